/* SPDX-License-Identifier: MIT */
/*
 * What moves joints of multizone models in a scene: an axis of a device, or set-points that another
 * controller sends on a device's bus.
 *
 *   axis:    value = offset + scale q,  q the joint angle of the device, rad
 *   frames:  value' = clamp((goal - value) / PALP_SETPOINT_LAG_S, -fastest, fastest)
 *
 * A set-point is a float, little-endian, at a byte of a frame of one id: rad, or m of a prismatic joint. One
 * that is not finite is left aside, one out of the joint's range is taken to its end, and when no more
 * come the joint stays. So whatever is sent, the body moves no faster than `fastest` says.
 */
#ifndef PALP_SERVO_SETPOINT_H
#define PALP_SERVO_SETPOINT_H

#include "core/budget/target.h"
#include "core/device/canframe.h"
#include "core/zone/zones.h"

#define PALP_SETPOINT_LAG_S 0.01f
#define PALP_SCENE_DRIVES 8u

typedef enum { PALP_DRIVEN_BY_AXIS, PALP_DRIVEN_BY_FRAMES } palp_driven_by;

/* A joint, and what drives it. */
typedef struct {
    uint32_t body, joint, hand;
    palp_driven_by by;
    uint32_t axis;       /* AXIS */
    float scale, offset; /* AXIS; FRAMES: offset is the value until the first set-point */
    uint32_t id, byte;   /* FRAMES: more than 11 bits are an extended id; byte + 4 is at most 64 */
    float fastest;       /* FRAMES: rad/s or m/s */
} palp_scene_drive;

/* A joint that is driven by frames. */
typedef struct {
    float value, goal;
    uint64_t taken, left; /* set-points that were followed, and left aside */
    uint32_t age;         /* ticks since the last that was taken */
} palp_setpoint;

/* Whether the numbers are within their ranges; body, joint, hand and axis are the scene's to check. */
bool palp_scene_drive_is_sound(const palp_scene_drive *drive);

/* Puts a set-point at the drive's offset. */
void palp_setpoint_init(palp_setpoint *setpoint, const palp_scene_drive *drive);

/* Whether a frame has a set-point for it; then takes its value within the joint's range. */
bool palp_setpoint_take(palp_setpoint *setpoint, const palp_scene_drive *drive,
                        const palp_joint_entry *joint, const palp_can_frame *frame);

/* Goes towards the goal for one tick. */
void palp_setpoint_step(palp_setpoint *setpoint, const palp_scene_drive *drive, float dt_s);

/* Bound of a tick of so many drives that each look at 64 frames. */
float palp_scene_drives_cost(const palp_prices *price, uint32_t drives);

#endif
