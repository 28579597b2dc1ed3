/* SPDX-License-Identifier: MIT */
/*
 * What the forces on the tools have not done of the energy's change, and how it is made good.
 *
 * The force is the gradient of the energy as far as the lattice's own way is known (gradient.c).
 * Over sharp edges, into folds and between regions it is not quite, and a hand that went round a
 * closed path would gain or lose energy. So a balance is kept. Between two solved ticks tool t goes
 * by dx_t and turns by da_t, and the energy goes from E' to E:
 *
 *     owed += E' - E - sum_t ((F'_t + F_t) / 2 . dx_t + (M'_t + M_t) / 2 . da_t)
 *
 * which stays 0 where F is exact. It is repaid along the way s_t that what holds the tools goes, as
 * a part of F_t that changes by STEP |F_t| in a tick at most, unless F_t falls faster:
 *
 *     R_t = owed s_t / ((s + still) (s + way)),   s^2 = sum_t |s_t|^2,   |R_t| <= MOST |F_t|
 *
 * and by its turn in the same manner, which counts as a way at the arm of the tool's size: with the motion what is owed to the hand, against it what the hand owes. At rest it fades: a hand
 * then feels of it only what friction and changes of level still move its spring by. Over a closed
 * path the work is what `owed` has changed by. What is more than OWED of the energy that was stored
 * of late is forgiven, and so is what is owed when the last tool lets go; the energy of a tool that
 * comes or goes while others press is not counted. Zones take energy up by themselves, as their
 * joints and seams move: of a multizone model nothing is counted or repaid.
 */
#ifndef PALP_CONTACT_REPAY_H
#define PALP_CONTACT_REPAY_H

#include "core/contact/contact.h"

/* The tools at the end of the last solved tick. */
typedef struct {
    float energy_J;
    palp_frame rest[PALP_CONTACT_TOOLS];
    palp_vec3 force_N[PALP_CONTACT_TOOLS], moment_Nm[PALP_CONTACT_TOOLS];
} palp_contact_past;

palp_contact_past palp_contact_past_of(const palp_contact *contact);

/* Balances and repays, at the end of a tick: adds contact->repaid_N to the forces and to where
 * tools come to rest. */
void palp_contact_repay(palp_contact *contact, const palp_contact_past *past);

#endif
