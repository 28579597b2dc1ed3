/* SPDX-License-Identifier: MIT */
#include "zones.h"
#include "core/base/real.h"
#include "core/blob/reader.h"

static bool name_is_sound(const char name[PALP_NAME_BYTES]) {
    for (uint32_t i = 0; i < PALP_NAME_BYTES; i++) {
        if (name[i] == '\0') return i > 0u;
    }
    return false;
}

static bool finite(const float *x, uint32_t n) {
    for (uint32_t i = 0; i < n; i++) {
        if (!palp_is_finite(x[i])) return false;
    }
    return true;
}

static bool near_one(float x) { return x > 0.999f && x < 1.001f; }

static void check_joints(palp_reader *r, const palp_zones *z) {
    for (uint32_t j = 0; j < z->meta->joints; j++) {
        const palp_joint_entry *e = &z->joint[j];
        palp_vec3 axis = palp_vec3_at(e->axis);
        palp_reader_require(r, name_is_sound(e->name) && e->kind <= PALP_PRISMATIC &&
                                   e->parent < z->meta->zones && e->child < z->meta->zones &&
                                   e->parent != e->child && e->closure <= 1u);
        palp_reader_require(r, finite(e->axis, 3) && finite(e->origin_m, 3) &&
                                   palp_is_finite(e->low) && palp_is_finite(e->high));
        palp_reader_require(r, e->low <= 0.0f && e->high >= 0.0f && e->low >= -1e4f &&
                                   e->high <= 1e4f && near_one(palp_norm(axis)));
    }
}

/* The joints that carry zones make a tree with its root at zone 0, parents first. */
static void check_tree(palp_reader *r, const palp_zones *z) {
    for (uint32_t i = 0; i < z->meta->zones && r->status == PALP_OK; i++) {
        const palp_zone_entry *e = &z->zone[i];
        palp_reader_require(r, name_is_sound(e->name) && finite(e->rotation, 9) &&
                                   finite(e->origin_m, 3));
        palp_reader_require(r, (e->joint == PALP_NONE) == (i == 0u));
        if (i == 0u) continue;
        palp_reader_require(r, e->joint < z->meta->joints);
        if (r->status != PALP_OK) return;
        const palp_joint_entry *j = &z->joint[e->joint];
        palp_reader_require(r, j->closure == 0u && j->child == i && j->parent < i);
    }
}

static void check_seam(palp_reader *r, const palp_zones *z, uint32_t s) {
    const palp_seam_entry *e = &z->seam[s];
    palp_reader_require(r, e->zone[0] < z->meta->zones && e->zone[1] < z->meta->zones &&
                               e->zone[0] != e->zone[1]);
    palp_reader_require(r, e->nodes >= 3u && e->nodes <= PALP_MAX_NODES && e->modes >= 3u &&
                               e->modes <= e->nodes);
    palp_reader_require(r, e->level_modes[0] >= 3u && e->length_m > 0.0f &&
                               palp_is_finite(e->length_m));
    for (uint32_t l = 1; l < PALP_SEAM_LEVELS; l++)
        palp_reader_require(r, e->level_modes[l] >= e->level_modes[l - 1u]);
    palp_reader_require(r, e->level_modes[PALP_SEAM_LEVELS - 1u] == e->modes);
    palp_reader_require(r, finite(e->ones, PALP_AFFINE_MODES) &&
                               finite(e->position_m[0], 3u * PALP_AFFINE_MODES));
    if (e->joint == PALP_NONE || r->status != PALP_OK) return;
    palp_reader_require(r, e->joint < z->meta->joints);
    if (r->status != PALP_OK) return;
    const palp_joint_entry *j = &z->joint[e->joint];
    palp_reader_require(r, j->parent == e->zone[0] && j->child == e->zone[1] &&
                               z->zone[e->zone[1]].joint == e->joint);
}

static void read_seams(palp_reader *r, palp_zones *z) {
    uint64_t nodes = 0, values = 0;
    for (uint32_t s = 0; s < z->meta->seams && r->status == PALP_OK; s++) {
        check_seam(r, z, s);
        nodes += z->seam[s].nodes;
        values += (uint64_t)z->seam[s].nodes * z->seam[s].modes;
        for (uint32_t k = 0; k < 2u && r->status == PALP_OK; k++) {
            palp_zone_part *p = &z->part[z->seam[s].zone[k]];
            palp_reader_require(r, p->seams < PALP_MAX_ZONE_SEAMS);
            if (r->status == PALP_OK) p->seam[p->seams++] = s;
        }
    }
    if (r->status != PALP_OK) return;
    const uint32_t *node = palp_reader_indices(r, PALP_SEC_SEAM_NODE, nodes, 2, PALP_MAX_NODES);
    const float *mode = palp_reader_floats(r, PALP_SEC_SEAM_MODE, values, 1);
    for (uint32_t s = 0; s < z->meta->seams && r->status == PALP_OK; s++) {
        z->seam_node[s] = node;
        z->seam_mode[s] = mode;
        node += 2u * (size_t)z->seam[s].nodes;
        mode += (size_t)z->seam[s].nodes * z->seam[s].modes;
    }
}

/* Seam nodes are held nodes of both zones. */
static void check_seam_nodes(palp_reader *r, const palp_zones *z, uint32_t s) {
    for (uint32_t i = 0; i < z->seam[s].nodes; i++) {
        for (uint32_t k = 0; k < 2u; k++) {
            const palp_blob *b = &z->blob[z->seam[s].zone[k]];
            uint32_t node = z->seam_node[s][2u * i + k];
            palp_reader_require(r, node < b->meta->nodes);
            if (r->status == PALP_OK) palp_reader_require(r, palp_node_is_fixed(b, node));
        }
    }
}

static void read_zone(palp_reader *r, palp_zones *z, uint32_t i) {
    palp_zone_part *p = &z->part[i];
    size_t bytes = 0;
    uint32_t modes = 0;
    const uint8_t *data = palp_reader_bytes(r, PALP_SEC_ZONE_BLOB + i, &bytes);
    if (data == NULL) return;
    palp_status status = palp_blob_open(&z->blob[i], data, bytes);
    if (status != PALP_OK) {
        palp_reader_fail(r, status);
        return;
    }
    const palp_meta *m = z->blob[i].meta;
    palp_reader_require(r, !palp_blob_has(&z->blob[i], PALP_META_SCALAR) &&
                               m->constraint_level + 1u == m->levels);
    for (uint32_t k = 0; k < p->seams; k++) {
        p->first[k] = modes;
        modes += z->seam[p->seam[k]].modes;
    }
    palp_reader_require(r, modes == z->zone[i].modes);
    if (r->status != PALP_OK) return;
    p->first_node = z->nodes;
    z->nodes += m->nodes;
    p->stiffness =
        palp_reader_floats(r, PALP_SEC_STIFFNESS + i, (uint64_t)modes * (modes + 1u) / 2u, 9);
    p->response = palp_reader_floats(r, PALP_SEC_SEAM_RESPONSE + i,
                                     (uint64_t)m->domain_nodes[PALP_FREE] * modes, 9);
    p->reaction = palp_reader_floats(r, PALP_SEC_REACTION + i,
                                     (uint64_t)m->domain_nodes[PALP_FIXED] * modes, 9);
    if (palp_reader_has(r, PALP_SEC_WEIGHT + i))
        p->weight = palp_reader_floats(r, PALP_SEC_WEIGHT + i, modes, 9);
}

bool palp_zones_are_here(const void *data, size_t bytes) {
    palp_reader r = palp_reader_glance(data, bytes);
    return r.status == PALP_OK && palp_reader_has(&r, PALP_SEC_ZONES);
}

palp_status palp_zones_open(palp_zones *z, const void *data, size_t bytes) {
    palp_reader r = palp_reader_open(data, bytes);
    *z = (palp_zones){.nodes = 0};
    z->meta = palp_reader_section(&r, PALP_SEC_ZONES, 1, sizeof *z->meta);
    if (z->meta == NULL) return r.status;
    palp_reader_require(&r, z->meta->zones >= 1u && z->meta->zones <= PALP_MAX_ZONES &&
                                z->meta->joints <= PALP_MAX_JOINTS &&
                                z->meta->seams <= PALP_MAX_SEAMS);
    z->zone = palp_reader_section(&r, PALP_SEC_ZONE, z->meta->zones, sizeof *z->zone);
    z->joint = palp_reader_section(&r, PALP_SEC_JOINT, z->meta->joints, sizeof *z->joint);
    z->seam = palp_reader_section(&r, PALP_SEC_SEAM, z->meta->seams, sizeof *z->seam);
    if (r.status != PALP_OK) return r.status;
    check_joints(&r, z);
    check_tree(&r, z);
    read_seams(&r, z);
    for (uint32_t i = 0; i < z->meta->zones && r.status == PALP_OK; i++) read_zone(&r, z, i);
    for (uint32_t s = 0; s < z->meta->seams && r.status == PALP_OK; s++) check_seam_nodes(&r, z, s);
    return r.status;
}
