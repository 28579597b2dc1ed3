/* SPDX-License-Identifier: MIT */
/* Contact against projected Gauss-Seidel in double, and closed tool paths. */
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/parallel.h"
#include "tools/util.h"
#include <stdlib.h>
#include <string.h>

#ifdef TRIALS /* under sanitizers */
#define LOOP_STEPS 2000
#define PUSHED 60
#else
#define LOOP_STEPS 12000
#define PUSHED 9 /* every so many nodes */
#endif

static palp_node_contact open_contact(const palp_blob *b, float radius,
                                      palp_node_contact_limits limits) {
    palp_node_contact c;
    size_t bytes = palp_node_contact_memsize(b, limits);
    palp_tool *tool = allocate(1, sizeof *tool);
    *tool = palp_tool_sphere(radius);
    palp_status status = palp_node_contact_init(&c, b, b->rest_m, tool, 1, limits,
                                                allocate_aligned(bytes, 1), bytes);
    if (status != PALP_OK) die(EXIT_WORK, "contact: %s", palp_status_text(status));
    return c;
}

static palp_vec3 place(palp_node_contact *c, palp_vec3 center, palp_grip grip) {
    palp_fresh fresh[PALP_MAX_CANDIDATES];
    uint32_t n = palp_node_contact_search(c, &center, fresh);
    for (uint32_t i = 0; i < n; i++) palp_node_contact_admit(c, fresh[i]);
    return palp_node_contact_solve(c, center, grip);
}

/*
 * The same problem from the dense matrix in double over every free node that sees the tool: 20,000
 * sweeps of projected Gauss-Seidel.
 */
static double reference_force(const baked *b, palp_vec3 center, double radius,
                              const palp_node_contact *c, double force[3]) {
    uint32_t n = 0, node[512];
    static double g[512][512], d[512], lambda[512], push[512][3];
    const double p[3] = {(double)center.x, (double)center.y, (double)center.z};
    for (uint32_t i = 0; i < b->m.vertices && n < 512; i++) {
        double r[3], t[3];
        v_sub(b->m.x[i], p, r);
        double along = v_dot(r, b->normal[i]);
        for (int k = 0; k < 3; k++) t[k] = r[k] - along * b->normal[i][k];
        double off = v_norm(t);
        if (b->fixed[i] != 0 || b->m.x[i][2] < 0 || off > 1.6 * radius) continue;
        double inner = 0.8 * radius;
        double psi =
            off <= inner ? sqrt(radius * radius - off * off) : 0.6 * radius - (off - inner) * 4 / 3;
        double slope = off <= inner ? 1 / psi : 4 / (3 * off);
        d[n] = along + psi;
        for (int k = 0; k < 3; k++) push[n][k] = b->normal[i][k] - slope * t[k];
        lambda[n] = 0;
        node[n++] = i;
    }
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t j = 0; j < n; j++) {
            g[i][j] = 0;
            for (size_t a = 0; a < 3; a++) {
                g[i][j] += b->normal[node[i]][a] *
                           v_dot(greens_row(&b->g, node[i], a) + 3 * node[j], b->normal[node[j]]);
            }
        }
    }
    double change = 1, most = 1;
    for (int sweep = 0; sweep < 20000 && change > 1e-10 * most; sweep++) {
        change = most = 0;
        for (uint32_t i = 0; i < n; i++) {
            double w = d[i];
            for (uint32_t j = 0; j < n; j++) w -= g[i][j] * lambda[j];
            const double next = fmax(0, lambda[i] + w / g[i][i]);
            change = fmax(change, fabs(next - lambda[i]));
            most = fmax(most, next);
            lambda[i] = next;
        }
    }
    double worst = 0, largest = 0;
    memset(force, 0, 3 * sizeof *force);
    for (uint32_t i = 0; i < n; i++) {
        double got = 0;
        for (uint32_t k = 0; k < c->count; k++) {
            if (c->candidate[k].node == node[i]) got = (double)c->candidate[k].force_N;
        }
        worst = fmax(worst, fabs(got - lambda[i]));
        largest = fmax(largest, lambda[i]);
        for (int k = 0; k < 3; k++) force[k] += lambda[i] * push[i][k];
    }
    return worst / largest;
}

static void test_reference(const baked *b) {
    const float radius = 0.45f;
    palp_node_contact c =
        open_contact(&b->blob, radius, (palp_node_contact_limits){128, 64, 128, 200, false});
    for (int depth = 1; depth <= 4; depth++) {
        palp_vec3 center = {0, 0, 0};
        palp_vec3 force = {0};
        /* Come down in steps, as a hand would, off the axis of any symmetry. */
        for (int step = 0; step <= 60; step++) {
            center =
                (palp_vec3){0.11f, 0.07f, 1.6f - (0.2f + 0.07f * (float)depth) * (float)step / 60};
            force = place(&c, center, (palp_grip){.held_m = center});
        }
        double exact[3];
        double worst = reference_force(b, center, (double)radius, &c, exact);
        const double got[3] = {(double)force.x, (double)force.y, (double)force.z};
        AT_MOST(worst, 2e-4, "press %d, %u nodes: each nodal force against Gauss-Seidel in double",
                depth, c.active_count);
        AT_MOST(v_distance(got, exact) / v_norm(exact), 2e-4, "press %d: force on the tool", depth);
        CHECK((c.flags & (PALP_NODE_CONTACT_PIVOTS_SPENT | PALP_NODE_CONTACT_ACTIVE_FULL)) == 0,
              "press %d: solved within its pivots", depth);
        palp_node_contact_clear(&c, c.level);
    }
}

/* One tick of a tool on its spring. */
static palp_node_coupling_result couple(palp_node_coupling *coupling, palp_node_contact *c,
                                        palp_vec3 device) {
    palp_fresh fresh[PALP_MAX_CANDIDATES];
    palp_node_coupling_result result;
    palp_vec3 center;
    palp_node_coupling_centers(coupling, c, &device, &center);
    uint32_t n = palp_node_contact_search(c, &center, fresh);
    for (uint32_t k = 0; k < n; k++) palp_node_contact_admit(c, fresh[k]);
    palp_node_coupling_begin(coupling, c, &device);
    while (palp_node_coupling_step(coupling, c)) {}
    palp_node_coupling_end(coupling, c, 0.001f, &result);
    return result;
}

/* Net energy that a closed path gives to the hand, over the most that was stored. */
typedef struct {
    double given, dissipated, stored;
    uint32_t most_active, flags;
} loop_result;

static loop_result closed_path(const palp_blob *b, float radius, palp_node_contact_limits limits,
                               float stiffness, int shape, double depth) {
    palp_node_contact c = open_contact(b, radius, limits);
    palp_node_coupling coupling = {.spring[0].stiffness_N_per_m = stiffness};
    const int steps = LOOP_STEPS;
    loop_result r = {0};
    palp_vec3 last_f = {0}, last_p = {0};
    double absorbed = 0;
    for (int i = 0; i <= steps; i++) {
        double a = 6.283185307179586 * i / steps;
        double down = depth * (double)radius * (1 - cos(a)) / 2;
        double x = 0.5 * sin(a) * (shape == 1 ? sin(a / 2) : 1),
               y = 0.35 * sin((shape == 2 ? 3 : 2) * a);
        palp_vec3 p = {(float)x, (float)y,
                       (float)(sqrt(1 - x * x - y * y) + 1.02 * (double)radius - down)};
        palp_vec3 f;
        double stored;
        if (stiffness > 0) {
            palp_node_coupling_result result = couple(&coupling, &c, p);
            f = result.force_N;
            stored = (double)result.energy_J;
        } else {
            f = place(&c, p, (palp_grip){.held_m = p});
            stored = (double)palp_node_contact_energy(&c);
        }
        if (i > 0) {
            absorbed -= 0.5 * ((double)(f.x + last_f.x) * (double)(p.x - last_p.x) +
                               (double)(f.y + last_f.y) * (double)(p.y - last_p.y) +
                               (double)(f.z + last_f.z) * (double)(p.z - last_p.z));
        }
        last_f = f;
        last_p = p;
        r.stored = fmax(r.stored, stored);
        r.flags |= c.flags;
        if (c.active_count > r.most_active) r.most_active = c.active_count;
    }
    r.given = fmax(-absorbed, 0) / r.stored;
    r.dissipated = fmax(absorbed, 0) / r.stored;
    return r;
}

static void test_loops(double epsilon) {
    baked b = model_bake(model_sphere(3), -0.7, epsilon, false, false);
    for (int shape = 0; shape < 3; shape++) {
        loop_result r = closed_path(&b.blob, 0.4f, PALP_NODE_CONTACT_DEFAULTS, 0, shape, 0.5);
        AT_MOST(r.given, 1e-4, "epsilon %g, path %d, rigid grip, %u nodes: energy given", epsilon,
                shape, r.most_active);
        AT_MOST(r.dissipated, 1e-4, "epsilon %g, path %d, rigid grip: energy lost", epsilon, shape);
        r = closed_path(&b.blob, 0.4f, PALP_NODE_CONTACT_DEFAULTS, 3000, shape, 0.8);
        AT_MOST(r.given, 1e-4, "epsilon %g, path %d, virtual coupling, %u nodes: energy given",
                epsilon, shape, r.most_active);
    }
}

/* Straight in and out at many places of the rabbit, ears included: the worst net energy given. */
static void test_pushes(double epsilon, const char *control, uint32_t splits, uint32_t every) {
    mesh m = mesh_load(control);
    for (uint32_t l = 0; l < splits; l++) {
        mesh finer = subdivide_loop(&m);
        mesh_free(&m);
        m = finer;
    }
    baked b = model_bake(m, 0.004, epsilon, false, false);
    float edge = b.blob.meta->mean_edge_m;
    for (float size = 2; size <= 4; size += 2) {
        double worst = 0;
        uint32_t where = 0, pushes = 0;
        for (uint32_t node = 0; node < b.m.vertices; node += every) {
            if (b.fixed[node] != 0) continue;
            palp_node_contact c = open_contact(&b.blob, size * edge, PALP_NODE_CONTACT_DEFAULTS);
            palp_vec3 x = palp_vec3_at(b.blob.rest_m + 3 * node),
                      n = palp_vec3_at(b.blob.normal + 3 * node);
            palp_vec3 last_f = {0}, last_p = {0};
            double absorbed = 0, stored = 0;
            const int steps = 1500;
            for (int i = 0; i <= 2 * steps; i++) {
                float in = (float)(i <= steps ? i : 2 * steps - i) / (float)steps;
                palp_vec3 p = palp_madd(x, size * edge * (1.4f - 1.2f * in), n);
                palp_vec3 f = place(&c, p, (palp_grip){.held_m = p});
                if (i > 0)
                    absorbed -= 0.5 * (double)palp_dot(palp_add(f, last_f), palp_sub(p, last_p));
                stored = fmax(stored, (double)palp_node_contact_energy(&c));
                last_f = f;
                last_p = p;
            }
            pushes++;
            if (stored > 0 && -absorbed / stored > worst) {
                worst = -absorbed / stored;
                where = node;
            }
            free(c.candidate); /* the first piece of the block */
        }
        AT_MOST(worst, 1e-4,
                "rabbit of %u nodes, epsilon %g, softened %.2g: %u pushes with a tool of %g edges, "
                "worst at node %u: energy given",
                b.m.vertices, epsilon, b.softened, pushes, (double)size, where);
    }
}

/* Whatever a capacity leaves out must not push when room comes back. */
static void test_capacities(const baked *b) {
    loop_result r =
        closed_path(&b->blob, 0.4f, (palp_node_contact_limits){24, 6, 2, 8, false}, 0, 1, 0.8);
    CHECK((r.flags & PALP_NODE_CONTACT_ACTIVE_FULL) != 0,
          "six active nodes are too few for this path, and that is reported");
    AT_MOST(r.given, 1e-3, "with capacities exceeded: energy given");
    palp_node_contact c;
    palp_tool tool = palp_tool_sphere(0.1f), bad = palp_tool_sphere(-1);
    CHECK(palp_node_contact_init(&c, &b->blob, b->blob.rest_m, &tool, 1,
                                 (palp_node_contact_limits){0}, NULL, 0) == PALP_ERR_LIMITS,
          "limits of zero are refused");
    CHECK(palp_node_contact_init(&c, &b->blob, b->blob.rest_m, &bad, 1, PALP_NODE_CONTACT_DEFAULTS,
                                 NULL, 0) == PALP_ERR_ARGUMENT,
          "a negative radius is refused");
    bad = tool;
    bad.friction = 0.5f;
    CHECK(palp_node_contact_init(&c, &b->blob, b->blob.rest_m, &bad, 1, PALP_NODE_CONTACT_DEFAULTS,
                                 NULL, 0) == PALP_ERR_ARGUMENT,
          "friction without the memory for it is refused");
    size_t bytes = palp_node_contact_memsize(&b->blob, PALP_NODE_CONTACT_DEFAULTS);
    CHECK(palp_node_contact_init(&c, &b->blob, b->blob.rest_m, &tool, 1, PALP_NODE_CONTACT_DEFAULTS,
                                 allocate_aligned(bytes, 1), bytes - 1) == PALP_ERR_MEMORY,
          "one byte too few is refused");
}

/* The depth function's gradient, by differences in double. */
static void test_sphere(void) {
    double worst = 0;
    uint64_t seed = 4;
    for (int i = 0; i < 2000; i++) {
        double n[3] = {tap_random(&seed), tap_random(&seed), tap_random(&seed)};
        v_normalize(n);
        palp_vec3 x = {0.1f, 0.2f, 0.3f}, normal = {(float)n[0], (float)n[1], (float)n[2]};
        palp_vec3 c = {0.1f + 0.3f * (float)tap_random(&seed),
                       0.2f + 0.3f * (float)tap_random(&seed),
                       0.3f + 0.3f * (float)tap_random(&seed)};
        const float h = 1e-2f;
        palp_tool tool = palp_tool_sphere(0.25f);
        palp_touch at = palp_tool_at(&tool, c, x, normal);
        if (fabsf(at.reach * PALP_TOOL_REACH * 0.25f - 0.2f) < 0.03f) continue;
        float dx = palp_tool_at(&tool, palp_add(c, (palp_vec3){h, 0, 0}), x, normal).depth_m -
                   palp_tool_at(&tool, palp_sub(c, (palp_vec3){h, 0, 0}), x, normal).depth_m;
        worst = fmax(worst, fabs((double)(-dx / (2 * h) - at.push.x)));
    }
    AT_MOST(worst, 6e-3, "the push is minus the gradient of the depth");
}

int main(void) {
    progress_quiet(1);
    test_sphere();
    baked exact = model_bake(model_sphere(3), -0.7, 0, false, false);
    test_reference(&exact);
    test_capacities(&exact);
    test_loops(0.01);
    test_loops(0.05);
    test_loops(0.2);
    test_pushes(0.01, "blobs/rabbit.obj", 2, PUSHED);
    test_pushes(0.05, "blobs/rabbit.obj", 2, PUSHED);
    test_pushes(0.2, "blobs/rabbit.obj", 2, PUSHED);
    return tap_done();
}
