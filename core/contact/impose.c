/* SPDX-License-Identifier: MIT */
#include "core/contact/impose.h"
#include "core/base/apart.h"
#include "core/base/arena.h"
#include "core/dyna/skin.h"

#define FACING 0.1f     /* least cosine at which a vertex is taken */
#define HOLD 1.0f       /* tool sizes within which families are held */
#define MARGIN 0.1f     /* tool sizes within which vertices are taken as contact points */
#define TOO_LITTLE 0.1f /* sum of squared weights: the nodes that can be moved carry too little */

static void lay_out(palp_impose *p, const palp_tets *t, palp_arena *a) {
    p->point = palp_take(a, p->max_points, sizeof *p->point);
    p->pressed = palp_take(a, t->meta->skin, 1);
}

size_t palp_impose_memsize(const palp_tets *tets, uint32_t max_points) {
    palp_impose p = {.max_points = max_points};
    palp_arena a = {NULL, 0};
    lay_out(&p, tets, &a);
    return a.used;
}

palp_status palp_impose_init(palp_impose *impose, const palp_impose_config *c, void *memory,
                             size_t bytes) {
    const palp_tets *tets = c->dyna->tets;
    palp_impose p = {.dyna = c->dyna,
                     .adapt = c->adapt,
                     .tools = c->tools,
                     .tool_count = c->tool_count,
                     .max_points = c->max_points};
    palp_arena a = {memory, 0};
    if (c->tool_count == 0u || c->tool_count > PALP_CONTACT_TOOLS || c->max_points == 0u ||
        c->max_points > PALP_MAX_NODES)
        return PALP_ERR_ARGUMENT;
    for (uint32_t t = 0; t < c->tool_count; t++) {
        if (!palp_tool_is_sound(&c->tools[t]) || !palp_vec3_is_finite(c->at[t].t) ||
            !palp_is_rotation(c->at[t].r))
            return PALP_ERR_ARGUMENT;
        p.reach_m[t] = palp_tool_extent(&c->tools[t]);
        p.size_m[t] = palp_tool_size(&c->tools[t]);
        p.from[t] = p.to[t] = c->at[t];
    }
    const palp_status status =
        palp_check_block(memory, bytes, palp_impose_memsize(tets, c->max_points));
    if (status != PALP_OK) return status;
    lay_out(&p, tets, &a);
    for (uint32_t i = 0; i < tets->meta->skin; i++) p.pressed[i] = 0;
    *impose = p;
    return PALP_OK;
}

/* ---- points ---- */

/* What moving the vertex means for the nodes that it is embedded in. */
static void embed(const palp_dyna *d, palp_imposed *s) {
    const palp_tets *t = d->tets;
    size_t at = (size_t)s->skin * t->meta->levels + d->skin_level[s->skin];
    float sum = 0.0f;
    s->rest_m = palp_vec3_at(t->rest_m + 3u * (size_t)t->skin_node[s->skin]);
    for (uint32_t k = 0; k < 4u; k++) {
        uint32_t n = t->tet[t->skin_tet[at]].node[k];
        bool moves = d->state[n] == PALP_ACTIVE && !palp_dyna_pinned(d, n);
        s->node[k] = n;
        s->weight[k] = t->skin_weight[4u * at + k];
        sum += moves ? s->weight[k] * s->weight[k] : 0.0f;
    }
    s->per_w2 = sum > TOO_LITTLE ? 1.0f / sum : 0.0f;
}

/* The deepest max_points vertices stay. */
static void keep(palp_impose *p, const palp_imposed *s) {
    if (p->count < p->max_points) {
        p->point[p->count++] = *s;
        return;
    }
    uint32_t shallowest = 0;
    p->overflow++;
    for (uint32_t i = 1; i < p->count; i++) {
        if (p->point[i].depth_m < p->point[shallowest].depth_m) shallowest = i;
    }
    if (s->depth_m > p->point[shallowest].depth_m) p->point[shallowest] = *s;
}

/* One of PALP_IMPOSE_NARROW_TESTS max_points. */
PALP_APART static void narrow_phase(palp_impose *p, uint32_t skin, uint32_t tool, palp_vec3 x,
                                    float margin) {
    palp_imposed s = {.skin = skin, .tool = tool, .n = palp_skin_normal(p->dyna, skin)};
    palp_touch at = palp_tool_at(&p->tools[tool], &p->to[tool], x, s.n);
    bool before = (p->pressed[skin] >> tool & 1u) != 0u;
    if (at.reach > 1.0f || at.depth_m < -2.0f * margin) return;
    if (at.facing < (before ? 0.0f : FACING)) return;
    embed(p->dyna, &s);
    s.depth_m = at.depth_m;
    if (s.per_w2 > 0.0f) keep(p, &s);
}

/* Returns whether families around the vertex are to be held. */
static bool broad_phase(palp_impose *p, uint32_t skin, uint32_t tool, palp_vec3 x, float path_m) {
    const palp_frame *to = &p->to[tool];
    float away = palp_norm(palp_sub(x, to->t)) - p->reach_m[tool];
    float size = p->size_m[tool];
    if (away > HOLD * size + path_m) return false;
    if (!palp_tool_may_reach(&p->tools[tool], palp_carry_back(to, x), HOLD * size + path_m))
        return false;
    float margin = MARGIN * size + path_m + PALP_IMPOSE_SPEED * p->dyna->config.tick_s;
    if (away > margin) return true;
    if (p->narrow_tests == 0u) {
        p->overflow++;
        return true;
    }
    p->narrow_tests--;
    narrow_phase(p, skin, tool, x, margin);
    return true;
}

/* Sets where a tool goes in this tick; returns how far any place of it goes at most. */
static float set_path(palp_impose *p, uint32_t t, const palp_frame *to) {
    const float most = PALP_IMPOSE_SPEED * p->dyna->config.tick_s;
    p->from[t] = p->to[t];
    palp_vec3 path = palp_sub(to->t, p->from[t].t);
    palp_vec3 turn = palp_turn_between(p->from[t].r, to->r);
    turn = palp_tool_turned(&p->tools[t], to, turn);
    float length = palp_norm(path) + p->reach_m[t] * palp_norm(turn);
    p->turn_rad[t] = (palp_vec3){0.0f, 0.0f, 0.0f};
    if (!palp_is_finite(length)) return 0.0f; /* not a place: the tool stays */
    const float share = length > most ? most / length : 1.0f;
    p->to[t] = *to;
    p->to[t].t = palp_madd(p->from[t].t, share, path);
    if (share < 1.0f) palp_turn_by(palp_scale(share, turn), p->from[t].r, p->to[t].r);
    p->turn_rad[t] = palp_scale(share, turn);
    return palp_min(length, most);
}

void palp_impose_place(palp_impose *impose, uint32_t tool, const palp_frame *at) {
    impose->from[tool] = impose->to[tool] = *at;
}

void palp_impose_begin(palp_impose *p, const palp_frame *to) {
    float path_m[PALP_CONTACT_TOOLS] = {0.0f};
    p->count = 0;
    p->narrow_tests = PALP_IMPOSE_NARROW_TESTS * p->max_points;
    for (uint32_t t = 0; t < p->tool_count; t++) {
        path_m[t] = set_path(p, t, &to[t]);
        p->impulse_Ns[t] = p->impulse_Nms[t] = (palp_vec3){0.0f, 0.0f, 0.0f};
    }
    for (uint32_t i = 0; i < p->dyna->tets->meta->skin; i++) {
        palp_vec3 x = palp_skin_position(p->dyna, i);
        bool near = false;
        for (uint32_t t = 0; t < p->tool_count; t++)
            near = broad_phase(p, i, t, x, path_m[t]) || near;
        if (near && p->adapt != NULL) palp_adapt_hold(p->adapt, i);
        p->pressed[i] = 0;
    }
}

/* ---- steps ---- */

/* Whether a corner of a point moves. */
static bool moves(const palp_dyna *d, const palp_imposed *s, uint32_t k) {
    return d->state[s->node[k]] == PALP_ACTIVE && !palp_dyna_pinned(d, s->node[k]);
}

/* Moves the nodes of a point by -n delta, takes the speed `rate` along n from them, and hands their
 * push along n over; returns it (N s). */
static float yield(palp_dyna *d, const palp_imposed *s, float delta, float rate) {
    float push = 0.0f;
    for (uint32_t k = 0; k < 4u; k++) {
        if (!moves(d, s, k)) continue;
        const float *p = d->impulse_Ns + 3u * (size_t)s->node[k];
        push += s->weight[k] * palp_dot(palp_vec3_at(p), s->n);
    }
    push = palp_max(push * s->per_w2, 0.0f);
    const float n[3] = {s->n.x, s->n.y, s->n.z};
    for (uint32_t k = 0; k < 4u; k++) {
        if (!moves(d, s, k)) continue;
        size_t at = 3u * (size_t)s->node[k];
        float share = s->weight[k] * s->per_w2;
        for (uint32_t a = 0; a < 3u; a++) {
            d->u_m[at + a] -= share * delta * n[a];
            d->v_m_s[at + a] -= share * rate * n[a];
            d->impulse_Ns[at + a] -= s->weight[k] * push * n[a];
        }
    }
    return push;
}

/* A tool in the course of a step. */
typedef struct {
    palp_frame at;
    palp_vec3 v_m_s, w_rad_s;
} tool_motion;

static palp_vec3 across(palp_vec3 v, palp_vec3 n) { return palp_madd(v, -palp_dot(v, n), n); }

/* Friction's impulse on the body at a point that is pushed by `push`, against a tool that moves
 * with `there`; given to its nodes. */
PALP_APART static palp_vec3 rub(palp_impose *p, const palp_imposed *s, float push, palp_vec3 there,
                                float dt_s) {
    palp_dyna *d = p->dyna;
    const palp_tool *tool = &p->tools[s->tool];
    palp_vec3 v = {0.0f, 0.0f, 0.0f};
    float answer = 0.0f, per_mass[4] = {0.0f};
    for (uint32_t k = 0; k < 4u; k++) {
        v = palp_madd(v, s->weight[k], palp_vec3_at(d->v_m_s + 3u * (size_t)s->node[k]));
        if (!moves(d, s, k)) continue;
        per_mass[k] = palp_dyna_per_mass(d, s->node[k], dt_s);
        answer += s->weight[k] * s->weight[k] * per_mass[k];
    }
    palp_vec3 impulse =
        palp_scale(-1.0f / palp_max(answer, 1e-20f), across(palp_sub(v, there), s->n));
    const bool slides = palp_norm(impulse) > tool->friction * push;
    if (slides) impulse = palp_at_most(impulse, palp_tool_sliding(tool) * push);
    *(slides ? &p->slid[s->tool] : &p->stuck[s->tool]) += 1u;
    for (uint32_t k = 0; k < 4u; k++) {
        const palp_vec3 more = palp_scale(s->weight[k] * per_mass[k], impulse);
        const float dv[3] = {more.x, more.y, more.z}, j[3] = {impulse.x, impulse.y, impulse.z};
        float *at_v = d->v_m_s + 3u * (size_t)s->node[k], *at_u = d->u_m + 3u * (size_t)s->node[k];
        float *at_p = d->impulse_Ns + 3u * (size_t)s->node[k];
        for (uint32_t a = 0; a < 3u && per_mass[k] > 0.0f; a++) {
            at_v[a] += dv[a];
            at_u[a] += dt_s * dv[a];
            at_p[a] += s->weight[k] * j[a];
        }
    }
    return impulse;
}

static void press(palp_impose *p, const palp_imposed *s, const tool_motion *tool, float most_m,
                  float dt_s) {
    palp_dyna *d = p->dyna;
    palp_vec3 x = s->rest_m, v = {0.0f, 0.0f, 0.0f};
    for (uint32_t k = 0; k < 4u; k++) {
        x = palp_madd(x, s->weight[k], palp_vec3_at(d->u_m + 3u * (size_t)s->node[k]));
        v = palp_madd(v, s->weight[k], palp_vec3_at(d->v_m_s + 3u * (size_t)s->node[k]));
    }
    palp_touch at = palp_tool_at(&p->tools[s->tool], &tool->at, x, s->n);
    if (!(at.depth_m > 0.0f) || at.reach > 1.0f || at.facing < 0.0f) return;
    const palp_vec3 arm = palp_sub(x, tool->at.t);
    const palp_vec3 there = palp_add(tool->v_m_s, palp_cross(tool->w_rad_s, arm));
    float delta = palp_min(at.depth_m, most_m); /* the paper: gradually */
    float rate = palp_max(palp_dot(s->n, v) - palp_dot(at.push, there), 0.0f);
    float push = yield(d, s, delta, rate);
    palp_vec3 on_tool = palp_scale(push, at.push);
    if (p->tools[s->tool].friction > 0.0f && push > 0.0f)
        on_tool = palp_sub(on_tool, rub(p, s, push, there, dt_s));
    p->impulse_Ns[s->tool] = palp_add(p->impulse_Ns[s->tool], on_tool);
    p->impulse_Nms[s->tool] = palp_add(p->impulse_Nms[s->tool], palp_cross(arm, on_tool));
    p->pressed[s->skin] |= (uint8_t)(1u << s->tool);
    p->inside++;
}

static tool_motion motion_at(const palp_impose *p, uint32_t t, float share, bool last) {
    const float per_tick = 1.0f / p->dyna->config.tick_s;
    const palp_vec3 path = palp_sub(p->to[t].t, p->from[t].t);
    tool_motion m = {.at = p->to[t],
                     .v_m_s = palp_scale(per_tick, path),
                     .w_rad_s = palp_scale(per_tick, p->turn_rad[t])};
    if (last) return m;
    m.at.t = palp_madd(p->from[t].t, share, path);
    if (palp_dot(p->turn_rad[t], p->turn_rad[t]) > 0.0f)
        palp_turn_by(palp_scale(share, p->turn_rad[t]), p->from[t].r, m.at.r);
    return m;
}

void palp_impose_step(palp_impose *p, uint32_t s, uint32_t steps) {
    tool_motion tool[PALP_CONTACT_TOOLS];
    for (uint32_t t = 0; t < p->tool_count; t++)
        tool[t] = motion_at(p, t, (float)(s + 1u) / (float)steps, s + 1u == steps);
    const float most_m = PALP_IMPOSE_SPEED * p->dyna->config.tick_s / (float)steps;
    p->inside = 0;
    const float dt_s = p->dyna->config.tick_s / (float)steps;
    for (uint32_t t = 0; t < p->tool_count; t++) p->slid[t] = p->stuck[t] = 0;
    for (uint32_t i = 0; i < p->count; i++)
        press(p, &p->point[i], &tool[p->point[i].tool], most_m, dt_s);
}

void palp_impose_end(const palp_impose *impose, palp_wrench *on_tool) {
    float per_tick = 1.0f / impose->dyna->config.tick_s;
    for (uint32_t t = 0; t < impose->tool_count; t++) {
        on_tool[t].force_N = palp_scale(per_tick, impose->impulse_Ns[t]);
        on_tool[t].moment_Nm = palp_scale(per_tick, impose->impulse_Nms[t]);
    }
}
