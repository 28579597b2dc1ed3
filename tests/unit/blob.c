/* SPDX-License-Identifier: MIT */
/* A hostile blob is an error code: every byte flipped, every length cut, every index checked. */
#include "core/base/crc32c.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

static baked sample;

static palp_status open_copy(uint8_t *copy, size_t bytes) {
    palp_blob b;
    return palp_blob_open(&b, copy, bytes);
}

/* Recomputes all CRCs, so that only the checks behind them stand between a bad value and its use.
 */
static void reseal(uint8_t *blob) {
    palp_blob_header *h = (palp_blob_header *)(void *)blob;
    palp_blob_entry *e = (palp_blob_entry *)(void *)(blob + sizeof *h);
    for (uint32_t i = 0; i < h->section_count; i++) {
        uint64_t end = i + 1 < h->section_count ? e[i + 1].offset : h->total_bytes;
        e[i].crc = palp_crc32c(0, blob + e[i].offset, end - e[i].offset);
    }
    h->header_crc = 0;
    uint32_t crc = palp_crc32c(0, h, sizeof *h);
    h->header_crc = palp_crc32c(crc, e, h->section_count * sizeof *e);
}

static uint8_t *section_of(uint8_t *blob, uint32_t type) {
    palp_blob_header *h = (palp_blob_header *)(void *)blob;
    palp_blob_entry *e = (palp_blob_entry *)(void *)(blob + sizeof *h);
    for (uint32_t i = 0; i < h->section_count; i++) {
        if (e[i].type == type) return blob + e[i].offset;
    }
    return NULL;
}

static void test_flips(uint8_t *copy) {
    size_t accepted = 0;
    for (size_t i = 0; i < sample.size; i++) {
        copy[i] ^= (uint8_t)(1u << (i % 8));
        accepted += open_copy(copy, sample.size) == PALP_OK ? 1 : 0;
        copy[i] ^= (uint8_t)(1u << (i % 8));
    }
    CHECK(accepted == 0, "one bit flipped in each of %zu bytes: all refused", sample.size);
}

static void test_lengths(uint8_t *copy) {
    size_t accepted = 0;
    for (size_t n = 0; n < sample.size; n += 13) accepted += open_copy(copy, n) == PALP_OK ? 1 : 0;
    CHECK(accepted == 0, "cut at every 13th length: all refused");
    CHECK(open_copy(copy, sample.size - 1) == PALP_ERR_TRUNCATED, "one byte short says truncated");
    CHECK(open_copy(copy, sample.size + 64) == PALP_ERR_TABLE, "bytes behind the end are refused");
    palp_blob b;
    CHECK(palp_blob_open(&b, copy + 4, sample.size) == PALP_ERR_ALIGNMENT,
          "a misaligned blob is refused");
    CHECK(palp_blob_open(&b, NULL, 0) == PALP_ERR_TRUNCATED, "no blob is refused");
}

/* Writes `value` at byte `at` of a section of a resealed copy and expects `wanted`. */
static void expect_bad(uint32_t type, size_t at, uint32_t value, palp_status wanted,
                       const char *what) {
    uint8_t *copy = allocate_aligned(sample.size, 1);
    memcpy(copy, sample.bytes, sample.size);
    memcpy(section_of(copy, type) + at, &value, sizeof value);
    reseal(copy);
    palp_status status = open_copy(copy, sample.size);
    CHECK(status == wanted, "%s: %s", what, palp_status_text(status));
    free(copy);
}

/* Presses a ball into a body somewhere, whatever its numbers are. */
static void touch(const palp_blob *b, double where) {
    palp_contact c;
    uint32_t node = (uint32_t)(where * b->meta->nodes) % b->meta->nodes;
    palp_tool tool = palp_tool_sphere(2.0f * b->meta->mean_edge_m);
    const palp_contact_config config = {
        .blob = b, .tools = &tool, .tool_count = 1, .finest = PALP_CONTACT_FINEST};
    size_t bytes = palp_contact_memsize(&config);
    void *memory = allocate_aligned(bytes + 1, 1);
    if (palp_contact_init(&c, &config, memory, bytes) == PALP_OK) {
        const palp_contact_spring held = {
            .held = palp_frame_at(palp_vec3_at(b->rest_m + 3 * (size_t)node))};
        for (int k = 0; k < 3; k++) palp_contact_solve(&c, &held.held, &held);
    }
    free(memory);
}

/* Random words in resealed blobs: opening either refuses, or leaves views through which solving
 * stays inside. */
static void test_random(void) {
    uint64_t seed = 2026;
    uint8_t *copy = allocate_aligned(sample.size, 1);
    size_t accepted = 0, total = 3000;
    for (size_t k = 0; k < total; k++) {
        memcpy(copy, sample.bytes, sample.size);
        palp_blob_header *h = (palp_blob_header *)(void *)copy;
        palp_blob_entry *e = (palp_blob_entry *)(void *)(copy + sizeof *h);
        uint32_t s = (uint32_t)(fabs(tap_random(&seed)) * h->section_count) % h->section_count;
        uint64_t size = e[s].count * e[s].element_bytes;
        if (size < 4) continue;
        uint64_t at = (uint64_t)(fabs(tap_random(&seed)) * (double)(size / 4)) % (size / 4) * 4;
        uint32_t value = (uint32_t)(int32_t)(tap_random(&seed) * (k % 3 == 0 ? 2e9 : 700));
        memcpy(copy + e[s].offset + at, &value, 4);
        reseal(copy);
        palp_blob b;
        if (palp_blob_open(&b, copy, sample.size) != PALP_OK) continue;
        accepted++;
        palp_cma cma;
        size_t bytes = palp_cma_memsize(&b, 3);
        void *memory = allocate_aligned(bytes, 1);
        float *u = allocate(3 * b.meta->nodes, sizeof *u),
              *f = allocate(3 * b.meta->nodes, sizeof *f);
        if (palp_cma_init(&cma, &b, 3, memory, bytes) == PALP_OK) {
            (void)palp_cma_prescribe(&cma, b.domain[PALP_FREE].node[0], PALP_PRESCRIBE_DISPLACEMENT,
                                     (palp_vec3){1, 0, 0});
            (void)palp_cma_solve(&cma, u, f);
        }
        free(memory);
        free(u);
        free(f);
        touch(&b, fabs(tap_random(&seed)));
    }
    CHECK(true, "%zu resealed random changes: %zu accepted, and solved without leaving the blob",
          total, accepted);
    free(copy);
}

/* A row longer than the blob says is refused where it is met. */
static void test_short_rows(void) {
    uint8_t *copy = allocate_aligned(sample.size, 1);
    const uint32_t one = 1;
    palp_blob b;
    memcpy(copy, sample.bytes, sample.size);
    memcpy(section_of(copy, PALP_SEC_META) + offsetof(palp_meta, max_row), &one, sizeof one);
    reseal(copy);
    CHECK(palp_blob_open(&b, copy, sample.size) == PALP_OK,
          "a blob that understates its rows opens");
    const uint32_t slots = b.domain[PALP_FREE].slots;
    palp_row_scratch scratch = {.weight = allocate(slots, sizeof(float)),
                                .mark = allocate((slots + 31) / 32, sizeof(uint32_t))};
    palp_row row = {.index = allocate(slots, sizeof *row.index),
                    .weight = allocate(slots, sizeof *row.weight)};
    const palp_basis basis = {b.meta->constraint_level, slots - 1};
    CHECK(!palp_basis_row(&b, basis, &scratch, &row, b.meta->max_row) &&
              palp_basis_row(&b, basis, &scratch, &row, slots),
          "and what it has no room for is not made");
    void *owned[] = {scratch.weight, scratch.mark, row.index, row.weight};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    free(copy);
}

int main(void) {
    progress_quiet(1);
    sample = model_bake(model_sphere(1), -0.5, 0.05, false, false);
    uint8_t *copy = allocate_aligned(sample.size + 128, 1);
    memcpy(copy, sample.bytes, sample.size);
    CHECK(open_copy(copy, sample.size) == PALP_OK, "the sample of %zu bytes opens", sample.size);
    test_flips(copy);
    test_lengths(copy);
    free(copy);
    expect_bad(PALP_SEC_TRIANGLE, 0, 42, PALP_ERR_RANGE, "a triangle's vertex out of range");
    expect_bad(PALP_SEC_REST, 4, 0x7fc00000u, PALP_ERR_NOT_FINITE, "a NaN position");
    expect_bad(PALP_SEC_COL_VALUE, 16, 0x7f800000u, PALP_ERR_NOT_FINITE,
               "an infinite column value");
    expect_bad(PALP_SEC_COL_INDEX, 0, 0xffffffffu, PALP_ERR_RANGE, "a row index out of range");
    expect_bad(PALP_SEC_COL_OFFSET, 4, 0xffffu, PALP_ERR_RANGE, "a column offset out of range");
    expect_bad(PALP_SEC_CHILD_OFFSET, 4, 0x80000000u, PALP_ERR_RANGE,
               "a child offset out of range");
    expect_bad(PALP_SEC_RING, 0, 4096, PALP_ERR_RANGE, "a neighbour out of range");
    expect_bad(PALP_SEC_CELL_NODE, 8, 4096, PALP_ERR_RANGE, "a grid node out of range");
    expect_bad(PALP_SEC_NODE, 0, 41, PALP_ERR_RANGE, "a slot that names another slot's node");
    expect_bad(PALP_SEC_AREA, 0, 0x80000000u, PALP_ERR_RANGE, "a nodal area that is not positive");
    expect_bad(PALP_SEC_META, 0, 43, PALP_ERR_RANGE, "a node count that disagrees");
    expect_bad(PALP_SEC_META, offsetof(palp_meta, max_groups), 1u << 29, PALP_ERR_RANGE,
               "a column length beyond the rows");
    expect_bad(PALP_SEC_META, offsetof(palp_meta, flags),
               sample.blob.meta->flags & ~PALP_META_REACTIONS, PALP_ERR_RANGE,
               "columns of fixed nodes without their rows");
    expect_bad(PALP_SEC_NORMAL, 0, 0x60000000u, PALP_ERR_RANGE,
               "a normal that is not of unit length");
    expect_bad(PALP_SEC_META, offsetof(palp_meta, flags),
               sample.blob.meta->flags | PALP_META_SPLIT | PALP_META_BUTTERFLY, PALP_ERR_RANGE,
               "a split form with butterfly wavelets");
    expect_bad(PALP_SEC_META, offsetof(palp_meta, flags),
               (sample.blob.meta->flags | PALP_META_SPLIT) & ~PALP_META_SYMMETRIC, PALP_ERR_RANGE,
               "a split form that is not symmetric");
    test_short_rows();
    test_random();
    /* Baking again gives the same bytes, on one thread or several. */
    set_threads(1);
    baked again = model_bake(model_sphere(1), -0.5, 0.05, false, false);
    set_threads(3);
    baked third = model_bake(model_sphere(1), -0.5, 0.05, false, false);
    CHECK(again.size == sample.size && memcmp(again.bytes, sample.bytes, sample.size) == 0,
          "the same bytes on one thread");
    CHECK(third.size == sample.size && memcmp(third.bytes, sample.bytes, sample.size) == 0,
          "the same bytes on three threads");
    return tap_done();
}
