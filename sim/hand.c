/* SPDX-License-Identifier: MIT */
#include "sim/hand.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RAD_PER_DEGREE 0.017453292519943295
#define TREMOR_M 6e-5
#define WAIT_S 60.0 /* a script that begins later was hardly meant to */

/* z = 0 is where the tool just touches; +z points away from the body. */
static const char touch_script[] = "0.0  0      0      0.020\n"
                                   "0.8  0      0      0.003\n"
                                   "1.3  0      0     -0.006\n" /* press */
                                   "1.8  0      0     -0.006\n"
                                   "2.2  0      0      0.004\n" /* let go */
                                   "2.6  0      0     -0.009\n" /* press harder */
                                   "3.2  0      0     -0.005\n"
                                   "4.0  0.008  0     -0.005\n" /* slide around a square */
                                   "4.8  0.008  0.008 -0.005\n"
                                   "5.6 -0.008  0.008 -0.005\n"
                                   "6.4 -0.008 -0.008 -0.005\n"
                                   "7.2  0      0     -0.005\n"
                                   "8.0  0      0     -0.013\n" /* deep */
                                   "8.6  0      0     -0.013\n"
                                   "9.4  0      0      0.010\n"
                                   "10   0      0      0.010\n";

/* Returns whether the line says how the tool is turned. */
static bool add_key(hand *h, size_t *capacity, const char *name, size_t line, const char *text) {
    hand_key k = {.time_s = 0};
    hand_turn t = {.gripper_rad = 0};
    double *x = k.x_m, *turn = t.turn_rad;
    char rest;
    int n = sscanf(text, "%lf %lf %lf %lf %lf %lf %lf %lf %c", &k.time_s, &x[0], &x[1], &x[2],
                   &turn[0], &turn[1], &turn[2], &t.gripper_rad, &rest);
    if (n != 4 && n != 7 && n != 8)
        die(EXIT_USAGE,
            "%s:%zu: need the four numbers t x y z, or seven with a turn rx ry rz, or eight with a "
            "gripper",
            name, line);
    for (int i = 0; i < 3; i++) turn[i] *= RAD_PER_DEGREE;
    t.gripper_rad *= RAD_PER_DEGREE;
    if (!(fabs(turn[0]) + fabs(turn[1]) + fabs(turn[2]) + fabs(t.gripper_rad) < 20))
        die(EXIT_USAGE, "%s:%zu: turns are degrees, at most a few hundred", name, line);
    if (h->count > 0 && !(k.time_s > h->key[h->count - 1].time_s)) {
        die(EXIT_USAGE, "%s:%zu: time %g does not grow", name, line, k.time_s);
    }
    for (int i = 0; i < 3; i++) {
        if (!(x[i] > -1 && x[i] < 1))
            die(EXIT_USAGE, "%s:%zu: %g m is out of any device's reach", name, line, x[i]);
    }
    h->key = grow(h->key, capacity, h->count + 1u, sizeof *h->key);
    h->turn = realloc(h->turn, *capacity * sizeof *h->turn);
    if (h->turn == NULL) die(EXIT_WORK, "no memory for the hand script");
    h->turn[h->count] = t;
    h->key[h->count++] = k;
    return n > 4;
}

hand hand_of_person(void) {
    return (hand){.stiffness_N_per_m = 400,
                  .damping_Ns_per_m = 6,
                  .stiffness_Nm_per_rad = 0.5,
                  .damping_Nms_per_rad = 0.01,
                  .tremor_m = TREMOR_M};
}

hand hand_load(const char *name_or_path) {
    hand h = hand_of_person();
    size_t bytes, capacity = 0, line = 0;
    bool turns = false;
    bool built_in = strcmp(name_or_path, "touch") == 0;
    char *text = built_in ? copy_string(touch_script) : read_file(name_or_path, &bytes);
    for (char *p = text; p != NULL;) {
        char *next = strchr(p, '\n');
        if (next != NULL) *next++ = '\0';
        line++;
        p[strcspn(p, "#\r")] = '\0';
        if (p[strspn(p, " \t")] != '\0')
            turns = add_key(&h, &capacity, name_or_path, line, p) || turns;
        p = next;
    }
    if (h.count == 0) die(EXIT_USAGE, "%s: no keys in the hand script", name_or_path);
    if (!turns) {
        free(h.turn);
        h.turn = NULL;
    }
    double wait_s = h.key[0].time_s;
    if (wait_s > WAIT_S)
        warn("%s: the hand stays where it is for %g s, up to its first key: times are seconds from "
             "the start (subtract %.17g)",
             name_or_path, wait_s, wait_s);
    free(text);
    return h;
}

static void blend(double *x, const double *to, double share, int count) {
    for (int k = 0; k < count; k++) x[k] += share * (to[k] - x[k]);
}

/* Minimum jerk between keys. */
static void script_target(const hand *h, double time_s, hand_pose *at) {
    uint32_t i = 0;
    while (i + 1 < h->count && h->key[i + 1].time_s <= time_s) i++;
    const hand_key *a = &h->key[i];
    *at = (hand_pose){.turn = {.gripper_rad = 0}};
    memcpy(at->x_m, a->x_m, sizeof at->x_m);
    if (h->turn != NULL) at->turn = h->turn[i];
    if (i + 1 == h->count || time_s <= a->time_s) return;
    const hand_key *b = &h->key[i + 1];
    const double s = (time_s - a->time_s) / (b->time_s - a->time_s);
    const double share = h->even ? s : s * s * s * (10 + s * (6 * s - 15));
    blend(at->x_m, b->x_m, share, 3);
    if (h->turn == NULL) return;
    blend(at->turn.turn_rad, h->turn[i + 1].turn_rad, share, 3);
    blend(&at->turn.gripper_rad, &h->turn[i + 1].gripper_rad, share, 1);
}

void hand_target(const hand *h, double time_s, hand_pose *at) {
    static const double rad_s[3] = {51, 59, 67};
    script_target(h, time_s, at);
    for (int k = 0; k < 3; k++) at->x_m[k] += h->tremor_m * sin(rad_s[k] * time_s);
}
