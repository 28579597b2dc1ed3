/* SPDX-License-Identifier: MIT */
#include "tools/study/speedup.h"
#include "core/dyna/skin.h"
#include "core/servo/dynamic.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>

#define POINTS 64

typedef struct {
    palp_dynamic body;
    palp_tool tool;
    void *memory;
} poked;

static uint64_t no_time(void *context) {
    (void)context;
    return 0;
}

static palp_vec3 ball_at(const poke *p, uint32_t k) {
    float t = (float)k / 1000.0f, d = p->depth_m, high; /* of its lowest point over the surface */
    if (t < 0.1f)
        high = 4 * d * (1 - t / 0.1f);
    else if (t < 0.25f)
        high = -d * (t - 0.1f) / 0.15f;
    else if (t < 0.3f)
        high = -d;
    else if (t < 0.32f)
        high = -d + 6 * d * (t - 0.3f) / 0.02f;
    else
        high = 5 * d;
    return palp_madd(p->position_m, p->radius_m + high, p->normal);
}

static void begin(poked *b, const palp_tets *tets, palp_material material, const poke *p,
                  double share, bool uniform) {
    b->tool = palp_tool_sphere(p->radius_m);
    palp_dynamic_config c = {
        .tets = tets,
        .material = material,
        .adapt = palp_adapt_defaults(tets),
        .tools = &b->tool,
        .tool_count = 1,
        .max_points = POINTS,
        .most_class = PALP_STEP_CLASSES - 1,
        .cost = {.target = &palp_target_counted, .ns_per_instruction = 1e-6f, .margin = 0.8f},
        .port = {.now_ns = no_time},
        .tick_s = 1e-3f,
        .uniform = uniform};
    c.adapt.refine_m = (float)share * tets->meta->diagonal_m;
    c.adapt.merge_m = 0.1f * c.adapt.refine_m;
    size_t bytes = palp_dynamic_memsize(tets, POINTS);
    const palp_frame at = palp_frame_at(ball_at(p, 0));
    b->memory = allocate_aligned(bytes, 1);
    palp_status s = palp_dynamic_init(&b->body, &c, &at, b->memory, bytes, NULL);
    if (s != PALP_OK) die(EXIT_WORK, "%s", palp_status_text(s));
}

poke poke_for(const palp_tets *tets) {
    const palp_tets_meta *m = tets->meta;
    double best = -1;
    uint32_t found = 0;
    for (uint32_t i = 0; i < m->skin; i++) {
        double near = HUGE_VAL;
        palp_vec3 x = palp_vec3_at(tets->rest_m + 3 * (size_t)tets->skin_node[i]);
        for (uint32_t n = m->first_node[m->levels - 1]; n < m->nodes; n++) {
            if ((tets->node[n].flags & PALP_TET_PINNED) == 0) continue;
            palp_vec3 y = palp_vec3_at(tets->rest_m + 3 * (size_t)n);
            near = fmin(near, (double)palp_norm(palp_sub(x, y)));
        }
        if (near > best && near < HUGE_VAL) {
            best = near;
            found = i;
        }
    }
    if (best < 0) die(EXIT_WORK, "the speed-up is measured on a body that is held: fix some nodes");
    return (poke){.radius_m = 0.05f * m->diagonal_m,
                  .position_m = palp_vec3_at(tets->rest_m + 3 * (size_t)tets->skin_node[found]),
                  .normal = palp_vec3_at(tets->skin_normal + 3 * (size_t)found),
                  .depth_m = 0.05f * m->diagonal_m,
                  .ticks = 1500};
}

speedup speedup_measure(const palp_tets *tets, palp_material material, const poke *p,
                        double refine_share) {
    poked *a = allocate(1, sizeof *a), *f = allocate(1, sizeof *f);
    speedup r = {.fine = 0};
    double largest = 0, off_force = 0, sum_force = 0;
    begin(a, tets, material, p, refine_share, false);
    begin(f, tets, material, p, refine_share, true);
    for (uint32_t k = 0; k < p->ticks; k++) {
        const palp_frame at = palp_frame_at(ball_at(p, k));
        palp_wrench on_a, on_f;
        palp_dynamic_report report_a, report_f;
        palp_dynamic_tick(&a->body, 0, &at, &on_a, &report_a);
        palp_dynamic_tick(&f->body, 0, &at, &on_f, &report_f);
        r.adaptive += report_a.evaluations;
        r.fine += report_f.evaluations;
        uint32_t nodes = 0;
        for (uint32_t l = 0; l < tets->meta->levels; l++) nodes += report_a.active[l];
        r.most_nodes = nodes > r.most_nodes ? nodes : r.most_nodes;
        for (uint32_t i = 0; i < tets->meta->skin; i++) {
            palp_vec3 x = palp_skin_position(&a->body.dyna, i),
                      y = palp_skin_position(&f->body.dyna, i);
            palp_vec3 rest = palp_vec3_at(tets->rest_m + 3 * (size_t)tets->skin_node[i]);
            double off = (double)palp_norm(palp_sub(x, y));
            r.worst_m = fmax(r.worst_m, off);
            r.mean_m += off / tets->meta->skin / p->ticks;
            r.moved_m = fmax(r.moved_m, (double)palp_norm(palp_sub(y, rest)));
        }
        double off = (double)palp_norm(palp_sub(on_a.force_N, on_f.force_N));
        largest = fmax(largest, (double)palp_norm(on_f.force_N));
        off_force = fmax(off_force, off);
        sum_force += k < 300 ? off / 300 : 0;
    }
    r.force_worst = largest > 0 ? off_force / largest : 0;
    r.force_mean = largest > 0 ? sum_force / largest : 0;
    free(a->memory);
    free(f->memory);
    free(a);
    free(f);
    return r;
}
