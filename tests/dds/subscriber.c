/* SPDX-License-Identifier: MIT */
/* subscriber SECONDS: a plain Cyclone DDS reader of what palpd publishes; one CSV line per message,
 * and the largest gap between wrenches at the end. */
#include "telemetry_idl.h"
#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>

static dds_entity_t participant;

static dds_entity_t reader(const dds_topic_descriptor_t *type, const char *name, bool keep) {
    dds_qos_t *q = dds_create_qos();
    dds_qset_history(q, DDS_HISTORY_KEEP_LAST, 64);
    dds_qset_reliability(q, keep ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                         DDS_MSECS(10));
    if (keep) dds_qset_durability(q, DDS_DURABILITY_TRANSIENT_LOCAL);
    dds_entity_t topic = dds_create_topic(participant, type, name, NULL, NULL);
    return dds_create_reader(participant, topic, q, NULL);
}

static double seconds(const std_msgs_msg_dds__Header_ *h) {
    return (double)h->stamp.sec + 1e-9 * (double)h->stamp.nanosec;
}

#define TAKE(reader, type, m)                                                                      \
    for (void *s[1] = {NULL}; dds_take(reader, s, &info, 1, 1) > 0; dds_return_loan(reader, s, 1)) \
        for (const type *m = info.valid_data ? s[0] : NULL; m != NULL; m = NULL)

int main(int argc, char **argv) {
    participant = dds_create_participant(DDS_DOMAIN_DEFAULT, NULL, NULL);
    dds_entity_t joints = reader(&sensor_msgs_msg_dds__JointState__desc, "rt/palp/joint_states", 0);
    dds_entity_t wrench = reader(&geometry_msgs_msg_dds__WrenchStamped__desc, "rt/palp/wrench", 0);
    dds_entity_t pose = reader(&geometry_msgs_msg_dds__PoseStamped__desc, "rt/palp/pose", 0);
    dds_entity_t fault = reader(&std_msgs_msg_dds__String__desc, "rt/palp/fault", 1);
    dds_time_t end = dds_time() + DDS_SECS(argc > 1 ? atoi(argv[1]) : 5);
    dds_sample_info_t info;
    while (dds_time() < end) {
        TAKE(joints, sensor_msgs_msg_dds__JointState_, m) {
            printf("joints,%.9f,%s,%u", seconds(&m->header), m->header.frame_id, m->name._length);
            for (uint32_t i = 0; i < m->name._length; i++)
                printf(",%s,%.9g,%.9g,%.9g", m->name._buffer[i], m->position._buffer[i],
                       m->velocity._buffer[i], m->effort._buffer[i]);
            printf("\n");
        }
        TAKE(wrench, geometry_msgs_msg_dds__WrenchStamped_, m)
        printf("wrench,%.9f,%s,%.9g,%.9g,%.9g\n", seconds(&m->header), m->header.frame_id,
               m->wrench.force.x, m->wrench.force.y, m->wrench.force.z);
        TAKE(pose, geometry_msgs_msg_dds__PoseStamped_, m)
        printf("pose,%.9f,%s,%.9g,%.9g,%.9g,%g\n", seconds(&m->header), m->header.frame_id,
               m->pose.position.x, m->pose.position.y, m->pose.position.z, m->pose.orientation.w);
        TAKE(fault, std_msgs_msg_dds__String_, m) printf("fault,%s\n", m->data);
        dds_sleepfor(DDS_MSECS(5));
    }
    dds_delete(participant);
    return 0;
}
