/* SPDX-License-Identifier: MIT */
/* Time of a tick of a dynamic body with about 5,000 active tetrahedra, per element evaluation,
 * beside the time that reading the elements takes. */
#include "tests/models.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TICKS 400
#define CLAIMED 1 /* of the materials: must be in time */
#define COPIES 64 /* of the elements, so that reading them does not find them in a cache */

static double read_all(const palp_tets *t, double *sum) {
    size_t bytes = (size_t)t->meta->tets * sizeof *t->tet, words = bytes / sizeof(uint64_t);
    uint64_t *copy = allocate_aligned(COPIES * words, sizeof *copy), x = 0;
    for (size_t k = 0; k < COPIES; k++) memcpy(copy + k * words, t->tet, bytes);
    double start = now_s();
    for (size_t i = 0; i < COPIES * words; i++) x += copy[i];
    double seconds = now_s() - start;
    *sum += (double)(x & 1);
    free(copy);
    return seconds / COPIES / t->meta->tets * 1e9;
}

static int ascending(const void *a, const void *b) {
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* The median. */
static double tick_us(palp_dyna *d) {
    static double us[TICKS];
    for (int k = 0; k < TICKS; k++) {
        double start = now_s();
        palp_dyna_tick(d, PALP_STEP_CLASSES - 1);
        us[k] = (now_s() - start) * 1e6;
    }
    qsort(us, TICKS, sizeof *us, ascending);
    return us[TICKS / 2];
}

int main(int argc, char **argv) {
    static const double size[3] = {0.1, 0.06, 0.06};
    static const uint32_t n[3] = {14, 8, 8};
    tetmesh level = tetmesh_block(size, n, true);
    dynamic_body b = model_dynamic_body(&level, 1, 1e-9, 2e3, 0.4, 0);
    double unused = 0, stream = read_all(&b.tets, &unused);
    printf("%" PRIu32 " tetrahedra, %" PRIu32
           " nodes; reading the elements (64 bytes each) %.2f ns "
           "each\n",
           b.tets.meta->tets, b.tets.meta->nodes, stream);
    static const double young[] = {500, 2e3, 5e3, 2e4};
    bool fits = false;
    for (size_t k = 0; k < sizeof young / sizeof young[0]; k++) {
        palp_dyna *d = model_dyna(&b.tets, palp_material_of((float)young[k], 0.4f, 1000, 2e-4f, 0),
                                  1e-3f, (palp_vec3){0, 0, -1});
        double us = tick_us(d);
        uint32_t work = palp_dyna_work(d, PALP_STEP_CLASSES - 1);
        printf("Young's modulus %g Pa: %" PRIu32 " steps a tick, %" PRIu32
               " evaluations, %.0f us, %.1f "
               "ns per evaluation with everything\n",
               young[k], palp_dyna_steps(d, PALP_STEP_CLASSES - 1), work, us, us * 1e3 / work);
        if (k == CLAIMED) fits = us < 1000;
    }
    (void)argc;
    (void)argv;
    return fits && unused < 2 ? 0 : 1;
}
