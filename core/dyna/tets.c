/* SPDX-License-Identifier: MIT */
#include "tets.h"
#include "core/base/real.h"
#include "core/blob/reader.h"

#define WEIGHT_MAX 64.0f /* of a node in an interpolation */

static void check_starts(palp_reader *r, const uint32_t *first, uint32_t levels, uint32_t count,
                         uint32_t least) {
    palp_reader_require(r, first[0] == 0u && first[levels] == count);
    for (uint32_t l = 0; l < levels; l++)
        palp_reader_require(r, first[l] <= first[l + 1u] && first[l + 1u] <= count &&
                                   first[l + 1u] - first[l] >= least);
}

static void check_meta(palp_reader *r, const palp_tets_meta *m) {
    palp_reader_require(r, m->levels >= 1u && m->levels <= PALP_TET_LEVELS);
    palp_reader_require(r, m->nodes >= 4u && m->nodes <= PALP_MAX_NODES);
    palp_reader_require(r, m->tets >= 1u && m->tets <= 16u * PALP_MAX_NODES);
    palp_reader_require(r, m->families <= m->nodes && m->skin >= 4u && m->skin <= m->nodes);
    palp_reader_require(r, m->skin_triangles >= 4u && m->skin_triangles <= 4u * m->skin);
    if (r->status != PALP_OK) return;
    check_starts(r, m->first_node, m->levels, m->nodes, 4u);
    check_starts(r, m->first_tet, m->levels, m->tets, 1u);
    check_starts(r, m->first_family, m->levels - 1u, m->families, 1u);
    const float number[] = {m->young_Pa, m->density_kg_m3, m->diagonal_m};
    for (uint32_t i = 0; i < 3u; i++)
        palp_reader_require(r, palp_is_finite(number[i]) && number[i] > 0.0f);
    for (uint32_t l = 0; l < m->levels; l++)
        palp_reader_require(r, m->theta[l] > 0.0f && m->theta[l] <= 4.0f);
    palp_reader_require(r, m->drag_per_s >= 0.0f && palp_is_finite(m->drag_per_s));
    palp_reader_require(r, m->poisson > -1.0f && m->poisson < 0.5f && m->damping_s >= 0.0f &&
                               palp_is_finite(m->damping_s));
}

/* Four weights that sum to one. */
static void check_weights(palp_reader *r, const float *w) {
    float sum = w[0] + w[1] + w[2] + w[3];
    bool bounded = true;
    for (uint32_t k = 0; k < 4u; k++) bounded = bounded && palp_abs(w[k]) <= WEIGHT_MAX;
    palp_reader_require(r, bounded && sum > 0.999f && sum < 1.001f);
}

static void read_nodes(palp_reader *r, palp_tets *t) {
    uint32_t n = t->meta->nodes;
    t->rest_m = palp_reader_floats(r, PALP_SEC_TET_REST, n, 3);
    t->node = palp_reader_section(r, PALP_SEC_TET_NODE, n, sizeof *t->node);
    for (uint32_t i = 0; i < n && r->status == PALP_OK; i++) {
        const palp_tet_node *e = &t->node[i];
        palp_reader_require(r, e->volume_m3 > 0.0f && palp_is_finite(e->volume_m3) &&
                                   e->near_m > 0.0f && palp_is_finite(e->near_m) &&
                                   e->flags <= PALP_TET_PINNED);
        for (uint32_t k = 0; k < 6u; k++)
            palp_reader_require(r, palp_is_finite(e->gradient_sum[k]) &&
                                       (k >= 3u || e->gradient_sum[k] >= 0.0f));
        palp_reader_require(r, e->gradient_sum[0] + e->gradient_sum[1] + e->gradient_sum[2] > 0.0f);
    }
}

static void read_level_tets(palp_reader *r, const palp_tets *t, uint32_t level) {
    const palp_tets_meta *m = t->meta;
    for (uint32_t i = m->first_tet[level]; i < m->first_tet[level + 1u]; i++) {
        const palp_tet *e = &t->tet[i];
        for (uint32_t k = 0; k < 4u; k++)
            palp_reader_require(r, e->node[k] >= m->first_node[level] &&
                                       e->node[k] < m->first_node[level + 1u]);
        palp_reader_require(r, e->node[0] != e->node[1] && e->node[0] != e->node[2] &&
                                   e->node[0] != e->node[3] && e->node[1] != e->node[2] &&
                                   e->node[1] != e->node[3] && e->node[2] != e->node[3]);
        palp_reader_require(r, e->volume_m3 > 0.0f && palp_is_finite(e->volume_m3));
        for (uint32_t k = 0; k < 9u; k++) palp_reader_require(r, palp_is_finite(e->b[k]));
        if (r->status != PALP_OK) return;
    }
}

static void read_tets(palp_reader *r, palp_tets *t) {
    const palp_tets_meta *m = t->meta;
    t->tet = palp_reader_section(r, PALP_SEC_TET, m->tets, sizeof *t->tet);
    for (uint32_t l = 0; l < m->levels && r->status == PALP_OK; l++) read_level_tets(r, t, l);
    t->around_offset = palp_reader_offsets(r, PALP_SEC_TET_AROUND_OFFSET, m->nodes, m->tets);
    t->around = palp_reader_indices(r, PALP_SEC_TET_AROUND, 4u * (uint64_t)m->tets, 1, m->tets);
    if (r->status != PALP_OK) return;
    palp_reader_require(r, t->around_offset[m->nodes] == 4u * m->tets);
    for (uint32_t i = 0; i < m->nodes && r->status == PALP_OK; i++) {
        palp_reader_require(r, t->around_offset[i + 1u] > t->around_offset[i]);
        for (uint32_t k = t->around_offset[i]; k < t->around_offset[i + 1u]; k++) {
            const uint32_t *n = t->tet[t->around[k]].node;
            palp_reader_require(r, n[0] == i || n[1] == i || n[2] == i || n[3] == i);
            if (k > t->around_offset[i]) palp_reader_require(r, t->around[k] > t->around[k - 1u]);
        }
    }
}

/* The level that node i is on; i is below the number of nodes. */
static uint32_t level_of(const palp_tets_meta *m, uint32_t i) {
    uint32_t l = 0;
    /* at most levels */
    while (i >= m->first_node[l + 1u]) l++;
    return l;
}

static void read_containers(palp_reader *r, palp_tets *t) {
    const palp_tets_meta *m = t->meta;
    t->container = palp_reader_indices(r, PALP_SEC_TET_CONTAINER, m->nodes, 1, m->tets);
    t->container_weight = palp_reader_floats(r, PALP_SEC_TET_CONTAINER_WEIGHT, m->nodes, 4);
    for (uint32_t i = m->first_node[1]; i < m->nodes && r->status == PALP_OK; i++) {
        uint32_t l = level_of(m, i);
        palp_reader_require(r, t->container[i] >= m->first_tet[l - 1u] &&
                                   t->container[i] < m->first_tet[l]);
        check_weights(r, t->container_weight + 4u * (size_t)i);
    }
}

/* Members of family f of list `which` are on `level`, name it as theirs, and are there once. */
static void check_members(palp_reader *r, const palp_tets *t, uint32_t f, uint32_t which,
                          uint32_t level) {
    const palp_tets_meta *m = t->meta;
    const uint32_t *offset = which == 0u ? t->child_offset : t->parent_offset;
    const uint32_t *list = which == 0u ? t->child : t->parent;
    palp_reader_require(r, offset[f + 1u] > offset[f]);
    for (uint32_t k = offset[f]; k < offset[f + 1u] && r->status == PALP_OK; k++) {
        uint32_t n = list[k];
        palp_reader_require(r, n >= m->first_node[level] && n < m->first_node[level + 1u] &&
                                   t->family[2u * n + which] == f);
        if (k > offset[f]) palp_reader_require(r, n > list[k - 1u]);
    }
}

static void read_families(palp_reader *r, palp_tets *t) {
    const palp_tets_meta *m = t->meta;
    uint32_t last = m->levels - 1u;
    t->family = palp_reader_section(r, PALP_SEC_TET_FAMILY, m->nodes, 2u * sizeof(uint32_t));
    t->child_offset = palp_reader_offsets(r, PALP_SEC_TET_CHILD_OFFSET, m->families, m->nodes);
    t->parent_offset = palp_reader_offsets(r, PALP_SEC_TET_PARENT_OFFSET, m->families, m->nodes);
    if (r->status != PALP_OK) return;
    uint32_t children = m->nodes - m->first_node[1], parents = m->first_node[last];
    palp_reader_require(r, t->child_offset[m->families] == children &&
                               t->parent_offset[m->families] == parents);
    t->child = palp_reader_indices(r, PALP_SEC_TET_CHILD, children, 1, m->nodes);
    t->parent = palp_reader_indices(r, PALP_SEC_TET_PARENT, parents, 1, m->nodes);
    for (uint32_t l = 0; l < last && r->status == PALP_OK; l++) {
        for (uint32_t f = m->first_family[l]; f < m->first_family[l + 1u]; f++) {
            check_members(r, t, f, 0, l + 1u);
            check_members(r, t, f, 1, l);
        }
    }
    for (uint32_t i = 0; i < m->nodes && r->status == PALP_OK; i++) {
        uint32_t up = t->family[2u * (size_t)i], down = t->family[2u * (size_t)i + 1u];
        palp_reader_require(r, i < m->first_node[1] ? up == PALP_NONE : up < m->families);
        palp_reader_require(r, i >= m->first_node[last] ? down == PALP_NONE : down < m->families);
    }
}

/* A parent is a mean of children of its own family. */
static void read_means(palp_reader *r, palp_tets *t) {
    const palp_tets_meta *m = t->meta;
    t->mean_offset = palp_reader_offsets(r, PALP_SEC_TET_MEAN_OFFSET, m->nodes, m->nodes);
    if (r->status != PALP_OK) return;
    uint32_t count = t->mean_offset[m->nodes];
    t->mean = palp_reader_indices(r, PALP_SEC_TET_MEAN, count, 1, m->nodes);
    t->mean_weight = palp_reader_floats(r, PALP_SEC_TET_MEAN_WEIGHT, count, 1);
    for (uint32_t i = 0; i < m->nodes && r->status == PALP_OK; i++) {
        uint32_t f = t->family[2u * (size_t)i + 1u];
        float sum = 0.0f;
        for (uint32_t k = t->mean_offset[i]; k < t->mean_offset[i + 1u]; k++) {
            palp_reader_require(r, f != PALP_NONE && t->family[2u * (size_t)t->mean[k]] == f &&
                                       palp_abs(t->mean_weight[k]) <= WEIGHT_MAX);
            sum += t->mean_weight[k];
        }
        palp_reader_require(r, f == PALP_NONE || (sum > 0.999f && sum < 1.001f));
    }
}

static void read_skin(palp_reader *r, palp_tets *t) {
    const palp_tets_meta *m = t->meta;
    t->skin_node = palp_reader_indices(r, PALP_SEC_SKIN_NODE, m->skin, 1, m->nodes);
    t->skin_triangle =
        palp_reader_indices(r, PALP_SEC_SKIN_TRIANGLE, m->skin_triangles, 3, m->skin);
    t->skin_normal = palp_reader_floats(r, PALP_SEC_SKIN_NORMAL, m->skin, 3);
    t->skin_tet = palp_reader_indices(r, PALP_SEC_SKIN_TET, m->skin, m->levels, m->tets);
    t->skin_weight = palp_reader_floats(r, PALP_SEC_SKIN_WEIGHT, (uint64_t)m->skin * m->levels, 4);
    for (uint32_t i = 0; i < m->skin && r->status == PALP_OK; i++) {
        float length = palp_norm(palp_vec3_at(t->skin_normal + 3u * (size_t)i));
        palp_reader_require(r, length > 0.99f && length < 1.01f &&
                                   t->skin_node[i] >= m->first_node[m->levels - 1u]);
        for (uint32_t l = 0; l < m->levels; l++) {
            uint32_t tet = t->skin_tet[i * m->levels + l];
            palp_reader_require(r, tet >= m->first_tet[l] && tet < m->first_tet[l + 1u]);
            check_weights(r, t->skin_weight + 4u * ((size_t)i * m->levels + l));
        }
    }
}

bool palp_tets_are_here(const void *data, size_t bytes) {
    palp_reader r = palp_reader_glance(data, bytes);
    return r.status == PALP_OK && palp_reader_has(&r, PALP_SEC_TETS);
}

palp_status palp_tets_open(palp_tets *tets, const void *data, size_t bytes) {
    palp_reader r = palp_reader_open(data, bytes);
    *tets = (palp_tets){.meta = palp_reader_section(&r, PALP_SEC_TETS, 1, sizeof *tets->meta)};
    if (tets->meta == NULL) return r.status;
    check_meta(&r, tets->meta);
    if (r.status != PALP_OK) return r.status;
    read_nodes(&r, tets);
    if (r.status == PALP_OK) read_tets(&r, tets);
    if (r.status == PALP_OK) read_containers(&r, tets);
    if (r.status == PALP_OK) read_families(&r, tets);
    if (r.status == PALP_OK) read_means(&r, tets);
    if (r.status == PALP_OK) read_skin(&r, tets);
    return r.status;
}
