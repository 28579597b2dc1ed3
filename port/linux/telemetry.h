/* SPDX-License-Identifier: MIT */
/*
 * Telemetry over DDS, off the real-time thread, as ROS 2 tools see it:
 *
 *   /palp/joint_states  sensor_msgs/JointState       position rad, velocity rad/s, effort Nm
 *   /palp/wrench        geometry_msgs/WrenchStamped  force at the tip, N
 *   /palp/pose          geometry_msgs/PoseStamped    the tip, m
 *   /palp/fault         std_msgs/String              state and faults when they change;
 *                                                    reliable, kept
 *
 * of the first device; of further ones under /palp/device1, /palp/device2 and so on.
 *
 * Built with Cyclone DDS when the Makefile finds it, else as a refusal.
 */
#ifndef PALP_PORT_TELEMETRY_H
#define PALP_PORT_TELEMETRY_H

#include "port/host/record.h"

typedef struct telemetry telemetry;

/* Exits 2 in a build without DDS, 1 when DDS does not come up. */
telemetry *telemetry_open(const palp_device *device, uint32_t number);

/* Publishes a tick of the device; what the middleware does not take is counted. Never called by the loop. */
void telemetry_publish(telemetry *t, const palp_report *r);

/* Says how much was published and dropped. */
void telemetry_close(telemetry *t);

#endif
