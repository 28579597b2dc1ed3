/* SPDX-License-Identifier: MIT */
/* Shots along a lattice, the sites that they show, and the regions that sites make. */
#include "core/contact/lattice_internal.h"
#include "core/contact/facing.h"

#define KEPT 0.25f      /* gap over the size up to which points stay that carried force */
#define FACING 0.15f    /* cosine between shot and surface below which no point is taken */
#define FADE 0.15f      /* above FACING, in which cells grow to their full size */
#define HOPS 4u         /* zones that one shot goes through */
#define SITE_MOST 16000 /* largest number of a site */

palp_vec3 palp_lattice_beside(const palp_lattice_filling *f, palp_vec3 y, float *gone) {
    const palp_lattice *l = f->l;
    float least = 1e30f;
    palp_vec3 u = palp_far_field_beside(&l->at.far_field, y, gone), far = {0};
    if (!(*gone > 0.0f)) return u;
    for (uint32_t k = 0; k < l->watched; k++) {
        palp_vec3 d = palp_sub(y, l->watch[k].x_m);
        if (palp_dot(d, d) >= least) continue;
        least = palp_dot(d, d);
        far = l->watch[k].u_m;
    }
    return palp_madd(u, *gone, far);
}

/* The gap at a place that the body has been moved to, seen from what presses. */
PALP_APART static palp_gap gap_at(palp_lattice_filling *f, palp_vec3 y) {
    const palp_lattice_room *r = f->r;
    f->r->done->evaluations++;
    if (r->other.surface == NULL) return palp_tool_gap(r->tool, &f->moved, y);
    const palp_vec3 x = palp_add(y, palp_sub(r->at.t, f->moved.t));
    uint32_t hint[2] = {f->l->facing, r->facing};
    r->done->shots++;
    palp_gap gap = palp_facing_gap(&r->other, x, f->l->at.axis, &f->crossings, hint);
    f->l->facing = hint[0];
    return gap;
}

/* The same as the lattice's points see it, of the surface with the normal n at rest. */
static palp_gap gap_along(palp_lattice_filling *f, palp_vec3 y, palp_vec3 n) {
    const palp_lattice_room *r = f->r;
    const palp_tool_press press = palp_lattice_press(&f->l->used, n);
    if (r->other.surface != NULL) return gap_at(f, y);
    if (r->tool->shape == PALP_TOOL_FIELD) {
        r->done->evaluations += 1u + palp_tool_out(r->tool);
        const palp_gap gap = palp_tool_gap_along(r->tool, &f->moved, y, &press);
        return palp_tool_gap_flared(r->tool, &f->moved, y, &press, gap, press.sunk);
    }
    palp_gap gap = gap_at(f, y);
    const bool behind = palp_tool_faces_back(r->tool, gap, &press);
    if (!behind && !(press.sunk > 0.0f)) return gap;
    r->done->evaluations += palp_tool_out(r->tool);
    if (behind) gap = palp_tool_gap_along(r->tool, &f->moved, y, &press);
    return palp_tool_gap_flared(r->tool, &f->moved, y, &press, gap, press.sunk);
}

palp_gap palp_lattice_gap(palp_lattice_filling *f, palp_vec3 y) {
    float gone;
    return gap_at(f, palp_add(y, palp_lattice_beside(f, y, &gone)));
}

static palp_vec3 direction_of(const palp_lattice_filling *f, float a, float b) {
    const palp_lattice *l = f->l;
    if (!f->central) return l->at.axis;
    float rho2 = a * a + b * b, up = 1.0f - 0.5f * rho2,
          out = palp_sqrt(palp_max(1.0f - 0.25f * rho2, 0.0f));
    palp_vec3 d = palp_scale(up, l->at.axis);
    d = palp_madd(d, out * a, l->at.tangent[0]);
    return palp_madd(d, out * b, l->at.tangent[1]);
}

/* Where in the lattice's map a point of the surface lies; false at its back. */
static bool map(const palp_lattice_filling *f, palp_vec3 y, float *a, float *b) {
    const palp_lattice *l = f->l;
    palp_vec3 r = palp_sub(y, palp_add(f->moved.t, l->at.origin_m));
    float scale = 1.0f;
    if (f->central) {
        float length = palp_norm(r), up = length > 0.0f ? palp_dot(r, l->at.axis) / length : -1.0f;
        if (up < -0.9f) return false;
        scale = palp_sqrt(2.0f / (1.0f + up)) / length;
    }
    *a = scale * palp_dot(r, l->at.tangent[0]);
    *b = scale * palp_dot(r, l->at.tangent[1]);
    return true;
}

float palp_lattice_cell_slope(const palp_contact_point *p) {
    float shown = p->facing - FACING;
    float fade = shown < FADE ? 1.0f / shown : 0.0f;
    return p->cell_m * (fade - 0.5f / p->facing);
}

bool palp_lattice_enter(palp_lattice_filling *f, palp_vec3 from, palp_vec3 direction,
                        palp_surface_point *at) {
    const palp_lattice_room *r = f->r;
    for (uint32_t hop = 0; hop < HOPS; hop++) {
        uint32_t edge = 0;
        palp_walk walk = palp_surface_walk(
            palp_lattice_surface(r, at->body), palp_lattice_into(r, at->body, from),
            palp_lattice_turned_in(r, at->body, direction), &f->crossings, at, &edge);
        if (walk != PALP_AT_SEAM) return walk == PALP_ENTERED;
        if (r->beyond == NULL) return false;
        const uint32_t beyond =
            r->beyond[at->body - r->first_body][3u * (size_t)at->triangle + edge];
        if (beyond == PALP_NONE) return false;
        at->body = beyond >> 24u;
        at->triangle = beyond & 0xffffffu;
    }
    return false;
}

/* What the shot at (a, b) of the map meets, beginning on p->at.triangle; false if there is nothing
 * to touch. `pressed`: it carried force in the last tick. */
PALP_APART static bool shoot(palp_lattice_filling *f, float a, float b, bool pressed,
                             palp_contact_point *p) {
    const palp_lattice *l = f->l;
    palp_vec3 from = palp_add(f->moved.t, l->at.origin_m);
    p->direction = direction_of(f, a, b);
    if (!f->central) {
        from = palp_madd(from, a, l->at.tangent[0]);
        from = palp_madd(from, b, l->at.tangent[1]);
    }
    f->r->done->shots++;
    if (!palp_lattice_enter(f, from, p->direction, &p->at)) return false;
    p->q = palp_lattice_out(f->r, p->at.body, p->at.q);
    p->y = palp_lattice_world(f->r, &p->at);
    p->n = palp_lattice_normal(f->r, &p->at);
    p->shot_m = palp_dot(palp_sub(p->q, from), p->direction);
    p->facing = -palp_dot(p->n, p->direction);
    float gone;
    palp_vec3 y = palp_add(p->y, palp_lattice_beside(f, p->y, &gone));
    palp_gap gap = gap_along(f, y, p->n);
    p->overlap_m = palp_max(-gap.gap_m, 0.0f);
    if (gap.gap_m >= (pressed ? KEPT * f->r->size_m : gone * f->unsure_m)) return false;
    if (p->facing <= FACING || (f->central && p->shot_m <= 0.0f)) return false;
    if (palp_dot(gap.normal, p->n) >= 0.0f) return false;
    float cell = l->at.spacing / palp_sqrt(p->facing);
    if (f->central) cell *= p->shot_m;
    p->cell_m = cell * palp_min((p->facing - FACING) / FADE, 1.0f);
    return true;
}

/* Shoots at a site of the lattice, unless that was done before; the walk begins on the triangle of
 * `near`. */
static void shoot_at_site(palp_lattice_filling *f, int32_t i, int32_t j,
                          const palp_surface_point *near) {
    const uint32_t body = near->body, triangle = near->triangle; /* which may be overwritten */
    const palp_lattice_room *r = f->r;
    if (i < -SITE_MOST || i > SITE_MOST || j < -SITE_MOST || j > SITE_MOST) return;
    uint32_t key = palp_lattice_key(i, j), slot = palp_lattice_slot(r->table, key);
    const bool known = r->table->key[slot] == key;
    const bool pressed = known && r->table->point[slot] == PALP_LATTICE_MARKED;
    if (known && !pressed) return;
    if (!known && r->table->key[slot] != 0u) { /* no room for it */
        f->full = true;
        return;
    }
    f->full = f->full || f->shots_left == 0u;
    if (f->shots_left == 0u) return;
    f->shots_left--;
    r->table->key[slot] = key;
    r->table->point[slot] = PALP_LATTICE_MISS;
    palp_contact_point *p = &r->point[*r->count];
    float a = f->l->at.spacing * ((float)i + 0.5f * (float)j),
          b = f->l->at.spacing * PALP_LATTICE_CELL * (float)j;
    p->at.body = body;
    p->at.triangle = triangle;
    if (f->central && a * a + b * b >= 3.9f) return;
    if (!shoot(f, a, b, pressed, p)) return;
    if (*r->count + 1u >= r->most) {
        f->full = true;
        return;
    }
    p->patch = r->number;
    p->i = (int16_t)i;
    p->j = (int16_t)j;
    p->active = false;
    p->force_N = 0.0f;
    r->table->point[slot] = (uint16_t)*r->count;
    (*r->count)++;
}

/* The site next to a point of the surface; false if there is none. */
static bool nearest_site(const palp_lattice_filling *f, palp_vec3 y, int32_t site[2]) {
    float a, b;
    if (!map(f, y, &a, &b)) return false;
    float row = b / (f->l->at.spacing * PALP_LATTICE_CELL);
    if (!(palp_abs(row) < (float)SITE_MOST)) return false; /* or not a number */
    site[1] = (int32_t)(row + (row >= 0.0f ? 0.5f : -0.5f));
    float column = a / f->l->at.spacing - 0.5f * (float)site[1];
    if (!(palp_abs(column) < (float)SITE_MOST)) return false;
    site[0] = (int32_t)(column + (column >= 0.0f ? 0.5f : -0.5f));
    return true;
}

/* Whether the lattice has shot at the site next to a point of the surface, or cannot. */
static bool knows(const palp_lattice_filling *f, palp_vec3 y) {
    int32_t site[2];
    if (!nearest_site(f, y, site)) return true;
    uint32_t key = palp_lattice_key(site[0], site[1]), slot = palp_lattice_slot(f->r->table, key);
    if (f->r->table->key[slot] != key) return f->r->table->key[slot] != 0u; /* no room for it */
    return f->r->table->point[slot] != PALP_LATTICE_MARKED;
}

void palp_lattice_want_pressed(const palp_lattice_filling *f) {
    const palp_lattice_room *r = f->r;
    uint32_t left = PALP_LATTICE_WANTED(r->most);
    for (uint32_t k = 0; k < r->count_before && left > 0u; k++) {
        const palp_contact_point *p = &r->before[k];
        int32_t site[2];
        if (p->patch != r->number || !(p->force_N > 0.0f)) continue;
        left--;
        if (!nearest_site(f, palp_lattice_world(r, &p->at), site)) continue;
        uint32_t key = palp_lattice_key(site[0], site[1]), slot = palp_lattice_slot(r->table, key);
        if (r->table->key[slot] != 0u && r->table->key[slot] != key) continue; /* no room for it */
        r->table->key[slot] = key;
        r->table->point[slot] = PALP_LATTICE_MARKED;
    }
}

/* Fills the region around a point of the surface; false if the lattice finds nothing there. */
static bool flood(palp_lattice_filling *f, const palp_surface_point *seed) {
    static const int32_t step[6][2] = {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};
    uint32_t before = *f->r->count;
    int32_t site[2];
    if (!nearest_site(f, palp_lattice_world(f->r, seed), site)) return false;
    shoot_at_site(f, site[0], site[1], seed);
    /* at most points in all of palp_lattice_fill */
    for (uint32_t k = before; k < *f->r->count; k++) {
        const int32_t at[2] = {f->r->point[k].i, f->r->point[k].j};
        const palp_surface_point near = f->r->point[k].at;
        for (uint32_t n = 0; n < 6u; n++)
            shoot_at_site(f, at[0] + step[n][0], at[1] + step[n][1], &near);
    }
    return *f->r->count > before;
}

PALP_APART bool palp_lattice_fill_region(palp_lattice_filling *f, const palp_surface_point *from) {
    uint32_t before = *f->r->count, deepest = before;
    if (!flood(f, from)) return false;
    for (uint32_t k = before; k < *f->r->count; k++) {
        if (f->r->point[k].overlap_m > f->r->point[deepest].overlap_m) deepest = k;
    }
    if (f->l->seeds < PALP_LATTICE_SEEDS) f->l->seed[f->l->seeds++] = f->r->point[deepest].at;
    if (f->regions < PALP_LATTICE_SEEDS) f->regions++;
    f->end[f->regions - 1u] = *f->r->count;
    return true;
}

void palp_lattice_fill_unknown(palp_lattice_filling *f, const palp_surface_point *from) {
    if (knows(f, palp_lattice_world(f->r, from))) return;
    if (f->shots_left == 0u)
        f->full = true;
    else
        (void)palp_lattice_fill_region(f, from);
}
