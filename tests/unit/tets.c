/* SPDX-License-Identifier: MIT */
/* Tetrahedral meshes, how resolutions hang together, and files that lie. */
#include "core/servo/dynamic.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/tet/tethierarchy.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

#define HOSTILE 60 /* tries in each section */

static void check_stuffing(void) {
    mesh m = model_sphere(4);
    bvh *on = bvh_build(&m);
    double low = 180, high = 0, volume[2] = {0, 0}, off[2] = {0, 0};
    uint32_t meshes = 0;
    for (int k = 0; k < 24; k++) {
        const double phase[3] = {0.11 * k, 0.07 * k, 0.17 * k};
        double dropped, pitch = 0.9 * pow(0.93, k);
        tetmesh t = stuff(&m, on, pitch, phase, &dropped);
        tet_quality q = tetmesh_quality(&t, &m, on);
        low = fmin(low, q.low_deg);
        high = fmax(high, q.high_deg);
        if (k == 0 || k == 23) volume[k > 0] = fabs(q.volume_error), off[k > 0] = q.largest_m;
        meshes += t.tets > 0;
        tetmesh_free(&t);
    }
    bvh_free(on);
    mesh_free(&m);
    CHECK(meshes == 24 && low > 10.7 && high < 164.8,
          "24 lattices in a ball: dihedral angles from %.1f to %.1f degrees", low, high);
    AT_MOST(volume[1] / volume[0], 0.15, "volume error at a fifth of the pitch, over the coarsest");
    AT_MOST(off[1] / off[0], 0.15, "distance to the surface");
}

static void check_box(void) {
    mesh m = model_box(0.1, 4);
    bvh *on = bvh_build(&m);
    const double phase[3] = {0, 0, 0};
    double dropped, volume = 0;
    tetmesh t = stuff(&m, on, 0.05, phase, &dropped);
    for (uint32_t i = 0; i < t.tets; i++) volume += tet_volume(&t, i);
    CHECK(t.nodes == 59, "a cube on the lattice, two cells along an edge: %u nodes", t.nodes);
    AT_MOST(fabs(volume / 1e-3 - 1), 1e-9, "and all of its volume");
    tetmesh_free(&t);
    bvh_free(on);
    mesh_free(&m);
}

/* Every weight reproduces places of rest, unless it was drawn in. */
static void check_hierarchy(const dynamic_body *b) {
    const palp_tets *t = &b->tets;
    const palp_tets_meta *m = t->meta;
    double worst = 0, mean = 0;
    uint32_t drawn = 0;
    for (uint32_t i = m->first_node[1]; i < m->nodes; i++) {
        double x[3] = {0}, sum = 0;
        for (int c = 0; c < 4; c++) {
            double w = (double)t->container_weight[4 * i + (uint32_t)c];
            uint32_t n = t->tet[t->container[i]].node[c];
            sum += fabs(w);
            for (uint32_t k = 0; k < 3; k++) x[k] += w * (double)t->rest_m[3 * n + k];
        }
        double d = 0;
        for (uint32_t k = 0; k < 3; k++) d = fmax(d, fabs(x[k] - (double)t->rest_m[3 * i + k]));
        if (sum > 1.999)
            drawn++;
        else
            worst = fmax(worst, d);
    }
    for (uint32_t i = 0; i < m->first_node[m->levels - 1]; i++) {
        double x[3] = {0};
        for (uint32_t k = t->mean_offset[i]; k < t->mean_offset[i + 1]; k++) {
            for (uint32_t a = 0; a < 3; a++)
                x[a] += (double)t->mean_weight[k] * (double)t->rest_m[3 * t->mean[k] + a];
        }
        for (uint32_t a = 0; a < 3; a++)
            mean = fmax(mean, fabs(x[a] - (double)t->rest_m[3 * i + a]));
    }
    double size = (double)m->diagonal_m;
    AT_MOST(worst / size, 1e-6, "nodes in their containers, of the size (%u of %u drawn in)", drawn,
            m->nodes - m->first_node[1]);
    AT_MOST(mean / size, 1e-6, "parents as means of their children");
}

static uint64_t no_time(void *context) {
    (void)context;
    return 0;
}

/* Some ticks with a ball that goes through it all. */
static void use(const palp_tets *t) {
    const palp_tool ball = palp_tool_sphere(0.02f);
    const palp_dynamic_config c = {
        .tets = t,
        .material = palp_material_of(1e4f, 0.4f, 1000, 1e-4f, 1),
        .adapt = palp_adapt_defaults(t),
        .tools = &ball,
        .tool_count = 1,
        .max_points = 16,
        .most_class = 3,
        .cost = {.target = &palp_target_counted, .ns_per_instruction = 0.1f, .margin = 0.9f},
        .port = {.now_ns = no_time},
        .tick_s = 1e-3f};
    palp_dynamic *d = allocate(1, sizeof *d);
    size_t bytes = palp_dynamic_memsize(t, 16);
    void *memory = allocate_aligned(bytes + 1, 1);
    palp_frame at = palp_frame_at((palp_vec3){0.02f, 0.02f, 0.06f});
    palp_wrench on_tool;
    if (palp_dynamic_init(d, &c, &at, memory, bytes, NULL) == PALP_OK) {
        for (int k = 0; k < 30; k++) {
            palp_dynamic_report r;
            at.t.z = 0.06f - 0.002f * (float)k;
            palp_dynamic_tick(d, 0, &at, &on_tool, &r);
        }
    }
    free(memory);
    free(d);
}

static void check_hostile(const dynamic_body *b) {
    static const uint32_t words[] = {0,   1,     2,          3,          4,          47,
                                     255, 65535, 0x7fffffff, 0x80000000, 0xffffffff, 0x7f7fffff};
    uint64_t seed = 1;
    uint32_t refused = 0, used = 0, tries = 0;
    uint8_t *bytes = allocate_aligned(b->size, 1);
    for (uint32_t section = PALP_SEC_TETS; section <= PALP_SEC_SKIN_WEIGHT; section++) {
        const palp_blob_header *h = (const palp_blob_header *)(const void *)b->bytes;
        const palp_blob_entry *e = (const palp_blob_entry *)(const void *)(b->bytes + sizeof *h);
        while (e->type != section) e++;
        for (uint32_t k = 0; k < HOSTILE; k++, tries++) {
            memcpy(bytes, b->bytes, b->size);
            size_t all = (size_t)(e->count * e->element_bytes / 4);
            size_t at = (size_t)((tap_random(&seed) + 1) / 2 * (double)all);
            uint32_t word = words[(size_t)((tap_random(&seed) + 1) / 2 * 12)];
            memcpy(bytes + e->offset + 4 * at, &word, 4);
            model_seal(bytes);
            palp_tets t;
            if (palp_tets_open(&t, bytes, b->size) != PALP_OK) {
                refused++;
                continue;
            }
            used++;
            use(&t);
        }
    }
    CHECK(refused > 100 && used > 100, "%u hostile files: %u refused, %u used without harm", tries,
          refused, used);
    free(bytes);
}

int main(void) {
    static const double size[3] = {0.04, 0.04, 0.04};
    static const uint32_t n[3][3] = {{2, 2, 2}, {4, 4, 4}, {7, 7, 7}};
    tetmesh level[3];
    for (int l = 0; l < 3; l++) level[l] = tetmesh_block(size, n[l], l == 1);
    dynamic_body b = model_dynamic_body(level, 3, 1e-9, 1e4, 0.4, 0);
    check_stuffing();
    check_box();
    check_hierarchy(&b);
    check_hostile(&b);
    return tap_done();
}
