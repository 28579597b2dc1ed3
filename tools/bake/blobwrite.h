/* SPDX-License-Identifier: MIT */
/* Writes a blob: sections are collected, laid out, checked in and given their CRCs. */
#ifndef PALP_TOOLS_BLOBWRITE_H
#define PALP_TOOLS_BLOBWRITE_H

#define BLOB_MAX_SECTIONS 256u

#include "tools/bake/compress.h"
#include "tools/bake/detail.h"
#include "tools/bake/hierarchy.h"
#include "tools/bake/regular.h"

/* Everything that one blob of an elastostatic body holds; pointers are borrowed. */
typedef struct {
    const mesh *m;
    const uint8_t *fixed;
    const double *area;
    double (*normal)[3];
    const hierarchy *h;
    const columns_data *coarse[PALP_MAX_LEVELS]; /* levels below the constraint level */
    const float *table[PALP_MAX_LEVELS];         /* NULL: not stored */
    const detail_data *detail;                   /* NULL: none */
    const float *level_error;                    /* [PALP_LEVEL_ERRORS][2]; NULL: none */
    const regular_data *regular;                 /* NULL: none */
    const regular_data *split;                   /* the split form's own modes; NULL: none */
    uint32_t max_row;                            /* at least; 0: that of the domains */
    palp_meta meta; /* material, options, errors; counts and grid are filled in here */
    const domain_data *domain[PALP_DOMAINS];
    const columns_data *columns[PALP_DOMAINS][PALP_DOMAINS]; /* NULL: not stored */
} blob_content;

/* Sections of a blob on their way into it; data are borrowed. */
typedef struct {
    palp_blob_entry entry[BLOB_MAX_SECTIONS];
    const void *data[BLOB_MAX_SECTIONS];
    uint32_t count;
} section_list;
void section_add(section_list *l, uint32_t type, const void *data, uint64_t count,
                 size_t element_bytes);

/* Lays sections out (type, element_bytes and count of each entry are read) with offsets and CRCs.
 */
uint8_t *blob_assemble(const palp_blob_entry *entry, const void *const *data, uint32_t count,
                       size_t *bytes);

/* Returns the finished bytes (64-byte aligned, to be freed); they pass palp_blob_open. */
uint8_t *blob_serialize(blob_content *content, size_t *bytes);

#endif
