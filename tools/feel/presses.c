/* SPDX-License-Identifier: MIT */
/* Presses: coarser levels against the finest, hard places against all nodes in double, the same
 * body on a finer mesh. */
#include "tools/feel/bench.h"
#include "tools/solver/nodal.h"
#include "tools/press/places.h"
#include "tools/press/press.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Between two forces; 180 where there is none. */
static double angle_deg(palp_vec3 a, palp_vec3 b) {
    if (!(palp_norm(a) > 0 && palp_norm(b) > 0)) return 180;
    const double along = (double)palp_dot(a, b) / ((double)palp_norm(a) * (double)palp_norm(b));
    return acos(fmax(fmin(along, 1), -1)) * 180 / acos(-1.0);
}

void feel_levels(bench *b) {
    static const double goal[PALP_CONTACT_LEVELS] = {4, 4, 4, 2, 2};
    const press_errors e = press_levels(b->blob, b->place, b->places);
    for (uint32_t l = 0; l + 1 < PALP_CONTACT_LEVELS; l++) {
        char of[72];
        snprintf(of, sizeof of, "level %u against %u, tools of 1 to 6 edges", l,
                 PALP_CONTACT_LEVELS - 1u);
        feel_add(&b->table, "level, mean", of, 100 * e.mean[l], "%", FEEL_FORCE_THRESHOLD, goal[l]);
        feel_add(&b->table, "level, worst", of, 100 * e.worst[l], "%", FEEL_FORCE_THRESHOLD, NAN);
    }
}

/* Largest change of the force in a tick over the largest ordinary one: the median of the ticks
 * about it. 1 where the force is smooth. */
static double largest_jump(const palp_vec3 *f, int count) {
    enum { BESIDE = 8 };
    double *step = allocate((size_t)count, sizeof *step), ordinary = 0, most = 0;
    for (int k = 1; k < count; k++) step[k] = (double)palp_norm(palp_sub(f[k], f[k - 1]));
    for (int k = 1 + BESIDE; k + BESIDE < count; k++) {
        double about[2 * BESIDE + 1];
        memcpy(about, step + k - BESIDE, sizeof about);
        ordinary = fmax(ordinary, bench_median(about, 2 * BESIDE + 1));
        most = fmax(most, step[k]);
    }
    free(step);
    return ordinary > 0 ? most / ordinary : HUGE_VAL;
}

/* Presses and slides where contact is hard; the press against all nodes in double. */
#define HARD_PLACES 4u
#define HARD_EDGES 6.0 /* of the tool: fine enough for the nodes to be right */
#define HARD_DEPTH 0.2 /* over the radius */
#define HARD_TICKS 200 /* of the press, and of the slide */

typedef struct {
    double off, turned_deg, jump;
    bool compared;
} hard_press;

static hard_press press_hard_place(const bench *b, const place *at, double radius) {
    const palp_tool tool = palp_tool_sphere((float)radius);
    palp_contact *c = contact_open(b->blob, &tool, 1, PALP_CONTACT_FINEST);
    const palp_vec3 side =
        palp_cross(at->push, bench_tangent((palp_vec3){0.3f, 0.5f, 0.8f}, at->push));
    palp_vec3 f[2 * HARD_TICKS], held = {0};
    for (int k = 0; k < 2 * HARD_TICKS; k++) {
        double down = fmin((k + 1.0) / HARD_TICKS, 1) * HARD_DEPTH * radius;
        double aside = fmax((k + 1.0) / HARD_TICKS - 1, 0) * HARD_DEPTH * radius;
        palp_vec3 where = palp_madd(at->at_m, (float)down, at->push);
        press_hold(c, palp_madd(where, (float)aside, side), 1);
        f[k] = c->force_N[0];
        if (k + 1 == HARD_TICKS) held = where;
    }
    contact_close(c);
    const double center[3] = {(double)held.x, (double)held.y, (double)held.z};
    const nodal_press truth = nodal_hold(b->blob, center, radius);
    const palp_vec3 felt = f[HARD_TICKS - 1];
    const palp_vec3 right = {(float)truth.force_N[0], (float)truth.force_N[1],
                             (float)truth.force_N[2]};
    const double size = (double)palp_norm(right);
    return (hard_press){.off = fabs((double)palp_norm(felt) / size - 1),
                        .turned_deg = angle_deg(felt, right),
                        .jump = largest_jump(f, 2 * HARD_TICKS),
                        .compared = truth.settled && size > 0};
}

void feel_hard_places(bench *b) {
    static const char *const name[PLACE_KINDS] = {"tips", "valleys", "two regions"};
    const double radius = HARD_EDGES * b->edge_m;
    for (place_kind kind = PLACE_TIP; kind < PLACE_KINDS; kind++) {
        place at[HARD_PLACES];
        uint32_t found = places_find(b->blob, kind, radius, HARD_DEPTH * radius, at, HARD_PLACES);
        double mean = 0, worst = 0, turned = 0, jump = 0;
        uint32_t used = 0;
        for (uint32_t i = 0; i < found; i++) {
            hard_press p = press_hard_place(b, &at[i], radius);
            jump = fmax(jump, p.jump);
            if (!p.compared) continue;
            used++;
            mean += p.off;
            worst = fmax(worst, p.off);
            turned = fmax(turned, p.turned_deg);
        }
        if (found == 0) continue;
        char of[72];
        snprintf(of, sizeof of, "%s, tool %g edges, depth %g R, %u places", name[kind], HARD_EDGES,
                 HARD_DEPTH, used);
        if (used > 0) {
            feel_add(&b->table, "against all nodes, mean", of, 100 * mean / used, "%",
                     FEEL_FORCE_THRESHOLD, 7);
            feel_add(&b->table, "against all nodes, worst", of, 100 * worst, "%",
                     FEEL_FORCE_THRESHOLD, NAN);
            feel_add(&b->table, "direction, worst", of, turned, "deg", NAN, NAN);
        }
        feel_add(&b->table, "largest step", of, jump, "times", NAN, 1.5);
    }
}

/* ---- the same body on a finer mesh ---- */

static uint32_t nearest_node(const palp_blob *b, palp_vec3 x) {
    uint32_t nearest = 0;
    float least = HUGE_VALF;
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        palp_vec3 d = palp_sub(at_node(b->rest_m, i), x);
        if (palp_dot(d, d) < least) {
            least = palp_dot(d, d);
            nearest = i;
        }
    }
    return nearest;
}

/* Force on a tool pressed along -n, so deep below where the line meets the body; false where it
 * does not, or the rest of the body is in the way. */
static bool press_along(const palp_blob *body, palp_vec3 from, palp_vec3 n, double radius,
                        double depth, palp_vec3 *force) {
    const palp_tool tool = palp_tool_sphere((float)radius);
    palp_contact *c = contact_open(body, &tool, 1, PALP_CONTACT_FINEST);
    palp_surface_point p = press_start(c, nearest_node(body, from));
    bool met = press_point(c, from, n, &p);
    const palp_vec3 at = palp_madd(p.y, (float)(radius - depth), n);
    met = met && press_is_clear(body, at, radius, depth);
    if (met) press_hold(c, at, 8);
    *force = c->force_N[0];
    contact_close(c);
    return met && palp_norm(*force) > 0;
}

void feel_finer_mesh(bench *b) {
    static const double depth[] = {0.1, 0.2, 0.4}, size[] = {1, 2, 4};
    for (size_t d = 0; d < 3; d++) {
        double sum = 0, worst = 0, turned = 0;
        uint32_t used = 0;
        for (uint32_t i = 0; i < 3 * b->places; i++) {
            const double radius = size[i % 3] * b->edge_m;
            const uint32_t node = b->place[i / 3];
            const palp_vec3 n = at_node(b->blob->normal, node),
                            from = palp_madd(at_node(b->blob->rest_m, node), (float)b->edge_m, n);
            palp_vec3 coarse, fine;
            if (!press_along(b->blob, from, n, radius, depth[d] * radius, &coarse) ||
                !press_along(b->finer, from, n, radius, depth[d] * radius, &fine))
                continue;
            const double off = fabs((double)(palp_norm(coarse) / palp_norm(fine)) - 1);
            sum += off;
            worst = fmax(worst, off);
            turned = fmax(turned, angle_deg(coarse, fine));
            used++;
        }
        if (used == 0) continue;
        char of[80];
        snprintf(of, sizeof of, "%u nodes, depth %g R, %u presses of 1 to 4 edges",
                 b->finer->meta->nodes, depth[d], used);
        feel_add(&b->table, "finer mesh, mean", of, 100 * sum / used, "%", FEEL_FORCE_THRESHOLD, 2);
        feel_add(&b->table, "finer mesh, worst", of, 100 * worst, "%", FEEL_FORCE_THRESHOLD, NAN);
        feel_add(&b->table, "finer mesh, direction", of, turned, "deg", NAN, 1);
    }
}
