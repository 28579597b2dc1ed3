/* SPDX-License-Identifier: MIT */
#include "tools/export/film.h"
#include "port/host/blobfile.h"
#include "port/host/parallel.h"
#include "port/host/toolfile.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define AROUND 24u
#define TURN 6.28318530717958648

/* ---- a blob at rest ---- */

static film_part *add_part(film *f, const char *name, uint32_t nodes, uint32_t triangles,
                           const uint32_t *triangle) {
    film_part *p = &f->part[f->parts++];
    uint8_t *fixed = allocate(nodes, 1);
    float *rest_m = allocate(3 * (size_t)nodes, sizeof *rest_m);
    *p = (film_part){.name = name,
                     .nodes = nodes,
                     .triangles = triangles,
                     .triangle = triangle,
                     .rest_m = rest_m,
                     .fixed = fixed};
    f->nodes += nodes;
    return p;
}

static void add_blob(film *f, const char *name, const palp_blob *b) {
    film_part *p = add_part(f, name, b->meta->nodes, b->meta->triangles, b->triangle);
    memcpy((float *)(uintptr_t)p->rest_m, b->rest_m, 3 * (size_t)p->nodes * sizeof(float));
    uint8_t *fixed = (uint8_t *)(uintptr_t)p->fixed;
    for (uint32_t i = 0; i < p->nodes; i++) fixed[i] = palp_node_is_fixed(b, i) ? 1 : 0;
    p->blob = b;
}

static void add_skin(film *f, const char *name, const palp_tets *t) {
    film_part *p = add_part(f, name, t->meta->skin, t->meta->skin_triangles, t->skin_triangle);
    uint8_t *fixed = (uint8_t *)(uintptr_t)p->fixed;
    float *rest_m = (float *)(uintptr_t)p->rest_m;
    for (uint32_t i = 0; i < p->nodes; i++) {
        fixed[i] = (t->node[t->skin_node[i]].flags & PALP_TET_PINNED) != 0 ? 1 : 0;
        memcpy(rest_m + 3 * (size_t)i, t->rest_m + 3 * (size_t)t->skin_node[i], 3 * sizeof(float));
    }
}

film *film_of_blob(const char *path) {
    film *f = allocate(1, sizeof *f);
    size_t bytes;
    const void *data = read_file(path, &bytes);
    const char *slash = strrchr(path, '/'), *name = slash != NULL ? slash + 1 : path;
    if (palp_tets_are_here(data, bytes)) {
        palp_tets *t = allocate(1, sizeof *t);
        const palp_status status = palp_tets_open(t, data, bytes);
        if (status != PALP_OK) die_of_blob(path, status, bytes);
        add_skin(f, name, t);
    } else if (palp_zones_are_here(data, bytes)) {
        palp_zones *z = allocate(1, sizeof *z);
        const palp_status status = palp_zones_open(z, data, bytes);
        if (status != PALP_OK) die_of_blob(path, status, bytes);
        for (uint32_t i = 0; i < z->meta->zones; i++) add_blob(f, z->zone[i].name, &z->blob[i]);
    } else {
        palp_blob *b = allocate(1, sizeof *b);
        *b = open_blob(path, data, bytes);
        add_blob(f, name, b);
    }
    return f;
}

/* ---- a session ---- */

static void add_frame(film *f, const shape *s, const tick_record *t, double t_s) {
    const double values = 4.0 * (double)f->nodes * (double)(f->frames + 1);
    if (values > (double)FILM_VALUES)
        die(EXIT_WORK,
            "%zu frames of %" PRIu32 " nodes are more than is kept at a time: a lower --fps, or "
            "a part of it by --from and --to",
            f->frames, f->nodes);
    f->frame = grow(f->frame, &f->room, f->frames + 1, sizeof *f->frame);
    film_frame *to = &f->frame[f->frames++];
    *to = (film_frame){.t_s = t_s,
                       .at_m = allocate(3 * (size_t)f->nodes, sizeof(float)),
                       .pressure_Pa = allocate(f->nodes, sizeof(float))};
    const palp_vec3 force = t->hand[0].report.force_N;
    const float felt[3] = {force.x, force.y, force.z};
    memcpy(to->force_N, felt, sizeof felt);
    memcpy(to->tool, t->tool, sizeof to->tool);
    size_t at = 0;
    for (uint32_t i = 0; i < s->parts; i++) {
        const shape_part *p = &s->part[i];
        memcpy(to->at_m + 3 * at, p->at_m, 3 * (size_t)p->nodes * sizeof(float));
        memcpy(to->pressure_Pa + at, p->pressure_Pa, p->nodes * sizeof(float));
        at += p->nodes;
    }
}

film *film_of_log(const film_spec *spec) {
    film *f = allocate(1, sizeof *f);
    replay *r = replay_open(spec->log, spec->body, spec->tool); /* stays: parts point into it */
    shape *s = shape_open(r->setup, r->scene);
    motion names = {.parts = 0};
    shape_to_motion(s, &names, 1);
    for (uint32_t i = 0; i < s->parts; i++) {
        const shape_part *p = &s->part[i];
        f->part[f->parts++] = (film_part){.name = names.part[i].name,
                                          .nodes = p->nodes,
                                          .triangles = p->triangles,
                                          .triangle = p->triangle,
                                          .rest_m = names.part[i].rest_m,
                                          .fixed = p->fixed,
                                          .blob = p->field.blob};
        f->nodes += p->nodes;
    }
    f->tools = r->setup->config.tools;
    for (uint32_t t = 0; t < f->tools; t++) f->tool[t] = &r->setup->tool[t].tool;
    const double rate_hz = r->setup->file->rate_hz, step_s = 1 / fmin(spec->fps, rate_hz);
    double next_s = spec->from_s;
    progress_begin("session again", 0);
    while (replay_next(r)) {
        const double t_s = (double)r->again->hand[0].report.tick / rate_hz;
        if (t_s > spec->to_s) break;
        if (t_s < next_s - 1e-9) continue;
        shape_update(s);
        add_frame(f, s, r->again, t_s);
        next_s += step_s;
        if (next_s <= t_s) next_s = t_s + step_s; /* ticks are missing */
    }
    progress_end();
    if (r->end == REPLAY_DIFFERS)
        die(EXIT_WORK, "%s: tick %" PRIu64 ": %s", spec->log, r->recorded->hand[0].report.tick,
            r->why);
    if (f->frames == 0)
        die(EXIT_WORK, "%s: no tick on record between %g and %g s", spec->log, spec->from_s,
            spec->to_s);
    return f;
}

/* ---- tools ---- */

/* A surface of revolution about z: rings[count] of radius and height, from below. */
static tool_surface revolve(const double (*ring)[2], uint32_t count, const palp_frame *at) {
    tool_surface s = {.vertices = count * AROUND, .triangles = 2 * (count - 1) * AROUND};
    s.x = allocate(3 * (size_t)s.vertices, sizeof *s.x);
    s.t = allocate(3 * (size_t)s.triangles, sizeof *s.t);
    for (uint32_t k = 0; k < count; k++) {
        for (uint32_t i = 0; i < AROUND; i++) {
            const double angle = TURN * i / AROUND;
            const palp_vec3 x = {(float)(ring[k][0] * cos(angle)), (float)(ring[k][0] * sin(angle)),
                                 (float)ring[k][1]};
            const palp_vec3 y = palp_carry(at, x);
            const float place[3] = {y.x, y.y, y.z};
            memcpy(s.x + 3 * (k * AROUND + i), place, sizeof place);
        }
    }
    uint32_t *t = s.t;
    for (uint32_t k = 0; k + 1 < count; k++) {
        for (uint32_t i = 0; i < AROUND; i++, t += 6) {
            const uint32_t a = k * AROUND + i, b = k * AROUND + (i + 1) % AROUND;
            const uint32_t two[6] = {a, b, b + AROUND, a, b + AROUND, a + AROUND};
            memcpy(t, two, sizeof two);
        }
    }
    return s;
}

static tool_surface rounded(double radius, double half, const palp_frame *at) {
    double ring[18][2];
    for (int i = 0; i < 18; i++) {
        const double angle = TURN / 4 * ((i < 9 ? i - 8 : i - 9) / 8.0);
        ring[i][0] = fmax(radius * cos(angle), 1e-4 * radius);
        ring[i][1] = radius * sin(angle) + (i < 9 ? -half : half);
    }
    return revolve((const double(*)[2])ring, 18, at);
}

static tool_surface box(double x, double y, const palp_frame *at) {
    static const uint32_t side[12][3] = {{0, 2, 1}, {0, 3, 2}, {4, 5, 6}, {4, 6, 7},
                                         {0, 1, 5}, {0, 5, 4}, {1, 2, 6}, {1, 6, 5},
                                         {2, 3, 7}, {2, 7, 6}, {3, 0, 4}, {3, 4, 7}};
    const double z = 0.25 * fmin(x, y);
    tool_surface s = {.vertices = 8, .triangles = 12};
    s.x = allocate(24, sizeof *s.x);
    s.t = allocate(36, sizeof *s.t);
    memcpy(s.t, side, sizeof side);
    for (uint32_t i = 0; i < 8; i++) {
        const palp_vec3 q = {(float)(i % 4 == 1 || i % 4 == 2 ? x : -x),
                             (float)(i % 4 >= 2 ? y : -y), (float)(i < 4 ? 0 : z)};
        const palp_vec3 p = palp_carry(at, q);
        const float place[3] = {p.x, p.y, p.z};
        memcpy(s.x + 3 * i, place, sizeof place);
    }
    return s;
}

tool_surface tool_surface_of(const palp_tool *t) {
    const tool_look look = tool_look_of(t);
    const double radius = (double)look.radius_m, half = (double)look.half_m;
    palp_frame at = PALP_FRAME_IDENTITY;
    memcpy(at.r, look.turn, sizeof at.r);
    if (t->shape == PALP_TOOL_PAD) return box(radius, half, &at);
    if (t->shape != PALP_TOOL_CYLINDER) return rounded(radius, half, &at);
    const double ring[4][2] = {
        {1e-4 * radius, -half}, {radius, -half}, {radius, half}, {1e-4 * radius, half}};
    return revolve(ring, 4, &at);
}

/* ---- normals ---- */

void film_normals(const film *f, const float *at_m, float *normal) {
    size_t first = 0;
    memset(normal, 0, 3 * (size_t)f->nodes * sizeof *normal);
    for (uint32_t i = 0; i < f->parts; first += f->part[i++].nodes) {
        const film_part *p = &f->part[i];
        for (uint32_t t = 0; t < p->triangles; t++) {
            const uint32_t *c = p->triangle + 3 * (size_t)t;
            const palp_vec3 a = palp_vec3_at(at_m + 3 * (first + c[0]));
            const palp_vec3 n = palp_cross(palp_sub(palp_vec3_at(at_m + 3 * (first + c[1])), a),
                                           palp_sub(palp_vec3_at(at_m + 3 * (first + c[2])), a));
            for (int k = 0; k < 3; k++) {
                float *to = normal + 3 * (first + c[k]);
                to[0] += n.x;
                to[1] += n.y;
                to[2] += n.z;
            }
        }
    }
    for (size_t i = 0; i < f->nodes; i++) {
        const float length = palp_norm(palp_vec3_at(normal + 3 * i));
        for (int k = 0; k < 3; k++)
            normal[3 * i + (size_t)k] = length > 0 ? normal[3 * i + (size_t)k] / length
                                        : k == 2   ? 1.0f
                                                   : 0.0f;
    }
}
