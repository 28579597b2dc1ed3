/* SPDX-License-Identifier: MIT */
/*
 * One haptic device in the servo: what its drives say, where its tool is in the scene, which force
 * may reach the hand that holds it, and what its drives are told.
 *
 *     palp_hand_begin   frames -> joints -> state -> pose -> the guard's books
 *     palp_hand_tip     where the tip is in the scene, and how fast
 *     palp_hand_end     what was felt -> limits -> torques -> frames
 */
#ifndef PALP_SERVO_HAND_H
#define PALP_SERVO_HAND_H

#include "core/budget/price.h"
#include "core/servo/axes.h"
#include "core/servo/output.h"
#include "core/servo/safety.h"

/* Where the scene is felt: x_scene = origin + scale R x_device, R row-major. */
typedef struct {
    palp_vec3 origin_m; /* finite */
    float rotation[9];  /* a rotation, to 1 % */
    float scale; /* scene over device, above 0; forces at the hand are scale times the scene's */
} palp_placement;

typedef struct {
    palp_device device; /* as palp_device_is_sound; its drives.rate_hz, 49 to 20,001, is the rate of
                           the ticks */
    palp_placement placement;
    bool resume; /* leave DAMPING without a reset when all is well again */
    /* For studies; 0 and false: as palp_device_coupling and the device say, and guarded. */
    float coupling_N_per_m, coupling_Ns_per_m; /* at the device, used when the first is above 0 */
    bool unguarded;                            /* without the passivity controller */
} palp_hand_config;

/* What a tick reads. All of it is untrusted: bad frames and torques that are not finite are counted
 * or rejected (PALP_FAULT_OUTPUT for the latter). */
typedef struct {
    const palp_can_frame *frames; /* received since the last tick, oldest first; NULL if none */
    uint32_t count;   /* of the first ones beyond PALP_SERVO_FRAMES_IN nothing is read */
    uint32_t skipped; /* whole periods that the caller let pass without a tick before this one */
    uint32_t events;  /* PALP_EVENT_ bits */
    float feedforward_Nm[PALP_AXES]; /* motor torques of the integrator's own compensation; they
                                        come within the motors' and the slew limit */
} palp_tick_input;

/* Frames of one device that a tick takes in at most: what its bound is for. */
#define PALP_SERVO_FRAMES_IN 64u

/* The first of these, and how many they are. */
static inline const palp_can_frame *palp_tick_frames(const palp_tick_input *input,
                                                     uint32_t *count) {
    const uint32_t dropped =
        input->count > PALP_SERVO_FRAMES_IN ? input->count - PALP_SERVO_FRAMES_IN : 0u;
    *count = input->count - dropped;
    return dropped > 0u ? input->frames + dropped : input->frames;
}

typedef struct {
    palp_hand_config config;
    palp_output output;
    palp_passivity_config passive;
    palp_counters counters;
    palp_device_axes axes;
    palp_safety safety;
    palp_axes_health health; /* after the frames of this tick */
    palp_pose pose;
    float dt_s;
    uint32_t periods; /* since the tick before it */
    bool seen;        /* all joints are where they were read in this tick */
    bool entered;     /* RUN has begun in this tick */
    bool feels;       /* what is touched may reach the hand, by the gain */
    float gain;
    float joint_rad_s[PALP_AXES];
    float certain_rad_s[PALP_AXES]; /* of the joints: 0 for one that is not seen any more */
    palp_vec3 certain_m_s;          /* of the tip */
    palp_vec3 certain_turn_rad_s;   /* of the tool's turn */
    palp_vec3 unfelt_Nm;            /* moment of the last tick that no motor made */
    float r[9];                     /* of the tool, in the last tick */
    bool turned;                    /* that is known */
} palp_hand;

/* The tip in the scene. */
typedef struct {
    palp_frame at;
    palp_vec3 velocity_m_s, turning_rad_s;
    float opening_m; /* of the jaws of a gripper */
} palp_hand_place;

/* What the tools of a hand do to it, about the tip, in the scene; forces there. */
typedef struct {
    palp_wrench wrench;
    float opens_N; /* along the way on which the jaws open */
    float stored_J, damped_W;
    float brought_J; /* by what moves the bodies, in this tick */
} palp_hand_felt;

/* What comes out of a tick for one device. */
typedef struct {
    palp_state state;
    uint32_t faults; /* PALP_FAULT_ bits, latched */
    float joint_rad[PALP_AXES], joint_rad_s[PALP_AXES];
    palp_vec3 tip_m, tip_velocity_m_s; /* device */
    float tip_r[9];                    /* turn of the tool, device */
    palp_vec3 force_N, moment_Nm;      /* at the tip, as sent; what motors make of the moment */
    palp_vec3 contact_moment_Nm; /* of the contact about the tip, device; most of which a wrist
                                          without motors lets nobody feel */
    float motor_torque_Nm[PALP_AXES];
    float stored_J;   /* contact and coupling, as far as it is felt, in device units */
    float absorbed_J; /* net energy that the hand has put in since RUN */
    float given_J;    /* most energy that it was given beyond that (passivity.h) since RUN */
    bool braked;
} palp_hand_report;

/* What a tick takes at most for one device before its answer and after it, in the unit of the
 * prices: each (SERVO + axes AXIS) / 2, before it also 64 (FRAME + bytes FRAME_BYTE), bytes as in
 * palp_drive_frame_bytes. Of an unknown device, NULL, the most. */
float palp_servo_cost_before(const palp_prices *price, const palp_device *device);
float palp_servo_cost_after(const palp_prices *price, const palp_device *device);

bool palp_hand_config_is_sound(const palp_hand_config *config);

/* Begins in PALP_STATE_INIT. */
void palp_hand_init(palp_hand *hand, const palp_hand_config *config);

/* Springs between a tool and this device, in the scene: device stiffness k becomes k / scale^2
 * there, where lengths grow and forces shrink by scale. Of a turn they are 0 where no motors make
 * it. */
typedef struct {
    float N_per_m, Ns_per_m, Nm_per_rad, Nms_per_rad;
} palp_hand_spring;
palp_hand_spring palp_hand_spring_of(const palp_hand_config *config);

/* Sets hand->entered and hand->feels. Bit i of `heard`: frame i of those that are read is a
 * set-point of a joint of the scene, of no drive. Cost: SERVO / 2 + frames FRAME. */
void palp_hand_begin(palp_hand *hand, const palp_tick_input *input, uint64_t heard,
                     palp_hand_report *report);

palp_hand_place palp_hand_tip(const palp_hand *hand);

/* Writes at most PALP_SERVO_FRAMES_OUT frames to `out`; returns how many. `felt` counts where
 * hand->feels. Cost: SERVO / 2. */
uint32_t palp_hand_end(palp_hand *hand, const palp_hand_felt *felt, const palp_tick_input *input,
                       uint64_t tick, palp_can_frame *out, palp_hand_report *report);

#endif
