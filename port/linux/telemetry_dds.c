/* SPDX-License-Identifier: MIT */
/* The build with Cyclone DDS. Writing may lock, allocate and send, so it has a thread of its own
 * behind a ring of its own: neither the loop nor the log waits for it. */
#include "port/host/ring.h"
#include "port/host/report.h"
#include "port/linux/telemetry.h"
#include "telemetry_idl.h"
#include "port/host/util.h"
#include <dds/dds.h>
#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define SLOTS 256u
#define POLL_NS 2000000

typedef struct {
    uint64_t stamp_ns; /* CLOCK_REALTIME */
    palp_state state;
    uint32_t faults;
    float joint_rad[PALP_AXES], joint_rad_s[PALP_AXES], motor_Nm[PALP_AXES];
    palp_vec3 tip_m, force_N, moment_Nm;
    float tip_r[9];
} sample;

struct telemetry {
    dds_entity_t participant, joints, wrench, pose, fault;
    char of[24]; /* what names the device in its topics: nothing for the first */
    uint32_t axes;
    float gear[PALP_AXES];
    ring ring;
    pthread_t thread;
    _Atomic bool stop;
    bool said;
    palp_state last_state;
    uint32_t last_faults;
    uint64_t published, refused;
};

static dds_entity_t check(dds_entity_t e, const char *what) {
    if (e < 0) die(EXIT_WORK, "--dds: %s: %s (see CYCLONEDDS_URI)", what, dds_strretcode(-e));
    return e;
}

/* The newest only, and if it is lost the next will do; or all faults, also for who comes late. */
static dds_entity_t writer(const telemetry *t, const dds_topic_descriptor_t *type, const char *name,
                           bool keep) {
    char topic_name[64];
    snprintf(topic_name, sizeof topic_name, "rt/palp/%s%s", t->of, name);
    dds_qos_t *q = dds_create_qos();
    dds_qset_history(q, DDS_HISTORY_KEEP_LAST, keep ? 16 : 1);
    dds_qset_reliability(q, keep ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                         DDS_MSECS(10));
    if (keep) dds_qset_durability(q, DDS_DURABILITY_TRANSIENT_LOCAL);
    dds_entity_t topic =
        check(dds_create_topic(t->participant, type, topic_name, NULL, NULL), name);
    dds_entity_t w = check(dds_create_writer(t->participant, topic, q, NULL), name);
    dds_delete_qos(q);
    return w;
}

static void write_one(telemetry *t, dds_entity_t w, const void *message) {
    if (dds_write(w, message) == DDS_RETCODE_OK)
        t->published++;
    else
        t->refused++;
}

static std_msgs_msg_dds__Header_ header_of(const sample *s) {
    return (std_msgs_msg_dds__Header_){.stamp = {.sec = (int32_t)(s->stamp_ns / 1000000000u),
                                                 .nanosec = (uint32_t)(s->stamp_ns % 1000000000u)},
                                       .frame_id = "palp_device"};
}

static void write_joints(telemetry *t, const sample *s) {
    static char *names[PALP_AXES] = {"joint1", "joint2", "joint3", "joint4",
                                     "joint5", "joint6", "joint7"};
    double position[PALP_AXES], velocity[PALP_AXES], effort[PALP_AXES];
    for (uint32_t i = 0; i < t->axes; i++) {
        position[i] = (double)s->joint_rad[i];
        velocity[i] = (double)s->joint_rad_s[i];
        effort[i] = (double)s->motor_Nm[i] * (double)t->gear[i];
    }
#define SEQUENCE(x) {._maximum = t->axes, ._length = t->axes, ._buffer = x}
    sensor_msgs_msg_dds__JointState_ m = {.header = header_of(s),
                                          .name = SEQUENCE(names),
                                          .position = SEQUENCE(position),
                                          .velocity = SEQUENCE(velocity),
                                          .effort = SEQUENCE(effort)};
#undef SEQUENCE
    write_one(t, t->joints, &m);
}

/* Half the angle along the axis of a turn. */
static geometry_msgs_msg_dds__Quaternion_ quaternion_of(const float r[9]) {
    const float none[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const palp_vec3 turn = palp_turn_between(none, r);
    const double angle = (double)palp_norm(turn), half = 0.5 * angle;
    const double share = angle > 1e-9 ? sin(half) / angle : 0.5;
    return (geometry_msgs_msg_dds__Quaternion_){.x = share * (double)turn.x,
                                                .y = share * (double)turn.y,
                                                .z = share * (double)turn.z,
                                                .w = cos(half)};
}

static void write_sample(telemetry *t, const sample *s) {
    geometry_msgs_msg_dds__WrenchStamped_ wrench = {
        .header = header_of(s),
        .wrench = {
            .force = {(double)s->force_N.x, (double)s->force_N.y, (double)s->force_N.z},
            .torque = {(double)s->moment_Nm.x, (double)s->moment_Nm.y, (double)s->moment_Nm.z}}};
    geometry_msgs_msg_dds__PoseStamped_ pose = {
        .header = header_of(s),
        .pose = {.position = {(double)s->tip_m.x, (double)s->tip_m.y, (double)s->tip_m.z},
                 .orientation = quaternion_of(s->tip_r)}};
    write_joints(t, s);
    write_one(t, t->wrench, &wrench);
    write_one(t, t->pose, &pose);
    if (t->said && s->state == t->last_state && s->faults == t->last_faults) return;
    t->said = true;
    t->last_state = s->state;
    t->last_faults = s->faults;
    char names[128], text[160];
    report_faults(s->faults, names, sizeof names);
    snprintf(text, sizeof text, "%s%s%s", report_state(s->state), s->faults != 0 ? ": " : "",
             names);
    std_msgs_msg_dds__String_ fault = {.data = text};
    write_one(t, t->fault, &fault);
}

static void *write_all(void *context) {
    telemetry *t = context;
    const struct timespec moment = {.tv_nsec = POLL_NS};
    for (;;) {
        bool last = t->stop;
        for (sample *s; (s = ring_peek(&t->ring)) != NULL; ring_release(&t->ring))
            write_sample(t, s);
        if (last) return NULL;
        nanosleep(&moment, NULL);
    }
}

telemetry *telemetry_open(const palp_device *device, uint32_t number) {
    telemetry *t = allocate(1, sizeof *t);
    t->axes = palp_axes(&device->kinematics);
    memcpy(t->gear, device->gear, sizeof t->gear);
    if (number > 0) snprintf(t->of, sizeof t->of, "device%u/", number % PALP_SCENE_HANDS);
    t->participant =
        check(dds_create_participant(DDS_DOMAIN_DEFAULT, NULL, NULL), "no participant");
    t->joints = writer(t, &sensor_msgs_msg_dds__JointState__desc, "joint_states", false);
    t->wrench = writer(t, &geometry_msgs_msg_dds__WrenchStamped__desc, "wrench", false);
    t->pose = writer(t, &geometry_msgs_msg_dds__PoseStamped__desc, "pose", false);
    t->fault = writer(t, &std_msgs_msg_dds__String__desc, "fault", true);
    t->ring =
        (ring){.memory = allocate(SLOTS, sizeof(sample)), .slots = SLOTS, .bytes = sizeof(sample)};
    if (pthread_create(&t->thread, NULL, write_all, t) != 0)
        die(EXIT_WORK, "--dds: no thread for telemetry");
    return t;
}

void telemetry_publish(telemetry *t, const palp_report *r) {
    struct timespec now;
    sample *s = ring_begin(&t->ring);
    if (s == NULL) return;
    clock_gettime(CLOCK_REALTIME, &now);
    *s = (sample){.stamp_ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec,
                  .state = r->state,
                  .faults = r->faults,
                  .tip_m = r->tip_m,
                  .force_N = r->force_N,
                  .moment_Nm = r->moment_Nm};
    memcpy(s->tip_r, r->tip_r, sizeof s->tip_r);
    memcpy(s->joint_rad, r->joint_rad, sizeof s->joint_rad);
    memcpy(s->joint_rad_s, r->joint_rad_s, sizeof s->joint_rad_s);
    memcpy(s->motor_Nm, r->motor_torque_Nm, sizeof s->motor_Nm);
    ring_end(&t->ring);
}

void telemetry_close(telemetry *t) {
    t->stop = true;
    pthread_join(t->thread, NULL);
    printf("dds                %" PRIu64 " messages published, %" PRIu64 " refused, %" PRIu64
           " samples dropped\n",
           t->published, t->refused, atomic_load(&t->ring.dropped));
    dds_delete(t->participant);
    free(t->ring.memory);
    free(t);
}
