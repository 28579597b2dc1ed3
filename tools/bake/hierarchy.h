/* SPDX-License-Identifier: MIT */
/* The constraint hierarchy at bake time (MR 6-7): nodal areas of every level, hierarchical Green's
 * functions by refinement, and dense compliance tables. */
#ifndef PALP_TOOLS_HIERARCHY_H
#define PALP_TOOLS_HIERARCHY_H

#include "tools/bake/domain.h"

typedef struct {
    palp_domain domain;            /* the free domain, borrowed */
    double *area[PALP_MAX_LEVELS]; /* [n_l] a_[l,k] = sum_i P_ik a_i */
} hierarchy;

hierarchy hierarchy_build(const domain_data *domain, const double *node_area);
void hierarchy_free(hierarchy *h);

/* One row of block columns of level `from`, 3 n_from entries, becomes the row of level `to` in
 * place (MR 60-61 in force form). */
void hierarchy_gather(const hierarchy *h, uint32_t from, uint32_t to, double *row);

/* The same for `rows` rows. */
void hierarchy_coarsen(const hierarchy *h, uint32_t from, uint32_t to, double *x, size_t stride,
                       size_t rows);

/* Rows of the columns of level `to`, [rows][3 n_to], to be freed, from a matrix that holds those of
 * level `from`: block column k begins at first[k]. */
double *hierarchy_columns(const hierarchy *h, uint32_t from, uint32_t to, const double *m,
                          size_t width, const size_t *first, size_t rows);

/*
 * R_l G R_l^T from the columns of level l: rows of the free nodes in slot order are averaged down
 * to K(l). `x` is [3 nodes][stride]. Returns [3 n_l][3 n_l], not symmetrised, to be freed.
 */
double *hierarchy_compliance(const hierarchy *h, uint32_t level, const double *x, size_t stride);

/* weight[slots] := column k of R_l^T, how a force on [l,k] is spread over the nodes. */
void hierarchy_distribute(const hierarchy *h, uint32_t level, uint32_t k, double *weight);

#endif
