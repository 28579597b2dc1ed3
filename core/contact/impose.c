/* SPDX-License-Identifier: MIT */
#include "core/contact/impose.h"
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

/* How far a tool extends from its reference point. */
static float extent(const palp_tool *t) {
    float far = 0.0f;
    for (uint32_t i = 0; i < t->balls; i++)
        far = palp_max(far, palp_norm(t->ball[i].center_m) + t->ball[i].radius_m);
    if (t->balls > 0u) return far;
    if (t->cylinder.radius_m > 0.0f)
        return t->cylinder.radius_m + t->cylinder.half_m + t->cylinder.rim_m;
    for (uint32_t i = 0; i < t->pad.columns * t->pad.rows; i++)
        far = palp_max(far, palp_abs(t->pad.height_m[i]));
    return far + t->pad.half_m[0] + t->pad.half_m[1] + t->pad.edge_m;
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
        if (!palp_tool_is_sound(&c->tools[t]) || !palp_vec3_is_finite(c->at_m[t]))
            return PALP_ERR_ARGUMENT;
        p.reach_m[t] = extent(&c->tools[t]);
        p.size_m[t] = palp_tool_size(&c->tools[t]);
        p.from_m[t] = p.to_m[t] = c->at_m[t];
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
static void narrow_phase(palp_impose *p, uint32_t skin, uint32_t tool, palp_vec3 x, float margin) {
    palp_imposed s = {.skin = skin, .tool = tool, .n = palp_skin_normal(p->dyna, skin)};
    palp_touch at = palp_tool_at(&p->tools[tool], p->to_m[tool], x, s.n);
    bool before = (p->pressed[skin] >> tool & 1u) != 0u;
    if (at.reach > 1.0f || at.depth_m < -2.0f * margin) return;
    if (at.facing < (before ? 0.0f : FACING)) return;
    embed(p->dyna, &s);
    s.depth_m = at.depth_m;
    if (s.per_w2 > 0.0f) keep(p, &s);
}

static void broad_phase(palp_impose *p, uint32_t skin, uint32_t tool, palp_vec3 x, float path_m) {
    float away = palp_norm(palp_sub(x, p->to_m[tool])) - p->reach_m[tool];
    float size = p->size_m[tool];
    if (away > HOLD * size + path_m) return;
    if (p->adapt != NULL) palp_adapt_hold(p->adapt, skin);
    float margin = MARGIN * size + path_m + PALP_IMPOSE_SPEED * p->dyna->config.tick_s;
    if (away > margin) return;
    if (p->narrow_tests == 0u) {
        p->overflow++;
        return;
    }
    p->narrow_tests--;
    narrow_phase(p, skin, tool, x, margin);
}

void palp_impose_begin(palp_impose *p, const palp_vec3 *to_m) {
    float path_m[PALP_CONTACT_TOOLS] = {0.0f};
    p->count = 0;
    p->narrow_tests = PALP_IMPOSE_NARROW_TESTS * p->max_points;
    for (uint32_t t = 0; t < p->tool_count; t++) {
        p->from_m[t] = p->to_m[t];
        palp_vec3 path = palp_sub(to_m[t], p->from_m[t]);
        float most = PALP_IMPOSE_SPEED * p->dyna->config.tick_s;
        path_m[t] = palp_norm(path);
        if (!palp_is_finite(path_m[t])) { /* not a place: the tool stays */
            path_m[t] = 0.0f;
        } else if (path_m[t] > most) {
            p->to_m[t] = palp_madd(p->from_m[t], most / path_m[t], path);
            path_m[t] = most;
        } else {
            p->to_m[t] = to_m[t];
        }
        p->impulse_Ns[t] = (palp_vec3){0.0f, 0.0f, 0.0f};
    }
    for (uint32_t i = 0; i < p->dyna->tets->meta->skin; i++) {
        palp_vec3 x = palp_skin_position(p->dyna, i);
        for (uint32_t t = 0; t < p->tool_count; t++) broad_phase(p, i, t, x, path_m[t]);
        p->pressed[i] = 0;
    }
}

/* ---- steps ---- */

/* Moves the nodes of a point by -n delta, takes the speed `rate` along n from them, and hands their
 * push along n over; returns it (N s). */
static float yield(palp_dyna *d, const palp_imposed *s, float delta, float rate) {
    float push = 0.0f;
    for (uint32_t k = 0; k < 4u; k++) {
        if (d->state[s->node[k]] != PALP_ACTIVE || palp_dyna_pinned(d, s->node[k])) continue;
        const float *p = d->impulse_Ns + 3u * (size_t)s->node[k];
        push += s->weight[k] * palp_dot(palp_vec3_at(p), s->n);
    }
    push = palp_max(push * s->per_w2, 0.0f);
    const float n[3] = {s->n.x, s->n.y, s->n.z};
    for (uint32_t k = 0; k < 4u; k++) {
        if (d->state[s->node[k]] != PALP_ACTIVE || palp_dyna_pinned(d, s->node[k])) continue;
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

static void press(palp_impose *p, const palp_imposed *s, palp_vec3 c, palp_vec3 v_m_s,
                  float most_m) {
    palp_dyna *d = p->dyna;
    palp_vec3 x = s->rest_m, v = {0.0f, 0.0f, 0.0f};
    for (uint32_t k = 0; k < 4u; k++) {
        x = palp_madd(x, s->weight[k], palp_vec3_at(d->u_m + 3u * (size_t)s->node[k]));
        v = palp_madd(v, s->weight[k], palp_vec3_at(d->v_m_s + 3u * (size_t)s->node[k]));
    }
    palp_touch at = palp_tool_at(&p->tools[s->tool], c, x, s->n);
    if (!(at.depth_m > 0.0f) || at.reach > 1.0f || at.facing < 0.0f) return;
    float delta = palp_min(at.depth_m, most_m); /* the paper: gradually */
    float rate = palp_max(palp_dot(s->n, v) - palp_dot(at.push, v_m_s), 0.0f);
    float push = yield(d, s, delta, rate);
    p->impulse_Ns[s->tool] = palp_madd(p->impulse_Ns[s->tool], push, at.push);
    p->pressed[s->skin] |= (uint8_t)(1u << s->tool);
    p->inside++;
}

void palp_impose_step(palp_impose *p, uint32_t s, uint32_t steps) {
    float share = (float)(s + 1u) / (float)steps, per_tick = 1.0f / p->dyna->config.tick_s;
    palp_vec3 at[PALP_CONTACT_TOOLS], v[PALP_CONTACT_TOOLS];
    for (uint32_t t = 0; t < p->tool_count; t++) {
        palp_vec3 path = palp_sub(p->to_m[t], p->from_m[t]);
        at[t] = s + 1u == steps ? p->to_m[t] : palp_madd(p->from_m[t], share, path);
        v[t] = palp_scale(per_tick, path);
    }
    const float most_m = PALP_IMPOSE_SPEED * p->dyna->config.tick_s / (float)steps;
    p->inside = 0;
    for (uint32_t i = 0; i < p->count; i++)
        press(p, &p->point[i], at[p->point[i].tool], v[p->point[i].tool], most_m);
}

void palp_impose_end(palp_impose *impose, palp_vec3 *force_N) {
    float per_tick = 1.0f / impose->dyna->config.tick_s;
    for (uint32_t t = 0; t < impose->tool_count; t++)
        force_N[t] = palp_scale(per_tick, impose->impulse_Ns[t]);
}
