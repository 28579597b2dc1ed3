/* SPDX-License-Identifier: MIT */
#include "core/servo/hand.h"

#define SINGULAR 0.05f /* conditioning at which the force is gone; it fades from twice that */
#define OUTSIDE 1.25f  /* workspace radii at which it begins to fade, over a quarter radius */

float palp_servo_cost_before(const palp_prices *price, const palp_device *device) {
    const uint32_t bytes =
        device == NULL ? PALP_CAN_MAX_DATA : palp_drive_frame_bytes(&device->drives);
    return palp_servo_cost_after(price, device) +
           (float)PALP_SERVO_FRAMES_IN *
               (price->of[PALP_WORK_FRAME] + (float)bytes * price->of[PALP_WORK_FRAME_BYTE]);
}

float palp_servo_cost_after(const palp_prices *price, const palp_device *device) {
    const uint32_t axes = device == NULL ? PALP_AXES : palp_axes(&device->kinematics);
    return 0.5f * (price->of[PALP_WORK_SERVO] + (float)axes * price->of[PALP_WORK_AXIS]);
}

bool palp_hand_config_is_sound(const palp_hand_config *c) {
    float rate_hz = c->device.drives.rate_hz;
    const palp_placement *p = &c->placement;
    const bool placed = p->scale > 0.0f && palp_is_finite(p->scale) &&
                        palp_vec3_is_finite(p->origin_m) && palp_is_rotation(p->rotation);
    const bool coupled = palp_is_finite(c->coupling_N_per_m) && c->coupling_N_per_m >= 0.0f &&
                         palp_is_finite(c->coupling_Ns_per_m) && c->coupling_Ns_per_m >= 0.0f;
    return palp_device_is_sound(&c->device) && rate_hz >= 49.0f && rate_hz <= 20001.0f && placed &&
           coupled;
}

palp_hand_spring palp_hand_spring_of(const palp_hand_config *c) {
    const float scale2 = c->placement.scale * c->placement.scale;
    const bool chosen = c->coupling_N_per_m > 0.0f, turns = palp_device_turns(&c->device);
    const float wanted = chosen ? c->coupling_N_per_m : palp_device_coupling(&c->device);
    const float b = chosen ? c->coupling_Ns_per_m : c->device.damping_max_Ns_per_m;
    return (palp_hand_spring){.N_per_m =
                                  palp_min(wanted, palp_device_stiffest(&c->device)) / scale2,
                              .Ns_per_m = b / scale2,
                              .Nm_per_rad = turns ? c->device.stiffness_max_Nm_per_rad : 0.0f,
                              .Nms_per_rad = turns ? c->device.damping_max_Nms_per_rad : 0.0f};
}

void palp_hand_init(palp_hand *h, const palp_hand_config *config) {
    const palp_device *device = &config->device;
    *h = (palp_hand){.config = *config, .dt_s = 1.0f / device->drives.rate_hz};
    h->passive = palp_passivity_configure(palp_axes(&device->kinematics), device->damping_Ns_per_m,
                                          palp_drive_delay(device->drives.protocol), h->dt_s,
                                          device->drives.torque_lag_s);
    palp_axes_init(&h->axes, device);
    for (uint32_t i = 0; i < h->axes.count; i++)
        h->passive.step_rad[i] = h->axes.limits[i].step_rad;
    palp_safety_init(&h->safety, h->dt_s, palp_drive_heartbeat_s(device->drives.protocol),
                     config->resume);
}

/* ---- state ---- */

static void count_events(palp_counters *c, uint32_t events) {
    const uint32_t bus = PALP_EVENT_BUS_OFF | PALP_EVENT_BUS_FULL | PALP_EVENT_BUS_DOWN;
    c->tardy += (events & PALP_EVENT_LATE) != 0u ? 1u : 0u;
    c->bus_faults += (events & bus) != 0u ? 1u : 0u;
    c->bus_warnings += (events & PALP_EVENT_BUS_WARNING) != 0u ? 1u : 0u;
    c->overflows += (events & PALP_EVENT_OVERFLOW) != 0u ? 1u : 0u;
}

static void apply_safety_step(palp_hand *h, palp_safety_step step) {
    if (step == PALP_SAFETY_HOME) palp_axes_home(&h->axes, &h->config.device);
    if (step == PALP_SAFETY_NOTHING || step == PALP_SAFETY_HOME) return;
    h->counters.resets++;
    palp_axes_forget(&h->axes);
    if (step == PALP_SAFETY_PROBE_UNHOME) palp_axes_unhome(&h->axes, &h->config.device);
}

/* Frames in, and what they mean for the state. */
static void take_in(palp_hand *h, const palp_tick_input *in, uint64_t heard) {
    palp_state before = h->safety.state;
    bool force = before == PALP_STATE_RUN || before == PALP_STATE_DAMPING;
    const uint32_t periods = in->skipped < UINT32_MAX ? in->skipped + 1u : in->skipped;
    h->periods = periods;
    h->counters.skipped += in->skipped;
    count_events(&h->counters, in->events);
    palp_axes_input read = {.heard = heard, .periods = periods, .strict = force};
    read.frames = palp_tick_frames(in, &read.count);
    h->counters.overflows += in->count - read.count;
    palp_axes_take(&h->axes, &h->config.device, &read, &h->counters);
    h->health = palp_axes_check(&h->axes);
    if (force && (float)h->health.frozen * h->dt_s >= 0.5f * PALP_FROZEN_S) h->counters.frozen++;
    apply_safety_step(h, palp_safety_tick(&h->safety, in->events, periods, &h->health));
    h->entered = h->safety.state == PALP_STATE_RUN && before != PALP_STATE_RUN;
    if (h->entered) {
        h->output = (palp_output){.last_N = {0.0f, 0.0f, 0.0f}};
        h->unfelt_Nm = (palp_vec3){0.0f, 0.0f, 0.0f};
        h->turned = false;
    }
}

/* ---- pose ---- */

/* Where the joints are taken to be, and how fast. */
static palp_pose read_pose(palp_hand *h, palp_hand_report *r) {
    float believed_rad[PALP_AXES] = {0.0f};
    h->seen = true;
    for (uint32_t i = 0; i < h->axes.count; i++) {
        const palp_joint *j = &h->axes.joint[i];
        const bool known = j->age <= PALP_JOINT_FORESEEN;
        h->seen = h->seen && j->age == 0u && !(palp_abs(j->shift_rad) > 0.0f);
        r->joint_rad[i] = believed_rad[i] = j->believed_rad;
        r->joint_rad_s[i] = h->joint_rad_s[i] = j->dq_rad_s;
        h->certain_rad_s[i] = known ? j->certain_rad_s : 0.0f;
    }
    const palp_pose pose = palp_forward(&h->config.device.kinematics, believed_rad);
    r->tip_m = pose.tip_m;
    for (uint32_t e = 0; e < 9u; e++) r->tip_r[e] = pose.r[e];
    r->tip_velocity_m_s = palp_pose_velocity(&pose, r->joint_rad_s);
    h->certain_m_s = palp_pose_velocity(&pose, h->certain_rad_s);
    h->certain_turn_rad_s = palp_pose_turning(&pose, h->certain_rad_s);
    return pose;
}

/* What the hand has put in by turning the tool against what it does not feel. */
static float unfelt_J(palp_hand *h, const palp_pose *pose) {
    const float work = h->turned ? -palp_dot(h->unfelt_Nm, palp_turn_between(h->r, pose->r)) : 0.0f;
    for (uint32_t e = 0; e < 9u; e++) h->r[e] = pose->r[e];
    h->turned = true;
    return work;
}

/* Tells the passivity observer what the encoders say. */
static void observe(palp_hand *h, const palp_pose *pose) {
    palp_passivity_motion m = {.periods = h->periods,
                               .certain_m_s = h->certain_m_s,
                               .certain_turn_rad_s = h->certain_turn_rad_s,
                               .unfelt_J = unfelt_J(h, pose)};
    for (uint32_t i = 0; i < h->axes.count; i++) {
        m.q_rad[i] = h->axes.joint[i].q_rad;
        m.certain_rad_s[i] = h->certain_rad_s[i];
        m.fresh[i] = h->axes.joint[i].age == 0u;
    }
    palp_passivity_observe(&h->output.passivity, &h->passive, &m);
}

palp_hand_place palp_hand_tip(const palp_hand *h) {
    const palp_placement *p = &h->config.placement;
    palp_frame turned = {.t = {0.0f, 0.0f, 0.0f}}, of_tool = turned;
    for (uint32_t e = 0; e < 9u; e++) {
        turned.r[e] = p->rotation[e];
        of_tool.r[e] = h->pose.r[e];
    }
    palp_hand_place place = {.at = palp_frame_compose(&turned, &of_tool),
                             .velocity_m_s =
                                 palp_scale(p->scale, palp_rotate(p->rotation, h->certain_m_s)),
                             .turning_rad_s = palp_rotate(p->rotation, h->certain_turn_rad_s),
                             .opening_m = p->scale * h->pose.opening_m};
    place.at.t = palp_madd(p->origin_m, p->scale, palp_rotate(p->rotation, h->pose.tip_m));
    return place;
}

/* Fades near singular poses and beyond the workspace. */
static float reach_gain(palp_hand *h, const palp_pose *pose) {
    float radius = h->config.device.workspace_radius_m;
    float inside = 1.0f - (palp_norm(pose->tip_m) / radius - OUTSIDE) * 4.0f;
    float sound = pose->conditioning / SINGULAR - 1.0f;
    float gain = palp_clamp(palp_min(inside, sound), 0.0f, 1.0f);
    if (gain < 1.0f) h->counters.outside++;
    return gain;
}

void palp_hand_begin(palp_hand *h, const palp_tick_input *input, uint64_t heard,
                     palp_hand_report *r) {
    take_in(h, input, heard);
    h->pose = read_pose(h, r);
    h->feels = false;
    if (palp_safety_request(h->safety.state) != PALP_REQUEST_TORQUE) return;
    if (!h->pose.reachable) {
        palp_safety_latch(&h->safety, PALP_FAULT_INPUT);
        return;
    }
    observe(h, &h->pose);
    h->gain = palp_safety_gain(&h->safety) * reach_gain(h, &h->pose);
    h->feels = h->gain > 0.0f || h->safety.state == PALP_STATE_RUN;
}

/* ---- force ---- */

/* The force of RUN, or of DAMPING: what is left of the contact, and a brake. */
static palp_wrench wanted_force(palp_hand *h, const palp_hand_felt *felt, palp_hand_report *r) {
    const palp_placement *p = &h->config.placement;
    palp_wrench w = {.force_N = {0.0f, 0.0f, 0.0f}};
    if (h->feels) {
        const palp_vec3 force = palp_rotate_back(p->rotation, felt->wrench.force_N);
        r->contact_moment_Nm = palp_rotate_back(p->rotation, felt->wrench.moment_Nm);
        w = (palp_wrench){palp_scale(h->gain * p->scale, force),
                          palp_scale(h->gain, r->contact_moment_Nm)};
        r->stored_J = h->gain * felt->stored_J;
    }
    if (h->safety.state == PALP_STATE_RUN) return w;
    const palp_device *d = &h->config.device;
    w.force_N = palp_madd(w.force_N, -d->damping_max_Ns_per_m, h->certain_m_s);
    w.moment_Nm = palp_madd(w.moment_Nm, -d->damping_max_Nms_per_rad, h->certain_turn_rad_s);
    return w;
}

static void make_force(palp_hand *h, const palp_hand_felt *felt, const palp_tick_input *in,
                       palp_hand_report *r) {
    /* Gravity compensation fades with the force. Friction is compensated only while the velocity is
     * known, and never against the brake of DAMPING. */
    const bool fresh = h->health.age == 0u && h->safety.state == PALP_STATE_RUN;
    const float gain = palp_safety_gain(&h->safety);
    const palp_wrench wanted = wanted_force(h, felt, r);
    palp_output_request request = {
        .force_N = wanted.force_N,
        .moment_Nm = wanted.moment_Nm,
        .gripper_N = h->feels ? h->gain * h->config.placement.scale * felt->opens_N : 0.0f,
        .stored_J = r->stored_J,
        .damped_W = h->feels ? felt->damped_W : 0.0f,
        .steady = gain >= 1.0f && h->seen,
        .gravity_share = gain,
        .friction_share = fresh ? gain : 0.0f};
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        request.dq_rad_s[i] = h->joint_rad_s[i];
        request.feedforward_Nm[i] = in->feedforward_Nm[i];
    }
    const palp_output_result out =
        palp_output_apply(&h->output, &h->config.device, h->config.unguarded ? NULL : &h->passive,
                          &h->pose, &request, h->dt_s);
    if (out.bad) palp_safety_latch(&h->safety, PALP_FAULT_OUTPUT);
    if (out.limited || out.slewed) h->counters.limited++;
    if (out.braked) h->counters.braked++;
    r->braked = out.braked;
    r->force_N = out.force_N;
    r->moment_Nm = out.moment_Nm;
    h->unfelt_Nm = palp_sub(r->contact_moment_Nm, out.moment_Nm);
    r->absorbed_J = h->output.passivity.absorbed_J;
    r->given_J = h->output.passivity.given_J;
    if (!h->config.unguarded && palp_passivity_exceeded(&h->output.passivity, &h->passive))
        palp_safety_latch(&h->safety, PALP_FAULT_ENERGY);
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        r->motor_torque_Nm[i] = out.motor_torque_Nm[i];
        h->axes.contact_torque_Nm[i] = out.contact_torque_Nm[i];
    }
}

uint32_t palp_hand_end(palp_hand *h, const palp_hand_felt *felt, const palp_tick_input *input,
                       uint64_t tick, palp_can_frame *out, palp_hand_report *r) {
    const bool torque = palp_safety_request(h->safety.state) == PALP_REQUEST_TORQUE;
    if (torque && h->pose.reachable) make_force(h, felt, input, r);
    const uint32_t n =
        palp_axes_send(&h->axes, &h->config.device, palp_safety_request(h->safety.state),
                       r->motor_torque_Nm, tick, out);
    r->state = h->safety.state;
    r->faults = h->safety.faults;
    return n;
}
