/* SPDX-License-Identifier: MIT */
/*
 * Fast summation and full-field ticks against dense summation and against streaming the same bytes,
 * in one run.
 *
 *     bench MESH.obj FIX_Z OUT.json     (make bench)
 */
#include "core/base/crc32c.h"
#include "core/base/linalg.h"
#include "tests/models.h"
#include "tools/press/press.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <dlfcn.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define COLUMNS 32
#define ROUNDS 25

static FILE *json;
static bool first_row = true;
static volatile float sink;

static int compare(const void *a, const void *b) {
    double p = *(const double *)a, q = *(const double *)b;
    return p < q ? -1 : p > q;
}

static double median(double *x, int n) {
    qsort(x, (size_t)n, sizeof *x, compare);
    return x[n / 2];
}

static void row(const char *name, double value, const char *unit, const char *baseline,
                double ratio) {
    fprintf(json,
            "%s{\"name\": \"%s\", \"value\": %.6g, \"unit\": \"%s\", \"baseline\": \"%s\", "
            "\"ratio\": %.6g}",
            first_row ? "[" : ",\n ", name, value, unit, baseline, ratio);
    first_row = false;
    printf("%-58s %10.3f %-3s  %8.2f x %s\n", name, value, unit, ratio, baseline);
}

/* Sum of a buffer by eight independent lanes: the time to stream its bytes and nothing else. */
static void stream(const void *data, size_t bytes) {
    const float *x = data;
    float sum[32] = {0};
    for (size_t i = 0; i + 32 <= bytes / 4; i += 32) {
        for (int k = 0; k < 32; k++) sum[k] += x[i + (size_t)k];
    }
    for (int k = 1; k < 32; k++) sum[0] += sum[k];
    sink = sum[0];
}

/* y (3 m) += columns of the dense float matrix stored column-major: three columns per node, each a
 * contiguous run. */
static void dense_sum(const float *g, size_t m, const uint32_t *slot, const float (*f)[3],
                      float *y) {
    for (int j = 0; j < COLUMNS; j++) {
        const float *c = g + (size_t)slot[j] * 9 * m;
        for (size_t i = 0; i < 3 * m; i++)
            y[i] += c[i] * f[j][0] + c[3 * m + i] * f[j][1] + c[6 * m + i] * f[j][2];
    }
}

typedef struct {
    const palp_blob *blob;
    const float *dense;
    size_t m;
    uint32_t slot[COLUMNS];
    float force[COLUMNS][3];
    float *detail, *y;
} setting;

static double time_of(void (*work)(const setting *), const setting *s) {
    double t = now_s();
    work(s);
    return (now_s() - t) * 1e6;
}

static void run_dense(const setting *s) {
    memset(s->y, 0, 3 * s->m * sizeof *s->y);
    dense_sum(s->dense, s->m, s->slot, s->force, s->y);
    sink = s->y[7];
}
static void run_dense_stream(const setting *s) {
    for (int j = 0; j < COLUMNS; j++) stream(s->dense + (size_t)s->slot[j] * 9 * s->m, 36 * s->m);
}
static void run_sparse(const setting *s) {
    const palp_columns *c = &s->blob->columns[PALP_FREE][PALP_FREE];
    memset(s->detail, 0, 4 * s->m * sizeof *s->detail);
    for (int j = 0; j < COLUMNS; j++) palp_columns_add(c, s->slot[j], s->force[j], s->detail);
    sink = s->detail[8];
}
static void run_sparse_stream(const setting *s) {
    const palp_columns *c = &s->blob->columns[PALP_FREE][PALP_FREE];
    for (int j = 0; j < COLUMNS; j++) {
        size_t first = c->offset[s->slot[j]], groups = c->offset[s->slot[j] + 1] - first;
        stream(c->value + first * PALP_GROUP_VALUES, groups * PALP_GROUP_VALUES * 4);
    }
}
static void run_field(const setting *s) {
    run_sparse(s);
    palp_wavelet_inverse(&s->blob->domain[PALP_FREE], s->detail, s->blob->meta->levels - 1);
    sink = s->detail[8];
}

/* Interleaves the five, so that the machine's drift meets all alike. */
static void measure(const setting *s, double epsilon, double compression, double rms) {
    static double t[5][ROUNDS];
    void (*const work[5])(const setting *) = {run_dense, run_dense_stream, run_sparse,
                                              run_sparse_stream, run_field};
    for (int r = 0; r < ROUNDS; r++) {
        for (int k = 0; k < 5; k++) t[k][r] = time_of(work[k], s);
    }
    double m[5];
    for (int k = 0; k < 5; k++) m[k] = median(t[k], ROUNDS);
    char name[96];
    printf("\nepsilon %g: compression %.2f, RMS %.4f, %d columns on %zu nodes\n", epsilon,
           compression, rms, COLUMNS, s->m);
    row("dense summation", m[0], "us", "stream of the same bytes (time ratio)", m[0] / m[1]);
    snprintf(name, sizeof name, "fast summation, epsilon %g", epsilon);
    row(name, m[2], "us", "dense summation (speed-up)", m[0] / m[2]);
    row(name, m[2], "us", "stream of the same bytes (time ratio)", m[2] / m[3]);
    row(name, m[2], "us", "compression (speed-up reached)", m[0] / m[2] / compression);
    snprintf(name, sizeof name, "full field tick, epsilon %g (sum and inverse transform)", epsilon);
    row(name, m[4], "us", "dense summation (speed-up)", m[0] / m[4]);
}

/* ---- OpenBLAS, if it is there ---- */

typedef void (*spotrf_call)(const char *, const int *, float *, const int *, int *);
typedef void (*sgemv_call)(const char *, const int *, const int *, const float *, const float *,
                           const int *, const float *, const int *, const float *, float *,
                           const int *);

static void *blas;

static void *blas_symbol(const char *name) { return blas != NULL ? dlsym(blas, name) : NULL; }

static void open_blas(void) {
    static const char *const names[] = {"libopenblas.so.0", "libopenblas.so", NULL};
    for (int i = 0; names[i] != NULL && blas == NULL; i++) blas = dlopen(names[i], RTLD_NOW);
    void (*threads)(int) = NULL;
    *(void **)(void *)&threads = blas_symbol("openblas_set_num_threads");
    if (threads != NULL) threads(1);
    if (blas == NULL) printf("no OpenBLAS (libopenblas0-pthread): rows against it are left out\n");
}

static void measure_cholesky(void) {
    static const int sizes[] = {3, 6, 12, 24, 48, 96, 144, 192};
    spotrf_call spotrf = NULL;
    *(void **)(void *)&spotrf = blas_symbol("spotrf_");
    float *a = allocate_aligned(192 * 192, sizeof *a), *b = allocate_aligned(192 * 192, sizeof *b);
    printf("\nCholesky factorisation of n x n\n");
    for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
        int n = sizes[k], info = 0;
        double ours = HUGE_VAL, theirs = HUGE_VAL;
        for (int i = 0; i < n * n; i++)
            a[i] = expf(-0.1f * (float)abs(i / n - i % n)) + (i / n == i % n ? 1.0f : 0.0f);
        for (int r = 0; r < 300; r++) {
            memcpy(b, a, (size_t)(n * n) * sizeof *b);
            double t = now_s();
            (void)palp_chol_factor(b, (size_t)n, (size_t)n);
            ours = fmin(ours, now_s() - t);
            if (spotrf == NULL) continue;
            memcpy(b, a, (size_t)(n * n) * sizeof *b);
            t = now_s();
            spotrf("L", &n, b, &n, &info);
            theirs = fmin(theirs, now_s() - t);
        }
        char name[64];
        snprintf(name, sizeof name, "Cholesky, n = %d", n);
        if (spotrf != NULL)
            row(name, ours * 1e6, "us", "OpenBLAS spotrf (time ratio)", ours / theirs);
    }
    free(a);
    free(b);
}

/* The check of a blob's bytes when it is opened. */
static void measure_crc(const palp_blob *b, const void *bytes) {
    double ours = HUGE_VAL, least = HUGE_VAL;
    for (int r = 0; r < 30; r++) {
        double t = now_s();
        sink = (float)palp_crc32c(0, bytes, b->bytes);
        ours = fmin(ours, now_s() - t);
        t = now_s();
        stream(bytes, b->bytes);
        least = fmin(least, now_s() - t);
    }
    printf("\nCRC of %zu bytes\n", b->bytes);
    row("CRC when a blob is opened", (double)b->bytes / ours * 1e-9, "GB/s",
        "stream of the same bytes (time ratio)", ours / least);
}

/* The whole field from `s` loaded nodes side by side: one inverse transform and s columns against
 * the dense product. */
static void measure_field(const palp_blob *b, const float *dense, double compression) {
    static const int loaded[] = {1, 4, 16, 40, 150, 400, 2000};
    const palp_columns *c = &b->columns[PALP_FREE][PALP_FREE];
    const palp_domain *d = &b->domain[PALP_FREE];
    sgemv_call sgemv = NULL;
    *(void **)(void *)&sgemv = blas_symbol("sgemv_");
    if (sgemv == NULL) return;
    size_t m = d->slots;
    float *force = allocate(3 * m, sizeof *force), *y = allocate_aligned(3 * m, sizeof *y);
    float *x = allocate_aligned(4 * m, sizeof *x);
    for (size_t i = 0; i < 3 * m; i++) force[i] = 0.1f + 0.01f * (float)(i % 7);
    printf("\nfull field from s loaded nodes, compression %.1f\n", compression);
    for (size_t k = 0; k < sizeof loaded / sizeof loaded[0]; k++) {
        int s = loaded[k], rows = (int)(3 * m), columns = 3 * s, one = 1;
        const float alpha = 1, beta = 0;
        double theirs = HUGE_VAL, ours = HUGE_VAL;
        for (uint32_t r = 0; r < (s > 300 ? 12u : 60u); r++) {
            uint32_t first = r * 97u % (uint32_t)(m - (size_t)s);
            double t = now_s();
            sgemv("N", &rows, &columns, &alpha, dense + (size_t)first * 9 * m, &rows, force, &one,
                  &beta, y, &one);
            theirs = fmin(theirs, now_s() - t);
            t = now_s();
            memset(x, 0, 4 * m * sizeof *x);
            for (uint32_t j = 0; j < (uint32_t)s; j++)
                palp_columns_add(c, first + j, force + 3 * j, x);
            palp_wavelet_inverse(d, x, d->levels - 1);
            ours = fmin(ours, now_s() - t);
            sink = y[0] + x[0];
        }
        char name[64];
        snprintf(name, sizeof name, "full field, s = %d", s);
        row(name, ours * 1e6, "us", "OpenBLAS sgemv (speed-up)", theirs / ours);
        row(name, ours * 1e6, "us", "compression (share of it reached)",
            theirs / ours / compression);
    }
    free(force);
    free(x);
    free(y);
}

/* The deformed surface under s loads side by side, from scratch, in split form: against the columns of
 * wavelets, and against streaming what it reads. */
static void measure_split(const palp_blob *wavelets, const palp_blob *split) {
    static const uint32_t loaded[] = {1, 16, 40, 100, 400};
    const palp_domain *d = &split->domain[PALP_FREE];
    const uint32_t modes = split->split.count;
    const size_t m = d->slots;
    float *x = allocate_aligned(4 * m, sizeof *x);
    const float f[3] = {0.1f, 0.2f, -1.0f};
    printf(
        "\nthe surface under s loads: split form of %zu bytes, columns of wavelets in one of %zu\n",
        split->bytes, wavelets->bytes);
    for (size_t k = 0; k < sizeof loaded / sizeof loaded[0]; k++) {
        const uint32_t s = loaded[k];
        double ours = HUGE_VAL, theirs = HUGE_VAL, least = HUGE_VAL;
        for (uint32_t r = 0; r < 30; r++) {
            const uint32_t first = r * 97u % (uint32_t)(m - (size_t)s);
            float load[PALP_MAX_MODES] = {0};
            double t = now_s();
            memset(x, 0, 4 * m * sizeof *x);
            for (uint32_t j = 0; j < s; j++) palp_split_add(split, first + j, f, load, x);
            palp_split_add_modes(split, load, (uint32_t)m, x);
            ours = fmin(ours, now_s() - t);
            t = now_s();
            memset(x, 0, 4 * m * sizeof *x);
            for (uint32_t j = 0; j < s; j++)
                palp_columns_add(&wavelets->columns[PALP_FREE][PALP_FREE], first + j, f, x);
            palp_wavelet_inverse(d, x, d->levels - 1);
            theirs = fmin(theirs, now_s() - t);
            t = now_s();
            stream(split->split.vector, 6 * (size_t)split->meta->nodes * modes);
            least = fmin(least, now_s() - t);
            sink = x[0];
        }
        char name[64];
        snprintf(name, sizeof name, "surface in split form, s = %u", s);
        row(name, ours * 1e6, "us", "columns of wavelets (time ratio)", ours / theirs);
        row(name, ours * 1e6, "us", "stream of its modes (time ratio)", ours / least);
    }
    free(x);
}

/* ---- ticks by contact size and level ---- */

typedef struct {
    uint32_t slot;
    float distance;
} near_slot;

static int nearer(const void *a, const void *b) {
    float p = ((const near_slot *)a)->distance, q = ((const near_slot *)b)->distance;
    return (p > q) - (p < q);
}

/*
 * A patch of s nodes on one level: from scratch (entries, factor, solve), and with the factor at
 * hand (solve). A level below has about a quarter of the unknowns.
 */
static void measure_patch(const palp_blob *b, const near_slot *list, uint32_t s, uint32_t level) {
    uint32_t slot[400], n = 0;
    bool table = b->level[level].table != NULL;
    for (uint32_t i = 0; i < s; i++) {
        if (list[i].slot < b->level[level].nodes) slot[n++] = list[i].slot;
    }
    if (n == 0) return;
    const palp_domain *d = &b->domain[PALP_FREE];
    palp_row_scratch scratch = {allocate(d->slots, sizeof(float)),
                                allocate((d->slots + 31) / 32, sizeof(uint32_t))};
    palp_row *rows = allocate(n, sizeof *rows);
    for (uint32_t i = 0; i < n; i++) {
        rows[i] = (palp_row){.index = allocate(b->meta->max_row, sizeof(uint16_t)),
                             .weight = allocate(b->meta->max_row, sizeof(float))};
    }
    float *c = allocate_aligned((size_t)n * n, sizeof *c), *f = allocate(n, sizeof *f), block[9];
    double entries = HUGE_VAL, factor = HUGE_VAL, solve = HUGE_VAL;
    for (int r = 0; r < (n > 100 ? 3 : 9); r++) {
        double t = now_s();
        for (uint32_t i = 0; i < n; i++) {
            if (!table) (void)palp_wavelet_row(d, slot[i], &scratch, &rows[i], b->meta->max_row);
            palp_vec3 ni = palp_vec3_at(b->normal + 3 * d->node[slot[i]]);
            for (uint32_t j = 0; j < n; j++) {
                if (table) palp_table_block(b, level, slot[i], slot[j], block);
                if (!table)
                    palp_columns_extract(&b->level[level].columns, slot[j], &rows[i], block);
                palp_vec3 nj = palp_vec3_at(b->normal + 3 * d->node[slot[j]]);
                palp_vec3 u = {palp_dot(palp_vec3_at(block), nj),
                               palp_dot(palp_vec3_at(block + 3), nj),
                               palp_dot(palp_vec3_at(block + 6), nj)};
                c[(size_t)i * n + j] = palp_dot(ni, u);
            }
        }
        for (uint32_t i = 0; i < n && !table; i++) { /* as contact does */
            for (uint32_t j = 0; j < i; j++) {
                float mean = 0.5f * (c[(size_t)i * n + j] + c[(size_t)j * n + i]);
                c[(size_t)i * n + j] = c[(size_t)j * n + i] = mean;
            }
        }
        entries = fmin(entries, now_s() - t);
        t = now_s();
        if (palp_chol_factor(c, n, n) != PALP_OK) printf("  (not positive definite)\n");
        factor = fmin(factor, now_s() - t);
        for (uint32_t i = 0; i < n; i++) f[i] = 1;
        t = now_s();
        palp_chol_solve(c, n, n, f);
        solve = fmin(solve, now_s() - t);
    }
    char name[96];
    snprintf(name, sizeof name, "s = %u on level %u (%u unknowns): from scratch", s, level, n);
    row(name, (entries + factor + solve) * 1e6, "us", "with the factor at hand (time ratio)",
        (entries + factor + solve) / solve);
    printf("      entries %.2f us (%s), factor %.2f us, solve %.2f us\n", entries * 1e6,
           table ? "table" : "extracted", factor * 1e6, solve * 1e6);
    for (uint32_t i = 0; i < n; i++) {
        free(rows[i].index);
        free(rows[i].weight);
    }
    void *owned[] = {rows, scratch.weight, scratch.mark, c, f};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}

static void measure_patches(const palp_blob *b) {
    static const uint32_t sizes[] = {1, 4, 16, 40, 150, 400};
    const palp_domain *d = &b->domain[PALP_FREE];
    near_slot *list = allocate(d->slots, sizeof *list);
    uint32_t center = d->level_start[1] / 2; /* on level 0, so on all */
    for (uint32_t i = 0; i < d->slots; i++) {
        palp_vec3 off = palp_sub(palp_vec3_at(b->rest_m + 3 * d->node[i]),
                                 palp_vec3_at(b->rest_m + 3 * d->node[center]));
        list[i] = (near_slot){i, palp_dot(off, off)};
    }
    qsort(list, d->slots, sizeof *list, nearer);
    printf("\ncapacitance systems of s contact nodes, by constraint level (normal unknowns)\n");
    for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
        for (uint32_t l = b->meta->constraint_level + 1; l-- > 0;)
            measure_patch(b, list, sizes[k], l);
    }
    free(list);
}

/* What one contact tick costs on each level while a ball of three edges slides, a tenth of its
 * radius deep. */
static void measure_contact(const palp_blob *b) {
    const float radius = 3 * b->meta->mean_edge_m;
    const palp_tool tool = palp_tool_sphere(radius);
    printf("\ncontact ticks while sliding (median)\n");
    for (uint32_t l = PALP_CONTACT_LEVELS; l-- > 0;) {
        double t[400];
        palp_contact *c = contact_open(b, &tool, 1, l);
        const palp_domain *d = &b->domain[PALP_FREE];
        palp_surface_point p = press_start(c, d->node[d->level_start[1] / 2]);
        palp_vec3 side = palp_cross(p.n, (palp_vec3){0.3f, 0.5f, 0.8f});
        for (int i = -20; i < 400; i++) {
            palp_vec3 at = palp_madd(p.y, 0.9f * radius, p.n);
            at = palp_madd(at, 1e-3f * radius * (float)(i < 0 ? 0 : i), side);
            double start = now_s();
            press_hold(c, at, 1);
            if (i >= 0) t[i] = (now_s() - start) * 1e6;
        }
        char name[96];
        snprintf(name, sizeof name, "contact tick, level %u, %u points, %u in contact at the end",
                 l, c->count, c->active_count);
        double typical = median(t, 400);
        row(name, typical, "us", "period at 1 kHz (share)", typical / 1000);
        contact_close(c);
    }
}

int main(int argc, char **argv) {
    if (argc != 4) die(EXIT_USAGE, "usage: bench MESH.obj FIX_Z OUT.json");
    output out = open_output(argv[3]);
    json = out.file;
    progress_quiet(1);
    open_blas();
    measure_cholesky();
    static const double epsilons[] = {0.01, 0.05, 0.2};
    for (int e = 0; e < 3; e++) {
        mesh m = mesh_load(argv[1]);
        baked b = model_bake_tables(m, atof(argv[2]), epsilons[e], false, false, 8e6);
        const palp_domain *d = &b.blob.domain[PALP_FREE];
        setting s = {.blob = &b.blob, .m = d->slots};
        float *dense = allocate_aligned(9 * s.m * s.m, sizeof *dense);
        for (size_t j = 0; j < s.m; j++) {
            for (size_t k = 0; k < 3; k++) {
                for (size_t i = 0; i < 3 * s.m; i++) {
                    dense[(3 * j + k) * 3 * s.m + i] =
                        (float)greens_row(&b.g, d->node[i / 3], i % 3)[3 * d->node[j] + k];
                }
            }
        }
        s.dense = dense;
        s.detail = allocate_aligned(4 * s.m, sizeof *s.detail);
        s.y = allocate_aligned(3 * s.m, sizeof *s.y);
        for (uint32_t j = 0; j < COLUMNS; j++) {
            s.slot[j] = (uint32_t)((j * 67u) % s.m);
            for (int k = 0; k < 3; k++) s.force[j][k] = (float)(1 + (j + (uint32_t)k) % 5) * 0.1f;
        }
        double compression = (double)s.m * (double)s.m / (double)b.blob.meta->free_blocks;
        measure(&s, epsilons[e], compression, (double)b.blob.meta->rms_error);
        if (e == 1) {
            measure_contact(&b.blob);
            measure_patches(&b.blob);
            measure_field(&b.blob, dense, compression);
            baked split = model_bake_split(mesh_load(argv[1]), atof(argv[2]), epsilons[e], true);
            measure_split(&b.blob, &split.blob);
            measure_crc(&split.blob, split.bytes);
            free(split.g.m);
            free(split.bytes);
        }
        free(dense);
        free(b.g.m);
        free(b.bytes);
    }
    fputs("]\n", json);
    commit_output(&out);
    return EXIT_SUCCESS;
}
