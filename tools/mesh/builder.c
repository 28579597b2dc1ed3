/* SPDX-License-Identifier: MIT */
#include "tools/mesh/builder.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

void builder_vertex(builder *b, const double x[3], size_t line) {
    b->x = grow(b->x, &b->x_capacity, b->vertices + 1, sizeof *b->x);
    b->x_line = grow(b->x_line, &b->line_capacity, b->vertices + 1, sizeof *b->x_line);
    memcpy(b->x[b->vertices], x, 3 * sizeof *x);
    b->x_line[b->vertices++] = line;
}

void builder_face(builder *b, size_t line) {
    b->face = grow(b->face, &b->face_capacity, b->faces + 1, sizeof *b->face);
    b->face[b->faces++] = (polygon){.first = b->corners, .line = line};
}

void builder_corner(builder *b, int64_t vertex) {
    b->corner = grow(b->corner, &b->corner_capacity, b->corners + 1, sizeof *b->corner);
    b->corner[b->corners++] = vertex;
    b->face[b->faces - 1].corners++;
}

/* ---- triangles ---- */

typedef struct {
    mesh m;
    size_t capacity;
} triangles;

static void add_triangle(triangles *t, uint32_t p, uint32_t q, uint32_t r) {
    t->m.t = grow(t->m.t, &t->capacity, t->m.triangles + 1u, sizeof *t->m.t);
    uint32_t *corner = t->m.t[t->m.triangles++];
    corner[0] = p;
    corner[1] = q;
    corner[2] = r;
}

/* Newell's normal of a polygon, about its first corner. */
static void polygon_normal(const mesh *m, const uint32_t *corner, size_t n, double normal[3]) {
    memset(normal, 0, 3 * sizeof *normal);
    for (size_t i = 1; i + 1 < n; i++) {
        double c[3];
        triangle_normal(m->x[corner[0]], m->x[corner[i]], m->x[corner[i + 1]], c);
        for (int k = 0; k < 3; k++) normal[k] += c[k];
    }
}

static bool is_ear(const mesh *m, const uint32_t *corner, size_t n, size_t i,
                   const double normal[3]) {
    const double *a = m->x[corner[(i + n - 1) % n]];
    const double *b = m->x[corner[i]];
    const double *c = m->x[corner[(i + 1) % n]];
    double turn[3];
    triangle_normal(a, b, c, turn);
    if (v_dot(turn, normal) <= 0) return false;
    for (size_t k = 0; k < n; k++) {
        const double *p = m->x[corner[k]]; /* that of a bridge to a hole lies there twice */
        if (v_distance(p, a) <= 0 || v_distance(p, b) <= 0 || v_distance(p, c) <= 0) continue;
        double s[3][3];
        triangle_normal(a, b, p, s[0]);
        triangle_normal(b, c, p, s[1]);
        triangle_normal(c, a, p, s[2]);
        if (v_dot(s[0], normal) >= 0 && v_dot(s[1], normal) >= 0 && v_dot(s[2], normal) >= 0)
            return false;
    }
    return true;
}

static void clip_ears(triangles *t, uint32_t *corner, size_t n) {
    double normal[3];
    polygon_normal(&t->m, corner, n, normal);
    while (n > 3) {
        size_t ear = 0;
        while (ear < n && !is_ear(&t->m, corner, n, ear, normal)) ear++;
        if (ear == n) ear = 0;
        add_triangle(t, corner[(ear + n - 1) % n], corner[ear], corner[(ear + 1) % n]);
        memmove(corner + ear, corner + ear + 1, (n - ear - 1) * sizeof *corner);
        n--;
    }
    add_triangle(t, corner[0], corner[1], corner[2]);
}

/* How many corners a polygon has that goes round more than once; n where it does not. */
static size_t first_round(const uint32_t *corner, size_t n) {
    for (size_t round = 3; 2 * round <= n; round++) {
        size_t k = round;
        while (k < n && corner[k] == corner[k - round]) k++;
        if (k == n) return round;
    }
    return n;
}

/* The corners of a polygon, each once where it follows itself; exits on one that is not there. */
static size_t corners_of(builder *b, const polygon *f, uint32_t *corner) {
    size_t n = 0;
    for (size_t k = 0; k < f->corners; k++) {
        const int64_t v = b->corner[f->first + k];
        if (v < 0 || (uint64_t)v >= b->vertices)
            die(EXIT_WORK, "%s:%zu: vertex %" PRId64 " is out of range (%zu vertices)", b->path,
                f->line, v + b->first_number, b->vertices);
        for (int axis = 0; axis < 3; axis++) {
            if (!isfinite(b->x[v][axis]))
                die(EXIT_WORK, "%s:%zu: coordinate %d of vertex %" PRId64 " is not a finite number",
                    b->path, b->x_line[v], axis + 1, v + b->first_number);
        }
        const uint32_t c = (uint32_t)v;
        if (n > 0 && corner[n - 1] == c)
            b->mended.corners++;
        else
            corner[n++] = c;
    }
    if (n > 1 && corner[n - 1] == corner[0]) {
        b->mended.corners++;
        n--;
    }
    const size_t round = first_round(corner, n);
    b->mended.corners += (uint32_t)(n - round);
    return round;
}

mesh builder_finish(builder *b) {
    if (b->vertices >= UINT32_MAX / 4u || b->faces >= UINT32_MAX / 4u)
        die(EXIT_WORK, "%s: %zu vertices and %zu faces are too many", b->path, b->vertices,
            b->faces);
    triangles t = {.m = {.vertices = (uint32_t)b->vertices, .x = b->x}};
    size_t most = 3;
    for (size_t i = 0; i < b->faces; i++)
        most = b->face[i].corners > most ? b->face[i].corners : most;
    uint32_t *corner = allocate(most, sizeof *corner);
    for (size_t i = 0; i < b->faces; i++) {
        const size_t n = corners_of(b, &b->face[i], corner);
        if (n >= 3)
            clip_ears(&t, corner, n);
        else
            b->mended.wires++;
    }
    free(corner);
    free(b->corner);
    free(b->face);
    free(b->x_line);
    if (t.m.triangles > 0) b->mended.unused = mesh_drop_unused(&t.m);
    return t.m;
}
