/* SPDX-License-Identifier: MIT */
#include "tools/bake/blobwrite.h"
#include "core/base/crc32c.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

void section_add(section_list *l, uint32_t type, const void *data, uint64_t count,
                 size_t element_bytes) {
    l->data[l->count] = data;
    l->entry[l->count++] =
        (palp_blob_entry){.type = type, .element_bytes = (uint32_t)element_bytes, .count = count};
}

static float *to_floats(const double *x, size_t n) {
    float *f = allocate(n, sizeof *f);
    for (size_t i = 0; i < n; i++) f[i] = (float)x[i];
    return f;
}

static uint32_t clamp_cell(double x, uint32_t cells) {
    return x < 0 ? 0 : x >= cells ? cells - 1 : (uint32_t)x;
}

/* A grid over the rest positions with cells of about two edge lengths. */
static void build_grid(const mesh *m, palp_meta *meta, uint32_t **offset, uint32_t **node) {
    double size = 2 * (double)meta->mean_edge_m;
    double extent = 0;
    for (int k = 0; k < 3; k++)
        extent = fmax(extent, (double)meta->box_max_m[k] - (double)meta->box_min_m[k]);
    if (size < extent / 64) size = extent / 64;
    meta->cell_size_m = (float)size;
    for (int k = 0; k < 3; k++) {
        meta->cell_origin_m[k] = meta->box_min_m[k];
        meta->cells[k] =
            1 + (uint32_t)(((double)meta->box_max_m[k] - (double)meta->box_min_m[k]) / size);
    }
    size_t cells = (size_t)meta->cells[0] * meta->cells[1] * meta->cells[2];
    uint32_t *cell = allocate(m->vertices, sizeof *cell);
    *offset = allocate(cells + 1, sizeof **offset);
    *node = allocate(m->vertices, sizeof **node);
    for (uint32_t i = 0; i < m->vertices; i++) {
        uint32_t c[3];
        for (int k = 0; k < 3; k++) {
            c[k] = clamp_cell((m->x[i][k] - (double)meta->cell_origin_m[k]) / size, meta->cells[k]);
        }
        cell[i] = (c[2] * meta->cells[1] + c[1]) * meta->cells[0] + c[0];
        (*offset)[cell[i] + 1]++;
    }
    for (size_t c = 0; c < cells; c++) (*offset)[c + 1] += (*offset)[c];
    uint32_t *at = allocate(cells, sizeof *at);
    for (uint32_t i = 0; i < m->vertices; i++) (*node)[(*offset)[cell[i]] + at[cell[i]]++] = i;
    free(at);
    free(cell);
}

static void bounding_box(const mesh *m, palp_meta *meta) {
    for (int k = 0; k < 3; k++) {
        double lo = HUGE_VAL, hi = -HUGE_VAL;
        for (uint32_t i = 0; i < m->vertices; i++) {
            lo = fmin(lo, m->x[i][k]);
            hi = fmax(hi, m->x[i][k]);
        }
        meta->box_min_m[k] = (float)lo;
        meta->box_max_m[k] = (float)hi;
    }
}

static void add_domain(section_list *l, uint32_t which, const domain_data *d) {
    uint64_t n = d->view.slots;
    section_add(l, PALP_SEC_NODE + which, d->node, n, 4);
    section_add(l, PALP_SEC_LEVEL_START + which, d->level_start, d->view.levels + 1u, 4);
    section_add(l, PALP_SEC_PARENT + which, d->parent, n, 8);
    section_add(l, PALP_SEC_PREDICT + which, d->predict, n, 8);
    section_add(l, PALP_SEC_UPDATE + which, d->update, n, 8);
    section_add(l, PALP_SEC_CHILD_OFFSET + which, d->child_offset, n + 1, 4);
    section_add(l, PALP_SEC_CHILD + which, d->child, d->child_offset[n], 4);
    section_add(l, PALP_SEC_CHILD_WEIGHT + which, d->child_weight, d->child_offset[n], 4);
    if (d->stencil_offset == NULL) return;
    section_add(l, PALP_SEC_STENCIL_OFFSET + which, d->stencil_offset, n + 1, 4);
    section_add(l, PALP_SEC_STENCIL + which, d->stencil, d->stencil_offset[n], 4);
    section_add(l, PALP_SEC_STENCIL_WEIGHT + which, d->stencil_weight, d->stencil_offset[n], 4);
}

/* Four sections, `step` apart. */
static void add_columns(section_list *l, uint32_t type, uint32_t step, const columns_data *c) {
    uint64_t groups = c->offset[c->view.columns];
    size_t width = c->half != NULL ? 2 : 4;
    section_add(l, type, c->offset, c->view.columns + 1u, 4);
    section_add(l, type + step, c->index, groups, PALP_LANES * 2);
    section_add(l, type + 2 * step, c->half != NULL ? (void *)c->half : (void *)c->value, groups,
                c->view.entries * PALP_LANES * width);
    section_add(l, type + 3 * step, c->scale, c->view.columns, 4);
}

/* Areas of every level one after the other; returns them, to be freed. */
static float *add_levels(section_list *l, const blob_content *c) {
    const palp_domain *d = &c->domain[PALP_FREE]->view;
    size_t count = 0;
    for (uint32_t k = 0; k < d->levels; k++) count += d->level_start[k + 1];
    float *area = allocate(count, sizeof *area), *at = area;
    for (uint32_t k = 0; k < d->levels; k++) {
        uint32_t nodes = d->level_start[k + 1], type = PALP_LEVEL_STRIDE * k;
        for (uint32_t i = 0; i < nodes; i++) *at++ = (float)c->h->area[k][i];
        if (c->coarse[k] != NULL) add_columns(l, PALP_SEC_LEVEL_OFFSET + type, 1, c->coarse[k]);
        if (c->table[k] != NULL) {
            section_add(l, PALP_SEC_LEVEL_TABLE + type, c->table[k],
                        (uint64_t)nodes * (nodes + 1u) / 2, 36);
        }
    }
    section_add(l, PALP_SEC_LEVEL_AREA, area, count, 4);
    return area;
}

static void add_detail(section_list *l, const detail_data *d, uint32_t nodes) {
    if (d == NULL) return;
    uint32_t entries = d->offset[d->vertices];
    section_add(l, PALP_SEC_DETAIL_OFFSET, d->offset, d->vertices + 1u, 4);
    section_add(l, PALP_SEC_DETAIL_NODE, d->node, entries, 4);
    section_add(l, PALP_SEC_DETAIL_WEIGHT, d->weight, entries, 4);
    section_add(l, PALP_SEC_DETAIL_HEIGHT, d->height, d->vertices, 4);
    section_add(l, PALP_SEC_DETAIL_TRIANGLE, d->t, d->triangles, 12);
    section_add(l, PALP_SEC_DETAIL_NEAR, d->near, nodes + 1u, 4);
    section_add(l, PALP_SEC_DETAIL_LIST, d->list, d->vertices, 4);
}

static void add_regular(section_list *l, const regular_data *r, const float *level_error,
                        const mesh *m) {
    if (r == NULL) return;
    section_add(l, PALP_SEC_ACROSS, r->across, m->triangles, 12);
    section_add(l, PALP_SEC_NODE_TRIANGLE, r->triangle, m->vertices, 4);
    section_add(l, PALP_SEC_MODE_VALUE, r->value, r->modes, 4);
    section_add(l, PALP_SEC_MODE, r->vector, 3 * (uint64_t)m->vertices * r->modes, 2);
    if (level_error != NULL)
        section_add(l, PALP_SEC_LEVEL_ERROR, level_error, PALP_LEVEL_ERRORS, 8);
}

/* Insertion sort by type: the table must ascend. */
static void sort_sections(section_list *l) {
    for (uint32_t i = 1; i < l->count; i++) {
        palp_blob_entry e = l->entry[i];
        const void *data = l->data[i];
        uint32_t k = i;
        for (; k > 0 && l->entry[k - 1].type > e.type; k--) {
            l->entry[k] = l->entry[k - 1];
            l->data[k] = l->data[k - 1];
        }
        l->entry[k] = e;
        l->data[k] = data;
    }
}

static uint64_t align_up(uint64_t x) {
    return (x + PALP_BLOB_ALIGN - 1) / PALP_BLOB_ALIGN * PALP_BLOB_ALIGN;
}

static uint8_t *lay_out(section_list *l, size_t *bytes) {
    sort_sections(l);
    uint64_t at = align_up(sizeof(palp_blob_header) + l->count * sizeof(palp_blob_entry));
    for (uint32_t i = 0; i < l->count; i++) {
        l->entry[i].offset = at;
        at = align_up(at + l->entry[i].count * l->entry[i].element_bytes);
    }
    uint8_t *blob = allocate_aligned(at, 1);
    for (uint32_t i = 0; i < l->count; i++) {
        palp_blob_entry *e = &l->entry[i];
        uint64_t size = e->count * e->element_bytes;
        if (size > 0) memcpy(blob + e->offset, l->data[i], size);
        e->crc = palp_crc32c(0, blob + e->offset, align_up(size));
    }
    palp_blob_header h = {.magic = {'P', 'A', 'L', 'P', 'B', 'L', 'O', 'B'},
                          .version = PALP_BLOB_VERSION,
                          .byte_order = PALP_BLOB_BYTE_ORDER,
                          .total_bytes = at,
                          .section_count = l->count};
    uint32_t crc = palp_crc32c(0, &h, sizeof h);
    h.header_crc = palp_crc32c(crc, l->entry, l->count * sizeof(palp_blob_entry));
    memcpy(blob, &h, sizeof h);
    memcpy(blob + sizeof h, l->entry, l->count * sizeof(palp_blob_entry));
    *bytes = at;
    return blob;
}

uint8_t *blob_assemble(const palp_blob_entry *entry, const void *const *data, uint32_t count,
                       size_t *bytes) {
    section_list l = {.count = 0};
    for (uint32_t i = 0; i < count; i++)
        section_add(&l, entry[i].type, data[i], entry[i].count, entry[i].element_bytes);
    return lay_out(&l, bytes);
}

uint8_t *blob_serialize(blob_content *c, size_t *bytes) {
    const mesh *m = c->m;
    palp_meta *meta = &c->meta;
    section_list l = {.count = 0};
    uint32_t *ring_offset, *ring, *cell_offset, *cell_node;
    meta->nodes = m->vertices;
    meta->triangles = m->triangles;
    meta->levels = c->domain[PALP_FREE]->view.levels;
    meta->mean_edge_m = (float)mesh_mean_edge(m);
    bounding_box(m, meta);
    mesh_rings(m, &ring_offset, &ring);
    build_grid(m, meta, &cell_offset, &cell_node);
    meta->max_ring = 0;
    meta->max_row = c->max_row;
    for (uint32_t i = 0; i < m->vertices; i++) {
        uint32_t valence = ring_offset[i + 1] - ring_offset[i];
        if (valence > meta->max_ring) meta->max_ring = valence;
    }
    uint32_t *slot = allocate(m->vertices, sizeof *slot);
    for (uint32_t d = 0; d < PALP_DOMAINS; d++) {
        const domain_data *v = c->domain[d];
        meta->domain_nodes[d] = v->view.slots;
        if (v->max_row > meta->max_row) meta->max_row = v->max_row;
        for (uint32_t s = 0; s < v->view.slots; s++)
            slot[v->node[s]] = s | (d == PALP_FIXED ? PALP_FIXED_FLAG : 0);
    }
    float *rest = to_floats(m->x[0], 3 * (size_t)m->vertices);
    float *normal = to_floats(c->normal[0], 3 * (size_t)m->vertices);
    float *area = to_floats(c->area, m->vertices);
    section_add(&l, PALP_SEC_META, meta, 1, sizeof *meta);
    section_add(&l, PALP_SEC_REST, rest, m->vertices, 12);
    section_add(&l, PALP_SEC_NORMAL, normal, m->vertices, 12);
    section_add(&l, PALP_SEC_AREA, area, m->vertices, 4);
    float *level_area = add_levels(&l, c);
    add_detail(&l, c->detail, m->vertices);
    add_regular(&l, c->regular, c->level_error, m);
    meta->modes = c->regular != NULL ? c->regular->modes : 0;
    meta->split_modes = c->split != NULL ? c->split->modes : 0;
    if (c->split != NULL) {
        section_add(&l, PALP_SEC_SPLIT_VALUE, c->split->value, c->split->modes, 4);
        section_add(&l, PALP_SEC_SPLIT_MODE, c->split->vector,
                    3 * (uint64_t)m->vertices * c->split->modes, 2);
    }
    meta->detail_vertices = c->detail != NULL ? c->detail->vertices : 0;
    meta->detail_triangles = c->detail != NULL ? c->detail->triangles : 0;
    section_add(&l, PALP_SEC_TRIANGLE, m->t, m->triangles, 12);
    section_add(&l, PALP_SEC_SLOT, slot, m->vertices, 4);
    section_add(&l, PALP_SEC_RING_OFFSET, ring_offset, m->vertices + 1u, 4);
    section_add(&l, PALP_SEC_RING, ring, ring_offset[m->vertices], 4);
    section_add(&l, PALP_SEC_CELL_OFFSET, cell_offset,
                (uint64_t)meta->cells[0] * meta->cells[1] * meta->cells[2] + 1, 4);
    section_add(&l, PALP_SEC_CELL_NODE, cell_node, m->vertices, 4);
    for (uint32_t d = 0; d < PALP_DOMAINS; d++) add_domain(&l, d, c->domain[d]);
    for (uint32_t block = 0; block < PALP_DOMAINS * PALP_DOMAINS; block++) {
        const columns_data *columns = c->columns[block / PALP_DOMAINS][block % PALP_DOMAINS];
        if (columns != NULL) {
            add_columns(&l, PALP_SEC_COL_OFFSET + block, PALP_SEC_COL_INDEX - PALP_SEC_COL_OFFSET,
                        columns);
        }
    }
    uint8_t *blob = lay_out(&l, bytes);
    void *temporary[] = {ring_offset, ring,   cell_offset, cell_node, slot,
                         rest,        normal, area,        level_area};
    for (size_t i = 0; i < sizeof temporary / sizeof temporary[0]; i++) free(temporary[i]);
    return blob;
}
