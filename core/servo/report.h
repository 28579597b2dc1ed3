/* SPDX-License-Identifier: MIT */
/* A tick of a scene as one of its devices sees it, for logs, reports and telemetry; and the forces on
 * its bodies, for displays. */
#ifndef PALP_SERVO_REPORT_H
#define PALP_SERVO_REPORT_H

#include "core/servo/scene.h"

typedef struct {
    uint64_t tick;
    palp_state state;
    uint32_t faults;         /* PALP_FAULT_ bits, latched */
    uint32_t level, limit;   /* of the contact, of the body on the coarsest; the finest that always
                                fits the period */
    uint32_t points, active; /* contact points; those of them in contact: of all bodies */
    uint32_t iterations;     /* of the active set, most of any body */
    uint32_t contact_flags;  /* PALP_CONTACT_ flags of any body */
    float bound_ns,
        elapsed_ns; /* of the whole tick: all that the limit level allows; by the clock */
    float joint_rad[PALP_AXES], joint_rad_s[PALP_AXES];
    palp_vec3 tip_m, tip_velocity_m_s; /* device */
    float tip_r[9];                    /* turn of the tool, device */
    palp_frame tool;                   /* its first one, in the scene */
    palp_vec3 force_N, moment_Nm;      /* at the tip, as sent; what motors make of the moment */
    palp_vec3 contact_moment_Nm; /* of the contact about the tip, device; most of which a wrist
                                          without motors lets nobody feel */
    float motor_torque_Nm[PALP_AXES];
    float stored_J;   /* contact and coupling, in device units */
    float absorbed_J; /* net energy that the hand has put in since RUN */
    float given_J;    /* most energy that it was given beyond that (passivity.h) since RUN */
    float doubt_N;    /* by how much the force may be off (answer.h), all bodies; device units */
    float
        unforeseen_m; /* how far that tool came to rest from where it was foreseen (scene), most */
    bool held;        /* went on as foreseen: no time for a contact, none found, or none settled */
    bool shortened;   /* did less than it would have with more time */
    bool slipping, braked;
} palp_report;

/* Cost: a copy for each axis, and each body once. Outside the bound of a tick. */
void palp_scene_view(const palp_scene *scene, const palp_scene_report *tick, uint32_t hand,
                     palp_report *report);

/* Loads that a body takes at most. */
#define PALP_SERVO_LOADS 192u

/* The forces of the last tick on an elastostatic body, in load[PALP_SERVO_LOADS]; returns how many; 0
 * for another body. Outside the bound of a tick. */
uint32_t palp_scene_loads(const palp_scene *scene, uint32_t body, palp_load *load);

#endif
