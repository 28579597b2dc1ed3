/* SPDX-License-Identifier: MIT */
#include "servo.h"
#include "core/base/frame.h"

#define NS_PER_S 1e9f
#define SINGULAR 0.05f /* conditioning at which the force is gone; it fades from twice that */
#define OUTSIDE 1.25f  /* workspace radii at which it begins to fade, over a quarter radius */
#define SOFTEST 4e-7f  /* of the body's stiffness that single precision can tell from it */

struct palp_servo {
    const palp_blob *blob;
    palp_servo_config config;
    palp_bounded bounded;
    palp_output output;
    palp_passivity_config passive;
    palp_counters counters;
    palp_device_axes axes;
    palp_safety safety;
    palp_axes_health health; /* after the frames of this tick */
    float dt_s, bound_ns;
    uint64_t start_ns; /* of the tick under way */
    palp_vec3 last_tip_m;
    bool moved; /* last_tip_m belongs to a force that was sent */
};

static palp_servo *lay_out(const palp_blob *b, palp_node_contact_limits l, palp_arena *arena,
                           void **bounded_memory) {
    palp_servo *s = palp_take(arena, 1, sizeof *s);
    *bounded_memory = palp_take(arena, palp_bounded_memsize(b, l), 1);
    return s;
}

size_t palp_servo_memsize(const palp_blob *blob, palp_node_contact_limits limits) {
    palp_arena arena = {0};
    void *bounded_memory;
    if (!palp_node_contact_limits_sound(limits)) return 0;
    (void)lay_out(blob, limits, &arena, &bounded_memory);
    return arena.used;
}

static bool config_is_sound(const palp_servo_config *c) {
    float rate_hz = c->device.drives.rate_hz;
    return palp_device_is_sound(&c->device) && palp_tool_is_sound(&c->tool) && rate_hz >= 49.0f &&
           rate_hz <= 20001.0f && c->placement.scale > 0.0f && palp_cost_table_is_sound(&c->cost) &&
           c->port.now_ns != NULL;
}

palp_status palp_servo_open(palp_servo **servo, const palp_blob *blob,
                            const palp_servo_config *config, void *memory, size_t bytes,
                            float *bound_ns) {
    palp_arena arena = {.base = memory};
    void *bounded_memory;
    if (!palp_node_contact_limits_sound(config->limits)) return PALP_ERR_LIMITS;
    if (!config_is_sound(config)) return PALP_ERR_ARGUMENT;
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (bytes < palp_servo_memsize(blob, config->limits)) return PALP_ERR_MEMORY;
    palp_servo *s = lay_out(blob, config->limits, &arena, &bounded_memory);
    const palp_device *device = &config->device;
    *s = (palp_servo){.blob = blob, .config = *config, .dt_s = 1.0f / device->drives.rate_hz};
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
    bool chosen = config->coupling_N_per_m > 0.0f;
    float wanted = chosen ? config->coupling_N_per_m : palp_device_coupling(device);
    float k = palp_min(wanted, palp_device_stiffest(device));
    float b = chosen ? config->coupling_Ns_per_m : device->damping_max_Ns_per_m;
    spring->stiffness_N_per_m =
        palp_max(k / (scale * scale), SOFTEST * blob->meta->stiffness_max_N_per_m);
    spring->damping_Ns_per_m = b / (scale * scale);
    s->passive = palp_passivity_configure(device->damping_Ns_per_m, palp_device_brake(device),
                                          palp_drive_delay(device->drives.protocol), s->dt_s,
                                          device->drives.torque_lag_s);
    const palp_ladder *ladder = &s->bounded.ladder;
    for (uint32_t r = 0; r < ladder->rungs; r++)
        s->bound_ns = palp_max(s->bound_ns, palp_cost_full(&s->bounded.bound, ladder->at[r]));
    palp_axes_init(&s->axes, device);
    palp_safety_init(&s->safety, s->dt_s, palp_drive_heartbeat_s(device->drives.protocol),
                     config->resume);
    *servo = s;
    return PALP_OK;
}

const palp_counters *palp_servo_counters(const palp_servo *servo) { return &servo->counters; }

uint32_t palp_servo_loads(const palp_servo *servo, palp_load *load) {
    const palp_node_contact *c = &servo->bounded.ladder.contact[servo->bounded.ladder.now];
    const palp_node_friction *f = &servo->bounded.coupling.spring[0].friction;
    palp_vec3 resultant;
    float total = palp_node_contact_normal_force(c, 0, &resultant);
    for (uint32_t a = 0; a < c->active_count; a++) {
        const palp_candidate *k = &c->candidate[c->active[a]];
        palp_vec3 force = palp_scale(-k->force_N, k->n);
        if (total > 0.0f) force = palp_madd(force, -k->force_N / total, f->force_N);
        load[a] = (palp_load){.at = {k->level, k->slot}, .force_N = force};
    }
    return c->active_count;
}

/* ---- state ---- */

static void count_events(palp_counters *c, uint32_t events) {
    const uint32_t bus = PALP_EVENT_BUS_OFF | PALP_EVENT_BUS_FULL | PALP_EVENT_BUS_DOWN;
    c->tardy += (events & PALP_EVENT_LATE) != 0u ? 1u : 0u;
    c->bus_faults += (events & bus) != 0u ? 1u : 0u;
    c->bus_warnings += (events & PALP_EVENT_BUS_WARNING) != 0u ? 1u : 0u;
    c->overflows += (events & PALP_EVENT_OVERFLOW) != 0u ? 1u : 0u;
}

/* Frames in, and what they mean for the state. */
static void take_in(palp_servo *s, const palp_tick_input *in) {
    palp_state before = s->safety.state;
    bool force = before == PALP_STATE_RUN || before == PALP_STATE_DAMPING;
    uint32_t periods = in->skipped < UINT32_MAX ? in->skipped + 1u : in->skipped;
    s->counters.skipped += in->skipped;
    count_events(&s->counters, in->events);
    palp_axes_take(&s->axes, &s->config.device, periods, in->frames, in->count, force,
                   &s->counters);
    s->health = palp_axes_look(&s->axes);
    if ((float)s->health.frozen * s->dt_s >= 0.5f * PALP_FROZEN_S) s->counters.frozen++;
    if (palp_safety_tick(&s->safety, in->events, periods, &s->health)) {
        s->counters.resets++;
        palp_axes_forget(&s->axes);
    }
    if (s->safety.state == PALP_STATE_RUN && before != PALP_STATE_RUN) {
        palp_bounded_reset(&s->bounded);
        s->output = (palp_output){.last_N = {0.0f, 0.0f, 0.0f}};
        s->moved = false;
    }
}

/* ---- force ---- */

static palp_vec3 feel(palp_servo *s, palp_vec3 tip, palp_report *r) {
    const palp_placement *p = &s->config.placement;
    palp_vec3 device = palp_madd(p->origin_m, p->scale, palp_rotate(p->rotation, tip));
    palp_node_coupling_result result;
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
    return palp_scale(p->scale, palp_rotate_back(p->rotation, result.force_N));
}

void palp_servo_spare(palp_servo *servo) {
    if (servo->safety.state == PALP_STATE_RUN) palp_bounded_spare(&servo->bounded);
}

/* Fades near singular poses and beyond the workspace. */
static float reach_gain(palp_servo *s, const palp_pose *pose) {
    float radius = s->config.device.workspace_radius_m;
    float inside = 1.0f - (palp_norm(pose->tip_m) / radius - OUTSIDE) * 4.0f;
    float sound = pose->conditioning / SINGULAR - 1.0f;
    float gain = palp_clamp(palp_min(inside, sound), 0.0f, 1.0f);
    if (gain < 1.0f) s->counters.outside++;
    return gain;
}

/* The force of RUN, or of DAMPING: what is left of the contact, and a brake. */
static palp_vec3 wanted_force(palp_servo *s, const palp_pose *pose, palp_report *r) {
    float gain = palp_safety_gain(&s->safety) * reach_gain(s, pose);
    palp_vec3 force = {0.0f, 0.0f, 0.0f};
    if (gain > 0.0f || s->safety.state == PALP_STATE_RUN) {
        force = palp_scale(gain, feel(s, pose->tip_m, r));
        r->stored_J *= gain;
    }
    if (s->safety.state == PALP_STATE_RUN) return force;
    bool fresh = s->health.age == 0u;
    float brake = fresh ? s->config.device.damping_max_Ns_per_m : 0.0f;
    return palp_madd(force, -brake, r->tip_velocity_m_s);
}

static void run(palp_servo *s, const palp_tick_input *in, palp_report *r) {
    for (uint32_t i = 0; i < s->axes.count; i++) {
        r->joint_rad[i] = s->axes.joint[i].q_rad;
        r->joint_rad_s[i] = s->axes.joint[i].dq_rad_s;
    }
    palp_pose pose = palp_forward(&s->config.device.kinematics, r->joint_rad);
    r->tip_m = pose.tip_m;
    r->tip_velocity_m_s = palp_pose_velocity(&pose, r->joint_rad_s);
    if (palp_safety_demand(s->safety.state) != PALP_DEMAND_TORQUE) return;
    if (!pose.reachable) {
        palp_safety_latch(&s->safety, PALP_FAULT_INPUT);
        return;
    }
    if (s->moved)
        palp_passivity_observe(&s->output.passivity, &s->passive,
                               palp_sub(pose.tip_m, s->last_tip_m));
    s->last_tip_m = pose.tip_m;
    s->moved = true;
    /* What holds the mechanism up comes and goes with the force; friction is only followed by who
     * knows the velocity, and never against the brake of DAMPING. */
    bool fresh = s->health.age == 0u && s->safety.state == PALP_STATE_RUN;
    float gain = palp_safety_gain(&s->safety);
    palp_vec3 force = wanted_force(s, &pose, r);
    palp_output_demand demand = {
        .force_N = force, .stored_J = r->stored_J, .lift = gain, .friction = fresh ? gain : 0.0f};
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        demand.dq_rad_s[i] = r->joint_rad_s[i];
        demand.feedforward_Nm[i] = in->feedforward_Nm[i];
    }
    palp_output_result out =
        palp_output_apply(&s->output, &s->config.device, s->config.unguarded ? NULL : &s->passive,
                          &pose, &demand, s->dt_s);
    if (out.bad) palp_safety_latch(&s->safety, PALP_FAULT_OUTPUT);
    if (out.limited || out.slewed) s->counters.limited++;
    if (out.braked) s->counters.braked++;
    if (r->shortened) s->counters.shortened++;
    r->braked = out.braked;
    r->force_N = out.force_N;
    r->absorbed_J = s->output.passivity.absorbed_J;
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        r->motor_torque_Nm[i] = out.motor_torque_Nm[i];
        s->axes.push_Nm[i] = out.touch_torque_Nm[i];
    }
}

uint32_t palp_servo_tick(palp_servo *servo, const palp_tick_input *input, palp_can_frame *out,
                         palp_report *report) {
    palp_servo *s = servo;
    s->start_ns = s->config.port.now_ns(s->config.port.context);
    palp_report r = {.tick = s->counters.ticks++,
                     .bound_ns = s->bound_ns,
                     .level = palp_ladder_contact(&s->bounded.ladder)->level,
                     .outer = palp_ladder_contact(&s->bounded.ladder)->outer};
    take_in(s, input);
    run(s, input, &r);
    uint32_t n = palp_axes_send(&s->axes, &s->config.device, palp_safety_demand(s->safety.state),
                                r.motor_torque_Nm, r.tick, out);
    r.state = s->safety.state;
    r.faults = s->safety.faults;
    r.elapsed_ns = (float)(s->config.port.now_ns(s->config.port.context) - s->start_ns);
    if (r.elapsed_ns > NS_PER_S * s->dt_s) s->counters.overruns++;
    *report = r;
    return n;
}
