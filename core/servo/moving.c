/* SPDX-License-Identifier: MIT */
#include "core/servo/moving.h"

#define FADE_S 0.05f /* in which what a change of the seams' level held back fades */

static const palp_seam_cost *cost_at(const palp_moving *m, uint32_t level) {
    return &m->seam_cost[level == PALP_DIAGONAL ? PALP_SEAM_LEVELS : level];
}

const palp_seam_cost *palp_moving_cost(const palp_moving *moving) {
    return cost_at(moving, moving->contact->assembly->level);
}

void palp_moving_init(palp_moving *m, palp_contact *contact, const palp_prices *price, float dt_s,
                      float share_ns, uint32_t points) {
    const palp_assembly *a = contact->assembly;
    const palp_seams *q = &a->seams;
    *m = (palp_moving){.contact = contact,
                       .price = *price,
                       .dt_s = dt_s,
                       .share_ns = share_ns,
                       .barred = PALP_NONE};
    float modes = 0.0f, all = 3.0f * (float)q->modes;
    for (uint32_t z = 0; z < a->zones->meta->zones; z++) {
        modes = palp_max(modes, palp_assembly_modes(a, z));
        all += 3.0f * (float)a->zones->zone[z].modes;
    }
    const float sides = contact->pairs ? 2.0f : 1.0f, zones = (float)a->zones->meta->zones;
    m->load_ns = (float)points * sides * 3.0f *
                     (price->of[PALP_WORK_POSITION] + modes * price->of[PALP_WORK_POSITION_MODE]) +
                 zones * (float)points * price->of[PALP_WORK_PRESSED] +
                 4.0f * all * price->of[PALP_WORK_SEAM_ROW] +
                 zones * modes * price->of[PALP_WORK_SEAM_MODE];
    for (uint32_t k = 0; k <= PALP_SEAM_LEVELS; k++) {
        uint32_t level = k == PALP_SEAM_LEVELS ? PALP_DIAGONAL : k;
        palp_seam_cost c = {.factor = palp_seams_cost_factor(q, price, level),
                            .step = palp_seams_cost_step(q, price, level),
                            .settle = palp_assembly_cost_settle(a, price, level),
                            .solve = palp_seams_cost_solve(q, price, level),
                            .forward = palp_seams_cost_forward(q, price, level)};
        for (uint32_t s = 0; s < q->zones->meta->seams; s++)
            c.unknowns += 3.0f * (float)palp_seam_modes(q, s, level);
        m->seam_cost[k] = c;
    }
}

/* Cost of what follows a factor on `level`, and of handing over the forces of the last tick. */
static float cost_after(const palp_moving *m, uint32_t level) {
    const palp_seam_cost *c = cost_at(m, level);
    return 2.0f * c->settle + 2.0f * c->solve + m->load_ns + c->contact;
}

static float cost_of(const palp_moving *m, uint32_t level) {
    return cost_at(m, level)->factor + cost_after(m, level);
}

float palp_moving_cost_of(const palp_moving *moving, uint32_t level) {
    return cost_of(moving, level);
}

float palp_moving_least(const palp_moving *moving) { return cost_of(moving, PALP_DIAGONAL); }

/* Makes the factor on `level`, looking at the clock before every step; false if that took too long
 * for `keep_ns` to be left, or it is not sound. */
static bool make_factor(palp_moving *m, const palp_deadline *d, uint32_t level, float keep_ns) {
    bool smooth = m->report.drift <= PALP_REUSE_FAR;
    palp_assembly *a = m->contact->assembly;
    float step_ns = cost_at(m, level)->step;
    palp_seams_begin(&a->seams, a->configuration, level);
    /* at most 2 * seams */
    while (palp_seams_step(&a->seams)) {
        if (level != PALP_DIAGONAL && step_ns + keep_ns > palp_left_ns(d)) return false;
    }
    return palp_assembly_take(a, smooth);
}

/* The finest level, `from` or coarser, that is done in time. */
static void renew(palp_moving *m, const palp_deadline *d, uint32_t from) {
    float least_ns = cost_of(m, PALP_DIAGONAL);
    for (uint32_t k = from + 1u; k-- > 0u;) {
        if (cost_of(m, k) <= palp_left_ns(d) &&
            make_factor(m, d, k, palp_max(cost_after(m, k), least_ns)))
            return;
        m->report.aborted++;
    }
    (void)make_factor(m, d, PALP_DIAGONAL, 0.0f);
}

/* A finer factor from spare time, if the configuration is still the one that it was made for. */
static bool take_finer(palp_moving *m, const palp_deadline *d) {
    palp_assembly *a = m->contact->assembly;
    const palp_seam_factor *f = &a->seams.factor[1u - a->seams.now];
    if (!m->finer || f->step < f->steps) return false;
    m->finer = false;
    if (cost_after(m, f->level) > palp_left_ns(d)) {
        m->barred = f->level;
        return false;
    }
    return palp_assembly_take(a, true);
}

void palp_moving_tick(palp_moving *m, const palp_deadline *deadline) {
    palp_assembly *a = m->contact->assembly;
    float drift = palp_assembly_drift(a);
    bool near = palp_contact_near(m->contact);
    palp_assembly_relax(a, palp_min(m->dt_s / FADE_S, 1.0f));
    palp_contact_load_seams(m->contact);
    m->report = (palp_moving_report){.drift = drift};
    bool approximate = a->level == PALP_DIAGONAL;
    bool fits = cost_after(m, a->level) <= palp_left_ns(deadline);
    bool reuse = fits && (approximate ? !(drift > 0.0f)
                                      : drift <= (near ? PALP_REUSE_NEAR : PALP_REUSE_FAR));
    if (reuse) {
        if (drift > PALP_REUSE_NEAR) m->finer = false;
        palp_assembly_settle(a);
        (void)take_finer(m, deadline);
    } else {
        m->finer = false;
        /* The displacement that a change of level is compared with; without time for it, that of
         * the last tick. */
        float before_ns = cost_at(m, a->level)->settle + cost_of(m, PALP_DIAGONAL);
        if (drift <= PALP_REUSE_FAR && before_ns <= palp_left_ns(deadline)) palp_assembly_settle(a);
        m->barred = PALP_NONE;
        renew(m, deadline, a->seams.finest);
        m->report.renewed = true;
    }
    m->report.level = a->level;
}

void palp_moving_spare(palp_moving *m, const palp_deadline *deadline) {
    palp_assembly *a = m->contact->assembly;
    palp_seams *q = &a->seams;
    uint32_t next = a->level == PALP_DIAGONAL ? 0u : a->level + 1u;
    if (palp_assembly_drift(a) > PALP_REUSE_NEAR || a->level == q->finest) return;
    if (m->barred == next) return; /* it was not sound, or not affordable, in this configuration */
    if (!m->finer) {
        if (cost_after(m, next) > 0.5f * m->share_ns) return;
        palp_seams_begin(q, a->configuration, next);
        m->finer = true;
    }
    float step_ns = cost_at(m, next)->step;
    /* at most 2 * seams */
    while (step_ns <= palp_left_ns(deadline) && palp_seams_step(q)) {}
    if (!q->factor[1u - q->now].sound) m->barred = next;
}
