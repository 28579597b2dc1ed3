/* SPDX-License-Identifier: MIT */
#include "port/linux/picture.h"
#include "port/host/util.h"
#include <string.h>

static void put(float *to, palp_vec3 x) {
    const float v[3] = {x.x, x.y, x.z};
    memcpy(to, v, sizeof v);
}

picture *picture_open(const scene_setup *s) {
    if (s->part[0].kind != PALP_BODY_ELASTIC) return NULL;
    picture *p = allocate(1, sizeof *p);
    const palp_blob *b = p->blob = &s->part[0].blob;
    const size_t nodes = b->meta->nodes, bytes = palp_field_memsize(b);
    p->at = s->body[0].at;
    p->field_memory = allocate_aligned(bytes, 1);
    if (palp_field_init(&p->field, b, p->field_memory, bytes) != PALP_OK)
        die(EXIT_WORK, "the surface of %s does not open", s->file->body[0].name);
    p->rest_m = allocate(3 * nodes, sizeof *p->rest_m);
    p->at_m = allocate(3 * nodes, sizeof *p->at_m);
    p->fixed = allocate(nodes, 1);
    for (size_t i = 0; i < nodes; i++) {
        put(p->rest_m + 3 * i, palp_carry(&p->at, palp_vec3_at(b->rest_m + 3 * i)));
        p->fixed[i] = palp_node_is_fixed(b, (uint32_t)i) ? 1 : 0;
    }
    motion *m = &p->motion;
    m->parts = 1;
    m->part[0] = (motion_part){.nodes = b->meta->nodes,
                               .triangles = b->meta->triangles,
                               .triangle = b->triangle,
                               .fixed = p->fixed,
                               .rest_m = p->rest_m};
    m->tools = s->config.tools;
    for (uint32_t t = 0; t < m->tools; t++) m->tool[t] = &s->tool[t].tool;
    motion_begin(m, MOTION_PAGE_BYTES);
    return p;
}

/* The surface under forces, in the scene; and its displacements, where asked for. */
static void solve(picture *p, const palp_load *load, uint32_t loads, float *displacement_m) {
    const palp_blob *b = p->blob;
    palp_field_update(&p->field, load, loads);
    const float *x = palp_field_reconstruct(&p->field, b->meta->levels - 1);
    memcpy(p->at_m, p->rest_m, 3 * (size_t)b->meta->nodes * sizeof *p->at_m);
    for (uint32_t s = 0; s < b->domain[PALP_FREE].slots; s++) {
        const size_t node = b->domain[PALP_FREE].node[s];
        const palp_vec3 u = palp_vec3_at(x + PALP_FIELD_LANES * (size_t)s);
        put(p->at_m + 3 * node,
            palp_add(palp_vec3_at(p->rest_m + 3 * node), palp_rotate(p->at.r, u)));
        if (displacement_m != NULL) put(displacement_m + 3 * node, u);
    }
}

static void keep_peak(picture *p, double t_s, const tick_record *t) {
    for (uint32_t h = 0; h < t->hands; h++) {
        const float force = palp_norm(t->hand[h].report.force_N);
        if (force <= p->peak_N) continue;
        p->peak_N = force;
        p->peak_s = t_s;
        p->peak_loads = t->load_count;
        memcpy(p->peak_load, t->load, t->load_count * sizeof t->load[0]);
        memcpy(p->peak_tool, t->tool, sizeof p->peak_tool);
    }
}

void picture_take(picture *p, double t_s, const tick_record *t) {
    const float *const at[1] = {p->at_m};
    keep_peak(p, t_s, t);
    if (!motion_wants(&p->motion, t_s)) return;
    solve(p, t->load, t->load_count, NULL);
    motion_add(&p->motion, t_s, at, t->tool);
}

void picture_end(picture *p, float *displacement_m) {
    const float *const at[1] = {p->at_m};
    solve(p, p->peak_load, p->peak_loads, displacement_m);
    if (p->peak_N > 0) motion_insert(&p->motion, p->peak_s, at, p->peak_tool);
}
