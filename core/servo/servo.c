/* SPDX-License-Identifier: MIT */
#include "servo.h"
#include "core/device/odrive.h"

#define NS_PER_S 1e9f
#define RAD_PER_REV 6.28318530718f
#define PLAUSIBLE 4.0f /* a joint may move this many times what its speed limit allows */
#define ENABLE_EVERY_S 0.1f

typedef struct {
    float q_rad, dq_rad_s;
    uint32_t age;           /* ticks since the last accepted estimate */
    uint32_t heartbeat_age; /* ticks */
    uint32_t drive_state, drive_error, bad_in_a_row;
    bool known, heard;
} axis;

struct palp_servo {
    const palp_blob *blob;
    palp_servo_config config;
    palp_bounded bounded;
    palp_output output;
    palp_counters counters;
    axis axes[PALP_AXES];
    palp_state state;
    uint32_t faults, state_ticks;
    float dt_s, absorbed_J;
    uint64_t start_ns; /* of the tick under way */
    palp_vec3 last_tip_m;
};

static palp_servo *lay_out(const palp_blob *b, palp_contact_limits l, palp_arena *arena,
                           void **bounded_memory) {
    palp_servo *s = palp_take(arena, 1, sizeof *s);
    *bounded_memory = palp_take(arena, palp_bounded_memsize(b, l), 1);
    return s;
}

size_t palp_servo_memsize(const palp_blob *blob, palp_contact_limits limits) {
    palp_arena arena = {0};
    void *bounded_memory;
    if (!palp_contact_limits_sound(limits)) return 0;
    (void)lay_out(blob, limits, &arena, &bounded_memory);
    return arena.used;
}

static bool config_is_sound(const palp_servo_config *c) {
    const palp_device *d = &c->device;
    bool positive = c->rate_hz > 0.0f && palp_tool_is_sound(&c->tool) &&
                    c->placement.scale > 0.0f && c->cost.ns_per_operation > 0.0f &&
                    c->cost.margin > 0.0f && d->force_max_N > 0.0f && d->slew_max_N_per_s > 0.0f &&
                    d->motor_torque_max_Nm > 0.0f && d->speed_max_m_s > 0.0f &&
                    d->stiffness_max_N_per_m > 0.0f && d->damping_max_Ns_per_m >= 0.0f &&
                    d->arm.upper_m > 0.0f && d->arm.fore_m > 0.0f;
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        positive = positive && palp_abs(d->gear[i]) > 0.0f && d->node_id[i] < 64u;
    }
    return positive && c->port.now_ns != NULL;
}

palp_status palp_servo_open(palp_servo **servo, const palp_blob *blob,
                            const palp_servo_config *config, void *memory, size_t bytes,
                            float *bound_ns) {
    palp_arena arena = {.base = memory};
    void *bounded_memory;
    if (!palp_contact_limits_sound(config->limits)) return PALP_ERR_LIMITS;
    if (!config_is_sound(config)) return PALP_ERR_ARGUMENT;
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (bytes < palp_servo_memsize(blob, config->limits)) return PALP_ERR_MEMORY;
    palp_servo *s = lay_out(blob, config->limits, &arena, &bounded_memory);
    *s = (palp_servo){.blob = blob, .config = *config, .dt_s = 1.0f / config->rate_hz};
    palp_bounded_config bounded = {.blob = blob,
                                   .tools = &s->config.tool,
                                   .tool_count = 1,
                                   .limits = config->limits,
                                   .cost = config->cost,
                                   .port = config->port,
                                   .dt_s = s->dt_s};
    palp_status status = palp_bounded_init(&s->bounded, &bounded, bounded_memory,
                                           palp_bounded_memsize(blob, config->limits), bound_ns);
    if (status != PALP_OK) return status;
    /* Device stiffness k becomes k / scale^2 in the model, where lengths grow and forces shrink by
     * scale. */
    float scale = config->placement.scale;
    palp_spring *spring = &s->bounded.coupling.spring[0];
    spring->stiffness_N_per_m = config->device.stiffness_max_N_per_m / (scale * scale);
    spring->damping_Ns_per_m = config->device.damping_max_Ns_per_m / (scale * scale);
    *servo = s;
    return PALP_OK;
}

const palp_counters *palp_servo_counters(const palp_servo *servo) { return &servo->counters; }

uint32_t palp_servo_loads(const palp_servo *servo, palp_load *load) {
    const palp_contact *c = &servo->bounded.ladder.contact[servo->bounded.ladder.now];
    const palp_friction *f = &servo->bounded.coupling.spring[0].friction;
    palp_vec3 resultant;
    float total = palp_contact_normal_force(c, 0, &resultant);
    for (uint32_t a = 0; a < c->active_count; a++) {
        const palp_candidate *k = &c->candidate[c->active[a]];
        palp_vec3 force = palp_scale(-k->force_N, k->n);
        if (total > 0.0f) force = palp_madd(force, -k->force_N / total, f->force_N);
        load[a] = (palp_load){.at = {k->level, k->slot}, .force_N = force};
    }
    return c->active_count;
}

/* ---- in ---- */

static axis *axis_of(palp_servo *s, uint8_t node, uint32_t *number) {
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        if (s->config.device.node_id[i] != node) continue;
        *number = i;
        return &s->axes[i];
    }
    return NULL;
}

/* Joint angle of an estimate, if it is finite, within the limits and reachable since the last one.
 */
static bool plausible(const palp_servo *s, const axis *a, uint32_t i, const palp_odrive_message *m,
                      float *q, float *dq) {
    const palp_device *d = &s->config.device;
    if (!palp_is_finite(m->position_rev) || !palp_is_finite(m->velocity_rev_s)) return false;
    *q = m->position_rev / d->gear[i] * RAD_PER_REV;
    *dq = m->velocity_rev_s / d->gear[i] * RAD_PER_REV;
    if (!(*q >= d->joint_min_rad[i] && *q <= d->joint_max_rad[i])) return false;
    if (!a->known) return true;
    float reach = palp_min(d->arm.upper_m, d->arm.fore_m);
    float speed = d->speed_max_m_s / (0.3f * reach);
    return palp_abs(*q - a->q_rad) <= PLAUSIBLE * speed * s->dt_s * (float)(a->age + 1u) &&
           palp_abs(*dq) <= PLAUSIBLE * speed;
}

static void take_estimate(palp_servo *s, axis *a, uint32_t i, const palp_odrive_message *m) {
    float q, dq;
    if (!plausible(s, a, i, m, &q, &dq)) {
        s->counters.implausible++;
        if (++a->bad_in_a_row >= PALP_BAD_IN_A_ROW && s->state == PALP_STATE_RUN)
            s->faults |= PALP_FAULT_INPUT;
        return;
    }
    if (a->known && a->age == 0u) s->counters.repeated++; /* two in one tick: the newer wins */
    a->q_rad = q;
    a->dq_rad_s = dq;
    a->age = 0;
    a->bad_in_a_row = 0;
    a->known = true;
}

static void take_frame(palp_servo *s, const palp_can_frame *frame) {
    palp_odrive_message m;
    uint32_t i = 0;
    axis *a = palp_odrive_decode(frame, &m) ? axis_of(s, m.node, &i) : NULL;
    bool ours = a != NULL &&
                (m.command == PALP_ODRIVE_HEARTBEAT || m.command == PALP_ODRIVE_ENCODER_ESTIMATES);
    if (!ours) {
        s->counters.rejected++;
        return;
    }
    s->counters.accepted++;
    if (m.command == PALP_ODRIVE_ENCODER_ESTIMATES) {
        take_estimate(s, a, i, &m);
        return;
    }
    a->drive_state = m.state;
    a->drive_error = m.error;
    a->heartbeat_age = 0;
    a->heard = true;
}

static void take_frames(palp_servo *s, const palp_can_frame *in, uint32_t count) {
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        s->axes[i].age++;
        s->axes[i].heartbeat_age++;
    }
    for (uint32_t i = 0; i < count; i++) take_frame(s, &in[i]);
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        if (s->axes[i].age > 1u && s->state == PALP_STATE_RUN) s->counters.late++;
    }
}

/* ---- state ---- */

static void enter(palp_servo *s, palp_state state) {
    s->state = state;
    s->state_ticks = 0;
    if (state != PALP_STATE_RUN) return;
    palp_bounded_reset(&s->bounded);
    s->output = (palp_output){0};
    s->absorbed_J = 0.0f;
}

static float oldest_estimate_s(const palp_servo *s) {
    uint32_t age = 0;
    for (uint32_t i = 0; i < PALP_AXES; i++) age = s->axes[i].age > age ? s->axes[i].age : age;
    return (float)age * s->dt_s;
}

static void watch_drives(palp_servo *s) {
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        const axis *a = &s->axes[i];
        if (a->drive_error != 0u || a->drive_state != PALP_ODRIVE_CLOSED_LOOP)
            s->faults |= PALP_FAULT_DRIVE;
        if ((float)a->heartbeat_age * s->dt_s > PALP_HEARTBEAT_S) s->faults |= PALP_FAULT_HEARTBEAT;
    }
    if (oldest_estimate_s(s) >= PALP_LOST_S) s->faults |= PALP_FAULT_LOST;
}

/* RUN needs a heartbeat that is younger than the enable sequence, whatever state the drives were
 * found in. */
static void advance_state(palp_servo *s) {
    bool heard = true, ready = true;
    uint32_t settle = (uint32_t)(PALP_SETTLE_S / s->dt_s);
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        const axis *a = &s->axes[i];
        heard = heard && a->heard;
        ready = ready && a->known && a->age <= 1u && a->drive_error == 0u &&
                a->drive_state == PALP_ODRIVE_CLOSED_LOOP &&
                a->heartbeat_age + settle < s->state_ticks;
    }
    if (s->state_ticks < UINT32_MAX / 2u) s->state_ticks++;
    if (s->state == PALP_STATE_INIT && heard) enter(s, PALP_STATE_ENABLING);
    if (s->state == PALP_STATE_ENABLING && ready) enter(s, PALP_STATE_RUN);
    if (s->state == PALP_STATE_RUN) watch_drives(s);
    if (s->faults != 0u && s->state != PALP_STATE_FAULT) enter(s, PALP_STATE_FAULT);
}

/* ---- force ---- */

static palp_vec3 rotate(const float r[9], palp_vec3 v) {
    return (palp_vec3){palp_dot(palp_vec3_at(r), v), palp_dot(palp_vec3_at(r + 3), v),
                       palp_dot(palp_vec3_at(r + 6), v)};
}

static palp_vec3 rotate_back(const float r[9], palp_vec3 v) {
    return (palp_vec3){r[0] * v.x + r[3] * v.y + r[6] * v.z, r[1] * v.x + r[4] * v.y + r[7] * v.z,
                       r[2] * v.x + r[5] * v.y + r[8] * v.z};
}

static float elapsed_ns(const palp_servo *s, uint64_t start) {
    return (float)(s->config.port.now_ns(s->config.port.context) - start);
}

static palp_vec3 feel(palp_servo *s, palp_vec3 tip, palp_report *r) {
    const palp_placement *p = &s->config.placement;
    palp_vec3 device = palp_madd(p->origin_m, p->scale, rotate(p->rotation, tip));
    palp_coupling_result result;
    palp_bounded_report b;
    palp_bounded_tick(&s->bounded, s->start_ns, &device, &result, &b);
    s->counters.dropped = s->bounded.ladder.dropped;
    s->counters.climbed = s->bounded.ladder.climbed;
    r->tool_m = result.tool_m;
    r->stored_J = result.energy_J;
    r->unsettled_m = result.moved_m;
    r->slipping = s->bounded.coupling.spring[0].friction.slipping;
    r->contact_flags = b.flags;
    r->level = b.level;
    r->outer = b.outer;
    r->aborted = b.aborted;
    r->admitted = b.admitted;
    r->deferred = b.deferred;
    r->shortened = b.shortened;
    r->pivots = b.pivots;
    r->candidates = b.candidates;
    r->active = b.active;
    return palp_scale(p->scale, rotate_back(p->rotation, result.force_N));
}

void palp_servo_spare(palp_servo *servo) {
    if (servo->state == PALP_STATE_RUN) palp_bounded_spare(&servo->bounded);
}

/* Full force after the ramp; fading to nothing while encoder values stay away. */
static float gain(const palp_servo *s) {
    float ramp = palp_min((float)s->state_ticks * s->dt_s / PALP_RAMP_S, 1.0f);
    float age = oldest_estimate_s(s);
    float fade =
        age <= PALP_LATE_S ? 1.0f : 1.0f - 2.0f * (age - PALP_LATE_S) / (PALP_LOST_S - PALP_LATE_S);
    return ramp * palp_max(fade, 0.0f);
}

static void run(palp_servo *s, palp_report *r) {
    float q[PALP_AXES];
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        q[i] = s->axes[i].q_rad;
        r->joint_rad[i] = q[i];
    }
    palp_arm_pose pose = palp_arm_forward(&s->config.device.arm, q);
    palp_vec3 rate = {s->axes[0].dq_rad_s, s->axes[1].dq_rad_s, s->axes[2].dq_rad_s};
    r->tip_m = pose.tip_m;
    r->tip_velocity_m_s = rotate(pose.jacobian, rate);
    if (s->state != PALP_STATE_RUN) return;
    /* The force of the last tick acted while the tip moved here. */
    if (s->state_ticks > 1u) {
        s->absorbed_J -= palp_dot(s->output.last_N, palp_sub(pose.tip_m, s->last_tip_m));
    }
    s->last_tip_m = pose.tip_m;
    palp_vec3 wanted = palp_scale(gain(s), feel(s, pose.tip_m, r));
    palp_output_result out =
        palp_output_apply(&s->output, &s->config.device, &pose, wanted, s->dt_s);
    if (out.bad) {
        s->faults |= PALP_FAULT_OUTPUT;
        enter(s, PALP_STATE_FAULT);
    }
    if (out.limited || out.slewed) s->counters.limited++;
    if (r->shortened) s->counters.shortened++;
    r->force_N = out.force_N;
    for (uint32_t i = 0; i < PALP_AXES; i++) r->motor_torque_Nm[i] = out.motor_torque_Nm[i];
}

/* ---- out ---- */

static uint32_t send_to_all(const palp_servo *s, palp_odrive_message m, palp_can_frame *out,
                            uint32_t at) {
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        m.node = s->config.device.node_id[i];
        out[at++] = palp_odrive_encode(&m);
    }
    return at;
}

static uint32_t send_frames(const palp_servo *s, const palp_report *r, palp_can_frame *out) {
    uint32_t every = (uint32_t)(ENABLE_EVERY_S / s->dt_s) + 1u;
    uint32_t n = 0;
    if (s->state == PALP_STATE_ENABLING &&
        s->state_ticks % every == 0u) { /* the first time at once */
        n = send_to_all(s,
                        (palp_odrive_message){.command = PALP_ODRIVE_SET_CONTROLLER_MODE,
                                              .control_mode = PALP_ODRIVE_TORQUE_CONTROL,
                                              .input_mode = PALP_ODRIVE_PASSTHROUGH},
                        out, n);
        n = send_to_all(s, (palp_odrive_message){.command = PALP_ODRIVE_CLEAR_ERRORS}, out, n);
        n = send_to_all(s,
                        (palp_odrive_message){.command = PALP_ODRIVE_SET_AXIS_STATE,
                                              .state = PALP_ODRIVE_CLOSED_LOOP},
                        out, n);
    }
    if (s->state == PALP_STATE_FAULT && s->state_ticks % every == 0u) {
        n = send_to_all(
            s,
            (palp_odrive_message){.command = PALP_ODRIVE_SET_AXIS_STATE, .state = PALP_ODRIVE_IDLE},
            out, n);
    }
    if (s->state != PALP_STATE_INIT) { /* zero but in RUN, so that no old set-point acts */
        for (uint32_t i = 0; i < PALP_AXES; i++) {
            palp_odrive_message m = {.command = PALP_ODRIVE_SET_INPUT_TORQUE,
                                     .node = s->config.device.node_id[i],
                                     .torque_Nm =
                                         s->state == PALP_STATE_RUN ? r->motor_torque_Nm[i] : 0.0f};
            out[n++] = palp_odrive_encode(&m);
        }
    }
    return n;
}

void palp_servo_skip(palp_servo *servo, uint32_t periods) {
    servo->counters.skipped += periods;
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        servo->axes[i].age += periods;
        servo->axes[i].heartbeat_age += periods;
    }
    if (servo->state == PALP_STATE_RUN) watch_drives(servo);
}

void palp_servo_bus_failed(palp_servo *servo) { servo->faults |= PALP_FAULT_BUS; }

uint32_t palp_servo_tick(palp_servo *servo, const palp_can_frame *in, uint32_t in_count,
                         palp_can_frame *out, palp_report *report) {
    palp_servo *s = servo;
    s->start_ns = s->config.port.now_ns(s->config.port.context);
    palp_report r = {.tick = s->counters.ticks++,
                     .level = palp_ladder_contact(&s->bounded.ladder)->level,
                     .outer = palp_ladder_contact(&s->bounded.ladder)->outer};
    r.bound_ns =
        palp_cost_full(&s->bounded.bound, s->config.limits) * s->config.cost.ns_per_operation;
    take_frames(s, in, in_count);
    advance_state(s);
    run(s, &r);
    uint32_t n = send_frames(s, &r, out);
    r.state = s->state;
    r.faults = s->faults;
    r.absorbed_J = s->absorbed_J;
    r.elapsed_ns = elapsed_ns(s, s->start_ns);
    if (r.elapsed_ns > NS_PER_S * s->dt_s) s->counters.overruns++;
    *report = r;
    return n;
}
