/* SPDX-License-Identifier: MIT */
/*
 * Palp: feel deformable objects in bounded time.
 *
 * A *blob* holds the Green's functions of one elastic body, precomputed and wavelet-compressed by
 * `palp bake`. Everything here reads it in place, in memory that the caller owns, without
 * allocation, recursion, I/O, locks or libm, in single precision and in one fixed order of
 * operations, so that the same blob and the same frames give the same bits on every platform.
 *
 *     palp_blob blob;
 *     palp_blob_open(&blob, data, bytes);                          once: everything is checked here
 *     palp_servo_open(&servo, &blob, &config, memory, size, NULL); once: refuses what is too slow
 *     n = palp_servo_tick(servo, &input, out, &report);            every millisecond
 *
 * Layers, each standing on those above it:
 *   base/   status codes, vectors, small dense factorisations, CRC, arena
 *   budget/ kinds of work, unit costs per target
 *   blob/   format, validation, typed views
 *   green/  wavelets, columns, constraint hierarchy, general capacitance matrix algorithm, deformed
 *           field, display surface
 *   zone/   multizone models: configurations, seams, the posed model as contact sees it
 *   dyna/   dynamic bodies: tetrahedra at several resolutions, adaptive in space and time (stands
 *           on blob alone)
 *   surface/ the surface of a body or a zone: its points, and how it gives way between them
 *   contact/ tools, contact points that travel with them, contact with its exact gradient, zones
 *           before zones, friction; imposed motion on dynamic bodies
 *   haptic/ virtual coupling that foresees
 *   device/ CAN frames, drive protocols, mechanisms, bus load (stands on base alone)
 *   servo/  cost bounds, bounded-time answer, safety, passivity, output chain, the tick; the
 *           bounded tick of a dynamic body
 *
 * Functions return palp_status where they can fail; a failed call leaves state untouched. Units are
 * SI and part of each name that has one. Costs are given in the counts of the blob and of the
 * limits.
 */
#ifndef PALP_H
#define PALP_H

#ifdef __cplusplus
extern "C" {
#endif

#include "core/base/status.h"
#include "core/base/version.h"
#include "core/blob/blob.h"
#include "core/device/busload.h"
#include "core/device/cia402.h"
#include "core/device/moteus.h"
#include "core/device/odrive.h"
#include "core/device/profile.h"
#include "core/dyna/adapt.h"
#include "core/dyna/skin.h"
#include "core/green/cma.h"
#include "core/green/detail.h"
#include "core/green/field.h"
#include "core/servo/answer.h"
#include "core/servo/dynamic.h"
#include "core/servo/servo.h"
#include "core/zone/assembly.h"

#ifdef __cplusplus
}
#endif

#endif
