/* SPDX-License-Identifier: MIT */
/* For the examples: a blob read into static memory, and its highest free node. */
#ifndef PALP_EXAMPLES_BLOB_H
#define PALP_EXAMPLES_BLOB_H

#include "core/palp.h"
#include <stdio.h>

#define BLOB_BYTES (64u << 20)

static palp_status read_blob(palp_blob *blob, const char *path) {
    static _Alignas(PALP_ALIGN) uint8_t data[BLOB_BYTES];
    FILE *f = fopen(path, "rb");
    if (f == NULL) return PALP_ERR_ABSENT;
    const size_t bytes = fread(data, 1, sizeof data, f);
    fclose(f);
    return palp_blob_open(blob, data, bytes);
}

static uint32_t highest_node(const palp_blob *b) {
    uint32_t top = b->domain[PALP_FREE].node[0];
    for (uint32_t i = 0; i < b->domain[PALP_FREE].slots; i++) {
        const uint32_t node = b->domain[PALP_FREE].node[i];
        if (b->rest_m[3u * node + 2u] > b->rest_m[3u * top + 2u]) top = node;
    }
    return top;
}

#endif
