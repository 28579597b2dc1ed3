/* SPDX-License-Identifier: MIT */
#include "port/host/view.h"
#include "port/host/vec3.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    double right[3], up[3], toward[3]; /* camera axes; `toward` points from the body to the eye */
    double center[3], scale;
    int width, height;
} camera;

typedef struct {
    double depth;
    double xy[3][2];
    int rgb[3];
} face;

/* Up is away from the fixed nodes; the eye stands at the tool's side, a little above. */
static camera look(const palp_blob *b, const float tool_m[3], double radius, int width,
                   int height) {
    camera c = {.width = width, .height = height};
    double fixed[3] = {0}, all[3] = {0}, n_fixed = 0;
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        bool held = palp_node_is_fixed(b, i);
        n_fixed += held ? 1 : 0;
        for (int k = 0; k < 3; k++) {
            all[k] += (double)b->rest_m[3 * i + (uint32_t)k] / b->meta->nodes;
            fixed[k] += held ? (double)b->rest_m[3 * i + (uint32_t)k] : 0;
        }
    }
    for (int k = 0; k < 3; k++) {
        c.center[k] = 0.5 * ((double)b->meta->box_min_m[k] + (double)b->meta->box_max_m[k]);
        c.up[k] = all[k] - fixed[k] / n_fixed;
        c.toward[k] = (double)tool_m[k] - c.center[k];
    }
    v_normalize(c.up);
    double along = v_dot(c.toward, c.up);
    for (int k = 0; k < 3; k++) c.toward[k] -= along * c.up[k];
    if (v_norm(c.toward) < 1e-3 * v_norm(c.center)) c.toward[fabs(c.up[0]) < 0.7 ? 0 : 1] += 1;
    v_normalize(c.toward);
    v_cross(c.up, c.toward, c.right);
    v_normalize(c.right);
    /* Half a turn to the side and a little down, so that an indentation is seen in profile. */
    for (int k = 0; k < 3; k++)
        c.toward[k] = 0.75 * c.toward[k] + 0.6 * c.right[k] + 0.35 * c.up[k];
    v_normalize(c.toward);
    v_cross(c.up, c.toward, c.right);
    v_normalize(c.right);
    v_cross(c.toward, c.right, c.up);
    double extent = 0;
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        double d[3];
        for (int k = 0; k < 3; k++) d[k] = (double)b->rest_m[3 * i + (uint32_t)k] - c.center[k];
        double wide = fabs(v_dot(d, c.right)) * height / width, high = fabs(v_dot(d, c.up));
        if (wide > extent) extent = wide;
        if (high > extent) extent = high;
    }
    for (int side = -1; side <= 1; side += 2) {
        double d[3];
        for (int k = 0; k < 3; k++) d[k] = (double)tool_m[k] - c.center[k];
        double reach = v_dot(d, c.up) + side * radius;
        extent = fmax(extent, fabs(reach));
    }
    c.scale = 0.45 * height / extent;
    return c;
}

static double project(const camera *c, const double x[3], double xy[2]) {
    double d[3];
    v_sub(x, c->center, d);
    xy[0] = c->width / 2.0 + c->scale * v_dot(d, c->right);
    xy[1] = c->height / 2.0 - c->scale * v_dot(d, c->up);
    return v_dot(d, c->toward);
}

static int compare_depth(const void *a, const void *b) {
    double p = ((const face *)a)->depth, q = ((const face *)b)->depth;
    return p < q ? -1 : p > q;
}

/* Warm skin that reddens where it is displaced. */
static void colour(double light, double heat, int rgb[3]) {
    const double calm[3] = {236, 200, 168}, hot[3] = {214, 72, 60};
    for (int k = 0; k < 3; k++) {
        double v = (calm[k] + heat * (hot[k] - calm[k])) * light;
        rgb[k] = v > 255 ? 255 : (int)v;
    }
}

static uint32_t project_faces(const palp_blob *b, const camera *c, const double (*x)[3],
                              const double *heat, face *faces) {
    double lamp[3];
    uint32_t n = 0;
    for (int k = 0; k < 3; k++)
        lamp[k] = 0.45 * c->toward[k] + 0.75 * c->up[k] - 0.45 * c->right[k];
    v_normalize(lamp);
    for (uint32_t i = 0; i < b->meta->triangles; i++) {
        const uint32_t *t = b->triangle + 3 * i;
        double normal[3];
        triangle_normal(x[t[0]], x[t[1]], x[t[2]], normal);
        v_normalize(normal);
        if (v_dot(normal, c->toward) < 0) continue;
        face *f = &faces[n++];
        f->depth = 0;
        double warm = 0;
        for (int k = 0; k < 3; k++) {
            f->depth += project(c, x[t[k]], f->xy[k]) / 3;
            warm += heat[t[k]] / 3;
        }
        colour(0.42 + 0.62 * fmax(v_dot(normal, lamp), 0), warm, f->rgb);
    }
    qsort(faces, n, sizeof *faces, compare_depth);
    return n;
}

static void draw_face(FILE *f, const face *t) {
    char hex[8];
    snprintf(hex, sizeof hex, "#%02x%02x%02x", t->rgb[0], t->rgb[1], t->rgb[2]);
    fprintf(f, "<path d='M%.1f %.1fL%.1f %.1fL%.1f %.1fz' fill='%s' stroke='%s'/>\n", t->xy[0][0],
            t->xy[0][1], t->xy[1][0], t->xy[1][1], t->xy[2][0], t->xy[2][1], hex, hex);
}

static void draw_tool(FILE *f, const camera *c, const double tool[3], double radius) {
    double xy[2];
    (void)project(c, tool, xy);
    fprintf(f, "<circle cx='%.1f' cy='%.1f' r='%.1f' fill='url(#ball)'/>\n", xy[0], xy[1],
            c->scale * radius);
}

void view_draw(FILE *f, const palp_blob *blob, const float *displacement_m, const float tool_m[3],
               float tool_radius_m, int width, int height) {
    camera c = look(blob, tool_m, (double)tool_radius_m, width, height);
    uint32_t n = blob->meta->nodes;
    double(*x)[3] = allocate(n, sizeof *x);
    double *heat = allocate(n, sizeof *heat);
    face *faces = allocate(blob->meta->triangles, sizeof *faces);
    double tool[3] = {(double)tool_m[0], (double)tool_m[1], (double)tool_m[2]};
    double largest = 1e-12;
    for (uint32_t i = 0; i < n; i++) {
        double u2 = 0;
        for (uint32_t k = 0; k < 3; k++) {
            double u = (double)displacement_m[3 * i + k];
            x[i][k] = (double)blob->rest_m[3 * i + k] + u;
            u2 += u * u;
        }
        heat[i] = sqrt(u2);
        if (heat[i] > largest) largest = heat[i];
    }
    for (uint32_t i = 0; i < n; i++) heat[i] /= largest;
    uint32_t count = project_faces(blob, &c, (const double(*)[3])x, heat, faces);
    fprintf(f,
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 %d %d' width='%d' height='%d'>\n"
            "<defs><radialGradient id='ball' cx='35%%' cy='30%%' r='75%%'><stop offset='0' "
            "stop-color='#e8f1fb'/>"
            "<stop offset='0.5' stop-color='#5b8fc7'/><stop offset='1' "
            "stop-color='#1d3e63'/></radialGradient></defs>\n"
            "<rect width='%d' height='%d' fill='#f7f5f2'/>\n<g stroke-width='0.6' "
            "stroke-linejoin='round'>\n",
            width, height, width, height, width, height);
    double tool_xy[2];
    double tool_depth = project(&c, tool, tool_xy);
    bool drawn = false;
    for (uint32_t i = 0; i < count; i++) {
        const face *t = &faces[i];
        if (!drawn && t->depth > tool_depth) {
            draw_tool(f, &c, tool, (double)tool_radius_m);
            drawn = true;
        }
        draw_face(f, t);
    }
    if (!drawn) draw_tool(f, &c, tool, (double)tool_radius_m);
    fputs("</g>\n</svg>\n", f);
    free(faces);
    free(heat);
    free(x);
}
