/* SPDX-License-Identifier: MIT */
#include "port/host/motion.h"
#include "port/host/base64.h"
#include "port/host/toolfile.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static size_t part_bytes(const motion_part *p) {
    return 3 * (size_t)p->nodes * (p->far_off ? 2u : 1u);
}

static int32_t most_steps(const motion_part *p) { return p->far_off ? 32767 : 127; }

void motion_begin(motion *m, size_t bytes) {
    m->frame_bytes = 0;
    for (uint32_t i = 0; i < m->parts; i++) m->frame_bytes += part_bytes(&m->part[i]);
    m->most = m->frame_bytes > 0 ? bytes / m->frame_bytes : 4096;
    if (m->most < 8) m->most = 8;
    m->interval_s = MOTION_FRAME_S;
}

bool motion_wants(const motion *m, double t_s) { return t_s >= m->next_s - 1e-9; }

static void free_frame(motion_frame *f) {
    free(f->level);
    free(f->scale_m);
    free(f->step);
}

/* Every second frame goes. */
static void thin(motion *m) {
    size_t kept = 0;
    for (size_t i = 0; i < m->frames; i++) {
        if (i % 2 == 0)
            m->frame[kept++] = m->frame[i];
        else
            free_frame(&m->frame[i]);
    }
    m->frames = kept;
    m->interval_s *= 2;
}

static float largest(const motion_part *p, const float *at_m) {
    float most = 0;
    for (size_t i = 0; i < 3 * (size_t)p->nodes; i++)
        most = fmaxf(most, fabsf(at_m[i] - p->rest_m[i]));
    return most;
}

static void put_steps(const motion_part *p, const float *at_m, float scale_m, uint8_t *to) {
    for (size_t i = 0; i < 3 * (size_t)p->nodes; i++) {
        const float u = scale_m > 0 ? (at_m[i] - p->rest_m[i]) / scale_m : 0;
        const int32_t v = (int32_t)lrintf(u);
        if (p->far_off) {
            const int16_t wide = (int16_t)v;
            memcpy(to + 2 * i, &wide, sizeof wide);
        } else {
            to[i] = (uint8_t)(int8_t)v;
        }
    }
}

static size_t all_nodes(const motion *m) {
    size_t n = 0;
    for (uint32_t i = 0; i < m->parts; i++) n += m->part[i].nodes;
    return n;
}

static motion_frame frame_of(const motion *m, double t_s, const float *const *at_m,
                             const palp_frame *tool_at) {
    motion_frame f = {.t_s = t_s,
                      .scale_m = allocate(m->parts + 1u, sizeof *f.scale_m),
                      .step = allocate(m->frame_bytes + 1u, 1)};
    for (uint32_t t = 0; t < m->tools; t++) f.tool[t] = tool_at[t];
    if (m->level != NULL) {
        f.level = allocate(all_nodes(m), 1);
        memcpy(f.level, m->level, all_nodes(m));
    }
    uint8_t *to = f.step;
    for (uint32_t i = 0; i < m->parts; i++) {
        const motion_part *p = &m->part[i];
        f.scale_m[i] = largest(p, at_m[i]) / (float)most_steps(p);
        put_steps(p, at_m[i], f.scale_m[i], to);
        to += part_bytes(p);
    }
    return f;
}

void motion_insert(motion *m, double t_s, const float *const *at_m, const palp_frame *tool_at) {
    m->frame = grow(m->frame, &m->room, m->frames + 1, sizeof *m->frame);
    size_t at = m->frames++;
    for (; at > 0 && m->frame[at - 1].t_s > t_s; at--) m->frame[at] = m->frame[at - 1];
    m->frame[at] = frame_of(m, t_s, at_m, tool_at);
}

void motion_add(motion *m, double t_s, const float *const *at_m, const palp_frame *tool_at) {
    if (m->frames >= m->most) thin(m);
    motion_insert(m, t_s, at_m, tool_at);
    m->next_s = t_s + m->interval_s;
}

void motion_displacement(const motion *m, size_t frame, uint32_t part, uint32_t node,
                         float u_m[3]) {
    const motion_frame *f = &m->frame[frame];
    const motion_part *p = &m->part[part];
    const uint8_t *from = f->step;
    for (uint32_t i = 0; i < part; i++) from += part_bytes(&m->part[i]);
    for (uint32_t k = 0; k < 3; k++) {
        int16_t step;
        if (p->far_off)
            memcpy(&step, from + 2 * (3 * (size_t)node + k), sizeof step);
        else
            step = (int8_t)from[3 * (size_t)node + k];
        u_m[k] = f->scale_m[part] * (float)step;
    }
}

/* ---- JSON ---- */

static void write_part(FILE *f, const motion *m, uint32_t number) {
    const motion_part *p = &m->part[number];
    size_t before = 0, nodes = 0;
    for (uint32_t i = 0; i < number; i++) {
        before += part_bytes(&m->part[i]);
        nodes += m->part[i].nodes;
    }
    fprintf(f, "{\"bits\": %d, \"triangles\": \"", p->far_off ? 16 : 8);
    base64_write_u32(f, p->triangle, 3 * (size_t)p->triangles);
    fputs("\", \"rest\": \"", f);
    base64_write_f32(f, p->rest_m, 3 * (size_t)p->nodes);
    fputs("\"", f);
    if (p->fixed != NULL) {
        fputs(", \"fixed\": \"", f);
        base64_write(f, p->fixed, p->nodes);
        fputs("\"", f);
    }
    float *scale = allocate(m->frames + 1, sizeof *scale);
    uint8_t *all = allocate(m->frames * part_bytes(p) + 1, 1);
    for (size_t i = 0; i < m->frames; i++) {
        scale[i] = m->frame[i].scale_m[number];
        memcpy(all + i * part_bytes(p), m->frame[i].step + before, part_bytes(p));
    }
    fputs(", \"scale\": \"", f);
    base64_write_f32(f, scale, m->frames);
    fputs("\", \"step\": \"", f);
    if (p->far_off) {
        int16_t *wide = allocate(m->frames * 3 * p->nodes + 1, sizeof *wide);
        memcpy(wide, all, m->frames * part_bytes(p));
        base64_write_i16(f, wide, m->frames * 3 * p->nodes);
        free(wide);
    } else {
        base64_write(f, all, m->frames * part_bytes(p));
    }
    fputs("\"", f);
    if (m->level != NULL) {
        uint8_t *level = allocate(m->frames * p->nodes + 1, 1);
        for (size_t i = 0; i < m->frames; i++)
            memcpy(level + i * p->nodes, m->frame[i].level + nodes, p->nodes);
        fputs(", \"level\": \"", f);
        base64_write(f, level, m->frames * p->nodes);
        fputs("\"", f);
        free(level);
    }
    fputs("}", f);
    free(scale);
    free(all);
}

static void write_tool(FILE *f, const motion *m, uint32_t number) {
    const tool_look look = tool_look_of(m->tool[number]);
    palp_frame turn = PALP_FRAME_IDENTITY;
    memcpy(turn.r, look.turn, sizeof turn.r);
    float *pose = allocate(12 * m->frames + 1, sizeof *pose);
    for (size_t i = 0; i < m->frames; i++) {
        const palp_frame at = palp_frame_compose(&m->frame[i].tool[number], &turn);
        const float t_m[3] = {at.t.x, at.t.y, at.t.z};
        memcpy(pose + 12 * i, at.r, sizeof at.r);
        memcpy(pose + 12 * i + 9, t_m, sizeof t_m);
    }
    fprintf(f, "{\"shape\": %d, \"radius\": %.6g, \"half\": %.6g, \"pose\": \"",
            (int)m->tool[number]->shape, (double)look.radius_m, (double)look.half_m);
    base64_write_f32(f, pose, 12 * m->frames);
    fputs("\"}", f);
    free(pose);
}

void motion_write(FILE *f, const motion *m) {
    float *time = allocate(m->frames + 1, sizeof *time);
    for (size_t i = 0; i < m->frames; i++) time[i] = (float)m->frame[i].t_s;
    fputs("{\"time\": \"", f);
    base64_write_f32(f, time, m->frames);
    fputs("\", \"parts\": [", f);
    for (uint32_t i = 0; i < m->parts; i++) {
        if (i > 0) fputs(",\n", f);
        write_part(f, m, i);
    }
    fputs("], \"tools\": [", f);
    for (uint32_t t = 0; t < m->tools; t++) {
        if (t > 0) fputs(", ", f);
        write_tool(f, m, t);
    }
    fputs("]}", f);
    free(time);
}

void motion_free(motion *m) {
    for (size_t i = 0; i < m->frames; i++) free_frame(&m->frame[i]);
    free(m->frame);
    m->frame = NULL;
    m->frames = m->room = 0;
}
