/* SPDX-License-Identifier: MIT */
#include "reader.h"
#include "core/base/crc32c.h"
#include "core/base/real.h"

#define MAX_SECTIONS 256u

void palp_reader_fail(palp_reader *r, palp_status status) {
    if (r->status == PALP_OK) r->status = status;
}
void palp_reader_require(palp_reader *r, bool condition) {
    if (!condition) palp_reader_fail(r, PALP_ERR_RANGE);
}

static const palp_blob_entry *entry_at(const palp_reader *r, uint32_t i) {
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

static uint32_t header_crc(const palp_reader *r, const palp_blob_header *header) {
    palp_blob_header copy = *header;
    copy.header_crc = 0;
    uint32_t crc = palp_crc32c(0, &copy, sizeof copy);
    return palp_crc32c(crc, r->data + sizeof copy, r->sections * sizeof(palp_blob_entry));
}

static void check_header(palp_reader *r) {
    const palp_blob_header *h = (const palp_blob_header *)(const void *)r->data;
    if (r->bytes < sizeof *h) {
        palp_reader_fail(r, PALP_ERR_TRUNCATED);
        return;
    }
    if (!same_bytes(h->magic, PALP_BLOB_MAGIC, sizeof h->magic)) {
        palp_reader_fail(r, PALP_ERR_MAGIC);
        return;
    }
    if (h->version < PALP_BLOB_OLDEST || h->version > PALP_BLOB_VERSION ||
        h->byte_order != PALP_BLOB_BYTE_ORDER) {
        palp_reader_fail(r, PALP_ERR_VERSION);
        return;
    }
    if (h->section_count == 0u || h->section_count > MAX_SECTIONS) {
        palp_reader_fail(r, PALP_ERR_TABLE);
        return;
    }
    r->sections = h->section_count;
    if (r->bytes < sizeof *h + r->sections * sizeof(palp_blob_entry)) {
        palp_reader_fail(r, PALP_ERR_TRUNCATED);
        return;
    }
    if (header_crc(r, h) != h->header_crc) {
        palp_reader_fail(r, PALP_ERR_CRC);
        return;
    }
    if (h->total_bytes > r->bytes) palp_reader_fail(r, PALP_ERR_TRUNCATED);
    if (h->total_bytes < r->bytes) palp_reader_fail(r, PALP_ERR_TABLE);
}

/* Sections must follow each other without overlap or unchecked gaps, types ascending. */
static void check_table(palp_reader *r) {
    uint64_t at = sizeof(palp_blob_header) + r->sections * sizeof(palp_blob_entry);
    uint32_t last_type = 0;
    at = (at + PALP_BLOB_ALIGN - 1u) / PALP_BLOB_ALIGN * PALP_BLOB_ALIGN;
    for (size_t i = sizeof(palp_blob_header) + r->sections * sizeof(palp_blob_entry); i < at; i++) {
        if (i >= r->bytes || r->data[i] != 0u) palp_reader_fail(r, PALP_ERR_TABLE);
    }
    for (uint32_t i = 0; i < r->sections && r->status == PALP_OK; i++) {
        const palp_blob_entry *e = entry_at(r, i);
        bool sane = e->type > last_type && e->offset == at && e->element_bytes > 0u &&
                    e->count <= r->bytes && e->count * e->element_bytes <= r->bytes - at;
        if (!sane) {
            palp_reader_fail(r, PALP_ERR_TABLE);
            return;
        }
        last_type = e->type;
        uint64_t size = e->count * e->element_bytes;
        uint64_t padded = (size + PALP_BLOB_ALIGN - 1u) / PALP_BLOB_ALIGN * PALP_BLOB_ALIGN;
        if (padded > r->bytes - at) {
            palp_reader_fail(r, PALP_ERR_TRUNCATED);
            return;
        }
        if (palp_crc32c(0, r->data + at, (size_t)padded) != e->crc) {
            palp_reader_fail(r, PALP_ERR_CRC);
            return;
        }
        at += padded;
    }
    if (r->status == PALP_OK && at != r->bytes) palp_reader_fail(r, PALP_ERR_TABLE);
}

/* The section of `type`, which must hold `count` elements of `size` bytes; NULL and an error if
 * not. */
const void *palp_reader_section(palp_reader *r, uint32_t type, uint64_t count, size_t size) {
    if (r->status != PALP_OK) return NULL;
    for (uint32_t i = 0; i < r->sections; i++) {
        const palp_blob_entry *e = entry_at(r, i);
        if (e->type == type && e->count == count && e->element_bytes == size) {
            return r->data + e->offset;
        }
    }
    palp_reader_fail(r, PALP_ERR_TABLE);
    return NULL;
}

const float *palp_reader_floats(palp_reader *r, uint32_t type, uint64_t count, uint32_t width) {
    const float *x = palp_reader_section(r, type, count, width * sizeof(float));
    if (x == NULL) return NULL;
    for (uint64_t i = 0; i < count * width; i++) {
        if (!palp_is_finite(x[i])) {
            palp_reader_fail(r, PALP_ERR_NOT_FINITE);
            return NULL;
        }
    }
    return x;
}

/* Indices, each below `bound`. */
const uint32_t *palp_reader_indices(palp_reader *r, uint32_t type, uint64_t count, uint32_t width,
                                    uint32_t bound) {
    const uint32_t *x = palp_reader_section(r, type, count, width * sizeof(uint32_t));
    if (x == NULL) return NULL;
    for (uint64_t i = 0; i < count * width; i++) {
        if (x[i] >= bound) {
            palp_reader_fail(r, PALP_ERR_RANGE);
            return NULL;
        }
    }
    return x;
}

/* count + 1 ascending offsets from 0, no step above `max_step`. */
const uint32_t *palp_reader_offsets(palp_reader *r, uint32_t type, uint32_t count,
                                    uint32_t max_step) {
    const uint32_t *x = palp_reader_section(r, type, (uint64_t)count + 1u, sizeof(uint32_t));
    if (x == NULL) return NULL;
    palp_reader_require(r, x[0] == 0u);
    for (uint32_t i = 0; i < count; i++)
        palp_reader_require(r, x[i + 1] >= x[i] && x[i + 1] - x[i] <= max_step);
    return r->status == PALP_OK ? x : NULL;
}

bool palp_reader_has(const palp_reader *reader, uint32_t type) {
    for (uint32_t i = 0; i < reader->sections; i++) {
        if (entry_at(reader, i)->type == type) return true;
    }
    return false;
}

const uint8_t *palp_reader_bytes(palp_reader *reader, uint32_t type, size_t *bytes) {
    for (uint32_t i = 0; i < reader->sections && reader->status == PALP_OK; i++) {
        const palp_blob_entry *e = entry_at(reader, i);
        if (e->type != type) continue;
        *bytes = (size_t)(e->count * e->element_bytes);
        return reader->data + e->offset;
    }
    palp_reader_fail(reader, PALP_ERR_TABLE);
    return NULL;
}

palp_reader palp_reader_glance(const void *data, size_t bytes) {
    palp_reader r = {.data = data, .bytes = bytes, .status = PALP_OK};
    if (((uintptr_t)data & (PALP_BLOB_ALIGN - 1u)) != 0u)
        r.status = PALP_ERR_ALIGNMENT;
    else if (data == NULL)
        r.status = PALP_ERR_TRUNCATED;
    else
        check_header(&r);
    return r;
}

palp_reader palp_reader_open(const void *data, size_t bytes) {
    palp_reader r = palp_reader_glance(data, bytes);
    if (r.status == PALP_OK) check_table(&r);
    return r;
}
