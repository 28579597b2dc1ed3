/* SPDX-License-Identifier: MIT */
#include "core/contact/repay.h"
#include "core/contact/contact_internal.h"

#define MOST 0.02f    /* of a tool's force: well below what a hand notices */
#define STEP 1e-3f    /* of it, by which what is repaid changes in a tick at most */
#define WAY 0.5f      /* cells over which what is owed is repaid */
#define OWED 0.5f     /* most that is owed, over the energy of late; */
#define FADING 0.999f /* share of which lasts for a tick */
#define STILL 2e-3f   /* cells in a tick below which a hand rests */

palp_contact_past palp_contact_past_of(const palp_contact *c) {
    palp_contact_past past = {.energy_J = c->energy_J};
    for (uint32_t t = 0; t < c->tool_count; t++) {
        past.rest_m[t] = c->rest_m[t];
        past.force_N[t] = c->force_N[t];
    }
    return past;
}

static bool pressed(const palp_contact_past *past, uint32_t t) {
    return palp_dot(past->force_N[t], past->force_N[t]) > 0.0f;
}

/* Whether a tool pressed in both ticks. */
static bool presses(const palp_contact *c, const palp_contact_past *past, uint32_t t) {
    return c->normal_N[t] > 0.0f && pressed(past, t);
}

/* Whether all tools that press did so before: the energy of one that comes or goes is its own. */
static bool all_stay(const palp_contact *c, const palp_contact_past *past) {
    for (uint32_t t = 0; t < c->tool_count; t++) {
        if (pressed(past, t) != (c->normal_N[t] > 0.0f)) return false;
    }
    return true;
}

/* How far a tool's holder has gone. The tool on its spring also moves by what is repaid, which
 * would seem to be a reason for more. */
static palp_vec3 way_of(const palp_contact *c, uint32_t t) {
    return palp_sub(c->spring[t].held_m, c->held_before_m[t]);
}

/* What the forces have left undone of the energy's change. */
static float undone_J(const palp_contact *c, const palp_contact_past *past) {
    float sum = past->energy_J - c->energy_J;
    for (uint32_t t = 0; t < c->tool_count; t++) {
        const palp_vec3 mean = palp_scale(0.5f, palp_add(past->force_N[t], c->force_N[t]));
        if (presses(c, past, t)) sum -= palp_dot(mean, palp_sub(c->rest_m[t], past->rest_m[t]));
    }
    return sum;
}

/* A force more on a tool, which moves it on its spring. */
static void add_force(palp_contact *c, uint32_t t, palp_vec3 by_N) {
    const float k = c->spring[t].stiffness_N_per_m;
    c->repaid_N[t] = palp_add(c->repaid_N[t], by_N);
    c->force_N[t] = palp_add(c->force_N[t], by_N);
    if (k > 0.0f) c->rest_m[t] = palp_madd(c->rest_m[t], 1.0f / k, by_N);
}

static void repay(palp_contact *c, const palp_contact_past *past) {
    float way2 = 0.0f, cell = 0.0f;
    const bool stay = all_stay(c, past);
    for (uint32_t t = 0; t < c->tool_count; t++) {
        const palp_vec3 before = c->repaid_N[t], d = way_of(c, t);
        c->repaid_N[t] = (palp_vec3){0};
        if (!presses(c, past, t)) continue;
        add_force(c, t, before); /* what is undone is so beside what is repaid already */
        way2 += palp_dot(d, d);
        cell = palp_max(cell, palp_contact_cell(c, t));
    }
    c->stored_J = palp_max(c->energy_J, FADING * c->stored_J);
    if (!(cell > 0.0f)) {
        c->owed_J = c->stored_J = 0.0f;
        return;
    }
    const float way = palp_sqrt(way2), most = OWED * c->stored_J, owed = c->owed_J;
    const float now = stay ? owed + undone_J(c, past) : owed;
    const float share = now / ((way + STILL * cell) * (way + WAY * cell));
    for (uint32_t t = 0; t < c->tool_count; t++) {
        if (!presses(c, past, t)) continue;
        const palp_vec3 before = c->repaid_N[t];
        const float force = palp_norm(palp_sub(c->force_N[t], before));
        const palp_vec3 change = palp_sub(palp_scale(share, way_of(c, t)), before);
        const palp_vec3 repaid = palp_contact_at_most(
            palp_add(before, palp_contact_at_most(change, STEP * force)), MOST * force);
        add_force(c, t, palp_sub(repaid, before));
    }
    c->owed_J = palp_clamp(stay ? owed + undone_J(c, past) : owed, -most, most);
}

void palp_contact_repay(palp_contact *c, const palp_contact_past *past) {
    if (c->assembly == NULL) repay(c, past);
    for (uint32_t t = 0; t < c->tool_count; t++) c->held_before_m[t] = c->spring[t].held_m;
}
