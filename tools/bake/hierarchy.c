/* SPDX-License-Identifier: MIT */
#include "tools/bake/hierarchy.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

hierarchy hierarchy_build(const domain_data *domain, const double *node_area) {
    hierarchy h = {.domain = domain->view};
    const palp_domain *d = &domain->view;
    for (uint32_t l = d->levels; l-- > 0;) {
        uint32_t n = d->level_start[l + 1];
        h.area[l] = allocate(n, sizeof *h.area[l]);
        if (l + 1 == d->levels) {
            for (uint32_t i = 0; i < n; i++) h.area[l][i] = node_area[d->node[i]];
            continue;
        }
        memcpy(h.area[l], h.area[l + 1], n * sizeof *h.area[l]);
        for (uint32_t m = n; m < d->level_start[l + 2]; m++) {
            for (uint32_t k = 0; k < 2; k++) {
                double w = (double)d->predict[2 * m + k];
                if (w > 0) h.area[l][d->parent[2 * m + k]] += w * h.area[l + 1][m];
            }
        }
    }
    return h;
}

void hierarchy_free(hierarchy *h) {
    for (uint32_t l = 0; l < h->domain.levels; l++) free(h->area[l]);
}

/* Forces on level + 1 gathered into those of `level`. */
static void gather_level(const hierarchy *h, uint32_t level, double *row) {
    const palp_domain *d = &h->domain;
    const double *fine = h->area[level + 1], *coarse = h->area[level];
    uint32_t n = d->level_start[level + 1];
    for (uint32_t k = 0; k < n; k++) {
        for (uint32_t a = 0; a < 3; a++) row[3 * k + a] *= fine[k] / coarse[k];
    }
    for (uint32_t m = n; m < d->level_start[level + 2]; m++) {
        for (uint32_t side = 0; side < 2; side++) {
            double w = (double)d->predict[2 * m + side];
            uint32_t k = d->parent[2 * m + side];
            if (!(w > 0)) continue;
            for (uint32_t a = 0; a < 3; a++)
                row[3 * k + a] += w * fine[m] / coarse[k] * row[3 * m + a];
        }
    }
}

void hierarchy_gather(const hierarchy *h, uint32_t from, uint32_t to, double *row) {
    for (uint32_t l = from; l > to; l--) gather_level(h, l - 1, row);
}

typedef struct {
    const hierarchy *h;
    uint32_t from, to;
    double *x;
    size_t stride;
} coarsening;

static void coarsen_row(void *context, size_t row) {
    const coarsening *c = context;
    hierarchy_gather(c->h, c->from, c->to, c->x + row * c->stride);
}

void hierarchy_coarsen(const hierarchy *h, uint32_t from, uint32_t to, double *x, size_t stride,
                       size_t rows) {
    coarsening c = {.h = h, .from = from, .to = to, .x = x, .stride = stride};
    parallel_for(rows, coarsen_row, &c);
}

typedef struct {
    const hierarchy *h;
    uint32_t from, to;
    const double *m;
    size_t width;
    const size_t *first;
    double *out;
} column_gathering;

static void gather_columns_row(void *context, size_t row) {
    const column_gathering *c = context;
    size_t fine = c->h->domain.level_start[c->from + 1];
    size_t coarse = c->h->domain.level_start[c->to + 1];
    double *all = allocate(3 * fine, sizeof *all);
    for (size_t j = 0; j < fine; j++)
        memcpy(all + 3 * j, c->m + row * c->width + c->first[j], 3 * sizeof *all);
    hierarchy_gather(c->h, c->from, c->to, all);
    memcpy(c->out + row * 3 * coarse, all, 3 * coarse * sizeof *all);
    free(all);
}

double *hierarchy_columns(const hierarchy *h, uint32_t from, uint32_t to, const double *m,
                          size_t width, const size_t *first, size_t rows) {
    column_gathering c = {.h = h, .from = from, .to = to, .m = m, .width = width, .first = first};
    c.out = allocate_aligned(rows * 3 * h->domain.level_start[to + 1], sizeof *c.out);
    parallel_for(rows, gather_columns_row, &c);
    return c.out;
}

double *hierarchy_compliance(const hierarchy *h, uint32_t level, const double *x, size_t stride) {
    const palp_domain *d = &h->domain;
    size_t width = 3 * (size_t)d->level_start[level + 1];
    double *rows = allocate_aligned(width * 3 * d->slots, sizeof *rows); /* transposed */
    for (size_t j = 0; j < width; j++) {
        for (size_t i = 0; i < 3 * (size_t)d->slots; i++)
            rows[j * 3 * d->slots + i] = x[(3 * (size_t)d->node[i / 3] + i % 3) * stride + j];
    }
    hierarchy_coarsen(h, d->levels - 1, level, rows, 3 * (size_t)d->slots, width);
    double *compliance = allocate_aligned(width * width, sizeof *compliance);
    for (size_t i = 0; i < width; i++) {
        for (size_t j = 0; j < width; j++) compliance[i * width + j] = rows[j * 3 * d->slots + i];
    }
    free(rows);
    return compliance;
}

void hierarchy_distribute(const hierarchy *h, uint32_t level, uint32_t k, double *weight) {
    const palp_domain *d = &h->domain;
    memset(weight, 0, d->slots * sizeof *weight);
    weight[k] = 1;
    for (uint32_t l = level; l + 1 < d->levels; l++) {
        uint32_t n = d->level_start[l + 1];
        for (uint32_t m = n; m < d->level_start[l + 2]; m++) {
            for (uint32_t side = 0; side < 2; side++) {
                double w = (double)d->predict[2 * m + side];
                uint32_t p = d->parent[2 * m + side];
                if (w > 0) weight[m] += w * h->area[l + 1][m] / h->area[l][p] * weight[p];
            }
        }
        for (uint32_t i = 0; i < n; i++) weight[i] *= h->area[l + 1][i] / h->area[l][i];
    }
}
