/* SPDX-License-Identifier: MIT */
#include "sim/device.h"
#include <math.h>
#include <string.h>

#define SUBSTEPS 20
#define FRICTION_SPEED 0.002 /* Coulomb friction is smoothed below this, m/s */
#define RAD_PER_REV 6.283185307179586

static bool joints_at(const sim_device *d, const double x_m[3], float q_rad[PALP_AXES]) {
    palp_vec3 tip = {(float)x_m[0], (float)x_m[1], (float)x_m[2]};
    return palp_inverse(&d->file->device.kinematics, tip, q_rad);
}

static double motor_turns(const sim_device *d, uint32_t i) {
    const palp_device *p = &d->file->device;
    return ((double)d->q_rad[i] - (double)d->zero_rad[i]) * (double)p->gear[i] / RAD_PER_REV;
}

void sim_device_init(sim_device *d, const device_file *file, const double x_m[3]) {
    const palp_device *p = &file->device;
    *d = (sim_device){.file = file, .axes = palp_axes(&p->kinematics)};
    memcpy(d->x_m, x_m, sizeof d->x_m);
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

/* The force at the tip, in the span of the Jacobian's columns, that balances the motors: c_i . f =
 * tau_i with f = sum y_j c_j, so G y = tau with G_ij = c_i . c_j. */
static void tip_force(const sim_device *d, double force[3]) {
    const palp_device *p = &d->file->device;
    palp_pose pose = palp_forward(&p->kinematics, d->q_rad);
    double g[PALP_AXES][PALP_AXES + 1], y[PALP_AXES];
    memset(force, 0, 3 * sizeof *force);
    if (!pose.reachable || !(pose.conditioning > 1e-3f)) return;
    for (uint32_t i = 0; i < d->axes; i++) {
        for (uint32_t j = 0; j < d->axes; j++)
            g[i][j] = (double)palp_dot(pose.column_m[i], pose.column_m[j]);
        g[i][d->axes] = d->drive[i].actual_Nm * (double)p->gear[i];
    }
    for (uint32_t i = 0; i < d->axes; i++) { /* G is positive definite: no pivoting */
        for (uint32_t r = i + 1; r < d->axes; r++) {
            double f = g[r][i] / g[i][i];
            for (uint32_t c = i; c <= d->axes; c++) g[r][c] -= f * g[i][c];
        }
    }
    for (uint32_t i = d->axes; i-- > 0;) {
        y[i] = g[i][d->axes];
        for (uint32_t c = i + 1; c < d->axes; c++) y[i] -= g[i][c] * y[c];
        y[i] /= g[i][i];
        force[0] += y[i] * (double)pose.column_m[i].x;
        force[1] += y[i] * (double)pose.column_m[i].y;
        force[2] += y[i] * (double)pose.column_m[i].z;
    }
}

void sim_device_move(sim_device *d, double dt_s, const double target_m[3], double hand_N_per_m,
                     double hand_Ns_per_m) {
    const device_file *file = d->file;
    double h = dt_s / SUBSTEPS;
    double damping = (double)file->device.damping_Ns_per_m, mass = (double)file->device.mass_kg;
    bool planar = d->axes < 3;
    for (int step = 0; step < SUBSTEPS; step++) {
        double motor[3];
        for (uint32_t i = 0; i < d->axes; i++) sim_drive_move(&d->drive[i], h);
        tip_force(d, motor);
        motor[2] -= file->weight_N;
        double speed =
            sqrt(d->v_m_s[0] * d->v_m_s[0] + d->v_m_s[1] * d->v_m_s[1] + d->v_m_s[2] * d->v_m_s[2]);
        double drag = hand_Ns_per_m + damping + file->friction_N / (speed + FRICTION_SPEED);
        for (int k = 0; k < 3; k++) {
            double push = motor[k] + hand_N_per_m * (target_m[k] - d->x_m[k]);
            /* drag is implicit, so that stiff friction cannot overshoot */
            d->v_m_s[k] = (d->v_m_s[k] + h * push / mass) / (1 + h * drag / mass);
        }
        if (planar) d->v_m_s[1] = 0;
        const double own = drag - hand_Ns_per_m; /* of the mechanism */
        for (int k = 0; k < 3; k++) d->given_J += h * d->v_m_s[k] * (motor[k] - own * d->v_m_s[k]);
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
