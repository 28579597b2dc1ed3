/* SPDX-License-Identifier: MIT */
/* The answer with its budget, as a servo runs it, in virtual time: what is left of disturbances. */
#include "core/servo/answer.h"
#include "tools/feel/bench.h"
#include "port/host/parallel.h"
#include "tools/press/press.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RATE_HZ 1000.0
#define MARGIN 0.7 /* share of the period for the answer */
#define NS_PER_OPERATION 0.5
#define DAMPING_S 2e-3  /* damping over stiffness, as devices allow */
#define AFTER_TICKS 100 /* after a disturbance */

/* A script: approach, press, hold, slide, hold, leave; device places at 1 kHz. */
#define SCRIPT_TICKS 1400
typedef struct {
    palp_answer answer;
    palp_tool tool;
    void *memory;
    size_t bytes;
    uint64_t base_ns, base_work;
    uint32_t clock_reads, leap_at; /* clock readings in this tick; at which it leaps, 0: never */
    uint64_t leap_ns;
    double ns_per_operation;
} hand;

static uint64_t virtual_ns(void *context) {
    hand *h = context;
    double work = (double)(h->answer.contact.work_done - h->base_work);
    if (h->leap_at > 0 && ++h->clock_reads == h->leap_at) h->base_ns += h->leap_ns;
    return h->base_ns + (uint64_t)(work * h->ns_per_operation);
}

static hand *open_hand(bench *b, double radius, double ns_per_operation, double stiffness) {
    hand *h = allocate(1, sizeof *h);
    h->tool = palp_tool_sphere((float)radius);
    h->ns_per_operation = ns_per_operation;
    const palp_answer_config config = {
        .contact = {.blob = b->blob,
                    .tools = &h->tool,
                    .tool_count = 1,
                    .finest = PALP_CONTACT_FINEST},
        .cost = {&palp_target_counted, (float)ns_per_operation, 0, (float)MARGIN},
        .port = {virtual_ns, h},
        .dt_s = (float)(1 / RATE_HZ)};
    h->bytes = palp_answer_memsize(&config.contact);
    h->memory = allocate_aligned(h->bytes, 1);
    float bound = 0;
    palp_status status = palp_answer_init(&h->answer, &config, h->memory, h->bytes, &bound);
    if (status != PALP_OK) {
        free(h->memory);
        free(h);
        return NULL;
    }
    h->answer.coupling.tool[0].stiffness_N_per_m = (float)stiffness;
    h->answer.coupling.tool[0].damping_Ns_per_m = (float)(DAMPING_S * stiffness);
    return h;
}

static void close_hand(hand *h) {
    free(h->memory);
    free(h);
}

static palp_coupling_result tick(hand *h, palp_vec3 device, palp_answer_report *report) {
    palp_coupling_result result;
    palp_answer_report r;
    h->clock_reads = 0;
    h->base_work = h->answer.contact.work_done;
    uint64_t start = virtual_ns(h);
    const palp_frame at = palp_frame_at(device);
    palp_answer_tick(&h->answer, start, &at, &result, &r);
    h->base_ns += 1000000;
    if (report != NULL) *report = r;
    return result;
}

/* Where the device is; `depth` of the press in the model. */
typedef struct {
    palp_vec3 at[SCRIPT_TICKS];
} script;

static script write_script(bench *b, uint32_t node, double radius, double depth) {
    script s;
    palp_tool tool = palp_tool_sphere((float)radius);
    palp_contact *c = contact_open(b->blob, &tool, 1, 0);
    palp_surface_point p = press_start(c, node);
    palp_vec3 along = {0.5f, 0.2f, 0.7f};
    for (int i = 0; i < SCRIPT_TICKS; i++) {
        double t = i / (double)SCRIPT_TICKS, down;
        down = t < 0.2 ? t / 0.2 : t < 0.85 ? 1 : (1 - t) / 0.15;
        down = down * down * (3 - 2 * down);
        if (t > 0.35 && t < 0.7) {
            along = bench_tangent(along, p.n);
            palp_vec3 y = palp_madd(p.y, (float)(2 * b->edge_m / (0.35 * SCRIPT_TICKS)), along);
            (void)press_point(c, palp_madd(y, (float)b->edge_m, p.n), p.n, &p);
        }
        s.at[i] = palp_madd(p.y, (float)(1.3 * radius - down * (0.3 * radius + depth)), p.n);
    }
    contact_close(c);
    return s;
}

typedef struct {
    palp_vec3 force[SCRIPT_TICKS];
    double largest, step;
    uint32_t held, coarsest;
} felt;

/* Largest change of the force from tick to tick. */
static double largest_step(const palp_vec3 *f, int from, int to) {
    float most = 0;
    for (int i = from > 0 ? from : 1; i < to; i++) {
        palp_vec3 d = palp_sub(f[i], f[i - 1]);
        if (palp_dot(d, d) > most) most = palp_dot(d, d);
    }
    return sqrt((double)most);
}

static double largest_difference(const palp_vec3 *a, const palp_vec3 *b) {
    float most = 0;
    for (int i = 0; i < SCRIPT_TICKS; i++) {
        palp_vec3 d = palp_sub(a[i], b[i]);
        if (palp_dot(d, d) > most) most = palp_dot(d, d);
    }
    return sqrt((double)most);
}

static felt feel_script(hand *h, const script *s) {
    felt f = {.coarsest = PALP_CONTACT_LEVELS};
    for (int i = 0; i < SCRIPT_TICKS; i++) {
        palp_answer_report r;
        f.force[i] = tick(h, s->at[i], &r).force_N;
        f.largest = fmax(f.largest, (double)palp_norm(f.force[i]));
        f.held += r.held;
        if (r.level < f.coarsest) f.coarsest = r.level;
    }
    f.step = largest_step(f.force, 0, SCRIPT_TICKS);
    return f;
}

/* One tick of the script is disturbed, each in its turn, from a copy of the state before it. */
static void disturb(bench *b, const char *name, uint64_t leap_ns, uint32_t leap_at, double radius,
                    double depth, double stiffness) {
    hand *h = open_hand(b, radius, NS_PER_OPERATION, stiffness);
    if (h == NULL) die(EXIT_WORK, "the body does not fit %g Hz here", RATE_HZ);
    script s = write_script(b, b->place[0], radius, depth);
    felt plain = feel_script(h, &s);
    close_hand(h);
    h = open_hand(b, radius, NS_PER_OPERATION, stiffness);
    hand kept;
    uint8_t *memory = allocate_aligned(h->bytes, 1);
    double off = 0, step = 0;
    uint32_t runs = 0, changed = 0, held = 0;
    progress_begin(name, SCRIPT_TICKS);
    for (int i = 0; i < SCRIPT_TICKS; i++) {
        if ((uint32_t)i % b->every == 0) {
            palp_vec3 force[AFTER_TICKS + 2];
            memcpy(memory, h->memory, h->bytes);
            kept = *h;
            int k = 0;
            force[k++] = i > 0 ? plain.force[i - 1] : (palp_vec3){0};
            for (; k <= AFTER_TICKS + 1 && i + k - 1 < SCRIPT_TICKS; k++) {
                palp_answer_report r;
                h->leap_at = k == 1 ? leap_at : 0;
                h->leap_ns = leap_ns;
                force[k] = tick(h, s.at[i + k - 1], &r).force_N;
                changed += r.level != h->answer.limit;
                held += r.held;
            }
            double error = (double)palp_norm(palp_sub(force[k - 1], plain.force[i + k - 2]));
            off = fmax(
                off, error / fmax((double)palp_norm(plain.force[i + k - 2]), 0.05 * plain.largest));
            step = fmax(step, largest_step(force, 1, k));
            runs++;
            memcpy(h->memory, memory, h->bytes);
            *h = kept;
        }
        (void)tick(h, s.at[i], NULL);
        progress_add(1);
    }
    progress_end();
    char of[72];
    snprintf(of, sizeof of, "%s, %u moments", name, runs);
    feel_add(&b->table, "off after 100 ms", of, 100 * off, "%", FEEL_FORCE_THRESHOLD, 2);
    feel_add(&b->table, "largest step", of, step / plain.step, "times", NAN, 1.5);
    feel_add(&b->table, "level changed", of, changed, "ticks", NAN, 0);
    feel_add(&b->table, "went on as foreseen", of, (double)held / runs, "ticks", NAN, NAN);
    free(memory);
    close_hand(h);
}

static void slow(bench *b, double radius, double depth, double stiffness) {
    static const double times[] = {2, 5, 10, 20}, goal[] = {2, 2, 4, 7};
    script s = write_script(b, b->place[0], radius, depth);
    hand *h = open_hand(b, radius, NS_PER_OPERATION, stiffness);
    felt plain = feel_script(h, &s);
    close_hand(h);
    for (size_t k = 0; k < 4; k++) {
        char of[72];
        h = open_hand(b, radius, times[k] * NS_PER_OPERATION, stiffness);
        if (h == NULL) {
            snprintf(of, sizeof of, "%g times: refused at open", times[k]);
            feel_add(&b->table, "slow controller", of, 0, "%", FEEL_FORCE_THRESHOLD, goal[k]);
            continue;
        }
        uint32_t level = h->answer.limit;
        felt f = feel_script(h, &s);
        double off = largest_difference(f.force, plain.force) / plain.largest;
        snprintf(of, sizeof of, "%g times, level %u, %u ticks foreseen", times[k], level, f.held);
        feel_add(&b->table, "slow controller", of, 100 * off, "%", FEEL_FORCE_THRESHOLD, goal[k]);
        close_hand(h);
    }
}

/* The device jumps into the body; the force must come to be that of a slow press. */
static void teleport(bench *b, double radius, double depth, double stiffness) {
    double worst = 0;
    const uint32_t places = b->places < 8 ? b->places : 8;
    for (uint32_t i = 0; i < places; i++) {
        hand *h = open_hand(b, radius, NS_PER_OPERATION, stiffness);
        palp_contact *c = &h->answer.contact;
        palp_surface_point p = press_start(c, b->place[i]);
        palp_vec3 in = palp_madd(p.y, (float)(radius - depth), p.n);
        palp_vec3 out = palp_madd(p.y, (float)(1.5 * radius), p.n), slow_force = {0}, fast = {0};
        for (int k = 0; k <= 400; k++)
            slow_force =
                tick(h, palp_madd(out, palp_min((float)k / 300.0f, 1.0f), palp_sub(in, out)), NULL)
                    .force_N;
        for (int k = 0; k < 100; k++) (void)tick(h, out, NULL);
        for (int k = 0; k < 200; k++) fast = tick(h, in, NULL).force_N;
        worst =
            fmax(worst, (double)(palp_norm(palp_sub(fast, slow_force)) / palp_norm(slow_force)));
        close_hand(h);
    }
    feel_add(&b->table, "teleport", "into the body, after 200 ms, worst of 8", 100 * worst, "%",
             FEEL_FORCE_THRESHOLD, 2);
}

static void touch_and_release(bench *b, double radius, double depth, double stiffness) {
    hand *h = open_hand(b, radius, NS_PER_OPERATION, stiffness);
    palp_surface_point p = press_start(&h->answer.contact, b->place[0]);
    const double speed = 0.1 / RATE_HZ;
    double first = 0, last = 0, largest = 0, pull = 0;
    palp_vec3 force = {0};
    int ticks = (int)((0.2 * radius + depth) / speed);
    for (int k = 0; k < 2 * ticks; k++) {
        double down = speed * (k < ticks ? k : 2 * ticks - k);
        palp_vec3 at = palp_madd(p.y, (float)(1.2 * radius - down), p.n);
        double before = (double)palp_norm(force);
        force = tick(h, at, NULL).force_N;
        double now = (double)palp_norm(force);
        if (!(before > 0) && now > 0) first = now;
        if (!(now > 0) && before > 0) last = before;
        largest = fmax(largest, now);
        pull = fmax(pull, -(double)palp_dot(force, p.n));
    }
    feel_add(&b->table, "first touch", "0.1 m/s, first force over the largest",
             100 * first / largest, "%", NAN, NAN);
    feel_add(&b->table, "release", "0.1 m/s, last force over the largest", 100 * last / largest,
             "%", NAN, NAN);
    feel_add(&b->table, "pull", "largest against the surface, over the largest",
             100 * pull / largest, "%", NAN, 0.1);
    close_hand(h);
}

void feel_disturbances(bench *b) {
    const double radius = 2 * b->edge_m, depth = 0.5 * radius,
                 stiffness = 2 * (double)b->blob->meta->stiffness_max_N_per_m;
    touch_and_release(b, radius, depth, stiffness);
    disturb(b, "stall of 3 ms in the tick", 3000000, 3, radius, depth, stiffness);
    disturb(b, "600 us late", 600000, 2, radius, depth, stiffness);
    slow(b, radius, depth, stiffness);
    teleport(b, radius, depth, stiffness);
}
