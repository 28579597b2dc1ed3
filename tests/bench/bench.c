/* SPDX-License-Identifier: MIT */
/*
 * Fast summation and full-field ticks against dense summation and against streaming the same bytes,
 * in one run.
 *
 *     bench MESH.obj FIX_Z OUT.json     (make bench)
 */
#include "tests/models.h"
#include "tools/parallel.h"
#include "tools/util.h"
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

/* What one contact tick costs while the tool slides, per number of nodes in contact. */
static void measure_contact(const palp_blob *b) {
    palp_fresh fresh[PALP_MAX_CANDIDATES];
    size_t bytes = palp_contact_memsize(b, PALP_CONTACT_DEFAULTS);
    palp_contact c;
    float edge = b->meta->mean_edge_m;
    printf("\ncontact ticks while pressing (median)\n");
    for (float radius = 2; radius <= 8; radius *= 2) {
        double t[400];
        uint32_t active = 0, top = b->domain[PALP_FREE].node[0];
        for (uint32_t i = 0; i < b->meta->nodes; i++) {
            if (b->rest_m[3 * i + 1] < b->rest_m[3 * top + 1] && !palp_node_is_fixed(b, i)) top = i;
        }
        palp_tool tool = palp_tool_sphere(radius * edge);
        (void)palp_contact_init(&c, b, b->rest_m, &tool, 1, PALP_CONTACT_DEFAULTS,
                                allocate_aligned(bytes, 1), bytes);
        palp_vec3 n = palp_vec3_at(b->normal + 3 * top), x = palp_vec3_at(b->rest_m + 3 * top);
        for (int i = 0; i < 400; i++) {
            palp_vec3 p = palp_madd(x, edge * (radius + 1 - 0.006f * (float)i), n);
            double start = now_s();
            uint32_t count = palp_contact_search(&c, &p, fresh);
            for (uint32_t k = 0; k < count; k++) palp_contact_admit(&c, fresh[k]);
            (void)palp_contact_solve(&c, p, (palp_grip){.held_m = p});
            t[i] = (now_s() - start) * 1e6;
            active = c.active_count;
        }
        char name[96];
        snprintf(name, sizeof name, "contact tick, tool of %g edges, %u nodes at the end",
                 (double)radius, active);
        double typical = median(t, 400);
        row(name, typical, "us", "period at 1 kHz (share)", typical / 1000);
    }
}

int main(int argc, char **argv) {
    if (argc != 4) die(EXIT_USAGE, "usage: bench MESH.obj FIX_Z OUT.json");
    output out = open_output(argv[3]);
    json = out.file;
    progress_quiet(1);
    static const double epsilons[] = {0.01, 0.05, 0.2};
    for (int e = 0; e < 3; e++) {
        mesh m = mesh_load(argv[1]);
        baked b = model_bake(m, atof(argv[2]), epsilons[e], false, false);
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
        if (e == 1) measure_contact(&b.blob);
        free(dense);
        free(b.g.m);
        free(b.bytes);
    }
    fputs("]\n", json);
    commit_output(&out);
    return EXIT_SUCCESS;
}
