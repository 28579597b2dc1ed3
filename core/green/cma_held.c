/* SPDX-License-Identifier: MIT */
#include "cma_internal.h"

#define LOOSE 1e-5f /* what a rigid motion may move what is prescribed by, over its own size */

/* A rigid motion: translation, and rotation about the body's middle times its size. */
typedef struct {
    float v[6];
} motion;

static float product(const motion *a, const motion *b) {
    float sum = 0.0f;
    for (uint32_t k = 0; k < 6u; k++) sum += a->v[k] * b->v[k];
    return sum;
}

/* What a rigid motion moves a place by along a direction, as a row: e . (t + r x d). */
static motion row_of(palp_vec3 direction, palp_vec3 from_middle) {
    const palp_vec3 turn = palp_cross(from_middle, direction);
    return (motion){{direction.x, direction.y, direction.z, turn.x, turn.y, turn.z}};
}

/* Whether all of node i's displacement is prescribed. */
static bool is_whole(const palp_cma *c, uint32_t i) {
    if (c->state[i] == 0u) return palp_node_is_fixed(c->blob, i);
    return c->state[i] == 1u + (uint32_t)PALP_PRESCRIBE_DISPLACEMENT;
}

/* Directions along which node i is prescribed: all, its normal, or none. */
static uint32_t prescribed(const palp_cma *c, uint32_t i, palp_vec3 direction[3]) {
    direction[0] = (palp_vec3){1.0f, 0.0f, 0.0f};
    direction[1] = (palp_vec3){0.0f, 1.0f, 0.0f};
    direction[2] = (palp_vec3){0.0f, 0.0f, 1.0f};
    if (is_whole(c, i)) return palp_blob_has(c->blob, PALP_META_SCALAR) ? 1u : 3u;
    direction[0] = palp_vec3_at(c->blob->normal + 3u * i);
    return c->state[i] == 1u + (uint32_t)PALP_PRESCRIBE_NORMAL ? 1u : 0u;
}

/* A row without its part along what is known; and how much that is. */
static motion rest_of(motion row, const motion *known, uint32_t count, float *size2) {
    for (uint32_t k = 0; k < count; k++) {
        const float along = product(&row, &known[k]);
        for (uint32_t i = 0; i < 6u; i++) row.v[i] -= along * known[k].v[i];
    }
    *size2 = product(&row, &row);
    return row;
}

/* Of all rows the one that has most beyond what is known. */
static motion farthest(const palp_cma *c, const motion *known, uint32_t count, float *size2) {
    const palp_meta *m = c->blob->meta;
    const palp_vec3 low = palp_vec3_at(m->box_min_m), high = palp_vec3_at(m->box_max_m);
    const palp_vec3 middle = palp_scale(0.5f, palp_add(low, high));
    const float over = 1.0f / palp_max(0.5f * palp_norm(palp_sub(high, low)), 1e-30f);
    motion best = {{0.0f}};
    *size2 = 0.0f;
    for (uint32_t i = 0; i < m->nodes; i++) {
        palp_vec3 direction[3];
        const uint32_t directions = prescribed(c, i, direction);
        const palp_vec3 at = palp_vec3_at(c->blob->rest_m + 3u * i);
        for (uint32_t k = 0; k < directions; k++) {
            float here2;
            const palp_vec3 from_middle = palp_scale(over, palp_sub(at, middle));
            const motion rest = rest_of(row_of(direction[k], from_middle), known, count, &here2);
            if (here2 <= *size2) continue;
            *size2 = here2;
            best = rest;
        }
    }
    return best;
}

/* Rounding and thresholding hide that a body is loose, so this is looked at: the rows of what is
 * prescribed must span all rigid motions. As long as no fixed node is let go they do. */
bool palp_cma_is_held(const palp_cma *c) {
    const uint32_t motions = palp_blob_has(c->blob, PALP_META_SCALAR) ? 1u : 6u;
    bool released = false;
    motion known[6];
    for (uint32_t i = 0; i < c->blob->meta->nodes; i++)
        released = released || (palp_node_is_fixed(c->blob, i) && !is_whole(c, i));
    for (uint32_t k = 0; k < motions && released; k++) {
        float size2;
        known[k] = farthest(c, known, k, &size2);
        if (!(size2 > LOOSE * LOOSE)) return false;
        const float over = 1.0f / palp_sqrt(size2);
        for (uint32_t i = 0; i < 6u; i++) known[k].v[i] *= over;
    }
    return true;
}
