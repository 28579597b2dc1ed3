/* SPDX-License-Identifier: MIT */
/* For the examples: a blob read into static memory, and its highest free node. */
#ifndef PALP_EXAMPLES_BLOB_H
#define PALP_EXAMPLES_BLOB_H

#include "core/palp.h"
#include <stdio.h>

#define BLOB_BYTES (64u << 20)

/* False, having said why, if there is no sound blob. */
static bool read_blob(palp_blob *blob, const char *path) {
    static _Alignas(PALP_ALIGN) uint8_t data[BLOB_BYTES];
    FILE *f = fopen(path, "rb");
    if (f == NULL) {
        perror(path);
        return false;
    }
    const size_t bytes = fread(data, 1, sizeof data, f);
    fclose(f);
    const palp_status status = palp_blob_open(blob, data, bytes);
    if (status != PALP_OK) fprintf(stderr, "%s: %s\n", path, palp_status_text(status));
    return status == PALP_OK;
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
