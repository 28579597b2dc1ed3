/* SPDX-License-Identifier: MIT */
#include "sim/faults.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char *const names[FAULT_KINDS] = {FAULT_NAMES};
static const double default_value[FAULT_KINDS] = {
    [FAULT_LOSS] = 1,        [FAULT_DUPLICATE] = 1,   [FAULT_REORDER] = 1,  [FAULT_CORRUPT] = 1,
    [FAULT_DELAY] = 0.003,   [FAULT_JUMP] = 5,        [FAULT_GLITCH] = 0.3, [FAULT_OVERRUN] = 10,
    [FAULT_REFUSE] = 0x6502, [FAULT_IGNORE] = 0x6060, [FAULT_MUTE] = 0x6060};
#define DEFAULT_DURATION_S 0.01

/* "KIND", "KIND@T", "KIND@T+D", each with "=V". Takes `part` apart. */
static fault read_one(const char *list, char *part) {
    char whole[128];
    snprintf(whole, sizeof whole, "%s", part);
    char *value = strchr(part, '='), *at = strchr(part, '@');
    if (value != NULL) *value++ = '\0';
    if (at != NULL) *at++ = '\0';
    char *plus = at != NULL ? strchr(at, '+') : NULL;
    if (plus != NULL) *plus++ = '\0';
    fault f = {.kind = FAULT_KINDS, .to_s = HUGE_VAL};
    for (int k = 0; k < FAULT_KINDS; k++) {
        if (strcmp(part, names[k]) == 0) f.kind = (fault_kind)k;
    }
    if (f.kind == FAULT_KINDS)
        die(EXIT_USAGE, "--fault: '%s' in '%s' is no fault (--help lists them)", part, list);
    f.value = default_value[f.kind];
    double duration = DEFAULT_DURATION_S;
    bool good = (value == NULL || (parse_double(value, &f.value) && f.value > 0)) &&
                (at == NULL || (parse_double(at, &f.from_s) && f.from_s >= 0)) &&
                (plus == NULL || (parse_double(plus, &duration) && duration > 0));
    if (!good) die(EXIT_USAGE, "--fault: '%s' is not KIND[@T[+D]][=V]", whole);
    if (at != NULL) f.to_s = f.from_s + duration;
    return f;
}

fault_list faults_read(const char *list, uint64_t seed) {
    fault_list f = {.seed = seed};
    char *copy = copy_string(list);
    for (char *part = copy; part != NULL;) {
        char *next = strchr(part, ',');
        if (next != NULL) *next++ = '\0';
        if (f.count == MAX_FAULTS) die(EXIT_USAGE, "--fault: more than %d faults", MAX_FAULTS);
        f.list[f.count++] = read_one(list, part);
        part = next;
    }
    free(copy);
    return f;
}

const fault *fault_now(const fault_list *f, fault_kind kind, double time_s) {
    for (uint32_t i = 0; i < f->count; i++) {
        const fault *one = &f->list[i];
        if (one->kind == kind && time_s >= one->from_s && time_s < one->to_s) return one;
    }
    return NULL;
}

double faults_random(fault_list *f) {
    f->seed = f->seed * 6364136223846793005ull + 1442695040888963407ull;
    return (double)(f->seed >> 11) / 9007199254740992.0;
}

bool fault_strikes(fault_list *f, fault_kind kind, double time_s) {
    const fault *one = fault_now(f, kind, time_s);
    return one != NULL && faults_random(f) < one->value;
}
