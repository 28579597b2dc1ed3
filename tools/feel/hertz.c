/* SPDX-License-Identifier: MIT */
/*
 * Presses against Hertz' law for two curved bodies, where the surface is a paraboloid about the
 * contact. With the tool's radius R and the surface's principal curvatures k1, k2,
 *
 *     A = (1 / R + k1) / 2,  B = (1 / R + k2) / 2,  R_e = 1 / (2 sqrt(A B))
 *     F = 4/3 E / (1 - nu^2) sqrt(R_e) (d / F2)^(3/2),  F2 = 1 - ((B / A)^0.0684 - 1)^1.531
 *
 * (Johnson, Contact Mechanics, 4.2; F2 is Greenwood's approximation to the elliptic integrals).
 * Hertz knows a half-space; the body as a whole gives way by F h besides, h = n . H n of its
 * regular part, where that is even over the contact.
 */
#include "tools/feel/bench.h"
#include "tools/solver/dense.h"
#include "tools/press/press.h"
#include "port/host/util.h"
#include <math.h>

#define TOOL 0.3        /* contact radius over the tool's, about, */
#define SMALLEST 0.5    /* which has so many edges at least */
#define RINGS 4         /* about a place, */
#define DIRECTIONS 12   /* points on each; the outermost */
#define OUTERMOST 2.5   /* contact radii away */
#define PARABOLOID 0.02 /* most deviation from it, over the depth */
#define EVEN 0.02       /* most by which F h differs within the contact, over the depth */
#define MOST_CURVED 2.0 /* curvatures may be so much times the tool's */
#define MOST_OBLONG 5.0 /* B over A */
#define TRIED 50        /* nodes for each place that is wanted */

typedef struct {
    palp_vec3 y, n;  /* its top */
    double k1, k2;   /* curvatures, positive where it bulges; k1 <= k2 */
    double residual; /* largest deviation (m) */
} paraboloid;

/* Fits z = c0 + c1 x + c2 y + c3 x^2 / 2 + c4 x y + c5 y^2 / 2 to points about p, in units of
 * `size`; false where the surface ends or turns away. */
static bool fit_paraboloid(const palp_contact *c, palp_surface_point p, double size,
                           paraboloid *out) {
    enum { TERMS = 6, POINTS = RINGS * DIRECTIONS + 1 };
    double term[POINTS][TERMS], z[POINTS], normal[TERMS * TERMS] = {0}, right[TERMS] = {0};
    uint32_t perm[TERMS];
    const palp_vec3 t1 = bench_tangent((palp_vec3){0.3f, 0.5f, 0.8f}, p.n),
                    t2 = palp_cross(p.n, t1);
    for (int k = 0; k < POINTS; k++) {
        const double ring = (k + DIRECTIONS - 1) / DIRECTIONS, r = OUTERMOST * ring / RINGS,
                     turn = 2 * acos(-1.0) * (k + 0.5 * ring) / DIRECTIONS, x = r * cos(turn),
                     y = r * sin(turn);
        palp_vec3 from = palp_madd(p.y, (float)(x * size), t1);
        from = palp_madd(palp_madd(from, (float)(y * size), t2), (float)size, p.n);
        palp_surface_point at = p;
        if (!press_point(c, from, p.n, &at)) return false;
        z[k] = (double)palp_dot(palp_sub(at.y, p.y), p.n) / size;
        const double row[TERMS] = {1, x, y, x * x / 2, x * y, y * y / 2};
        for (int i = 0; i < TERMS; i++) {
            term[k][i] = row[i];
            right[i] += row[i] * z[k];
            for (int j = 0; j < TERMS; j++) normal[i * TERMS + j] += row[i] * row[j];
        }
    }
    if (dense_lu(normal, TERMS, TERMS, perm) != TERMS) return false;
    dense_lu_solve(normal, TERMS, TERMS, perm, right, 1, 1);
    out->residual = 0;
    for (int k = 0; k < POINTS; k++) {
        double off = -z[k];
        for (int i = 0; i < TERMS; i++) off += term[k][i] * right[i];
        out->residual = fmax(out->residual, fabs(off) * size);
    }
    const double half = 0.5 * (right[3] - right[5]), mean = 0.5 * (right[3] + right[5]),
                 split = sqrt(half * half + right[4] * right[4]);
    out->k1 = -(mean + split) / size;
    out->k2 = -(mean - split) / size;
    palp_vec3 n = palp_madd(palp_madd(p.n, (float)-right[1], t1), (float)-right[2], t2);
    out->n = palp_scale(1.0f / palp_norm(n), n);
    out->y = palp_madd(p.y, (float)(right[0] * size), p.n);
    return true;
}

/* n . H n between two points: what the body as a whole gives way by at one under a unit force at
 * the other. */
static double regular_compliance(const palp_contact *c, const palp_surface_point *p,
                                 const palp_surface_point *q) {
    float row[2][PALP_MAX_MODES];
    const palp_regular *g = &c->surface->blob->regular;
    palp_surface_modes(c->surface, p, p->n, g->modes, row[0], 1);
    palp_surface_modes(c->surface, q, q->n, g->modes, row[1], 1);
    double sum = 0;
    for (uint32_t a = 0; a < g->modes; a++)
        sum += (double)g->value[a] * (double)row[0][a] * (double)row[1][a];
    return sum;
}

/* The same of a point with itself; *varies: by how much it differs a contact radius away. */
static double compliance_about(const palp_contact *c, const palp_surface_point *p, double a,
                               double *varies) {
    const double own = regular_compliance(c, p, p);
    const palp_vec3 t = bench_tangent((palp_vec3){0.3f, 0.5f, 0.8f}, p->n);
    *varies = 0;
    for (int side = -1; side <= 1; side += 2) {
        palp_surface_point q = *p;
        palp_vec3 from = palp_madd(palp_madd(p->y, (float)(side * a), t), (float)a, p->n);
        *varies = press_point(c, from, p->n, &q)
                      ? fmax(*varies, fabs(own - regular_compliance(c, p, &q)))
                      : HUGE_VAL;
    }
    return own;
}

/* The force at which Hertz' approach and force * h are the depth. */
static double hertz_force(double stiff, double flat, double depth, double h) {
    double least = 0, most = 2 * stiff * pow(depth / flat, 1.5);
    if (h > 0) most = fmin(most, depth / h);
    for (int it = 0; it < 60; it++) {
        const double force = 0.5 * (least + most);
        *(force < stiff * pow((depth - force * h) / flat, 1.5) ? &least : &most) = force;
    }
    return least;
}

/* Force over Hertz' less 1 with a contact radius of about `a` near a node; false where he does not
 * apply. */
static bool press_as_hertz(bench *b, uint32_t node, double a, double *error) {
    const palp_meta *m = b->blob->meta;
    const double radius = fmax(a / TOOL, SMALLEST * b->edge_m);
    const palp_tool tool = palp_tool_sphere((float)radius);
    palp_contact *c = contact_open(b->blob, &tool, 1, PALP_CONTACT_FINEST);
    palp_surface_point p = press_start(c, node);
    const palp_vec3 aside = {(float)(bench_roll(b) - 0.5), (float)(bench_roll(b) - 0.5),
                             (float)(bench_roll(b) - 0.5)};
    palp_vec3 from = palp_madd(p.y, (float)b->edge_m, palp_add(p.n, aside));
    paraboloid s = {.residual = 0};
    bool applies = press_point(c, from, p.n, &p) && fit_paraboloid(c, p, a, &s);
    const double a1 = 0.5 * (1 / radius + s.k1), a2 = 0.5 * (1 / radius + s.k2);
    applies = applies && a1 > 0 && fabs(s.k1) < MOST_CURVED / radius &&
              fabs(s.k2) < MOST_CURVED / radius && a2 < MOST_OBLONG * a1;
    if (applies) {
        const double effective = 0.5 / sqrt(a1 * a2), depth = a * a / effective,
                     flat = 1 - pow(pow(a2 / a1, 0.0684) - 1, 1.531);
        const palp_vec3 at = palp_madd(s.y, (float)(radius - depth), s.n);
        applies = s.residual < PARABOLOID * depth && press_is_clear(b->blob, at, radius, depth);
        double varies;
        const double h = compliance_about(c, &p, a, &varies), nu = (double)m->poisson,
                     stiff = 4.0 / 3 * (double)m->young_Pa / (1 - nu * nu) * sqrt(effective),
                     force = hertz_force(stiff, flat, depth, h);
        applies = applies && varies * force < EVEN * depth;
        if (applies) {
            press_hold(c, at, 8);
            *error = (double)palp_norm(c->force_N[0]) / force - 1;
        }
    }
    contact_close(c);
    return applies;
}

void feel_hertz(bench *b) {
    static const double size[] = {0.1, 0.2, 0.5, 1};
    for (size_t s = 0; s < sizeof size / sizeof size[0]; s++) {
        double sum = 0, square = 0;
        uint32_t used = 0, tried = 0;
        for (; used < b->places && tried < TRIED * b->places; tried++) {
            double error;
            if (!press_as_hertz(b, bench_roll_node(b), size[s] * b->edge_m, &error)) continue;
            sum += error;
            square += error * error;
            used++;
        }
        if (used == 0) continue;
        char of[72];
        double mean = sum / used;
        snprintf(of, sizeof of, "contact radius %g edges, %u of %u places", size[s], used, tried);
        feel_add(&b->table, "Hertz, mean", of, 100 * mean, "%", FEEL_FORCE_THRESHOLD,
                 s == 0 ? 5 : 3);
        feel_add(&b->table, "Hertz, spread", of, 100 * sqrt(fmax(square / used - mean * mean, 0)),
                 "%", FEEL_FORCE_THRESHOLD, s == 0 ? 9 : 3);
    }
}
