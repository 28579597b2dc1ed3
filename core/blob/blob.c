/* SPDX-License-Identifier: MIT */
#include "blob.h"
#include "core/base/crc32c.h"
#include "core/base/real.h"

#define MAX_SECTIONS 160u

/* The bytes under inspection, and the first error met: later steps do nothing once it is set. */
typedef struct {
    const uint8_t *data;
    size_t bytes;
    uint32_t sections;
    palp_status status;
} reader;

static void fail(reader *r, palp_status status) {
    if (r->status == PALP_OK) r->status = status;
}
static void require(reader *r, bool condition) {
    if (!condition) fail(r, PALP_ERR_RANGE);
}

static const palp_blob_entry *entry_at(const reader *r, uint32_t i) {
    return (const palp_blob_entry *)(const void *)(r->data + sizeof(palp_blob_header)) + i;
}

static bool same_bytes(const void *a, const void *b, size_t n) {
    const uint8_t *p = a;
    const uint8_t *q = b;
    for (size_t i = 0; i < n; i++) {
        if (p[i] != q[i]) return false;
    }
    return true;
}

static uint32_t header_crc(const reader *r, const palp_blob_header *header) {
    palp_blob_header copy = *header;
    copy.header_crc = 0;
    uint32_t crc = palp_crc32c(0, &copy, sizeof copy);
    return palp_crc32c(crc, r->data + sizeof copy, r->sections * sizeof(palp_blob_entry));
}

static void check_header(reader *r) {
    const palp_blob_header *h = (const palp_blob_header *)(const void *)r->data;
    if (r->bytes < sizeof *h) {
        fail(r, PALP_ERR_TRUNCATED);
        return;
    }
    if (!same_bytes(h->magic, PALP_BLOB_MAGIC, sizeof h->magic)) {
        fail(r, PALP_ERR_MAGIC);
        return;
    }
    if (h->version != PALP_BLOB_VERSION || h->byte_order != PALP_BLOB_BYTE_ORDER) {
        fail(r, PALP_ERR_VERSION);
        return;
    }
    if (h->section_count == 0u || h->section_count > MAX_SECTIONS) {
        fail(r, PALP_ERR_TABLE);
        return;
    }
    r->sections = h->section_count;
    if (r->bytes < sizeof *h + r->sections * sizeof(palp_blob_entry)) {
        fail(r, PALP_ERR_TRUNCATED);
        return;
    }
    if (header_crc(r, h) != h->header_crc) {
        fail(r, PALP_ERR_CRC);
        return;
    }
    if (h->total_bytes > r->bytes) fail(r, PALP_ERR_TRUNCATED);
    if (h->total_bytes < r->bytes) fail(r, PALP_ERR_TABLE);
}

/* Sections must follow each other without overlap or unchecked gaps, types ascending. */
static void check_table(reader *r) {
    uint64_t at = sizeof(palp_blob_header) + r->sections * sizeof(palp_blob_entry);
    uint32_t last_type = 0;
    at = (at + PALP_BLOB_ALIGN - 1u) / PALP_BLOB_ALIGN * PALP_BLOB_ALIGN;
    for (size_t i = sizeof(palp_blob_header) + r->sections * sizeof(palp_blob_entry); i < at; i++) {
        if (i >= r->bytes || r->data[i] != 0u) fail(r, PALP_ERR_TABLE);
    }
    for (uint32_t i = 0; i < r->sections && r->status == PALP_OK; i++) {
        const palp_blob_entry *e = entry_at(r, i);
        bool sane = e->type > last_type && e->offset == at && e->element_bytes > 0u &&
                    e->count <= r->bytes && e->count * e->element_bytes <= r->bytes - at;
        if (!sane) {
            fail(r, PALP_ERR_TABLE);
            return;
        }
        last_type = e->type;
        uint64_t size = e->count * e->element_bytes;
        uint64_t padded = (size + PALP_BLOB_ALIGN - 1u) / PALP_BLOB_ALIGN * PALP_BLOB_ALIGN;
        if (padded > r->bytes - at) {
            fail(r, PALP_ERR_TRUNCATED);
            return;
        }
        if (palp_crc32c(0, r->data + at, (size_t)padded) != e->crc) {
            fail(r, PALP_ERR_CRC);
            return;
        }
        at += padded;
    }
    if (r->status == PALP_OK && at != r->bytes) fail(r, PALP_ERR_TABLE);
}

/* The section of `type`, which must hold `count` elements of `size` bytes; NULL and an error if
 * not. */
static const void *section(reader *r, uint32_t type, uint64_t count, size_t size) {
    if (r->status != PALP_OK) return NULL;
    for (uint32_t i = 0; i < r->sections; i++) {
        const palp_blob_entry *e = entry_at(r, i);
        if (e->type == type && e->count == count && e->element_bytes == size) {
            return r->data + e->offset;
        }
    }
    fail(r, PALP_ERR_TABLE);
    return NULL;
}

static const float *floats(reader *r, uint32_t type, uint64_t count, uint32_t width) {
    const float *x = section(r, type, count, width * sizeof(float));
    if (x == NULL) return NULL;
    for (uint64_t i = 0; i < count * width; i++) {
        if (!palp_is_finite(x[i])) {
            fail(r, PALP_ERR_NOT_FINITE);
            return NULL;
        }
    }
    return x;
}

/* Indices, each below `bound`. */
static const uint32_t *indices(reader *r, uint32_t type, uint64_t count, uint32_t width,
                               uint32_t bound) {
    const uint32_t *x = section(r, type, count, width * sizeof(uint32_t));
    if (x == NULL) return NULL;
    for (uint64_t i = 0; i < count * width; i++) {
        if (x[i] >= bound) {
            fail(r, PALP_ERR_RANGE);
            return NULL;
        }
    }
    return x;
}

/* count + 1 ascending offsets from 0, no step above `max_step`. */
static const uint32_t *offsets(reader *r, uint32_t type, uint32_t count, uint32_t max_step) {
    const uint32_t *x = section(r, type, (uint64_t)count + 1u, sizeof(uint32_t));
    if (x == NULL) return NULL;
    require(r, x[0] == 0u);
    for (uint32_t i = 0; i < count; i++)
        require(r, x[i + 1] >= x[i] && x[i + 1] - x[i] <= max_step);
    return r->status == PALP_OK ? x : NULL;
}

static void check_meta(reader *r, const palp_meta *m) {
    require(r, m->nodes >= 4u && m->nodes <= PALP_MAX_NODES);
    require(r, m->triangles >= 4u && m->triangles <= 4u * PALP_MAX_NODES);
    require(r, m->levels >= 1u && m->levels <= PALP_MAX_LEVELS);
    require(r, m->domain_nodes[PALP_FREE] >= 1u && m->domain_nodes[PALP_FREE] < m->nodes);
    require(r, m->domain_nodes[PALP_FIXED] == m->nodes - m->domain_nodes[PALP_FREE]);
    require(r, m->max_groups <= m->domain_nodes[PALP_FREE] / PALP_LANES + 1u);
    require(r,
            (m->flags & PALP_META_FIXED_COLUMNS) == 0u || (m->flags & PALP_META_REACTIONS) != 0u);
    require(r, m->max_ring >= 3u && m->max_ring < m->nodes);
    require(r, m->max_row >= 1u && m->max_row <= m->nodes);
    require(r, m->constraint_level < m->levels);
    for (int axis = 0; axis < 3; axis++) require(r, m->cells[axis] >= 1u && m->cells[axis] <= 256u);
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
        if (!palp_is_finite(number[i])) fail(r, PALP_ERR_NOT_FINITE);
    }
    for (int axis = 0; axis < 3; axis++) {
        if (!palp_is_finite(m->cell_origin_m[axis]) || !palp_is_finite(m->box_min_m[axis]) ||
            !palp_is_finite(m->box_max_m[axis])) {
            fail(r, PALP_ERR_NOT_FINITE);
        }
    }
    require(r, m->cell_size_m > 0.0f && m->mean_edge_m > 0.0f && m->young_Pa > 0.0f);
}

static void read_mesh(reader *r, palp_blob *b) {
    const palp_meta *m = b->meta;
    uint32_t cells = m->cells[0] * m->cells[1] * m->cells[2];
    b->rest_m = floats(r, PALP_SEC_REST, m->nodes, 3);
    b->normal = floats(r, PALP_SEC_NORMAL, m->nodes, 3);
    b->area_m2 = floats(r, PALP_SEC_AREA, m->nodes, 1);
    b->softening = floats(r, PALP_SEC_SOFTENING, m->nodes, 1);
    b->triangle = indices(r, PALP_SEC_TRIANGLE, m->triangles, 3, m->nodes);
    b->ring_offset = offsets(r, PALP_SEC_RING_OFFSET, m->nodes, m->max_ring);
    b->cell_offset = offsets(r, PALP_SEC_CELL_OFFSET, cells, m->nodes);
    if (r->status != PALP_OK) return;
    b->ring = indices(r, PALP_SEC_RING, b->ring_offset[m->nodes], 1, m->nodes);
    b->cell_node = indices(r, PALP_SEC_CELL_NODE, m->nodes, 1, m->nodes);
    require(r, b->cell_offset[cells] == m->nodes);
    for (uint32_t i = 0; i < m->nodes && r->status == PALP_OK; i++) {
        palp_vec3 n = palp_vec3_at(b->normal + 3u * i);
        float length2 = palp_dot(n, n);
        require(r, length2 > 0.98f && length2 < 1.02f);
        require(r, b->area_m2[i] > 0.0f && b->softening[i] >= 0.0f);
    }
}

static void read_slots(reader *r, palp_blob *b) {
    const palp_meta *m = b->meta;
    b->slot = section(r, PALP_SEC_SLOT, m->nodes, sizeof(uint32_t));
    if (b->slot == NULL) return;
    for (uint32_t i = 0; i < m->nodes && r->status == PALP_OK; i++) {
        uint32_t d = palp_node_is_fixed(b, i) ? PALP_FIXED : PALP_FREE;
        uint32_t s = palp_node_slot(b, i);
        require(r, s < m->domain_nodes[d]);
        if (r->status == PALP_OK) require(r, b->domain[d].node[s] == i);
    }
}

/* Each stencil reaches only to coarser slots. */
static void read_stencils(reader *r, palp_domain *v, uint32_t d) {
    v->stencil_offset = offsets(r, PALP_SEC_STENCIL_OFFSET + d, v->slots, v->slots);
    if (r->status != PALP_OK) return;
    uint32_t count = v->stencil_offset[v->slots];
    v->stencil = indices(r, PALP_SEC_STENCIL + d, count, 1, v->slots);
    v->stencil_weight = floats(r, PALP_SEC_STENCIL_WEIGHT + d, count, 1);
    for (uint32_t l = 0; l < v->levels && r->status == PALP_OK; l++) {
        for (uint32_t s = v->level_start[l]; s < v->level_start[l + 1]; s++) {
            for (uint32_t k = v->stencil_offset[s]; k < v->stencil_offset[s + 1]; k++)
                require(r, v->stencil[k] < v->level_start[l] && l > 0u);
        }
    }
}

static void read_domain(reader *r, palp_blob *b, uint32_t d) {
    const palp_meta *m = b->meta;
    palp_domain *v = &b->domain[d];
    v->slots = m->domain_nodes[d];
    v->levels = m->levels;
    v->node = indices(r, PALP_SEC_NODE + d, v->slots, 1, m->nodes);
    v->level_start = offsets(r, PALP_SEC_LEVEL_START + d, v->levels, v->slots);
    v->parent = indices(r, PALP_SEC_PARENT + d, v->slots, 2, v->slots);
    v->predict = floats(r, PALP_SEC_PREDICT + d, v->slots, 2);
    v->update = floats(r, PALP_SEC_UPDATE + d, v->slots, 2);
    v->child_offset = offsets(r, PALP_SEC_CHILD_OFFSET + d, v->slots, v->slots);
    if (r->status != PALP_OK) return;
    v->child = indices(r, PALP_SEC_CHILD + d, v->child_offset[v->slots], 1, v->slots);
    v->child_weight = floats(r, PALP_SEC_CHILD_WEIGHT + d, v->child_offset[v->slots], 1);
    require(r, v->level_start[v->levels] == v->slots);
    if (palp_blob_has(b, PALP_META_BUTTERFLY)) read_stencils(r, v, d);
    for (uint32_t l = 1; l < v->levels && r->status == PALP_OK; l++) {
        for (uint32_t s = v->level_start[l]; s < v->level_start[l + 1]; s++) {
            for (uint32_t k = 0; k < 2; k++) {
                bool coarser = v->parent[2 * s + k] < v->level_start[l];
                bool absent = !(v->predict[2 * s + k] > 0.0f) && !(v->update[2 * s + k] > 0.0f);
                require(r, coarser || absent);
                require(r, v->predict[2 * s + k] >= 0.0f && v->update[2 * s + k] >= 0.0f);
            }
        }
    }
    for (uint32_t s = 0; s < v->slots && r->status == PALP_OK; s++) {
        for (uint32_t k = v->child_offset[s]; k < v->child_offset[s + 1]; k++) {
            uint32_t c = v->child[k];
            require(r, v->parent[2 * c] == s || v->parent[2 * c + 1] == s);
            require(r, c >= v->level_start[1]);
            if (k > v->child_offset[s]) require(r, c > v->child[k - 1]);
        }
    }
}

static void check_half(reader *r, const uint16_t *half, uint64_t count) {
    for (uint64_t i = 0; i < count; i++) {
        if ((half[i] & 0x7c00u) == 0x7c00u) fail(r, PALP_ERR_NOT_FINITE);
    }
}

/* The types of the four sections of a set of columns. */
typedef struct {
    uint32_t offset, index, value, scale;
} column_types;

/* `v` comes with its counts of rows and columns; no column before `bounded` exceeds max_groups. */
static void read_columns(reader *r, const palp_meta *m, palp_columns *v, column_types type,
                         uint32_t bounded) {
    v->offset = offsets(r, type.offset, v->columns, v->rows / PALP_LANES + 1u);
    v->scale = floats(r, type.scale, v->columns, 1);
    if (r->status != PALP_OK) return;
    uint32_t groups = v->offset[v->columns];
    v->entries = (m->flags & PALP_META_SCALAR) != 0u ? 1u : 9u;
    uint32_t values = v->entries * PALP_LANES;
    v->index = section(r, type.index, groups, PALP_LANES * sizeof(uint16_t));
    if ((m->flags & PALP_META_HALF) != 0u) {
        v->half = section(r, type.value, groups, values * sizeof(uint16_t));
        if (v->half != NULL) check_half(r, v->half, (uint64_t)groups * values);
    } else {
        v->value = floats(r, type.value, groups, values);
    }
    for (uint32_t j = 0; j < v->columns && r->status == PALP_OK; j++) {
        for (uint32_t k = v->offset[j] * PALP_LANES; k < v->offset[j + 1] * PALP_LANES; k++) {
            require(r, v->index[k] < v->rows);
            if (k > v->offset[j] * PALP_LANES) require(r, v->index[k] >= v->index[k - 1]);
        }
        if (j < bounded) require(r, v->offset[j + 1] - v->offset[j] <= m->max_groups);
    }
}

static void read_block(reader *r, palp_blob *b, uint32_t row, uint32_t column) {
    uint32_t block = PALP_DOMAINS * row + column;
    const palp_domain *d = &b->domain[column];
    bool gravity = column == PALP_FREE && palp_blob_has(b, PALP_META_GRAVITY);
    uint32_t nodes =
        column == PALP_FREE ? d->level_start[b->meta->constraint_level + 1u] : d->slots;
    palp_columns *v = &b->columns[row][column];
    v->rows = b->domain[row].slots;
    v->columns = nodes + (gravity ? 1u : 0u);
    read_columns(r, b->meta, v,
                 (column_types){PALP_SEC_COL_OFFSET + block, PALP_SEC_COL_INDEX + block,
                                PALP_SEC_COL_VALUE + block, PALP_SEC_COL_SCALE + block},
                 row == PALP_FREE && column == PALP_FREE ? nodes : 0u);
}

static bool has_section(const reader *r, uint32_t type) {
    for (uint32_t i = 0; i < r->sections; i++) {
        if (entry_at(r, i)->type == type) return true;
    }
    return false;
}

static void read_detail(reader *r, palp_blob *b) {
    const palp_meta *m = b->meta;
    palp_detail *v = &b->detail;
    if (m->detail_vertices == 0u) return;
    require(r, m->detail_vertices <= 64u * PALP_MAX_NODES && m->detail_triangles >= 4u &&
                   m->detail_triangles <= 256u * PALP_MAX_NODES);
    v->vertices = m->detail_vertices;
    v->triangles = m->detail_triangles;
    v->offset = offsets(r, PALP_SEC_DETAIL_OFFSET, v->vertices, m->nodes);
    v->near = offsets(r, PALP_SEC_DETAIL_NEAR, m->nodes, v->vertices);
    if (r->status != PALP_OK) return;
    uint32_t entries = v->offset[v->vertices];
    v->node = indices(r, PALP_SEC_DETAIL_NODE, entries, 1, m->nodes);
    v->weight = floats(r, PALP_SEC_DETAIL_WEIGHT, entries, 1);
    v->height_m = floats(r, PALP_SEC_DETAIL_HEIGHT, v->vertices, 1);
    v->triangle = indices(r, PALP_SEC_DETAIL_TRIANGLE, v->triangles, 3, v->vertices);
    v->list = indices(r, PALP_SEC_DETAIL_LIST, v->vertices, 1, v->vertices);
    require(r, v->near[m->nodes] == v->vertices);
}

/* The constraint hierarchy, once the free-free block is there. */
static void read_levels(reader *r, palp_blob *b) {
    const palp_domain *d = &b->domain[PALP_FREE];
    uint32_t areas = 0;
    for (uint32_t l = 0; l < d->levels; l++) areas += d->level_start[l + 1];
    const float *area = floats(r, PALP_SEC_LEVEL_AREA, areas, 1);
    for (uint32_t i = 0; i < areas && r->status == PALP_OK; i++) require(r, area[i] > 0.0f);
    for (uint32_t l = 0; l < d->levels && r->status == PALP_OK; l++) {
        palp_level *v = &b->level[l];
        uint32_t stride = PALP_LEVEL_STRIDE * l;
        v->nodes = d->level_start[l + 1];
        v->area_m2 = area;
        area += v->nodes;
        if (l > b->meta->constraint_level) continue;
        if (l == b->meta->constraint_level) {
            v->columns = b->columns[PALP_FREE][PALP_FREE];
        } else {
            v->columns = (palp_columns){.columns = v->nodes, .rows = d->slots};
            read_columns(
                r, b->meta, &v->columns,
                (column_types){PALP_SEC_LEVEL_OFFSET + stride, PALP_SEC_LEVEL_INDEX + stride,
                               PALP_SEC_LEVEL_VALUE + stride, PALP_SEC_LEVEL_SCALE + stride},
                v->nodes);
        }
        uint64_t blocks = (uint64_t)v->nodes * (v->nodes + 1u) / 2u;
        if (has_section(r, PALP_SEC_LEVEL_TABLE + stride))
            v->table = floats(r, PALP_SEC_LEVEL_TABLE + stride, blocks, 9);
    }
    require(r, b->level[0].nodes >= 1u);
}

palp_status palp_blob_open(palp_blob *blob, const void *data, size_t bytes) {
    reader r = {.data = data, .bytes = bytes, .status = PALP_OK};
    palp_blob b = {.bytes = bytes};
    if (data == NULL || ((uintptr_t)data & (PALP_BLOB_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    check_header(&r);
    if (r.status == PALP_OK) check_table(&r);
    b.meta = section(&r, PALP_SEC_META, 1, sizeof(palp_meta));
    if (b.meta == NULL) return r.status;
    check_meta(&r, b.meta);
    if (r.status == PALP_OK) read_mesh(&r, &b);
    for (uint32_t d = 0; d < PALP_DOMAINS && r.status == PALP_OK; d++) read_domain(&r, &b, d);
    if (r.status == PALP_OK) read_slots(&r, &b);
    for (uint32_t row = 0; row < PALP_DOMAINS && r.status == PALP_OK; row++) {
        if (row == PALP_FIXED && !palp_blob_has(&b, PALP_META_REACTIONS)) continue;
        read_block(&r, &b, row, PALP_FREE);
        if (!palp_blob_has(&b, PALP_META_FIXED_COLUMNS) || r.status != PALP_OK) continue;
        read_block(&r, &b, row, PALP_FIXED);
    }
    if (r.status == PALP_OK) read_levels(&r, &b);
    if (r.status == PALP_OK) read_detail(&r, &b);
    if (r.status == PALP_OK) *blob = b;
    return r.status;
}
