/* SPDX-License-Identifier: MIT */
#include "tools/bake/build.h"
#include "core/green/hierarchy.h"
#include "tools/solver/dense.h"
#include "port/host/parallel.h"
#include "tools/bake/regular.h"
#include "tools/bake/split.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Of the split form the columns of fixed nodes give the reactions too, which are small beside their
 * largest blocks: with these shares of epsilon reactions are off by no more than in the other form. */
#define SPLIT_FREE_ROWS 0.5
#define SPLIT_FIXED_ROWS 0.25
#define TABLE_FLOOR 1e-5 /* share of its diagonal that a table may lose and stay definite */

domains domains_build(const mesh *m, const uint8_t *fixed, const double *area, wavelet w) {
    domains d;
    semireg levels = semireg_detect(m);
    for (uint32_t k = 0; k < PALP_DOMAINS; k++)
        d.domain[k] = domain_build(m, &levels, fixed, k, area, w);
    semireg_free(&levels);
    d.h = hierarchy_build(&d.domain[PALP_FREE], area);
    return d;
}

void domains_free(domains *d) {
    hierarchy_free(&d->h);
    for (uint32_t k = 0; k < PALP_DOMAINS; k++) domain_free(&d->domain[k]);
}

typedef struct {
    const greens *g;
    const domains *d;
    const double *area;
    const build_options *o;
    compress_options compress;
    uint32_t level; /* constraint level */
    size_t *first;  /* of each free column, gravity last */
    size_t *fixed_first;
    columns_data columns[PALP_DOMAINS][PALP_DOMAINS];
    columns_data coarse[PALP_MAX_LEVELS];
    float *table[PALP_MAX_LEVELS];
    blob_content content;
} builder;

static uint32_t level_nodes(const builder *b, uint32_t level) {
    return b->d->domain[PALP_FREE].view.level_start[level + 1];
}

static void list_columns(builder *b) {
    uint32_t n = level_nodes(b, b->level);
    const domain_data *fixed = &b->d->domain[PALP_FIXED];
    b->first = allocate(n + 1u, sizeof *b->first);
    b->fixed_first = allocate(fixed->view.slots, sizeof *b->fixed_first);
    for (size_t j = 0; j < n; j++)
        b->first[j] = 3 * (b->g->basis_count > 0 ? j : b->d->domain[PALP_FREE].node[j]);
    b->first[n] = 3 * (size_t)(b->g->basis_count > 0 ? n : b->g->nodes);
    for (size_t j = 0; j < fixed->view.slots; j++) b->fixed_first[j] = 3 * (size_t)fixed->node[j];
}

static void keep_columns(builder *b, uint32_t row, uint32_t column, columns_data data) {
    b->columns[row][column] = data;
    b->content.columns[row][column] = &b->columns[row][column];
}

/* Columns of the fixed nodes, with `share` of epsilon. */
static void compress_held(builder *b, uint32_t row, double share) {
    compress_options options = b->compress;
    options.epsilon *= share;
    gf_source held = {.m = b->g->m,
                      .width = b->g->width,
                      .first = b->fixed_first,
                      .columns = b->d->domain[PALP_FIXED].view.slots,
                      .counted = b->d->domain[PALP_FIXED].view.slots};
    keep_columns(
        b, row, PALP_FIXED,
        columns_build(&held, &b->d->domain[row], row == PALP_FIXED ? b->area : NULL, options));
}

static void compress_blocks(builder *b) {
    const greens *g = b->g;
    uint32_t n = level_nodes(b, b->level);
    gf_source loads = {.m = g->m,
                       .width = g->width,
                       .first = b->first,
                       .columns = n + (g->gravity ? 1u : 0u),
                       .counted = n};
    for (uint32_t r = 0; r < PALP_DOMAINS; r++) {
        if (r == PALP_FIXED && !g->reactions) continue;
        const double *area = r == PALP_FIXED ? b->area : NULL;
        keep_columns(b, r, PALP_FREE, columns_build(&loads, &b->d->domain[r], area, b->compress));
        if (g->reactions && g->basis_count == 0 && !b->o->loads_only) compress_held(b, r, 1);
    }
}

/* Of the split form: corrections, columns of fixed nodes, and reactions to gravity alone, since those
 * to loads follow by reciprocity. */
static split_data split_blocks(builder *b, const split_body *body) {
    const greens *g = b->g;
    const size_t gravity = 3 * (size_t)g->nodes;
    split_data d = split_build(body, &b->compress);
    keep_columns(b, PALP_FREE, PALP_FREE, d.columns);
    if (!g->reactions) return d;
    gf_source all = {
        .m = g->m, .width = g->width, .first = &gravity, .columns = g->gravity ? 1u : 0u};
    keep_columns(b, PALP_FIXED, PALP_FREE,
                 columns_build(&all, &b->d->domain[PALP_FIXED], b->area, b->compress));
    compress_held(b, PALP_FREE, SPLIT_FREE_ROWS);
    if (!b->o->loads_only) compress_held(b, PALP_FIXED, SPLIT_FIXED_ROWS);
    return d;
}

/* The columns of `level`, [3 nodes][3 n_level], from those of the constraint level. */
static double *gather_columns(const builder *b, uint32_t level) {
    return hierarchy_columns(&b->d->h, b->level, level, b->g->m, b->g->width, b->first,
                             3 * (size_t)b->g->nodes);
}

static double table_size(const builder *b, uint32_t level) {
    double n = level_nodes(b, level);
    return 36 * n * (n + 1) / 2;
}

static double asymmetry(const double *t, size_t n) {
    double difference = 0, norm = 0;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            difference += (t[i * n + j] - t[j * n + i]) * (t[i * n + j] - t[j * n + i]);
            norm += t[i * n + j] * t[i * n + j];
        }
    }
    return sqrt(difference / norm);
}

static void symmetrise(double *t, size_t n) {
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < i; j++)
            t[i * n + j] = t[j * n + i] = 0.5 * (t[i * n + j] + t[j * n + i]);
    }
}

static void require_definite(const builder *b, double *t, uint32_t level) {
    size_t n = 3 * (size_t)level_nodes(b, level);
    if (b->g->basis_count > 0) {
        definite_report r = make_definite(t, n, n);
        if (!r.definite || r.change > GREENS_CHANGE_MAX) {
            die(EXIT_WORK,
                "the compliance of constraint level %" PRIu32
                " is not positive definite: collocation carries no thin walls: leave "
                "--constraint-level out",
                level);
        }
    }
    /* Thin walls bend so much more than they give way that single precision cannot hold both. */
    double *work = allocate_aligned(n * n, sizeof *work), raised = 0;
    for (double step = TABLE_FLOOR;; step *= 2) {
        for (size_t i = 0; i < n * n; i++) work[i] = (double)(float)t[i];
        for (size_t i = 0; i < n; i++) work[i * n + i] *= 1 - TABLE_FLOOR;
        if (dense_cholesky(work, n, n) == n) break;
        for (size_t i = 0; i < n; i++) t[i * n + i] *= 1 + step;
        raised += step;
        if (raised > GREENS_CHANGE_MAX)
            die(EXIT_WORK,
                "the compliance table of constraint level %" PRIu32
                " is not positive definite in single precision: a wall is too thin for the body's "
                "size; use --table-mb 0",
                level);
    }
    free(work);
    if (raised > 0)
        warn("the compliance table of constraint level %" PRIu32
             " was raised by %.2g %% of its diagonal to stay definite in single precision: a wall "
             "is thin for the body's size",
             level, 100 * raised);
}

static float *pack_table(const double *t, size_t nodes) {
    float *packed = allocate(9 * nodes * (nodes + 1) / 2, sizeof *packed), *at = packed;
    for (size_t i = 0; i < nodes; i++) {
        for (size_t j = 0; j <= i; j++) {
            for (size_t e = 0; e < 9; e++)
                *at++ = (float)t[(3 * i + e / 3) * 3 * nodes + 3 * j + e % 3];
        }
    }
    return packed;
}

/* The table of `level` from its columns. */
static void make_table(builder *b, uint32_t level, const double *x) {
    size_t n = level_nodes(b, level);
    double *t = hierarchy_compliance(&b->d->h, level, x, 3 * n);
    if (b->g->basis_count > 0 && level == b->level)
        b->content.meta.reciprocity_residual = (float)asymmetry(t, 3 * n);
    symmetrise(t, 3 * n);
    require_definite(b, t, level);
    b->table[level] = pack_table(t, n);
    b->content.table[level] = b->table[level];
    free(t);
}

static void build_levels(builder *b) {
    double room = b->o->raw || b->g->scalar ? 0 : b->o->table_bytes;
    for (uint32_t l = 0; l <= b->level; l++) {
        bool fits = table_size(b, l) <= room;
        room = fits ? room - table_size(b, l) : 0;
        if (l == b->level && !fits) continue;
        uint32_t n = level_nodes(b, l);
        double *x = gather_columns(b, l);
        if (fits) make_table(b, l, x);
        if (l < b->level) {
            size_t *first = allocate(n, sizeof *first);
            for (size_t j = 0; j < n; j++) first[j] = 3 * j;
            gf_source source = {
                .m = x, .width = 3 * (size_t)n, .first = first, .columns = n, .counted = n};
            b->coarse[l] = columns_build(&source, &b->d->domain[PALP_FREE], NULL, b->compress);
            b->content.coarse[l] = &b->coarse[l];
            free(first);
        }
        free(x);
    }
}

static void stiffness_range(const builder *b, double (*normal)[3], palp_meta *meta) {
    double low = HUGE_VAL, high = 0;
    const uint32_t *node = b->d->domain[PALP_FREE].node;
    for (size_t k = 0; k < level_nodes(b, b->level); k++) {
        double compliance = 0;
        for (size_t a = 0; a < 9; a++) {
            double g = greens_row(b->g, node[k], a / 3)[b->first[k] + a % 3];
            compliance += normal[node[k]][a / 3] * g * normal[node[k]][a % 3];
        }
        low = fmin(low, 1 / compliance);
        high = fmax(high, 1 / compliance);
    }
    meta->stiffness_min_N_per_m = (float)low;
    meta->stiffness_max_N_per_m = (float)high;
}

/* Longest row that contact on the constraint level may need. */
static uint32_t longest_row(const palp_blob *blob) {
    const palp_domain *d = &blob->domain[PALP_FREE];
    uint32_t level = blob->meta->constraint_level, longest = blob->meta->max_row;
    if (level + 1 == d->levels) return longest;
    palp_row_scratch scratch = {allocate(d->slots, sizeof(float)),
                                allocate((d->slots + 31) / 32, sizeof(uint32_t))};
    palp_row row = {.index = allocate(d->slots, sizeof(uint16_t)),
                    .weight = allocate(d->slots, sizeof(float))};
    for (uint32_t k = 0; k < blob->level[level].nodes; k++) {
        (void)palp_basis_row(blob, (palp_basis){level, k}, &scratch, &row, d->slots);
        if (row.count > longest) longest = row.count;
    }
    void *owned[] = {scratch.weight, scratch.mark, row.index, row.weight};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return longest;
}

/* What contact needs, from the columns of the constraint level. */
static regular_data build_regular(builder *b, double (*normal)[3], const palp_meta *meta) {
    const regular_body body = {.m = b->content.m,
                               .area = b->area,
                               .normal = normal,
                               .material = {(double)meta->young_Pa, (double)meta->poisson},
                               .h = &b->d->h,
                               .level = b->level,
                               .averaged = b->g->averaged};
    if (b->o->modes == 0 || b->o->raw || b->g->scalar) return (regular_data){.modes = 0};
    double *x = gather_columns(b, b->level);
    regular_data r = regular_build(&body, x, b->o->modes);
    free(x);
    return r;
}

static palp_blob reopen(builder *b, built *out) {
    palp_blob blob;
    free(out->bytes);
    out->bytes = blob_serialize(&b->content, &out->size);
    palp_status status = palp_blob_open(&blob, out->bytes, out->size);
    if (status != PALP_OK) {
        die(EXIT_WORK, "the finished blob does not open: %s (are the units metres and pascals?)",
            palp_status_text(status));
    }
    return blob;
}

/* Presses on nodes of all of the free surface; NULL when none was clear. */
static const float *measure_levels(const palp_blob *blob, uint32_t presses, built *out,
                                   float error[][2]) {
    const palp_domain *d = &blob->domain[PALP_FREE];
    uint32_t places = d->slots < presses ? d->slots : presses;
    uint32_t *place = allocate(places, sizeof *place);
    for (uint32_t i = 0; i < places; i++) place[i] = d->node[(size_t)i * d->slots / places];
    out->levels = press_levels(blob, place, places);
    free(place);
    for (uint32_t l = 0; l < PALP_LEVEL_ERRORS; l++) {
        error[l][0] = (float)out->levels.mean[l];
        error[l][1] = (float)out->levels.worst[l];
    }
    return out->levels.count > 0 ? error[0] : NULL;
}

/* Bytes of the free-free block, in blocks of floats. */
static uint64_t stored_blocks(const builder *b, const regular_data *regular) {
    const columns_data *c = &b->columns[PALP_FREE][PALP_FREE];
    if (!b->o->split) return c->blocks;
    const uint32_t slots = b->d->domain[PALP_FREE].view.slots;
    const uint64_t group = PALP_GROUP_VALUES * (c->half != NULL ? 2u : 4u) + PALP_LANES * 2u;
    const uint64_t bytes =
        6 * (uint64_t)slots * regular->modes + group * c->offset[slots] + 8 * (uint64_t)slots;
    return (bytes + 35) / 36;
}

/* Flags, counts and errors of what is stored. */
static void describe(const builder *b, const regular_data *regular, palp_meta *meta) {
    const build_options *o = b->o;
    const greens *g = b->g;
    const columns_data *main_block = &b->columns[PALP_FREE][PALP_FREE];
    const bool held = g->reactions && g->basis_count == 0 && !o->loads_only;
    meta->flags = (o->wavelet.lifted ? PALP_META_LIFTED : 0) | (o->raw ? 0 : PALP_META_SYMMETRIC) |
                  (g->gravity ? PALP_META_GRAVITY : 0) | (o->compress.half ? PALP_META_HALF : 0) |
                  (o->wavelet.kind == WAVELET_BUTTERFLY ? PALP_META_BUTTERFLY : 0) |
                  (g->scalar ? PALP_META_SCALAR : 0) | (g->reactions ? PALP_META_REACTIONS : 0) |
                  (held ? PALP_META_FIXED_COLUMNS : 0) | (o->split ? PALP_META_SPLIT : 0);
    meta->constraint_level = b->level;
    meta->free_blocks = stored_blocks(b, regular);
    meta->max_groups = main_block->max_groups;
    for (uint32_t l = 0; l < b->level; l++) {
        if (b->coarse[l].max_groups > meta->max_groups) meta->max_groups = b->coarse[l].max_groups;
    }
    meta->epsilon = (float)o->compress.epsilon;
    meta->rms_error = (float)main_block->rms;
    meta->max_error = (float)main_block->max;
}

built blob_build(const mesh *m, const greens *g, const domains *d, const double *area,
                 double (*normal)[3], palp_meta meta, const build_options *options) {
    builder b = {.g = g, .d = d, .area = area, .o = options, .level = options->constraint_level};
    b.compress = options->compress;
    b.compress.scalar = g->scalar;
    b.content = (blob_content){.m = m,
                               .fixed = g->fixed,
                               .area = area,
                               .normal = normal,
                               .h = &d->h,
                               .detail = options->detail,
                               .meta = meta};
    for (uint32_t k = 0; k < PALP_DOMAINS; k++) b.content.domain[k] = &d->domain[k];
    palp_meta *out_meta = &b.content.meta;
    out_meta->reciprocity_residual = (float)g->reciprocity_residual;
    out_meta->equilibrium_residual = (float)g->equilibrium_residual;
    list_columns(&b);
    stiffness_range(&b, normal, out_meta);
    built out = {.bytes = NULL};
    regular_data regular =
        options->regular != NULL ? *options->regular : build_regular(&b, normal, out_meta);
    b.content.regular = regular.modes > 0 ? &regular : NULL;
    out.left_over = regular.left_over;
    regular_data own = {.modes = 0};
    if (options->split) {
        if (options->regular != NULL) own = build_regular(&b, normal, out_meta);
        if (own.modes > 0) b.content.split = &own;
        const split_body body = {.m = m,
                                 .normal = normal,
                                 .material = {(double)meta.young_Pa, (double)meta.poisson},
                                 .g = g,
                                 .free = &d->domain[PALP_FREE].view,
                                 .regular = own.modes > 0 ? &own : &regular};
        const split_data split = split_blocks(&b, &body);
        out.worst_column = split.worst_column;
        out.worst_own = split.worst_own;
    } else {
        compress_blocks(&b);
        build_levels(&b);
    }
    describe(&b, own.modes > 0 ? &own : &regular, out_meta);
    palp_blob blob = reopen(&b, &out);
    b.content.max_row = longest_row(&blob);
    float level_error[PALP_LEVEL_ERRORS][2];
    if (blob.regular.modes > 0 && options->presses > 0)
        b.content.level_error = measure_levels(&blob, options->presses, &out, level_error);
    (void)reopen(&b, &out);
    if (options->regular == NULL) regular_free(&regular);
    regular_free(&own);
    for (uint32_t k = 0; k < PALP_DOMAINS * PALP_DOMAINS; k++)
        columns_free(&b.columns[k / PALP_DOMAINS][k % PALP_DOMAINS]);
    for (uint32_t l = 0; l < PALP_MAX_LEVELS; l++) {
        columns_free(&b.coarse[l]);
        free(b.table[l]);
    }
    free(b.first);
    free(b.fixed_first);
    out.meta = b.content.meta;
    return out;
}
