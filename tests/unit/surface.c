/* SPDX-License-Identifier: MIT */
/* Contact on the surface: against Hertz, a dense problem in double, differences of the energy, and
 * under disturbance in virtual time. */
#include "core/contact/cost.h"
#include "core/contact/loads.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/solver/nodal.h"
#include "port/host/parallel.h"
#include "tools/press/press.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

/* A direction in the upper half. */
static void direction(uint64_t *seed, double d[3]) {
    do {
        for (int k = 0; k < 3; k++) d[k] = tap_random(seed);
    } while (v_norm(d) > 1 || v_norm(d) < 0.1);
    d[2] = fabs(d[2]);
    v_normalize(d);
}

static palp_vec3 times(const double d[3], double s) {
    return (palp_vec3){(float)(d[0] * s), (float)(d[1] * s), (float)(d[2] * s)};
}

/* ---- the data in the blob ---- */

/* B and the modes together are G, block by block, between free nodes. */
static void test_split(const baked *b) {
    const half_space_material material = {(double)b->blob.meta->young_Pa,
                                          (double)b->blob.meta->poisson};
    half_space *infinite = half_space_build(&b->m, b->normal, b->g.averaged);
    const palp_regular *g = &b->blob.regular;
    double off = 0, all = 0, own = 0;
    for (uint32_t i = 0; i < b->m.vertices; i += 3) {
        for (uint32_t j = 0; j < b->m.vertices; j += 3) {
            if (b->fixed[i] != 0 || b->fixed[j] != 0) continue;
            double block[9], self = 0, wrong = 0;
            half_space_block(infinite, material, i, j, block);
            for (size_t e = 0; e < 9; e++) {
                double sum = block[e];
                for (size_t a = 0; a < g->modes; a++)
                    sum += (double)g->value[a] * g->vector[(3 * i + e / 3) * g->modes + a] *
                           g->vector[(3 * j + e % 3) * g->modes + a] /
                           ((double)PALP_MODE_UNIT * (double)PALP_MODE_UNIT);
                double exact = greens_row(&b->g, i, e / 3)[3 * j + e % 3];
                off += (sum - exact) * (sum - exact);
                all += exact * exact;
                wrong += (sum - exact) * (sum - exact);
                self += exact * exact;
            }
            if (i == j) own = fmax(own, sqrt(wrong / self));
        }
    }
    half_space_free(infinite);
    AT_MOST(sqrt(off / all), 0.03, "half-space and %u modes against G, %u nodes", g->modes,
            b->m.vertices);
    AT_MOST(own, 0.2, "worst own block of a node");
}

static void test_across(const baked *b) {
    uint32_t *across = mesh_across(&b->m);
    bool mutual = true;
    for (uint32_t t = 0; t < b->m.triangles; t++) {
        for (uint32_t k = 0; k < 3; k++) {
            uint32_t other = across[3 * t + k];
            bool back = false;
            for (uint32_t q = 0; q < 3; q++) back = back || across[3 * other + q] == t;
            mutual = mutual && back;
        }
    }
    CHECK(mutual, "each triangle lies across from those across from it");
    free(across);
}

/* ---- forces ---- */

static void test_hertz(const baked *b) {
    static const double size[] = {0.1, 0.2, 0.4, 0.8}, mean_goal[] = {5, 3, 3, 3},
                        spread_goal[] = {9, 3, 3, 3};
    const palp_meta *m = b->blob.meta;
    double edge = (double)m->mean_edge_m, nu = (double)m->poisson;
    double stiff = (double)m->young_Pa / (1 - nu * nu);
    uint64_t seed = 5;
    for (size_t s = 0; s < 4; s++) {
        double sum = 0, square = 0, aside = 0;
        const int places = 20;
        for (int i = 0; i < places; i++) {
            double d[3], a = size[s] * edge, radius = a / 0.3, rho = radius / (1 + radius);
            double depth = a * a / rho, force = 0, h = 0;
            direction(&seed, d);
            palp_tool tool = palp_tool_sphere((float)radius);
            palp_contact *c = contact_open(&b->blob, &tool, 1, PALP_CONTACT_FINEST);
            palp_vec3 at = times(d, 1 + radius - depth);
            press_hold(c, at, 8);
            palp_surface_point p = c->point[0].at;
            float row[PALP_MAX_MODES];
            uint32_t crossings = 64;
            CHECK(palp_surface_shoot(c->surface, at, times(d, -1), &crossings, &p) || i > 0,
                  "the surface is met below the tool");
            palp_surface_modes(c->surface, &p, times(d, 1), m->modes, row, 1);
            for (uint32_t k = 0; k < m->modes; k++)
                h += (double)(b->blob.regular.value[k] * row[k] * row[k]);
            for (int it = 0; it < 80; it++) /* depth = Hertz' own and what the ball gives */
                force = 0.5 * force +
                        0.5 * 4 / 3 * stiff * sqrt(rho) * pow(fmax(depth - force * h, 0), 1.5);
            double error = (double)palp_norm(c->force_N[0]) / force - 1;
            sum += error;
            square += error * error;
            double along = (double)palp_dot(c->force_N[0], times(d, 1));
            aside = fmax(aside, acos(fmin(along / (double)palp_norm(c->force_N[0]), 1)));
            contact_close(c);
        }
        double mean = sum / places;
        AT_MOST(fabs(100 * mean), mean_goal[s],
                "%u nodes, contact radius %g edges: mean off Hertz in %%", m->nodes, size[s]);
        AT_MOST(100 * sqrt(square / places - mean * mean), spread_goal[s], "spread in %%");
        AT_MOST(aside * 57.3, 1, "direction in degrees");
    }
}

/* Against all nodes under a tool of several edges. At small depths few of them are touched, and the
 * reference has the mesh's rhythm itself. */
static void test_dense(const baked *b) {
    static const double depth[] = {0.05, 0.1, 0.2};
    double radius = 6 * (double)b->blob.meta->mean_edge_m;
    uint64_t seed = 11;
    for (size_t s = 0; s < 3; s++) {
        double d[3], worst = 0;
        for (int i = 0; i < 3; i++) {
            direction(&seed, d);
            palp_tool tool = palp_tool_sphere((float)radius);
            palp_contact *c = contact_open(&b->blob, &tool, 1, PALP_CONTACT_FINEST);
            palp_vec3 at = times(d, 1 + radius * (1 - depth[s]));
            const double center[3] = {(double)at.x, (double)at.y, (double)at.z};
            press_hold(c, at, 10);
            const nodal_press all = nodal_hold(&b->blob, center, radius);
            CHECK(all.settled, "%u nodes near, %u touch", all.near, all.touched);
            worst = fmax(worst, fabs((double)palp_norm(c->force_N[0]) / v_norm(all.force_N) - 1));
            contact_close(c);
        }
        AT_MOST(100 * worst, s == 0 ? 12 : 5,
                "tool of 6 edges, depth %g R: off all nodes in true geometry, in %%", depth[s]);
    }
}

/* The force is the gradient of the energy, whatever the tool's shape. */
static void test_gradient(const baked *b) {
    float e = b->blob.meta->mean_edge_m;
    palp_tool tool[4] = {palp_tool_sphere(2 * e),
                         palp_tool_sphere(e),
                         palp_tool_sphere(e),
                         {.shape = PALP_TOOL_CYLINDER}};
    static const char *const name[] = {"sphere of 2 edges", "sphere of 1 edge", "three balls",
                                       "cylinder"};
    tool[2].balls = 3;
    for (uint32_t k = 1; k < 3; k++)
        tool[2].ball[k] = (palp_ball){{(k == 1 ? 1.0f : -1.0f) * 1.2f * e, 0, 0}, e};
    tool[3].cylinder = (palp_cylinder){
        .axis = {1, 0, 0}, .radius_m = 1.5f * e, .half_m = 2.0f * e, .rim_m = 0.7f * e};
    for (size_t s = 0; s < 4; s++) {
        palp_contact *c = contact_open(&b->blob, &tool[s], 1, PALP_CONTACT_FINEST);
        float size = palp_tool_size(&tool[s]), step = 0.01f * size;
        palp_vec3 at = {0.05f, -0.02f, 1.0f + 0.85f * (s == 3 ? 1.5f * e : size)}, gradient = {0};
        press_hold(c, at, 30);
        palp_vec3 force = c->force_N[0];
        float *axis[3] = {&gradient.x, &gradient.y, &gradient.z};
        for (int k = 0; k < 3; k++) {
            float energy[2];
            for (int side = 0; side < 2; side++) {
                palp_vec3 moved = at;
                float *x[3] = {&moved.x, &moved.y, &moved.z};
                *x[k] += side == 0 ? -step : step;
                press_hold(c, moved, 30);
                energy[side] = c->energy_J;
            }
            *axis[k] = -(energy[1] - energy[0]) / (2 * step);
        }
        double off = (double)(palp_norm(palp_sub(gradient, force)) / palp_norm(force));
        AT_MOST(off, s < 2 ? 2e-3 : 3e-2, "%s: force against differences of the energy", name[s]);
        contact_close(c);
    }
}

static void test_levels(const baked *b) {
    double e = (double)b->blob.meta->mean_edge_m;
    uint64_t seed = 3;
    for (uint32_t l = 0; l + 1 < PALP_CONTACT_LEVELS; l++) {
        double worst = 0;
        for (int i = 0; i < 12; i++) {
            double d[3], radius = (1 + i % 4) * e;
            direction(&seed, d);
            palp_tool tool = palp_tool_sphere((float)radius);
            palp_contact *c = contact_open(&b->blob, &tool, 1, PALP_CONTACT_FINEST);
            palp_vec3 at = times(d, 1 + 0.9 * radius);
            c->now = PALP_CONTACT_LEVELS - 1u;
            press_hold(c, at, 8);
            palp_vec3 fine = c->force_N[0];
            c->now = l;
            press_hold(c, at, 8);
            worst =
                fmax(worst, (double)(palp_norm(palp_sub(fine, c->force_N[0])) / palp_norm(fine)));
            contact_close(c);
        }
        AT_MOST(100 * worst, l < 3 ? 6 : 3, "level %u against %u, worst of 12, in %%", l,
                PALP_CONTACT_LEVELS - 1u);
    }
}

/* ---- the answer in virtual time ---- */

typedef struct {
    palp_answer answer;
    palp_tool tool;
    uint64_t base_ns, base_work;
    uint32_t looks, leap_at;
    uint64_t leap_ns;
    double ns_per_operation;
} hand;

static uint64_t virtual_ns(void *context) {
    hand *h = context;
    if (h->leap_at > 0 && ++h->looks == h->leap_at) h->base_ns += h->leap_ns;
    double work = (double)(h->answer.contact.work_done - h->base_work);
    return h->base_ns + (uint64_t)(work * h->ns_per_operation);
}

static palp_status open_hand(hand *h, const palp_blob *b, double ns_per_operation, float friction) {
    *h = (hand){.ns_per_operation = ns_per_operation};
    h->tool = palp_tool_sphere(2 * b->meta->mean_edge_m);
    h->tool.friction = friction;
    const palp_answer_config config = {
        .contact = {.blob = b, .tools = &h->tool, .tool_count = 1, .finest = PALP_CONTACT_FINEST},
        .cost = {&palp_target_counted, (float)ns_per_operation, 0, 0.8f},
        .port = {virtual_ns, h},
        .dt_s = 1e-3f};
    const size_t bytes = palp_answer_memsize(&config.contact);
    palp_status status =
        palp_answer_init(&h->answer, &config, allocate_aligned(bytes, 1), bytes, NULL);
    if (status == PALP_OK) h->answer.coupling.tool[0].stiffness_N_per_m = 5000;
    return status;
}

static palp_coupling_result tick(hand *h, palp_vec3 device, palp_answer_report *r) {
    palp_coupling_result result;
    palp_answer_report unused;
    h->looks = 0;
    h->base_work = h->answer.contact.work_done;
    const palp_frame at = palp_frame_at(device);
    palp_answer_tick(&h->answer, virtual_ns(h), &at, &result, r != NULL ? r : &unused);
    h->base_ns += 1000000;
    return result;
}

/* Above the pole, sunk by that share of the tool's radius. */
static palp_vec3 above(const hand *h, float sunk) {
    float radius = h->tool.ball[0].radius_m;
    return (palp_vec3){0.03f, 0.01f, 1.0f + radius * (1.0f - sunk)};
}

static void test_answer(const palp_blob *b) {
    hand h;
    palp_answer_report r;
    CHECK(open_hand(&h, b, 0.5, 0) == PALP_OK, "the answer opens");
    palp_vec3 force = {0};
    for (int i = 0; i < 200; i++) force = tick(&h, above(&h, -0.1f), NULL).force_N;
    CHECK(!(palp_norm(force) > 0), "nothing is felt beside the body");
    for (int i = 0; i < 400; i++) force = tick(&h, above(&h, (float)i / 1000.0f), &r).force_N;
    CHECK(palp_norm(force) > 1.0f && r.level == PALP_CONTACT_FINEST && !r.held,
          "pressed, on the finest level");
    for (int i = 0; i < 100; i++) force = tick(&h, above(&h, 0.4f), NULL).force_N;
    double off = 0;
    bool all_held = true;
    for (uint32_t at = 2; at < 5; at++) { /* before, in the middle, and at the end of the work */
        h.leap_at = at;
        h.leap_ns = 3000000;
        off = fmax(off, (double)palp_norm(palp_sub(tick(&h, above(&h, 0.4f), &r).force_N, force)));
        all_held = all_held && r.level == PALP_CONTACT_FINEST;
        h.leap_at = 0;
        for (int i = 0; i < 20; i++) {
            palp_vec3 now = tick(&h, above(&h, 0.4f), &r).force_N;
            off = fmax(off, (double)palp_norm(palp_sub(now, force)));
        }
    }
    AT_MOST(off / (double)palp_norm(force), 1e-3,
            "three stalls of 3 ms at rest: largest change of force");
    CHECK(all_held && h.answer.coarsened == 0, "no stall changes the level");
    for (int i = 0; i < 100; i++) { /* always late: the level gives way */
        h.leap_at = 2;
        h.leap_ns = 550000;
        (void)tick(&h, above(&h, 0.4f), &r);
    }
    CHECK(r.level < PALP_CONTACT_FINEST && h.answer.coarsened > 0,
          "lasting lack of time does: level %u", r.level);
    h.leap_at = 0;
    double step = 0;
    palp_vec3 before = tick(&h, above(&h, 0.4f), NULL).force_N;
    for (int i = 0; i < 4000; i++) {
        palp_vec3 now = tick(&h, above(&h, 0.4f), &r).force_N;
        step = fmax(step, (double)palp_norm(palp_sub(now, before)));
        before = now;
    }
    CHECK(r.level == PALP_CONTACT_FINEST, "and comes back");
    AT_MOST((double)(palp_norm(palp_sub(before, force)) / palp_norm(force)), 0.01,
            "to the same force");
    AT_MOST(step / (double)palp_norm(force), 0.01, "without a step");
    hand jumped;
    (void)open_hand(&jumped, b, 0.5, 0);
    for (int i = 0; i < 20; i++) (void)tick(&jumped, above(&jumped, -0.5f), NULL);
    palp_vec3 now = {0};
    for (int i = 0; i < 100; i++) now = tick(&jumped, above(&jumped, 0.4f), NULL).force_N;
    AT_MOST((double)(palp_norm(palp_sub(now, force)) / palp_norm(force)), 0.01,
            "a jump into the body comes to the force of a slow press");
    CHECK(open_hand(&jumped, b, 50, 0) == PALP_ERR_BUDGET,
          "a controller that is too slow is refused");
}

/* Dragged sideways: sticks first, then slides with mu N. */
static void test_friction(const palp_blob *b) {
    hand h;
    if (open_hand(&h, b, 0.1, 0.3f) != PALP_OK) die(EXIT_WORK, "the answer does not open");
    float radius = h.tool.ball[0].radius_m;
    palp_vec3 at = above(&h, 0.4f);
    for (int i = 0; i < 200; i++) (void)tick(&h, at, NULL);
    const palp_friction *f = &h.answer.coupling.tool[0].friction;
    bool stuck = true, slid = false;
    double beyond = 0, kinetic = 0;
    for (int i = 0; i < 600; i++) {
        at.x += 0.001f * radius;
        (void)tick(&h, at, NULL);
        double share = (double)palp_norm(f->force_N) / (0.3 * (double)h.answer.contact.normal_N[0]);
        if (i < 5) stuck = stuck && !f->slipping;
        slid = slid || f->slipping;
        beyond = fmax(beyond, share - 1);
        if (i > 400) kinetic = fmax(kinetic, fabs(share - 1));
    }
    CHECK(stuck && slid, "a dragged tool sticks, then slides");
    AT_MOST(beyond, 1e-3, "never more than mu N");
    AT_MOST(kinetic, 0.01, "mu N while it slides");
}

static void test_two_tools(const baked *b) {
    float e = b->blob.meta->mean_edge_m;
    palp_tool tool[2] = {palp_tool_sphere(2 * e), palp_tool_sphere(2 * e)};
    palp_contact *c = contact_open(&b->blob, tool, 2, PALP_CONTACT_FINEST);
    const palp_frame at[2] = {palp_frame_at((palp_vec3){0, 0, 1 + 1.7f * e}),
                              palp_frame_at((palp_vec3){1 + 1.7f * e, 0, 0.2f})};
    const palp_contact_spring held[2] = {{.held = at[0]}, {.held = at[1]}};
    for (int i = 0; i < 10; i++) palp_contact_solve(c, at, held);
    float both = c->normal_N[0];
    palp_contact *one = contact_open(&b->blob, tool, 1, PALP_CONTACT_FINEST);
    press_hold(one, at[0].t, 10);
    AT_MOST(fabs((double)(both / one->normal_N[0]) - 1), 0.05,
            "a second tool far away changes little");
    CHECK(c->normal_N[1] > 0.0f, "and presses as well");
    contact_close(c);
    contact_close(one);
}

static palp_vec3 sum_of_loads(const palp_contact *c) {
    palp_load load[512];
    palp_vec3 sum = {0};
    palp_load_list list = {.load = load, .capacity = 512};
    palp_contact_loads(c, 0, 0, (palp_vec3){0}, &list);
    for (uint32_t i = 0; i < list.count; i++) sum = palp_add(sum, load[i].force_N);
    return sum;
}

/* What is displayed balances the force on the tool, also after ticks that were given up. */
static void test_loads(const baked *b) {
    float e = b->blob.meta->mean_edge_m;
    palp_tool tool = palp_tool_sphere(2 * e);
    palp_contact *c = contact_open(&b->blob, &tool, 1, PALP_CONTACT_FINEST);
    const palp_vec3 at = {0, 0, 1 + 1.7f * e};
    press_hold(c, at, 10);
    const palp_vec3 pushed = palp_sub(c->force_N[0], c->beyond_N[0]);
    const double off = (double)(palp_norm(palp_add(sum_of_loads(c), pushed)) / palp_norm(pushed));
    AT_MOST(off, 1e-5, "loads on nodes balance the force on the tool");
    double changed = 0;
    for (uint32_t stop = 0; stop < 3; stop++) {
        const palp_frame next =
            palp_frame_at((palp_vec3){0.3f * e, 0, 1 + (1.6f - 0.1f * (float)stop) * e});
        const palp_contact_spring held = {.held = next};
        palp_contact_begin(c, &next, &held);
        while (stop > 0 && palp_contact_fill(c)) {}
        if (stop > 0) palp_contact_points(c);
        while (stop > 1 && palp_contact_assemble(c)) {}
        if (stop > 1) (void)palp_contact_iterate(c);
        double now = (double)(palp_norm(palp_add(sum_of_loads(c), pushed)) / palp_norm(pushed));
        changed = fmax(changed, now);
    }
    AT_MOST(changed, 1e-5, "also after ticks that were given up");
    contact_close(c);
}

static void test_errors(const baked *b) {
    palp_tool tool = palp_tool_sphere(0.2f), bad = palp_tool_sphere(-1);
    palp_contact c;
    const palp_contact_config good = {
        .blob = &b->blob, .tools = &tool, .tool_count = 1, .finest = PALP_CONTACT_FINEST};
    palp_contact_config config = good;
    size_t bytes = palp_contact_memsize(&good);
    uint8_t *memory = allocate_aligned(bytes + 64, 1);
    palp_blob plain = b->blob;
    plain.regular = (palp_regular){.modes = 0};
    config.blob = &plain;
    CHECK(palp_contact_init(&c, &config, memory, bytes) == PALP_ERR_ABSENT,
          "a body without modes cannot be touched");
    config = good;
    config.tools = &bad;
    CHECK(palp_contact_init(&c, &config, memory, bytes) == PALP_ERR_ARGUMENT, "an unsound tool");
    config = good;
    config.tool_count = 0;
    CHECK(palp_contact_init(&c, &config, memory, bytes) == PALP_ERR_ARGUMENT, "no tool");
    config = good;
    config.finest = PALP_CONTACT_LEVELS;
    CHECK(palp_contact_init(&c, &config, memory, bytes) == PALP_ERR_LIMITS, "no such level");
    CHECK(palp_contact_init(&c, &good, memory, bytes - 1) == PALP_ERR_MEMORY, "too little memory");
    CHECK(palp_contact_init(&c, &good, memory + 4, bytes) == PALP_ERR_ALIGNMENT, "odd memory");
    free(memory);
}

/* Work that outgrows its stage neither spins nor is shown beyond all of it. */
static void test_progress(void) {
    double start = now_s();
    progress_quiet(0);
    progress_begin("a stage told less than it does", 1);
    for (int i = 0; i < 1000; i++) progress_add(1e15);
    progress_end();
    progress_begin("a stage of unknown length", 0);
    progress_add(1e300);
    progress_end();
    progress_quiet(1);
    AT_MOST(now_s() - start, 1, "progress beyond its total, in s");
}

/* A triangle of the node nearest to x, to begin a shot on. */
static uint32_t nearest_triangle(const palp_blob *b, palp_vec3 x) {
    uint32_t nearest = 0;
    float least = INFINITY;
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        palp_vec3 d = palp_sub(palp_vec3_at(b->rest_m + 3 * i), x);
        if (palp_dot(d, d) >= least) continue;
        least = palp_dot(d, d);
        nearest = i;
    }
    return b->regular.triangle[nearest];
}

/* The same press on two resolutions of one body, each as deep below its own surface. */
static void test_resolutions(const baked *coarse, const baked *fine) {
    const double edge = (double)fine->blob.meta->mean_edge_m;
    for (int s = 0; s < 3; s++) {
        const double radius = edge * (2 << s) / 2;
        const palp_tool tool = palp_tool_sphere((float)radius);
        for (int deep = 0; deep < 3; deep++) {
            const double depth = 0.1 * (1 << deep) * radius;
            double mean = 0, worst = 0, turned = 0;
            uint64_t seed = 11;
            for (int i = 0; i < 15; i++) {
                const baked *body[2] = {coarse, fine};
                palp_vec3 force[2];
                double d[3];
                direction(&seed, d);
                for (int k = 0; k < 2; k++) {
                    palp_contact *c = contact_open(&body[k]->blob, &tool, 1, PALP_CONTACT_FINEST);
                    palp_surface_point p = {.triangle =
                                                nearest_triangle(&body[k]->blob, times(d, 1))};
                    uint32_t crossings = 64;
                    (void)palp_surface_shoot(c->surface, times(d, 2), times(d, -1), &crossings, &p);
                    press_hold(c, palp_madd(p.y, (float)(radius - depth), times(d, 1)), 10);
                    force[k] = c->force_N[0];
                }
                double a = (double)palp_norm(force[0]), b = (double)palp_norm(force[1]);
                mean += (a / b - 1) / 15;
                worst = fmax(worst, fabs(a / b - 1));
                turned =
                    fmax(turned, acos(fmin((double)palp_dot(force[0], force[1]) / (a * b), 1)));
            }
            AT_MOST(
                100 * fabs(mean), 9,
                "%u and %u nodes, tool of %g fine edges, %g R deep: forces apart in the mean, %%",
                coarse->blob.meta->nodes, fine->blob.meta->nodes, radius / edge, depth / radius);
            AT_MOST(100 * worst, 16, "at worst, %%");
            AT_MOST(turned * 57.3, 1, "directions apart, degrees");
        }
    }
}

/* A soft body is pressed deeper than the tool's radius and let go again: the force goes up and down
 * without a step, and no work is won. */
static void test_deep(const baked *b) {
    const float radius = 1.2f * b->blob.meta->mean_edge_m, stiffness = 2000;
    const palp_tool tool = palp_tool_sphere(radius);
    palp_contact *c = contact_open(&b->blob, &tool, 1, PALP_CONTACT_FINEST);
    palp_coupling k = {.settling = 0};
    const int ticks = 1200;
    double jump = 0, largest = 0, work = 0, stored = 0;
    palp_vec3 before = {0}, was = {0};
    palp_coupling_reset(&k);
    k.tool[0].stiffness_N_per_m = stiffness;
    for (int i = 0; i <= 2 * ticks; i++) {
        float sunk = 1.2f * radius * (float)(i <= ticks ? i : 2 * ticks - i) / (float)ticks;
        const palp_frame device = palp_frame_at((palp_vec3){0.1f, 0.05f, 1.0f + radius - sunk});
        palp_frame at;
        palp_contact_spring spring;
        palp_coupling_result r;
        while (!palp_coupling_begin(&k, c, &device)) {}
        palp_coupling_springs(&k, c, &at, &spring);
        palp_contact_solve(c, &at, &spring);
        palp_coupling_take(&k, c, 1e-3f, &r);
        if (i > 0) {
            jump = fmax(jump, (double)palp_norm(palp_sub(r.force_N, before)));
            work += 0.5 * (double)palp_dot(palp_add(r.force_N, before), palp_sub(device.t, was));
        }
        largest = fmax(largest, (double)palp_norm(r.force_N));
        stored = fmax(stored, (double)r.energy_J);
        before = r.force_N;
        was = device.t;
    }
    AT_MOST(jump / largest, 0.01, "pressed %g radii deep and let go: largest step over the force",
            1.2);
    AT_MOST(fmax(work, 0) / stored, 1e-3, "work won over what was stored");
}

/* No filling does more of anything than its bound counts (contact/cost.h), on whatever level the
 * tick before was. */
static void test_most_filled(const palp_blob *b, palp_tool tool, double reach, const char *name) {
    const palp_prices *price = &palp_target_counted.instructions;
    palp_contact_cost cost = palp_contact_cost_of(b, &tool, 1, price);
    cost.finest = PALP_CONTACT_LEVELS - 1u;
    palp_contact *c = contact_open(b, &tool, 1, 0);
    const palp_contact_spring free = {.stiffness_N_per_m = 0};
    palp_vec3 at = {.x = 0};
    uint64_t seed = 21;
    uint32_t beyond = 0, filled = 0;
    double nearest = 0;
    for (int k = 0; k < 6000; k++) {
        if (k % 5 == 0) c->now = (uint32_t)(2.5 * (tap_random(&seed) + 1));
        const double far = k % 40 == 0 ? 1 : 0.03; /* leaps, else steps */
        palp_vec3 by = times((double[3]){tap_random(&seed), tap_random(&seed), tap_random(&seed)},
                             far * reach);
        at = palp_add(k % 40 == 0 ? (palp_vec3){.x = 0} : at, by);
        const palp_frame place = palp_frame_at(at);
        palp_contact_begin(c, &place, &free);
        for (bool more = true; more; filled++) {
            const palp_lattice_counts most = palp_contact_most_filled(&cost, c->level);
            more = palp_contact_fill(c);
            const palp_lattice_counts d = c->done;
            beyond += d.fillings > most.fillings || d.around > most.around ||
                      d.evaluations > most.evaluations || d.shots > most.shots ||
                      d.crossings > most.crossings || d.nodes > most.nodes || d.feet > most.feet ||
                      d.kept > most.kept;
            nearest = fmax(nearest, (double)d.evaluations / most.evaluations);
        }
        if (palp_contact_points(c) == 0) continue;
        while (palp_contact_assemble(c)) {}
        while (palp_contact_iterate(c)) {}
        palp_contact_finish(c);
    }
    contact_close(c);
    CHECK(beyond == 0 && nearest > 0.2,
          "%s: none of %u fillings beyond what is counted, evaluations up to %.2f of it", name,
          filled, nearest);
}

/* A ball goes down between the two prongs of a fork and bends them apart, then presses one aside:
 * two regions, far apart and on sharp edges, felt from the first touch on and without a step. */
static void test_fork(uint32_t squares) {
    static const int cube[][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 0, 1},
                                  {2, 0, 1}, {0, 0, 2}, {2, 0, 2}};
    enum { TICKS = 300 };
    uint32_t *cell;
    const baked b = model_bake(model_voxels(cube, 7, 1, squares, &cell), 1e-6, 0, false, false);
    const palp_tool tool = palp_tool_sphere(0.6f);
    palp_contact *c = contact_open(&b.blob, &tool, 1, PALP_CONTACT_FINEST);
    palp_vec3 before = {.x = 0};
    double step = 0, largest = 0, aside = 0, first = 0;
    uint32_t left = 0, right = 0;
    for (int k = 0; k < 2 * TICKS; k++) {
        const double down = fmin(k, TICKS) / TICKS, over = fmax(k - TICKS, 0) / TICKS;
        const palp_vec3 at = {(float)(1.5 + 0.08 * over), 0.5f, (float)(3.35 - 0.35 * down)};
        press_hold(c, at, 1);
        const palp_vec3 f = c->force_N[0];
        const double size = (double)palp_norm(f);
        if (!(palp_norm(before) > 0) && size > 0) first = size;
        step = fmax(step, (double)palp_norm(palp_sub(f, before)));
        largest = fmax(largest, size);
        before = f;
        if (k != TICKS - 1) continue;
        aside = (double)(palp_abs(f.x) / palp_norm(f));
        for (uint32_t i = 0; i < c->count; i++) {
            if (c->point[i].force_N > 0) *(c->point[i].at.y.x < 1.5f ? &left : &right) += 1;
        }
    }
    CHECK(left > 2 && right > 2, "fork of %u nodes: %u and %u points on the prongs",
          b.blob.meta->nodes, left, right);
    AT_MOST(aside, 0.03, "between equal prongs the force is upright: aside");
    AT_MOST(first / largest, 0.01, "found when touched: first force over the largest");
    AT_MOST(step / largest, 0.03, "largest step over the largest force");
    contact_close(c);
    test_most_filled(&b.blob, tool, 3, "ball on a fork");
    free(cell);
}

int main(void) {
    progress_quiet(1);
    test_progress();
    baked small = model_bake(model_sphere(2), -0.7, 0, false, false);
    baked ball = model_bake(model_sphere(3), -0.7, 0, false, false);
    test_across(&small);
    test_split(&small);
    test_split(&ball);
    test_hertz(&small);
    test_hertz(&ball);
    test_dense(&ball);
    test_gradient(&ball);
    test_levels(&ball);
    test_resolutions(&small, &ball);
    test_deep(&ball);
    test_fork(3);
    test_fork(4);
    test_most_filled(&ball.blob, palp_tool_sphere(0.1f), 1.1, "small ball on a ball");
    test_most_filled(&ball.blob, palp_tool_sphere(0.7f), 1.6, "large ball on a ball");
    test_answer(&ball.blob);
    test_friction(&ball.blob);
    test_two_tools(&ball);
    test_loads(&ball);
    test_errors(&small);
    return tap_done();
}
