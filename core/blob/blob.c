/* SPDX-License-Identifier: MIT */
#include "blob.h"
#include "core/base/real.h"
#include "core/blob/reader.h"

static void check_meta(palp_reader *r, const palp_meta *m) {
    palp_reader_require(r, m->nodes >= 4u && m->nodes <= PALP_MAX_NODES);
    palp_reader_require(r, m->triangles >= 4u && m->triangles <= 4u * PALP_MAX_NODES);
    palp_reader_require(r, m->levels >= 1u && m->levels <= PALP_MAX_LEVELS);
    palp_reader_require(r,
                        m->domain_nodes[PALP_FREE] >= 1u && m->domain_nodes[PALP_FREE] < m->nodes);
    palp_reader_require(r, m->domain_nodes[PALP_FIXED] == m->nodes - m->domain_nodes[PALP_FREE]);
    palp_reader_require(r, m->max_groups <= m->domain_nodes[PALP_FREE] / PALP_LANES + 1u);
    palp_reader_require(r, (m->flags & PALP_META_FIXED_COLUMNS) == 0u ||
                               (m->flags & PALP_META_REACTIONS) != 0u);
    palp_reader_require(r, m->max_ring >= 3u && m->max_ring < m->nodes);
    palp_reader_require(r, m->max_row >= 1u && m->max_row <= m->nodes);
    palp_reader_require(r, m->constraint_level < m->levels);
    for (int axis = 0; axis < 3; axis++)
        palp_reader_require(r, m->cells[axis] >= 1u && m->cells[axis] <= 256u);
    const float number[] = {m->young_Pa,
                            m->poisson,
                            m->density_kg_m3,
                            m->epsilon,
                            m->rms_error,
                            m->max_error,
                            m->mean_edge_m,
                            m->stiffness_min_N_per_m,
                            m->cell_size_m,
                            m->stiffness_max_N_per_m,
                            m->reciprocity_residual,
                            m->equilibrium_residual};
    for (size_t i = 0; i < sizeof number / sizeof number[0]; i++) {
        if (!palp_is_finite(number[i])) palp_reader_fail(r, PALP_ERR_NOT_FINITE);
    }
    for (int axis = 0; axis < 3; axis++) {
        if (!palp_is_finite(m->cell_origin_m[axis]) || !palp_is_finite(m->box_min_m[axis]) ||
            !palp_is_finite(m->box_max_m[axis])) {
            palp_reader_fail(r, PALP_ERR_NOT_FINITE);
        }
    }
    palp_reader_require(r, m->cell_size_m > 0.0f && m->mean_edge_m > 0.0f && m->young_Pa > 0.0f);
    if ((m->flags & PALP_META_SPLIT) == 0u) return;
    palp_reader_require(r, (m->flags & (PALP_META_BUTTERFLY | PALP_META_SCALAR)) == 0u);
    palp_reader_require(r, (m->flags & PALP_META_SYMMETRIC) != 0u && m->modes > 0u);
    palp_reader_require(r, m->constraint_level + 1u == m->levels);
    palp_reader_require(r,
                        m->split_modes <= PALP_MAX_MODES && m->split_modes % PALP_MODE_LANES == 0u);
}

/* Whether a cell of the search grid lists a node that lies in it, but for rounding. */
static bool cell_lists(const palp_blob *b, uint32_t cell, uint32_t node) {
    const palp_meta *m = b->meta;
    const uint32_t at[3] = {cell % m->cells[0], cell / m->cells[0] % m->cells[1],
                            cell / m->cells[0] / m->cells[1]};
    bool in = true;
    for (uint32_t e = 0; e < 3u; e++) {
        const float x = (b->rest_m[3u * node + e] - m->cell_origin_m[e]) / m->cell_size_m;
        in = in && palp_abs(x - (float)at[e] - 0.5f) < 0.51f;
    }
    for (uint32_t k = b->cell_offset[cell]; in && k < b->cell_offset[cell + 1u]; k++) {
        if (b->cell_node[k] == node) return true;
    }
    return false;
}

/* Each node is listed once, in its own cell: as many are listed as there are. */
static bool is_in_grid(const palp_blob *b, uint32_t node) {
    const palp_meta *m = b->meta;
    uint32_t low[3];
    for (uint32_t e = 0; e < 3u; e++) {
        const float x = (b->rest_m[3u * node + e] - m->cell_origin_m[e]) / m->cell_size_m;
        low[e] = (uint32_t)palp_clamp(x - 0.02f, 0.0f, (float)(m->cells[e] - 1u));
    }
    for (uint32_t k = 0; k < 8u; k++) {
        const uint32_t at[3] = {low[0] + (k & 1u), low[1] + (k >> 1u & 1u), low[2] + (k >> 2u)};
        if (at[0] >= m->cells[0] || at[1] >= m->cells[1] || at[2] >= m->cells[2]) continue;
        if (cell_lists(b, (at[2] * m->cells[1] + at[1]) * m->cells[0] + at[0], node)) return true;
    }
    return false;
}

static void read_mesh(palp_reader *r, palp_blob *b) {
    const palp_meta *m = b->meta;
    uint32_t cells = m->cells[0] * m->cells[1] * m->cells[2];
    b->rest_m = palp_reader_floats(r, PALP_SEC_REST, m->nodes, 3);
    b->normal = palp_reader_floats(r, PALP_SEC_NORMAL, m->nodes, 3);
    b->area_m2 = palp_reader_floats(r, PALP_SEC_AREA, m->nodes, 1);
    b->triangle = palp_reader_indices(r, PALP_SEC_TRIANGLE, m->triangles, 3, m->nodes);
    b->ring_offset = palp_reader_offsets(r, PALP_SEC_RING_OFFSET, m->nodes, m->max_ring);
    b->cell_offset = palp_reader_offsets(r, PALP_SEC_CELL_OFFSET, cells, m->nodes);
    if (r->status != PALP_OK) return;
    b->ring = palp_reader_indices(r, PALP_SEC_RING, b->ring_offset[m->nodes], 1, m->nodes);
    b->cell_node = palp_reader_indices(r, PALP_SEC_CELL_NODE, m->nodes, 1, m->nodes);
    palp_reader_require(r, b->cell_offset[cells] == m->nodes);
    for (uint32_t i = 0; i < m->nodes && r->status == PALP_OK; i++) {
        palp_vec3 n = palp_vec3_at(b->normal + 3u * i);
        float length2 = palp_dot(n, n);
        palp_reader_require(r, length2 > 0.98f && length2 < 1.02f);
        palp_reader_require(r, b->area_m2[i] > 0.0f);
        palp_reader_require(r, is_in_grid(b, i));
    }
}

static void read_slots(palp_reader *r, palp_blob *b) {
    const palp_meta *m = b->meta;
    b->slot = palp_reader_section(r, PALP_SEC_SLOT, m->nodes, sizeof(uint32_t));
    if (b->slot == NULL) return;
    for (uint32_t i = 0; i < m->nodes && r->status == PALP_OK; i++) {
        uint32_t d = palp_node_is_fixed(b, i) ? PALP_FIXED : PALP_FREE;
        uint32_t s = palp_node_slot(b, i);
        palp_reader_require(r, s < m->domain_nodes[d]);
        if (r->status == PALP_OK) palp_reader_require(r, b->domain[d].node[s] == i);
    }
}

/* Each stencil reaches only to coarser slots. */
static void read_stencils(palp_reader *r, palp_domain *v, uint32_t d) {
    v->stencil_offset = palp_reader_offsets(r, PALP_SEC_STENCIL_OFFSET + d, v->slots, v->slots);
    if (r->status != PALP_OK) return;
    uint32_t count = v->stencil_offset[v->slots];
    v->stencil = palp_reader_indices(r, PALP_SEC_STENCIL + d, count, 1, v->slots);
    v->stencil_weight = palp_reader_floats(r, PALP_SEC_STENCIL_WEIGHT + d, count, 1);
    for (uint32_t l = 0; l < v->levels && r->status == PALP_OK; l++) {
        for (uint32_t s = v->level_start[l]; s < v->level_start[l + 1]; s++) {
            for (uint32_t k = v->stencil_offset[s]; k < v->stencil_offset[s + 1]; k++)
                palp_reader_require(r, v->stencil[k] < v->level_start[l] && l > 0u);
        }
    }
}

static void read_domain(palp_reader *r, palp_blob *b, uint32_t d) {
    const palp_meta *m = b->meta;
    palp_domain *v = &b->domain[d];
    v->slots = m->domain_nodes[d];
    v->levels = m->levels;
    v->node = palp_reader_indices(r, PALP_SEC_NODE + d, v->slots, 1, m->nodes);
    v->level_start = palp_reader_offsets(r, PALP_SEC_LEVEL_START + d, v->levels, v->slots);
    v->parent = palp_reader_indices(r, PALP_SEC_PARENT + d, v->slots, 2, v->slots);
    v->predict = palp_reader_floats(r, PALP_SEC_PREDICT + d, v->slots, 2);
    v->update = palp_reader_floats(r, PALP_SEC_UPDATE + d, v->slots, 2);
    v->child_offset = palp_reader_offsets(r, PALP_SEC_CHILD_OFFSET + d, v->slots, v->slots);
    if (r->status != PALP_OK) return;
    v->child = palp_reader_indices(r, PALP_SEC_CHILD + d, v->child_offset[v->slots], 1, v->slots);
    v->child_weight =
        palp_reader_floats(r, PALP_SEC_CHILD_WEIGHT + d, v->child_offset[v->slots], 1);
    palp_reader_require(r, v->level_start[v->levels] == v->slots);
    if (palp_blob_has(b, PALP_META_BUTTERFLY)) read_stencils(r, v, d);
    for (uint32_t l = 1; l < v->levels && r->status == PALP_OK; l++) {
        for (uint32_t s = v->level_start[l]; s < v->level_start[l + 1]; s++) {
            for (uint32_t k = 0; k < 2; k++) {
                bool coarser = v->parent[2 * s + k] < v->level_start[l];
                bool absent = !(v->predict[2 * s + k] > 0.0f) && !(v->update[2 * s + k] > 0.0f);
                palp_reader_require(r, coarser || absent);
                palp_reader_require(r,
                                    v->predict[2 * s + k] >= 0.0f && v->update[2 * s + k] >= 0.0f);
            }
        }
    }
    for (uint32_t s = 0; s < v->slots && r->status == PALP_OK; s++) {
        for (uint32_t k = v->child_offset[s]; k < v->child_offset[s + 1]; k++) {
            uint32_t c = v->child[k];
            palp_reader_require(r, v->parent[2 * c] == s || v->parent[2 * c + 1] == s);
            palp_reader_require(r, c >= v->level_start[1]);
            if (k > v->child_offset[s]) palp_reader_require(r, c > v->child[k - 1]);
        }
    }
}

static void check_half(palp_reader *r, const uint16_t *half, uint64_t count) {
    for (uint64_t i = 0; i < count; i++) {
        if ((half[i] & 0x7c00u) == 0x7c00u) palp_reader_fail(r, PALP_ERR_NOT_FINITE);
    }
}

/* The types of the four sections of a set of columns. */
typedef struct {
    uint32_t offset, index, value, scale;
} column_types;

/* `v` comes with its counts of rows and columns; no column before `bounded` exceeds max_groups. */
static void read_columns(palp_reader *r, const palp_meta *m, palp_columns *v, column_types type,
                         uint32_t bounded) {
    v->offset = palp_reader_offsets(r, type.offset, v->columns, v->rows / PALP_LANES + 1u);
    v->scale = palp_reader_floats(r, type.scale, v->columns, 1);
    if (r->status != PALP_OK) return;
    uint32_t groups = v->offset[v->columns];
    v->entries = (m->flags & PALP_META_SCALAR) != 0u ? 1u : 9u;
    uint32_t values = v->entries * PALP_LANES;
    v->index = palp_reader_section(r, type.index, groups, PALP_LANES * sizeof(uint16_t));
    if ((m->flags & PALP_META_HALF) != 0u) {
        v->half = palp_reader_section(r, type.value, groups, values * sizeof(uint16_t));
        if (v->half != NULL) check_half(r, v->half, (uint64_t)groups * values);
    } else {
        v->value = palp_reader_floats(r, type.value, groups, values);
    }
    for (uint32_t j = 0; j < v->columns && r->status == PALP_OK; j++) {
        for (uint32_t k = v->offset[j] * PALP_LANES; k < v->offset[j + 1] * PALP_LANES; k++) {
            palp_reader_require(r, v->index[k] < v->rows);
            if (k > v->offset[j] * PALP_LANES)
                palp_reader_require(r, v->index[k] >= v->index[k - 1]);
        }
        if (j < bounded) palp_reader_require(r, v->offset[j + 1] - v->offset[j] <= m->max_groups);
    }
}

static void read_block(palp_reader *r, palp_blob *b, uint32_t row, uint32_t column) {
    uint32_t block = PALP_DOMAINS * row + column;
    const palp_domain *d = &b->domain[column];
    bool gravity = column == PALP_FREE && palp_blob_has(b, PALP_META_GRAVITY);
    uint32_t nodes =
        column == PALP_FREE ? d->level_start[b->meta->constraint_level + 1u] : d->slots;
    /* reactions to loads are then those of the fixed nodes' columns, by reciprocity */
    if (palp_blob_has(b, PALP_META_SPLIT) && row == PALP_FIXED && column == PALP_FREE) nodes = 0;
    palp_columns *v = &b->columns[row][column];
    v->rows = b->domain[row].slots;
    v->columns = nodes + (gravity ? 1u : 0u);
    read_columns(r, b->meta, v,
                 (column_types){PALP_SEC_COL_OFFSET + block, PALP_SEC_COL_INDEX + block,
                                PALP_SEC_COL_VALUE + block, PALP_SEC_COL_SCALE + block},
                 row == PALP_FREE && column == PALP_FREE ? nodes : 0u);
}

static void read_detail(palp_reader *r, palp_blob *b) {
    const palp_meta *m = b->meta;
    palp_detail *v = &b->detail;
    if (m->detail_vertices == 0u) return;
    palp_reader_require(r, m->detail_vertices <= 64u * PALP_MAX_NODES &&
                               m->detail_triangles >= 4u &&
                               m->detail_triangles <= 256u * PALP_MAX_NODES);
    v->vertices = m->detail_vertices;
    v->triangles = m->detail_triangles;
    v->offset = palp_reader_offsets(r, PALP_SEC_DETAIL_OFFSET, v->vertices, m->nodes);
    v->near = palp_reader_offsets(r, PALP_SEC_DETAIL_NEAR, m->nodes, v->vertices);
    if (r->status != PALP_OK) return;
    uint32_t entries = v->offset[v->vertices];
    v->node = palp_reader_indices(r, PALP_SEC_DETAIL_NODE, entries, 1, m->nodes);
    v->weight = palp_reader_floats(r, PALP_SEC_DETAIL_WEIGHT, entries, 1);
    v->height_m = palp_reader_floats(r, PALP_SEC_DETAIL_HEIGHT, v->vertices, 1);
    v->triangle = palp_reader_indices(r, PALP_SEC_DETAIL_TRIANGLE, v->triangles, 3, v->vertices);
    v->list = palp_reader_indices(r, PALP_SEC_DETAIL_LIST, v->vertices, 1, v->vertices);
    palp_reader_require(r, v->near[m->nodes] == v->vertices);
}

/* The constraint hierarchy, once the free-free block is there. */
static void read_levels(palp_reader *r, palp_blob *b) {
    const palp_domain *d = &b->domain[PALP_FREE];
    uint32_t areas = 0;
    for (uint32_t l = 0; l < d->levels; l++) areas += d->level_start[l + 1];
    const float *area = palp_reader_floats(r, PALP_SEC_LEVEL_AREA, areas, 1);
    for (uint32_t i = 0; i < areas && r->status == PALP_OK; i++)
        palp_reader_require(r, area[i] > 0.0f);
    for (uint32_t l = 0; l < d->levels && r->status == PALP_OK; l++) {
        palp_level *v = &b->level[l];
        uint32_t stride = PALP_LEVEL_STRIDE * l;
        v->nodes = d->level_start[l + 1];
        v->area_m2 = area;
        area += v->nodes;
        if (l > b->meta->constraint_level) continue;
        if (l == b->meta->constraint_level) {
            v->columns = b->columns[PALP_FREE][PALP_FREE];
        } else if (!palp_blob_has(b, PALP_META_SPLIT)) {
            v->columns = (palp_columns){.columns = v->nodes, .rows = d->slots};
            read_columns(
                r, b->meta, &v->columns,
                (column_types){PALP_SEC_LEVEL_OFFSET + stride, PALP_SEC_LEVEL_INDEX + stride,
                               PALP_SEC_LEVEL_VALUE + stride, PALP_SEC_LEVEL_SCALE + stride},
                v->nodes);
        }
        uint64_t blocks = (uint64_t)v->nodes * (v->nodes + 1u) / 2u;
        if (palp_reader_has(r, PALP_SEC_LEVEL_TABLE + stride))
            v->table = palp_reader_floats(r, PALP_SEC_LEVEL_TABLE + stride, blocks, 9);
    }
    palp_reader_require(r, b->level[0].nodes >= 1u);
}

/* Whether triangle `t` lies across the edge of triangle `s` that faces corner `corner`; itself
 * where nothing beyond is to be touched. */
static bool is_across(const palp_blob *b, uint32_t s, uint32_t corner, uint32_t t) {
    const uint32_t *from = b->triangle + 3u * (size_t)s, *to = b->triangle + 3u * (size_t)t;
    const uint32_t p = from[(corner + 1u) % 3u], q = from[(corner + 2u) % 3u];
    if (s == t) return true;
    for (uint32_t k = 0; k < 3u; k++) {
        if (to[k] == q && to[(k + 1u) % 3u] == p) return true;
    }
    return false;
}

static void read_regular(palp_reader *r, palp_blob *b) {
    const palp_meta *m = b->meta;
    palp_regular *v = &b->regular;
    if (m->modes == 0u) return;
    palp_reader_require(r, m->modes <= PALP_MAX_MODES && m->modes % PALP_MODE_LANES == 0u &&
                               m->poisson > -1.0f && m->poisson <= 0.5f);
    if (r->status != PALP_OK) return;
    v->across = palp_reader_indices(r, PALP_SEC_ACROSS, m->triangles, 3, m->triangles);
    v->triangle = palp_reader_indices(r, PALP_SEC_NODE_TRIANGLE, m->nodes, 1, m->triangles);
    v->value = palp_reader_floats(r, PALP_SEC_MODE_VALUE, m->modes, 1);
    v->vector =
        palp_reader_section(r, PALP_SEC_MODE, (uint64_t)m->nodes * 3u * m->modes, sizeof(int16_t));
    if (palp_reader_has(r, PALP_SEC_LEVEL_ERROR))
        v->level_error = palp_reader_floats(r, PALP_SEC_LEVEL_ERROR, PALP_LEVEL_ERRORS, 2);
    if (r->status != PALP_OK) return;
    for (uint32_t t = 0; t < m->triangles; t++) {
        for (uint32_t k = 0; k < 3u; k++)
            palp_reader_require(r, is_across(b, t, k, v->across[3u * (size_t)t + k]));
    }
    for (uint32_t i = 0; i < m->nodes; i++) {
        const uint32_t *corner = b->triangle + 3u * (size_t)v->triangle[i];
        palp_reader_require(r, corner[0] == i || corner[1] == i || corner[2] == i);
    }
    v->modes = m->modes;
}

static void read_split(palp_reader *r, palp_blob *b) {
    const palp_meta *m = b->meta;
    palp_split_modes *v = &b->split;
    if (!palp_blob_has(b, PALP_META_SPLIT)) return;
    *v = (palp_split_modes){m->modes, b->regular.value, b->regular.vector};
    if (m->split_modes == 0u) return;
    v->count = m->split_modes;
    v->value = palp_reader_floats(r, PALP_SEC_SPLIT_VALUE, v->count, 1);
    v->vector = palp_reader_section(r, PALP_SEC_SPLIT_MODE, (uint64_t)m->nodes * 3u * v->count,
                                    sizeof(int16_t));
}

palp_status palp_blob_open(palp_blob *blob, const void *data, size_t bytes) {
    palp_reader r = palp_reader_open(data, bytes);
    palp_blob b = {.bytes = bytes};
    b.meta = palp_reader_section(&r, PALP_SEC_META, 1, sizeof(palp_meta));
    if (b.meta == NULL) return r.status;
    check_meta(&r, b.meta);
    if (r.status == PALP_OK) read_mesh(&r, &b);
    for (uint32_t d = 0; d < PALP_DOMAINS && r.status == PALP_OK; d++) read_domain(&r, &b, d);
    if (r.status == PALP_OK) read_slots(&r, &b);
    for (uint32_t row = 0; row < PALP_DOMAINS && r.status == PALP_OK; row++) {
        if (row == PALP_FIXED && !palp_blob_has(&b, PALP_META_REACTIONS)) continue;
        read_block(&r, &b, row, PALP_FREE);
        /* of the split form they are the reactions too */
        const bool reacting = row == PALP_FREE && palp_blob_has(&b, PALP_META_SPLIT) &&
                              palp_blob_has(&b, PALP_META_REACTIONS);
        if (r.status != PALP_OK || !(reacting || palp_blob_has(&b, PALP_META_FIXED_COLUMNS)))
            continue;
        read_block(&r, &b, row, PALP_FIXED);
    }
    if (r.status == PALP_OK) read_levels(&r, &b);
    if (r.status == PALP_OK) read_detail(&r, &b);
    if (r.status == PALP_OK) read_regular(&r, &b);
    if (r.status == PALP_OK) read_split(&r, &b);
    if (r.status == PALP_OK) *blob = b;
    return r.status;
}
