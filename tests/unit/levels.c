/* SPDX-License-Identifier: MIT */
/* The constraint hierarchy against its definition in double precision, definiteness of every level,
 * and a press that is felt through changes of level. */
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/dense.h"
#include "tools/parallel.h"
#include "tools/util.h"
#include <stdlib.h>
#include <string.h>

/* G between two weightings of the free nodes, from the dense matrix. */
static void weighted_block(const baked *b, const double *left, const double *right, double g[9]) {
    const palp_domain *d = &b->blob.domain[PALP_FREE];
    memset(g, 0, 9 * sizeof *g);
    for (uint32_t i = 0; i < d->slots; i++) {
        for (uint32_t j = 0; j < d->slots && left[i] > 0; j++) {
            if (!(right[j] > 0)) continue;
            for (size_t e = 0; e < 9; e++)
                g[e] += left[i] * right[j] *
                        greens_row(&b->g, d->node[i], e / 3)[3 * d->node[j] + e % 3];
        }
    }
}

static double largest_entry(const double g[9]) {
    double m = 0;
    for (int e = 0; e < 9; e++) m = fmax(m, fabs(g[e]));
    return m;
}

/* Entries of any two basis functions, of equal and of different levels: extracted from compressed
 * hierarchical columns, and looked up. */
static void test_entries(const baked *b) {
    const palp_blob *blob = &b->blob;
    const palp_domain *d = &blob->domain[PALP_FREE];
    double *left = allocate(d->slots, sizeof *left), *right = allocate(d->slots, sizeof *right);
    palp_row_scratch scratch = {allocate(d->slots, sizeof(float)),
                                allocate((d->slots + 31) / 32, sizeof(uint32_t))};
    palp_row row = {.index = allocate(d->slots, sizeof(uint16_t)),
                    .weight = allocate(d->slots, sizeof(float))};
    double extracted = 0, looked_up = 0;
    uint64_t seed = 17;
    for (int trial = 0; trial < 60; trial++) {
        uint32_t la = (uint32_t)trial % d->levels, lb = (uint32_t)(trial / 4) % d->levels;
        uint32_t a = (uint32_t)((tap_random(&seed) + 1) / 2 * (double)blob->level[la].nodes);
        uint32_t c = (uint32_t)((tap_random(&seed) + 1) / 2 * (double)blob->level[lb].nodes);
        a = a < blob->level[la].nodes ? a : 0;
        c = c < blob->level[lb].nodes ? c : 0;
        hierarchy_spread(&b->d.h, la, a, left);
        hierarchy_spread(&b->d.h, lb, c, right);
        double exact[9];
        float block[9];
        weighted_block(b, left, right, exact);
        (void)palp_basis_row(blob, (palp_basis){la, a}, &scratch, &row, d->slots);
        palp_columns_extract(&blob->level[lb].columns, c, &row, block);
        for (int e = 0; e < 9; e++)
            extracted = fmax(extracted, fabs((double)block[e] - exact[e]) / largest_entry(exact));
        if (la != lb || blob->level[la].table == NULL) continue;
        palp_table_block(blob, la, a, c, block);
        for (int e = 0; e < 9; e++)
            looked_up = fmax(looked_up, fabs((double)block[e] - exact[e]) / largest_entry(exact));
    }
    AT_MOST(extracted, 2e-5, "entries of any two basis functions against R G R^T in double");
    AT_MOST(looked_up, 1e-6, "and those looked up in tables");
    double sums = 0;
    for (uint32_t l = 0; l + 1 < d->levels; l++) {
        for (uint32_t k = 0; k < blob->level[l].nodes; k++) {
            double sum = (double)palp_own_share(blob, l, k);
            palp_child_range r = palp_children(d, k, l + 1);
            for (uint32_t c = r.first; c < r.end; c++)
                sum += (double)palp_child_share(blob, l, k, d->child[c]);
            sums = fmax(sums, fabs(sum - 1));
        }
    }
    AT_MOST(sums, 1e-6, "shares of every force on the way down sum to one");
}

/* Least pivot over diagonal of the compliance that contact uses on a level, in double. */
static double least_pivot(const palp_blob *b, uint32_t level) {
    size_t n = b->level[level].nodes;
    bool table = b->level[level].table != NULL;
    size_t axes = table ? 3 : 1, order = axes * n;
    double *c = allocate_aligned(order * order, sizeof *c),
           *diagonal = allocate(order, sizeof(double));
    float *x = allocate(PALP_FIELD_LANES * (size_t)b->domain[PALP_FREE].slots, sizeof *x);
    for (uint32_t j = 0; j < n; j++) {
        if (table) {
            for (uint32_t i = 0; i < n; i++) {
                float block[9];
                palp_table_block(b, level, i, j, block);
                for (size_t e = 0; e < 9; e++)
                    c[(3 * i + e / 3) * order + 3 * j + e % 3] = (double)block[e];
            }
            continue;
        }
        const palp_domain *d = &b->domain[PALP_FREE];
        memset(x, 0, PALP_FIELD_LANES * (size_t)d->slots * sizeof *x);
        palp_columns_add(&b->level[level].columns, j, b->normal + 3 * d->node[j], x);
        palp_wavelet_inverse(d, x, d->levels - 1);
        for (uint32_t i = 0; i < n; i++) {
            palp_vec3 u = palp_vec3_at(x + PALP_FIELD_LANES * i);
            double g = (double)palp_dot(palp_vec3_at(b->normal + 3 * d->node[i]), u);
            c[i * order + j] += 0.5 * g;
            c[j * order + i] += 0.5 * g;
            if (i == j) c[i * order + j] += (double)b->softening[d->node[j]];
        }
    }
    for (size_t i = 0; i < order; i++) diagonal[i] = c[i * order + i];
    double least = HUGE_VAL;
    size_t done = dense_lu_unpivoted(c, order, order);
    for (size_t i = 0; i < done; i++) least = fmin(least, c[i * order + i] / diagonal[i]);
    free(c);
    free(diagonal);
    free(x);
    return done == order ? least : -1;
}

/* A set of two levels: its normal compliances against R G R^T in double, and that it is positive
 * definite. */
static void test_mixed(const baked *b) {
    const palp_node_contact_limits limits = {120, 120, 120, 1, false};
    const palp_domain *d = &b->blob.domain[PALP_FREE];
    palp_tool tool = palp_tool_sphere(2.0f);
    palp_node_contact c;
    size_t bytes = palp_node_contact_memsize(&b->blob, limits);
    (void)palp_node_contact_init(&c, &b->blob, b->blob.rest_m, &tool, 1, limits,
                            allocate_aligned(bytes, 1), bytes);
    palp_node_contact_clear_mixed(&c, 2, 1, 0.3f);
    palp_vec3 at = {0.05f, 0.02f, 2.7f};
    palp_fresh fresh[PALP_MAX_CANDIDATES];
    for (int tick = 0; tick < 12; tick++) {
        uint32_t n = palp_node_contact_search(&c, &at, fresh);
        for (uint32_t i = 0; i < n; i++) palp_node_contact_admit(&c, fresh[i]);
    }
    uint32_t fine = 0, coarse = 0, active = 0;
    double *left = allocate(d->slots, sizeof *left), *right = allocate(d->slots, sizeof *right);
    double worst = 0;
    for (uint32_t i = 0; i < c.count; i++) {
        fine += c.candidate[i].level == 2;
        coarse += c.candidate[i].level == 1;
        active += palp_node_contact_let_in(&c, i);
        for (uint32_t j = 0; j <= i; j++) {
            double g[9], exact = 0;
            hierarchy_spread(&b->d.h, c.candidate[i].level, c.candidate[i].slot, left);
            hierarchy_spread(&b->d.h, c.candidate[j].level, c.candidate[j].slot, right);
            weighted_block(b, left, right, g);
            for (size_t e = 0; e < 9; e++)
                exact += b->normal[c.candidate[i].node][e / 3] * g[e] *
                         b->normal[c.candidate[j].node][e % 3];
            worst = fmax(worst, fabs((double)palp_node_contact_g(&c, i, j) - exact) / largest_entry(g));
        }
    }
    CHECK(fine > 5 && coarse > 5 && active == c.count,
          "a mixed set of %u nodes and %u hats around them is positive definite", fine, coarse);
    AT_MOST(worst, 1e-6, "its compliances against R G R^T in double");
}

static mesh refined(const char *control, uint32_t splits) {
    mesh m = mesh_load(control);
    for (uint32_t l = 0; l < splits; l++) {
        mesh finer = subdivide_loop(&m);
        mesh_free(&m);
        m = finer;
    }
    return m;
}

static void test_definite(const char *name, uint32_t splits, double below) {
    static const double epsilons[] = {0.01, 0.05, 0.2};
    for (int e = 0; e < 3; e++) {
        baked b = model_bake_tables(refined(name, splits), below, epsilons[e], false, false, 1e6);
        for (uint32_t l = 0; l < b.blob.meta->levels; l++) {
            double least = least_pivot(&b.blob, l);
            CHECK(least > 0,
                  "%s of %u nodes, epsilon %g, level %u (%u nodes, %s): positive definite, least "
                  "pivot %.1e of its diagonal",
                  name, b.m.vertices, epsilons[e], l, b.blob.level[l].nodes,
                  b.blob.level[l].table != NULL ? "table" : "normals", least);
        }
        free(b.bytes);
        free(b.g.m);
    }
}

/* ---- a press through the levels ---- */

typedef struct {
    palp_bounded *b;
    double ns_per_operation;
} work_clock;

/* Time as the work that was done: what the steps counted. */
static uint64_t by_work(void *context) {
    const work_clock *c = context;
    return (uint64_t)((double)palp_bounded_work(c->b) * c->ns_per_operation);
}

typedef struct {
    double jump, jump_at_change, jump_after_change, given, owed, stored, largest_N;
    uint32_t late, dropped, climbed, most_covered;
    uint32_t level_at_depth, outer_at_depth, level_at_end, mixed;
} press_result;

/* Nodes that a tool covers: what the finest level would have in contact. */
static uint32_t covered(const palp_blob *b, const palp_tool *tool, palp_vec3 at) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        palp_touch t = palp_tool_at(tool, at, palp_vec3_at(b->rest_m + 3 * i),
                                    palp_vec3_at(b->normal + 3 * i));
        n += t.depth_m > 0 && t.facing > 0.2f;
    }
    return n;
}

static press_result press(const palp_blob *blob, const palp_tool *tool, float above, double depth,
                          double ns, palp_node_contact_limits limits) {
    palp_bounded b;
    work_clock clock = {&b, ns};
    palp_bounded_config config = {.blob = blob,
                                  .tools = tool,
                                  .tool_count = 1,
                                  .limits = limits,
                                  .cost = {&palp_target_counted, (float)ns, 0.0f, 0.8f},
                                  .port = {by_work, &clock},
                                  .dt_s = 0.001f};
    size_t bytes = palp_bounded_memsize(blob, config.limits);
    void *memory = allocate_aligned(bytes, 1);
    if (palp_bounded_init(&b, &config, memory, bytes, NULL) != PALP_OK) die(EXIT_WORK, "bounded");
    b.coupling.spring[0].stiffness_N_per_m = 5e4f;
    press_result r = {.late = 0};
    palp_vec3 last_f = {0}, last_p = {0};
    uint32_t last_level = blob->meta->constraint_level, last_outer = last_level, since = 1000;
    double absorbed = 0;
    const int steps = 4000;
    for (int i = 0; i <= steps; i++) {
        double down = depth * (1 - cos(6.283185307179586 * i / steps)) / 2;
        palp_vec3 p = {0.013f, 0.007f, above + 0.004f - (float)down};
        palp_node_coupling_result result;
        palp_bounded_report report;
        uint64_t start = by_work(&clock);
        palp_bounded_tick(&b, start, &p, &result, &report);
        r.late += (double)(by_work(&clock) - start) > 0.8e6;
        palp_bounded_spare(&b);
        r.late += (double)(by_work(&clock) - start) > 0.8e6;
        double jump = (double)palp_norm(palp_sub(result.force_N, last_f));
        bool changed = report.level != last_level || report.outer != last_outer;
        since = changed ? 0 : since + 1;
        if (since == 0) r.jump_at_change = fmax(r.jump_at_change, jump);
        if (since < 40) r.jump_after_change = fmax(r.jump_after_change, jump);
        if (since >= 40) r.jump = fmax(r.jump, jump);
        if (i > 0)
            absorbed -=
                0.5 * (double)palp_dot(palp_add(result.force_N, last_f), palp_sub(p, last_p));
        r.stored = fmax(r.stored, (double)result.energy_J);
        r.owed = fmax(r.owed, (double)result.energy_J - absorbed);
        r.largest_N = fmax(r.largest_N, (double)palp_norm(result.force_N));
        if (i == steps / 2) {
            r.most_covered = covered(blob, tool, result.tool_m);
            r.level_at_depth = report.level;
            r.outer_at_depth = report.outer;
        }
        last_f = result.force_N;
        last_p = p;
        last_level = report.level;
        last_outer = report.outer;
        r.mixed += report.outer != report.level;
    }
    r.level_at_end = last_level;
    r.given = fmax(-absorbed, 0) / r.stored;
    r.dropped = b.ladder.dropped;
    r.climbed = b.ladder.climbed;
    free(memory);
    return r;
}

static void expect_press(const palp_blob *blob, const char *name, const palp_tool *tool,
                         float above, double depth, double ns, palp_node_contact_limits limits,
                         uint32_t nodes) {
    press_result r = press(blob, tool, above, depth, ns, limits);
    CHECK(r.most_covered >= nodes && r.late == 0,
          "%s presses 1 to %u nodes with room for %u at %g ns per operation: %u late ticks", name,
          r.most_covered, limits.max_active, ns, r.late);
    CHECK(r.dropped > 0 && r.climbed > 0 && r.outer_at_depth < blob->meta->constraint_level &&
              r.level_at_end == blob->meta->constraint_level,
          "%s: level %u/%u at the deepest, %u at the end, %u drops, %u climbs, %u ticks on two "
          "levels",
          name, r.level_at_depth, r.outer_at_depth, r.level_at_end, r.dropped, r.climbed, r.mixed);
    AT_MOST(r.jump_at_change / r.jump, 1.5,
            "%s: force jump at a change of level, of %.3g N without", name, r.jump);
    AT_MOST(r.jump_after_change / r.jump, 1.5, "%s: in the 40 ticks after one", name);
    AT_MOST(r.given, 1e-4, "%s: energy given, of %.3g J stored", name, r.stored);
    AT_MOST(r.owed / r.stored, 1e-4, "%s: stored at any time beyond what the hand put in", name);
}

static void test_press(void) {
    baked b = model_bake_tables(model_sphere(4), -0.7, 0.05, false, false, 8e6);
    const palp_tool plate = {.pad = {.axis = {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
                                     .half_m = {1.2f, 1.2f},
                                     .edge_m = 0.3f}};
    const palp_tool ball = palp_tool_sphere(2), small = palp_tool_sphere(0.5f);
    const palp_node_contact_limits forty = {160, 40, 6, 12, false};
    expect_press(&b.blob, "a flat plate", &plate, 1, 0.42, 0.6, forty, 400);
    expect_press(&b.blob, "a ball of radius 2", &ball, 3, 0.42, 0.6, forty, 300);
    expect_press(&b.blob, "a plate on a slow machine", &plate, 1, 0.42, 2.5, forty, 400);
    expect_press(&b.blob, "a ball of radius 0.5", &small, 1.5f, 0.35, 0.6, forty, 100);
}

int main(void) {
    progress_quiet(1);
    baked exact = model_bake_tables(model_sphere(2), -0.7, 0, false, false, 8e6);
    test_entries(&exact);
    test_mixed(&exact);
    test_definite("blobs/ball.obj", 1, -0.5);
    test_definite("blobs/rabbit.obj", 2, 0.004);
    test_press();
    return tap_done();
}
