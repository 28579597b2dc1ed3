/* SPDX-License-Identifier: MIT */
/* The balance of forces at the seams: both sides of it, zone by zone, and its iterative solution.
 */
#include "seams.h"

/* ---- products, zone by zone ---- */

static void clear(const palp_seams *q, float *x) {
    for (uint32_t i = 0; i < 3u * q->modes; i++) x[i] = 0.0f;
}

static palp_vec3 at(const float *x, uint32_t mode) { return palp_vec3_at(x + 3u * mode); }

static void put(float *x, uint32_t mode, palp_vec3 v) {
    x[3u * mode] = v.x;
    x[3u * mode + 1u] = v.y;
    x[3u * mode + 2u] = v.z;
}

/* g of mode k of a seam's second zone. */
static palp_vec3 mismatch(const palp_seam_entry *e, const palp_frame *f, uint32_t k) {
    palp_vec3 place = palp_vec3_at(e->position_m[k]);
    palp_vec3 off = palp_madd(place, -e->ones[k], f->t);
    return palp_sub(palp_rotate_back(f->r, off), place);
}

/* u := T^T w (+ g); modes beyond the level are zero. `relative` NULL: at rest. */
static void expand(const palp_seams *q, const palp_frame *relative, uint32_t level, uint32_t zone,
                   const float *w, bool bent, float *u) {
    const palp_zone_part *part = &q->zones->part[zone];
    for (uint32_t k = 0; k < part->seams; k++) {
        uint32_t s = part->seam[k], used = palp_seam_modes(q, s, level);
        bool second = relative != NULL && palp_zone_is_second(q->zones, s, zone);
        for (uint32_t i = 0; i < q->zones->seam[s].modes; i++) {
            palp_vec3 v = {0.0f, 0.0f, 0.0f};
            if (i < used && w != NULL) v = at(w, q->first_mode[s] + i);
            if (second) v = palp_rotate_back(relative[s].r, v);
            if (second && bent && i < PALP_AFFINE_MODES)
                v = palp_add(v, mismatch(&q->zones->seam[s], &relative[s], i));
            put(u, part->first[k] + i, v);
        }
    }
}

/* out += sign T f of the zone's modal forces, entries `stride` apart. `relative` NULL: at rest. */
static void gather_among(const palp_seams *q, const palp_frame *relative, uint32_t level,
                         uint32_t zone, float sign, const float *f, float *out, size_t stride) {
    const palp_zone_part *part = &q->zones->part[zone];
    for (uint32_t k = 0; k < part->seams; k++) {
        uint32_t s = part->seam[k], used = palp_seam_modes(q, s, level);
        bool second = relative != NULL && palp_zone_is_second(q->zones, s, zone);
        for (uint32_t i = 0; i < used; i++) {
            palp_vec3 v = at(f, part->first[k] + i);
            if (second) v = palp_rotate(relative[s].r, v);
            float *to = out + 3u * (size_t)(q->first_mode[s] + i) * stride;
            to[0] += sign * v.x;
            to[stride] += sign * v.y;
            to[2u * stride] += sign * v.z;
        }
    }
}

static void gather(const palp_seams *q, const palp_frame *relative, uint32_t level, uint32_t zone,
                   float sign, const float *f, float *out) {
    gather_among(q, relative, level, zone, sign, f, out, 1u);
}

/* f := K u on the modes of the level. Rows of the packed triangle are read as straight streams. */
static void stiffness(palp_seams *q, uint32_t zone, uint32_t level, const float *u, float *f) {
    const palp_zone_part *part = &q->zones->part[zone];
    for (uint32_t i = 0; i < 3u * q->zones->zone[zone].modes; i++) f[i] = 0.0f;
    for (uint32_t a = 0; a < part->seams; a++) {
        for (uint32_t i = part->first[a];
             i < part->first[a] + palp_seam_modes(q, part->seam[a], level); i++) {
            const float *row = part->stiffness + 9u * ((size_t)i * (i + 1u) / 2u);
            palp_vec3 ui = at(u, i), fi = at(f, i);
            for (uint32_t b = 0; b <= a; b++) {
                uint32_t end = part->first[b] + palp_seam_modes(q, part->seam[b], level);
                if (end > i + 1u) end = i + 1u;
                for (uint32_t j = part->first[b]; j < end; j++) {
                    const float *k = row + 9u * j;
                    fi = palp_add(fi, palp_rotate(k, at(u, j)));
                    if (j < i) put(f, j, palp_add(at(f, j), palp_rotate_back(k, ui)));
                }
                q->work_done += 18u * (end - part->first[b]);
            }
            put(f, i, fi);
        }
    }
}

void palp_seams_mismatch(palp_seams *q, const palp_configuration *configuration, uint32_t level,
                         float *r) {
    clear(q, r);
    for (uint32_t z = 0; z < q->zones->meta->zones; z++) {
        const palp_zone_part *part = &q->zones->part[z];
        uint32_t modes = q->zones->zone[z].modes;
        for (uint32_t i = 0; i < 3u * modes; i++) q->zone_forces[i] = 0.0f;
        for (uint32_t k = 0; k < part->seams; k++) { /* only affine modes are in the way */
            uint32_t s = part->seam[k];
            if (!palp_zone_is_second(q->zones, s, z)) continue;
            uint32_t affine = q->zones->seam[s].modes;
            if (affine > PALP_AFFINE_MODES) affine = PALP_AFFINE_MODES;
            for (uint32_t j = 0; j < affine; j++) {
                palp_vec3 g = mismatch(&q->zones->seam[s], &configuration->relative[s], j);
                for (uint32_t a = 0; a < part->seams; a++) {
                    uint32_t end = part->first[a] + palp_seam_modes(q, part->seam[a], level);
                    for (uint32_t i = part->first[a]; i < end; i++) {
                        float block[9];
                        palp_zone_stiffness(part, i, part->first[k] + j, block);
                        put(q->zone_forces, i,
                            palp_add(at(q->zone_forces, i), palp_rotate(block, g)));
                    }
                    q->work_done += 9u * (end - part->first[a]);
                }
            }
        }
        gather(q, configuration->relative, level, z, -1.0f, q->zone_forces, r);
    }
}

void palp_seams_gravity(palp_seams *q, const palp_configuration *configuration, uint32_t level,
                        palp_vec3 acceleration_m_s2, float *r) {
    for (uint32_t z = 0; z < q->zones->meta->zones; z++) {
        const palp_zone_part *part = &q->zones->part[z];
        if (part->weight == NULL) continue;
        palp_vec3 local = palp_rotate_back(configuration->frame[z].r, acceleration_m_s2);
        for (uint32_t i = 0; i < q->zones->zone[z].modes; i++)
            put(q->zone_forces, i, palp_rotate(part->weight + 9u * i, local));
        gather(q, configuration->relative, level, z, -1.0f, q->zone_forces, r);
        q->work_done += 9u * q->zones->zone[z].modes;
    }
}

/* False where a node is on no seam of its zone. */
static bool find_on_seam(const palp_zones *zones, uint32_t zone, uint32_t node,
                         palp_seam_place *place) {
    const palp_zone_part *part = &zones->part[zone];
    for (uint32_t n = 0; n < part->seams; n++) {
        const uint32_t s = part->seam[n], side = palp_zone_is_second(zones, s, zone) ? 1u : 0u;
        for (uint32_t m = 0; m < zones->seam[s].nodes; m++) {
            if (zones->seam_node[s][2u * m + side] != node) continue;
            *place = (palp_seam_place){.seam = n, .node = m};
            return true;
        }
    }
    return false;
}

void palp_zone_modal_load(const palp_zones *zones, uint32_t level, uint32_t zone, uint32_t node,
                          palp_vec3 f, float *felt) {
    const palp_zone_part *part = &zones->part[zone];
    const palp_blob *b = &zones->blob[zone];
    if (!palp_node_is_fixed(b, node)) { /* Betti: G_SF = -G_FS^T */
        const float *response =
            part->response + 9u * (size_t)palp_node_slot(b, node) * zones->zone[zone].modes;
        for (uint32_t s = 0; s < part->seams; s++) {
            uint32_t end = part->first[s] + zones->seam[part->seam[s]].level_modes[level];
            for (uint32_t i = part->first[s]; i < end; i++)
                put(felt, i, palp_add(at(felt, i), palp_rotate_back(response + 9u * i, f)));
        }
        return;
    }
    palp_seam_place place;
    if (find_on_seam(zones, zone, node, &place))
        palp_zone_modal_load_at_seam(zones, level, zone, place, f, felt);
}

void palp_zone_modal_load_at_seam(const palp_zones *zones, uint32_t level, uint32_t zone,
                                  palp_seam_place place, palp_vec3 f, float *felt) {
    const palp_zone_part *part = &zones->part[zone];
    const palp_seam_entry *e = &zones->seam[part->seam[place.seam]];
    const float *mode = zones->seam_mode[part->seam[place.seam]] + (size_t)place.node * e->modes;
    const uint32_t first = part->first[place.seam];
    for (uint32_t m = 0; m < e->level_modes[level]; m++)
        put(felt, first + m, palp_madd(at(felt, first + m), mode[m], f));
}

void palp_seams_load(const palp_seams *seams, const palp_configuration *configuration,
                     uint32_t level, uint32_t zone, const float *felt, float *r) {
    gather(seams, configuration != NULL ? configuration->relative : NULL, level, zone, 1.0f, felt,
           r);
}

void palp_seams_load_among(const palp_seams *seams, const palp_configuration *configuration,
                           uint32_t zone, const float *felt, float *r, size_t stride) {
    gather_among(seams, configuration != NULL ? configuration->relative : NULL,
                 palp_seams_factor(seams)->level, zone, 1.0f, felt, r, stride);
}

void palp_seams_zone(const palp_seams *seams, const palp_configuration *configuration,
                     uint32_t level, uint32_t zone, const float *w, float *u) {
    expand(seams, configuration->relative, level, zone, w, true, u);
}

void palp_seams_expand(const palp_seams *seams, const palp_configuration *configuration,
                       uint32_t level, uint32_t zone, const float *w, float *u) {
    expand(seams, configuration != NULL ? configuration->relative : NULL, level, zone, w, false, u);
}

palp_vec3 palp_zone_modal_displacement(const palp_zones *zones, uint32_t level, uint32_t zone,
                                       uint32_t node, const float *u) {
    const palp_zone_part *part = &zones->part[zone];
    const palp_blob *b = &zones->blob[zone];
    palp_vec3 sum = {0.0f, 0.0f, 0.0f};
    if (palp_node_is_fixed(b, node)) {
        palp_seam_place place;
        return find_on_seam(zones, zone, node, &place)
                   ? palp_zone_modal_displacement_at_seam(zones, level, zone, place, u)
                   : sum;
    }
    const float *response =
        part->response + 9u * (size_t)palp_node_slot(b, node) * zones->zone[zone].modes;
    for (uint32_t k = 0; k < part->seams; k++) {
        uint32_t end = part->first[k] + zones->seam[part->seam[k]].level_modes[level];
        for (uint32_t i = part->first[k]; i < end; i++)
            sum = palp_add(sum, palp_rotate(response + 9u * i, at(u, i)));
    }
    return sum;
}

palp_vec3 palp_zone_modal_displacement_at_seam(const palp_zones *zones, uint32_t level,
                                               uint32_t zone, palp_seam_place place,
                                               const float *u) {
    const palp_zone_part *part = &zones->part[zone];
    const palp_seam_entry *e = &zones->seam[part->seam[place.seam]];
    const float *mode = zones->seam_mode[part->seam[place.seam]] + (size_t)place.node * e->modes;
    palp_vec3 sum = {0.0f, 0.0f, 0.0f};
    for (uint32_t m = 0; m < e->level_modes[level]; m++)
        sum = palp_madd(sum, mode[m], at(u, part->first[place.seam] + m));
    return sum;
}

void palp_seams_reaction(palp_seams *q, const palp_configuration *configuration, uint32_t zone,
                         const float *w, palp_vec3 acceleration_m_s2) {
    const palp_zone_part *part = &q->zones->part[zone];
    palp_vec3 local = palp_rotate_back(configuration->frame[zone].r, acceleration_m_s2);
    expand(q, configuration->relative, PALP_SEAM_LEVELS - 1u, zone, w, true, q->zone_modes);
    stiffness(q, zone, PALP_SEAM_LEVELS - 1u, q->zone_modes, q->zone_forces);
    for (uint32_t i = 0; i < q->zones->zone[zone].modes && part->weight != NULL; i++)
        put(q->zone_forces, i,
            palp_add(at(q->zone_forces, i), palp_rotate(part->weight + 9u * i, local)));
}

float palp_seams_energy(palp_seams *q, const palp_configuration *configuration, uint32_t level,
                        const float *w) {
    float energy = 0.0f;
    for (uint32_t z = 0; z < q->zones->meta->zones; z++) {
        expand(q, configuration->relative, level, z, w, true, q->zone_modes);
        stiffness(q, z, PALP_SEAM_LEVELS - 1u, q->zone_modes, q->zone_forces);
        for (uint32_t i = 0; i < q->zones->zone[z].modes; i++)
            energy += 0.5f * palp_dot(at(q->zone_modes, i), at(q->zone_forces, i));
    }
    return energy;
}

/* ---- conjugate gradients ---- */

/* out := A p on the level of the factor, for the configuration given. */
static void product(palp_seams *q, const palp_configuration *configuration, uint32_t level,
                    const float *p, float *out) {
    clear(q, out);
    for (uint32_t z = 0; z < q->zones->meta->zones; z++) {
        expand(q, configuration->relative, level, z, p, false, q->zone_modes);
        stiffness(q, z, level, q->zone_modes, q->zone_forces);
        gather(q, configuration->relative, level, z, 1.0f, q->zone_forces, out);
        q->work_done += 24u * q->zones->zone[z].modes;
    }
}

static float dot(const palp_seams *q, const float *x, const float *y) {
    float sum = 0.0f;
    for (uint32_t i = 0; i < 3u * q->modes; i++) sum += x[i] * y[i];
    return sum;
}

float palp_seams_iterate(palp_seams *q, const palp_configuration *configuration, const float *r,
                         uint32_t iterations, float *w) {
    uint32_t level = palp_seams_factor(q)->level;
    float *rest = q->work[0], *z = q->work[1], *p = q->work[2], *ap = q->work[3];
    clear(q, w);
    for (uint32_t s = 0; s < q->zones->meta->seams; s++) { /* modes beyond the level stay out */
        uint32_t used = 3u * palp_seam_modes(q, s, level),
                 all = 3u * palp_seam_modes(q, s, q->finest);
        for (uint32_t i = 0; i < all; i++)
            rest[3u * q->first_mode[s] + i] = i < used ? r[3u * q->first_mode[s] + i] : 0.0f;
    }
    for (uint32_t i = 0; i < 3u * q->modes; i++) z[i] = rest[i];
    palp_seams_solve(q, z);
    for (uint32_t i = 0; i < 3u * q->modes; i++) p[i] = z[i];
    float first = dot(q, rest, z), now = first;
    for (uint32_t k = 0; k < iterations && now > 1e-12f * first; k++) {
        product(q, configuration, level, p, ap);
        float curvature = dot(q, p, ap);
        if (!(curvature > 0.0f)) break;
        float step = now / curvature;
        for (uint32_t i = 0; i < 3u * q->modes; i++) {
            w[i] += step * p[i];
            rest[i] -= step * ap[i];
            z[i] = rest[i];
        }
        palp_seams_solve(q, z);
        float next = dot(q, rest, z);
        for (uint32_t i = 0; i < 3u * q->modes; i++) p[i] = z[i] + next / now * p[i];
        now = next;
        q->work_done += 15u * q->modes;
    }
    return first > 0.0f ? palp_sqrt(palp_max(now, 0.0f) / first) : 0.0f;
}
