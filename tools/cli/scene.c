/* SPDX-License-Identifier: MIT */
#include "tools/cli/scene.h"
#include "port/host/args.h"
#include "tools/mesh/mesh.h"
#include "port/host/util.h"
#include "tools/zone/zonesolve.h"
#include <stdlib.h>
#include <string.h>

#define FAR_M 1e3 /* where a tool touches nothing */

static const option keys[] = {
    {"--seconds", 1},  {"--rate", 1},   {"--stiffness", 1}, {"--gravity", 3}, {"--pose", 3},
    {"--cylinder", 5}, {"--object", 4}, {"--probe", 1},     {"--touch", 4},   {NULL, 0}};

typedef struct {
    scene s;
    const palp_zones *zones;
} reading;

static void add_key(scene_track *track, const argument *a, int first_value) {
    scene_key k = {.t_s = arg_double(a, 0)};
    for (int i = first_value; i < a->count; i++) k.value[i - first_value] = arg_double(a, i);
    if (track->count > 0 && !(k.t_s > track->key[track->count - 1].t_s))
        die(EXIT_USAGE, "%s: time %s is not behind the one before", a->where, a->value[0]);
    track->key = grow(track->key, &track->room, track->count + 1, sizeof k);
    track->key[track->count++] = k;
}

static double positive(const argument *a, int index) {
    double v = arg_double(a, index);
    if (!(v > 0)) die(EXIT_USAGE, "%s: %s must be above 0", a->where, a->value[index]);
    return v;
}

static void take_key(void *context, const argument *a) {
    reading *r = context;
    scene *s = &r->s;
    const char *o = a->option;
    if (strcmp(o, "--seconds") == 0) {
        s->seconds = arg_between(a, 0, 3600);
    } else if (strcmp(o, "--rate") == 0) {
        s->rate_hz = arg_between(a, 49, 20001);
    } else if (strcmp(o, "--stiffness") == 0) {
        s->stiffness_N_per_m = positive(a, 0);
    } else if (strcmp(o, "--gravity") == 0) {
        for (int k = 0; k < 3; k++) s->gravity_m_s2[k] = arg_double(a, k);
        if (!(v_norm(s->gravity_m_s2) <= 1e4))
            die(EXIT_USAGE, "%s: more than 10000 m/s^2", a->where);
    } else if (strcmp(o, "--pose") == 0) {
        if (r->zones == NULL) die(EXIT_USAGE, "%s: a dynamic body has no joints", a->where);
        uint32_t j = find_joint(a->where, r->zones, a->value[1]);
        check_joint(a->where, r->zones, j, arg_double(a, 2));
        add_key(&s->joint[j], a, 2);
    } else if (strcmp(o, "--cylinder") == 0) {
        for (int k = 0; k < 5; k++) s->cylinder[k] = k < 2 ? positive(a, k) : arg_double(a, k);
        if (!(v_norm(s->cylinder + 2) > 0)) die(EXIT_USAGE, "%s: the axis is zero", a->where);
        v_normalize(s->cylinder + 2);
        s->has[SCENE_OBJECT] = true;
    } else if (strcmp(o, "--object") == 0) {
        add_key(&s->track[SCENE_OBJECT], a, 1);
    } else if (strcmp(o, "--probe") == 0) {
        s->probe_radius_m = positive(a, 0);
        s->has[SCENE_PROBE] = true;
    } else {
        add_key(&s->track[SCENE_PROBE], a, 1);
    }
}

scene scene_read(const char *path, const palp_zones *zones) {
    static const char *const shape[] = {"object", "touch"}, *const needed[] = {"cylinder", "probe"};
    reading r = {.s = {.seconds = 5, .rate_hz = 1000, .stiffness_N_per_m = 2000}, .zones = zones};
    args_parse_file(path, keys, take_key, &r);
    for (int k = 0; k < SCENE_TRACKS; k++) {
        bool moves = r.s.track[k].count > 0;
        if (moves && !r.s.has[k])
            die(EXIT_USAGE, "%s: '%s' lines need a '%s' line", path, shape[k], needed[k]);
        if (!moves && r.s.has[k])
            die(EXIT_USAGE, "%s: '%s' needs '%s' lines that say where it is", path, needed[k],
                shape[k]);
    }
    return r.s;
}

void scene_free(scene *s) {
    for (size_t j = 0; j < PALP_MAX_JOINTS; j++) free(s->joint[j].key);
    for (size_t k = 0; k < SCENE_TRACKS; k++) free(s->track[k].key);
}

void scene_at(const scene_track *track, double t_s, double value[3]) {
    memset(value, 0, 3 * sizeof *value);
    if (track->count == 0) return;
    size_t i = 0;
    while (i + 1 < track->count && track->key[i + 1].t_s <= t_s) i++;
    const scene_key *a = &track->key[i], *b = i + 1 < track->count ? a + 1 : a;
    double s = b->t_s > a->t_s ? (t_s - a->t_s) / (b->t_s - a->t_s) : 0;
    s = s < 0 ? 0 : s > 1 ? 1 : s;
    s = s * s * s * (10 - s * (15 - 6 * s));
    for (int k = 0; k < 3; k++) value[k] = a->value[k] + s * (b->value[k] - a->value[k]);
}

void scene_tools(const scene *s, palp_tool tool[SCENE_TRACKS], uint32_t which[SCENE_TRACKS],
                 uint32_t *count) {
    *count = 0;
    if (s->has[SCENE_OBJECT]) {
        const double *c = s->cylinder;
        which[*count] = SCENE_OBJECT;
        tool[(*count)++] = (palp_tool){.shape = PALP_TOOL_CYLINDER,
                                       .cylinder = {.axis = {(float)c[2], (float)c[3], (float)c[4]},
                                                    .radius_m = (float)c[0],
                                                    .half_m = (float)c[1],
                                                    .rim_m = 0.25f * (float)c[0]}};
    }
    if (s->has[SCENE_PROBE]) {
        which[*count] = SCENE_PROBE;
        tool[(*count)++] = palp_tool_sphere((float)s->probe_radius_m);
    }
    if (*count > 0) return;
    which[0] = SCENE_TRACKS;
    tool[(*count)++] = palp_tool_sphere(1e-3f);
}

void scene_tools_at(const scene *s, const uint32_t *which, uint32_t count, double t_s,
                    palp_frame *at) {
    for (uint32_t t = 0; t < count; t++) {
        double x[3] = {FAR_M, FAR_M, FAR_M};
        if (which[t] < SCENE_TRACKS) scene_at(&s->track[which[t]], t_s, x);
        at[t] = palp_frame_at((palp_vec3){(float)x[0], (float)x[1], (float)x[2]});
    }
}
