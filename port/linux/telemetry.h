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
 * Built with Cyclone DDS when the Makefile finds it, else as a refusal.
 */
#ifndef PALP_PORT_TELEMETRY_H
#define PALP_PORT_TELEMETRY_H

#include "port/host/record.h"

typedef struct telemetry telemetry;

/* Exits 2 in a build without DDS, 1 when DDS does not come up. */
telemetry *telemetry_open(const palp_device *device);

/* Publishes a tick; what the middleware does not take is counted. Never called by the loop. */
void telemetry_publish(telemetry *t, const tick_record *tick);

/* Says how much was published and dropped. */
void telemetry_close(telemetry *t);

#endif
