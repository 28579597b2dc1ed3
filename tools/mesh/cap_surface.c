/* SPDX-License-Identifier: MIT */
#include "tools/mesh/cap_surface.h"
#include "tools/mesh/mesh.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CLEARANCE 0.6  /* of interior points from the loops, in edge lengths */
#define JITTER 1e-6    /* of the edge length squared, see in_circle */
#define MAX_FLIPS 1000 /* per edge that is enforced */
#define RELAXATIONS 2000

/* Third: a little of its own that breaks ties. */
typedef double point2[3];

/* The plane region under triangulation. */
typedef struct {
    double origin[3], axis[3][3]; /* axis[2] is the normal */
    uint32_t boundary, points;
    point2 *p;
    uint32_t (*edge)[2]; /* of the loops */
    uint32_t (*t)[3];    /* counterclockwise */
    uint32_t triangles;
    size_t point_room, triangle_room;
} region;

static void find_plane(region *r, double (*x)[3], uint32_t n) {
    double normal[3] = {0}, along[3], least[3] = {0};
    memset(r->origin, 0, sizeof r->origin);
    for (uint32_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++) r->origin[k] += x[i][k] / n;
    }
    for (uint32_t e = 0; e < r->boundary; e++) { /* Newell: twice the vector area */
        double a[3], b[3], c[3];
        v_sub(x[r->edge[e][0]], r->origin, a);
        v_sub(x[r->edge[e][1]], r->origin, b);
        v_cross(a, b, c);
        for (int k = 0; k < 3; k++) normal[k] += c[k];
    }
    v_normalize(normal);
    int smallest = 0;
    for (int k = 1; k < 3; k++) {
        if (fabs(normal[k]) < fabs(normal[smallest])) smallest = k;
    }
    least[smallest] = 1;
    v_cross(normal, least, along);
    v_normalize(along);
    memcpy(r->axis[0], along, sizeof along);
    v_cross(normal, along, r->axis[1]);
    memcpy(r->axis[2], normal, sizeof normal);
}

static double area2(const point2 a, const point2 b, const point2 c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/*
 * Above 0 when d lies inside the circle through a, b, c (counterclockwise). Points on one circle,
 * which regular outlines are full of, are told apart by small weights, so that all answers fit
 * together.
 */
static double in_circle(const point2 a, const point2 b, const point2 c, const point2 d) {
    double m[3][3];
    const double *corner[3] = {a, b, c};
    for (int i = 0; i < 3; i++) {
        m[i][0] = corner[i][0] - d[0];
        m[i][1] = corner[i][1] - d[1];
        m[i][2] = m[i][0] * m[i][0] + m[i][1] * m[i][1] + corner[i][2] - d[2];
    }
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
           m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

static bool inside(const region *r, const point2 q) {
    bool in = false;
    for (uint32_t e = 0; e < r->boundary; e++) {
        const double *a = r->p[r->edge[e][0]], *b = r->p[r->edge[e][1]];
        if ((a[1] > q[1]) == (b[1] > q[1])) continue;
        if (q[0] < a[0] + (q[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])) in = !in;
    }
    return in;
}

static double clearance(const region *r, const point2 q) {
    double nearest = HUGE_VAL;
    for (uint32_t e = 0; e < r->boundary; e++) {
        const double *a = r->p[r->edge[e][0]], *b = r->p[r->edge[e][1]];
        double d[2] = {b[0] - a[0], b[1] - a[1]}, s[2] = {q[0] - a[0], q[1] - a[1]};
        double t = (s[0] * d[0] + s[1] * d[1]) / (d[0] * d[0] + d[1] * d[1]);
        t = t < 0 ? 0 : t > 1 ? 1 : t;
        nearest = fmin(nearest, hypot(s[0] - t * d[0], s[1] - t * d[1]));
    }
    return nearest;
}

static double jitter(uint64_t *seed) {
    *seed = *seed * 6364136223846793005ull + 1442695040888963407ull;
    return (double)(*seed >> 11) / 4503599627370496.0 - 1.0;
}

static void add_lattice(region *r, double edge, uint64_t *seed) {
    double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL};
    for (uint32_t i = 0; i < r->boundary; i++) {
        for (int k = 0; k < 2; k++) {
            low[k] = fmin(low[k], r->p[i][k]);
            high[k] = fmax(high[k], r->p[i][k]);
        }
    }
    double rise = edge * sqrt(0.75);
    uint32_t row = 0;
    for (double y = low[1] + 0.5 * rise; y < high[1]; y += rise, row++) {
        for (double x = low[0] + (row % 2 == 0 ? 0.25 : 0.75) * edge; x < high[0]; x += edge) {
            point2 q = {x, y, JITTER * edge * edge * jitter(seed)};
            if (!inside(r, q) || clearance(r, q) < CLEARANCE * edge) continue;
            r->p = grow(r->p, &r->point_room, r->points + 4, sizeof *r->p);
            memcpy(r->p[r->points++], q, sizeof q);
        }
    }
}

static void add_triangle(region *r, uint32_t a, uint32_t b, uint32_t c) {
    r->t = grow(r->t, &r->triangle_room, r->triangles + 1, sizeof *r->t);
    uint32_t *t = r->t[r->triangles++];
    t[0] = a;
    t[1] = b;
    t[2] = c;
}

/* Bowyer and Watson: takes out the triangles whose circle holds the point, fills the hole. */
static void insert_point(region *r, uint32_t q) {
    size_t room = 0, count = 0;
    uint32_t(*rim)[2] = NULL, kept = 0;
    for (uint32_t i = 0; i < r->triangles; i++) {
        uint32_t *t = r->t[i];
        if (in_circle(r->p[t[0]], r->p[t[1]], r->p[t[2]], r->p[q]) <= 0) {
            memmove(r->t[kept++], t, sizeof *r->t);
            continue;
        }
        for (int k = 0; k < 3; k++) {
            uint32_t a = t[k], b = t[(k + 1) % 3];
            size_t twin = 0;
            while (twin < count && (rim[twin][0] != b || rim[twin][1] != a)) twin++;
            if (twin < count) {
                memcpy(rim[twin], rim[--count], sizeof *rim);
                continue;
            }
            rim = grow(rim, &room, count + 1, sizeof *rim);
            rim[count][0] = a;
            rim[count++][1] = b;
        }
    }
    r->triangles = kept;
    for (size_t i = 0; i < count; i++) add_triangle(r, rim[i][0], rim[i][1], q);
    free(rim);
}

static void delaunay(region *r) {
    double far = 0;
    uint32_t n = r->points;
    for (uint32_t i = 0; i < n; i++) far = fmax(far, hypot(r->p[i][0], r->p[i][1]));
    r->p = grow(r->p, &r->point_room, n + 4, sizeof *r->p);
    for (int k = 0; k < 3; k++) {
        double angle = 0.1 + 2.0943951 * k;
        r->p[n + (uint32_t)k][0] = 100 * far * cos(angle);
        r->p[n + (uint32_t)k][1] = 100 * far * sin(angle);
        r->p[n + (uint32_t)k][2] = 0;
    }
    add_triangle(r, n, n + 1, n + 2);
    for (uint32_t i = 0; i < n; i++) insert_point(r, i);
}

/* The triangle with the directed edge a -> b, and its third corner; -1 if there is none. */
static int32_t find_edge(const region *r, uint32_t a, uint32_t b, uint32_t *third) {
    for (uint32_t i = 0; i < r->triangles; i++) {
        for (int k = 0; k < 3; k++) {
            if (r->t[i][k] != a || r->t[i][(k + 1) % 3] != b) continue;
            *third = r->t[i][(k + 2) % 3];
            return (int32_t)i;
        }
    }
    return -1;
}

static bool crosses(const region *r, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    if (a == c || a == d || b == c || b == d) return false;
    const double *pa = r->p[a], *pb = r->p[b], *pc = r->p[c], *pd = r->p[d];
    return (area2(pa, pb, pc) > 0) != (area2(pa, pb, pd) > 0) &&
           (area2(pc, pd, pa) > 0) != (area2(pc, pd, pb) > 0);
}

/* Flips one edge that crosses a - b and whose two triangles make a convex quadrilateral; false if
 * there is none. `turn` spreads the choice. */
static bool flip_one(region *r, uint32_t a, uint32_t b, uint32_t turn) {
    for (uint32_t s = 0; s < r->triangles; s++) {
        uint32_t i = (s + turn) % r->triangles;
        for (int k = 0; k < 3; k++) {
            uint32_t c = r->t[i][k], d = r->t[i][(k + 1) % 3], e = r->t[i][(k + 2) % 3], f;
            if (!crosses(r, a, b, c, d)) continue;
            int32_t other = find_edge(r, d, c, &f);
            if (other < 0 || area2(r->p[e], r->p[c], r->p[f]) <= 0 ||
                area2(r->p[f], r->p[d], r->p[e]) <= 0)
                continue;
            uint32_t first[3] = {e, c, f}, second[3] = {f, d, e};
            memcpy(r->t[i], first, sizeof first);
            memcpy(r->t[other], second, sizeof second);
            return true;
        }
    }
    return false;
}

static void enforce_loops(region *r, const char *what) {
    for (uint32_t e = 0; e < r->boundary; e++) {
        uint32_t a = r->edge[e][0], b = r->edge[e][1], third;
        for (uint32_t k = 0; find_edge(r, a, b, &third) < 0 && find_edge(r, b, a, &third) < 0;
             k++) {
            if (k == MAX_FLIPS || !flip_one(r, a, b, k)) {
                die(EXIT_WORK, "%s: the outline of the cut crosses itself: move the cut", what);
            }
        }
    }
}

static void keep_inside(region *r) {
    uint32_t kept = 0;
    for (uint32_t i = 0; i < r->triangles; i++) {
        const uint32_t *t = r->t[i];
        if (t[0] >= r->points || t[1] >= r->points || t[2] >= r->points) continue;
        point2 middle;
        for (int k = 0; k < 2; k++) middle[k] = (r->p[t[0]][k] + r->p[t[1]][k] + r->p[t[2]][k]) / 3;
        if (inside(r, middle)) memmove(r->t[kept++], t, sizeof *r->t);
    }
    r->triangles = kept;
}

/* Heights over the plane: given on the loops, the mean of the neighbours inside. */
static void lift(const region *r, double (*x)[3]) {
    double *height = allocate(r->points, sizeof *height);
    double *sum = allocate(r->points, sizeof *sum);
    uint32_t *valence = allocate(r->points, sizeof *valence);
    for (uint32_t i = 0; i < r->boundary; i++) {
        double off[3];
        v_sub(x[i], r->origin, off);
        height[i] = v_dot(off, r->axis[2]);
    }
    for (int step = 0; step < RELAXATIONS; step++) {
        memset(sum, 0, r->points * sizeof *sum);
        memset(valence, 0, r->points * sizeof *valence);
        for (uint32_t i = 0; i < r->triangles; i++) {
            for (int k = 0; k < 3; k++) {
                uint32_t a = r->t[i][k], b = r->t[i][(k + 1) % 3];
                sum[a] += height[b];
                sum[b] += height[a];
                valence[a]++;
                valence[b]++;
            }
        }
        for (uint32_t i = r->boundary; i < r->points; i++) {
            if (valence[i] > 0) height[i] = sum[i] / valence[i];
        }
    }
    for (uint32_t i = r->boundary; i < r->points; i++) {
        for (int k = 0; k < 3; k++) {
            x[i][k] = r->origin[k] + r->p[i][0] * r->axis[0][k] + r->p[i][1] * r->axis[1][k] +
                      height[i] * r->axis[2][k];
        }
    }
    free(height);
    free(sum);
    free(valence);
}

cap cap_build(double (*loop)[3], const uint32_t *length, uint32_t loops, const char *what) {
    region r = {.boundary = 0};
    for (uint32_t k = 0; k < loops; k++) r.boundary += length[k];
    r.edge = allocate(r.boundary, sizeof *r.edge);
    double total = 0;
    for (uint32_t k = 0, first = 0; k < loops; first += length[k++]) {
        for (uint32_t i = 0; i < length[k]; i++) {
            r.edge[first + i][0] = first + i;
            r.edge[first + i][1] = first + (i + 1) % length[k];
            total += v_distance(loop[first + i], loop[first + (i + 1) % length[k]]);
        }
    }
    const double edge = total / r.boundary;
    uint64_t seed = 1;
    find_plane(&r, loop, r.boundary);
    r.points = r.boundary;
    r.p = grow(r.p, &r.point_room, r.points + 4, sizeof *r.p);
    for (uint32_t i = 0; i < r.boundary; i++) {
        double off[3];
        v_sub(loop[i], r.origin, off);
        for (int k = 0; k < 2; k++) r.p[i][k] = v_dot(off, r.axis[k]);
        r.p[i][2] = JITTER * edge * edge * jitter(&seed);
    }
    add_lattice(&r, edge, &seed);
    delaunay(&r);
    enforce_loops(&r, what);
    keep_inside(&r);
    cap c = {.points = r.points, .boundary = r.boundary, .triangles = r.triangles};
    c.x = allocate(r.points, sizeof *c.x);
    memcpy(c.x, loop, r.boundary * sizeof *c.x);
    lift(&r, c.x);
    c.t = allocate(r.triangles, sizeof *c.t);
    for (uint32_t i = 0; i < r.triangles; i++) { /* the loops run counterclockwise, so turn round */
        c.t[i][0] = r.t[i][0];
        c.t[i][1] = r.t[i][2];
        c.t[i][2] = r.t[i][1];
    }
    free(r.edge);
    free(r.p);
    free(r.t);
    return c;
}

void cap_free(cap *c) {
    free(c->x);
    free(c->t);
}
