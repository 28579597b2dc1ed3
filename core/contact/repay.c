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
        past.rest[t] = c->rest[t];
        past.force_N[t] = c->force_N[t];
        past.moment_Nm[t] = c->moment_Nm[t];
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

/* A motion, or what does work in it: along, and about the reference point at the arm of the tool's
 * size. */
typedef struct {
    palp_vec3 along, about;
} motion;

/* How far a tool's holder has gone. The tool on its spring also moves by what is repaid, which
 * would seem to be a reason for more. */
static motion way_of(const palp_contact *c, uint32_t t) {
    const palp_frame *now = &c->spring[t].held, *before = &c->held_before[t];
    const palp_vec3 turn = palp_turn_between(before->r, now->r);
    return (motion){palp_sub(now->t, before->t),
                    palp_scale(palp_tool_size(&c->tools[t]),
                               palp_tool_turned(&c->tools[t], &c->patch[t].at, turn))};
}

/* What the forces have left undone of the energy's change. */
static float undone_J(const palp_contact *c, const palp_contact_past *past) {
    float sum = past->energy_J - c->energy_J;
    for (uint32_t t = 0; t < c->tool_count; t++) {
        if (!presses(c, past, t)) continue;
        const palp_vec3 force = palp_scale(0.5f, palp_add(past->force_N[t], c->force_N[t]));
        const palp_vec3 moment = palp_scale(0.5f, palp_add(past->moment_Nm[t], c->moment_Nm[t]));
        sum -= palp_dot(force, palp_sub(c->rest[t].t, past->rest[t].t));
        sum -= palp_dot(moment, palp_turn_between(past->rest[t].r, c->rest[t].r));
    }
    return sum;
}

/* A force and a moment more on a tool, which move it on its springs. */
static void add_force(palp_contact *c, uint32_t t, motion by_N) {
    const palp_vec3 moment = palp_scale(palp_tool_size(&c->tools[t]), by_N.about);
    c->repaid_N[t] = palp_add(c->repaid_N[t], by_N.along);
    c->force_N[t] = palp_add(c->force_N[t], by_N.along);
    c->repaid_Nm[t] = palp_add(c->repaid_Nm[t], moment);
    c->moment_Nm[t] = palp_add(c->moment_Nm[t], moment);
    palp_contact_rest(c, t);
}

static motion repaid_of(const palp_contact *c, uint32_t t) {
    return (motion){c->repaid_N[t],
                    palp_scale(1.0f / palp_tool_size(&c->tools[t]), c->repaid_Nm[t])};
}

/* From what was repaid to `wanted`, no faster than may be and no more. */
static palp_vec3 step_to(palp_vec3 wanted, palp_vec3 before, float force_N) {
    const palp_vec3 change = palp_at_most(palp_sub(wanted, before), STEP * force_N);
    return palp_sub(palp_at_most(palp_add(before, change), MOST * force_N), before);
}

static void repay(palp_contact *c, const palp_contact_past *past) {
    float way2 = 0.0f, cell = 0.0f;
    const bool stay = all_stay(c, past);
    for (uint32_t t = 0; t < c->tool_count; t++) {
        const motion before = repaid_of(c, t), d = way_of(c, t);
        c->repaid_N[t] = c->repaid_Nm[t] = (palp_vec3){0};
        if (!presses(c, past, t)) continue;
        add_force(c, t, before); /* what is undone is so beside what is repaid already */
        way2 += palp_dot(d.along, d.along) + palp_dot(d.about, d.about);
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
        const motion before = repaid_of(c, t), d = way_of(c, t);
        const float force = palp_norm(palp_sub(c->force_N[t], before.along));
        add_force(c, t,
                  (motion){step_to(palp_scale(share, d.along), before.along, force),
                           step_to(palp_scale(share, d.about), before.about, force)});
    }
    c->owed_J = palp_clamp(stay ? owed + undone_J(c, past) : owed, -most, most);
}

void palp_contact_repay(palp_contact *c, const palp_contact_past *past) {
    if (c->assembly == NULL) repay(c, past);
    for (uint32_t t = 0; t < c->tool_count; t++) c->held_before[t] = c->spring[t].held;
}
