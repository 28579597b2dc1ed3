/* SPDX-License-Identifier: MIT */
/* The forces of the last solved contact as loads on nodes, for the display (green/field.h). */
#ifndef PALP_CONTACT_LOADS_H
#define PALP_CONTACT_LOADS_H

#include "core/contact/contact.h"
#include "core/green/field.h"

/* Loads so far, with room for `capacity`. */
typedef struct {
    palp_load *load;
    uint32_t count, capacity;
} palp_load_list;

/*
 * Adds what one patch does to one of its bodies to the list, a tool's friction (in that body's
 * frame) shared out like the pressure. A
 * force within a triangle goes to its corners with the barycentric weights, one on a node finer
 * than the constraint level to its parents in equal parts, one on a fixed node to the support. At
 * most `capacity` loads are made: forces beyond are added to the last one. Patch t is tool t.
 * friction_N: on the tool. Cost: 3 active points times (capacity + levels).
 */
void palp_contact_loads(const palp_contact *contact, uint32_t patch, uint32_t body,
                        palp_vec3 friction_N, palp_load_list *list);

#endif
