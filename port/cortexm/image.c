/* SPDX-License-Identifier: MIT */
/*
 * A controller without an operating system: opens the blob in flash, and ticks with a device whose
 * joints go round (test_trajectory.h) until TICKS are done. Prints what the image takes, what its
 * ticks took, and a hash of every frame and force, which is the same on every machine.
 */
#include "port/cortexm/print.h"
#include "port/cortexm/test_trajectory.h"
#include "port/cortexm/systick.h"

#ifndef TICKS
#define TICKS 4000u
#endif
#ifndef RATE_HZ
#define RATE_HZ 1000.0f
#endif
#ifndef MEMORY_BYTES
#define MEMORY_BYTES (256u << 10)
#endif
#ifndef FINEST
#define FINEST 2u /* level of contact */
#endif
#define STATE_TICKS 400u /* until the drives are on and the force has risen */

extern const uint8_t blob_begin[], blob_end[];
extern uint8_t data_begin, bss_end, data_load, data_end;
int main(void);

static _Alignas(64) uint8_t memory[MEMORY_BYTES];
static test_trajectory device;
static uint64_t hash = HASH_BEGIN;

/* What a tick takes at most, and how often a core at CORE_MHZ can do that with a fifth of the period
 * left over. */
static void print_bound(const char *what, float work) {
    float hz = 0.8e9f / (SYSTICK_NS * work);
    print_number(what, (uint64_t)work, " " SYSTICK_UNIT " at most");
    print_number(", ", (uint64_t)hz, " Hz\n");
}

static void print_bounds(const palp_blob *blob, const palp_servo_config *config) {
    const palp_prices *price = &SYSTICK_TARGET->instructions;
    palp_contact_cost c = palp_contact_cost_of(blob, &config->tool, 1, price);
    float servo = palp_servo_cost_before(price, &config->device) +
                  palp_servo_cost_after(price, &config->device);
    for (uint32_t l = 0; l <= FINEST; l++) {
        print_number("level ", l, ": ");
        print_bound("always, ", servo + palp_answer_cost_least(&c, l));
        print_number("level ", l, ": ");
        print_bound("all that it allows, ", servo + palp_answer_cost_full(&c, l));
    }
}

/* What is worth knowing of the ticks in which the force was on. */
typedef struct {
    uint64_t ticks, sum, most, level[PALP_CONTACT_LEVELS], late, held;
    uint32_t points, active;
    float force_N;
} tally;

static void one_tick(palp_servo *servo, const palp_servo_config *config, uint32_t i, tally *t) {
    palp_can_frame in[TRAJECTORY_AXES], out[PALP_SERVO_FRAMES_OUT];
    palp_report r;
    float q[PALP_AXES];
    trajectory_path(i, i < STATE_TICKS ? 0.0f : 0.12f, q);
    trajectory_speak(&device, &config->device, q, in);
    const palp_tick_input input = {.frames = in, .count = TRAJECTORY_AXES};
    uint64_t begun = systick_work();
    uint32_t sent = palp_servo_tick(servo, &input, out, &r);
    uint64_t took = systick_work() - begun;
    trajectory_listen(&device, &config->device, out, sent);
    for (uint32_t k = 0; k < sent; k++) hash = hash_on(hash, out[k].data, out[k].length);
    hash = hash_on(hash, &r.force_N, sizeof r.force_N);
    if (r.state != PALP_STATE_RUN) return;
    t->ticks++;
    t->sum += took;
    t->most = took > t->most ? took : t->most;
    t->level[r.level]++;
    t->late += r.elapsed_ns > 0.8e9f / RATE_HZ ? 1u : 0u;
    t->held += r.held ? 1u : 0u;
    t->points = r.points > t->points ? r.points : t->points;
    t->active = r.active > t->active ? r.active : t->active;
    t->force_N = palp_max(t->force_N, palp_norm(r.force_N));
}

static void print_tally(const tally *t) {
    print_number("ticks with force ", t->ticks, "\n");
    if (t->ticks == 0u) return;
    print_number(SYSTICK_UNIT " a tick: mean ", t->sum / t->ticks, "");
    print_number(", most ", t->most, "\n");
    print_number("most contact points ", t->points, "");
    print_number(", in contact ", t->active, "");
    print_number(", largest force ", (uint64_t)(1000.0f * t->force_N), " mN\n");
    for (uint32_t l = 0; l < PALP_CONTACT_LEVELS; l++) {
        if (t->level[l] == 0u) continue;
        print_number("ticks on level ", l, "");
        print_number(": ", t->level[l], "\n");
    }
    print_number("held as foreseen ", t->held, "\n");
    print_number("late ", t->late, "\n");
}

int main(void) {
    palp_blob blob;
    palp_servo *servo;
    tally t = {.ticks = 0};
    float bound_ns = 0.0f;
    const uint32_t bytes = (uint32_t)(blob_end - blob_begin);
    systick_start();
    palp_status status = palp_blob_open(&blob, blob_begin, bytes);
    print_number("blob ", bytes, " bytes in flash");
    print_number(", opened in ", systick_work(), " " SYSTICK_UNIT "\n");
    if (status != PALP_OK) {
        semihost_print(palp_status_text(status));
        return 1;
    }
    palp_servo_config config = trajectory_config(&blob, RATE_HZ, 1.5f * blob.meta->mean_edge_m);
    config.finest = FINEST;
    config.cost = (palp_cost_table){SYSTICK_TARGET, SYSTICK_NS, 0.0f, 0.8f};
    config.port = (palp_port){systick_now_ns, NULL};
    print_number("data and memory ", (uint64_t)(&bss_end - &data_begin), " bytes of RAM");
    print_number(", servo ", palp_servo_memsize(&blob, FINEST), " of them\n");
    status = palp_servo_open(&servo, &blob, &config, memory, sizeof memory, &bound_ns);
    print_bounds(&blob, &config);
    if (status != PALP_OK) {
        semihost_print(palp_status_text(status));
        semihost_print("\n");
        return 1;
    }
    for (uint32_t i = 0; i < TICKS; i++) one_tick(servo, &config, i, &t);
    print_tally(&t);
    print_hash(hash);
    return 0;
}
