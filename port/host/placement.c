/* SPDX-License-Identifier: MIT */
#include "port/host/placement.h"
#include "core/green/hierarchy.h"
#include "core/green/split.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

static palp_vec3 rest(const palp_blob *b, uint32_t i) { return palp_vec3_at(b->rest_m + 3 * i); }
static palp_vec3 normal(const palp_blob *b, uint32_t i) { return palp_vec3_at(b->normal + 3 * i); }

/* Mean of n_i . n_j over the nodes j within `radius`, a measure of how flat the surface is at i. */
static float flatness(const palp_blob *b, uint32_t i, float radius) {
    float sum = 0;
    float count = 0;
    for (uint32_t j = 0; j < b->meta->nodes; j++) {
        if (palp_norm(palp_sub(rest(b, i), rest(b, j))) > radius) continue;
        sum += palp_dot(normal(b, i), normal(b, j)) * (palp_node_is_fixed(b, j) ? 0.0f : 1.0f);
        count += 1;
    }
    return sum / count;
}

static palp_vec3 centroid(const palp_blob *b, bool fixed) {
    palp_vec3 sum = {0};
    float count = 0;
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        if (palp_node_is_fixed(b, i) != fixed) continue;
        sum = palp_add(sum, rest(b, i));
        count += 1;
    }
    return palp_scale(1.0f / count, sum);
}

/* 1 / (n^T G_ii n) of every node of the constraint level, N/m; 0 at others. Exits where a node does
 * not give way along its push. */
static float *node_stiffness(const palp_blob *b) {
    uint32_t slots = b->domain[PALP_FREE].slots;
    palp_row_scratch scratch = {allocate(slots, sizeof(float)),
                                allocate((slots + 31) / 32, sizeof(uint32_t))};
    palp_row row = {.index = allocate(slots, sizeof(uint16_t)),
                    .weight = allocate(slots, sizeof(float))};
    uint32_t level = b->meta->constraint_level;
    float *stiffness = allocate(b->meta->nodes, sizeof *stiffness);
    for (uint32_t s = 0; s < b->level[level].nodes; s++) {
        uint32_t node = b->domain[PALP_FREE].node[s];
        palp_vec3 n = normal(b, node);
        float g[9];
        if (palp_blob_has(b, PALP_META_SPLIT)) {
            (void)palp_basis_weights(b, (palp_basis){level, s}, &scratch, &row, slots);
            palp_split_between(b, &row, &row, g);
        } else {
            (void)palp_basis_row(b, (palp_basis){level, s}, &scratch, &row, slots);
            palp_columns_extract(&b->level[level].columns, s, &row, g);
        }
        palp_vec3 u = {palp_dot(palp_vec3_at(g), n), palp_dot(palp_vec3_at(g + 3), n),
                       palp_dot(palp_vec3_at(g + 6), n)};
        const float compliance = palp_dot(n, u);
        if (!(compliance > 0))
            die(EXIT_WORK,
                "node %" PRIu32 " of the blob moves by %.3g m against a push of 1 N, which no body "
                "does: it is damaged, or was baked with a wrong --compliance: bake it again",
                node, -(double)compliance);
        stiffness[node] = 1.0f / compliance;
    }
    free(scratch.weight);
    free(scratch.mark);
    free(row.index);
    free(row.weight);
    return stiffness;
}

/* High, flat, facing up, and no softer than most: not the tip of an ear. */
static uint32_t choose_node(const palp_blob *b, float radius, const float *stiffness) {
    palp_vec3 from = centroid(b, true);
    palp_vec3 up = palp_sub(centroid(b, false), from);
    float length = palp_norm(up);
    if (length > 0) up = palp_scale(1.0f / length, up);
    uint32_t best = UINT32_MAX;
    float best_score = 0, mean = 0;
    for (uint32_t i = 0; i < b->meta->nodes; i++)
        mean += stiffness[i] / (float)b->level[b->meta->constraint_level].nodes;
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        if (!(stiffness[i] > 0)) continue;
        float height = palp_dot(palp_sub(rest(b, i), from), up);
        float score = height * fmaxf(flatness(b, i, radius) - 0.5f, 1e-3f) *
                      (1.2f + palp_dot(normal(b, i), up)) * fminf(stiffness[i] / mean, 1.0f);
        if (best != UINT32_MAX && score <= best_score) continue;
        best = i;
        best_score = score;
    }
    return best;
}

/* Columns of R are where the device's x, y and z axes go; z goes to n. */
static void rotation_to(palp_vec3 n, float r[9]) {
    palp_vec3 helper = fabsf(n.x) < 0.7f ? (palp_vec3){1, 0, 0} : (palp_vec3){0, 1, 0};
    palp_vec3 y = palp_cross(n, helper);
    y = palp_scale(1.0f / palp_norm(y), y);
    palp_vec3 x = palp_cross(y, n);
    const float columns[9] = {x.x, y.x, n.x, x.y, y.y, n.y, x.z, y.z, n.z};
    for (int i = 0; i < 9; i++) r[i] = columns[i];
}

uint32_t nearest_free_node(const palp_blob *blob, const double place_m[3]) {
    const palp_vec3 place = {(float)place_m[0], (float)place_m[1], (float)place_m[2]};
    uint32_t nearest = UINT32_MAX;
    float least = HUGE_VALF;
    for (uint32_t i = 0; i < blob->meta->nodes; i++) {
        const float away = palp_norm(palp_sub(rest(blob, i), place));
        if (palp_node_is_fixed(blob, i) || away >= least) continue;
        least = away;
        nearest = i;
    }
    return nearest;
}

touch_frame place_under(const surface_spot *spot, const palp_device *device, const spot_tool *held,
                        const float rotation[9], double scale) {
    const float workspace = 2 * device->workspace_radius_m, size = spot->size_m;
    touch_frame t = {.node = spot->node, .placement = {.scale = 1}};
    if (size < workspace / 3 || size > 2 * workspace) t.placement.scale = size / workspace;
    if (scale > 0) t.placement.scale = (float)scale;
    t.tool_radius_m = held->radius_m > 0
                          ? held->radius_m
                          : fmaxf(device->tool_radius_m * t.placement.scale, 0.5f * spot->edge_m);
    if (rotation != NULL)
        for (int e = 0; e < 9; e++) t.placement.rotation[e] = rotation[e];
    else
        rotation_to(spot->normal, t.placement.rotation);
    /* its lowest place touches, seen along the normal */
    const palp_vec3 down = palp_rotate_back(t.placement.rotation, palp_scale(-1, spot->normal));
    float reach = palp_dot(held->at.t, down);
    reach += held->tool != NULL ? palp_tool_support(held->tool, palp_rotate_back(held->at.r, down))
                                : t.tool_radius_m;
    t.placement.origin_m = palp_madd(spot->at_m, reach, spot->normal);
    return t;
}

surface_spot spot_of_blob(const palp_blob *blob, uint32_t node) {
    const palp_meta *m = blob->meta;
    const palp_vec3 diagonal = palp_sub(palp_vec3_at(m->box_max_m), palp_vec3_at(m->box_min_m));
    return (surface_spot){.at_m = rest(blob, node),
                          .normal = normal(blob, node),
                          .size_m = palp_norm(diagonal),
                          .edge_m = m->mean_edge_m,
                          .node = node};
}

uint32_t flat_high_node(const palp_blob *blob, float radius_m) {
    float *stiffness = node_stiffness(blob);
    const uint32_t node = choose_node(blob, 2 * radius_m, stiffness);
    free(stiffness);
    return node;
}

touch_frame place_body(const palp_blob *blob, const palp_device *device, uint32_t node,
                       const palp_tool *tool, double radius_m) {
    const spot_tool held = {.tool = tool,
                            .radius_m = tool != NULL ? palp_tool_size(tool) : (float)radius_m,
                            .at = PALP_FRAME_IDENTITY};
    surface_spot spot = spot_of_blob(blob, 0);
    if (node == UINT32_MAX) {
        const touch_frame usual =
            place_under(&spot, device, &(spot_tool){.at = PALP_FRAME_IDENTITY}, NULL, 0);
        node = flat_high_node(blob, fmaxf(held.radius_m, usual.tool_radius_m));
    }
    spot = spot_of_blob(blob, node);
    return place_under(&spot, device, &held, NULL, 0);
}
