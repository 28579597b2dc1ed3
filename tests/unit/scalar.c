/* SPDX-License-Identifier: MIT */
/* A scalar problem end to end: electrostatics on a sphere, through a .npy file, against closed form
 * and elimination in double. */
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/solver/dense.h"
#include "tools/solver/electrostatics.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The charge of a conducting sphere of radius 1 at unit potential is 1 (in units of 4 pi eps0): the
 * matrix is what it should be, before anything is grounded. */
static void test_sphere(const mesh *m, const double *area) {
    uint8_t *fixed = allocate(m->vertices, 1);
    size_t n = m->vertices - 1;
    fixed[0] = 1; /* one node at zero among many: its charge is induced by the others */
    double *g = electrostatic_greens(m, fixed, area), *q = allocate(n, sizeof *q);
    uint32_t *perm = allocate(n, sizeof *perm);
    /* All at potential 1 but node 0 at 0 is all at 1 less node 0 alone at 1; by symmetry of the
     * sphere the first has the same charge everywhere. */
    for (size_t i = 0; i < n; i++) q[i] = 1;
    (void)dense_lu(g, n, n, perm);
    dense_lu_solve(g, n, n, perm, q, 1, 1);
    double total = 0;
    for (size_t i = 0; i < n; i++) total += q[i];
    AT_MOST(fabs(total - 1), 0.12, "a sphere of %zu nodes at unit potential carries unit charge",
            n + 1);
    free(g);
    free(q);
    free(perm);
    free(fixed);
}

int main(void) {
    progress_quiet(1);
    mesh m = model_sphere(3);
    uint32_t n = m.vertices, count = 0;
    double *area = allocate(n, sizeof *area), (*normal)[3] = allocate(n, sizeof *normal);
    uint8_t *fixed = allocate(n, 1);
    mesh_nodal(&m, area, normal);
    test_sphere(&m, area);
    for (uint32_t i = 0; i < n; i++) {
        fixed[i] = m.x[i][2] < -0.6;
        count += fixed[i] == 0;
    }
    double *exact = electrostatic_greens(&m, fixed, area);
    char path[] = "/tmp/palp-scalar-XXXXXX";
    int fd = mkstemp(path);
    if (fd < 0) die(EXIT_WORK, "no temporary file");
    close(fd);
    FILE *matrix = fopen(path, "wb");
    if (matrix == NULL) die(EXIT_WORK, "cannot write %s", path);
    npy_write(matrix, exact, count);
    fclose(matrix);
    greens g = greens_from_npy(path, &m, fixed);
    unlink(path);
    CHECK(g.scalar, "a matrix of as many rows as free nodes is a scalar problem");
    greens_reciprocity(&g, &m, true);
    const wavelet w = {WAVELET_LINEAR, true};
    domains d = domains_build(&m, fixed, area, w);
    palp_blob blob;
    size_t sizes[2];
    double errors[2];
    for (int k = 0; k < 2; k++) {
        build_options o = {.wavelet = w,
                           .compress = {.epsilon = k == 0 ? 0 : 0.05},
                           .constraint_level = 3,
                           .table_bytes = 8e6};
        built b = blob_build(&m, &g, &d, area, normal, (palp_meta){.young_Pa = 1}, &o);
        if (palp_blob_open(&blob, b.bytes, b.size) != PALP_OK) die(EXIT_WORK, "blob");
        palp_cma cma;
        size_t bytes = palp_cma_memsize(&blob, count);
        float *v = allocate(3 * n, sizeof *v), *q = allocate(3 * n, sizeof *q);
        (void)palp_cma_init(&cma, &blob, count, allocate_aligned(bytes, 1), bytes);
        double *a = allocate((size_t)count * count, sizeof *a), *x = allocate(count, sizeof *x);
        uint32_t electrodes = 0, *slot = allocate(count, sizeof *slot), row = 0;
        for (uint32_t i = 0; i < n; i++) {
            if (fixed[i] != 0) continue;
            if (m.x[i][2] > 0.6) {
                (void)palp_cma_prescribe(&cma, i, PALP_PRESCRIBE_DISPLACEMENT,
                                         (palp_vec3){1, 0, 0});
                slot[electrodes++] = row;
            }
            row++;
        }
        CHECK(palp_cma_solve(&cma, v, q) == PALP_OK, "an electrode of %u nodes at unit potential",
              electrodes);
        CHECK(cma.solved == electrodes, "one unknown per node");
        for (uint32_t i = 0; i < electrodes; i++) {
            x[i] = 1;
            for (uint32_t j = 0; j < electrodes; j++)
                a[i * electrodes + j] = exact[(size_t)slot[i] * count + slot[j]];
        }
        uint32_t *perm = allocate(electrodes, sizeof *perm);
        (void)dense_lu(a, electrodes, electrodes, perm);
        dense_lu_solve(a, electrodes, electrodes, perm, x, 1, 1);
        double total = 0, got = 0;
        for (uint32_t i = 0; i < electrodes; i++) total += x[i];
        for (uint32_t i = 0; i < n; i++) got += (double)q[3 * i];
        errors[k] = fabs(got / total - 1);
        sizes[k] = b.size;
    }
    AT_MOST(errors[0], 1e-5, "its charge against elimination, nothing dropped");
    AT_MOST(errors[1], 0.02, "and at epsilon 0.05, %zu bytes for %zu", sizes[1], sizes[0]);
    palp_contact c;
    palp_tool tool = palp_tool_sphere(0.1f);
    const palp_contact_config config = {.blob = &blob, .tools = &tool, .tool_count = 1};
    size_t room = palp_contact_memsize(&config);
    CHECK(palp_contact_init(&c, &config, allocate_aligned(room, 1), room) == PALP_ERR_ABSENT,
          "nothing to touch: contact refuses a scalar blob");
    return tap_done();
}
