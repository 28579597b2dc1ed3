/* SPDX-License-Identifier: MIT */
/* Device files: keys and values, one per line. */
#include "device.h"
#include "tools/args.h"
#include "tools/util.h"
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Made by the Makefile from sim/devices: name and text of every description, ended by NULL. */
extern const char *const builtin_devices[][2];

static const option keys[] = {
    {"--kinematics", 1}, {"--upper", 1},         {"--fore", 1},
    {"--gear", 3},       {"--counts", 1},        {"--protocol", 1},
    {"--node", 3},       {"--bitrate", 1},       {"--joint-min", 3},
    {"--joint-max", 3},  {"--torque-max", 1},    {"--force-max", 1},
    {"--slew-max", 1},   {"--speed-max", 1},     {"--workspace", 1},
    {"--tool", 1},       {"--stiffness-max", 1}, {"--damping-max", 1},
    {"--mass", 1},       {"--damping", 1},       {"--friction", 1},
    {NULL, 0},
};
#define KEYS (sizeof keys / sizeof keys[0] - 1)

typedef struct {
    device_file d;
    bool seen[KEYS];
} reading;

static void set_word(const argument *a, const char *only) {
    if (strcmp(a->value[0], only) != 0)
        die(EXIT_USAGE, "%s: '%s' is not supported, only '%s'", a->where, a->value[0], only);
}

static void set_key(void *context, const argument *a) {
    reading *r = context;
    palp_device *p = &r->d.device;
    const struct {
        const char *key;
        float *value;
    } positive[] = {{"--upper", &p->arm.upper_m},
                    {"--fore", &p->arm.fore_m},
                    {"--counts", &p->counts_per_rev},
                    {"--bitrate", &p->bit_rate_bps},
                    {"--torque-max", &p->motor_torque_max_Nm},
                    {"--force-max", &p->force_max_N},
                    {"--slew-max", &p->slew_max_N_per_s},
                    {"--speed-max", &p->speed_max_m_s},
                    {"--workspace", &p->workspace_radius_m},
                    {"--tool", &p->tool_radius_m},
                    {"--stiffness-max", &p->stiffness_max_N_per_m},
                    {"--damping-max", &p->damping_max_Ns_per_m}};
    for (size_t i = 0; i < KEYS; i++)
        r->seen[i] = r->seen[i] || strcmp(keys[i].name, a->option) == 0;
    for (size_t i = 0; i < sizeof positive / sizeof positive[0]; i++) {
        if (strcmp(positive[i].key, a->option) == 0)
            *positive[i].value = (float)arg_between(a, 0, 1e9);
    }
    if (strcmp(a->option, "--kinematics") == 0) set_word(a, "arm3");
    if (strcmp(a->option, "--protocol") == 0) set_word(a, "odrive");
    if (strcmp(a->option, "--mass") == 0) r->d.mass_kg = arg_between(a, 0, 100);
    if (strcmp(a->option, "--damping") == 0) r->d.damping_Ns_per_m = arg_between(a, 0, 1e4);
    if (strcmp(a->option, "--friction") == 0) r->d.friction_N = arg_between(a, 0, 1e3);
    for (int i = 0; i < 3; i++) {
        const float degree = 0.017453292519943f;
        if (strcmp(a->option, "--node") == 0) p->node_id[i] = (uint8_t)arg_u32(a, i, 0, 63);
        if (strcmp(a->option, "--joint-min") == 0)
            p->joint_min_rad[i] = degree * (float)arg_double(a, i);
        if (strcmp(a->option, "--joint-max") == 0)
            p->joint_max_rad[i] = degree * (float)arg_double(a, i);
        if (strcmp(a->option, "--gear") != 0) continue;
        p->gear[i] = (float)arg_double(a, i);
        if (!(p->gear[i] > 0.0f || p->gear[i] < 0.0f))
            die(EXIT_USAGE, "%s: a gear ratio cannot be 0", a->where);
    }
}

static const char *builtin_text(const char *name) {
    for (size_t i = 0; builtin_devices[i][0] != NULL; i++) {
        if (strcmp(builtin_devices[i][0], name) == 0) return builtin_devices[i][1];
    }
    return NULL;
}

device_file device_load(const char *name_or_path) {
    reading r = {0};
    const char *text = builtin_text(name_or_path);
    if (text != NULL) {
        args_parse_text(name_or_path, text, keys, set_key, &r);
    } else if (access(name_or_path, R_OK) == 0) {
        args_parse_file(name_or_path, keys, set_key, &r);
    } else {
        char names[256] = "";
        for (size_t i = 0; builtin_devices[i][0] != NULL; i++) {
            size_t used = strlen(names);
            snprintf(names + used, sizeof names - used, " %s", builtin_devices[i][0]);
        }
        die(EXIT_USAGE, "no device '%s': neither built in (%s) nor a readable file", name_or_path,
            names + 1);
    }
    for (size_t i = 0; i < KEYS; i++) {
        if (!r.seen[i])
            die(EXIT_USAGE, "%s: the key '%s' is missing", name_or_path, keys[i].name + 2);
    }
    for (int i = 0; i < 3; i++) {
        if (!(r.d.device.joint_min_rad[i] < r.d.device.joint_max_rad[i])) {
            die(EXIT_USAGE, "%s: joint-min of axis %d is not below joint-max", name_or_path, i);
        }
    }
    snprintf(r.d.name, sizeof r.d.name, "%s", name_or_path);
    return r.d;
}
