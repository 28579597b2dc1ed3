/* SPDX-License-Identifier: MIT */
/* From dense Green's functions to the finished bytes of a blob: domains, and either compressed
 * columns of every constraint level with tables, or the split form (core/green/split.h). */
#ifndef PALP_TOOLS_BUILD_H
#define PALP_TOOLS_BUILD_H

#include "tools/bake/blobwrite.h"
#include "tools/bake/greens.h"
#include "tools/press/press.h"
#include "tools/bake/regular.h"

typedef struct {
    wavelet wavelet;
    compress_options compress;
    double table_bytes;          /* most that the dense tables of all levels may take together */
    bool raw;                    /* reciprocity not enforced */
    bool split;                  /* split form; needs modes, nodes as columns, linear wavelets */
    bool loads_only;             /* no columns of fixed nodes */
    const detail_data *detail;   /* display surface; NULL: none */
    uint32_t constraint_level;   /* finest level whose columns are stored */
    uint32_t modes;              /* of the regular part, for contact; 0: none */
    const regular_data *regular; /* made already; NULL: it is to be made */
    uint32_t presses;            /* places at which the levels of contact are measured; 0: not */
} build_options;

#define BUILD_PRESSES 24u
#define BUILD_MODES 56u /* by default: 0.9 MB with 2,562 nodes */

typedef struct {
    uint8_t *bytes;
    size_t size;
    palp_meta meta;
    double left_over;               /* of regular_data */
    double worst_column, worst_own; /* of split_data */
    press_errors levels;            /* of contact; count 0: not measured */
} built;

/* The wavelet domains of a mesh. */
typedef struct {
    domain_data domain[PALP_DOMAINS];
    hierarchy h;
} domains;
domains domains_build(const mesh *m, const uint8_t *fixed, const double *area, wavelet w);
void domains_free(domains *d);

/*
 * `meta` comes with material and hash. Exits with a message when a level's compliance is not
 * positive definite. The greens must have been through greens_reciprocity.
 */
built blob_build(const mesh *m, const greens *g, const domains *d, const double *area,
                 double (*normal)[3], palp_meta meta, const build_options *options);

#endif
