/* SPDX-License-Identifier: MIT */
/* Device files: keys and values, one per line. */
#include "core/device/busload.h"
#include "port/host/devfile.h"
#include "port/host/args.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Made by the Makefile from sim/devices: name and text of every description, ended by NULL. */
extern const char *const builtin_devices[][2];

static const option keys[] = {
    {"--like", 1},
    {"--kinematics", 1},
    {"--upper", 1},
    {"--fore", 1},
    {"--base", 1},
    {"--gear", -7},
    {"--wrist", 1},
    {"--gripper", 1},
    {"--motors", -7},
    {"--moment-max", 1},
    {"--turn-stiffness-max", 1},
    {"--turn-damping-max", 1},
    {"--counts", 1},
    {"--protocol", 1},
    {"--fd", 1},
    {"--node", -7},
    {"--bitrate", 1},
    {"--data-bitrate", 1},
    {"--rated-torque", 1},
    {"--mit-range", 3},
    {"--mit-answer", 1},
    {"--master-id", 1},
    {"--watchdog", 1},
    {"--torque-lag", 1},
    {"--joint-zero", -7},
    {"--homing", 1},
    {"--joint-home", -7},
    {"--joint-min", -7},
    {"--joint-max", -7},
    {"--torque-max", 1},
    {"--force-max", 1},
    {"--slew-max", 1},
    {"--speed-max", 1},
    {"--workspace", 1},
    {"--tool", 1},
    {"--stiffness-max", 1},
    {"--damping-max", 1},
    {"--mass", 1},
    {"--damping", 1},
    {"--friction", 1},
    {"--weight", 1},
    {"--lift", 3},
    {"--coulomb", -7},
    {"--viscous", -7},
    {NULL, 0},
};
#define MAX_LIKES 8
#define KEYS (sizeof keys / sizeof keys[0] - 1)

static const char *const mechanisms[] = {PALP_MECHANISM_NAMES, NULL};
static const char *const mit_forms[] = {PALP_MIT_FORM_NAMES, NULL};
static const char *const wrists[] = {"none", "gimbal", NULL};
static const char *const homings[] = {"none", "pose", NULL};
static const char *const protocols[] = {PALP_PROTOCOL_NAMES, NULL};

typedef struct {
    device_file d;
    bool seen[KEYS];
    int count[KEYS]; /* of values */
    int likes;
    bool alone; /* it may not be like another */
} reading;

static bool set_scalar(reading *r, const argument *a) {
    palp_device *p = &r->d.device;
    const struct {
        const char *key;
        float *value;
        double low, high; /* what a device that a hand holds may have */
        const char *unit;
    } positive[] = {{"--upper", &p->kinematics.upper_m, 0.005, 2, "m"},
                    {"--fore", &p->kinematics.fore_m, 0.005, 2, "m"},
                    {"--base", &p->kinematics.base_m, 0, 2, "m"},
                    {"--counts", &p->drives.counts_per_rev, 8, 1e9, ""},
                    {"--bitrate", &p->bit_rate_bps, 1e4, 1e8, "bit/s"},
                    {"--data-bitrate", &p->data_rate_bps, 1e4, 1e8, "bit/s"},
                    {"--rated-torque", &p->drives.rated_torque_Nm, 1e-4, 1e3, "Nm"},
                    {"--watchdog", &p->drives.watchdog_s, 1e-4, 10, "s"},
                    {"--torque-lag", &p->drives.torque_lag_s, 0, 0.1, "s"},
                    {"--torque-max", &p->drives.torque_max_Nm, 1e-4, 1e3, "Nm"},
                    {"--force-max", &p->force_max_N, 0.01, 500, "N"},
                    {"--slew-max", &p->slew_max_N_per_s, 0.1, 1e6, "N/s"},
                    {"--speed-max", &p->speed_max_m_s, 0.01, 20, "m/s"},
                    {"--workspace", &p->workspace_radius_m, 0.002, 2, "m"},
                    {"--tool", &p->tool_radius_m, 1e-4, 0.5, "m"},
                    {"--stiffness-max", &p->stiffness_max_N_per_m, 1, 1e6, "N/m"},
                    {"--damping-max", &p->damping_max_Ns_per_m, 0, 1e3, "Ns/m"},
                    {"--moment-max", &p->moment_max_Nm, 1e-4, 100, "Nm"},
                    {"--turn-stiffness-max", &p->stiffness_max_Nm_per_rad, 1e-4, 1e4, "Nm/rad"},
                    {"--turn-damping-max", &p->damping_max_Nms_per_rad, 0, 100, "Nms/rad"},
                    {"--damping", &p->damping_Ns_per_m, 0, 1e3, "Ns/m"},
                    {"--mass", &p->mass_kg, 1e-3, 50, "kg"}};
    for (size_t i = 0; i < sizeof positive / sizeof positive[0]; i++) {
        if (strcmp(positive[i].key, a->option) != 0) continue;
        const double v = arg_between(a, -1e-9, 1e9);
        if (v < positive[i].low || v > positive[i].high)
            die(EXIT_USAGE,
                "%s: %g %s is implausible for a device that a hand holds (%g to %g; lengths are "
                "m, forces N)",
                a->where, v, positive[i].unit, positive[i].low, positive[i].high);
        *positive[i].value = (float)v;
        return true;
    }
    return false;
}

/* Keys with a value per axis. */
static bool set_axes(palp_device *p, const argument *a) {
    const float degree = 0.017453292519943f;
    const struct {
        const char *key;
        float *value, unit;
    } axes[] = {{"--gear", p->gear, 1},
                {"--joint-zero", p->joint_zero_rad, degree},
                {"--joint-home", p->joint_home_rad, degree},
                {"--joint-min", p->joint_min_rad, degree},
                {"--joint-max", p->joint_max_rad, degree},
                {"--coulomb", p->compensation.coulomb_Nm, 1},
                {"--viscous", p->compensation.viscous_Nms, 1}};
    for (size_t k = 0; k < sizeof axes / sizeof axes[0]; k++) {
        if (strcmp(axes[k].key, a->option) != 0) continue;
        for (int i = 0; i < a->count; i++)
            axes[k].value[i] = axes[k].unit * (float)arg_double(a, i);
        return true;
    }
    return false;
}

const char *device_builtin(size_t number) { return builtin_devices[number][0]; }

static char *raw_text(const char *name_or_path);

static void set_key(void *context, const argument *a) {
    reading *r = context;
    palp_device *p = &r->d.device;
    const char *o = a->option;
    if (strcmp(o, "--like") == 0) {
        for (size_t i = 0; i < KEYS; i++) {
            if (r->seen[i]) die(EXIT_USAGE, "%s: must be the first key", a->where);
        }
        if (r->alone)
            die(EXIT_WORK, "%s: a recorded device stands by itself, without 'like'", a->where);
        if (r->likes++ == MAX_LIKES)
            die(EXIT_USAGE, "%s: devices are like each other in a circle", a->where);
        char *text = raw_text(a->value[0]);
        args_parse_text(a->value[0], text, keys, set_key, r);
        free(text);
        return;
    }
    for (size_t i = 0; i < KEYS; i++) {
        if (strcmp(keys[i].name, o) != 0) continue;
        r->seen[i] = true;
        r->count[i] = a->count;
    }
    if (set_scalar(r, a) || set_axes(p, a)) return;
    if (strcmp(o, "--kinematics") == 0) {
        p->kinematics.mechanism = (palp_mechanism)arg_word(a, mechanisms);
    } else if (strcmp(o, "--protocol") == 0) {
        p->drives.protocol = (palp_protocol)arg_word(a, protocols);
    } else if (strcmp(o, "--wrist") == 0) {
        p->kinematics.wrist = arg_word(a, wrists) == 1;
    } else if (strcmp(o, "--gripper") == 0) {
        p->kinematics.gripper_m_per_rad = (float)arg_between(a, -1, 1);
    } else if (strcmp(o, "--motors") == 0) {
        p->passive = 0;
        for (int i = 0; i < a->count; i++)
            p->passive |= (arg_u32(a, i, 0, 1) == 0 ? 1u : 0u) << (uint32_t)i;
    } else if (strcmp(o, "--homing") == 0) {
        p->homes = arg_word(a, homings) == 1;
    } else if (strcmp(o, "--fd") == 0) {
        p->drives.fd = arg_u32(a, 0, 0, 1) == 1;
    } else if (strcmp(o, "--master-id") == 0) {
        p->drives.master_id = arg_u32(a, 0, 0, 0x7ff);
    } else if (strcmp(o, "--mit-range") == 0) {
        p->drives.range = (palp_mit_range){(float)arg_double(a, 0), (float)arg_double(a, 1),
                                           (float)arg_double(a, 2)};
    } else if (strcmp(o, "--mit-answer") == 0) {
        p->drives.form = (palp_mit_form)arg_word(a, mit_forms);
    } else if (strcmp(o, "--node") == 0) {
        for (int i = 0; i < a->count; i++) p->node_id[i] = (uint8_t)arg_u32(a, i, 0, 126);
    } else if (strcmp(o, "--lift") == 0) {
        p->compensation.gravity_compensation_N =
            (palp_vec3){(float)arg_double(a, 0), (float)arg_double(a, 1), (float)arg_double(a, 2)};
    } else if (strcmp(o, "--friction") == 0) {
        r->d.friction_N = arg_between(a, 0, 1e3);
    } else if (strcmp(o, "--weight") == 0) {
        r->d.weight_N = arg_between(a, 0, 1e3);
    }
}

static bool seen(const reading *r, const char *key) {
    for (size_t i = 0; i < KEYS; i++) {
        if (strcmp(keys[i].name + 2, key) == 0) return r->seen[i];
    }
    return false;
}

static void need(const reading *r, const char *name, const char *key, const char *why) {
    if (!seen(r, key)) die(EXIT_USAGE, "%s: the key '%s' is missing%s", name, key, why);
}

static void check(const reading *r, const char *name) {
    static const char *const always[] = {
        "kinematics", "upper",     "fore",      "gear",      "counts",        "protocol",
        "node",       "bitrate",   "joint-min", "joint-max", "torque-max",    "force-max",
        "slew-max",   "speed-max", "workspace", "tool",      "stiffness-max", "damping-max",
        "mass",       "damping",   "friction"};
    const palp_device *p = &r->d.device;
    for (size_t i = 0; i < sizeof always / sizeof always[0]; i++) need(r, name, always[i], "");
    if (p->kinematics.mechanism != PALP_ARM3) need(r, name, "base", ": this mechanism needs it");
    if (p->drives.protocol == PALP_PROTOCOL_CIA402)
        need(r, name, "rated-torque", ": the unit of CiA 402 torques");
    if (p->drives.protocol == PALP_PROTOCOL_MIT) {
        need(r, name, "mit-range", ": MIT mode does not tell its ranges");
        need(r, name, "master-id", ": the id of the motors' answers");
    }
    if (p->homes && seen(r, "joint-zero"))
        die(EXIT_USAGE,
            "%s: 'homing pose' finds what 'joint-zero' says: name one of them; with homing the "
            "pose is 'joint-home'",
            name);
    if (palp_device_turns(p)) {
        need(r, name, "moment-max", ": motors turn the wrist");
        need(r, name, "turn-stiffness-max", ": motors turn the wrist");
        need(r, name, "turn-damping-max", ": motors turn the wrist");
    }
    for (uint32_t i = 0; i < palp_arm_axes(&p->kinematics); i++) {
        if ((p->passive >> i & 1u) != 0)
            die(EXIT_USAGE,
                "%s: 'motors' says that axis %u has none, but only wrist and gripper can do "
                "without",
                name, i + 1);
    }
    if (p->drives.fd) need(r, name, "data-bitrate", ": the second rate of CAN FD");
    for (size_t i = 0; i < KEYS; i++) {
        int axes = (int)palp_axes(&p->kinematics);
        if (keys[i].values < 0 && r->seen[i] && r->count[i] != axes)
            die(EXIT_USAGE, "%s: '%s' needs %d values, one for each axis, and has %d", name,
                keys[i].name + 2, axes, r->count[i]);
    }
    for (uint32_t i = 0; i < palp_axes(&p->kinematics); i++) {
        if (!(fabsf(p->joint_zero_rad[i]) <= 6.2832f))
            die(EXIT_USAGE, "%s: joint-zero of axis %u is %g degrees: need -360 to 360", name,
                i + 1, (double)(p->joint_zero_rad[i] * 57.29578f));
        if (p->homes && !(p->joint_home_rad[i] >= p->joint_min_rad[i] &&
                          p->joint_home_rad[i] <= p->joint_max_rad[i]))
            die(EXIT_USAGE, "%s: joint-home of axis %u lies outside joint-min and joint-max", name,
                i + 1);
        if (!(p->joint_min_rad[i] < p->joint_max_rad[i]))
            die(EXIT_USAGE, "%s: joint-min of axis %u is not below joint-max", name, i);
        if (!(p->gear[i] > 0.0f || p->gear[i] < 0.0f))
            die(EXIT_USAGE, "%s: the gear ratio of axis %u cannot be 0", name, i);
    }
    if (!palp_kinematics_is_sound(&p->kinematics))
        die(EXIT_USAGE, "%s: the links do not meet at home: fore must be longer than base + upper",
            name);
    if (p->drives.protocol == PALP_PROTOCOL_MOTEUS && !p->drives.fd)
        die(EXIT_USAGE, "%s: moteus speaks CAN FD: set 'fd 1' and 'data-bitrate'", name);
    if (p->drives.fd &&
        (p->drives.protocol == PALP_PROTOCOL_ODRIVE || p->drives.protocol == PALP_PROTOCOL_CIA402))
        die(EXIT_USAGE, "%s: %s drives speak classic CAN: remove 'fd'", name,
            protocols[p->drives.protocol]);
    if (!palp_device_is_sound(p))
        die(EXIT_USAGE,
            "%s: node ids must differ (and from master-id) and fit the protocol (ODrive and palp "
            "0-63, cia402 1-126, "
            "moteus 1-63, mit 0-15), mit-range must be above 0, watchdog from 0.01 to 0.1 s, "
            "coulomb and viscous not below 0",
            name);
}

/* What fits no rule but hardly can be meant. */
static void doubt(const palp_device *p, const char *name) {
    const float home[PALP_AXES] = {0};
    const palp_pose pose = palp_forward(&p->kinematics, home);
    const float reach = p->kinematics.upper_m + p->kinematics.fore_m;
    float most = 0;
    const palp_vec3 along[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int k = 0; k < 3 && pose.reachable; k++) {
        float torque[PALP_AXES] = {0}, force = HUGE_VALF;
        palp_pose_torques(&pose, along[k], (palp_vec3){0}, torque);
        for (uint32_t i = 0; i < palp_arm_axes(&p->kinematics); i++) {
            if (fabsf(torque[i]) > 1e-6f)
                force = fminf(force, p->drives.torque_max_Nm * fabsf(p->gear[i] / torque[i]));
        }
        if (force < HUGE_VALF) most = fmaxf(most, force);
    }
    if (p->workspace_radius_m > reach)
        warn("%s: a workspace of %g m radius is beyond the reach of %g m", name,
             (double)p->workspace_radius_m, (double)reach);
    if (most > 0 && p->force_max_N > 3 * most)
        warn("%s: force-max is %g N, but at home the motors make %g N at most along its axes", name,
             (double)p->force_max_N, (double)most);
    if (p->slew_max_N_per_s * 1e-3f > p->force_max_N)
        warn("%s: slew-max %g N/s limits nothing: force-max %g N comes within a millisecond", name,
             (double)p->slew_max_N_per_s, (double)p->force_max_N);
    if (p->tool_radius_m > reach)
        warn("%s: a tool of %g m radius on a device of %g m reach", name, (double)p->tool_radius_m,
             (double)reach);
}

static const char *builtin_text(const char *name) {
    for (size_t i = 0; builtin_devices[i][0] != NULL; i++) {
        if (strcmp(builtin_devices[i][0], name) == 0) return builtin_devices[i][1];
    }
    return NULL;
}

static char *raw_text(const char *name_or_path) {
    const char *text = builtin_text(name_or_path);
    size_t bytes;
    if (text != NULL) return copy_string(text);
    if (access(name_or_path, R_OK) == 0) return read_file(name_or_path, &bytes);
    char names[256] = "";
    for (size_t i = 0; builtin_devices[i][0] != NULL; i++) {
        size_t used = strlen(names);
        snprintf(names + used, sizeof names - used, " %s", builtin_devices[i][0]);
    }
    die(EXIT_USAGE, "no device '%s': neither built in (%s) nor a readable file", name_or_path,
        names + 1);
}

char *device_text(const char *name_or_path) {
    char *text = raw_text(name_or_path), other[128];
    for (char *line = text; line != NULL; line = strchr(line, '\n')) {
        line += *line == '\n' ? 1 : 0;
        line += strspn(line, " \t\r\v\f");
        if (sscanf(line, "like %127s", other) != 1) continue;
        char *base = device_text(other);
        memset(line, ' ', strcspn(line, "\n")); /* what follows overrides it */
        char *both = allocate(strlen(base) + strlen(text) + 2, 1);
        sprintf(both, "%s\n%s", base, text);
        free(base);
        free(text);
        return both;
    }
    return text;
}

static device_file read_text(const char *name, const char *text, bool alone) {
    reading r = {.d.device.drives = {.watchdog_s = 0.05f, .torque_lag_s = 0.0002f, .rate_hz = 1000},
                 .alone = alone};
    args_parse_text(name, text, keys, set_key, &r);
    check(&r, name);
    doubt(&r.d.device, name);
    snprintf(r.d.name, sizeof r.d.name, "%s", name);
    return r.d;
}

device_file device_read(const char *name, const char *text) { return read_text(name, text, true); }

device_file device_load(const char *name_or_path) {
    char *text = raw_text(name_or_path);
    device_file d = read_text(name_or_path, text, false);
    free(text);
    return d;
}

void device_check_load(const device_file *d, char *text, size_t size) {
    const palp_device *p = &d->device;
    palp_bus_load load = palp_bus_load_of(p);
    double percent = 100 * (double)load.load;
    snprintf(text, size, "%.0f %% of the bus at worst: %.0f us of frames in each %.0f us", percent,
             1e6 * (double)load.cycle_s, 1e6 / (double)p->drives.rate_hz);
    if (load.load > 1.0f)
        die(EXIT_WORK, "%s at %g Hz needs %s: lower --rate, or use more buses", d->name,
            (double)p->drives.rate_hz, text);
    if (load.load > PALP_BUS_LOAD_ADVISED)
        warn("%s at %g Hz needs %s: more than %.0f %% leaves no room for retries", d->name,
             (double)p->drives.rate_hz, text, 100 * (double)PALP_BUS_LOAD_ADVISED);
}
