/* SPDX-License-Identifier: MIT */
/* The damper of the coupling: nothing across a smooth surface, no step at touch, never a pull, and
 * it takes energy. */
#include "core/haptic/coupling.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "tools/press/press.h"

#define DT_S 0.001f
#define RADIUS 0.3f
#define STIFFNESS 2000.0f

typedef struct {
    palp_contact *contact;
    palp_coupling coupling;
} hand;

static hand take(const baked *b, const palp_tool *tool, float damping) {
    hand h = {.contact = contact_open(&b->blob, tool, 1, 3)};
    palp_coupling_reset(&h.coupling);
    h.coupling.tool[0].stiffness_N_per_m = STIFFNESS;
    h.coupling.tool[0].damping_Ns_per_m = damping;
    return h;
}

static palp_coupling_result tick(hand *h, palp_vec3 place) {
    const palp_frame device = palp_frame_at(place);
    palp_frame tool;
    palp_contact_spring spring;
    palp_coupling_result r;
    if (!palp_coupling_begin(&h->coupling, h->contact, &device)) {
        palp_coupling_hold(&h->coupling, h->contact, DT_S, &r);
        return r;
    }
    palp_coupling_springs(&h->coupling, h->contact, &tool, &spring);
    palp_contact_solve(h->contact, &tool, &spring);
    palp_coupling_take(&h->coupling, h->contact, DT_S, &r);
    return r;
}

/* Above the middle of the box's top, so high. */
static palp_vec3 above(double aside, double high) {
    return (palp_vec3){(float)(0.5 + aside), 0.5f, (float)(1 + (double)RADIUS + high)};
}

static void settle(hand *h, double aside, double high) {
    for (int k = 0; k < 50; k++) (void)tick(h, above(aside, 0.1));
    for (int k = 0; k < 200; k++) (void)tick(h, above(aside, 0.1 + (high - 0.1) * k / 199));
}

/* Slides over the flat top: all of the force is upright. */
static void test_drag(const baked *b, const palp_tool *tool, double speed) {
    hand h = take(b, tool, 200);
    double drag = 0, least = HUGE_VAL;
    const double step = speed * (double)DT_S;
    settle(&h, -0.08, -0.05);
    for (int k = 0; - 0.08 + step * k < 0.08; k++) {
        const palp_vec3 f = tick(&h, above(-0.08 + step * k, -0.05)).force_N;
        least = fmin(least, (double)f.z);
        if (k > 0) drag = fmax(drag, fabs((double)f.x / (double)f.z));
    }
    AT_MOST(drag, 0.01, "slid without friction at %g mm/s: tangential over normal force",
            1000 * speed);
    CHECK(least > 1, "pressed by %.1f N at least", least);
    contact_close(h.contact);
}

/* Goes in and out at a speed. */
static void test_touch(const baked *b, const palp_tool *tool, double speed) {
    hand h = take(b, tool, 200), bare = take(b, tool, 0);
    const double step = speed * (double)DT_S;
    const int ticks = (int)(0.1 / step);
    double first = 0, ordinary = 0, pull = 0, last = 0, damped = 0, work = 0, bare_work = 0;
    settle(&h, 0, 0.05);
    settle(&bare, 0, 0.05);
    palp_vec3 before = {0}, plain_before = {0};
    double where = 0.05;
    for (int k = 0; k < 2 * ticks; k++) {
        const double high = 0.05 - step * (k < ticks ? k : 2 * ticks - k);
        const palp_vec3 f = tick(&h, above(0, high)).force_N;
        const palp_vec3 plain = tick(&bare, above(0, high)).force_N;
        const double change = fabs((double)(f.z - before.z));
        if (!(before.z > 0) && f.z > 0) first = change;
        if (before.z > 0 && f.z > 0 && k < ticks) ordinary = fmax(ordinary, change);
        if (before.z > 0 && !(f.z > 0)) last = (double)before.z;
        pull = fmax(pull, -(double)f.z);
        if (plain.z > 0.1f) damped = fmax(damped, fabs((double)((f.z - plain.z) / plain.z)));
        work += 0.5 * (double)(f.z + before.z) * (high - where);
        bare_work += 0.5 * (double)(plain.z + plain_before.z) * (high - where);
        where = high;
        plain_before = plain;
        before = f;
    }
    AT_MOST(first, 1.5 * ordinary, "touched at %g m/s: first step of the force, N", speed);
    AT_MOST(last, 1.5 * ordinary, "and the last one when it lets go, N");
    AT_MOST(pull, 0, "it never pulls, N");
    AT_MOST(damped, 0.52, "the damper over the spring's force");
    CHECK(work < -fabs(bare_work) - 1e-3,
          "in and out took %.3g J from the hand, without damping %.3g", -work, -bare_work);
    contact_close(h.contact);
    contact_close(bare.contact);
}

/* A velocity that was measured is the one that damps. */
static void test_measured(const baked *b, const palp_tool *tool) {
    hand h = take(b, tool, 200);
    settle(&h, 0, -0.05);
    const double still = (double)tick(&h, above(0, -0.05)).force_N.z;
    h.coupling.tool[0].measured = true;
    h.coupling.tool[0].velocity_m_s = (palp_vec3){0, 0, -0.01f};
    const double damped = (double)tick(&h, above(0, -0.05)).force_N.z;
    AT_MOST(fabs(damped - still - 2), 0.05, "200 Ns/m at a measured 0.01 m/s: 2 N more, off by");
    h.coupling.tool[0].velocity_m_s = (palp_vec3){0.01f, 0, 0};
    const palp_vec3 aside = tick(&h, above(0, -0.05)).force_N;
    AT_MOST(fabs((double)aside.x), 0.01 * still, "across, nothing: N");
    contact_close(h.contact);
}

int main(void) {
    progress_quiet(1);
    const baked box = model_bake(model_box(1, 8), 1e-6, 0, false, false);
    const palp_tool tool = palp_tool_sphere(RADIUS);
    static const double slow[] = {0.02, 0.1, 0.2, 0.5}, fast[] = {0.1, 0.5, 2};
    for (size_t k = 0; k < 4; k++) test_drag(&box, &tool, slow[k]);
    for (size_t k = 0; k < 3; k++) test_touch(&box, &tool, fast[k]);
    test_measured(&box, &tool);
    return tap_done();
}
