/* SPDX-License-Identifier: MIT */
#include "core/contact/repay.h"
#include "core/contact/contact_internal.h"

#define MOST 0.02f  /* of a tool's force: well below what a hand notices */
#define STEP 1e-3f  /* of it, by which what is repaid changes in a tick at most */
#define WAY 0.5f    /* cells over which what is owed is repaid */
#define STILL 2e-3f /* cells in a tick below which a hand rests */

palp_contact_past palp_contact_past_of(const palp_contact *contact) {
    const palp_contact *c = contact;
    palp_contact_past past = {.energy_J = c->energy_J};
    for (uint32_t t = 0; t < c->tool_count; t++) {
        past.rest_m[t] = c->rest_m[t];
        past.force_N[t] = c->force_N[t];
    }
    return past;
}

static bool frames_moved(const palp_contact *c) {
    float moved = 0.0f;
    for (uint32_t b = 0; b < c->bodies && c->frame != NULL; b++) {
        const palp_frame *now = &c->frame[b], *before = &c->frame_before[b];
        for (uint32_t k = 0; k < 9u; k++) moved += palp_abs(now->r[k] - before->r[k]);
        moved += palp_norm(palp_sub(now->t, before->t));
    }
    return moved > 0.0f;
}

/* Whether a tool pressed in both ticks; what was not touched before owes nothing. */
static bool presses(const palp_contact *c, const palp_contact_past *past, uint32_t t) {
    return c->normal_N[t] > 0.0f && palp_dot(past->force_N[t], past->force_N[t]) > 0.0f;
}

/* How far a tool's holder has gone. The tool on its spring also moves by what is repaid, which
 * would seem to be a reason for more. */
static palp_vec3 way_of(const palp_contact *c, uint32_t t) {
    return palp_sub(c->spring[t].held_m, c->held_before_m[t]);
}

/* What the forces have done on the tools. */
static float work_J(const palp_contact *c, const palp_contact_past *past) {
    float work = 0.0f;
    for (uint32_t t = 0; t < c->tool_count; t++) {
        const palp_vec3 mean = palp_scale(0.5f, palp_add(past->force_N[t], c->force_N[t]));
        if (presses(c, past, t)) work += palp_dot(mean, palp_sub(c->rest_m[t], past->rest_m[t]));
    }
    return work;
}

static float cell_m(const palp_contact *c, uint32_t t) {
    const float spacing = c->patch[t].lattice.used.spacing;
    const palp_tool *tool = &c->tools[t];
    return palp_lattice_is_central(tool) ? spacing * palp_tool_size(tool) : spacing;
}

static void repay(palp_contact *c, const palp_contact_past *past) {
    float way2 = 0.0f, cell = 0.0f;
    palp_vec3 before_N[PALP_CONTACT_TOOLS];
    for (uint32_t t = 0; t < c->tool_count; t++) {
        before_N[t] = c->repaid_N[t];
        c->repaid_N[t] = (palp_vec3){0};
        if (!presses(c, past, t)) continue;
        const palp_vec3 d = way_of(c, t);
        way2 += palp_dot(d, d);
        cell = palp_max(cell, cell_m(c, t));
    }
    if (!(cell > 0.0f) || !(past->energy_J > 0.0f) || frames_moved(c)) {
        c->owed_J = 0.0f;
        return;
    }
    const float way = palp_sqrt(way2);
    const float before = c->owed_J + past->energy_J - c->energy_J;
    const float share = (before - work_J(c, past)) / ((way + STILL * cell) * (way + WAY * cell));
    for (uint32_t t = 0; t < c->tool_count; t++) {
        if (!presses(c, past, t)) continue;
        const float force = palp_norm(c->force_N[t]);
        const palp_vec3 change = palp_sub(palp_scale(share, way_of(c, t)), before_N[t]);
        const palp_vec3 repaid = palp_contact_at_most(
            palp_add(before_N[t], palp_contact_at_most(change, STEP * force)), MOST * force);
        const float k = c->spring[t].stiffness_N_per_m;
        c->repaid_N[t] = repaid;
        c->force_N[t] = palp_add(c->force_N[t], repaid);
        if (k > 0.0f) c->rest_m[t] = palp_madd(c->rest_m[t], 1.0f / k, repaid);
    }
    c->owed_J = before - work_J(c, past);
}

void palp_contact_repay(palp_contact *contact, const palp_contact_past *past) {
    palp_contact *c = contact;
    repay(c, past);
    for (uint32_t t = 0; t < c->tool_count; t++) c->held_before_m[t] = c->spring[t].held_m;
}
