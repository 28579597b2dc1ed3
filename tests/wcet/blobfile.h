/* SPDX-License-Identifier: MIT */
/* A whole file in aligned memory, for good; exits if there is none. */
#ifndef PALP_TESTS_BLOBFILE_H
#define PALP_TESTS_BLOBFILE_H

#include <stdio.h>
#include <stdlib.h>

static inline void *load(const char *path, size_t *bytes) {
    FILE *f = fopen(path, "rb");
    if (f == NULL) exit(2);
    fseek(f, 0, SEEK_END);
    *bytes = (size_t)ftell(f);
    rewind(f);
    void *data = aligned_alloc(64, (*bytes + 63) / 64 * 64);
    if (fread(data, 1, *bytes, f) != *bytes) exit(1);
    fclose(f);
    return data;
}

#endif
