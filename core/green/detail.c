/* SPDX-License-Identifier: MIT */
#include "detail.h"

static void store(float *to, palp_vec3 v) {
    to[0] = v.x;
    to[1] = v.y;
    to[2] = v.z;
}

/* Unit vertex normals, by triangles weighted with their areas. */
static void find_normals(const palp_detail *d, const float *vertex, float *normal) {
    for (uint32_t i = 0; i < 3u * d->vertices; i++) normal[i] = 0.0f;
    for (uint32_t t = 0; t < d->triangles; t++) {
        const uint32_t *v = d->triangle + 3u * t;
        palp_vec3 a = palp_vec3_at(vertex + 3u * v[0]);
        palp_vec3 n = palp_cross(palp_sub(palp_vec3_at(vertex + 3u * v[1]), a),
                                 palp_sub(palp_vec3_at(vertex + 3u * v[2]), a));
        for (uint32_t k = 0; k < 3; k++)
            store(normal + 3u * v[k], palp_add(palp_vec3_at(normal + 3u * v[k]), n));
    }
    for (uint32_t i = 0; i < d->vertices; i++) {
        palp_vec3 n = palp_vec3_at(normal + 3u * i);
        float length = palp_norm(n);
        if (length > 0.0f) store(normal + 3u * i, palp_scale(1.0f / length, n));
    }
}

void palp_detail_surface(const palp_blob *blob, const float *position_m, float *vertex_m,
                         float *normal) {
    const palp_detail *d = &blob->detail;
    if (d->vertices == 0u) return;
    for (uint32_t i = 0; i < d->vertices; i++) {
        palp_vec3 x = {0};
        for (uint32_t k = d->offset[i]; k < d->offset[i + 1u]; k++)
            x = palp_madd(x, d->weight[k], palp_vec3_at(position_m + 3u * d->node[k]));
        store(vertex_m + 3u * i, x);
    }
    find_normals(d, vertex_m, normal);
    for (uint32_t i = 0; i < d->vertices; i++) {
        palp_vec3 x = palp_vec3_at(vertex_m + 3u * i);
        store(vertex_m + 3u * i, palp_madd(x, d->height_m[i], palp_vec3_at(normal + 3u * i)));
    }
    find_normals(d, vertex_m, normal);
}

typedef struct {
    const float *vertex, *normal;
    palp_vec3 x, sum;
    float radius2;
} gathering;

static void gather(const palp_detail *d, uint32_t node, gathering *g) {
    for (uint32_t k = d->near[node]; k < d->near[node + 1u]; k++) {
        uint32_t v = d->list[k];
        palp_vec3 off = palp_sub(palp_vec3_at(g->vertex + 3u * v), g->x);
        float w = 1.0f - palp_dot(off, off) / g->radius2;
        if (w > 0.0f) g->sum = palp_madd(g->sum, w * w, palp_vec3_at(g->normal + 3u * v));
    }
}

palp_vec3 palp_detail_normal(const palp_blob *blob, const float *vertex_m, const float *normal,
                             uint32_t node, palp_vec3 x, float radius_m) {
    palp_vec3 own = palp_vec3_at(blob->normal + 3u * node);
    gathering g = {.vertex = vertex_m, .normal = normal, .x = x, .radius2 = radius_m * radius_m};
    if (blob->detail.vertices == 0u) return own;
    gather(&blob->detail, node, &g);
    for (uint32_t k = blob->ring_offset[node]; k < blob->ring_offset[node + 1u]; k++)
        gather(&blob->detail, blob->ring[k], &g);
    float length = palp_norm(g.sum);
    return length > 0.0f ? palp_scale(1.0f / length, g.sum) : own;
}
