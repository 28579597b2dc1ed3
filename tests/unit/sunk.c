/* SPDX-License-Identifier: MIT */
/* Tools pressed deeper than they are thick, and thin ones at any place: they must not fall through. Against
 * Sneddon's solution for a rigid sphere on an elastic half space. */
#include "core/haptic/coupling.h"
#include "port/host/parallel.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/press/press.h"
#include <string.h>

#define SIZE 0.06 /* of the block, m */
#define YOUNG 4e4 /* model_bake_young's Poisson's ratio is 0.45 */
#define POISSON 0.45
#define SPRING 700.0f

/* One tool on its spring. */
typedef struct {
    palp_contact *contact;
    palp_coupling coupling;
    palp_coupling_result result;
} held;

static void take(held *h, const palp_blob *blob, const palp_tool *tool) {
    h->contact = contact_open(blob, tool, 1, PALP_CONTACT_FINEST);
    memset(&h->coupling, 0, sizeof h->coupling);
    palp_coupling_reset(&h->coupling);
    h->coupling.tool[0].stiffness_N_per_m = SPRING;
}

static void hold(held *h, palp_frame device) {
    palp_frame at;
    palp_contact_spring spring;
    while (!palp_coupling_begin(&h->coupling, h->contact, &device)) {}
    palp_coupling_springs(&h->coupling, h->contact, &at, &spring);
    palp_contact_solve(h->contact, &at, &spring);
    palp_coupling_take(&h->coupling, h->contact, 1e-3f, &h->result);
}

/* F(d) of a rigid sphere without friction: d = a/2 ln((R+a)/(R-a)),
 * F = E* ((a^2+R^2)/2 ln((R+a)/(R-a)) - a R). */
static double sneddon(double radius, double depth) {
    const double modulus = YOUNG / (1 - POISSON * POISSON);
    double low = 0, high = 1 - 1e-12;
    for (int i = 0; i < 100; i++) {
        const double a = 0.5 * (low + high);
        *(0.5 * a * log((1 + a) / (1 - a)) * radius < depth ? &low : &high) = a;
    }
    const double a = low;
    return modulus * radius * radius * (0.5 * (a * a + 1) * log((1 + a) / (1 - a)) - a);
}

/* Against the law as far as small strains mean anything, and on from there: never weaker by more than
 * `least`. The block's free sides and fixed bottom are near: they are the law's own error. */
static void test_sphere(const palp_blob *blob, float radius) {
    const palp_tool tool = palp_tool_sphere(radius);
    held h;
    double off = 0, weakest = 10, depth = 0;
    take(&h, blob, &tool);
    for (int i = 0; i < 15000 && depth < 2.5; i++) {
        const float z = (float)SIZE + radius - 6e-6f * (float)i;
        hold(&h, palp_frame_at((palp_vec3){0.031f, 0.0295f, z}));
        depth = ((double)radius + SIZE - (double)h.result.tool.t.z) / (double)radius;
        if (depth < 0.15) continue;
        const double ratio =
            (double)h.result.force_N.z / sneddon((double)radius, depth * (double)radius);
        if (depth < 1.2) off = fmax(off, fabs(ratio - 1));
        weakest = fmin(weakest, ratio);
        if (getenv("SHOW") != NULL && i % 150 == 0) printf("# %.3f R: %.3f\n", depth, ratio);
    }
    AT_MOST(off, 0.12, "a ball of %.1f edges to 1.2 radii: off Sneddon's law",
            (double)(radius / blob->meta->mean_edge_m));
    CHECK(depth >= 2.5 && weakest > 0.88, "and to %.1f radii never softer: %.2f of it", depth,
          weakest);
    contact_close(h.contact);
}

/* Turns z towards x by so much. */
static palp_frame tilted(palp_vec3 at, float degrees) {
    palp_frame f = palp_frame_at(at);
    const float c = cosf(degrees * 0.0174533f), s = sinf(degrees * 0.0174533f);
    const float r[9] = {c, 0, s, 0, 1, 0, -s, 0, c};
    memcpy(f.r, r, sizeof r);
    return f;
}

/* A tool whose lowest place is `below` its middle goes down by `depth` and up again: it is felt all the
 * way, without a step, and takes more than it gives. */
static void go_deep(const palp_blob *blob, const char *name, palp_tool tool, float degrees,
                    float below, float depth) {
    const int ticks = 3000;
    held h;
    palp_vec3 before = {0}, was = {0};
    double step = 0, largest = 0, work = 0, most = 0, dip = 0;
    take(&h, blob, &tool);
    for (int i = 0; i <= 2 * ticks; i++) {
        const float down = depth * (float)(i <= ticks ? i : 2 * ticks - i) / (float)ticks;
        const palp_vec3 at = {0.031f, 0.0295f, (float)SIZE + below - down};
        hold(&h, tilted(at, degrees));
        const palp_vec3 f = h.result.force_N;
        if (i > 0) {
            step = fmax(step, (double)palp_norm(palp_sub(f, before)));
            work -= 0.5 * (double)palp_dot(palp_add(f, before), palp_sub(at, was));
        }
        largest = fmax(largest, (double)f.z);
        if (i <= ticks) dip = fmax(dip, largest - (double)f.z);
        most = fmax(most, work);
        before = f;
        was = at;
    }
    CHECK(largest > 0, "%s, %g degrees, %.3g mm down: up to %.3f N", name, (double)degrees,
          (double)depth * 1e3, largest);
    AT_MOST(step / largest, 0.04, "largest step over the largest force");
    AT_MOST(dip / largest, 0.05, "how far the force falls on the way down, over the largest");
    AT_MOST(fmax(-work, 0) / most, 0.01, "work won over what was put in");
    contact_close(h.contact);
}

/* Thin tools go down at any place and tilt, fast: all are felt. */
static void test_found(const palp_blob *blob, float radius, uint32_t tries) {
    uint32_t lost = 0;
    uint64_t seed = 3;
    double worst = 0;
    for (uint32_t n = 0; n < tries; n++) {
        const float half = radius * (float)(3 + 2 * tap_random(&seed));
        const float degrees = (float)(45 + 45 * tap_random(&seed));
        const palp_tool tool = palp_tool_capsule((palp_vec3){0, 0, 1}, half, radius);
        const float below = radius + half * fabsf(cosf(degrees * 0.0174533f));
        const palp_vec3 from = {(float)(0.03 + 0.015 * tap_random(&seed)),
                                (float)(0.03 + 0.015 * tap_random(&seed)), (float)SIZE + below};
        held h;
        take(&h, blob, &tool);
        double first = 0, last = 0;
        for (int i = -20; i < 100; i++) {
            const palp_vec3 at = {from.x, from.y, from.z - 5e-5f * (float)i};
            hold(&h, tilted(at, degrees));
            last = (double)h.result.force_N.z;
            if (!(first > 0)) first = last;
        }
        worst = fmax(worst, first / fmax(last, 1e-9));
        lost += last > 0.02 ? 0 : 1;
        contact_close(h.contact);
    }
    CHECK(lost == 0, "%u capsules of %.2f edges at any place and tilt: %u not felt 5 mm down",
          tries, (double)(radius / blob->meta->mean_edge_m), lost);
    AT_MOST(worst, 0.1, "found when they touch: first force over that");
}

int main(void) {
    progress_quiet(1);
    const baked block = model_bake_young(model_box(SIZE, 10), 1e-6, YOUNG);
    const palp_blob *b = &block.blob;
    const palp_vec3 z = {0, 0, 1};
    palp_tool flat = palp_tool_capsule(z, 0.008f, 0.005f);
    flat.cylinder.rim_m = 0.00125f;
    test_sphere(b, 0.006f);
    test_sphere(b, 0.009f);
    go_deep(b, "ball", palp_tool_sphere(0.005f), 0, 0.005f, 0.02f);
    go_deep(b, "small ball", palp_tool_sphere(0.003f), 0, 0.003f, 0.012f);
    go_deep(b, "capsule", palp_tool_capsule(z, 0.01f, 0.004f), 0, 0.014f, 0.02f);
    go_deep(b, "capsule", palp_tool_capsule(z, 0.01f, 0.004f), 90, 0.004f, 0.02f);
    go_deep(b, "capsule", palp_tool_capsule(z, 0.01f, 0.004f), 40, 0.0117f, 0.02f);
    go_deep(b, "cylinder", flat, 0, 0.00925f, 0.02f);
    go_deep(b, "cylinder", flat, 90, 0.005f, 0.02f);
    test_found(b, 0.002f, 60);
    test_found(b, 0.004f, 60);
    return tap_done();
}
