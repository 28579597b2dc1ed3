/* SPDX-License-Identifier: MIT */
#include "point.h"

#define LARGEST_MOVE 0.25f /* of the mask's radius, per step */
#define ABOVE 0.6f         /* of the mask's radius: height of the search above the point */

/* Weights at c, and the gradient of sum_i m_i s_i for any s by `slope_of`. */
typedef struct {
    float total;   /* sum a_i w_i */
    palp_vec3 sum; /* sum a_i grad w_i */
    float radius2;
} mask;

static float area_of(const palp_node_contact *c, uint32_t i) {
    return c->blob->level[c->candidate[i].level].area_m2[c->candidate[i].slot];
}

static float lobe(const mask *m, palp_vec3 off) {
    float s = palp_dot(off, off) / m->radius2;
    return s < 1.0f ? 1.0f - s : 0.0f;
}

static mask place_mask(palp_point *p, const palp_node_contact *c, palp_vec3 at) {
    float r = c->tools[0].ball[0].radius_m;
    mask m = {.radius2 = r * r};
    for (uint32_t i = 0; i < c->count; i++) {
        float area = area_of(c, i);
        palp_vec3 off = palp_sub(c->candidate[i].x, at);
        float w = lobe(&m, off);
        p->weight[i] = area * w * w;
        m.total += p->weight[i];
        m.sum = palp_madd(m.sum, 4.0f * area * w / m.radius2, off);
    }
    for (uint32_t i = 0; i < c->count && m.total > 0.0f; i++) p->weight[i] /= m.total;
    return m;
}

/* grad m_i */
static palp_vec3 slope_of(const palp_point *p, const palp_node_contact *c, const mask *m, uint32_t i,
                          palp_vec3 at) {
    float area = area_of(c, i);
    palp_vec3 off = palp_sub(c->candidate[i].x, at);
    palp_vec3 own = palp_scale(4.0f * area * lobe(m, off) / m->radius2, off);
    return palp_scale(1.0f / m->total, palp_madd(own, -p->weight[i], m->sum));
}

/* Depth, compliance and force with the point at `at`. */
static void press(palp_point *p, palp_node_contact *c, palp_vec3 at) {
    mask m = place_mask(p, c, at);
    palp_vec3 x = {0}, n = {0}, depth_slope = {0}, compliance_slope = {0};
    p->lambda_N = p->depth_m = p->compliance_m_per_N = 0.0f;
    p->force_N = (palp_vec3){0};
    p->tool_m = at;
    c->work_done += (uint64_t)c->count * (c->count + 40u);
    if (!(m.total > 0.0f)) return;
    for (uint32_t i = 0; i < c->count; i++) {
        x = palp_madd(x, p->weight[i], palp_sub(c->candidate[i].x, at));
        n = palp_madd(n, p->weight[i], c->candidate[i].n);
    }
    float g = 0.0f;
    for (uint32_t i = 0; i < c->count; i++) {
        palp_vec3 slope = slope_of(p, c, &m, i, at);
        float row = 0.0f;
        for (uint32_t j = 0; j < c->count; j++) row += palp_node_contact_g(c, i, j) * p->weight[j];
        g += p->weight[i] * row;
        compliance_slope = palp_madd(compliance_slope, 2.0f * row, slope);
        float level = palp_dot(palp_sub(c->candidate[i].x, at), n) + palp_dot(x, c->candidate[i].n);
        depth_slope = palp_madd(depth_slope, level, slope);
    }
    /* x is taken from `at`, which moves: its own motion cancels against that of the weights' sum.
     */
    depth_slope = palp_sub(depth_slope, n);
    p->axis = palp_scale(1.0f / palp_max(palp_norm(n), 1e-6f), n);
    p->depth_m = palp_dot(x, n);
    p->compliance_m_per_N = g;
    if (!(p->depth_m > 0.0f) || !(g > 0.0f)) {
        p->depth_m = 0.0f;
        return;
    }
    p->lambda_N = p->depth_m / g;
    p->force_N = palp_scale(-p->lambda_N, depth_slope);
    p->force_N = palp_madd(p->force_N, 0.5f * p->lambda_N * p->lambda_N, compliance_slope);
}

palp_vec3 palp_point_center(const palp_point *point, const palp_node_contact *contact, palp_vec3 at) {
    palp_vec3 n = point->lambda_N > 0.0f
                      ? point->axis
                      : palp_vec3_at(contact->blob->normal + 3u * contact->nearest[0][0]);
    return palp_madd(at, ABOVE * contact->tools[0].ball[0].radius_m, n);
}

palp_vec3 palp_point_solve(palp_point *point, palp_node_contact *contact, palp_vec3 from,
                           palp_grip grip) {
    palp_point *p = point;
    if (!(grip.stiffness_N_per_m > 0.0f)) {
        press(p, contact, grip.held_m);
        return p->force_N;
    }
    float k = grip.stiffness_N_per_m;
    float farthest = LARGEST_MOVE * contact->tools[0].ball[0].radius_m;
    palp_vec3 at = from;
    for (uint32_t step = 0; step < PALP_POINT_STEPS; step++) {
        press(p, contact, at);
        /* Newton with the stiffness along the axis: (k + n n^T / g) move = k (held - at) + F */
        palp_vec3 pull = palp_madd(p->force_N, k, palp_sub(grip.held_m, at));
        float contact_k = p->lambda_N > 0.0f ? 1.0f / p->compliance_m_per_N : 0.0f;
        float along = palp_dot(pull, p->axis);
        palp_vec3 move = palp_scale(1.0f / k, pull);
        move = palp_madd(move, along / (k + contact_k) - along / k, p->axis);
        float length = palp_norm(move);
        if (length > farthest) move = palp_scale(farthest / length, move);
        at = palp_add(at, move);
    }
    press(p, contact, at);
    return palp_scale(k, palp_sub(at, grip.held_m));
}

palp_vec3 palp_force_shade(palp_vec3 force_N, palp_vec3 normal, palp_vec3 detail, float limit) {
    float along = palp_dot(force_N, normal), cosine = palp_dot(detail, normal);
    if (!(cosine > 0.0f)) return force_N;
    palp_vec3 lean = palp_sub(palp_scale(1.0f / cosine, detail), normal);
    float length = palp_norm(lean);
    if (length > limit) lean = palp_scale(limit / length, lean);
    palp_vec3 turned = palp_add(normal, lean);
    turned = palp_scale(along / palp_norm(turned), turned);
    return palp_add(turned, palp_madd(force_N, -along, normal));
}
