/* SPDX-License-Identifier: MIT */
/* Friction against Coulomb's law in closed form, tools of several spheres and pads, several tools
 * at once. */
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

typedef struct {
    palp_contact contact;
    palp_coupling coupling;
    palp_tool tool[PALP_CONTACT_TOOLS];
    palp_coupling_result result[PALP_CONTACT_TOOLS];
    void *memory;
} rig;

static void start(rig *r, const palp_blob *b, uint32_t tools, float stiffness) {
    const palp_contact_config config = {
        .blob = b, .tools = r->tool, .tool_count = tools, .finest = PALP_CONTACT_FINEST};
    size_t bytes = palp_contact_memsize(&config);
    r->memory = allocate_aligned(bytes, 1);
    palp_status status = palp_contact_init(&r->contact, &config, r->memory, bytes);
    if (status != PALP_OK) die(EXIT_WORK, "contact: %s", palp_status_text(status));
    r->coupling = (palp_coupling){.settling = 0};
    palp_coupling_reset(&r->coupling);
    for (uint32_t t = 0; t < tools; t++) r->coupling.tool[t].stiffness_N_per_m = stiffness;
}

static void tick(rig *r, const palp_vec3 *place) {
    palp_frame at[PALP_CONTACT_TOOLS], device[PALP_CONTACT_TOOLS];
    for (uint32_t t = 0; t < r->contact.tool_count; t++) device[t] = palp_frame_at(place[t]);
    palp_contact_spring spring[PALP_CONTACT_TOOLS];
    while (!palp_coupling_begin(&r->coupling, &r->contact, device)) {}
    palp_coupling_springs(&r->coupling, &r->contact, at, spring);
    palp_contact_solve(&r->contact, at, spring);
    palp_coupling_take(&r->coupling, &r->contact, 0.001f, r->result);
}

/* ---- friction ---- */

/* Tangential compliance along x of the patch as loaded now, by the dense matrix in double: each
 * point's force goes to the corners of its triangle. */
static double patch_compliance(const baked *b, const palp_contact *c) {
    double sum = 0, total = 0;
    const uint32_t nodes = b->blob.meta->nodes;
    double *load = allocate(nodes, sizeof *load);
    for (uint32_t a = 0; a < c->active_count; a++) {
        const palp_contact_point *p = &c->point[c->active[a]];
        total += (double)p->force_N;
        for (uint32_t k = 0; k < 3; k++)
            load[b->blob.triangle[3 * p->at.triangle + k]] +=
                (double)p->force_N * (double)p->at.weight[k];
    }
    for (uint32_t i = 0; i < nodes; i++) {
        for (uint32_t k = 0; k < nodes && load[i] > 0; k++) {
            if (load[k] > 0 && !palp_node_is_fixed(&b->blob, i) && !palp_node_is_fixed(&b->blob, k))
                sum += load[i] * load[k] * greens_row(&b->g, i, 0)[3 * k];
        }
    }
    free(load);
    return sum / (total * total);
}

/* A square block, face down. */
static palp_tool block(float friction) {
    return (palp_tool){.shape = PALP_TOOL_PAD,
                       .pad = {.axis = {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
                               .half_m = {0.22f, 0.22f},
                               .edge_m = 0.05f},
                       .friction = friction};
}

/* A block on a slope: a dead load that leans by `slope` (tangent). Returns how far the tool still
 * creeps per tick at the end, in units of load / k. */
static double block_on_slope(const baked *b, float friction, double slope, double *force_ratio) {
    rig r;
    const float k = 2e4f, weight = 15;
    r.tool[0] = block(friction);
    start(&r, &b->blob, 1, k);
    r.result[0].tool.t.x = 0.5f;
    palp_vec3 load = {0, 0, -weight}, device = {0.5f, 0.5f, 1.0005f};
    double before = 0;
    for (int i = 0; i <= 700; i++) {
        load.x = weight * (float)(slope * fmax(0, fmin((i - 200) / 100.0, 1)));
        tick(&r, &device);
        device = palp_madd(r.result[0].tool.t, 1 / k, load);
        if (i == 600) before = (double)r.result[0].tool.t.x;
    }
    *force_ratio = -(double)r.result[0].force_N.x / (double)r.result[0].force_N.z;
    double creep = ((double)r.result[0].tool.t.x - before) / 100;
    free(r.memory);
    return creep / (double)(weight / k);
}

static void test_slope(const baked *b) {
    for (int i = 0; i < 3; i++) {
        double mu = 0.2 * (i + 1), ratio;
        double creep = block_on_slope(b, (float)mu, 0.98 * mu, &ratio);
        AT_MOST(fabs(creep), 1e-5, "mu %g, slope 0.98 mu: the block stays, creep per tick", mu);
        AT_MOST(fabs(ratio / (0.98 * mu) - 1), 1e-3, "mu %g: and friction carries the slope", mu);
        creep = block_on_slope(b, (float)mu, 1.02 * mu, &ratio);
        AT_MOST(fabs(creep / (0.02 * mu) - 1), 0.02,
                "mu %g, slope 1.02 mu: the block slides, as fast as a dead load on a spring does",
                mu);
        AT_MOST(fabs(ratio / mu - 1), 5e-4, "mu %g: and friction is mu N while it slides", mu);
    }
}

/*
 * The device goes to and fro along x over a flat face. Exact for a spring of compliance A + 1/k in
 * series with Coulomb's element: dT = -dx / (A + 1/k) until |T| = mu N.
 */
static void test_stick_slip(const baked *b) {
    rig r;
    const float k = 2e4f, mu = 0.4f;
    r.tool[0] = block(mu);
    start(&r, &b->blob, 1, k);
    double exact = 0, worst = 0, most = 0, work = 0, exact_work = 0, last_x = 0.5, last_f = 0;
    double worst_ratio = 0, last_exact = 0;
    uint32_t slips = 0, sticks = 0;
    for (int i = 0; i < 1800; i++) {
        double phase = i < 200 ? 0 : (i - 200) / 400.0;
        double wave = 4 * fabs(phase + 0.25 - floor(phase + 0.25 + 0.5)) - 1; /* triangle, 0 at 0 */
        double x = 0.5 + 0.03 * wave;
        palp_vec3 device = {(float)x, 0.5f, 1 - 0.01f * (float)fmin(i / 150.0, 1)};
        tick(&r, &device);
        const palp_friction *f = &r.coupling.tool[0].friction;
        double force = (double)f->force_N.x;
        if (i >= 200) {
            double normal = (double)f->normal_N;
            exact -= (x - last_x) / (patch_compliance(b, &r.contact) + 1 / (double)k);
            exact = fmax(-(double)mu * normal, fmin((double)mu * normal, exact));
            worst = fmax(worst, fabs(force - exact));
            most = fmax(most, fabs(exact));
            worst_ratio = fmax(worst_ratio, fabs(force) / ((double)mu * normal));
            slips += f->slipping;
            sticks += !f->slipping;
            if (i >= 600) { /* whole cycles */
                work -= 0.5 * (force + last_f) * (x - last_x);
                exact_work -= 0.5 * (exact + last_exact) * (x - last_x);
            }
        } else {
            exact = force;
        }
        last_x = x;
        last_f = force;
        last_exact = exact;
    }
    CHECK(sticks > 300 && slips > 300, "to and fro: %u ticks of stick, %u of slip", sticks, slips);
    AT_MOST(worst / most, 0.08,
            "friction against the exact stick-slip loop, over its plateau of %.3g N", most);
    AT_MOST(fabs(work / exact_work - 1), 0.04,
            "work lost per cycle against the exact loop (%.3g J)", exact_work / 3);
    AT_MOST(worst_ratio, 1.00001, "friction never exceeds mu N");
    free(r.memory);
}

/* ---- shapes ---- */

static void test_gradients(void) {
    const float heights[12] = {0, 0.01f, 0.02f, 0, 0.03f, 0.05f, 0.02f, 0.01f, 0, 0, 0.04f, 0.02f};
    palp_tool tools[4] = {
        {.balls = 3,
         .ball = {{{0, 0, 0}, 0.2f}, {{0.15f, 0, 0.02f}, 0.15f}, {{-0.05f, 0.18f, 0}, 0.25f}}},
        {.shape = PALP_TOOL_PAD,
         .pad = {.axis = {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
                 .half_m = {0.3f, 0.2f},
                 .edge_m = 0.1f}},
        {.shape = PALP_TOOL_PAD,
         .pad = {.axis = {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
                 .half_m = {0.3f, 0.2f},
                 .edge_m = 0.1f,
                 .columns = 4,
                 .rows = 3,
                 .height_m = heights}},
        {.shape = PALP_TOOL_CYLINDER,
         .cylinder = {.axis = {0.6f, 0.8f, 0}, .radius_m = 0.2f, .half_m = 0.15f, .rim_m = 0.1f}}};
    static const char *const name[] = {"three balls", "a flat pad", "a height-field pad",
                                       "a cylinder"};
    for (int k = 0; k < 4; k++) {
        uint64_t seed = 5;
        double worst = 0, kink = 0;
        for (int i = 0; i < 4000; i++) {
            double n[3] = {0.3 * tap_random(&seed), 0.3 * tap_random(&seed), 1};
            v_normalize(n);
            palp_vec3 normal = {(float)n[0], (float)n[1], (float)n[2]}, x = {0};
            palp_vec3 c = {0.35f * (float)tap_random(&seed), 0.3f * (float)tap_random(&seed),
                           0.2f + 0.05f * (float)tap_random(&seed)};
            palp_frame place = palp_frame_at(c);
            palp_touch at = palp_tool_at(&tools[k], &place, x, normal);
            const float h = 2e-3f;
            for (int axis = 0; axis < 3; axis++) {
                palp_vec3 e = {axis == 0 ? h : 0, axis == 1 ? h : 0, axis == 2 ? h : 0};
                place.t = palp_add(c, e);
                palp_touch up = palp_tool_at(&tools[k], &place, x, normal);
                place.t = palp_sub(c, e);
                palp_touch down = palp_tool_at(&tools[k], &place, x, normal);
                double slope = -(double)(up.depth_m - down.depth_m) / (2 * (double)h);
                double push = axis == 0   ? (double)at.push.x
                              : axis == 1 ? (double)at.push.y
                                          : (double)at.push.z;
                worst = fmax(worst, fabs(slope - push));
                kink = fmax(kink, (double)palp_norm(palp_sub(up.push, down.push)));
            }
        }
        AT_MOST(worst, 0.06, "%s: the push is minus the gradient of the depth, everywhere",
                name[k]);
        AT_MOST(kink, 0.35, "%s: and it has no jumps, largest change over 4 mm", name[k]);
    }
    palp_tool bad = tools[1];
    bad.pad.axis[0].x = 2;
    CHECK(!palp_tool_is_sound(&bad), "a pad with skew axes is refused");
    bad = tools[3];
    bad.cylinder.axis.x = 2;
    CHECK(palp_tool_is_sound(&tools[3]) && !palp_tool_is_sound(&bad),
          "a cylinder needs a unit axis");
    bad = tools[0];
    bad.balls = PALP_TOOL_BALLS + 1;
    CHECK(!palp_tool_is_sound(&bad), "too many balls are refused");
}

/* Net energy of a tool that goes down, round and up again. */
static void test_loops(const baked *b) {
    const float heights[9] = {0, 0.02f, 0, 0.02f, 0.05f, 0.02f, 0, 0.02f, 0};
    palp_tool tools[3] = {{.balls = 2, .ball = {{{-0.2f, 0, 0.3f}, 0.3f}, {{0.2f, 0, 0.3f}, 0.3f}}},
                          {.shape = PALP_TOOL_PAD,
                           .pad = {.axis = {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
                                   .half_m = {0.35f, 0.25f},
                                   .edge_m = 0.2f}},
                          {.shape = PALP_TOOL_PAD,
                           .pad = {.axis = {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
                                   .half_m = {0.35f, 0.35f},
                                   .edge_m = 0.2f,
                                   .columns = 3,
                                   .rows = 3,
                                   .height_m = heights}}};
    static const char *const name[] = {"two balls", "a flat pad", "a height-field pad"};
    for (int k = 0; k < 3; k++) {
        rig r;
        r.tool[0] = tools[k];
        start(&r, &b->blob, 1, 3000);
        double absorbed = 0, stored = 0;
        uint32_t most = 0;
        palp_vec3 last_f = {0}, last_p = {0};
        const int steps = 6000;
        for (int i = 0; i <= steps; i++) {
            double a = 6.283185307179586 * i / steps, down = 0.12 * (1 - cos(a));
            double x = 0.25 * sin(a), y = 0.2 * sin(2 * a);
            palp_vec3 p = {(float)x, (float)y, (float)(sqrt(1 - x * x - y * y) + 0.08 - down)};
            tick(&r, &p);
            palp_vec3 f = r.result[0].force_N;
            if (i > 0) absorbed -= 0.5 * (double)palp_dot(palp_add(f, last_f), palp_sub(p, last_p));
            stored = fmax(stored, (double)r.result[0].energy_J);
            most = r.contact.active_count > most ? r.contact.active_count : most;
            last_f = f;
            last_p = p;
        }
        AT_MOST(fmax(-absorbed, 0) / stored, 3e-4,
                "%s on a ball, %u points: energy given on a closed path", name[k], most);
        CHECK(most >= 4, "%s: %u points in contact", name[k], most);
        free(r.memory);
    }
}

/* Two tools at once equal one tool of two balls on the same springs' positions: the body couples
 * them, and what one does to the other is reciprocal. */
static void test_two_tools(const baked *b) {
    rig r, one;
    r.tool[0] = r.tool[1] = palp_tool_sphere(0.3f);
    start(&r, &b->blob, 2, 1e6f);
    one.tool[0] = (palp_tool){.balls = 2, .ball = {{{-0.45f, 0, 0}, 0.3f}, {{0.45f, 0, 0}, 0.3f}}};
    start(&one, &b->blob, 1, 1e6f);
    palp_vec3 device[2] = {{-0.45f, 0, 0}, {0.45f, 0, 0}}, middle = {0};
    double alone = 0;
    for (int i = 0; i <= 300; i++) {
        float z = 0.89f + 0.3f - 0.08f * (float)i / 300;
        device[0].z = device[1].z = middle.z = z;
        if (i <= 300) {
            tick(&r, device);
            tick(&one, &middle);
        }
    }
    palp_vec3 sum = palp_add(r.result[0].force_N, r.result[1].force_N);
    double off = (double)palp_norm(palp_sub(sum, one.result[0].force_N)) /
                 (double)palp_norm(one.result[0].force_N);
    AT_MOST(off, 0.02, "two tools carry what one tool of two balls carries");
    /* Lifting one tool leaves the other pressing harder on its own. */
    double together = (double)r.result[0].force_N.z;
    for (int i = 0; i <= 200; i++) {
        device[1].z += 0.002f;
        tick(&r, device);
    }
    alone = (double)r.result[0].force_N.z;
    CHECK(alone > together * 1.001, "alone a tool meets %.4g N, with its neighbour %.4g N", alone,
          together);
    AT_MOST((double)palp_norm(r.result[1].force_N), 0, "and the lifted one feels nothing");
    free(r.memory);
    free(one.memory);
}

int main(void) {
    progress_quiet(1);
    test_gradients();
    baked box = model_bake(model_box(1, 10), 0, 0.0, false, false);
    test_slope(&box);
    test_stick_slip(&box);
    baked ball = model_bake(model_sphere(3), -0.7, 0.05, false, false);
    test_loops(&ball);
    test_two_tools(&ball);
    return tap_done();
}
