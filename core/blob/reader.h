/* SPDX-License-Identifier: MIT */
/*
 * Reads the sections of a blob with every check that their users rely on; for the files of core
 * that open blobs. The first error is kept and later steps do nothing.
 */
#ifndef PALP_BLOB_READER_H
#define PALP_BLOB_READER_H

#include "core/base/status.h"
#include "core/blob/format.h"
#include <stdbool.h>

typedef struct {
    const uint8_t *data;
    size_t bytes;
    uint32_t sections;
    palp_status status;
} palp_reader;

/* Checks alignment, header, table and all CRCs. */
palp_reader palp_reader_open(const void *data, size_t bytes);

/* Alignment and header with its CRC only, for a look at which sections there are. */
palp_reader palp_reader_glance(const void *data, size_t bytes);

void palp_reader_fail(palp_reader *reader, palp_status status);
void palp_reader_require(palp_reader *reader, bool condition); /* else RANGE */
bool palp_reader_has(const palp_reader *reader, uint32_t type);

/* The section of `type`, which must hold `count` elements of `size` bytes; NULL and an error if it
 * does not. */
const void *palp_reader_section(palp_reader *reader, uint32_t type, uint64_t count, size_t size);

/* The bytes of a section of any length; NULL and an error if it is absent. */
const uint8_t *palp_reader_bytes(palp_reader *reader, uint32_t type, size_t *bytes);

/* Floats, all finite. */
const float *palp_reader_floats(palp_reader *reader, uint32_t type, uint64_t count, uint32_t width);

/* Indices, each below `bound`. */
const uint32_t *palp_reader_indices(palp_reader *reader, uint32_t type, uint64_t count,
                                    uint32_t width, uint32_t bound);

/* count + 1 ascending offsets from 0, no step above `max_step`. */
const uint32_t *palp_reader_offsets(palp_reader *reader, uint32_t type, uint32_t count,
                                    uint32_t max_step);

#endif
