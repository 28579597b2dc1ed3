/* SPDX-License-Identifier: MIT */
#include "tools/bake/regularise.h"
#include "core/green/columns.h"
#include "tools/solver/dense.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FIRST_MU 1e-4
#define FLOOR 1e-3 /* least eigenvalue wanted, over the diagonal */
#define REFINEMENTS 4

typedef struct {
    const palp_blob *blob;
    size_t m;
    double *normal; /* [m][m] N before averaging: column j holds n_i . u_i under n_j */
} normal_columns;

/* Means under the hats of `level` from those of level + 1: w = R_l u. */
static void average_level(const palp_blob *b, uint32_t level, float *x) {
    const palp_domain *d = &b->domain[PALP_FREE];
    const float *fine = b->level[level + 1].area_m2, *coarse = b->level[level].area_m2;
    for (uint32_t k = 0; k < b->level[level].nodes; k++) {
        for (uint32_t a = 0; a < 3; a++) x[PALP_FIELD_LANES * k + a] *= fine[k] / coarse[k];
    }
    for (uint32_t m = b->level[level].nodes; m < b->level[level + 1].nodes; m++) {
        for (uint32_t side = 0; side < 2; side++) {
            float w = d->predict[2 * m + side];
            uint32_t p = d->parent[2 * m + side];
            if (!(w > 0)) continue;
            for (uint32_t a = 0; a < 3; a++)
                x[PALP_FIELD_LANES * p + a] +=
                    w * fine[m] / coarse[p] * x[PALP_FIELD_LANES * m + a];
        }
    }
}

static void fill_column(void *context, size_t j) {
    const normal_columns *c = context;
    const palp_domain *d = &c->blob->domain[PALP_FREE];
    uint32_t level = c->blob->meta->constraint_level;
    float *x = allocate(PALP_FIELD_LANES * (size_t)d->slots, sizeof *x);
    palp_columns_add(&c->blob->level[level].columns, (uint32_t)j, c->blob->normal + 3 * d->node[j],
                     x);
    palp_wavelet_inverse(d, x, d->levels - 1);
    for (uint32_t l = d->levels - 1; l > level; l--) average_level(c->blob, l - 1, x);
    for (size_t i = 0; i < c->m; i++) {
        const float *n = c->blob->normal + 3 * d->node[i];
        const float *u = x + PALP_FIELD_LANES * i;
        c->normal[i * c->m + j] =
            (double)n[0] * (double)u[0] + (double)n[1] * (double)u[1] + (double)n[2] * (double)u[2];
    }
    free(x);
}

/* Whether N + diag(mu a - floor N) has only positive pivots; `work` is m x m. */
static bool definite(const double *n, const double *amplitude, size_t m, double mu, double *work) {
    memcpy(work, n, m * m * sizeof *work);
    for (size_t i = 0; i < m; i++) {
        work[i * m + i] += mu * amplitude[i] - FLOOR * n[i * m + i];
    }
    return dense_cholesky(work, m, m) == m;
}

static double least_mu(const double *n, const double *amplitude, size_t m) {
    double *work = allocate_aligned(m * m, sizeof *work);
    double low = 0, high = FIRST_MU;
    bool sound = definite(n, amplitude, m, 0, work);
    while (!sound && high < 1e3 && !definite(n, amplitude, m, high, work)) {
        low = high;
        high *= 3;
    }
    for (int i = 0; !sound && i < REFINEMENTS; i++) {
        double middle = low > 0 ? sqrt(low * high) : high / 2;
        if (definite(n, amplitude, m, middle, work)) {
            high = middle;
        } else {
            low = middle;
        }
    }
    free(work);
    return sound ? 0 : high;
}

regularisation_report regularise(const palp_blob *blob, float *regularisation) {
    const palp_domain *d = &blob->domain[PALP_FREE];
    normal_columns c = {.blob = blob, .m = blob->level[blob->meta->constraint_level].nodes};
    c.normal = allocate_aligned(c.m * c.m, sizeof *c.normal);
    double *amplitude = allocate(c.m, sizeof *amplitude);
    progress_begin("contact definiteness", 0);
    parallel_for(c.m, fill_column, &c);
    for (size_t i = 0; i < c.m; i++) {
        for (size_t j = 0; j < i; j++) {
            double mean = 0.5 * (c.normal[i * c.m + j] + c.normal[j * c.m + i]);
            c.normal[i * c.m + j] = c.normal[j * c.m + i] = mean;
        }
    }
    for (size_t i = 0; i < c.m; i++) {
        for (size_t j = 0; j < c.m; j++) {
            if (fabs(c.normal[i * c.m + j]) > amplitude[i])
                amplitude[i] = fabs(c.normal[i * c.m + j]);
        }
    }
    regularisation_report r = {.mu = least_mu(c.normal, amplitude, c.m)};
    memset(regularisation, 0, blob->meta->nodes * sizeof *regularisation);
    for (size_t i = 0; i < c.m; i++) {
        regularisation[d->node[i]] = (float)(r.mu * amplitude[i]);
        r.largest = fmax(r.largest, r.mu * amplitude[i] / c.normal[i * c.m + i]);
    }
    progress_end();
    free(amplitude);
    free(c.normal);
    return r;
}
