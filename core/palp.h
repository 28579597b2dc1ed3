/* SPDX-License-Identifier: MIT */
/*
 * Palp: feel deformable objects in bounded time.
 *
 * A *blob* holds the Green's functions of one elastic body (or of the zones of a multizone model,
 * or the meshes of a dynamic one), precomputed by `palp bake`. This library reads it in place, in
 * memory that the caller owns, in single precision and in one fixed order of operations: the same
 * blob and the same input give the same bits on every platform.
 *
 * Order of calls
 *
 *     one body on a haptic device       palp_blob_open, palp_servo_memsize, palp_servo_open;
 *                                       then palp_servo_tick once a period
 *     several devices, tools, bodies    open each body's file; palp_scene_memsize, palp_scene_open;
 *     of any engine                     then once a period palp_scene_pose for models that are moved
 *                                       by the caller, palp_scene_tick, palp_scene_spare
 *     tools without a device            palp_blob_open, palp_answer_memsize, palp_answer_init;
 *                                       set coupling.tool[t].stiffness_N_per_m (above 0) and
 *                                       damping of each tool; then palp_answer_tick
 *     a multizone model                 palp_zones_open, palp_assembly_memsize, palp_assembly_init,
 *                                       palp_answer_memsize, palp_answer_init, stiffness as
 *                                       above; then palp_answer_pose, palp_answer_tick and
 *                                       palp_answer_spare
 *     a dynamic body                    palp_tets_open, palp_dynamic_memsize, palp_dynamic_init;
 *                                       then palp_dynamic_tick
 *     any boundary value problem        palp_blob_open, palp_cma_memsize, palp_cma_init,
 *                                       palp_cma_prescribe for each condition, palp_cma_solve
 *     the deformed surface, to look at  palp_blob_open, palp_field_memsize, palp_field_init; then
 *                                       palp_field_update (with palp_servo_loads),
 *                                       palp_field_reconstruct
 *
 * Rules that hold for every function, unless it says otherwise
 *
 *     memory    Nothing is allocated. An init lays its object out in one block: at least
 *               memsize bytes, beginning at a multiple of PALP_ALIGN. NULL or a shorter block is
 *               MEMORY, a misaligned one ALIGNMENT. The block belongs to the object until the
 *               caller no longer uses it; there is nothing to close.
 *     lifetime  What is given to an init by pointer (blob bytes, tools, zones, targets, the port's
 *               context) is kept by reference and has to stay where it is, unchanged. Objects are
 *               not to be moved or copied after their init. Pointers returned point into the
 *               object and hold until its next call.
 *     failure   A call that fails has changed nothing, except that an object whose open or init
 *               failed is not to be used before an init succeeds. Ticks and other calls that return
 *               no palp_status cannot fail: they clamp, count and report.
 *     NULL      Pointers must not be NULL where a comment does not allow it.
 *     aliasing  Output must not overlap input or the block of any object.
 *     threads   An object is used by one thread at a time. There are no globals that change, so
 *               different objects may be used by different threads, on one and the same blob.
 *     time      No function waits, locks, recurses, does input or output, or calls libc but for
 *               memcpy, memmove, memset and memcmp. Every loop is bounded by counts of the blob
 *               and of the limits given at init; costs are stated in these. A clock is read only
 *               through palp_port.
 *     stack     At most PALP_SERVO_STACK bytes, any call, besides what the port's clock takes.
 *     numbers   SI units, in each name that has one (_m _N _s _rad _N_per_m). Numbers from outside
 *               may be anything, NaN too, where a function says which error it returns or that it
 *               clamps; elsewhere they must be finite.
 *
 * Folders, each standing on those above it (core/README.md)
 *
 *     base/     status codes, vectors, small dense factorisations, CRC, arena
 *     budget/   kinds of work, unit costs per target
 *     blob/     format, validation, typed views
 *     green/    wavelets, columns, constraint hierarchy, general capacitance matrix algorithm,
 *               deformed field, display surface
 *     zone/     multizone models: configurations, seams, the posed model as contact sees it
 *     dyna/     dynamic bodies: tetrahedra at several resolutions, adaptive in space and time
 *               (stands on blob alone)
 *     surface/  the surface of a body or a zone: its points, and its compliance between them
 *     contact/  tools, contact points that travel with them, contact with its exact gradient,
 *               contact between zones, friction; imposed motion on dynamic bodies
 *     haptic/   virtual coupling; proxies on dynamic bodies
 *     device/   CAN frames, drive protocols, mechanisms, bus load (stands on base alone)
 *     servo/    cost bounds, bounded-time answers, safety, passivity, output chain; devices and
 *               bodies of a scene, its tick
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
