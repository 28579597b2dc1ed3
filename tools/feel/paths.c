/* SPDX-License-Identifier: MIT */
/* Closed paths: what a hand that goes round gives or is given. */
#include "tools/feel/bench.h"
#include "tools/press/press.h"
#include <math.h>

/* Net work over a closed path of a rigid tool about a place, over what is stored on it: the third
 * time round, when what the first brought about has been repaid. */
static double closed_path(const bench *b, uint32_t node, uint32_t level) {
    static const int ticks = 4000;
    double radius = 2 * b->edge_m, depth = 0.15 * radius, work = 0, stored = 0;
    palp_tool tool = palp_tool_sphere((float)radius);
    palp_contact *c = contact_open(b->blob, &tool, 1, level);
    palp_surface_point p = press_start(c, node);
    palp_vec3 before_m = {0}, before_N = {0};
    const palp_vec3 t = bench_tangent((palp_vec3){0.3f, 0.5f, 0.8f}, p.n), t2 = palp_cross(p.n, t);
    for (int k = 0; k <= 3 * ticks; k++) {
        double q = 2 * acos(-1.0) * k / ticks;
        palp_vec3 at = palp_madd(p.y, (float)(radius - depth * (1 + 0.5 * sin(2 * q))), p.n);
        at = palp_madd(at, (float)(0.3 * radius * cos(q)), t);
        at = palp_madd(at, (float)(0.3 * radius * sin(q)), t2);
        press_hold(c, at, 1);
        if (k > 2 * ticks) {
            palp_vec3 mean = palp_scale(0.5f, palp_add(before_N, c->force_N[0]));
            work += (double)palp_dot(mean, palp_sub(at, before_m));
            stored = fmax(stored, (double)c->energy_J);
        }
        before_m = at;
        before_N = c->force_N[0];
    }
    contact_close(c);
    return stored > 0 ? work / stored : 0;
}

/* Both signs: what is lost one way round is given the other. */
void feel_closed_paths(bench *b) {
    const uint32_t paths = b->places < 10 ? b->places : 10;
    for (uint32_t l = 0; l < PALP_CONTACT_LEVELS; l++) {
        double given[10] = {0}, worst = 0;
        for (uint32_t i = 0; i < paths; i++) {
            given[i] = fabs(closed_path(b, b->place[i], l));
            worst = fmax(worst, given[i]);
        }
        char of[72];
        snprintf(of, sizeof of, "level %u, work over stored, %u paths", l, paths);
        feel_add(&b->table, "closed path, median", of, bench_median(given, paths), "1", NAN, 1e-4);
        feel_add(&b->table, "closed path, worst", of, worst, "1", NAN, 1e-4);
    }
}
