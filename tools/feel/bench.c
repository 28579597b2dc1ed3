/* SPDX-License-Identifier: MIT */
#include "tools/feel/bench.h"
#include "tools/press/press.h"
#include "port/host/util.h"
#include <stdlib.h>

double bench_roll(bench *b) {
    b->seed = b->seed * 6364136223846793005ull + 1442695040888963407ull;
    return (double)(b->seed >> 33) / 2147483648.0;
}

uint32_t bench_roll_node(bench *b) {
    return b->free_node[(size_t)(bench_roll(b) * b->free_nodes) % b->free_nodes];
}

palp_vec3 bench_tangent(palp_vec3 wanted, palp_vec3 n) {
    palp_vec3 t = palp_madd(wanted, -palp_dot(wanted, n), n);
    return palp_scale(1.0f / palp_norm(t), t);
}

static int ascending(const void *a, const void *b) {
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

double bench_median(double *x, size_t count) {
    qsort(x, count, sizeof *x, ascending);
    return x[count / 2];
}

void bench_open(bench *b, uint32_t places, double edges) {
    const palp_blob *m = b->blob;
    uint32_t nodes = m->meta->nodes;
    b->free_node = allocate(nodes, sizeof *b->free_node);
    for (uint32_t i = 0; i < nodes; i++) {
        bool away = !palp_node_is_fixed(m, i);
        for (uint32_t k = 0; k < nodes && away; k++) {
            if (!palp_node_is_fixed(m, k)) continue;
            palp_vec3 d = palp_sub(at_node(m->rest_m, i), at_node(m->rest_m, k));
            away = (double)palp_norm(d) > edges * b->edge_m;
        }
        if (away) b->free_node[b->free_nodes++] = i;
    }
    if (b->free_nodes == 0)
        die(EXIT_WORK, "no node is farther than %g edges from the fixed ones", edges);
    b->places = places;
    b->place = allocate(places, sizeof *b->place);
    for (uint32_t i = 0; i < places; i++) b->place[i] = bench_roll_node(b);
}

void bench_close(bench *b) {
    free(b->free_node);
    free(b->place);
    free(b->table.row);
}
