/* SPDX-License-Identifier: MIT */
/* Ripple of the force while a rigid tool slides at constant depth. */
#include "tools/feel/bench.h"
#include "tools/press/press.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>

#define PATH_TICKS 240 /* of a slide */
#define PATH_EDGES 4.0 /* its length */
#define PLAIN 0.6      /* angle by which the surface turns over one edge, where it is plain */
#define TRIED 3        /* paths for each that is wanted */

/* What differs from a parabola through its surroundings of `window` ticks to each side, rms over
 * the force (Savitzky and Golay's smoothing, of second order). */
static double roughness(const double *f, const double *force, int count, int window) {
    const double m = window, scale = 3 / ((2 * m - 1) * (2 * m + 1) * (2 * m + 3));
    double square = 0;
    for (int k = window; k + window < count; k++) {
        double smooth = 0;
        for (int j = -window; j <= window; j++)
            smooth += scale * (3 * m * m + 3 * m - 1 - 5.0 * j * j) * f[k + j];
        square += pow((f[k] - smooth) / force[k], 2) / (count - 2 * window);
    }
    return sqrt(square);
}

/* Ripple of a path: of the force, and of its part along the path; largest angle by which the
 * surface turns over one edge. */
typedef struct {
    double force, along, turns;
} path_ripple;

/* Slides at constant depth; the ripple over a window of one edge to each side. False where the path
 * ends or the rest of the body is in the way; *lost counts ticks without force. */
static bool slide(bench *b, uint32_t node, double radius, double depth, uint32_t level,
                  uint32_t *lost, path_ripple *r) {
    palp_tool tool = palp_tool_sphere((float)radius);
    palp_contact *c = contact_open(b->blob, &tool, 1, level);
    palp_surface_point p = press_start(c, node);
    palp_vec3 along = {0.3f, 0.5f, 0.8f};
    palp_vec3 n[PATH_TICKS];
    const int window = (int)(PATH_TICKS / PATH_EDGES);
    double f[PATH_TICKS], t[PATH_TICKS], least = 1;
    uint32_t without = 0;
    bool whole = true;
    for (int i = -20; i < PATH_TICKS && whole; i++) {
        along = bench_tangent(along, p.n);
        double advance = i < 0 ? 0 : PATH_EDGES * b->edge_m / PATH_TICKS;
        palp_vec3 y = palp_madd(p.y, (float)advance, along);
        whole = press_point(c, palp_madd(y, (float)b->edge_m, p.n), p.n, &p);
        palp_vec3 at = palp_madd(p.y, (float)(radius - depth), p.n);
        whole = whole && press_is_clear(b->blob, at, radius, depth);
        press_hold(c, at, 1);
        if (i < 0) continue;
        n[i] = p.n;
        if (i >= window) least = fmin(least, (double)palp_dot(n[i], n[i - window]));
        f[i] = (double)palp_norm(c->force_N[0]);
        t[i] = (double)palp_dot(c->force_N[0], along);
        without += !(f[i] > 0);
    }
    contact_close(c);
    if (!whole) return false;
    *lost += without;
    *r = (path_ripple){roughness(f, f, PATH_TICKS, window), roughness(t, f, PATH_TICKS, window),
                       acos(fmax(least, -1))};
    return true;
}

/* Rows of one tool and depth: the median and the worst path. */
static void ripple_of(bench *b, double size, double depth, uint32_t level, double goal,
                      double goal_along, uint32_t *lost) {
    const uint32_t most = TRIED * b->places;
    double *force = allocate(most, sizeof *force), *along = allocate(most, sizeof *along),
           *sharp = allocate(most, sizeof *sharp);
    uint32_t paths = 0, turning = 0;
    char of[72];
    for (uint32_t i = 0; i < most && paths < b->places; i++) {
        path_ripple r;
        const double radius = size * b->edge_m;
        const uint32_t node = i < b->places ? b->place[i] : bench_roll_node(b);
        if (!slide(b, node, radius, depth * radius, level, lost, &r)) continue;
        if (r.turns > PLAIN) {
            sharp[turning++] = 100 * r.force;
            continue;
        }
        force[paths] = 100 * r.force;
        along[paths++] = 100 * r.along;
    }
    snprintf(of, sizeof of, "level %u, tool %g edges, depth %g R, %u paths", level, size, depth,
             paths);
    if (paths > 0) {
        feel_add(&b->table, "ripple", of, bench_median(force, paths), "% rms", NAN, goal);
        feel_add(&b->table, "ripple, worst path", of, force[paths - 1], "% rms", NAN, NAN);
        feel_add(&b->table, "ripple, tangential", of, bench_median(along, paths), "% rms", NAN,
                 goal_along);
    }
    snprintf(of, sizeof of, "level %u, tool %g edges, depth %g R, %u paths", level, size, depth,
             turning);
    if (turning > 0)
        feel_add(&b->table, "change at sharp edges", of, bench_median(sharp, turning), "% rms", NAN,
                 NAN);
    free(force);
    free(along);
    free(sharp);
}

void feel_ripple(bench *b) {
    static const double size[] = {0.75, 1.5, 3, 6}, depth[] = {0.03, 0.1, 0.3},
                        goal[] = {2, 0.7, 0.3};
    uint32_t lost = 0;
    for (size_t s = 0; s < 4; s++) {
        for (size_t d = 0; d < 3; d++)
            ripple_of(b, size[s], depth[d], PALP_CONTACT_FINEST, goal[d], 0.2, &lost);
    }
    for (uint32_t l = 0; l < PALP_CONTACT_FINEST; l++) {
        for (size_t s = 1; s < 4; s++) ripple_of(b, size[s], 0.1, l, 2, NAN, &lost);
    }
    feel_add(&b->table, "contact lost", "on all these paths", lost, "ticks", (double)NAN, 0);
}
