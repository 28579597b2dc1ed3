/* SPDX-License-Identifier: MIT */
#include "device.h"
#include "core/device/odrive.h"
#include <math.h>
#include <string.h>

#define SUBSTEPS 20
#define CURRENT_LOOP_S 0.0002 /* time constant of the drive's torque */
#define WATCHDOG_S 0.05       /* the drive drops its torque when set-points stay away */
#define HEARTBEAT_S 0.1
#define FRICTION_SPEED 0.002 /* Coulomb friction is smoothed below this, m/s */
#define ESTIMATOR_SHARE 0.3  /* of a new rate in the drive's velocity estimate */
#define RAD_PER_REV 6.283185307179586

bool arm_inverse(const palp_arm *arm, const double x_m[3], double q_rad[PALP_AXES]) {
    double a = (double)arm->upper_m, b = (double)arm->fore_m;
    double rho = hypot(x_m[0] + a, x_m[1]);
    double z = x_m[2] - b;
    double reach2 = rho * rho + z * z;
    /* Two links: rho = a cos q2 + b cos p, z = a sin q2 + b sin p with p = q3 - pi/2, elbow up. */
    double cosine = (reach2 - a * a - b * b) / (2 * a * b);
    if (!(cosine > -1 && cosine < 1)) return false;
    double elbow = -acos(cosine);
    double q2 = atan2(z, rho) - atan2(b * sin(elbow), a + b * cos(elbow));
    q_rad[0] = atan2(x_m[1], x_m[0] + a);
    q_rad[1] = q2;
    q_rad[2] = q2 + elbow + 1.5707963267948966;
    return true;
}

void sim_device_init(sim_device *d, const device_file *file, const double x_m[3]) {
    *d = (sim_device){.file = file};
    memcpy(d->x_m, x_m, sizeof d->x_m);
    (void)arm_inverse(&file->device.arm, d->x_m, d->q_rad);
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        double counts = (double)file->device.counts_per_rev;
        d->drive[i].state = PALP_ODRIVE_IDLE;
        d->drive[i].turns =
            floor(d->q_rad[i] * (double)file->device.gear[i] / RAD_PER_REV * counts) / counts;
    }
}

void sim_device_receive(sim_device *d, const palp_can_frame *frame) {
    palp_odrive_message m;
    if (!palp_odrive_decode(frame, &m)) return;
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        sim_drive *s = &d->drive[i];
        if (d->file->device.node_id[i] != m.node) continue;
        if (m.command == PALP_ODRIVE_SET_CONTROLLER_MODE) {
            s->torque_mode = m.control_mode == PALP_ODRIVE_TORQUE_CONTROL &&
                             m.input_mode == PALP_ODRIVE_PASSTHROUGH;
        } else if (m.command == PALP_ODRIVE_SET_AXIS_STATE) {
            s->state = m.state;
            s->torque_Nm = 0;
        } else if (m.command == PALP_ODRIVE_ESTOP) {
            s->state = PALP_ODRIVE_IDLE;
        } else if (m.command == PALP_ODRIVE_SET_INPUT_TORQUE) {
            s->torque_Nm = isfinite((double)m.torque_Nm) ? (double)m.torque_Nm : 0;
            s->since_command_s = 0;
        }
    }
}

/* Tip force of the joint torques: J^T f = tau. */
static bool tip_force(const sim_device *d, double force[3]) {
    const palp_device *p = &d->file->device;
    float q[PALP_AXES];
    double tau[3], j[9];
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        q[i] = (float)d->q_rad[i];
        tau[i] = d->drive[i].actual_Nm * (double)p->gear[i];
    }
    palp_arm_pose pose = palp_arm_forward(&p->arm, q);
    for (int i = 0; i < 9; i++) j[i] = (double)pose.jacobian[i];
    /* Cramer's rule on J^T, whose row i is column i of J */
    double c0[3], c1[3], c2[3];
    for (int k = 0; k < 3; k++) {
        c0[k] = j[3 * k];
        c1[k] = j[3 * k + 1];
        c2[k] = j[3 * k + 2];
    }
    double x01[3] = {c0[1] * c1[2] - c0[2] * c1[1], c0[2] * c1[0] - c0[0] * c1[2],
                     c0[0] * c1[1] - c0[1] * c1[0]};
    double x12[3] = {c1[1] * c2[2] - c1[2] * c2[1], c1[2] * c2[0] - c1[0] * c2[2],
                     c1[0] * c2[1] - c1[1] * c2[0]};
    double x20[3] = {c2[1] * c0[2] - c2[2] * c0[1], c2[2] * c0[0] - c2[0] * c0[2],
                     c2[0] * c0[1] - c2[1] * c0[0]};
    double det = c0[0] * x12[0] + c0[1] * x12[1] + c0[2] * x12[2];
    if (!(fabs(det) > 1e-9)) return false;
    for (int k = 0; k < 3; k++)
        force[k] = (tau[0] * x12[k] + tau[1] * x20[k] + tau[2] * x01[k]) / det;
    return true;
}

static void move_drives(sim_device *d, double h) {
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        sim_drive *s = &d->drive[i];
        s->since_command_s += h;
        bool live = s->state == PALP_ODRIVE_CLOSED_LOOP && s->torque_mode &&
                    s->since_command_s < WATCHDOG_S;
        double wanted = live ? s->torque_Nm : 0;
        double limit = (double)d->file->device.motor_torque_max_Nm;
        wanted = fmin(fmax(wanted, -limit), limit);
        s->actual_Nm += (wanted - s->actual_Nm) * (1 - exp(-h / CURRENT_LOOP_S));
    }
}

void sim_device_move(sim_device *d, double dt_s, const double target_m[3], double hand_N_per_m,
                     double hand_Ns_per_m) {
    double h = dt_s / SUBSTEPS;
    for (int step = 0; step < SUBSTEPS; step++) {
        double motor[3] = {0};
        move_drives(d, h);
        (void)tip_force(d, motor);
        double speed =
            sqrt(d->v_m_s[0] * d->v_m_s[0] + d->v_m_s[1] * d->v_m_s[1] + d->v_m_s[2] * d->v_m_s[2]);
        double friction = d->file->friction_N / (speed + FRICTION_SPEED);
        double drag = hand_Ns_per_m + d->file->damping_Ns_per_m + friction;
        for (int k = 0; k < 3; k++) {
            double push = motor[k] + hand_N_per_m * (target_m[k] - d->x_m[k]);
            /* drag is implicit, so that stiff friction cannot overshoot */
            d->v_m_s[k] =
                (d->v_m_s[k] + h * push / d->file->mass_kg) / (1 + h * drag / d->file->mass_kg);
        }
        double next[3], q[PALP_AXES];
        for (int k = 0; k < 3; k++) next[k] = d->x_m[k] + h * d->v_m_s[k];
        if (arm_inverse(&d->file->device.arm, next, q)) {
            memcpy(d->x_m, next, sizeof next);
            memcpy(d->q_rad, q, sizeof q);
        } else {
            memset(d->v_m_s, 0, sizeof d->v_m_s); /* the mechanical stop */
        }
    }
    d->time_s += dt_s;
}

uint32_t sim_device_transmit(sim_device *d, palp_can_frame frames[SIM_FRAMES_OUT]) {
    const palp_device *p = &d->file->device;
    uint32_t n = 0;
    bool heartbeat = d->time_s >= d->next_heartbeat_s;
    if (heartbeat) d->next_heartbeat_s = d->time_s + HEARTBEAT_S;
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        double counts = (double)p->counts_per_rev;
        double turns = d->q_rad[i] * (double)p->gear[i] / RAD_PER_REV;
        sim_drive *s = &d->drive[i];
        double read = floor(turns * counts) / counts;
        double rate = d->time_s > d->last_s ? (read - s->turns) / (d->time_s - d->last_s) : 0;
        s->turns_per_s += ESTIMATOR_SHARE * (rate - s->turns_per_s);
        s->turns = read;
        palp_odrive_message m = {.node = p->node_id[i],
                                 .command = PALP_ODRIVE_ENCODER_ESTIMATES,
                                 .position_rev = (float)read,
                                 .velocity_rev_s = (float)s->turns_per_s};
        frames[n++] = palp_odrive_encode(&m);
        if (!heartbeat) continue;
        m = (palp_odrive_message){
            .node = p->node_id[i], .command = PALP_ODRIVE_HEARTBEAT, .state = d->drive[i].state};
        frames[n++] = palp_odrive_encode(&m);
    }
    d->last_s = d->time_s;
    return n;
}
