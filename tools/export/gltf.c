/* SPDX-License-Identifier: MIT */
#include "tools/export/gltf.h"
#include "core/base/version.h"
#include "core/device/canframe.h"
#include "port/host/base64.h"
#include "port/host/page.h"
#include "port/host/util.h"
#include "tools/export/shapes.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FLOAT 5126
#define UNSIGNED 5125
#define ARRAY 34962
#define ELEMENTS 34963
#define MOST_TEXT 128u

/* The buffer so far, and the JSON that describes it. */
typedef struct {
    uint8_t *bytes;
    size_t used, room;
    uint32_t views, accessors, meshes, nodes;
    FILE *views_json, *accessors_json, *meshes_json, *nodes_json, *samplers_json, *channels_json;
    char *text[6];
    size_t length[6];
    uint32_t samplers, channels;
} writer;

static uint8_t *take(writer *w, size_t bytes) {
    w->bytes = grow(w->bytes, &w->room, w->used + bytes, 1);
    uint8_t *at = w->bytes + w->used;
    w->used += bytes;
    return at;
}

static void view(writer *w, size_t from, int target) {
    fprintf(w->views_json, "%s{\"buffer\":0,\"byteOffset\":%zu,\"byteLength\":%zu",
            w->views++ > 0 ? ",\n" : "", from, w->used - from);
    if (target != 0) fprintf(w->views_json, ",\"target\":%d", target);
    fputc('}', w->views_json);
}

/* The index of an accessor of `count` elements of `width` floats; with its range where that is asked for. */
static uint32_t floats(writer *w, const float *x, size_t count, uint32_t width, int target,
                       bool range) {
    static const char *const type[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};
    const size_t from = w->used;
    uint8_t *to = take(w, 4 * count * width);
    for (size_t i = 0; i < count * width; i++) palp_put_f32(to + 4 * i, x[i]);
    view(w, from, target);
    fprintf(w->accessors_json,
            "%s{\"bufferView\":%" PRIu32 ",\"componentType\":%d,\"count\":%zu,\"type\":\"%s\"",
            w->accessors > 0 ? ",\n" : "", w->views - 1, FLOAT, count, type[width]);
    for (int high = 0; high < 2 && range; high++) {
        fprintf(w->accessors_json, ",\"%s\":[", high ? "max" : "min");
        for (uint32_t k = 0; k < width; k++) {
            float v = x[k];
            for (size_t i = 1; i < count; i++)
                v = high ? fmaxf(v, x[i * width + k]) : fminf(v, x[i * width + k]);
            fprintf(w->accessors_json, "%s%.9g", k > 0 ? "," : "", (double)v);
        }
        fputc(']', w->accessors_json);
    }
    fputc('}', w->accessors_json);
    return w->accessors++;
}

static uint32_t indices(writer *w, const uint32_t *x, size_t count) {
    const size_t from = w->used;
    uint8_t *to = take(w, 4 * count);
    for (size_t i = 0; i < count; i++) palp_put_u32(to + 4 * i, x[i]);
    view(w, from, ELEMENTS);
    fprintf(w->accessors_json,
            "%s{\"bufferView\":%" PRIu32 ",\"componentType\":%d,\"count\":%zu,\"type\":\"SCALAR\"}",
            w->accessors > 0 ? ",\n" : "", w->views - 1, UNSIGNED, count);
    return w->accessors++;
}

static void channel(writer *w, uint32_t node, const char *path, uint32_t time, uint32_t values) {
    fprintf(w->samplers_json,
            "%s{\"input\":%" PRIu32 ",\"interpolation\":\"LINEAR\",\"output\":%" PRIu32 "}",
            w->samplers++ > 0 ? ",\n" : "", time, values);
    fprintf(w->channels_json,
            "%s{\"sampler\":%" PRIu32 ",\"target\":{\"node\":%" PRIu32 ",\"path\":\"%s\"}}",
            w->channels++ > 0 ? ",\n" : "", w->samplers - 1, node, path);
}

static uint32_t add_node(writer *w, const char *name) {
    fprintf(w->nodes_json, "%s{\"name\":", w->nodes > 0 ? ",\n" : "");
    page_put_json(w->nodes_json, name);
    fprintf(w->nodes_json, ",\"mesh\":%" PRIu32, w->meshes - 1);
    return ++w->nodes; /* node 0 is the root, written at the end */
}

/* ---- surfaces ---- */

static void put_part(writer *w, const film *f, uint32_t number, size_t first, uint32_t time,
                     const float *normal, gltf_report *report) {
    const film_part *p = &f->part[number];
    const size_t values = 3 * (size_t)p->nodes;
    shape_basis b = {.count = 0};
    if (f->frames > 0) {
        const float **x = allocate(f->frames, sizeof *x);
        for (size_t i = 0; i < f->frames; i++) x[i] = f->frame[i].at_m + 3 * first;
        b = shapes_of(x, f->frames, p->rest_m, values);
        free(x);
        report->shapes += b.count;
        report->missed_m = fmax(report->missed_m, b.missed);
        report->largest_m = fmax(report->largest_m, b.largest);
    }
    float *colour = allocate(values + 1, sizeof *colour);
    for (size_t i = 0; i < values; i++) {
        static const float skin[3] = {0.86f, 0.62f, 0.45f};
        colour[i] = (p->fixed[i / 3] != 0 ? 0.5f : 1.0f) * skin[i % 3];
    }
    const uint32_t place = floats(w, p->rest_m, p->nodes, 3, ARRAY, true);
    const uint32_t turned = floats(w, normal + 3 * first, p->nodes, 3, ARRAY, false);
    const uint32_t coloured = floats(w, colour, p->nodes, 3, ARRAY, false);
    const uint32_t corners = indices(w, p->triangle, 3 * (size_t)p->triangles);
    fprintf(w->meshes_json,
            "%s{\"primitives\":[{\"attributes\":{\"POSITION\":%" PRIu32 ",\"NORMAL\":%" PRIu32
            ",\"COLOR_0\":%" PRIu32 "},\"indices\":%" PRIu32 ",\"material\":0",
            w->meshes++ > 0 ? ",\n" : "", place, turned, coloured, corners);
    for (uint32_t k = 0; k < b.count; k++)
        fprintf(w->meshes_json, "%s{\"POSITION\":%" PRIu32 "}", k == 0 ? ",\"targets\":[" : ",",
                floats(w, b.shape + k * values, p->nodes, 3, ARRAY, true));
    fputs(b.count > 0 ? "]}],\"weights\":[" : "}]", w->meshes_json);
    for (uint32_t k = 0; k < b.count; k++) fprintf(w->meshes_json, "%s0", k > 0 ? "," : "");
    fputs(b.count > 0 ? "]}" : "}", w->meshes_json);
    const uint32_t node = add_node(w, p->name);
    fputc('}', w->nodes_json);
    if (b.count > 0)
        channel(w, node, "weights", time, floats(w, b.weight, f->frames * b.count, 1, 0, false));
    if (b.count > 0) shapes_free(&b);
    free(colour);
}

/* ---- tools ---- */

/* A rotation as a unit quaternion x, y, z, w on the side of the one before. */
static void quaternion(const float r[9], const float *before, float q[4]) {
    const double trace = (double)r[0] + (double)r[4] + (double)r[8];
    double v[4];
    if (trace > 0) {
        const double s = 2 * sqrt(trace + 1);
        v[3] = s / 4;
        v[0] = ((double)r[7] - (double)r[5]) / s;
        v[1] = ((double)r[2] - (double)r[6]) / s;
        v[2] = ((double)r[3] - (double)r[1]) / s;
    } else {
        const int i = r[0] > r[4] && r[0] > r[8] ? 0
                      : r[4] > r[8]              ? 1
                                                 : 2,
                  j = (i + 1) % 3, k = (i + 2) % 3;
        const double s =
            2 * sqrt(fmax(1 + (double)r[4 * i] - (double)r[4 * j] - (double)r[4 * k], 1e-12));
        v[i] = s / 4;
        v[j] = ((double)r[3 * j + i] + (double)r[3 * i + j]) / s;
        v[k] = ((double)r[3 * k + i] + (double)r[3 * i + k]) / s;
        v[3] = ((double)r[3 * k + j] - (double)r[3 * j + k]) / s;
    }
    double norm = 0, same = 0;
    for (int e = 0; e < 4; e++) norm += v[e] * v[e];
    for (int e = 0; e < 4 && before != NULL; e++) same += v[e] * (double)before[e];
    for (int e = 0; e < 4; e++) q[e] = (float)((same < 0 ? -v[e] : v[e]) / sqrt(norm));
}

static void put_tool(writer *w, const film *f, uint32_t number, uint32_t time) {
    tool_surface s = tool_surface_of(f->tool[number]);
    film one = {.parts = 1, .nodes = s.vertices};
    one.part[0] = (film_part){.nodes = s.vertices, .triangles = s.triangles, .triangle = s.t};
    float *normal = allocate(3 * (size_t)s.vertices, sizeof *normal);
    film_normals(&one, s.x, normal);
    const uint32_t place = floats(w, s.x, s.vertices, 3, ARRAY, true);
    const uint32_t turned = floats(w, normal, s.vertices, 3, ARRAY, false);
    const uint32_t corners = indices(w, s.t, 3 * (size_t)s.triangles);
    fprintf(w->meshes_json,
            "%s{\"primitives\":[{\"attributes\":{\"POSITION\":%" PRIu32 ",\"NORMAL\":%" PRIu32
            "},\"indices\":%" PRIu32 ",\"material\":1}]}",
            w->meshes++ > 0 ? ",\n" : "", place, turned, corners);
    char name[MOST_TEXT];
    snprintf(name, sizeof name, "tool %" PRIu32, number);
    const uint32_t node = add_node(w, name);
    float *t = allocate(3 * f->frames + 1, sizeof *t), *q = allocate(4 * f->frames + 1, sizeof *q);
    for (size_t i = 0; i < f->frames; i++) {
        const palp_frame *at = &f->frame[i].tool[number];
        const float place_m[3] = {at->t.x, at->t.y, at->t.z};
        memcpy(t + 3 * i, place_m, sizeof place_m);
        quaternion(at->r, i > 0 ? q + 4 * (i - 1) : NULL, q + 4 * i);
    }
    fputc('}', w->nodes_json);
    channel(w, node, "translation", time, floats(w, t, f->frames, 3, 0, false));
    channel(w, node, "rotation", time, floats(w, q, f->frames, 4, 0, false));
    free(t);
    free(q);
    free(s.x);
    free(s.t);
    free(normal);
}

/* ---- the file ---- */

static void put_json(FILE *out, writer *w, const film *f, const char *uri) {
    FILE **const json[6] = {&w->views_json, &w->accessors_json, &w->meshes_json,
                            &w->nodes_json, &w->samplers_json,  &w->channels_json};
    for (int i = 0; i < 6; i++) fclose(*json[i]);
    fprintf(out,
            "{\"asset\":{\"version\":\"2.0\",\"generator\":\"palp "
            "%s\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\n",
            PALP_VERSION);
    fputs("\"nodes\":[{\"name\":\"scene, z "
          "up\",\"rotation\":[-0.70710678,0,0,0.70710678],\"children\":[",
          out);
    for (uint32_t i = 1; i <= w->nodes; i++) fprintf(out, "%s%" PRIu32, i > 1 ? "," : "", i);
    fprintf(out, "]},\n%s],\n\"meshes\":[%s],\n", w->text[3], w->text[2]);
    fputs("\"materials\":[{\"name\":\"body\",\"pbrMetallicRoughness\":{\"metallicFactor\":0,"
          "\"roughnessFactor\":0.7},\"doubleSided\":true},"
          "{\"name\":\"tool\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.45,0.55,0.68,1],"
          "\"metallicFactor\":0.3,\"roughnessFactor\":0.4}}],\n",
          out);
    if (f->frames > 0)
        fprintf(out,
                "\"animations\":[{\"name\":\"session\",\"samplers\":[%s],\n\"channels\":[%s]}],\n",
                w->text[4], w->text[5]);
    fprintf(out, "\"accessors\":[%s],\n\"bufferViews\":[%s],\n\"buffers\":[{\"byteLength\":%zu",
            w->text[1], w->text[0], w->used);
    if (uri != NULL) {
        fprintf(out, ",\"uri\":\"%s", uri);
        base64_write(out, w->bytes, w->used);
        fputc('"', out);
    }
    fputs("}]}", out);
    for (int i = 0; i < 6; i++) free(w->text[i]);
}

static void put_u32(FILE *out, uint32_t v) {
    uint8_t bytes[4];
    palp_put_u32(bytes, v);
    fwrite(bytes, 1, 4, out);
}

/* The binary form: JSON padded with spaces, then the bytes. */
static void put_glb(FILE *out, writer *w, const film *f) {
    char *text = NULL;
    size_t length = 0;
    FILE *json = open_memory(&text, &length);
    put_json(json, w, f, NULL);
    fclose(json);
    const uint32_t pad = (uint32_t)(3u - (length + 3u) % 4u);
    put_u32(out, 0x46546c67u);
    put_u32(out, 2);
    put_u32(out, (uint32_t)(12 + 8 + length + pad + 8 + w->used));
    put_u32(out, (uint32_t)length + pad);
    put_u32(out, 0x4e4f534au);
    fwrite(text, 1, length, out);
    for (uint32_t i = 0; i < pad; i++) fputc(' ', out);
    put_u32(out, (uint32_t)w->used);
    put_u32(out, 0x004e4942u);
    fwrite(w->bytes, 1, w->used, out);
    free(text);
}

gltf_report gltf_write(FILE *out, const film *f, bool binary) {
    writer w = {.used = 0};
    gltf_report report = {.shapes = 0};
    FILE **const json[6] = {&w.views_json, &w.accessors_json, &w.meshes_json,
                            &w.nodes_json, &w.samplers_json,  &w.channels_json};
    for (int i = 0; i < 6; i++) *json[i] = open_memory(&w.text[i], &w.length[i]);
    uint32_t time = 0;
    if (f->frames > 0) {
        float *t = allocate(f->frames, sizeof *t);
        for (size_t i = 0; i < f->frames; i++) t[i] = (float)(f->frame[i].t_s - f->frame[0].t_s);
        time = floats(&w, t, f->frames, 1, 0, true);
        free(t);
    }
    float *rest_m = allocate(3 * (size_t)f->nodes, sizeof *rest_m),
          *normal = allocate(3 * (size_t)f->nodes, sizeof *normal);
    size_t first = 0;
    for (uint32_t i = 0; i < f->parts; first += f->part[i++].nodes)
        memcpy(rest_m + 3 * first, f->part[i].rest_m,
               3 * (size_t)f->part[i].nodes * sizeof *rest_m);
    film_normals(f, rest_m, normal);
    first = 0;
    for (uint32_t i = 0; i < f->parts; first += f->part[i++].nodes)
        put_part(&w, f, i, first, time, normal, &report);
    for (uint32_t t = 0; t < f->tools && f->frames > 0; t++) put_tool(&w, f, t, time);
    if (binary)
        put_glb(out, &w, f);
    else
        put_json(out, &w, f, "data:application/octet-stream;base64,");
    free(rest_m);
    free(normal);
    free(w.bytes);
    return report;
}
