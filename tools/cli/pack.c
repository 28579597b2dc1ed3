/* SPDX-License-Identifier: MIT */
/*
 * The transport form of a blob (MR 4.6): values of the columns quantised, everything entropy coded.
 *
 * Header, one entry per section of the blob, the coded sections, and a CRC-32C of all before it.
 * What is not a column value is kept bit for bit. Column values are rounded to multiples of a step,
 * the same share `delta` of the largest value of each column. Writing and reading share one routine
 * per kind of section, so they cannot disagree.
 */
#include "port/host/args.h"
#include "tools/bake/blobwrite.h"
#include "tools/cli/commands.h"
#include "port/host/blobfile.h"
#include "core/base/crc32c.h"
#include "core/green/split.h"
#include "tools/bake/half.h"
#include "port/host/parallel.h"
#include "tools/bake/rangecoder.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PACK_MAGIC "PALPPACK"
#define PACK_VERSION 1u
#define LARGEST_SECTION (UINT64_C(1) << 32)
#define ELEMENT_MAX 4096u
#define LEAST_DELTA 0x1p-28 /* so that every quotient fits 32 bits */
#define ATTEMPTS 8

typedef struct {
    char magic[8];
    uint32_t version, sections;
    uint64_t blob_bytes;
    double delta, rms; /* step over the column's largest value; RMS error that it adds (MR 70) */
} pack_header;

typedef struct {
    uint32_t type, element_bytes;
    uint64_t count, coded_bytes;
} pack_entry;

typedef struct {
    palp_blob_entry entry[BLOB_MAX_SECTIONS];
    uint8_t *data[BLOB_MAX_SECTIONS];
    uint32_t count;
} sections;

/* ---- what a section is ---- */

typedef enum { BYTES, OFFSETS, INDICES, VALUES } coding;

static coding coding_of(uint32_t type) {
    if (type >= PALP_SEC_LEVEL_OFFSET) {
        static const coding level[] = {OFFSETS, INDICES, VALUES, BYTES, BYTES};
        uint32_t part = (type - PALP_SEC_LEVEL_OFFSET) % PALP_LEVEL_STRIDE;
        return part < 5 ? level[part] : BYTES;
    }
    if (type >= PALP_SEC_COL_OFFSET && type < PALP_SEC_COL_OFFSET + 4) return OFFSETS;
    if (type >= PALP_SEC_COL_INDEX && type < PALP_SEC_COL_INDEX + 4) return INDICES;
    if (type >= PALP_SEC_COL_VALUE && type < PALP_SEC_COL_VALUE + 4) return VALUES;
    return BYTES;
}

static int find_section(const sections *s, uint32_t type) {
    for (uint32_t i = 0; i < s->count; i++) {
        if (s->entry[i].type == type) return (int)i;
    }
    return -1;
}

/* The offsets of the columns that a section of indices or values belongs to. */
static const palp_blob_entry *offsets_of(const sections *s, uint32_t type,
                                         const uint32_t **offset) {
    uint32_t wanted = type >= PALP_SEC_LEVEL_OFFSET
                          ? type - (type - PALP_SEC_LEVEL_OFFSET) % PALP_LEVEL_STRIDE
                          : PALP_SEC_COL_OFFSET + type % 8;
    int at = find_section(s, wanted);
    if (at < 0 || s->entry[at].element_bytes != 4 || s->entry[at].count < 2) return NULL;
    *offset = (const uint32_t *)(const void *)s->data[at];
    return &s->entry[at];
}

/* ---- coding ---- */

static void code_bytes(coder *c, uint8_t *data, uint64_t bytes, uint32_t element) {
    uint32_t planes = element <= 16 ? element : 4;
    bit_model(*tree)[256] = allocate(planes, sizeof *tree);
    for (size_t i = 0; i < 256 * (size_t)planes; i++) tree[i / 256][i % 256] = 32768;
    for (uint64_t i = 0; i < bytes; i++) data[i] = code_byte(c, tree[i % planes], data[i]);
    free(tree);
}

static void code_offsets(coder *c, uint32_t *x, uint64_t count) {
    number_model m;
    number_model_init(&m);
    uint32_t last = 0;
    for (uint64_t i = 0; i < count; i++) {
        x[i] = last + code_number(c, &m, x[i] - last);
        last = x[i];
    }
}

/* Gaps between the rows of a column, their size foretold by the last one. */
static void code_indices(coder *c, uint16_t *x, const uint32_t *offset, uint64_t columns) {
    number_model m[18];
    for (size_t i = 0; i < 18; i++) number_model_init(&m[i]);
    for (uint64_t j = 0; j < columns; j++) {
        uint32_t last = 0, length = 17;
        for (uint64_t k = (uint64_t)offset[j] * PALP_LANES;
             k < (uint64_t)offset[j + 1] * PALP_LANES; k++) {
            uint32_t gap = code_number(c, &m[length], (uint32_t)x[k] - last);
            x[k] = (uint16_t)(last + gap);
            last = x[k];
            length = bit_length(gap & 0xffffu);
        }
    }
}

/* Quantised entries, their size foretold by that of the same entry of the block before. */
static bool code_values(coder *c, uint8_t *data, bool half, uint32_t entries,
                        const uint32_t *offset, uint64_t columns, double delta) {
    number_model(*m)[NUMBER_LENGTHS] = allocate(9, sizeof *m);
    for (size_t i = 0; i < 9 * NUMBER_LENGTHS; i++)
        number_model_init(&m[i / NUMBER_LENGTHS][i % NUMBER_LENGTHS]);
    float *wide = (float *)(void *)data;
    uint16_t *narrow = (uint16_t *)(void *)data;
    for (uint64_t j = 0; j < columns; j++) {
        uint64_t group = (uint64_t)entries * PALP_LANES;
        uint64_t first = offset[j] * group, end = offset[j + 1] * group;
        union {
            float f;
            uint32_t u;
        } largest = {.f = 0};
        for (uint64_t k = first; k < end && !c->reading; k++)
            largest.f = fmaxf(largest.f, fabsf(half ? from_half(narrow[k]) : wide[k]));
        bit_model even[32];
        for (int b = 31; b >= 0; b--) {
            even[b] = 32768;
            uint32_t bit = code_bit(c, &even[b], largest.u >> b & 1u);
            largest.u = (largest.u & ~(1u << b)) | bit << b;
        }
        if (!isfinite(largest.f) || largest.f < 0 || largest.f > (half ? 1.0f : 1e30f)) {
            free(m);
            return false;
        }
        double step = delta * (double)largest.f;
        uint32_t length[9] = {0};
        for (uint64_t g = first; g < end; g += group) {
            for (uint64_t lane = 0; lane < PALP_LANES; lane++) {
                for (uint64_t e = 0; e < entries; e++) {
                    uint64_t k = g + e * PALP_LANES + lane;
                    int32_t q = 0;
                    if (!c->reading && step > 0)
                        q = (int32_t)lrint((double)(half ? from_half(narrow[k]) : wide[k]) / step);
                    q = code_signed(c, &m[e][length[e]], q);
                    length[e] = bit_length((uint32_t)abs(q));
                    float v = (float)fmax(-(double)largest.f, fmin(q * step, (double)largest.f));
                    if (half) narrow[k] = to_half(v);
                    if (!half) wide[k] = v;
                }
            }
        }
    }
    free(m);
    return true;
}

/* Codes section i one way or the other; false if its columns do not fit together. */
static bool code_section(coder *c, sections *s, uint32_t i, double delta) {
    palp_blob_entry *e = &s->entry[i];
    const uint32_t *offset = NULL;
    coding kind = coding_of(e->type);
    if (kind == OFFSETS && e->element_bytes == 4) {
        code_offsets(c, (uint32_t *)(void *)s->data[i], e->count);
        return true;
    }
    if (kind == BYTES || kind == OFFSETS) {
        code_bytes(c, s->data[i], e->count * e->element_bytes, e->element_bytes);
        return true;
    }
    const palp_blob_entry *columns = offsets_of(s, e->type, &offset);
    if (columns == NULL) return false;
    uint32_t width = e->element_bytes / PALP_LANES; /* 2, 4: one entry; 18, 36: nine */
    bool half = width == 2 || width == 18;
    bool known = kind == INDICES ? width == 2 : half || width == 4 || width == 36;
    bool sound =
        offset[columns->count - 1] == e->count && known && e->element_bytes == width * PALP_LANES;
    for (uint64_t j = 0; j + 1 < columns->count && sound; j++) sound = offset[j] <= offset[j + 1];
    if (!sound) return false;
    if (kind == INDICES) {
        code_indices(c, (uint16_t *)(void *)s->data[i], offset, columns->count - 1);
    } else {
        return code_values(c, s->data[i], half, width > 4 ? 9 : 1, offset, columns->count - 1,
                           delta);
    }
    return true;
}

/* ---- error ---- */

typedef struct {
    const palp_blob *a, *b;
    double *error2, *norm2;
} comparison;

/* What one free-free column differs by on the nodes, all three directions. */
static void compare_column(void *context, size_t j) {
    const comparison *c = context;
    const palp_domain *d = &c->a->domain[PALP_FREE];
    size_t n = PALP_FIELD_LANES * (size_t)d->slots;
    float *x = allocate(n, sizeof *x), *y = allocate(n, sizeof *y);
    for (size_t k = 0; k < 3; k++) {
        float force[3] = {0};
        force[k] = 1;
        palp_nodal_response(c->a, (uint32_t)j, force, x);
        palp_nodal_response(c->b, (uint32_t)j, force, y);
        for (size_t i = 0; i < n; i++) {
            c->norm2[j] += (double)x[i] * (double)x[i];
            c->error2[j] += (double)(y[i] - x[i]) * (double)(y[i] - x[i]);
        }
    }
    free(x);
    free(y);
}

static double rms_between(const palp_blob *a, const palp_blob *b) {
    size_t n = a->level[a->meta->constraint_level].nodes;
    comparison c = {a, b, allocate(n, sizeof(double)), allocate(n, sizeof(double))};
    parallel_for(n, compare_column, &c);
    double error = 0, norm = 0;
    for (size_t j = 0; j < n; j++) {
        error += c.error2[j];
        norm += c.norm2[j];
    }
    free(c.error2);
    free(c.norm2);
    return norm > 0 ? sqrt(error / norm) : 0;
}

/* ---- pack ---- */

static sections sections_of(const uint8_t *blob) {
    const palp_blob_header *h = (const palp_blob_header *)(const void *)blob;
    const palp_blob_entry *e = (const palp_blob_entry *)(const void *)(blob + sizeof *h);
    sections s = {.count = h->section_count};
    for (uint32_t i = 0; i < s.count; i++) {
        size_t bytes = (size_t)(e[i].count * e[i].element_bytes);
        s.entry[i] = e[i];
        s.data[i] = allocate_aligned(bytes + 1, 1);
        memcpy(s.data[i], blob + e[i].offset, bytes);
    }
    return s;
}

static void sections_free(sections *s) {
    for (uint32_t i = 0; i < s->count; i++) free(s->data[i]);
}

static uint8_t *assemble(const sections *s, size_t *bytes) {
    const void *data[BLOB_MAX_SECTIONS];
    for (uint32_t i = 0; i < s->count; i++) data[i] = s->data[i];
    return blob_assemble(s->entry, data, s->count, bytes);
}

/* Codes a copy of the blob with step `delta`; `coded` gets the streams, the result what unpacking
 * will give. */
static uint8_t *encode(const uint8_t *blob, double delta, coder coded[BLOB_MAX_SECTIONS],
                       size_t *bytes) {
    sections s = sections_of(blob);
    for (uint32_t i = 0; i < s.count; i++) {
        coder_write(&coded[i]);
        if (!code_section(&coded[i], &s, i, delta)) die(EXIT_WORK, "a blob with odd columns");
        coder_finish(&coded[i]);
    }
    uint8_t *out = assemble(&s, bytes);
    sections_free(&s);
    return out;
}

static const char pack_help[] =
    "usage: palp pack BLOB -o OUT [--error E]\n"
    "\n"
    "Writes the transport form of a blob: column values quantised so that the RMS error grows by "
    "no "
    "more than E\n"
    "of the free-free block (default a fifth of what the blob has already), all entropy coded.\n";

static const char unpack_help[] = "usage: palp unpack PACKED -o OUT.palp\n\n"
                                  "The blob back from its transport form. What keeps contact "
                                  "passive is measured anew.\n";

static const option pack_options[] = {{"-o", 1}, {"--error", 1}, {NULL, 0}};
static const option unpack_options[] = {{"-o", 1}, {NULL, 0}};

typedef struct {
    const char *input, *output;
    double error;
} pack_spec;

static void set_option(void *context, const argument *a) {
    pack_spec *s = context;
    if (a->option == NULL) {
        if (s->input != NULL) die(EXIT_USAGE, "one input, not also '%s'", a->value[0]);
        s->input = a->value[0];
    } else if (strcmp(a->option, "-o") == 0) {
        s->output = a->value[0];
    } else {
        s->error = arg_between(a, 0, 1);
    }
}

static void put(FILE *f, uint32_t *crc, const void *data, size_t bytes, const char *path) {
    *crc = palp_crc32c(*crc, data, bytes);
    if (fwrite(data, 1, bytes, f) != bytes) die(EXIT_WORK, "cannot write %s", path);
}

int command_pack(int argc, char **argv) {
    pack_spec s = {.error = -1};
    args_parse(argc, argv, pack_options, pack_help, set_option, &s);
    if (s.input == NULL) die(EXIT_USAGE, "no blob named (--help shows the usage)");
    if (s.output == NULL) die(EXIT_USAGE, "no output: add -o OUT");
    size_t bytes, decoded_bytes;
    uint8_t *blob = (uint8_t *)read_file(s.input, &bytes);
    palp_blob before = open_blob(s.input, blob, bytes), after;
    double wanted = s.error > 0 ? s.error : fmax(0.2 * (double)before.meta->rms_error, 1e-4);
    output out = open_output(s.output);
    coder *coded = allocate(BLOB_MAX_SECTIONS, sizeof *coded);
    double delta = fmax(wanted / 4, LEAST_DELTA), rms = 0;
    for (int attempt = 0; attempt < ATTEMPTS; attempt++) {
        uint8_t *decoded = encode(blob, delta, coded, &decoded_bytes);
        if (palp_blob_open(&after, decoded, decoded_bytes) != PALP_OK)
            die(EXIT_WORK, "%s: the error asked for is too large", s.input);
        rms = rms_between(&before, &after);
        free(decoded);
        bool within = rms <= wanted, near = rms > 0.8 * wanted || attempt > 2;
        if (within && (near || !(rms > 0))) break;
        if (attempt + 1 == ATTEMPTS || delta <= LEAST_DELTA)
            die(EXIT_WORK, "%s: an error of %g cannot be reached, only %g", s.input, wanted, rms);
        delta = fmax(delta * fmin(0.93 * wanted / fmax(rms, 1e-12), 4), LEAST_DELTA);
        for (uint32_t i = 0; i < BLOB_MAX_SECTIONS; i++) free(coded[i].data);
        memset(coded, 0, BLOB_MAX_SECTIONS * sizeof *coded);
    }
    const palp_blob_header *h = (const palp_blob_header *)(const void *)blob;
    const palp_blob_entry *e = (const palp_blob_entry *)(const void *)(blob + sizeof *h);
    pack_header header = {.magic = {'P', 'A', 'L', 'P', 'P', 'A', 'C', 'K'},
                          .version = PACK_VERSION,
                          .sections = h->section_count,
                          .blob_bytes = bytes,
                          .delta = delta,
                          .rms = rms};
    uint32_t crc = 0;
    size_t total = sizeof header + 4;
    put(out.file, &crc, &header, sizeof header, s.output);
    for (uint32_t i = 0; i < header.sections; i++) {
        pack_entry p = {e[i].type, e[i].element_bytes, e[i].count, coded[i].bytes};
        put(out.file, &crc, &p, sizeof p, s.output);
        total += sizeof p + coded[i].bytes;
    }
    for (uint32_t i = 0; i < header.sections; i++)
        put(out.file, &crc, coded[i].data, coded[i].bytes, s.output);
    if (fwrite(&crc, 1, 4, out.file) != 4) die(EXIT_WORK, "cannot write %s", s.output);
    commit_output(&out);
    fprintf(strcmp(s.output, "-") == 0 ? stderr : stdout,
            "%zu bytes to %zu, %.2f times smaller; RMS error %.5f added to %.5f\n", bytes, total,
            (double)bytes / (double)total, rms, (double)before.meta->rms_error);
    return EXIT_SUCCESS;
}

/* ---- unpack ---- */

static void refuse(const char *path, const char *why) {
    die(EXIT_WORK, "%s: %s: pack it again", path, why);
}

/* Decodes every section; sizes are bounded before anything is allocated. */
static sections decode(const char *path, const uint8_t *data, size_t bytes) {
    pack_header h;
    sections s = {.count = 0};
    if (bytes < sizeof h + 4) refuse(path, "not a packed blob, or cut short");
    memcpy(&h, data, sizeof h);
    if (memcmp(h.magic, PACK_MAGIC, 8) != 0) refuse(path, "not a packed blob");
    if (h.version != PACK_VERSION) refuse(path, "packed by another version");
    uint32_t crc;
    memcpy(&crc, data + bytes - 4, 4);
    if (crc != palp_crc32c(0, data, bytes - 4)) refuse(path, "damaged or cut short");
    size_t at = sizeof h + h.sections * sizeof(pack_entry), end = bytes - 4;
    bool sound = h.sections >= 1 && h.sections <= BLOB_MAX_SECTIONS && at <= end &&
                 h.delta >= LEAST_DELTA && h.delta < 1 && h.rms >= 0 && h.rms < 10;
    if (!sound) refuse(path, "an unsound header");
    uint64_t total = 0;
    for (uint32_t i = 0; i < h.sections; i++) {
        pack_entry p;
        memcpy(&p, data + sizeof h + i * sizeof p, sizeof p);
        sound = p.element_bytes >= 1 && p.element_bytes <= ELEMENT_MAX &&
                p.count <= LARGEST_SECTION / p.element_bytes && p.coded_bytes <= end - at &&
                p.count * p.element_bytes <= CODER_MOST_EXPANSION * (p.coded_bytes + 4);
        total += sound ? p.count * p.element_bytes : 0;
        if (!sound || total > h.blob_bytes || total > LARGEST_SECTION)
            refuse(path, "an unsound section");
        s.entry[i] =
            (palp_blob_entry){.type = p.type, .element_bytes = p.element_bytes, .count = p.count};
        s.data[i] = allocate_aligned((size_t)(p.count * p.element_bytes) + 1, 1);
        s.count = i + 1;
        coder c;
        coder_read(&c, data + at, (size_t)p.coded_bytes);
        if (!code_section(&c, &s, i, h.delta)) refuse(path, "columns that do not fit together");
        at += (size_t)p.coded_bytes;
    }
    int meta = find_section(&s, PALP_SEC_META);
    if (meta < 0 || s.entry[meta].element_bytes != sizeof(palp_meta) || s.entry[meta].count != 1)
        refuse(path, "no description");
    palp_meta *m = (palp_meta *)(void *)s.data[meta];
    m->rms_error = (float)hypot((double)m->rms_error, h.rms);
    return s;
}

int command_unpack(int argc, char **argv) {
    pack_spec s = {.input = NULL};
    args_parse(argc, argv, unpack_options, unpack_help, set_option, &s);
    if (s.input == NULL) die(EXIT_USAGE, "no packed blob named (--help shows the usage)");
    if (s.output == NULL) die(EXIT_USAGE, "no output: add -o OUT.palp");
    size_t bytes, packed_bytes;
    uint8_t *packed = (uint8_t *)read_file(s.input, &packed_bytes);
    output out = open_output(s.output);
    sections parts = decode(s.input, packed, packed_bytes);
    uint8_t *blob = assemble(&parts, &bytes);
    palp_blob b;
    palp_status status = palp_blob_open(&b, blob, bytes);
    if (status != PALP_OK) refuse(s.input, palp_status_text(status));
    if (fwrite(blob, 1, bytes, out.file) != bytes) die(EXIT_WORK, "cannot write %s", s.output);
    commit_output(&out);
    fprintf(strcmp(s.output, "-") == 0 ? stderr : stdout, "%zu bytes to %zu\n", packed_bytes,
            bytes);
    sections_free(&parts);
    return EXIT_SUCCESS;
}
