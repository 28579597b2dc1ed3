/* SPDX-License-Identifier: MIT */
#include "servo.h"
#include "core/base/frame.h"

#define NS_PER_S 1e9f
#define SINGULAR 0.05f /* conditioning at which the force is gone; it fades from twice that */
#define OUTSIDE 1.25f  /* workspace radii at which it begins to fade, over a quarter radius */

struct palp_servo {
    const palp_blob *blob;
    palp_servo_config config;
    palp_answer answer;
    palp_output output;
    palp_passivity_config passive;
    palp_counters counters;
    palp_device_axes axes;
    palp_safety safety;
    palp_axes_health health; /* after the frames of this tick */
    float dt_s, bound_ns;
    uint64_t start_ns;              /* of the tick under way */
    uint32_t periods;               /* since the tick before it */
    bool seen;                      /* all joints are where they were read in this tick */
    float certain_rad_s[PALP_AXES]; /* of the joints: 0 for one that is not seen any more */
    palp_vec3 certain_m_s;          /* of the tip */
    palp_vec3 certain_turn_rad_s;   /* of the tool's turn */
    palp_vec3 unfelt_Nm;            /* moment of the last tick that no motor made */
    float r[9];                     /* of the tool, in the last tick */
    bool turned;                    /* that is known */
};

PALP_STATIC_ASSERT(sizeof(palp_servo) <= PALP_SERVO_OBJECT, "PALP_SERVO_BYTES");

static palp_servo *lay_out(const palp_blob *b, uint32_t finest, palp_arena *arena,
                           void **answer_memory) {
    palp_servo *s = palp_take(arena, 1, sizeof *s);
    *answer_memory = palp_take(
        arena,
        palp_answer_memsize(&(palp_contact_config){.blob = b, .tool_count = 1, .finest = finest}),
        1);
    return s;
}

size_t palp_servo_memsize(const palp_blob *blob, uint32_t finest) {
    palp_arena arena = {0};
    void *answer_memory;
    if (blob->regular.modes == 0u || finest >= PALP_CONTACT_LEVELS) return 0;
    (void)lay_out(blob, finest, &arena, &answer_memory);
    return arena.used;
}

static bool config_is_sound(const palp_servo_config *c) {
    float rate_hz = c->device.drives.rate_hz;
    const palp_placement *p = &c->placement;
    const bool placed = p->scale > 0.0f && palp_is_finite(p->scale) &&
                        palp_vec3_is_finite(p->origin_m) && palp_is_rotation(p->rotation);
    const bool coupled = palp_is_finite(c->coupling_N_per_m) && c->coupling_N_per_m >= 0.0f &&
                         palp_is_finite(c->coupling_Ns_per_m) && c->coupling_Ns_per_m >= 0.0f;
    return palp_device_is_sound(&c->device) && palp_tool_is_sound(&c->tool) && rate_hz >= 49.0f &&
           rate_hz <= 20001.0f && placed && coupled && palp_cost_table_is_sound(&c->cost) &&
           c->port.now_ns != NULL;
}

/* Device stiffness k becomes k / scale^2 in the model, where lengths grow and forces shrink by
 * scale. */
static void set_coupling(palp_coupling_tool *spring, const palp_servo_config *c) {
    float scale = c->placement.scale;
    bool chosen = c->coupling_N_per_m > 0.0f;
    float wanted = chosen ? c->coupling_N_per_m : palp_device_coupling(&c->device);
    float k = palp_min(wanted, palp_device_stiffest(&c->device));
    float b = chosen ? c->coupling_Ns_per_m : c->device.damping_max_Ns_per_m;
    spring->stiffness_N_per_m = k / (scale * scale);
    spring->damping_Ns_per_m = b / (scale * scale);
    if (!palp_device_turns(&c->device)) return;
    spring->stiffness_Nm_per_rad = c->device.stiffness_max_Nm_per_rad;
    spring->damping_Nms_per_rad = c->device.damping_max_Nms_per_rad;
}

float palp_servo_cost_before(const palp_prices *price) {
    return palp_servo_cost_after(price) + (float)PALP_SERVO_FRAMES_IN * price->of[PALP_WORK_FRAME];
}

float palp_servo_cost_after(const palp_prices *price) { return 0.5f * price->of[PALP_WORK_SERVO]; }

palp_status palp_servo_open(palp_servo **servo, const palp_blob *blob,
                            const palp_servo_config *config, void *memory, size_t bytes,
                            float *bound_ns) {
    palp_arena arena = {.base = memory};
    void *answer_memory;
    if (blob->regular.modes == 0u) return PALP_ERR_ABSENT;
    if (config->finest >= PALP_CONTACT_LEVELS) return PALP_ERR_LIMITS;
    if (!config_is_sound(config)) return PALP_ERR_ARGUMENT;
    palp_status status = palp_check_block(memory, bytes, palp_servo_memsize(blob, config->finest));
    if (status != PALP_OK) return status;
    palp_servo *s = lay_out(blob, config->finest, &arena, &answer_memory);
    const palp_device *device = &config->device;
    const palp_prices ns = palp_prices_of(&config->cost);
    *s = (palp_servo){.blob = blob, .config = *config, .dt_s = 1.0f / device->drives.rate_hz};
    const palp_answer_config answer = {.contact = {.blob = blob,
                                                   .tools = &s->config.tool,
                                                   .tool_count = 1,
                                                   .finest = config->finest},
                                       .cost = config->cost,
                                       .port = config->port,
                                       .dt_s = s->dt_s,
                                       .before_ns = palp_servo_cost_before(&ns),
                                       .after_ns = palp_servo_cost_after(&ns)};
    status = palp_answer_init(&s->answer, &answer, answer_memory,
                              palp_answer_memsize(&answer.contact), bound_ns);
    if (status != PALP_OK) return status;
    set_coupling(&s->answer.coupling.tool[0], &s->config);
    s->passive = palp_passivity_configure(palp_axes(&device->kinematics), device->damping_Ns_per_m,
                                          palp_drive_delay(device->drives.protocol), s->dt_s,
                                          device->drives.torque_lag_s);
    s->bound_ns = answer.before_ns + answer.after_ns +
                  palp_answer_cost_full(&s->answer.bound, s->answer.limit);
    palp_axes_init(&s->axes, device);
    for (uint32_t i = 0; i < s->axes.count; i++)
        s->passive.step_rad[i] = s->axes.limits[i].step_rad;
    palp_safety_init(&s->safety, s->dt_s, palp_drive_heartbeat_s(device->drives.protocol),
                     config->resume);
    *servo = s;
    return PALP_OK;
}

const palp_counters *palp_servo_counters(const palp_servo *servo) { return &servo->counters; }

palp_drive_trouble palp_servo_trouble(const palp_servo *servo, uint32_t axis) {
    if (axis >= servo->axes.count) return (palp_drive_trouble){.kind = PALP_TROUBLE_NONE};
    return palp_drive_trouble_of(&servo->axes.drive[axis], &servo->config.device.drives);
}

uint32_t palp_servo_loads(const palp_servo *servo, palp_load *load) {
    const palp_answer *a = &servo->answer;
    palp_load_list list = {.load = load, .capacity = PALP_SERVO_LOADS};
    palp_contact_loads(&a->contact, 0, 0, a->coupling.tool[0].friction.force_N, &list);
    return list.count;
}

/* ---- state ---- */

static void count_events(palp_counters *c, uint32_t events) {
    const uint32_t bus = PALP_EVENT_BUS_OFF | PALP_EVENT_BUS_FULL | PALP_EVENT_BUS_DOWN;
    c->tardy += (events & PALP_EVENT_LATE) != 0u ? 1u : 0u;
    c->bus_faults += (events & bus) != 0u ? 1u : 0u;
    c->bus_warnings += (events & PALP_EVENT_BUS_WARNING) != 0u ? 1u : 0u;
    c->overflows += (events & PALP_EVENT_OVERFLOW) != 0u ? 1u : 0u;
}

static void apply_safety_step(palp_servo *s, palp_safety_step step) {
    if (step == PALP_SAFETY_HOME) palp_axes_home(&s->axes, &s->config.device);
    if (step == PALP_SAFETY_NOTHING || step == PALP_SAFETY_HOME) return;
    s->counters.resets++;
    palp_axes_forget(&s->axes);
    if (step == PALP_SAFETY_PROBE_UNHOME) palp_axes_unhome(&s->axes, &s->config.device);
}

/* Frames in, and what they mean for the state. */
static void take_in(palp_servo *s, const palp_tick_input *in) {
    palp_state before = s->safety.state;
    bool force = before == PALP_STATE_RUN || before == PALP_STATE_DAMPING;
    const uint32_t periods = in->skipped < UINT32_MAX ? in->skipped + 1u : in->skipped;
    s->periods = periods;
    s->counters.skipped += in->skipped;
    count_events(&s->counters, in->events);
    const uint32_t frames = in->count < PALP_SERVO_FRAMES_IN ? in->count : PALP_SERVO_FRAMES_IN;
    const uint32_t dropped = in->count - frames;
    s->counters.overflows += dropped;
    const palp_axes_input read = {.frames = dropped > 0u ? in->frames + dropped : in->frames,
                                  .count = frames,
                                  .periods = periods,
                                  .strict = force};
    palp_axes_take(&s->axes, &s->config.device, &read, &s->counters);
    s->health = palp_axes_check(&s->axes);
    if (force && (float)s->health.frozen * s->dt_s >= 0.5f * PALP_FROZEN_S) s->counters.frozen++;
    apply_safety_step(s, palp_safety_tick(&s->safety, in->events, periods, &s->health));
    if (s->safety.state == PALP_STATE_RUN && before != PALP_STATE_RUN) {
        palp_answer_reset(&s->answer);
        s->output = (palp_output){.last_N = {0.0f, 0.0f, 0.0f}};
        s->unfelt_Nm = (palp_vec3){0.0f, 0.0f, 0.0f};
        s->turned = false;
    }
}

/* ---- force ---- */

/* Where a pose of the device is in the model. */
static palp_frame placed(const palp_placement *p, const palp_pose *pose) {
    palp_frame turned = {.t = {0.0f, 0.0f, 0.0f}}, of_tool = turned;
    for (uint32_t e = 0; e < 9u; e++) {
        turned.r[e] = p->rotation[e];
        of_tool.r[e] = pose->r[e];
    }
    palp_frame f = palp_frame_compose(&turned, &of_tool);
    f.t = palp_madd(p->origin_m, p->scale, palp_rotate(p->rotation, pose->tip_m));
    return f;
}

/* What the hand is to feel of the body, at the tip. */
static palp_wrench feel(palp_servo *s, const palp_pose *pose, palp_report *r, float *damped_W) {
    const palp_placement *p = &s->config.placement;
    const palp_frame device = placed(p, pose);
    palp_coupling_tool *spring = &s->answer.coupling.tool[0];
    palp_coupling_result result;
    palp_answer_report a;
    spring->velocity_m_s = palp_scale(p->scale, palp_rotate(p->rotation, s->certain_m_s));
    spring->velocity_rad_s = palp_rotate(p->rotation, s->certain_turn_rad_s);
    spring->measured = true;
    palp_answer_tick(&s->answer, s->start_ns, &device, &result, &a);
    s->counters.coarsened = s->answer.coarsened;
    s->counters.refined = s->answer.refined;
    s->counters.held = s->answer.held;
    *damped_W = result.damped_W;
    r->tool = result.tool;
    r->stored_J = result.energy_J;
    r->unforeseen_m = result.moved_m;
    r->slipping = s->answer.coupling.tool[0].friction.slipping;
    r->contact_flags = a.flags;
    r->level = a.level;
    r->points = a.points;
    r->active = a.active;
    r->iterations = a.iterations;
    r->doubt_N = p->scale * a.doubt_N;
    r->held = a.held;
    r->shortened = a.shortened;
    return (palp_wrench){palp_scale(p->scale, palp_rotate_back(p->rotation, result.force_N)),
                         palp_rotate_back(p->rotation, result.moment_Nm)};
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
static palp_wrench wanted_force(palp_servo *s, const palp_pose *pose, palp_report *r,
                                float *damped_W) {
    float gain = palp_safety_gain(&s->safety) * reach_gain(s, pose);
    palp_wrench w = {.force_N = {0.0f, 0.0f, 0.0f}};
    if (gain > 0.0f || s->safety.state == PALP_STATE_RUN) {
        w = feel(s, pose, r, damped_W);
        r->contact_moment_Nm = w.moment_Nm;
        w = (palp_wrench){palp_scale(gain, w.force_N), palp_scale(gain, w.moment_Nm)};
        r->stored_J *= gain;
    }
    if (s->safety.state == PALP_STATE_RUN) return w;
    w.force_N = palp_madd(w.force_N, -s->config.device.damping_max_Ns_per_m, s->certain_m_s);
    w.moment_Nm =
        palp_madd(w.moment_Nm, -s->config.device.damping_max_Nms_per_rad, s->certain_turn_rad_s);
    return w;
}

/* Where the joints are taken to be, and how fast. */
static palp_pose read_pose(palp_servo *s, palp_report *r) {
    float believed_rad[PALP_AXES] = {0.0f};
    s->seen = true;
    for (uint32_t i = 0; i < s->axes.count; i++) {
        const palp_joint *j = &s->axes.joint[i];
        const bool known = j->age <= PALP_JOINT_FORESEEN;
        s->seen = s->seen && j->age == 0u && !(palp_abs(j->shift_rad) > 0.0f);
        r->joint_rad[i] = believed_rad[i] = j->believed_rad;
        r->joint_rad_s[i] = j->dq_rad_s;
        s->certain_rad_s[i] = known ? j->certain_rad_s : 0.0f;
    }
    const palp_pose pose = palp_forward(&s->config.device.kinematics, believed_rad);
    r->tip_m = pose.tip_m;
    for (uint32_t e = 0; e < 9u; e++) r->tip_r[e] = pose.r[e];
    r->tip_velocity_m_s = palp_pose_velocity(&pose, r->joint_rad_s);
    s->certain_m_s = palp_pose_velocity(&pose, s->certain_rad_s);
    s->certain_turn_rad_s = palp_pose_turning(&pose, s->certain_rad_s);
    return pose;
}

/* What the hand has put in by turning the tool against what it does not feel. */
static float unfelt_J(palp_servo *s, const palp_pose *pose) {
    const float work =
        s->turned ? -palp_dot(s->unfelt_Nm, palp_turn_between(s->r, pose->r)) : 0.0f;
    for (uint32_t e = 0; e < 9u; e++) s->r[e] = pose->r[e];
    s->turned = true;
    return work;
}

/* Tells the passivity observer what the encoders say. */
static void observe(palp_servo *s, const palp_pose *pose) {
    palp_passivity_motion m = {.periods = s->periods,
                               .certain_m_s = s->certain_m_s,
                               .certain_turn_rad_s = s->certain_turn_rad_s,
                               .unfelt_J = unfelt_J(s, pose)};
    for (uint32_t i = 0; i < s->axes.count; i++) {
        m.q_rad[i] = s->axes.joint[i].q_rad;
        m.certain_rad_s[i] = s->certain_rad_s[i];
        m.fresh[i] = s->axes.joint[i].age == 0u;
    }
    palp_passivity_observe(&s->output.passivity, &s->passive, &m);
}

static void run(palp_servo *s, const palp_tick_input *in, palp_report *r) {
    const palp_pose pose = read_pose(s, r);
    if (palp_safety_request(s->safety.state) != PALP_REQUEST_TORQUE) return;
    if (!pose.reachable) {
        palp_safety_latch(&s->safety, PALP_FAULT_INPUT);
        return;
    }
    observe(s, &pose);
    /* Gravity compensation fades with the force. Friction is compensated only while the velocity is
     * known, and never against the brake of DAMPING. */
    bool fresh = s->health.age == 0u && s->safety.state == PALP_STATE_RUN;
    float gain = palp_safety_gain(&s->safety);
    float damped_W = 0.0f;
    const palp_wrench wanted = wanted_force(s, &pose, r, &damped_W);
    palp_output_request request = {.force_N = wanted.force_N,
                                   .moment_Nm = wanted.moment_Nm,
                                   .stored_J = r->stored_J,
                                   .damped_W = damped_W,
                                   .steady = gain >= 1.0f && s->seen,
                                   .gravity_share = gain,
                                   .friction_share = fresh ? gain : 0.0f};
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        request.dq_rad_s[i] = r->joint_rad_s[i];
        request.feedforward_Nm[i] = in->feedforward_Nm[i];
    }
    palp_output_result out =
        palp_output_apply(&s->output, &s->config.device, s->config.unguarded ? NULL : &s->passive,
                          &pose, &request, s->dt_s);
    if (out.bad) palp_safety_latch(&s->safety, PALP_FAULT_OUTPUT);
    if (out.limited || out.slewed) s->counters.limited++;
    if (out.braked) s->counters.braked++;
    if (r->shortened) s->counters.shortened++;
    r->braked = out.braked;
    r->force_N = out.force_N;
    r->moment_Nm = out.moment_Nm;
    s->unfelt_Nm = palp_sub(r->contact_moment_Nm, out.moment_Nm);
    r->absorbed_J = s->output.passivity.absorbed_J;
    r->given_J = s->output.passivity.given_J;
    if (!s->config.unguarded && palp_passivity_exceeded(&s->output.passivity, &s->passive))
        palp_safety_latch(&s->safety, PALP_FAULT_ENERGY);
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        r->motor_torque_Nm[i] = out.motor_torque_Nm[i];
        s->axes.contact_torque_Nm[i] = out.contact_torque_Nm[i];
    }
}

uint32_t palp_servo_tick(palp_servo *s, const palp_tick_input *input, palp_can_frame *out,
                         palp_report *r) {
    s->start_ns = s->config.port.now_ns(s->config.port.context);
    *r = (palp_report){.tick = s->counters.ticks++,
                       .bound_ns = s->bound_ns,
                       .level = s->answer.contact.now,
                       .limit = s->answer.limit};
    take_in(s, input);
    run(s, input, r);
    uint32_t n = palp_axes_send(&s->axes, &s->config.device, palp_safety_request(s->safety.state),
                                r->motor_torque_Nm, r->tick, out);
    r->state = s->safety.state;
    r->faults = s->safety.faults;
    r->elapsed_ns = (float)(s->config.port.now_ns(s->config.port.context) - s->start_ns);
    if (r->elapsed_ns > NS_PER_S * s->dt_s) s->counters.overruns++;
    return n;
}
