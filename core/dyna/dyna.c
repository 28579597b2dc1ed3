/* SPDX-License-Identifier: MIT */
#include "dyna.h"
#include "core/base/arena.h"

#define SAFETY 1.05f /* of the filter's mass over the least that is stable */
#define OVERSTRETCHED                                                                              \
    3.0f /* growth of the stiffness from which nodes lose speed when it grows further */
#define ADDED_MASS 0.005f /* of a level, on its slivers, rather than a finer step for all */
#define HEADROOM 1.3f /* growth of the stiffness that steps are chosen for, without the filter */

static void lay_out(palp_dyna *d, palp_arena *a) {
    const palp_tets_meta *m = d->tets->meta;
    size_t n = m->nodes;
    d->u_m = palp_take(a, 3u * n, sizeof(float));
    d->v_m_s = palp_take(a, 3u * n, sizeof(float));
    d->impulse_Ns = palp_take(a, 3u * n, sizeof(float));
    d->force_N = palp_take(a, 3u * n, sizeof(float));
    d->mass_kg = palp_take(a, n, sizeof(float));
    d->j_N_per_m = palp_take(a, n, sizeof(float));
    d->c_N_s_per_m = palp_take(a, n, sizeof(float));
    d->limit_s = palp_take(a, n, sizeof(float));
    d->stretch = palp_take(a, n, sizeof(float));
    d->overstretched = palp_take(a, n, sizeof(float));
    d->stiffness_ratio = palp_take(a, n, sizeof(float));
    d->state = palp_take(a, n, 1);
    d->active_flag = palp_take(a, n, 1);
    d->step_class = palp_take(a, n, 1);
    d->needed = palp_take(a, n, 1);
    d->borders = palp_take(a, n, 1);
    d->duty = palp_take(a, n, 1);
    d->split = palp_take(a, m->families + 1u, 1);
    d->cost = palp_take(a, m->families + 1u, sizeof(uint32_t));
    d->family_class = palp_take(a, m->families + 1u, 1);
    d->element_class = palp_take(a, m->tets, 1);
    d->skin_level = palp_take(a, m->skin, 1);
    d->active = palp_take(a, n, sizeof(uint32_t));
    d->up = palp_take(a, n, sizeof(uint32_t));
    d->down = palp_take(a, n, sizeof(uint32_t));
    d->element = palp_take(a, m->tets, sizeof(uint32_t));
}

size_t palp_dyna_memsize(const palp_tets *tets) {
    palp_dyna d = {.tets = tets};
    palp_arena a = {NULL, 0};
    lay_out(&d, &a);
    return a.used;
}

/* ---- what the material makes of the nodes ---- */

float palp_dyna_bound(const float s[static 6], float a, float b) {
    float trace = s[0] + s[1] + s[2];
    float yz = palp_abs(s[3]), zx = palp_abs(s[4]), xy = palp_abs(s[5]);
    float row = palp_max(palp_max(s[0] + xy + zx, s[1] + xy + yz), s[2] + yz + zx);
    return a * palp_min(trace, row) + b * trace;
}

/* The step up to which m >= dt^2 j + 2 dt c. */
static float limit(float m, float j, float c) { return m / (c + palp_sqrt(c * c + m * j)); }

static uint32_t class_for(const palp_dyna *d, float step_s) {
    uint32_t k = 0;
    /* at most most_class */
    for (float dt = d->config.tick_s; dt > step_s && k < d->config.most_class; dt *= 0.5f) k++;
    return k;
}

/* The mass that a step of dt_s needs. */
static float needed_mass(const palp_dyna *d, uint32_t node, float dt_s) {
    float j = d->j_N_per_m[node], c = d->c_N_s_per_m[node];
    return SAFETY * HEADROOM * dt_s * (dt_s * j + 2.0f * c);
}

/* The largest step for which the nodes first..end get heavier by ADDED_MASS at most. */
static float common_step(const palp_dyna *d, uint32_t first, uint32_t end) {
    float dt_s = d->config.tick_s;
    for (uint32_t k = 0; k < d->config.most_class; k++, dt_s *= 0.5f) {
        float mass = 0.0f, added = 0.0f;
        for (uint32_t i = first; i < end; i++) {
            mass += d->mass_kg[i];
            added += palp_max(needed_mass(d, i, dt_s) - d->mass_kg[i], 0.0f);
        }
        if (added <= ADDED_MASS * mass) break;
    }
    return dt_s;
}

static void weigh_level(palp_dyna *d, uint32_t level) {
    const palp_material *m = &d->config.material;
    uint32_t first = d->tets->meta->first_node[level], end = d->tets->meta->first_node[level + 1u];
    float share = 0.25f * d->tets->meta->theta[level];
    float stiff = palp_max(m->lambda_Pa + m->mu_Pa, 0.0f);
    float viscous = palp_max(m->phi_Pa_s + m->psi_Pa_s, 0.0f);
    for (uint32_t i = first; i < end; i++) {
        const palp_tet_node *n = &d->tets->node[i];
        d->mass_kg[i] = m->density_kg_m3 * n->volume_m3;
        d->j_N_per_m[i] = share * palp_dyna_bound(n->gradient_sum, stiff, m->mu_Pa);
        d->c_N_s_per_m[i] = share * palp_dyna_bound(n->gradient_sum, viscous, m->psi_Pa_s);
    }
    float dt_s = common_step(d, first, end);
    for (uint32_t i = first; i < end; i++) {
        if (dt_s * (float)(1u << d->config.most_class) > 1.5f * d->config.tick_s)
            d->mass_kg[i] = palp_max(d->mass_kg[i], needed_mass(d, i, dt_s));
        d->limit_s[i] = limit(d->mass_kg[i], SAFETY * HEADROOM * d->j_N_per_m[i],
                              SAFETY * HEADROOM * d->c_N_s_per_m[i]);
        d->step_class[i] = (uint8_t)class_for(d, 1.0001f * d->limit_s[i]);
    }
}

/* Every element with a child of the family, once: by its first corner that is one. */
static void find_refinement_costs(palp_dyna *d) {
    const palp_tets *t = d->tets;
    for (uint32_t f = 0; f < t->meta->families; f++) {
        uint32_t sum = 0, top = 0;
        for (uint32_t k = t->child_offset[f]; k < t->child_offset[f + 1u]; k++) {
            uint32_t child = t->child[k];
            for (uint32_t e = t->around_offset[child]; e < t->around_offset[child + 1u]; e++) {
                const uint32_t *n = t->tet[t->around[e]].node;
                uint32_t fastest = 0, first = 4;
                for (uint32_t c = 4; c-- > 0u;) {
                    if (d->step_class[n[c]] > fastest) fastest = d->step_class[n[c]];
                    if (t->family[2u * (size_t)n[c]] == f) first = c;
                }
                if (n[first] == child) sum += 1u << fastest;
                if (fastest > top) top = fastest;
            }
        }
        d->cost[f] = sum;
        d->family_class[f] = (uint8_t)top;
    }
}

palp_status palp_dyna_init(palp_dyna *dyna, const palp_tets *tets, const palp_dyna_config *config,
                           void *memory, size_t bytes) {
    const palp_material *m = &config->material;
    bool sound = m->mu_Pa > 0.0f && 3.0f * m->lambda_Pa + 2.0f * m->mu_Pa > 0.0f &&
                 m->psi_Pa_s >= 0.0f && 3.0f * m->phi_Pa_s + 2.0f * m->psi_Pa_s >= 0.0f &&
                 m->density_kg_m3 > 0.0f && config->tick_s > 0.0f && m->drag_per_s >= 0.0f &&
                 config->most_class < PALP_STEP_CLASSES &&
                 palp_is_finite(m->mu_Pa + m->lambda_Pa + m->psi_Pa_s + m->phi_Pa_s) &&
                 palp_is_finite(m->density_kg_m3 + config->tick_s + m->drag_per_s) &&
                 palp_vec3_is_finite(config->gravity_m_s2);
    if (!sound) return PALP_ERR_ARGUMENT;
    palp_dyna d = {.tets = tets, .config = *config};
    palp_arena a = {memory, 0};
    const palp_status status = palp_check_block(memory, bytes, palp_dyna_memsize(tets));
    if (status != PALP_OK) return status;
    lay_out(&d, &a);
    for (uint32_t l = 0; l < tets->meta->levels; l++) weigh_level(&d, l);
    find_refinement_costs(&d);
    *dyna = d;
    palp_dyna_reset(dyna);
    return PALP_OK;
}

void palp_dyna_reset(palp_dyna *dyna) {
    for (size_t i = 0; i < 3u * (size_t)dyna->tets->meta->nodes; i++)
        dyna->u_m[i] = dyna->v_m_s[i] = dyna->impulse_Ns[i] = dyna->force_N[i] = 0.0f;
    for (uint32_t i = 0; i < dyna->tets->meta->nodes; i++)
        dyna->stretch[i] = 1.0f, dyna->overstretched[i] = 1.0f;
    for (uint32_t f = 0; f < dyna->tets->meta->families; f++) dyna->split[f] = 0;
    dyna->evaluations = dyna->moves = dyna->interpolated = 0;
    dyna->stored_J = 0.0f;
    palp_dyna_relist(dyna);
}

/* ---- steps ---- */

static uint32_t class_in_use(const palp_dyna *d, uint32_t most_class) {
    return d->top_class < most_class ? d->top_class : most_class;
}

uint32_t palp_dyna_steps(const palp_dyna *dyna, uint32_t most_class) {
    return 1u << class_in_use(dyna, most_class);
}

uint32_t palp_dyna_work(const palp_dyna *dyna, uint32_t most_class) {
    uint32_t sum = 0, top = class_in_use(dyna, most_class);
    for (uint32_t c = 0; c <= top; c++) {
        uint32_t end = c == top ? PALP_STEP_CLASSES : c + 1u; /* finer ones go with the last */
        uint32_t count = dyna->class_start[end] - dyna->class_start[c];
        sum += (count + PALP_LANES - 1u) / PALP_LANES * PALP_LANES << c;
    }
    return sum;
}

static void gather(const palp_dyna *d, const uint32_t *element, uint32_t count,
                   palp_element_lanes *e) {
    for (uint32_t k = 0; k < PALP_LANES; k++) {
        const palp_tet *t = &d->tets->tet[element[k < count ? k : 0u]];
        for (uint32_t c = 0; c < 4u; c++) {
            const float *u = d->u_m + 3u * (size_t)t->node[c];
            const float *v = d->v_m_s + 3u * (size_t)t->node[c];
            for (uint32_t a = 0; a < 3u; a++) {
                e->u[c][a][k] = u[a];
                e->v[c][a][k] = v[a];
            }
        }
        for (uint32_t b = 0; b < 9u; b++) e->b[b][k] = t->b[b];
        e->volume[k] = t->volume_m3;
    }
}

/* Elements count by the share of their corners that are active, as the masses of those do. */
static void scatter(palp_dyna *d, const uint32_t *element, uint32_t count,
                    const palp_element_lanes *e, float dt_s, bool first) {
    for (uint32_t k = 0; k < count; k++) {
        const uint32_t *node = d->tets->tet[element[k]].node;
        const float share = 0.25f * (float)(d->active_flag[node[0]] + d->active_flag[node[1]] +
                                            d->active_flag[node[2]] + d->active_flag[node[3]]);
        const float push = share * dt_s;
        for (uint32_t c = 0; c < 4u; c++) {
            uint32_t n = node[c];
            float *p = d->impulse_Ns + 3u * (size_t)n;
            for (uint32_t a = 0; a < 3u; a++) p[a] += push * e->f[c][a][k];
            d->stretch[n] = palp_max(d->stretch[n], e->stretch[k]);
            if (!first) continue;
            float *f = d->force_N + 3u * (size_t)n;
            for (uint32_t a = 0; a < 3u; a++) f[a] += e->f[c][a][k];
        }
        if (first) d->stored_J += share * e->energy_J[k];
    }
}

static void evaluate(palp_dyna *d, uint32_t from, uint32_t to, float dt_s, bool first) {
    palp_element_lanes lanes;
    for (uint32_t i = from; i < to; i += PALP_LANES) {
        uint32_t count = to - i < PALP_LANES ? to - i : PALP_LANES;
        gather(d, d->element + i, count, &lanes);
        palp_element_forces(&lanes, &d->config.material);
        scatter(d, d->element + i, count, &lanes, dt_s, first);
    }
    d->evaluations += to - from;
}

static void clear(palp_dyna *d, uint32_t n, bool first) {
    for (size_t k = 3u * (size_t)n; k < 3u * (size_t)n + 3u; k++) {
        d->impulse_Ns[k] = 0.0f;
        if (first) d->force_N[k] = 0.0f;
    }
    if (first) d->stretch[n] = 1.0f;
}

void palp_dyna_forces(palp_dyna *d, uint32_t s, uint32_t steps) {
    for (uint32_t i = 0; i < d->active_count; i++) clear(d, d->active[i], s == 0u);
    for (uint32_t i = 0; i < d->up_count; i++) clear(d, d->up[i], s == 0u);
    for (uint32_t i = 0; i < d->down_count; i++) clear(d, d->down[i], s == 0u);
    if (s == 0u) d->stored_J = 0.0f;
    uint32_t top = 0;
    /* at most PALP_STEP_CLASSES */
    while (1u << top < steps) top++;
    float dt_s = d->config.tick_s;
    for (uint32_t c = 0; c <= top; c++, dt_s *= 0.5f) {
        uint32_t end = c == top ? PALP_STEP_CLASSES : c + 1u; /* finer ones go with the last */
        bool due = (s & ((steps >> c) - 1u)) == 0u;
        if (due) evaluate(d, d->class_start[c], d->class_start[end], dt_s, s == 0u);
    }
    palp_dyna_hand_back(d);
}

float palp_dyna_per_mass(const palp_dyna *d, uint32_t n, float dt) {
    float own = palp_max(2.0f * d->config.tick_s / (float)(1u << d->duty[n]), dt);
    float grown = SAFETY * d->stretch[n] * d->stiffness_ratio[n] * own;
    float filter = grown * (own * d->j_N_per_m[n] + 2.0f * d->c_N_s_per_m[n]);
    return 1.0f / palp_max(d->mass_kg[n], filter);
}

void palp_dyna_move(palp_dyna *d, uint32_t steps) {
    const float dt = d->config.tick_s / (float)steps;
    const float slower = palp_max(1.0f - dt * d->config.material.drag_per_s, 0.0f);
    const palp_vec3 g = palp_scale(dt, d->config.gravity_m_s2);
    for (uint32_t i = 0; i < d->active_count; i++) {
        uint32_t n = d->active[i];
        if (palp_dyna_pinned(d, n)) continue;
        float per_mass = palp_dyna_per_mass(d, n, dt);
        float overstretched = palp_max(d->stretch[n] * (1.0f / OVERSTRETCHED), 1.0f);
        float stay = slower * palp_min(d->overstretched[n] / overstretched, 1.0f);
        d->overstretched[n] = overstretched;
        float *v = d->v_m_s + 3u * (size_t)n, *u = d->u_m + 3u * (size_t)n;
        const float *p = d->impulse_Ns + 3u * (size_t)n;
        v[0] = stay * v[0] + per_mass * p[0] + g.x;
        v[1] = stay * v[1] + per_mass * p[1] + g.y;
        v[2] = stay * v[2] + per_mass * p[2] + g.z;
        for (uint32_t a = 0; a < 3u; a++) u[a] += dt * v[a];
    }
    d->moves += d->active_count;
}

void palp_dyna_tick(palp_dyna *dyna, uint32_t most_class) {
    uint32_t steps = palp_dyna_steps(dyna, most_class);
    for (uint32_t s = 0; s < steps; s++) {
        palp_dyna_forces(dyna, s, steps);
        palp_dyna_move(dyna, steps);
        palp_dyna_interpolate(dyna);
    }
}

float palp_dyna_kinetic_J(const palp_dyna *dyna) {
    float sum = 0.0f;
    for (uint32_t i = 0; i < dyna->active_count; i++) {
        palp_vec3 v = palp_vec3_at(dyna->v_m_s + 3u * (size_t)dyna->active[i]);
        sum += 0.5f * dyna->mass_kg[dyna->active[i]] * palp_dot(v, v);
    }
    return sum;
}
