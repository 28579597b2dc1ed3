/* SPDX-License-Identifier: MIT */
#include "sim/device.h"
#include <math.h>
#include <string.h>

#define SUBSTEPS 20
#define FRICTION_SPEED 0.002 /* Coulomb friction is smoothed below this, m/s */
#define RAD_PER_REV 6.283185307179586
#define STYLUS_KG_M2 2e-5 /* and of a gripper */

/* Joints that put the tip at a place and turn the stylus as it is. */
static bool joints_at(const sim_device *d, const double x_m[3], float q_rad[PALP_AXES]) {
    const palp_kinematics *k = &d->file->device.kinematics;
    const uint32_t gripper = palp_gripper_axis(k);
    palp_vec3 tip = {(float)x_m[0], (float)x_m[1], (float)x_m[2]};
    if (!palp_inverse(k, tip, q_rad)) return false;
    palp_inverse_wrist(k, d->r, q_rad);
    if (gripper < d->axes) q_rad[gripper] = (float)d->gripper_rad;
    return true;
}

static void turn_to(const double turn_rad[3], float r[9]) {
    const float unit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    palp_turn_by((palp_vec3){(float)turn_rad[0], (float)turn_rad[1], (float)turn_rad[2]}, unit, r);
}

static double motor_turns(const sim_device *d, uint32_t i) {
    const palp_device *p = &d->file->device;
    return ((double)d->q_rad[i] - (double)d->zero_rad[i]) * (double)p->gear[i] / RAD_PER_REV;
}

void sim_device_init(sim_device *d, const device_file *file, const hand_pose *at) {
    const palp_device *p = &file->device;
    *d = (sim_device){
        .file = file, .axes = palp_axes(&p->kinematics), .gripper_rad = at->turn.gripper_rad};
    memcpy(d->x_m, at->x_m, sizeof d->x_m);
    turn_to(at->turn.turn_rad, d->r);
    (void)joints_at(d, d->x_m, d->q_rad);
    for (uint32_t i = 0; i < d->axes; i++) {
        d->zero_rad[i] = p->homes ? d->q_rad[i] : p->joint_zero_rad[i]; /* switched on here */
        sim_drive_init(&d->drive[i], &p->drives, p->node_id[i]);
        sim_drive_read(&d->drive[i], motor_turns(d, i), 0);
    }
}

void sim_device_receive(sim_device *d, const palp_can_frame *frame) {
    for (uint32_t i = 0; i < d->axes; i++) sim_drive_receive(&d->drive[i], frame);
}

static double torque_of(const sim_device *d, uint32_t i) {
    return d->drive[i].actual_Nm * (double)d->file->device.gear[i];
}

/* The moment that the wrist's motors make: its part along each axis is their torque. */
static palp_vec3 wrist_moment(const sim_device *d, const palp_pose *pose) {
    const uint32_t first = palp_wrist_axis(&d->file->device.kinematics);
    palp_vec3 sum = {0};
    if (first + 3 > d->axes) return sum;
    const palp_vec3 *w = pose->turn + first;
    const float volume = palp_dot(w[0], palp_cross(w[1], w[2]));
    for (uint32_t i = 0; i < 3 && fabsf(volume) > 1e-3f; i++)
        sum = palp_madd(sum, (float)torque_of(d, first + i) / volume,
                        palp_cross(w[(i + 1) % 3], w[(i + 2) % 3]));
    return sum;
}

/* The force at the tip, in the span of the Jacobian's columns, that balances the arm's motors beside
 * the wrist's moment: c_i . f = tau_i - w_i . m with f = sum y_j c_j, so G y = that with G_ij = c_i .
 * c_j. */
static void tip_force(const sim_device *d, const palp_pose *pose, palp_vec3 moment,
                      double force[3]) {
    const uint32_t arm = palp_arm_axes(&d->file->device.kinematics);
    double g[3][4], y[3];
    memset(force, 0, 3 * sizeof *force);
    if (!pose->reachable || !(pose->conditioning > 1e-3f)) return;
    for (uint32_t i = 0; i < arm; i++) {
        for (uint32_t j = 0; j < arm; j++)
            g[i][j] = (double)palp_dot(pose->column_m[i], pose->column_m[j]);
        g[i][arm] = torque_of(d, i) - (double)palp_dot(pose->turn[i], moment);
    }
    for (uint32_t i = 0; i < arm; i++) { /* G is positive definite: no pivoting */
        for (uint32_t r = i + 1; r < arm; r++) {
            double f = g[r][i] / g[i][i];
            for (uint32_t c = i; c <= arm; c++) g[r][c] -= f * g[i][c];
        }
    }
    for (uint32_t i = arm; i-- > 0;) {
        y[i] = g[i][arm];
        for (uint32_t c = i + 1; c < arm; c++) y[i] -= g[i][c] * y[c];
        y[i] /= g[i][i];
        force[0] += y[i] * (double)pose->column_m[i].x;
        force[1] += y[i] * (double)pose->column_m[i].y;
        force[2] += y[i] * (double)pose->column_m[i].z;
    }
}

/* The stylus turns by the hand's spring and the wrist's motors. */
static void turn_stylus(sim_device *d, double h, const hand_pose *target, const hand *by,
                        palp_vec3 moment) {
    float wanted[9];
    turn_to(target->turn.turn_rad, wanted);
    const palp_vec3 back = palp_turn_between(d->r, wanted);
    const double pull[3] = {(double)back.x, (double)back.y, (double)back.z},
                 motor[3] = {(double)moment.x, (double)moment.y, (double)moment.z};
    for (int k = 0; k < 3; k++) {
        const double push = motor[k] + by->stiffness_Nm_per_rad * pull[k];
        d->w_rad_s[k] = (d->w_rad_s[k] + h * push / STYLUS_KG_M2) /
                        (1 + h * by->damping_Nms_per_rad / STYLUS_KG_M2);
        d->given_J += h * d->w_rad_s[k] * motor[k];
    }
    palp_turn_by((palp_vec3){(float)(h * d->w_rad_s[0]), (float)(h * d->w_rad_s[1]),
                             (float)(h * d->w_rad_s[2])},
                 d->r, d->r);
}

static void move_gripper(sim_device *d, double h, const hand_pose *target, const hand *by) {
    const uint32_t gripper = palp_gripper_axis(&d->file->device.kinematics);
    if (gripper >= d->axes) return;
    const double motor = torque_of(d, gripper);
    const double push =
        motor + by->stiffness_Nm_per_rad * (target->turn.gripper_rad - d->gripper_rad);
    d->gripper_rad_s = (d->gripper_rad_s + h * push / STYLUS_KG_M2) /
                       (1 + h * by->damping_Nms_per_rad / STYLUS_KG_M2);
    d->gripper_rad += h * d->gripper_rad_s;
    d->given_J += h * d->gripper_rad_s * motor;
}

void sim_device_move(sim_device *d, double dt_s, const hand_pose *target, const hand *by) {
    const device_file *file = d->file;
    double h = dt_s / SUBSTEPS;
    double damping = (double)file->device.damping_Ns_per_m, mass = (double)file->device.mass_kg;
    bool planar = palp_arm_axes(&file->device.kinematics) < 3;
    for (int step = 0; step < SUBSTEPS; step++) {
        double motor[3];
        for (uint32_t i = 0; i < d->axes; i++) sim_drive_move(&d->drive[i], h);
        const palp_pose pose = palp_forward(&file->device.kinematics, d->q_rad);
        const palp_vec3 moment = wrist_moment(d, &pose);
        tip_force(d, &pose, moment, motor);
        motor[2] -= file->weight_N;
        double speed =
            sqrt(d->v_m_s[0] * d->v_m_s[0] + d->v_m_s[1] * d->v_m_s[1] + d->v_m_s[2] * d->v_m_s[2]);
        double drag = by->damping_Ns_per_m + damping + file->friction_N / (speed + FRICTION_SPEED);
        for (int k = 0; k < 3; k++) {
            double push = motor[k] + by->stiffness_N_per_m * (target->x_m[k] - d->x_m[k]);
            /* drag is implicit, so that stiff friction cannot overshoot */
            d->v_m_s[k] = (d->v_m_s[k] + h * push / mass) / (1 + h * drag / mass);
        }
        if (planar) d->v_m_s[1] = 0;
        const double own = drag - by->damping_Ns_per_m; /* of the mechanism */
        for (int k = 0; k < 3; k++) d->given_J += h * d->v_m_s[k] * (motor[k] - own * d->v_m_s[k]);
        if (file->device.kinematics.wrist) turn_stylus(d, h, target, by, moment);
        move_gripper(d, h, target, by);
        double next[3];
        float q[PALP_AXES] = {0};
        for (int k = 0; k < 3; k++) next[k] = d->x_m[k] + h * d->v_m_s[k];
        if (joints_at(d, next, q)) {
            memcpy(d->x_m, next, sizeof next);
            memcpy(d->q_rad, q, sizeof q);
        } else {
            memset(d->v_m_s, 0, sizeof d->v_m_s); /* the mechanical stop */
        }
    }
    d->time_s += dt_s;
}

uint32_t sim_device_transmit(sim_device *d, palp_can_frame frames[SIM_FRAMES_OUT]) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < d->axes; i++) {
        double turns = motor_turns(d, i) + (i == 0 ? d->offset_turns : 0);
        if (!d->stuck) sim_drive_read(&d->drive[i], turns, d->time_s - d->last_s);
        n += sim_drive_transmit(&d->drive[i], d->time_s, frames + n);
    }
    d->last_s = d->time_s;
    return n;
}
