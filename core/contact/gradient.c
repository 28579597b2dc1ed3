/* SPDX-License-Identifier: MIT */
/*
 * The exact gradient of the elastic energy, beyond - sum lambda m: what moving the points and their
 * compliance does to it. With Q = f . y + f C f / 2 at fixed forces
 *
 *     dQ/dc = Q_c + Q_p dp/dc
 *
 * where Q_c moves the lattice with the tool, and p (its axis, origin, spacing, how far behind)
 * follows the overlap by the equations r(c, p) = 0 of lattice.h: dp/dc = - r_p^-1 r_c. An axis that
 * follows slowly, between regions apart, is taken to stay. c stands for the tool's place and for its
 * turn about that: a turn takes a pad's lattice with it, and a ball's by its centre; any other stays
 * and follows the overlap alone.
 *
 * All this is seen from the surface as the body as a whole has given way, by h (far_field.h), which
 * follows the tool, so only (1 - dh/dc) of the tool's way counts. With the force F along n on a
 * contact d deep
 *
 *     dh/dc = h n^T / (h . n + 2 d / 3)
 *
 * as for Hertz' F ~ d^(3/2) in line with a spring that gives way by h . n under F; a turn goes as
 * deep as its moment does work, M / F.
 *
 * Both are sums over points of how each moves in 6 + PARAMETERS directions: its shot (origin,
 * direction), then the facet, the smooth surface, the cell and the overlap.
 */
#include "core/contact/contact_internal.h"
#include "core/base/apart.h"
#include "core/base/linalg.h"

/* Derivatives of f C f / 2 + f . y with respect to one point. */
typedef struct {
    palp_vec3 y, n;
    float cell;
} pull;

/* d/dy_i and d/dn_i of sum_j f_i B_ij f_j over the forces on one body, without its factor. */
PALP_APART static pull half_space_pull(const palp_contact *c, uint32_t i,
                                       const palp_contact_run *in_contact, float nu) {
    const palp_contact_point *point = &c->point[i];
    const float rest = 0.5f - nu, plain = 1.0f - nu;
    const palp_vec3 y = point->at.y, n = point->at.n, f = palp_scale(point->force_N, point->m);
    const float cell = point->cell_m, patch = (float)point->patch;
    const float *const *in = (const float *const *)c->pressed;
    float lane[6][LANES] = {{0}};
    for (uint32_t first = in_contact->first; first < in_contact->end; first += LANES) {
        for (uint32_t k = 0; k < LANES; k++) {
            uint32_t j = first + k;
            float gx = in[IN_F][j], gy = in[IN_F + 1][j], gz = in[IN_F + 2][j];
            float ex = y.x - in[IN_Y][j], ey = y.y - in[IN_Y + 1][j], ez = y.z - in[IN_Y + 2][j];
            float r2 = ex * ex + ey * ey + ez * ez, s2 = cell * in[IN_CELL][j];
            float other = palp_abs(patch - in[IN_PATCH][j]) > 0.5f ? 1.0f : 0.0f;
            float apart = r2 + other * SPREAD2 * s2, least = NEAREST2 * s2;
            bool counts = r2 > 0.0f && (apart >= least || other > 0.5f);
            float inverse = counts ? 1.0f / palp_sqrt(apart) : 0.0f;
            ex *= inverse;
            ey *= inverse;
            ez *= inverse;
            float hx = 0.5f * (n.x + in[IN_N][j]), hy = 0.5f * (n.y + in[IN_N + 1][j]),
                  hz = 0.5f * (n.z + in[IN_N + 2][j]);
            float a = f.x * gx + f.y * gy + f.z * gz;
            float p = f.x * ex + f.y * ey + f.z * ez, q = gx * ex + gy * ey + gz * ez;
            float s = hx * gx + hy * gy + hz * gz, t = hx * f.x + hy * f.y + hz * f.z;
            float square = inverse * inverse;
            /* d/dr of (plain a + nu p q + rest (p s - t q)) / r, with p, q of unit length */
            float back = -plain * a - 3.0f * nu * p * q - 2.0f * rest * (p * s - t * q);
            float of_f = nu * q + rest * s, of_g = nu * p - rest * t;
            lane[0][k] += square * (back * ex + of_f * f.x + of_g * gx);
            lane[1][k] += square * (back * ey + of_f * f.y + of_g * gy);
            lane[2][k] += square * (back * ez + of_f * f.z + of_g * gz);
            lane[3][k] += inverse * 0.5f * rest * (p * gx - q * f.x);
            lane[4][k] += inverse * 0.5f * rest * (p * gy - q * f.y);
            lane[5][k] += inverse * 0.5f * rest * (p * gz - q * f.z);
        }
    }
    pull sum = {.cell = 0.0f};
    for (uint32_t k = 0; k < LANES; k++) {
        sum.y = palp_add(sum.y, (palp_vec3){lane[0][k], lane[1][k], lane[2][k]});
        sum.n = palp_add(sum.n, (palp_vec3){lane[3][k], lane[4][k], lane[5][k]});
    }
    return sum;
}

/* The same of the point's own B, which its cell and normal decide. */
static void add_self(const palp_surface *s, const palp_contact_point *p, pull *sum) {
    float nu = s->poisson, cell = p->cell_m, scale = PALP_LATTICE_SELF / cell;
    float f2 = p->force_N * p->force_N, along = palp_dot(p->m, p->at.n);
    sum->n = palp_madd(sum->n, -0.5f * nu * scale * f2 * along, p->m);
    sum->cell -= 0.5f * scale / cell * f2 * (1.0f - nu + 0.5f * nu * (1.0f - along * along));
}

/* ---- how a point moves ---- */

#define PARAMETERS 6u /* of a lattice: axis 2, origin 2, log of the spacing, how far behind */
#define TURN 3u       /* first turn of the tool, after its translations */
#define OF_LATTICE 6u /* first of the parameters, after the turns */
#define MOVES (OF_LATTICE + PARAMETERS)

enum { AXIS = 0, ORIGIN = 2, SPACING = 4, BACK = 5 };

static palp_vec3 unit(uint32_t k) {
    const palp_vec3 e = {k == 0u ? 1.0f : 0.0f, k == 1u ? 1.0f : 0.0f, k == 2u ? 1.0f : 0.0f};
    return e;
}

/* Whether a lattice has that parameter now. */
static bool is_free(const palp_lattice *l, bool central, bool flat, uint32_t parameter) {
    if (parameter == BACK) return l->used.back_m > 0.0f;
    if (parameter == SPACING) return true;
    if (parameter >= ORIGIN) return !central;
    return !flat && !l->apart;
}

/* How the lattice itself turns in a direction: an axis of its own, or with a pad. */
static palp_vec3 turn_of(const palp_lattice_state *s, bool flat, uint32_t k) {
    if (k >= OF_LATTICE + AXIS && k < OF_LATTICE + AXIS + 2u)
        return palp_cross(s->axis, s->tangent[k - OF_LATTICE - AXIS]);
    if (!flat || k < TURN || k >= OF_LATTICE) return (palp_vec3){0};
    const palp_vec3 e = unit(k - TURN);
    return palp_madd(e, -palp_dot(e, s->axis), s->axis);
}

/* Of a shot: its origin and its direction; explicit part of log(cell). */
typedef struct {
    palp_vec3 from, direction;
    float log_cell;
} shot_move;

/* Of a point; n is only there where the axis follows the normals. */
typedef struct {
    palp_vec3 q, n;
    float cell, overlap;
} point_move;

/* What does not depend on the move: derivatives at a point. */
typedef struct {
    float dy_dq[9], dn_dq[9]; /* in the body's frame; the others where it is */
    palp_vec3 facet;          /* over its slant to the shot */
    palp_vec3 out;            /* gradient of the gap with respect to the tool's place */
    palp_vec3 arm_m;          /* from there to where the gap is measured */
    palp_vec3 out_q;          /* and to q */
    palp_vec3 facing_q;       /* of n . direction */
} point_slopes;

static palp_vec3 times(const float m[9], palp_vec3 v) {
    return (palp_vec3){m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
                       m[6] * v.x + m[7] * v.y + m[8] * v.z};
}

static palp_vec3 transposed(const float m[9], palp_vec3 v) {
    return (palp_vec3){m[0] * v.x + m[3] * v.y + m[6] * v.z, m[1] * v.x + m[4] * v.y + m[7] * v.z,
                       m[2] * v.x + m[5] * v.y + m[8] * v.z};
}

/* M v or, `back`, M^T v for a matrix of the body's frame and a vector where the body is. */
static palp_vec3 where_it_is(const palp_contact *c, const palp_contact_point *p, const float m[9],
                             palp_vec3 v, bool back) {
    v = palp_contact_inward(c, p->at.body, v);
    return palp_contact_outward(c, p->at.body, back ? transposed(m, v) : times(m, v));
}

static point_slopes slopes_of(const palp_contact *c, const palp_contact_point *p) {
    const palp_contact_patch *patch = &c->patch[p->patch];
    const palp_surface *s = &c->surface[p->at.body];
    const palp_lattice *l = &patch->lattice;
    const uint32_t *v = s->blob->triangle + 3u * (size_t)p->at.triangle;
    point_slopes z;
    palp_surface_slopes(s, &p->at, z.dy_dq, z.dn_dq);
    palp_vec3 x0 = palp_vec3_at(s->blob->rest_m + 3u * (size_t)v[0]);
    palp_vec3 normal = palp_cross(palp_sub(palp_vec3_at(s->blob->rest_m + 3u * (size_t)v[1]), x0),
                                  palp_sub(palp_vec3_at(s->blob->rest_m + 3u * (size_t)v[2]), x0));
    normal = palp_contact_outward(c, p->at.body, normal);
    z.facet = palp_scale(1.0f / palp_dot(normal, p->direction), normal);
    const palp_far_field *far_field = &l->used.far_field;
    palp_frame at = patch->at;
    at.t = palp_sub(at.t, far_field->mean_m);
    float gone; /* beyond the reach; what watched nodes say hardly turns the normal */
    palp_vec3 y = palp_add(p->y, palp_far_field_beside(far_field, p->y, &gone));
    const palp_tool_press press = palp_lattice_press(&l->used, p->n);
    const palp_tool *tool = &c->tools[patch->tool];
    const palp_gap gap = palp_tool_gap_along(tool, &at, y, &press);
    z.out = palp_tool_gap_flared(tool, &at, y, &press, gap, press.sunk).normal;
    z.arm_m = palp_sub(y, at.t);
    z.out_q = where_it_is(
        c, p, z.dy_dq,
        palp_add(z.out, palp_scale(1.0f - gone, palp_far_field_turned_back(far_field, z.out))),
        true);
    z.facing_q = where_it_is(c, p, z.dn_dq, p->direction, true);
    return z;
}

/* `tool`: how the tool moves itself. */
static point_move move_point(const palp_contact *c, const palp_contact_point *p,
                             const point_slopes *z, bool central, const shot_move *shot,
                             palp_vec3 tool) {
    point_move d;
    palp_vec3 aim = palp_madd(shot->from, p->shot_m, shot->direction);
    d.q = palp_madd(aim, -palp_dot(z->facet, aim), p->direction);
    d.n = (palp_vec3){.x = 0.0f};
    if (!central) d.n = where_it_is(c, p, z->dn_dq, d.q, false);
    float facing = -palp_dot(z->facing_q, d.q) - palp_dot(p->n, shot->direction);
    float length = palp_dot(palp_sub(d.q, shot->from), p->direction);
    d.cell = palp_lattice_cell_slope(p) * facing + p->cell_m * shot->log_cell;
    if (central) d.cell += p->cell_m * length / p->shot_m;
    d.overlap = p->overlap_m > 0.0f ? palp_dot(z->out, tool) - palp_dot(z->out_q, d.q) : 0.0f;
    return d;
}

/* How the shot of a point moves in each of the directions, and the tool where it sees the point. */
static void shot_moves(const palp_contact *c, const palp_contact_point *p, const point_slopes *z,
                       shot_move shot[MOVES], palp_vec3 tool[MOVES]) {
    const palp_contact_patch *patch = &c->patch[p->patch];
    const palp_tool *of = &c->tools[patch->tool];
    const palp_lattice_state *s = &patch->lattice.used;
    const bool central = palp_lattice_is_central(of), flat = palp_lattice_is_flat(of);
    const palp_vec3 ball = palp_rotate(patch->at.r, of->ball[0].center_m);
    const float a = s->spacing * ((float)p->i + 0.5f * (float)p->j);
    const float b = s->spacing * PALP_LATTICE_CELL * (float)p->j;
    const palp_vec3 side = palp_madd(palp_scale(a, s->tangent[0]), b, s->tangent[1]);
    for (uint32_t k = 0; k < MOVES; k++) {
        shot[k] = (shot_move){.log_cell = 0.0f};
        tool[k] = (palp_vec3){0};
    }
    for (uint32_t k = 0; k < 3u; k++) {
        shot[k].from = tool[k] = unit(k);
        tool[TURN + k] = palp_cross(unit(k), z->arm_m);
        if (central) shot[TURN + k].from = palp_cross(unit(k), ball);
    }
    for (uint32_t k = TURN; k < OF_LATTICE + AXIS + 2u; k++) { /* the lattice turns */
        const palp_vec3 about = turn_of(s, flat, k);
        if (k < OF_LATTICE && !flat) continue;
        shot[k].direction = palp_cross(about, p->direction);
        shot[k].from = central ? palp_scale(-s->back_m, palp_cross(about, s->axis))
                               : palp_cross(about, palp_add(side, s->origin_m));
    }
    shot[OF_LATTICE + SPACING].log_cell = 1.0f;
    if (central) {
        float rho2 = a * a + b * b, root = palp_sqrt(palp_max(1.0f - 0.25f * rho2, 1e-6f));
        shot[OF_LATTICE + SPACING].direction =
            palp_madd(palp_scale(root - 0.25f * rho2 / root, side), -rho2, s->axis);
        shot[OF_LATTICE + BACK].from = palp_scale(-1.0f, s->axis);
        return;
    }
    for (uint32_t k = 0; k < 2u; k++) shot[OF_LATTICE + ORIGIN + k].from = s->tangent[k];
    shot[OF_LATTICE + SPACING].from = side;
}

/* ---- what the lattice follows ---- */

/* Sums over the points of one tool: of the overlap, and of its derivatives. */
typedef struct {
    float s0, s1, s2, d0[MOVES], d1[MOVES], d2[MOVES];
    palp_vec3 toward, dtoward[MOVES], out, dout[MOVES];
    float deepest, ddeepest[MOVES];
    float q[MOVES]; /* dQ */
} derivative_sums;

static void add_derivative(derivative_sums *f, const palp_contact_point *p, palp_vec3 off,
                           const point_move *d, const shot_move *shot, bool central, uint32_t k) {
    float area = PALP_LATTICE_CELL * p->cell_m * p->cell_m,
          darea = 2.0f * PALP_LATTICE_CELL * p->cell_m * d->cell;
    float w = area * p->overlap_m, dw = darea * p->overlap_m + area * d->overlap;
    f->d0[k] += dw;
    f->d1[k] += dw * p->overlap_m + w * d->overlap;
    f->d2[k] += dw * area + w * darea;
    palp_vec3 moved = central ? shot->direction : d->q;
    f->dtoward[k] = palp_add(f->dtoward[k], palp_madd(palp_scale(dw, off), w, moved));
    if (!central) f->dout[k] = palp_add(f->dout[k], palp_madd(palp_scale(dw, p->n), w, d->n));
}

/* Derivatives of the equations r that the lattice obeys, in direction k. */
static void equations(const palp_lattice *l, const derivative_sums *f, bool central, bool flat,
                      float cells, uint32_t k, float r[PARAMETERS]) {
    const palp_lattice_state *s = &l->used;
    const palp_vec3 about = turn_of(s, flat, k), none = {0};
    palp_vec3 own =
        palp_cross(about, s->origin_m); /* of the origin, seen from the reference point */
    if (k >= OF_LATTICE + ORIGIN && k < OF_LATTICE + ORIGIN + 2u)
        own = s->tangent[k - OF_LATTICE - ORIGIN];
    const palp_vec3 moved = k < TURN ? unit(k) : own; /* and in space */
    for (uint32_t e = 0; e < 2u; e++) {
        const palp_vec3 turn = palp_cross(about, s->tangent[e]);
        if (central) {
            r[AXIS + e] = palp_dot(f->dtoward[k], s->tangent[e]) + palp_dot(f->toward, turn);
            r[ORIGIN + e] = 0.0f;
            continue;
        }
        r[AXIS + e] = flat ? 0.0f : palp_dot(f->dout[k], s->tangent[e]) + palp_dot(f->out, turn);
        const palp_vec3 kept =
            palp_madd(palp_scale(f->d0[k], s->origin_m), f->s0, k < TURN ? none : own);
        const palp_vec3 change =
            palp_scale(1.0f - s->fixed, palp_madd(f->dtoward[k], -f->s0, moved));
        r[ORIGIN + e] = palp_dot(palp_madd(change, -s->fixed, kept), s->tangent[e]) +
                        (1.0f - s->fixed) * palp_dot(f->toward, turn);
    }
    r[SPACING] =
        (1.0f - s->fixed) * 2.0f / 3.0f *
            (2.0f * f->s0 * f->d0[k] / f->s1 - f->s0 * f->s0 * f->d1[k] / (f->s1 * f->s1)) -
        cells * (f->d2[k] / f->s0 - f->s2 * f->d0[k] / (f->s0 * f->s0));
    r[BACK] = s->back_m > 0.0f ? f->ddeepest[k] - (k == OF_LATTICE + BACK ? 1.0f : 0.0f) : 0.0f;
}

/* Q_p dp/dc for the six motions of the tool. */
static void derivative_force(const palp_contact *c, const palp_contact_patch *patch,
                             const derivative_sums *f, float force[OF_LATTICE]) {
    const palp_tool *tool = &c->tools[patch->tool];
    const palp_lattice *l = &patch->lattice;
    const bool central = palp_lattice_is_central(tool), flat = palp_lattice_is_flat(tool);
    const float cells = (float)c->level.cells * c->crowd;
    float r[MOVES][PARAMETERS], a[PARAMETERS * PARAMETERS];
    uint32_t perm[PARAMETERS];
    for (uint32_t k = 0; k < OF_LATTICE; k++) force[k] = 0.0f;
    for (uint32_t k = 0; k < MOVES; k++) equations(l, f, central, flat, cells, k, r[k]);
    for (uint32_t e = 0; e < PARAMETERS; e++) {
        bool follows = is_free(l, central, flat, e);
        for (uint32_t p = 0; p < PARAMETERS; p++) {
            bool both = follows && is_free(l, central, flat, p);
            a[e * PARAMETERS + p] = both ? r[OF_LATTICE + p][e] : (p == e ? 1.0f : 0.0f);
        }
        for (uint32_t k = 0; k < OF_LATTICE && !follows; k++) r[k][e] = 0.0f;
    }
    if (palp_lu_factor(a, perm, PARAMETERS, PARAMETERS) != PALP_OK) return;
    for (uint32_t k = 0; k < OF_LATTICE; k++) {
        float x[PARAMETERS];
        for (uint32_t e = 0; e < PARAMETERS; e++) x[e] = -r[k][e];
        palp_lu_solve(a, perm, PARAMETERS, PARAMETERS, x);
        for (uint32_t e = 0; e < PARAMETERS; e++) force[k] += f->q[OF_LATTICE + e] * x[e];
    }
}

/* ---- all together ---- */

/* Derivatives of Q with respect to q (through y, n and the weights), and to the cell. */
static pull pull_of(palp_contact *c, const palp_contact_point *p, uint32_t i,
                    const point_slopes *z) {
    const uint32_t body = p->at.body;
    const palp_surface *s = &c->surface[body];
    const palp_vec3 f = palp_scale(p->force_N, p->m);
    palp_vec3 gradient[3];
    pull sum = {.cell = 0.0f};
    for (uint32_t b = 0; b < c->bodies; b++) {
        const palp_contact_run *in = &c->pressed_of[b];
        if (in->end == in->first) continue;
        const palp_half_space h = palp_contact_half_space(c, body, b);
        pull by = half_space_pull(c, i, in, h.poisson);
        if (b == body) add_self(s, p, &by);
        sum.y = palp_madd(sum.y, h.factor, by.y);
        sum.n = palp_madd(sum.n, h.factor, by.n);
        sum.cell += h.factor * by.cell;
    }
    sum.y = palp_add(f, sum.y);
    sum.y = palp_add(transposed(z->dy_dq, sum.y), transposed(z->dn_dq, sum.n));
    palp_surface_gradients(s, p->at.triangle, gradient);
    for (uint32_t k = 0; k < 3u; k++) {
        palp_vec3 u = c->node_u_m[c->corner[i][k]];
        if (c->assembly != NULL) u = palp_add(u, c->node_bent_m[c->corner[i][k]]);
        float along = palp_dot(f, u);
        sum.y = palp_madd(sum.y, along, gradient[k]);
    }
    sum.y = palp_contact_outward(c, body, sum.y);
    return sum;
}

PALP_APART static void add_point(palp_contact *c, uint32_t i, derivative_sums *f) {
    const palp_contact_point *p = &c->point[i];
    const palp_contact_patch *patch = &c->patch[p->patch];
    const palp_lattice *l = &patch->lattice;
    const bool central = palp_lattice_is_central(&c->tools[patch->tool]);
    const point_slopes z = slopes_of(c, p);
    shot_move shot[MOVES];
    palp_vec3 tool[MOVES];
    pull of_q = {.cell = 0.0f};
    if (p->force_N > 0.0f) of_q = pull_of(c, p, i, &z);
    const palp_vec3 moved = palp_sub(patch->at.t, l->used.far_field.mean_m);
    const palp_vec3 origin = palp_add(moved, l->used.origin_m);
    palp_vec3 off = central ? p->direction : palp_sub(p->q, origin);
    float area = PALP_LATTICE_CELL * p->cell_m * p->cell_m, w = area * p->overlap_m;
    bool deepest = p->overlap_m > f->deepest;
    f->s0 += w;
    f->s1 += w * p->overlap_m;
    f->s2 += w * area;
    f->toward = palp_madd(f->toward, w, off);
    f->out = palp_madd(f->out, w, p->n);
    if (deepest) f->deepest = p->overlap_m;
    shot_moves(c, p, &z, shot, tool);
    const bool flat = palp_lattice_is_flat(&c->tools[patch->tool]);
    for (uint32_t k = 0; k < MOVES; k++) {
        if (k >= OF_LATTICE && !is_free(l, central, flat, k - OF_LATTICE)) continue;
        point_move d = move_point(c, p, &z, central, &shot[k], tool[k]);
        add_derivative(f, p, off, &d, &shot[k], central, k);
        if (deepest) f->ddeepest[k] = d.overlap;
        f->q[k] += palp_dot(of_q.y, d.q) + of_q.cell * d.cell;
    }
}

/* (1 - dh/dc)^T v. d is from the energy, F (h . n / 2 + 2 d / 5). What a zone is bent by without
 * contact is not given by the force. */
static palp_wrench seen_from_far_field(const palp_contact *c, uint32_t k, palp_wrench v) {
    const palp_contact_patch *patch = &c->patch[k];
    palp_vec3 push = {0}, turn = {0};
    float energy = 0.0f;
    uint32_t used = 0;
    for (uint32_t a = 0; a < c->active_count; a++) {
        const palp_contact_point *p = &c->point[c->active[a]];
        if (p->patch != k) continue;
        push = palp_madd(push, p->force_N, p->out);
        turn = palp_madd(turn, p->force_N, p->arm_m);
        energy += 0.5f * p->force_N * palp_dot(p->m, p->u_m);
    }
    for (uint32_t n = 0; n < c->patches; n++) used += c->patch[n].used ? 1u : 0u;
    const float force = palp_norm(push);
    if (!(force > 0.0f)) return v;
    const palp_vec3 n = palp_scale(1.0f / force, push);
    const palp_vec3 h =
        palp_sub(patch->lattice.used.far_field.mean_m, patch->bent_field_used.mean_m);
    const float along = palp_dot(h, n);
    if (!(along > 0.0f)) return v;
    const float local = palp_max(energy / force - 0.5f * along, 0.0f);
    float room = along + 5.0f / 3.0f * local;
    if (used > 1u) room = palp_max(room, palp_norm(h)); /* others move the body too */
    const float back = -palp_dot(h, v.force_N) / room;
    return (palp_wrench){palp_madd(v.force_N, back, n), palp_madd(v.moment_Nm, back / force, turn)};
}

void palp_contact_exact(palp_contact *c) {
    for (uint32_t k = 0; k < c->patches; k++) {
        palp_contact_patch *patch = &c->patch[k];
        derivative_sums f = {.s0 = 0.0f};
        float follows[OF_LATTICE];
        bool any = false;
        if (!patch->used || patch->tool == PALP_CONTACT_TOOLS) continue;
        for (uint32_t i = 0; i < c->count; i++) {
            if (c->point[i].patch != k) continue;
            add_point(c, i, &f);
            any = any || c->point[i].force_N > 0.0f;
        }
        if (!any) continue;
        derivative_force(c, patch, &f, follows);
        const palp_wrench moved = {
            palp_add(palp_vec3_at(f.q), palp_vec3_at(follows)),
            palp_add(palp_vec3_at(f.q + TURN), palp_vec3_at(follows + TURN))};
        const palp_wrench beyond = seen_from_far_field(c, k, moved);
        patch->beyond_N = beyond.force_N;
        patch->beyond_Nm = beyond.moment_Nm;
    }
    c->work_done += (uint64_t)c->active_count * 80u * c->active_count + 1000u * (uint64_t)c->count;
}
