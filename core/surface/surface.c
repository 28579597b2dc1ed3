/* SPDX-License-Identifier: MIT */
#include "core/surface/surface.h"

#define EDGE_SLACK                                                                                 \
    1e-6f /* barycentric weight below 0 that still counts as inside; twice as much                 \
             with every further step, so that no walk turns about a node for ever */

palp_status palp_surface_open(palp_surface *surface, const palp_blob *blob) {
    const palp_meta *m = blob->meta;
    if (blob->regular.modes == 0u) return PALP_ERR_ABSENT;
    *surface =
        (palp_surface){.blob = blob,
                       .compliance_m2_per_N = (1.0f + m->poisson) / (PALP_PI_F * m->young_Pa),
                       .poisson = m->poisson};
    return PALP_OK;
}

palp_status palp_surface_open_zone(palp_surface *surface, palp_assembly *assembly, uint32_t zone) {
    palp_status status = palp_surface_open(surface, &assembly->zones->blob[zone]);
    if (status != PALP_OK) return status;
    surface->assembly = assembly;
    surface->zone = zone;
    return PALP_OK;
}

/* ---- geometry ---- */

typedef struct {
    palp_vec3 x[3], n[3];
} corners;

static corners corners_of(const palp_surface *s, uint32_t triangle) {
    const uint32_t *v = s->blob->triangle + 3u * (size_t)triangle;
    corners c;
    for (uint32_t k = 0; k < 3u; k++) {
        c.x[k] = palp_vec3_at(s->blob->rest_m + 3u * (size_t)v[k]);
        c.n[k] = palp_vec3_at(s->blob->normal + 3u * (size_t)v[k]);
    }
    return c;
}

/* Twice the signed volumes that the line spans with the edges, over their sum the barycentric
 * weights; all negative where it enters. */
static float edge_volumes(const palp_surface *s, uint32_t triangle, palp_vec3 origin,
                          palp_vec3 direction, float volume[3]) {
    const uint32_t *v = s->blob->triangle + 3u * (size_t)triangle;
    palp_vec3 x[3];
    for (uint32_t k = 0; k < 3u; k++) x[k] = palp_vec3_at(s->blob->rest_m + 3u * (size_t)v[k]);
    for (uint32_t k = 0; k < 3u; k++) {
        palp_vec3 a = x[(k + 1u) % 3u], edge = palp_sub(x[(k + 2u) % 3u], a);
        volume[k] = palp_dot(direction, palp_cross(palp_sub(a, origin), edge));
    }
    return volume[0] + volume[1] + volume[2];
}

static void fill_point(const palp_surface *s, palp_surface_point *p) {
    const corners c = corners_of(s, p->triangle);
    palp_vec3 normal = {0};
    p->q = (palp_vec3){0};
    for (uint32_t k = 0; k < 3u; k++) {
        p->q = palp_madd(p->q, p->weight[k], c.x[k]);
        normal = palp_madd(normal, p->weight[k], c.n[k]);
    }
    p->y = p->q;
    for (uint32_t k = 0; k < 3u; k++) {
        float off = palp_dot(palp_sub(c.x[k], p->q), c.n[k]);
        p->y = palp_madd(p->y, 0.5f * p->weight[k] * off, c.n[k]);
    }
    p->n = palp_scale(1.0f / palp_max(palp_norm(normal), 0.05f), normal);
}

palp_walk palp_surface_walk(const palp_surface *surface, palp_vec3 origin, palp_vec3 direction,
                            uint32_t *crossings, palp_surface_point *point, uint32_t *edge) {
    float slack = EDGE_SLACK;
    for (uint32_t step = 0; step < PALP_SURFACE_CROSSINGS; step++) {
        float volume[3];
        if (*crossings == 0u) return PALP_MISSED;
        (*crossings)--;
        float sum = edge_volumes(surface, point->triangle, origin, direction, volume);
        if (!(sum < 0.0f)) return PALP_MISSED;
        uint32_t out = 0;
        for (uint32_t k = 1; k < 3u; k++) {
            if (volume[k] > volume[out]) out = k;
        }
        if (volume[out] > -slack * sum) {
            uint32_t across = surface->blob->regular.across[3u * (size_t)point->triangle + out];
            if (across == point->triangle) {
                *edge = out;
                return PALP_AT_SEAM;
            }
            point->triangle = across;
            slack = palp_min(2.0f * slack, 1e-3f);
            continue;
        }
        float total = 0.0f;
        for (uint32_t k = 0; k < 3u; k++) {
            point->weight[k] = palp_max(volume[k] / sum, 0.0f);
            total += point->weight[k];
        }
        for (uint32_t k = 0; k < 3u; k++) point->weight[k] /= total;
        fill_point(surface, point);
        return PALP_ENTERED;
    }
    return PALP_MISSED;
}

bool palp_surface_is_within(const palp_blob *blob, palp_vec3 x, float reach_m) {
    const palp_meta *m = blob->meta;
    const float at[3] = {x.x, x.y, x.z};
    for (uint32_t k = 0; k < 3u; k++) {
        if (at[k] < m->box_min_m[k] - reach_m || at[k] > m->box_max_m[k] + reach_m) return false;
    }
    return true;
}

bool palp_surface_shoot(const palp_surface *surface, palp_vec3 origin, palp_vec3 direction,
                        uint32_t *crossings, palp_surface_point *point) {
    uint32_t edge;
    return palp_surface_walk(surface, origin, direction, crossings, point, &edge) == PALP_ENTERED;
}

void palp_surface_gradients(const palp_surface *surface, uint32_t triangle, palp_vec3 gradient[3]) {
    const corners c = corners_of(surface, triangle);
    palp_vec3 normal = palp_cross(palp_sub(c.x[1], c.x[0]), palp_sub(c.x[2], c.x[0]));
    float scale = 1.0f / palp_max(palp_dot(normal, normal), 1e-37f);
    for (uint32_t k = 0; k < 3u; k++) {
        palp_vec3 edge = palp_sub(c.x[(k + 2u) % 3u], c.x[(k + 1u) % 3u]);
        gradient[k] = palp_scale(scale, palp_cross(normal, edge));
    }
}

/* m += a b^T */
static void add_outer(float m[9], palp_vec3 a, palp_vec3 b) {
    const float l[3] = {a.x, a.y, a.z}, r[3] = {b.x, b.y, b.z};
    for (uint32_t e = 0; e < 9u; e++) m[e] += l[e / 3u] * r[e % 3u];
}

void palp_surface_slopes(const palp_surface *surface, const palp_surface_point *point,
                         float dy_dq[9], float dn_dq[9]) {
    const corners c = corners_of(surface, point->triangle);
    palp_vec3 gradient[3], normal = {0};
    palp_surface_gradients(surface, point->triangle, gradient);
    for (uint32_t e = 0; e < 9u; e++) {
        dy_dq[e] = e % 4u == 0u ? 1.0f : 0.0f;
        dn_dq[e] = 0.0f;
    }
    for (uint32_t k = 0; k < 3u; k++) normal = palp_madd(normal, point->weight[k], c.n[k]);
    float shrink = 1.0f / palp_max(palp_norm(normal), 0.05f);
    for (uint32_t k = 0; k < 3u; k++) {
        float off = palp_dot(palp_sub(c.x[k], point->q), c.n[k]);
        palp_vec3 slope = palp_scale(0.5f * off, gradient[k]);
        slope = palp_madd(slope, -0.5f * point->weight[k], c.n[k]);
        add_outer(dy_dq, c.n[k], slope);
        palp_vec3 across = palp_madd(c.n[k], -palp_dot(c.n[k], point->n), point->n);
        add_outer(dn_dq, across, palp_scale(shrink, gradient[k]));
    }
}

/* ---- the regular part ---- */

/* sum += x u_x + y u_y + z u_z for `modes` modes, a multiple of PALP_MODE_LANES. */
static void add_corner(float *restrict sum, const int16_t *restrict u, uint32_t stored,
                       uint32_t modes, palp_vec3 d) {
    const int16_t *restrict v = u + stored, *restrict w = v + stored;
    for (uint32_t a = 0; a < modes; a += PALP_MODE_LANES) {
        for (uint32_t k = a; k < a + PALP_MODE_LANES; k++)
            sum[k] += d.x * (float)u[k] + d.y * (float)v[k] + d.z * (float)w[k];
    }
}

void palp_surface_modes(const palp_surface *surface, const palp_surface_point *point, palp_vec3 d,
                        uint32_t modes, float *row, size_t stride) {
    const palp_blob *b = surface->blob;
    const uint32_t *v = b->triangle + 3u * (size_t)point->triangle, stored = b->regular.modes;
    float sum[PALP_MAX_MODES];
    for (uint32_t a = 0; a < modes; a += PALP_MODE_LANES) {
        for (uint32_t k = a; k < a + PALP_MODE_LANES; k++) sum[k] = 0.0f;
    }
    for (uint32_t k = 0; k < 3u; k++) {
        add_corner(sum, b->regular.vector + 3u * (size_t)v[k] * stored, stored, modes,
                   palp_scale(point->weight[k] / PALP_MODE_UNIT, d));
    }
    for (uint32_t a = 0; a < modes; a += PALP_MODE_LANES) {
        for (uint32_t k = a; k < a + PALP_MODE_LANES; k++) row[k * stride] = sum[k];
    }
}

palp_vec3 palp_surface_corner(const palp_surface *surface, uint32_t node, uint32_t modes,
                              const float *load) {
    const palp_regular *g = &surface->blob->regular;
    float sum[3];
    for (uint32_t axis = 0; axis < 3u; axis++) {
        const int16_t *restrict u = g->vector + (3u * (size_t)node + axis) * g->modes;
        float lane[PALP_MODE_LANES] = {0};
        for (uint32_t a = 0; a < modes; a += PALP_MODE_LANES) {
            for (uint32_t k = 0; k < PALP_MODE_LANES; k++) lane[k] += load[a + k] * (float)u[a + k];
        }
        sum[axis] = 0.0f;
        for (uint32_t k = 0; k < PALP_MODE_LANES; k++) sum[axis] += lane[k];
    }
    return palp_scale(1.0f / PALP_MODE_UNIT, (palp_vec3){sum[0], sum[1], sum[2]});
}
