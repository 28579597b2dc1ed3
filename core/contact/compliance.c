/* SPDX-License-Identifier: MIT */
/* The compliance between contact points: half-space and modes (surface/surface.h). */
#include "core/base/apart.h"
#include "core/base/linalg.h"
#include "core/contact/contact_internal.h"

#define NO_SIDE 0xffffu /* among those in contact: padding */

palp_half_space palp_contact_half_space(const palp_contact *contact, uint32_t body,
                                        uint32_t other) {
    const palp_surface *a = &contact->surface[body], *b = &contact->surface[other];
    if (body == other) return (palp_half_space){a->compliance_m2_per_N, a->poisson};
    return (palp_half_space){0.5f * (a->compliance_m2_per_N + b->compliance_m2_per_N),
                             0.5f * (a->poisson + b->poisson)};
}

/* What a row of the half-space needs of its own side: place, normal, direction of the force, cell
 * and patch. */
typedef struct {
    float x, y, z, nx, ny, nz, mx, my, mz, cell, patch;
    float nu, rest, factor; /* of the half-space */
} row_side;

/* The same of side j, from the columns of all. */
static inline float half_space_between(const row_side *i, const float *const *column, size_t j) {
    const float mx = column[COL_M][j], my = column[COL_M + 1][j], mz = column[COL_M + 2][j];
    float ex = i->x - column[COL_Y][j], ey = i->y - column[COL_Y + 1][j],
          ez = i->z - column[COL_Y + 2][j];
    float r2 = ex * ex + ey * ey + ez * ez, s2 = i->cell * column[COL_CELL][j];
    float apart = palp_abs(i->patch - column[COL_PATCH][j]) > 0.5f ? r2 + SPREAD2 * s2
                                                                   : palp_max(r2, NEAREST2 * s2);
    float inverse = 1.0f / palp_sqrt(apart);
    ex *= inverse;
    ey *= inverse;
    ez *= inverse;
    float hx = 0.5f * (i->nx + column[COL_N][j]), hy = 0.5f * (i->ny + column[COL_N + 1][j]),
          hz = 0.5f * (i->nz + column[COL_N + 2][j]);
    float mm = i->mx * mx + i->my * my + i->mz * mz;
    float p = i->mx * ex + i->my * ey + i->mz * ez, q = mx * ex + my * ey + mz * ez;
    float a = hx * mx + hy * my + hz * mz, b = hx * i->mx + hy * i->my + hz * i->mz;
    return i->factor * inverse * ((1.0f - i->nu) * mm + i->nu * p * q + i->rest * (p * a - b * q));
}

/* Of side i with the sides first..end - 1, all on one body. */
static void half_space_row(const palp_contact *c, palp_half_space h, uint32_t i, uint32_t first,
                           uint32_t end, float *restrict row) {
    const float *const *column = (const float *const *)c->column;
    const row_side side = {column[COL_Y][i],     column[COL_Y + 1][i],
                           column[COL_Y + 2][i], column[COL_N][i],
                           column[COL_N + 1][i], column[COL_N + 2][i],
                           column[COL_M][i],     column[COL_M + 1][i],
                           column[COL_M + 2][i], column[COL_CELL][i],
                           column[COL_PATCH][i], h.poisson,
                           0.5f - h.poisson,     h.factor};
    const size_t whole = (end - first) / PALP_BESIDE;
    for (size_t q = 0; q < whole; q++) {
        const size_t at = first + PALP_BESIDE * q;
        float lane[PALP_BESIDE];
        for (size_t e = 0; e < PALP_BESIDE; e++)
            lane[e] = half_space_between(&side, column, at + e);
        for (size_t e = 0; e < PALP_BESIDE; e++) row[at + e] = lane[e];
    }
    for (size_t j = first + PALP_BESIDE * whole; j < end; j++) /* at most 3 */
        row[j] = half_space_between(&side, column, j);
}

/* f B f of one side that stands for its cell, for a unit force along m. */
static float half_space_self(const palp_contact *c, uint32_t body, uint32_t side) {
    const palp_surface *s = &c->surface[body];
    const palp_vec3 m = palp_contact_column(c, COL_M, side),
                    n = palp_contact_column(c, COL_N, side);
    float nu = s->poisson, along = palp_dot(m, n);
    return s->compliance_m2_per_N * PALP_LATTICE_SELF / c->column[COL_CELL][side] *
           (1.0f - nu + 0.5f * nu * (1.0f - along * along));
}

static void modes_row(const palp_contact *c, uint32_t i, uint32_t first, uint32_t end,
                      float *restrict row) {
    const uint32_t modes = c->level.modes;
    const size_t whole = (end - first) / PALP_BESIDE;
    const float *value = c->surface[0].blob->regular.value;
    for (uint32_t a = 0; a < modes; a += 4u) { /* PALP_MODE_LANES is a multiple of it */
        const float *restrict v0 = c->mode + (size_t)a * c->side_room,
                              *restrict v1 = v0 + c->side_room, *restrict v2 = v1 + c->side_room,
                              *restrict v3 = v2 + c->side_room;
        const float w0 = value[a] * v0[i], w1 = value[a + 1u] * v1[i], w2 = value[a + 2u] * v2[i],
                    w3 = value[a + 3u] * v3[i];
        for (size_t q = 0; q < whole; q++) {
            for (size_t e = 0; e < PALP_BESIDE; e++) {
                const size_t j = first + PALP_BESIDE * q + e;
                row[j] += w0 * v0[j] + w1 * v1[j] + w2 * v2[j] + w3 * v3[j];
            }
        }
        for (size_t j = first + PALP_BESIDE * whole; j < end; j++) /* at most 3 */
            row[j] += w0 * v0[j] + w1 * v1[j] + w2 * v2[j] + w3 * v3[j];
    }
}

/* Where the other sides of the points below `end` end. */
static uint32_t others_end(const palp_contact *c, uint32_t end) {
    for (uint32_t j = end; j-- > 0u && c->sides > c->count;) {
        if (c->other_side[j] > 0u) return c->other_side[j] + 1u;
    }
    return c->count;
}

/* What does not ask which bodies the sides lie on. */
static void common_row(palp_contact *c, uint32_t side, uint32_t first, uint32_t end, float *row) {
    modes_row(c, side, first, end, row);
    if (c->assembly != NULL) palp_contact_bond_row(c, side, first, end, row);
    c->work_done += (uint64_t)(end - first) * (40u + c->level.modes);
}

/* row[j] of one side with those of the points below `end`. */
static void row_of_side(palp_contact *c, uint32_t side, uint32_t end, float *row) {
    const uint32_t others = others_end(c, end), body = palp_contact_body(c, side);
    for (uint32_t k = 0; k < c->runs; k++) {
        const palp_contact_run *run = &c->run[k];
        const uint32_t most = run->first >= c->count ? others : end;
        const uint32_t last = run->end < most ? run->end : most;
        if (run->first >= last) continue;
        half_space_row(c, palp_contact_half_space(c, body, run->body), side, run->first, last, row);
        if (side >= run->first && side < last) row[side] = half_space_self(c, body, side);
    }
    common_row(c, side, 0, end, row);
    if (others > c->count) common_row(c, side, c->count, others, row);
}

/* What the points feel of one side, both of theirs together. */
static void fold(const palp_contact *c, uint32_t end, float *row) {
    for (uint32_t j = 0; j < end && c->sides > c->count; j++) {
        if (c->other_side[j] > 0u) row[j] += row[c->other_side[j]];
    }
}

void palp_contact_compliance_row(palp_contact *c, uint32_t i, float *row) {
    float *first = c->side_row[0], *second = c->side_row[1];
    if (c->sides == c->count) {
        row_of_side(c, i, i + 1u, row);
        return;
    }
    row_of_side(c, i, i + 1u, first);
    fold(c, i + 1u, first);
    for (uint32_t j = 0; j <= i; j++) row[j] = first[j];
    if (c->other_side[i] == 0u) return;
    row_of_side(c, c->other_side[i], i + 1u, second);
    fold(c, i + 1u, second);
    for (uint32_t j = 0; j <= i; j++) row[j] += second[j];
}

/* ---- displacements ---- */

static float force_of(const palp_contact *c, uint32_t side) {
    return c->point[c->side_point[side]].force_N;
}

/* The forces of one body's sides behind those of the others; returns where they end. */
static uint32_t gather_body(palp_contact *c, uint32_t body, uint32_t at) {
    static const palp_vec3 nowhere = {1e4f, 1e4f, 1e4f};
    const uint32_t first = at;
    for (uint32_t r = 0; r < c->runs; r++) {
        for (uint32_t s = c->run[r].first; s < c->run[r].end && c->run[r].body == body; s++) {
            const float f = force_of(c, s);
            if (!(f > 0.0f)) continue;
            for (uint32_t k = 0; k < 11u; k++)
                c->pressed[k][at] = c->column[k][s] * (k >= IN_F && k < IN_CELL ? f : 1.0f);
            c->pressed_side[at++] = (uint16_t)s;
        }
    }
    /* at most LANES - 1 */
    for (; at % LANES != 0u; at++) {
        const float of[11] = {nowhere.x, nowhere.y, nowhere.z, 0.0f, 0.0f, 1.0f,
                              0.0f,      0.0f,      0.0f,      1.0f, 0.0f};
        for (uint32_t k = 0; k < 11u; k++) c->pressed[k][at] = of[k];
        c->pressed_side[at] = NO_SIDE;
    }
    c->pressed_of[body] = (palp_contact_run){body, first, at};
    return at;
}

void palp_contact_gather(palp_contact *c) {
    uint32_t at = 0;
    for (uint32_t b = 0; b < c->bodies; b++) at = gather_body(c, b, at);
    for (uint32_t m = 0; m < c->level.modes; m++) {
        const float *v = c->mode + (size_t)m * c->side_room;
        float sum = 0.0f;
        for (uint32_t k = 0; k < at; k++) {
            const uint32_t s = c->pressed_side[k];
            if (s != NO_SIDE) sum += v[s] * force_of(c, s);
        }
        c->load[m] = c->surface[0].blob->regular.value[m] * sum;
    }
    c->work_done += ((uint64_t)c->level.modes + 20u) * at;
}

PALP_APART void palp_contact_displace_corners(palp_contact *c) {
    for (uint32_t k = 0; k < c->nodes; k++)
        c->node_u_m[k] =
            palp_surface_corner(&c->surface[c->node_body[k]], c->node[k], c->level.modes, c->load);
    c->work_done += 3u * (uint64_t)c->nodes * c->level.modes;
    if (c->assembly != NULL) palp_contact_bond_corners(c);
}

/* What the forces on one body displace a place of a half-space by, without its factor. */
static palp_vec3 half_space_at(const palp_contact *c, const palp_contact_run *in_contact, float nu,
                               palp_vec3 y, palp_vec3 n, float cell, float patch) {
    const float rest = 0.5f - nu;
    float lane[3][LANES] = {{0}};
    for (uint32_t first = in_contact->first; first < in_contact->end; first += LANES) {
        const float *const *in = (const float *const *)c->pressed;
        for (uint32_t k = 0; k < LANES; k++) {
            uint32_t j = first + k;
            float fx = in[IN_F][j], fy = in[IN_F + 1][j], fz = in[IN_F + 2][j];
            float ex = y.x - in[IN_Y][j], ey = y.y - in[IN_Y + 1][j], ez = y.z - in[IN_Y + 2][j];
            float r2 = ex * ex + ey * ey + ez * ez, s2 = cell * in[IN_CELL][j];
            float apart = palp_abs(patch - in[IN_PATCH][j]) > 0.5f ? r2 + SPREAD2 * s2
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
    return u;
}

/* What the gathered forces displace a side by as if its body were a half-space, with its own force
 * f. */
static palp_vec3 near_displacement(palp_contact *c, uint32_t side, palp_vec3 f) {
    const uint32_t body = palp_contact_body(c, side);
    const palp_surface_point *at = palp_contact_side(c, side);
    const float cell = c->column[COL_CELL][side], patch = c->column[COL_PATCH][side];
    palp_vec3 u = {0};
    for (uint32_t b = 0; b < c->bodies; b++) {
        const palp_contact_run *in = &c->pressed_of[b];
        if (in->end == in->first && b != body) continue;
        const palp_half_space h = palp_contact_half_space(c, body, b);
        palp_vec3 by = half_space_at(c, in, h.poisson, at->y, at->n, cell, patch);
        if (b == body && palp_dot(f, f) > 0.0f) {
            float scale = PALP_LATTICE_SELF / cell, along = palp_dot(f, at->n);
            by = palp_madd(by, scale * (1.0f - 0.5f * h.poisson), f);
            by = palp_madd(by, -scale * 0.5f * h.poisson * along, at->n);
        }
        u = palp_madd(u, h.factor, by);
        c->work_done += 50u * (uint64_t)(in->end - in->first);
    }
    return u;
}

/* The rest of it, by the displaced corners, added to u. */
static palp_vec3 with_far(const palp_contact *c, uint32_t side, palp_vec3 u) {
    const palp_surface_point *at = palp_contact_side(c, side);
    for (uint32_t k = 0; k < 3u; k++)
        u = palp_madd(u, at->weight[k], c->node_u_m[c->corner[side][k]]);
    return u;
}

palp_vec3 palp_contact_displacement(palp_contact *contact, uint32_t side) {
    const palp_vec3 f =
        palp_scale(force_of(contact, side), palp_contact_column(contact, COL_M, side));
    return with_far(contact, side, near_displacement(contact, side, f));
}

/* How a tool's regions are pressed: region r along `along[r]`, at each point by its lambda /
 * over_N.
 */
typedef struct {
    uint32_t tool;
    float over_N;
    palp_vec3 along[PALP_CONTACT_REGIONS];
} pressing;

/* The force at one of the pressed sides, in the frame of its body. */
static palp_vec3 pressed_by(const palp_contact *c, uint32_t side, const pressing *p) {
    const palp_contact_point *at = &c->point[c->side_point[side]];
    const bool of_tool = c->patch[at->patch].tool == p->tool;
    if (!of_tool || !(at->force_N > 0.0f)) return (palp_vec3){0}; /* it is in no region */
    return palp_scale(at->force_N / p->over_N,
                      palp_contact_inward(c, palp_contact_body(c, side), p->along[at->region]));
}

/* Puts these forces in place of those that were gathered; with the modes' loads if `far`. */
PALP_APART static void press(palp_contact *c, const pressing *p, bool far) {
    const uint32_t modes = far ? c->level.modes : 0u;
    float row[PALP_MAX_MODES];
    for (uint32_t m = 0; m < modes; m++) c->load[m] = 0.0f;
    for (uint32_t b = 0; b < c->bodies; b++) {
        for (uint32_t at = c->pressed_of[b].first; at < c->pressed_of[b].end; at++) {
            const uint32_t s = c->pressed_side[at];
            if (s == NO_SIDE) continue;
            const palp_vec3 f = pressed_by(c, s, p);
            c->pressed[IN_F][at] = f.x;
            c->pressed[IN_F + 1][at] = f.y;
            c->pressed[IN_F + 2][at] = f.z;
            if (!far || !(palp_dot(f, f) > 0.0f)) continue;
            palp_surface_modes(&c->surface[b], palp_contact_side(c, s), f, modes, row, 1);
            for (uint32_t m = 0; m < modes; m++) c->load[m] += row[m];
            c->work_done += 10u * (uint64_t)modes;
        }
    }
    for (uint32_t m = 0; m < modes; m++) c->load[m] *= c->surface[0].blob->regular.value[m];
}

/* Sums of u . f over the points of a tool: u of what presses, f of two other ways to press. */
static void work_of(palp_contact *c, const pressing *presses, const pressing other[2],
                    float near[2], float far[2]) {
    for (uint32_t a = 0; a < c->active_count; a++) {
        const uint32_t i = c->active[a];
        const palp_vec3 f = pressed_by(c, i, presses);
        const palp_vec3 with[2] = {pressed_by(c, i, &other[0]), pressed_by(c, i, &other[1])};
        if (!(palp_dot(with[0], with[0]) + palp_dot(with[1], with[1]) > 0.0f)) continue;
        const palp_vec3 u = near_displacement(c, i, f);
        const palp_vec3 v = far != NULL ? with_far(c, i, (palp_vec3){0}) : (palp_vec3){0};
        for (uint32_t e = 0; e < 2u; e++) {
            near[e] += palp_dot(u, with[e]);
            if (far != NULL) far[e] += palp_dot(v, with[e]);
        }
    }
}

static palp_symmetric2 symmetric(float c[2][2]) {
    return (palp_symmetric2){c[0][0], 0.5f * (c[0][1] + c[1][0]), c[1][1]};
}

/* A region by itself, along its own tangents, as on a half-space. */
static palp_symmetric2 alone(palp_contact *c, uint32_t tool, const palp_contact_region *region,
                             uint32_t number) {
    pressing way[2];
    float near[2][2] = {{0.0f}};
    for (uint32_t k = 0; k < 2u; k++) {
        way[k] = (pressing){.tool = tool, .over_N = region->normal_N};
        way[k].along[number] = region->tangent[k];
    }
    for (uint32_t k = 0; k < 2u; k++) {
        press(c, &way[k], false);
        work_of(c, &way[k], way, near[k], NULL);
    }
    return symmetric(near);
}

/* What of a direction lies along a region. */
static palp_vec3 along(const palp_contact_region *region, palp_vec3 v) {
    return palp_madd(v, -palp_dot(v, region->axis), region->axis);
}

/* c less share^2 times the part of a region by itself. */
static palp_symmetric2 without(palp_symmetric2 c, palp_symmetric2 part, float share,
                               const palp_contact_region *region, const palp_vec3 tangent[2]) {
    float t[2][2];
    for (uint32_t k = 0; k < 2u; k++) {
        t[k][0] = share * palp_dot(tangent[k], region->tangent[0]);
        t[k][1] = share * palp_dot(tangent[k], region->tangent[1]);
    }
    const float on[2][2] = {
        {part.xx * t[0][0] + part.xy * t[0][1], part.xy * t[0][0] + part.yy * t[0][1]},
        {part.xx * t[1][0] + part.xy * t[1][1], part.xy * t[1][0] + part.yy * t[1][1]}};
    return (palp_symmetric2){c.xx - t[0][0] * on[0][0] - t[0][1] * on[0][1],
                             c.xy - t[1][0] * on[0][0] - t[1][1] * on[0][1],
                             c.yy - t[1][0] * on[1][0] - t[1][1] * on[1][1]};
}

void palp_contact_tangential(palp_contact *c, uint32_t tool, const palp_vec3 tangent[2],
                             const palp_contact_region *region, uint32_t regions,
                             palp_symmetric2 *near, palp_symmetric2 *far) {
    pressing way[2];
    float sum[2][2][2] = {{{0.0f}}}, all_N = 0.0f;
    for (uint32_t r = 0; r < regions; r++) all_N += region[r].normal_N;
    for (uint32_t k = 0; k < 2u; k++) {
        way[k] = (pressing){.tool = tool, .over_N = all_N};
        for (uint32_t r = 0; r < regions; r++) way[k].along[r] = along(&region[r], tangent[k]);
    }
    for (uint32_t k = 0; k < 2u; k++) {
        press(c, &way[k], true);
        palp_contact_displace_corners(c);
        work_of(c, &way[k], way, sum[0][k], sum[1][k]);
    }
    palp_symmetric2 between = symmetric(sum[0]);
    *far = symmetric(sum[1]);
    if (regions == 1u) {
        near[0] = between;
        return;
    }
    for (uint32_t r = 0; r < regions; r++) {
        near[r] = alone(c, tool, &region[r], r);
        between = without(between, near[r], region[r].normal_N / all_N, &region[r], tangent);
    }
    far->xx += between.xx, far->xy += between.xy, far->yy += between.yy;
}
