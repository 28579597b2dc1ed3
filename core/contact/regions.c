/* SPDX-License-Identifier: MIT */
#include "core/contact/regions.h"
#include "core/base/frame.h"
#include "core/contact/contact_internal.h"

#define NO_REGION 0xffu
#define SAME_WAY 0.9976f /* cosine between regions that become one: 4 degrees */
#define CELL                                                                                       \
    0.07f /* mean square distance in a cell, over the spacing squared: half a hexagon's,           \
             which meets Hertz to 0.5 %; points at the rim stand for less than a cell */

/* The point in contact at a place of the tool's lattice that has no region yet; PALP_LATTICE_MISS
 * if there is none. */
static uint32_t unclaimed_at(const palp_contact *c, uint32_t tool, int32_t i, int32_t j) {
    const uint32_t at = palp_lattice_find(c->patch[tool].table, (int16_t)i, (int16_t)j);
    if (at >= c->count) return PALP_LATTICE_MISS;
    const palp_contact_point *p = &c->point[at];
    const bool unclaimed = p->patch == tool && p->force_N > 0.0f && p->region == NO_REGION;
    return unclaimed ? at : PALP_LATTICE_MISS;
}

/* Marks all points that are connected with one. */
static void claim(palp_contact *c, uint32_t tool, uint32_t from, uint32_t number) {
    static const int32_t step[6][2] = {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};
    uint16_t list[PALP_CONTACT_MAX_POINTS];
    uint32_t listed = 1;
    list[0] = (uint16_t)from;
    c->point[from].region = (uint8_t)number;
    /* at most active in all of palp_contact_regions: each comes on the list once */
    for (uint32_t k = 0; k < listed; k++) {
        const palp_contact_point *p = &c->point[list[k]];
        for (uint32_t s = 0; s < 6u; s++) {
            const uint32_t at = unclaimed_at(c, tool, p->i + step[s][0], p->j + step[s][1]);
            if (at == PALP_LATTICE_MISS) continue;
            c->point[at].region = (uint8_t)number;
            list[listed++] = (uint16_t)at;
        }
    }
}

/* The point in contact that is nearest to a place of the tool; those without a region do not count.
 */
static uint32_t nearest_point(const palp_contact *c, uint32_t tool, palp_vec3 from_tool,
                              float *distance2) {
    const palp_vec3 at = palp_add(c->patch[tool].at.t, from_tool);
    uint32_t nearest = PALP_LATTICE_MISS;
    *distance2 = 0.0f;
    for (uint32_t a = 0; a < c->active_count; a++) {
        const palp_contact_point *p = &c->point[c->active[a]];
        if (p->patch != tool || p->region == NO_REGION) continue;
        const palp_vec3 d = palp_sub(p->y, at);
        const float here2 = palp_dot(d, d);
        if (nearest != PALP_LATTICE_MISS && here2 >= *distance2) continue;
        nearest = c->active[a];
        *distance2 = here2;
    }
    return nearest;
}

/* Numbers the connected pieces; returns how many there are. */
static uint32_t find_pieces(palp_contact *c, uint32_t tool) {
    uint32_t count = 0;
    for (uint32_t a = 0; a < c->active_count; a++) {
        palp_contact_point *p = &c->point[c->active[a]];
        if (p->patch == tool) p->region = NO_REGION;
    }
    for (uint32_t a = 0; a < c->active_count; a++) {
        const uint32_t at = c->active[a];
        const palp_contact_point *p = &c->point[at];
        if (p->patch != tool || !(p->force_N > 0.0f) || p->region != NO_REGION) continue;
        uint32_t number = count;
        if (count < PALP_CONTACT_REGIONS) {
            count++;
        } else {
            float distance2;
            const palp_vec3 from_tool = palp_sub(p->y, c->patch[tool].at.t);
            number = c->point[nearest_point(c, tool, from_tool, &distance2)].region;
        }
        claim(c, tool, at, number);
    }
    return count;
}

/* ---- what goes on from the last tick ---- */

typedef struct {
    const palp_contact_region *before;
    uint32_t count;
    uint32_t piece[PALP_CONTACT_REGIONS]; /* where each of them is now; NO_REGION: gone */
    uint32_t heir[PALP_CONTACT_REGIONS];  /* the region that it becomes */
} descent;

/* Where the regions of before are: in the piece nearest to the middle of each, if that is within
 * its reach. */
static void find_heirs(const palp_contact *c, uint32_t tool, descent *d) {
    for (uint32_t o = 0; o < d->count; o++) {
        float distance2;
        const uint32_t at = nearest_point(c, tool, d->before[o].centre_m, &distance2);
        const float reach2 = palp_contact_reach2(&d->before[o]);
        d->piece[o] = NO_REGION;
        if (at == PALP_LATTICE_MISS) continue;
        const float cell = c->point[at].cell_m;
        if (distance2 <= reach2 + cell * cell) d->piece[o] = c->point[at].region;
    }
}

/* The regions of before that share a piece: all that are in it and do not face the same way. */
typedef struct {
    uint32_t of[PALP_CONTACT_REGIONS], count;
} leaders;

/* Which of the leaders faces the same way; their count if none does. */
static uint32_t alike(const descent *d, const leaders *l, uint32_t o) {
    for (uint32_t k = 0; k < l->count; k++) {
        if (palp_dot(d->before[l->of[k]].axis, d->before[o].axis) >= SAME_WAY) return k;
    }
    return l->count;
}

static leaders find_leaders(descent *d, uint32_t piece, uint32_t first, uint32_t most) {
    leaders l = {.count = 0};
    for (uint32_t o = 0; o < d->count; o++) {
        if (d->piece[o] != piece) continue;
        const uint32_t k = alike(d, &l, o);
        if (k == l.count && k < most) l.of[l.count++] = o;
        d->heir[o] = first + (k < l.count ? k : 0u);
    }
    return l;
}

/* The leader whose region was nearest to a point. */
static uint32_t nearest_leader(const descent *d, const leaders *l, palp_vec3 from_tool) {
    uint32_t nearest = 0;
    float least = 0.0f;
    for (uint32_t k = 0; k < l->count; k++) {
        const palp_vec3 off = palp_sub(from_tool, d->before[l->of[k]].centre_m);
        const float off2 = palp_dot(off, off);
        if (k > 0u && off2 >= least) continue;
        nearest = k;
        least = off2;
    }
    return nearest;
}

/* Makes a piece one region, or one for each of its leaders, numbered from `first`; returns where
 * numbers go on. */
static uint32_t share_out(palp_contact *c, uint32_t tool, descent *d, uint32_t piece,
                          uint32_t first, uint32_t most) {
    const leaders l = find_leaders(d, piece, first, most);
    for (uint32_t a = 0; a < c->active_count; a++) {
        palp_contact_point *p = &c->point[c->active[a]];
        if (p->patch != tool || p->region != piece + PALP_CONTACT_REGIONS) continue;
        const palp_vec3 from_tool = palp_sub(p->y, c->patch[tool].at.t);
        p->region = (uint8_t)(first + nearest_leader(d, &l, from_tool));
    }
    return first + (l.count > 0u ? l.count : 1u);
}

static void measure(const palp_contact *c, uint32_t tool, uint32_t number,
                    palp_contact_region *region) {
    const palp_contact_patch *patch = &c->patch[tool];
    palp_vec3 push = {0}, centre = {0};
    float sum = 0.0f, square = 0.0f, most = 0.0f;
    for (uint32_t a = 0; a < c->active_count; a++) {
        const palp_contact_point *p = &c->point[c->active[a]];
        if (p->patch != tool || p->region != number) continue;
        const palp_vec3 r = palp_sub(p->y, patch->at.t);
        sum += p->force_N;
        push = palp_madd(push, -p->force_N, p->out);
        centre = palp_madd(centre, p->force_N, r);
        square += p->force_N * (palp_dot(r, r) + CELL * p->cell_m * p->cell_m);
        if (p->force_N <= most) continue;
        const palp_meta *meta = c->surface[p->at.body].blob->meta;
        region->shear_Pa = 0.5f * meta->young_Pa / (1.0f + meta->poisson);
        most = p->force_N;
    }
    const float over = 1.0f / palp_max(sum, 1e-30f);
    centre = palp_scale(over, centre);
    region->normal_N = sum;
    region->centre_m = centre;
    region->gyration_m2 = palp_max(square * over - palp_dot(centre, centre), 0.0f);
    region->axis = palp_scale(1.0f / palp_max(palp_norm(push), 1e-30f), push);
    palp_tangents(region->axis, region->tangent);
}

/* Measures the regions, without those that were left no point; returns how many there are. */
static uint32_t measure_all(palp_contact *c, uint32_t tool, descent *d, palp_contact_region *region,
                            uint32_t count) {
    uint32_t number[PALP_CONTACT_REGIONS], left = 0;
    for (uint32_t r = 0; r < count; r++) {
        measure(c, tool, r, &region[left]);
        number[r] = region[left].normal_N > 0.0f ? left++ : NO_REGION;
    }
    if (left == count) return left;
    for (uint32_t a = 0; a < c->active_count; a++) {
        palp_contact_point *p = &c->point[c->active[a]];
        if (p->patch == tool && p->region != NO_REGION) p->region = (uint8_t)number[p->region];
    }
    for (uint32_t o = 0; o < d->count; o++) {
        if (d->piece[o] != NO_REGION) d->heir[o] = number[d->heir[o]];
    }
    return left;
}

/* Which regions of before go on in each: those that have become it, else the one that it has come
 * off from. */
static void name_parents(const descent *d, palp_contact_region *region, uint32_t count) {
    for (uint32_t r = 0; r < count; r++) {
        float least = 0.0f;
        region[r].parents = 0;
        for (uint32_t o = 0; o < d->count; o++) {
            if (d->piece[o] != NO_REGION && d->heir[o] == r) region[r].parents |= 1u << o;
        }
        if (region[r].parents != 0u) continue;
        for (uint32_t o = 0; o < d->count; o++) {
            const palp_vec3 off = palp_sub(region[r].centre_m, d->before[o].centre_m);
            const float off2 = palp_dot(off, off);
            const float reach2 =
                palp_contact_reach2(&region[r]) + palp_contact_reach2(&d->before[o]);
            if (off2 > 2.0f * reach2 || (region[r].parents != 0u && off2 >= least)) continue;
            region[r].parents = 1u << o;
            least = off2;
        }
    }
}

uint32_t palp_contact_regions(palp_contact *c, uint32_t tool, const palp_contact_region *before,
                              uint32_t count_before,
                              palp_contact_region region[PALP_CONTACT_REGIONS]) {
    descent d = {.before = before, .count = count_before};
    uint32_t count = 0;
    const uint32_t pieces = find_pieces(c, tool);
    find_heirs(c, tool, &d);
    for (uint32_t a = 0; a < c->active_count; a++) { /* numbers of pieces, above those of regions */
        palp_contact_point *p = &c->point[c->active[a]];
        if (p->patch == tool && p->region != NO_REGION) p->region += PALP_CONTACT_REGIONS;
    }
    for (uint32_t piece = 0; piece < pieces; piece++)
        count = share_out(c, tool, &d, piece, count,
                          PALP_CONTACT_REGIONS - count - (pieces - piece - 1u));
    count = measure_all(c, tool, &d, region, count);
    name_parents(&d, region, count);
    c->work_done += 500u * (uint64_t)c->active_count;
    return count;
}
