/* SPDX-License-Identifier: MIT */
#include "skin.h"
#include "core/base/arena.h"

/* Sum of w_k x_k over the corners of the tetrahedron that the vertex is embedded in. */
static palp_vec3 weigh(const palp_dyna *d, uint32_t i, const float *x) {
    const palp_tets *t = d->tets;
    size_t at = (size_t)i * t->meta->levels + d->skin_level[i];
    const uint32_t *n = t->tet[t->skin_tet[at]].node;
    const float *w = t->skin_weight + 4u * at;
    palp_vec3 sum = palp_scale(w[0], palp_vec3_at(x + 3u * (size_t)n[0]));
    for (uint32_t k = 1; k < 4u; k++)
        sum = palp_madd(sum, w[k], palp_vec3_at(x + 3u * (size_t)n[k]));
    return sum;
}

palp_vec3 palp_skin_position(const palp_dyna *dyna, uint32_t i) {
    uint32_t node = dyna->tets->skin_node[i];
    return palp_add(palp_vec3_at(dyna->tets->rest_m + 3u * (size_t)node),
                    weigh(dyna, i, dyna->u_m));
}

palp_vec3 palp_skin_velocity(const palp_dyna *dyna, uint32_t i) {
    return weigh(dyna, i, dyna->v_m_s);
}

palp_vec3 palp_skin_normal(const palp_dyna *dyna, uint32_t i) {
    const palp_tets *t = dyna->tets;
    size_t at = (size_t)i * t->meta->levels + dyna->skin_level[i];
    const palp_tet *e = &t->tet[t->skin_tet[at]];
    palp_vec3 u0 = palp_vec3_at(dyna->u_m + 3u * (size_t)e->node[0]);
    palp_vec3 row[3] = {{1.0f, 0.0f, 0.0f}, {0.0f, 1.0f, 0.0f}, {0.0f, 0.0f, 1.0f}};
    for (uint32_t k = 0; k < 3u; k++) {
        palp_vec3 u = palp_sub(palp_vec3_at(dyna->u_m + 3u * (size_t)e->node[k + 1u]), u0);
        palp_vec3 b = palp_vec3_at(e->b + 3u * k);
        row[0] = palp_madd(row[0], u.x, b);
        row[1] = palp_madd(row[1], u.y, b);
        row[2] = palp_madd(row[2], u.z, b);
    }
    const float *rest = t->skin_normal + 3u * (size_t)i;
    palp_vec3 n0 = palp_vec3_at(rest);
    palp_vec3 n = {palp_dot(palp_cross(row[1], row[2]), n0),
                   palp_dot(palp_cross(row[2], row[0]), n0),
                   palp_dot(palp_cross(row[0], row[1]), n0)};
    float length = palp_norm(n);
    bool flat = !(length > 1e-12f) || !palp_is_finite(length);
    return flat ? n0 : palp_scale(1.0f / length, n);
}

static void lay_out(palp_skin *s, const palp_tets *t, palp_arena *a) {
    s->position_m = palp_take(a, 3u * (size_t)t->meta->skin, sizeof(float));
    s->off_m = palp_take(a, 3u * (size_t)t->meta->skin, sizeof(float));
}

size_t palp_skin_memsize(const palp_tets *tets) {
    palp_skin s = {.dyna = NULL};
    palp_arena a = {NULL, 0};
    lay_out(&s, tets, &a);
    return a.used;
}

static void put(float *at, palp_vec3 v) {
    at[0] = v.x;
    at[1] = v.y;
    at[2] = v.z;
}

palp_status palp_skin_init(palp_skin *skin, const palp_dyna *dyna, void *memory, size_t bytes) {
    palp_arena a = {memory, 0};
    const palp_status status = palp_check_block(memory, bytes, palp_skin_memsize(dyna->tets));
    if (status != PALP_OK) return status;
    *skin = (palp_skin){.dyna = dyna, .lists = dyna->lists};
    lay_out(skin, dyna->tets, &a);
    for (uint32_t i = 0; i < dyna->tets->meta->skin; i++) {
        put(skin->position_m + 3u * (size_t)i, palp_skin_position(dyna, i));
        put(skin->off_m + 3u * (size_t)i, (palp_vec3){0.0f, 0.0f, 0.0f});
    }
    return PALP_OK;
}

void palp_skin_update(palp_skin *skin, float dt_s) {
    float stay = palp_max(1.0f - dt_s / PALP_SKIN_FADE_S, 0.0f);
    bool changed = skin->lists != skin->dyna->lists;
    skin->lists = skin->dyna->lists;
    skin->jump_m = 0.0f;
    for (uint32_t i = 0; i < skin->dyna->tets->meta->skin; i++) {
        float *place = skin->position_m + 3u * (size_t)i, *off = skin->off_m + 3u * (size_t)i;
        palp_vec3 goal = palp_skin_position(skin->dyna, i), rest = palp_vec3_at(off);
        if (changed) { /* as if it had gone on as it was */
            palp_vec3 gone = palp_scale(dt_s, palp_skin_velocity(skin->dyna, i));
            palp_vec3 left = palp_sub(palp_add(palp_vec3_at(place), gone), goal);
            skin->jump_m = palp_max(skin->jump_m, palp_norm(palp_sub(left, rest)));
            rest = left;
        }
        rest = palp_scale(stay, rest);
        put(off, rest);
        put(place, palp_add(goal, rest));
    }
}
