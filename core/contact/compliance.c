/* SPDX-License-Identifier: MIT */
/* The compliance between contact points: half-space and modes (surface/surface.h). */
#include "core/contact/contact_internal.h"

static void half_space_row(const palp_contact *c, uint32_t i, uint32_t count, float *restrict row) {
    const float *restrict x = c->column[COL_Y], *restrict y = c->column[COL_Y + 1],
                          *restrict z = c->column[COL_Y + 2], *restrict nx = c->column[COL_N],
                          *restrict ny = c->column[COL_N + 1], *restrict nz = c->column[COL_N + 2],
                          *restrict mx = c->column[COL_M], *restrict my = c->column[COL_M + 1],
                          *restrict mz = c->column[COL_M + 2], *restrict cell = c->column[COL_CELL],
                          *restrict tool = c->column[COL_TOOL];
    const float nu = c->surface.poisson, rest = 0.5f - nu, factor = c->surface.compliance_m2_per_N;
    const float xi = x[i], yi = y[i], zi = z[i], nxi = nx[i], nyi = ny[i], nzi = nz[i];
    const float mxi = mx[i], myi = my[i], mzi = mz[i], si = cell[i], ti = tool[i];
    for (uint32_t j = 0; j < count; j++) {
        float ex = xi - x[j], ey = yi - y[j], ez = zi - z[j];
        float r2 = ex * ex + ey * ey + ez * ez, s2 = si * cell[j];
        float apart =
            palp_abs(ti - tool[j]) > 0.5f ? r2 + SPREAD2 * s2 : palp_max(r2, NEAREST2 * s2);
        float inverse = 1.0f / palp_sqrt(apart);
        ex *= inverse;
        ey *= inverse;
        ez *= inverse;
        float hx = 0.5f * (nxi + nx[j]), hy = 0.5f * (nyi + ny[j]), hz = 0.5f * (nzi + nz[j]);
        float mm = mxi * mx[j] + myi * my[j] + mzi * mz[j];
        float p = mxi * ex + myi * ey + mzi * ez, q = mx[j] * ex + my[j] * ey + mz[j] * ez;
        float s = hx * mx[j] + hy * my[j] + hz * mz[j], t = hx * mxi + hy * myi + hz * mzi;
        row[j] = factor * inverse * ((1.0f - nu) * mm + nu * p * q + rest * (p * s - t * q));
    }
}

/* f B f of one point that stands for its cell, for a unit force along m. */
static float half_space_self(const palp_contact *c, const palp_contact_point *p) {
    float nu = c->surface.poisson, along = palp_dot(p->m, p->at.n);
    return c->surface.compliance_m2_per_N * PALP_LATTICE_SELF / p->cell_m *
           (1.0f - nu + 0.5f * nu * (1.0f - along * along));
}

void palp_contact_compliance_row(palp_contact *contact, uint32_t i, uint32_t count, float *row) {
    palp_contact *c = contact;
    const uint32_t modes = c->level.modes;
    const float *value = c->surface.blob->regular.value;
    half_space_row(c, i, count, row);
    if (i < count) row[i] = half_space_self(c, &c->point[i]);
    for (uint32_t a = 0; a < modes; a += 4u) { /* PALP_MODE_LANES is a multiple of it */
        const float *restrict v0 = c->mode + (size_t)a * c->room, *restrict v1 = v0 + c->room,
                              *restrict v2 = v1 + c->room, *restrict v3 = v2 + c->room;
        const float w0 = value[a] * v0[i], w1 = value[a + 1u] * v1[i], w2 = value[a + 2u] * v2[i],
                    w3 = value[a + 3u] * v3[i];
        for (uint32_t j = 0; j < count; j++)
            row[j] += w0 * v0[j] + w1 * v1[j] + w2 * v2[j] + w3 * v3[j];
    }
    c->work_done += (uint64_t)count * (40u + modes);
}

/* Displacement at a point by the gathered forces and the load of the modes; `f`: its own force. */
static palp_vec3 displacement(palp_contact *c, uint32_t i, palp_vec3 f);

void palp_contact_gather(palp_contact *contact) {
    palp_contact *c = contact;
    const uint32_t modes = c->level.modes, n = c->active_count;
    const uint32_t padded = (n + LANES - 1u) / LANES * LANES;
    for (uint32_t a = 0; a < padded; a++) {
        static const palp_vec3 nowhere = {1e4f, 1e4f, 1e4f};
        bool in = a < n;
        const palp_contact_point *p = &c->point[in ? c->active[a] : 0u];
        const palp_vec3 y = in ? p->at.y : nowhere, f = palp_scale(in ? p->force_N : 0.0f, p->m);
        const float of[11] = {y.x, y.y, y.z, p->at.n.x, p->at.n.y,     p->at.n.z,
                              f.x, f.y, f.z, p->cell_m, (float)p->tool};
        for (uint32_t k = 0; k < 11u; k++) c->pressed[k][a] = of[k];
    }
    for (uint32_t m = 0; m < modes; m++) {
        const float *v = c->mode + (size_t)m * c->room;
        float sum = 0.0f;
        for (uint32_t a = 0; a < n; a++) sum += v[c->active[a]] * c->point[c->active[a]].force_N;
        c->load[m] = c->surface.blob->regular.value[m] * sum;
    }
    c->work_done += (uint64_t)modes * n + 20u * padded;
}

palp_vec3 palp_contact_displacement(palp_contact *contact, uint32_t i) {
    const palp_contact_point *p = &contact->point[i];
    return displacement(contact, i, palp_scale(p->force_N, p->m));
}

static palp_vec3 displacement(palp_contact *c, uint32_t i, palp_vec3 f) {
    const palp_contact_point *point = &c->point[i];
    const float nu = c->surface.poisson, rest = 0.5f - nu;
    const palp_vec3 y = point->at.y, n = point->at.n;
    const float cell = point->cell_m, tool = (float)point->tool;
    float lane[3][LANES] = {{0}};
    for (uint32_t first = 0; first < c->active_count; first += LANES) {
        const float *const *in = (const float *const *)c->pressed;
        for (uint32_t k = 0; k < LANES; k++) {
            uint32_t j = first + k;
            float fx = in[IN_F][j], fy = in[IN_F + 1][j], fz = in[IN_F + 2][j];
            float ex = y.x - in[IN_Y][j], ey = y.y - in[IN_Y + 1][j], ez = y.z - in[IN_Y + 2][j];
            float r2 = ex * ex + ey * ey + ez * ez, s2 = cell * in[IN_CELL][j];
            float apart = palp_abs(tool - in[IN_TOOL][j]) > 0.5f ? r2 + SPREAD2 * s2
                                                                 : palp_max(r2, NEAREST2 * s2);
            float inverse = r2 > 0.0f ? 1.0f / palp_sqrt(apart) : 0.0f;
            ex *= inverse;
            ey *= inverse;
            ez *= inverse;
            float hx = 0.5f * (n.x + in[IN_N][j]), hy = 0.5f * (n.y + in[IN_N + 1][j]),
                  hz = 0.5f * (n.z + in[IN_N + 2][j]);
            float along = nu * (ex * fx + ey * fy + ez * fz) + rest * (hx * fx + hy * fy + hz * fz);
            float out = rest * (ex * fx + ey * fy + ez * fz), plain = 1.0f - nu;
            lane[0][k] += inverse * (plain * fx + along * ex - out * hx);
            lane[1][k] += inverse * (plain * fy + along * ey - out * hy);
            lane[2][k] += inverse * (plain * fz + along * ez - out * hz);
        }
    }
    palp_vec3 u = {0};
    for (uint32_t k = 0; k < LANES; k++)
        u = palp_add(u, (palp_vec3){lane[0][k], lane[1][k], lane[2][k]});
    if (palp_dot(f, f) > 0.0f) {
        float scale = PALP_LATTICE_SELF / cell, along = palp_dot(f, n);
        u = palp_madd(u, scale * (1.0f - 0.5f * nu), f);
        u = palp_madd(u, -scale * 0.5f * nu * along, n);
    }
    u = palp_scale(c->surface.compliance_m2_per_N, u);
    for (uint32_t k = 0; k < 3u; k++)
        u = palp_madd(u, point->at.weight[k], c->node_u_m[c->corner[i][k]]);
    c->work_done += 50u * (uint64_t)c->active_count;
    return u;
}

void palp_contact_tangential(palp_contact *contact, uint32_t tool, const palp_vec3 tangent[2],
                             float normal_N, float entry[3]) {
    palp_contact *c = contact;
    const uint32_t modes = c->level.modes, n = c->active_count;
    float sum[2][2] = {{0}};
    for (uint32_t k = 0; k < 2u; k++) {
        for (uint32_t m = 0; m < modes; m++) c->load[m] = 0.0f;
        for (uint32_t a = 0; a < n; a++) {
            const palp_contact_point *p = &c->point[c->active[a]];
            float share = p->tool == tool ? p->force_N / normal_N : 0.0f;
            palp_vec3 f = palp_scale(share, tangent[k]);
            c->pressed[IN_F][a] = f.x;
            c->pressed[IN_F + 1][a] = f.y;
            c->pressed[IN_F + 2][a] = f.z;
            float row[PALP_MAX_MODES];
            palp_surface_modes(&c->surface, &p->at, f, modes, row, 1);
            for (uint32_t m = 0; m < modes; m++) c->load[m] += row[m];
        }
        for (uint32_t m = 0; m < modes; m++) c->load[m] *= c->surface.blob->regular.value[m];
        for (uint32_t i = 0; i < c->nodes; i++)
            c->node_u_m[i] = palp_surface_corner(&c->surface, c->node[i], modes, c->load);
        for (uint32_t a = 0; a < n; a++) {
            const palp_contact_point *p = &c->point[c->active[a]];
            float share = p->tool == tool ? p->force_N / normal_N : 0.0f;
            palp_vec3 u = displacement(c, c->active[a], palp_scale(share, tangent[k]));
            for (uint32_t e = 0; e < 2u; e++) sum[k][e] += share * palp_dot(u, tangent[e]);
        }
        c->work_done += 10u * (uint64_t)modes * n + 3u * (uint64_t)c->nodes * modes;
    }
    entry[0] = sum[0][0];
    entry[1] = 0.5f * (sum[0][1] + sum[1][0]);
    entry[2] = sum[1][1];
}
