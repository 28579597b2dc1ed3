/* SPDX-License-Identifier: MIT */
/* Joints of multizone models as people name them. */
#ifndef PALP_HOST_JOINTS_H
#define PALP_HOST_JOINTS_H

#include "core/zone/zones.h"

/* The joint of that name; exits 2 if there is none that has a value. */
uint32_t find_joint(const char *where, const palp_zones *zones, const char *name);

/* Exits 2 if a value is out of its limits. */
void check_joint(const char *where, const palp_zones *zones, uint32_t joint, double value);

#endif
