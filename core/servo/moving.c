/* SPDX-License-Identifier: MIT */
/* The bounded-time answer, second half: keeping up with a multizone model that moves. */
#include "bounded.h"

#define FADE_S 0.05f /* in which what a change of the seams' level held back fades */

static const palp_seam_cost *cost_at(const palp_bounded *b, uint32_t level) {
    return &b->seam_cost[level == PALP_DIAGONAL ? PALP_SEAM_LEVELS : level];
}

void palp_moving_costs(palp_bounded *bounded) {
    const palp_assembly *a = bounded->config.assembly;
    const palp_seams *q = &a->seams;
    const palp_prices *price = &bounded->bound.price;
    for (uint32_t k = 0; k <= PALP_SEAM_LEVELS; k++) {
        uint32_t level = k == PALP_SEAM_LEVELS ? PALP_DIAGONAL : k;
        palp_seam_cost c = {.factor = palp_seams_cost_factor(q, price, level),
                            .step = palp_seams_cost_step(q, price, level),
                            .settle = palp_assembly_cost_settle(a, price, level),
                            .solve = palp_seams_cost_solve(q, price, level)};
        for (uint32_t s = 0; s < q->zones->meta->seams; s++)
            c.unknowns += 3.0f * (float)palp_seam_modes(q, s, level);
        bounded->seam_cost[k] = c;
    }
}

/* What follows a factor on `level` before the contact can be solved, and what the forces of the
 * last tick cost to hand over. */
static float cost_after(const palp_bounded *b, uint32_t level, uint32_t count) {
    const palp_seam_cost *c = cost_at(b, level);
    return 2.0f * c->settle + 2.0f * c->solve +
           palp_cost_follow(&b->bound, count, b->config.limits.max_active, c->unknowns, c->solve);
}

static float cost_of(const palp_bounded *b, uint32_t level, uint32_t count) {
    return cost_at(b, level)->factor + cost_after(b, level, count);
}

float palp_moving_cost_least(const palp_bounded *bounded, uint32_t count) {
    return cost_of(bounded, PALP_DIAGONAL, count);
}

void palp_bounded_pose(palp_bounded *bounded, const float *value, const palp_frame *root) {
    if (bounded->config.assembly != NULL) palp_assembly_pose(bounded->config.assembly, value, root);
}

/* Makes the factor on `level`, looking at the clock before every step; false if that took too long
 * for `keep_ns` to be left, or it is not sound. */
static bool make_factor(palp_bounded *b, uint32_t level, float keep_ns) {
    bool smooth = b->moving.drift <= PALP_REUSE_FAR;
    palp_assembly *a = b->config.assembly;
    float step_ns = cost_at(b, level)->step;
    palp_seams_begin(&a->seams, a->posture, level);
    /* at most two steps a seam */
    while (palp_seams_step(&a->seams)) {
        if (level != PALP_DIAGONAL && step_ns + keep_ns > palp_bounded_left_ns(b)) return false;
    }
    return palp_assembly_take(a, smooth);
}

/* The finest level, `from` or coarser, that is done in time. */
static void renew(palp_bounded *b, uint32_t from, uint32_t count, float rest_ns) {
    float least_ns = rest_ns + cost_of(b, PALP_DIAGONAL, count);
    for (uint32_t k = from + 1u; k-- > 0u;) {
        float need_ns = cost_of(b, k, count) + rest_ns;
        if (need_ns <= palp_bounded_left_ns(b)) {
            float after_ns = cost_after(b, k, count) + rest_ns;
            if (make_factor(b, k, palp_max(after_ns, least_ns))) return;
        }
        b->moving.aborted++;
    }
    (void)make_factor(b, PALP_DIAGONAL, 0.0f);
}

static void note_level(palp_bounded *b) {
    palp_assembly *a = b->config.assembly;
    b->moving.level = a->level;
    const palp_seam_cost *c = cost_at(b, a->level);
    b->bound.unknowns = c->unknowns;
    b->bound.seam_row = 0.5f * c->solve + c->unknowns * b->bound.price.of[PALP_WORK_SEAM_MODE];
}

/* A finer factor from spare time, if the posture is still the one that it was made for. */
static bool take_finer(palp_bounded *b, uint32_t count, float rest_ns) {
    palp_assembly *a = b->config.assembly;
    const palp_seam_factor *f = &a->seams.factor[1u - a->seams.now];
    if (!b->finer || f->step < f->steps) return false;
    b->finer = false;
    if (cost_after(b, f->level, count) + rest_ns > palp_bounded_left_ns(b)) {
        b->barred = f->level;
        return false;
    }
    return palp_assembly_take(a, true);
}

void palp_moving_tick(palp_bounded *bounded, float rest_ns) {
    palp_bounded *b = bounded;
    palp_assembly *a = b->config.assembly;
    palp_node_contact *c = &b->contact;
    float drift = palp_assembly_drift(a);
    bool near = c->count > 0u;
    palp_assembly_relax(a, palp_min(b->config.dt_s / FADE_S, 1.0f));
    palp_node_contact_load(c, a);
    b->moving = (palp_moving_report){.drift = drift};
    bool approximate = a->level == PALP_DIAGONAL;
    float settle_ns = cost_after(b, a->level, c->count);
    bool fits = settle_ns + rest_ns <= palp_bounded_left_ns(b);
    bool reuse = fits && (approximate ? !(drift > 0.0f)
                                      : drift <= (near ? PALP_REUSE_NEAR : PALP_REUSE_FAR));
    if (reuse) {
        if (drift > PALP_REUSE_NEAR) b->finer = false;
        palp_assembly_settle(a);
        (void)take_finer(b, c->count, rest_ns);
    } else {
        b->finer = false;
        /* What a change of level is measured against; without time for it, the last tick's will do.
         */
        float before_ns = cost_at(b, a->level)->settle + cost_of(b, PALP_DIAGONAL, c->count);
        if (drift <= PALP_REUSE_FAR && before_ns + rest_ns <= palp_bounded_left_ns(b))
            palp_assembly_settle(a);
        b->barred = PALP_NONE;
        renew(b, a->seams.finest, c->count, rest_ns);
        b->moving.renewed = true;
    }
    palp_node_contact_follow(c);
    note_level(b);
}

/* The next finer level while the posture rests, as far as it would leave time for a tick. */
void palp_moving_spare(palp_bounded *bounded) {
    palp_bounded *b = bounded;
    palp_assembly *a = b->config.assembly;
    palp_seams *q = &a->seams;
    uint32_t count = b->contact.count;
    uint32_t next = a->level == PALP_DIAGONAL ? 0u : a->level + 1u;
    if (palp_assembly_drift(a) > PALP_REUSE_NEAR || a->level == q->finest) return;
    if (b->barred == next) return; /* it was not sound, or not affordable, in this posture */
    float share = b->config.cost.margin * 1e9f * b->config.dt_s;
    if (!b->finer) {
        if (cost_after(b, next, count) > 0.5f * share) return;
        palp_seams_begin(q, a->posture, next);
        b->finer = true;
    }
    float step_ns = cost_at(b, next)->step;
    /* at most two steps a seam */
    while (step_ns <= palp_bounded_left_ns(b) && palp_seams_step(q)) {}
    if (!q->factor[1u - q->now].sound) b->barred = next;
}
