/* SPDX-License-Identifier: MIT */
/* Tools on dynamic bodies: adaptive against uniformly fine, forces, the guaranteed rate. */
#include "core/dyna/skin.h"
#include "core/servo/dynamic.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/press/press.h"
#include "tools/study/speedup.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

#define RATE 1000.0f

/* An ellipsoid of half axes 60, 40, 25 mm; axis k of the first is axis k + turn. */
static mesh ellipsoid(uint32_t splits, size_t turn) {
    static const double half_m[3] = {0.06, 0.04, 0.025};
    mesh m = model_sphere(splits);
    for (uint32_t i = 0; i < m.vertices; i++) {
        double x[3];
        for (size_t k = 0; k < 3; k++) x[(k + turn) % 3] = m.x[i][k] * half_m[k];
        memcpy(m.x[i], x, sizeof x);
    }
    return m;
}

/* It pinned where x is at most `below`. */
static dynamic_body make_pinned(const uint32_t *nodes, uint32_t levels, double young,
                                double poisson, double damping_s, double below) {
    mesh m = ellipsoid(4, 0);
    bvh *on = bvh_build(&m);
    tetmesh level[TET_LEVELS];
    for (uint32_t l = 0; l < levels; l++) {
        double pitch, dropped;
        level[l] = stuff_level(&m, on, nodes[l], l, &pitch, &dropped);
    }
    bvh_free(on);
    mesh_free(&m);
    return model_dynamic_body(level, levels, below, young, poisson, damping_s);
}

static dynamic_body make(const uint32_t *nodes, uint32_t levels, double young, double poisson,
                         double damping_s) {
    return make_pinned(nodes, levels, young, poisson, damping_s, -0.045);
}

static uint64_t no_time(void *context) {
    (void)context;
    return 0;
}

typedef struct {
    palp_dynamic body;
    palp_tool tool;
} poked;

/* ns_per_operation 0.5: a budget of 0.8 ms holds 1.6 million operations. */
static poked *open_poked(const dynamic_body *b, float radius, palp_material material,
                         float ns_per_operation, bool uniform, palp_vec3 place) {
    const palp_frame at = palp_frame_at(place);
    poked *p = allocate(1, sizeof *p);
    p->tool = palp_tool_sphere(radius);
    palp_dynamic_config c = {.tets = &b->tets,
                             .material = material,
                             .adapt = palp_adapt_defaults(&b->tets),
                             .tools = &p->tool,
                             .tool_count = 1,
                             .max_points = 64,
                             .most_class = PALP_STEP_CLASSES - 1,
                             .cost = {.target = &palp_target_counted,
                                      .ns_per_instruction = ns_per_operation,
                                      .margin = 0.8f},
                             .port = {.now_ns = no_time},
                             .tick_s = 1 / RATE,
                             .uniform = uniform};
    size_t bytes = palp_dynamic_memsize(&b->tets, c.max_points);
    float bound_ns = 0;
    palp_status s =
        palp_dynamic_init(&p->body, &c, &at, allocate_aligned(bytes, 1), bytes, &bound_ns);
    if (s != PALP_OK) die(EXIT_WORK, "%s: %g ns", palp_status_text(s), (double)bound_ns);
    return p;
}

static void set_speed(poked *p, float ns_per_instruction) {
    p->body.config.cost.ns_per_instruction = ns_per_instruction;
    p->body.price = palp_prices_of(&p->body.config.cost);
}

static void compare(void) {
    static const uint32_t nodes[3] = {90, 500, 2800};
    dynamic_body b = make(nodes, 3, 5e3, 0.4, 5e-4);
    const poke p = {.radius_m = 0.01f,
                    .position_m = {0.025f, 0, 0.0228f},
                    .normal = {0, 0, 1},
                    .depth_m = 0.0158f,
                    .ticks = 1500};
    speedup r =
        speedup_measure(&b.tets, palp_material_of(5e3f, 0.4f, 1000.0f, 5e-4f, 6.0f), &p, 0.008);
    double size = (double)b.tets.meta->diagonal_m;
    AT_MOST(r.worst_m / size, 0.02,
            "surface, adaptive against fine: largest difference, of the size");
    printf("# mean %.3g; largest motion %.3g; force differs by %.3g of the largest, mean %.3g\n",
           r.mean_m / size, r.moved_m / size, r.force_worst, r.force_mean);
    CHECK(r.fine / r.adaptive > 5, "element evaluations: %.1f times fewer (%.0f of %.0f), %u nodes",
          r.fine / r.adaptive, r.adaptive, r.fine, r.most_nodes);
}

/* ---- forces ---- */

/* The force of a tick with the tool at a place, without a turn. */
static palp_vec3 tick(poked *p, palp_vec3 place, palp_dynamic_report *r) {
    const palp_frame at = palp_frame_at(place);
    palp_wrench on_tool;
    palp_dynamic_tick(&p->body, 0, &at, &on_tool, r);
    return on_tool.force_N;
}

/* A ball presses slowly: what it takes over its path is what is stored. */
static void check_force(void) {
    static const uint32_t nodes[1] = {900};
    dynamic_body b = make(nodes, 1, 5e3, 0.4, 0);
    palp_material m = palp_material_of(5e3f, 0.4f, 1000.0f, 1e-3f, 40.0f);
    palp_vec3 at = {-0.02f, 0, 0.036f}, force = {0, 0, 0};
    poked *p = open_poked(&b, 0.01f, m, 1e-6f, true, at);
    palp_dynamic_report r;
    double work = 0, stored[2] = {0, 0}, sideways = 0, largest = 0;
    int ticks = 24000;
    for (int k = 0; k < ticks; k++) {
        float before = at.z;
        at.z = 0.036f - 0.009f * (float)k / (float)ticks;
        force = tick(p, at, &r);
        if (k == ticks / 4) {
            stored[0] = (double)p->body.dyna.stored_J;
            work = 0;
        }
        work -= (double)force.z * (double)(at.z - before);
        largest = fmax(largest, (double)palp_norm(force));
        sideways = fmax(sideways, fabs((double)force.y));
    }
    stored[1] = (double)p->body.dyna.stored_J;
    CHECK(r.inside >= 3 && force.z > 0, "a ball holds %u nodes down with %.3g N", r.inside,
          (double)force.z);
    AT_MOST(fabs(work / (stored[1] - stored[0]) - 1), 0.03, "its work against what is stored");
    AT_MOST(sideways / largest, 0.2, "sideways, of the largest force (the mesh is not symmetric)");
}

/*
 * The same poke of the same body by the elastostatic engine, with contact on the surface, and by
 * the dynamic one at rest, with contact at the vertices of its skin. They differ by what the meshes
 * leave out (linear tetrahedra on a coarse skin), by the rhythm of few vertices in contact, and by
 * Green's strain where the press is deep.
 */
static void check_against_elastostatic(void) {
    static const uint32_t nodes[] = {300, 1000};
    const float radius = 0.04f, depth = 0.004f, top = 0.025f;
    const baked b = model_bake(ellipsoid(3, 2), -0.02, 0, false, false);
    const palp_tool tool = palp_tool_sphere(radius);
    palp_contact *c = contact_open(&b.blob, &tool, 1, PALP_CONTACT_FINEST);
    press_hold(c, (palp_vec3){0, top + radius - depth, 0}, 20);
    const double still = (double)palp_norm(c->force_N[0]);
    const double young = (double)b.blob.meta->young_Pa, poisson = (double)b.blob.meta->poisson;
    contact_close(c);
    for (size_t k = 0; k < 2; k++) {
        dynamic_body body = make_pinned(&nodes[k], 1, young, poisson, 0, -0.02);
        palp_material m = palp_material_of((float)young, (float)poisson, 1000.0f, 1e-3f, 40.0f);
        palp_vec3 at = {0, 0, top + radius + 0.001f}, force = {0, 0, 0};
        poked *p = open_poked(&body, radius, m, 1e-6f, true, at);
        palp_dynamic_report r;
        const float from = at.z, to = top + radius - depth;
        for (int i = 0; i < 2500; i++) {
            at.z = from + (to - from) * palp_min((float)i / 1500, 1);
            force = tick(p, at, &r);
        }
        AT_MOST(fabs((double)palp_norm(force) / still - 1), 0.1,
                "%u nodes, %u vertices held: dynamic body at rest against the elastostatic one",
                nodes[k], r.inside);
        CHECK(force.z > 0.95f * palp_norm(force), "pushed straight back");
    }
}

/* ---- the guaranteed rate ---- */

static uint64_t late_ns; /* how long after its start a tick is begun */
static uint64_t clock_late(void *context) {
    (void)context;
    return late_ns;
}

static double farthest(const palp_dyna *d) {
    double far = 0;
    for (uint32_t i = 0; i < d->active_count; i++) {
        palp_vec3 u = palp_vec3_at(d->u_m + 3 * (size_t)d->active[i]);
        far = palp_vec3_is_finite(u) ? fmax(far, (double)palp_norm(u)) : HUGE_VAL;
    }
    return far;
}

/* Stirs a body with a ball that jumps about, while the time for a tick changes by factors of ten.
 */
static void check_violence(double lambda, double mu, int ticks) {
    static const uint32_t nodes[3] = {40, 160, 640};
    double young = mu * (3 * lambda + 2 * mu) / (lambda + mu),
           poisson = lambda / (2 * (lambda + mu));
    dynamic_body b = make(nodes, 3, young, poisson, 0);
    palp_material m = {(float)lambda, (float)mu, 0, 0, 1000, 1};
    m.phi_Pa_s = 1e-4f * m.lambda_Pa;
    m.psi_Pa_s = 1e-4f * m.mu_Pa;
    palp_vec3 at = {0, 0, 0.1f}, force;
    poked *p = open_poked(&b, 0.01f, m, 0.2f, false, at);
    p->body.config.port.now_ns = clock_late;
    uint64_t seed = 11, steps = 0;
    uint32_t beyond = 0, capped = 0, coasted = 0, short_ticks = 0, collapsed = 0,
             energy_limited = 0;
    double far = 0, largest = 0;
    uint64_t evaluations = 0, moves = 0, interpolated = 0;
    late_ns = 0;
    for (int k = 0; k < ticks; k++) {
        palp_dynamic_report r;
        if (k % 50 == 0) { /* another place, perhaps far away at once; another budget */
            at = (palp_vec3){0.07f * (float)tap_random(&seed), 0.05f * (float)tap_random(&seed),
                             0.05f * (float)tap_random(&seed)};
            set_speed(p, 0.05f * (float)pow(10, 0.65 + 0.65 * tap_random(&seed)));
        } else { /* or up to 5 mm a tick, 5 m/s */
            at.x += 0.003f * (float)tap_random(&seed);
            at.y += 0.003f * (float)tap_random(&seed);
            at.z += 0.003f * (float)tap_random(&seed);
        }
        late_ns = k % 97 == 0 ? 750000 : 0;
        float ns = p->body.config.cost.ns_per_instruction;
        force = tick(p, at, &r);
        /* by the counters of what was done, at the prices of counted.c */
        const palp_dyna *d = &p->body.dyna;
        double done = 210 * (double)(d->evaluations - evaluations) +
                      45 * (double)(d->moves - moves) +
                      24 * 4 * (double)(d->interpolated - interpolated);
        evaluations = d->evaluations;
        moves = d->moves;
        interpolated = d->interpolated;
        beyond +=
            r.bound_ns > 800001.0f - (float)late_ns || done * (double)ns > 800001 - (double)late_ns;
        capped += r.adapt.refused > 0;
        coasted += r.coasted;
        short_ticks += r.shortened;
        collapsed += r.collapsed;
        energy_limited += r.energy_limited;
        steps += r.steps;
        far = fmax(far, farthest(&p->body.dyna));
        largest = fmax(largest, palp_vec3_is_finite(force) ? (double)palp_norm(force) : HUGE_VAL);
    }
    at.z = 1;
    late_ns = 0;
    set_speed(p, 0.05f);
    double wave = sqrt(mu / 1000), rest = (double)p->body.dyna.stored_J;
    int calm = (int)(20000 + 300 / wave);
    for (int k = 0; k < calm; k++) {
        palp_dynamic_report r;
        force = tick(p, at, &r);
    }
    rest = (double)p->body.dyna.stored_J / (mu * 1e-4);
    CHECK(beyond == 0, "lambda %g, mu %g: no tick of %d (%.2g steps) beyond its bound; %u coasted",
          lambda, mu, ticks, (double)steps, coasted);
    CHECK(capped + short_ticks > 0,
          "lambda %g, mu %g: refused in %u ticks, larger steps in %u, coarsest mesh in %u, "
          "energy limited in "
          "%u",
          lambda, mu, capped, short_ticks, collapsed, energy_limited);
    CHECK(far < 1 && largest < HUGE_VAL && rest < 1e-4,
          "lambda %g, mu %g: at most %.2g m away, %.2g N; left alone it stores %.1g of mu 1e-4 m^3",
          lambda, mu, far, largest, rest);
}

int main(int argc, char **argv) {
    int ticks = argc > 1 ? atoi(argv[1]) : 1000;
    if (argc == 1) {
        compare();
        check_force();
        check_against_elastostatic();
    }
    static const double lame[6][2] = {{10, 10},   {90, 10},   {1e3, 1e3}, /* lambda, mu */
                                      {9e4, 1e4}, {1e6, 1e6}, {1e6, 1.1e5}};
    for (int k = 0; k < 6; k++) {
        if (argc == 1 && k % 2 == 0 && !tap_full()) continue; /* check/dynamic.sh has all of them */
        if (argc < 3 || atoi(argv[2]) == k) check_violence(lame[k][0], lame[k][1], ticks);
    }
    return tap_done();
}
