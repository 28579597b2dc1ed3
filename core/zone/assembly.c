/* SPDX-License-Identifier: MIT */
#include "assembly.h"
#include "core/green/columns.h"

#define FADED 3e-6f /* of a seam's length: what is carried is let go */

static void lay_out(palp_assembly *a, palp_arena *arena) {
    const palp_zones *z = a->zones;
    size_t n = 3u * (size_t)a->seams.modes;
    a->configuration = palp_take(arena, 1, sizeof *a->configuration);
    a->w = palp_take(arena, n, sizeof(float));
    a->carried = palp_take(arena, n, sizeof(float));
    a->load = palp_take(arena, n, sizeof(float));
    a->total = palp_take(arena, n, sizeof(float));
    a->kept = palp_take(arena, n, sizeof(float));
    uint32_t most = 0;
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        const palp_blob *b = &z->blob[i];
        uint32_t slots = b->domain[PALP_FREE].slots;
        bool gravity = palp_blob_has(b, PALP_META_GRAVITY) && z->part[i].weight != NULL;
        a->bent[i] = palp_take(arena, 3u * (size_t)z->zone[i].modes, sizeof(float));
        a->pushed[i] = palp_take(arena, 3u * (size_t)z->zone[i].modes, sizeof(float));
        a->node[i] = palp_take(arena, b->meta->nodes, sizeof(palp_zone_node));
        a->gravity_response[i] =
            gravity ? palp_take(arena, 9u * (size_t)slots, sizeof(float)) : NULL;
        most = slots > most ? slots : most;
    }
    a->field = palp_take(arena, PALP_FIELD_LANES * (size_t)most, sizeof(float));
}

/* Modes of all seams on a level. */
static uint32_t count_modes(const palp_zones *z, uint32_t finest) {
    uint32_t sum = 0;
    for (uint32_t s = 0; s < z->meta->seams; s++) sum += z->seam[s].level_modes[finest];
    return sum;
}

/* A function of its own, so that its stack frame is gone before the seams are initialised. */
__attribute__((noinline)) static size_t memsize_with(const palp_zones *zones, uint32_t finest,
                                                     size_t seams) {
    palp_arena arena = {0};
    palp_assembly a = {.zones = zones};
    (void)palp_take(&arena, seams, 1);
    a.seams.modes = count_modes(zones, finest);
    lay_out(&a, &arena);
    return arena.used;
}

size_t palp_assembly_memsize(const palp_zones *zones, uint32_t finest) {
    size_t seams = palp_seams_memsize(zones, finest);
    return seams > 0u ? memsize_with(zones, finest, seams) : 0u;
}

/* How each free slot of a zone moves by unit acceleration along each axis. */
static void find_gravity_response(palp_assembly *a, uint32_t zone) {
    const palp_blob *b = &a->zones->blob[zone];
    const palp_columns *c = &b->columns[PALP_FREE][PALP_FREE];
    uint32_t slots = b->domain[PALP_FREE].slots;
    for (uint32_t axis = 0; axis < 3; axis++) {
        const float along[3] = {axis == 0u ? 1.0f : 0.0f, axis == 1u ? 1.0f : 0.0f,
                                axis == 2u ? 1.0f : 0.0f};
        for (uint32_t i = 0; i < PALP_FIELD_LANES * slots; i++) a->field[i] = 0.0f;
        palp_columns_add(c, c->columns - 1u, along, a->field);
        if (!palp_blob_has(b, PALP_META_SPLIT))
            palp_wavelet_inverse(&b->domain[PALP_FREE], a->field, b->meta->levels - 1u);
        for (uint32_t i = 0; i < slots; i++) {
            for (uint32_t k = 0; k < 3; k++)
                a->gravity_response[zone][9u * i + 3u * k + axis] =
                    a->field[PALP_FIELD_LANES * i + k];
        }
    }
}

/* So far all that is known of a zone's nodes is where they are on its seams; on the first of
 * several. */
static void list_nodes(palp_assembly *a, uint32_t zone) {
    const palp_zones *z = a->zones;
    const palp_zone_part *part = &z->part[zone];
    for (uint32_t n = 0; n < z->blob[zone].meta->nodes; n++)
        a->node[zone][n] = (palp_zone_node){.on_seam = PALP_NONE};
    for (uint32_t k = part->seams; k-- > 0u;) {
        const uint32_t s = part->seam[k], side = palp_zone_is_second(z, s, zone) ? 1u : 0u;
        for (uint32_t i = z->seam[s].nodes; i-- > 0u;)
            a->node[zone][z->seam_node[s][2u * i + side]].on_seam = k << 24u | i;
    }
}

palp_status palp_assembly_init(palp_assembly *a, const palp_zones *zones, uint32_t finest,
                               void *memory, size_t bytes) {
    palp_arena arena = {.base = memory};
    if (finest >= PALP_SEAM_LEVELS) return PALP_ERR_LIMITS;
    size_t need = palp_assembly_memsize(zones, finest), seams = palp_seams_memsize(zones, finest);
    if (need == 0u) return PALP_ERR_LIMITS;
    palp_status status = palp_check_block(memory, bytes, need);
    if (status != PALP_OK) return status;
    a->zones = zones;
    a->gravity_m_s2 = (palp_vec3){0.0f, 0.0f, 0.0f};
    a->level = a->extent = finest;
    a->length_m = 0.0f;
    for (uint32_t s = 0; s < zones->meta->seams; s++)
        a->length_m = palp_max(a->length_m, zones->seam[s].length_m);
    void *part = palp_take(&arena, seams, 1);
    status = palp_seams_init(&a->seams, zones, finest, part, seams);
    if (status != PALP_OK) return status;
    lay_out(a, &arena);
    a->settled = 0;
    for (uint32_t i = 0; i < 3u * a->seams.modes; i++) a->w[i] = a->carried[i] = a->total[i] = 0.0f;
    for (uint32_t i = 0; i < zones->meta->zones; i++) list_nodes(a, i);
    palp_assembly_unload(a);
    for (uint32_t i = 0; i < zones->meta->zones; i++) {
        if (a->gravity_response[i] != NULL) find_gravity_response(a, i);
    }
    palp_configuration_rest(a->configuration, zones);
    palp_assembly_pose(a, a->configuration->value, &a->configuration->root);
    palp_assembly_settle(a);
    return PALP_OK;
}

palp_status palp_assembly_gravity(palp_assembly *assembly, palp_vec3 acceleration_m_s2) {
    if (!palp_vec3_is_finite(acceleration_m_s2)) return PALP_ERR_NOT_FINITE;
    for (uint32_t i = 0; i < assembly->zones->meta->zones; i++) {
        if (assembly->gravity_response[i] == NULL) return PALP_ERR_ABSENT;
    }
    assembly->gravity_m_s2 = acceleration_m_s2;
    return PALP_OK;
}

void palp_assembly_forget_forces(palp_assembly *assembly) {
    palp_assembly_unload(assembly);
    for (uint32_t i = 0; i < 3u * assembly->seams.modes; i++) assembly->carried[i] = 0.0f;
    assembly->extent = palp_seams_factor(&assembly->seams)->level;
}

void palp_assembly_pose(palp_assembly *a, const float *value, const palp_frame *root) {
    palp_configuration_set(a->configuration, a->zones, value, root);
    for (uint32_t i = 0; i < a->zones->meta->zones; i++)
        a->world[i] = palp_configuration_world(a->configuration, i);
}

float palp_assembly_drift(const palp_assembly *a) {
    const palp_seam_factor *f = &a->seams.factor[a->seams.now];
    float most = 0.0f;
    for (uint32_t s = 0; s < a->zones->meta->seams; s++) {
        float d = palp_frame_distance(&a->configuration->relative[s], &f->relative[s],
                                      a->zones->seam[s].length_m);
        most = palp_max(most, d);
    }
    return most;
}

/* w by the factor in use, without what is carried. */
static void solve_bare(palp_assembly *a, float *w) {
    palp_seams *q = &a->seams;
    const palp_seam_factor *f = palp_seams_factor(q);
    a->level = f->diagonal ? PALP_DIAGONAL : f->level;
    float *r = a->total;
    palp_seams_mismatch(q, a->configuration, f->level, r);
    palp_seams_gravity(q, a->configuration, f->level,
                       palp_rotate_back(a->configuration->root.r, a->gravity_m_s2), r);
    if (!f->diagonal && palp_assembly_drift(a) > 0.0f) {
        (void)palp_seams_iterate(q, a->configuration, r, PALP_ASSEMBLY_ITERATIONS, w);
        return;
    }
    for (uint32_t i = 0; i < 3u * q->modes; i++) w[i] = r[i];
    palp_seams_solve(q, w);
}

static void share_out(palp_assembly *a) {
    a->settled++;
    for (uint32_t i = 0; i < a->zones->meta->zones; i++)
        palp_seams_zone(&a->seams, a->configuration, PALP_SEAM_LEVELS - 1u, i, a->w, a->bent[i]);
}

void palp_assembly_settle(palp_assembly *a) {
    solve_bare(a, a->w);
    for (uint32_t i = 0; i < 3u * a->seams.modes; i++) a->w[i] += a->carried[i];
    share_out(a);
}

float palp_assembly_cost_settle(const palp_assembly *a, const palp_prices *price, uint32_t level) {
    float modes = 0.0f;
    for (uint32_t i = 0; i < a->zones->meta->zones;
         i++) /* mismatch of each seam, product, shares */
        modes += (float)a->zones->zone[i].modes * (float)a->zones->part[i].seams;
    return (1.0f + (float)PALP_ASSEMBLY_ITERATIONS) *
               palp_seams_cost_solve(&a->seams, price, level) +
           ((float)PALP_AFFINE_MODES * price->of[PALP_WORK_POSITION_MODE] +
            price->of[PALP_WORK_POSITION]) *
               modes;
}

void palp_assembly_relax(palp_assembly *a, float share) {
    float most = 0.0f;
    for (uint32_t i = 0; i < 3u * a->seams.modes; i++) {
        a->carried[i] -= share * a->carried[i];
        most = palp_max(most, palp_abs(a->carried[i]));
    }
    if (most > FADED * a->length_m) return;
    for (uint32_t i = 0; i < 3u * a->seams.modes; i++) a->carried[i] = 0.0f;
    a->extent = palp_seams_factor(&a->seams)->level;
}

float palp_assembly_modes(const palp_assembly *a, uint32_t zone) {
    const palp_zone_part *part = &a->zones->part[zone];
    float modes = 0.0f;
    for (uint32_t k = 0; k < part->seams; k++)
        modes += (float)palp_seam_modes(&a->seams, part->seam[k], a->seams.finest);
    return modes;
}

static palp_seam_place seam_place(uint32_t on_seam) {
    return (palp_seam_place){.seam = on_seam >> 24u, .node = on_seam & 0xffffffu};
}

void palp_assembly_modal_load(const palp_assembly *assembly, uint32_t level, uint32_t zone,
                              uint32_t node, palp_vec3 f, float *felt) {
    const palp_zones *z = assembly->zones;
    const uint32_t at = assembly->node[zone][node].on_seam;
    if (!palp_node_is_fixed(&z->blob[zone], node))
        palp_zone_modal_load(z, level, zone, node, f, felt);
    else if (at != PALP_NONE)
        palp_zone_modal_load_at_seam(z, level, zone, seam_place(at), f, felt);
}

palp_vec3 palp_assembly_modal_displacement(const palp_assembly *assembly, uint32_t level,
                                           uint32_t zone, uint32_t node, const float *u) {
    const palp_zones *z = assembly->zones;
    const uint32_t at = assembly->node[zone][node].on_seam;
    if (!palp_node_is_fixed(&z->blob[zone], node))
        return palp_zone_modal_displacement(z, level, zone, node, u);
    if (at == PALP_NONE) return (palp_vec3){0.0f, 0.0f, 0.0f};
    return palp_zone_modal_displacement_at_seam(z, level, zone, seam_place(at), u);
}

palp_vec3 palp_assembly_bent(palp_assembly *a, uint32_t zone, uint32_t node) {
    const palp_blob *b = &a->zones->blob[zone];
    palp_zone_node *kept = &a->node[zone][node];
    if (kept->when == a->settled) return kept->u_m;
    palp_vec3 u = palp_assembly_modal_displacement(a, a->extent, zone, node, a->bent[zone]);
    if (a->gravity_response[zone] != NULL && !palp_node_is_fixed(b, node) &&
        palp_dot(a->gravity_m_s2, a->gravity_m_s2) > 0.0f)
        u = palp_add(u,
                     palp_rotate(a->gravity_response[zone] + 9u * (size_t)palp_node_slot(b, node),
                                 palp_rotate_back(a->world[zone].r, a->gravity_m_s2)));
    kept->u_m = u;
    kept->when = a->settled;
    a->seams.work_done += 40u + 9u * (uint32_t)palp_assembly_modes(a, zone);
    return u;
}

palp_vec3 palp_assembly_position(palp_assembly *assembly, uint32_t zone, uint32_t node) {
    const palp_vec3 x = palp_vec3_at(assembly->zones->blob[zone].rest_m + 3u * (size_t)node);
    return palp_carry(&assembly->world[zone],
                      palp_add(x, palp_assembly_bent(assembly, zone, node)));
}

palp_vec3 palp_assembly_normal(const palp_assembly *a, uint32_t zone, uint32_t node) {
    return palp_rotate(a->world[zone].r,
                       palp_vec3_at(a->zones->blob[zone].normal + 3u * (size_t)node));
}

void palp_assembly_add_modal_load(palp_assembly *a, uint32_t zone, const float *felt, float *sum) {
    palp_seams *q = &a->seams;
    const uint32_t level = palp_seams_factor(q)->level;
    palp_seams_load(q, a->configuration, level, zone, felt, sum);
    palp_seams_load(q, NULL, level, zone, felt, sum + 3u * (size_t)q->modes);
    q->work_done += 24u * a->zones->zone[zone].modes;
}

void palp_assembly_answer(palp_assembly *assembly, float *sum) {
    palp_seams *q = &assembly->seams;
    const palp_seam_factor *rest = palp_seams_at_rest(q);
    uint64_t all = ~0ull;
    palp_seams_solve(q, sum);
    palp_seams_forward(q, rest, sum + 3u * (size_t)q->modes, &all);
    palp_seams_backward(q, rest, sum + 3u * (size_t)q->modes);
}

void palp_assembly_answer_of(palp_assembly *a, uint32_t zone, const float *sum, float *u) {
    palp_seams *q = &a->seams;
    const uint32_t level = palp_seams_factor(q)->level;
    palp_seams_expand(q, a->configuration, level, zone, sum, u);
    palp_seams_expand(q, NULL, level, zone, sum + 3u * (size_t)q->modes, q->zone_modes);
    for (uint32_t i = 0; i < 3u * a->zones->zone[zone].modes; i++) u[i] -= q->zone_modes[i];
}

void palp_assembly_unload(palp_assembly *assembly) {
    const palp_zones *z = assembly->zones;
    for (uint32_t i = 0; i < 3u * assembly->seams.modes; i++) assembly->load[i] = 0.0f;
    for (uint32_t k = 0; k < z->meta->zones; k++) {
        for (uint32_t i = 0; i < 3u * z->zone[k].modes; i++) assembly->pushed[k][i] = 0.0f;
    }
}

void palp_assembly_load(palp_assembly *assembly, uint32_t zone, const float *felt) {
    palp_seams *q = &assembly->seams;
    const uint32_t modes = assembly->zones->zone[zone].modes;
    palp_seams_load(q, assembly->configuration, q->finest, zone, felt, assembly->load);
    for (uint32_t i = 0; i < 3u * modes; i++) assembly->pushed[zone][i] += felt[i];
    q->work_done += 15u * modes;
}

const float *palp_assembly_total(palp_assembly *a) {
    palp_seams *q = &a->seams;
    uint32_t level = palp_seams_factor(q)->level;
    for (uint32_t s = 0; s < q->zones->meta->seams; s++) { /* modes beyond the level stay out */
        uint32_t first = 3u * q->first_mode[s], used = 3u * palp_seam_modes(q, s, level);
        for (uint32_t i = 0; i < 3u * palp_seam_modes(q, s, q->finest); i++)
            a->total[first + i] = i < used ? a->load[first + i] : 0.0f;
    }
    palp_seams_solve(q, a->total);
    for (uint32_t i = 0; i < 3u * a->seams.modes; i++) a->total[i] += a->w[i];
    return a->total;
}

bool palp_assembly_take(palp_assembly *a, bool smooth) {
    palp_seams *q = &a->seams;
    uint32_t n = 3u * q->modes;
    const palp_seam_factor *f = palp_seams_factor(q), *next = &q->factor[1u - q->now];
    bool other = f->level != next->level || f->diagonal != next->diagonal;
    bool carry = smooth && other;
    const float *total = carry ? palp_assembly_total(a) : a->total;
    for (uint32_t i = 0; i < n && carry; i++) a->kept[i] = total[i];
    if (!palp_seams_take(q)) return false;
    uint32_t level = palp_seams_factor(q)->level;
    for (uint32_t i = 0; i < n && !smooth; i++) a->carried[i] = 0.0f;
    if (!smooth || level > a->extent) a->extent = level;
    if (!carry) {
        palp_assembly_settle(a);
        return true;
    }
    solve_bare(a, a->w);
    total = palp_assembly_total(a);
    for (uint32_t i = 0; i < n; i++) a->carried[i] = a->kept[i] - total[i];
    for (uint32_t i = 0; i < n; i++) a->w[i] += a->carried[i];
    share_out(a);
    return true;
}

void palp_assembly_wrench(palp_assembly *a, uint32_t zone, palp_vec3 *force_N,
                          palp_vec3 *moment_Nm) {
    palp_seams *q = &a->seams;
    const palp_zone_part *part = &a->zones->part[zone];
    palp_vec3 force = {0.0f, 0.0f, 0.0f}, moment = force;
    palp_seams_reaction(q, a->configuration, zone, a->total,
                        palp_rotate_back(a->configuration->root.r, a->gravity_m_s2));
    for (uint32_t k = 0; k < part->seams; k++) {
        const palp_seam_entry *e = &a->zones->seam[part->seam[k]];
        for (uint32_t i = 0; i < e->modes; i++) {
            uint32_t mode = part->first[k] + i;
            palp_vec3 f = palp_sub(palp_vec3_at(q->zone_forces + 3u * mode),
                                   palp_vec3_at(a->pushed[zone] + 3u * mode));
            palp_vec3 x = palp_vec3_at(q->zone_modes + 3u * mode);
            if (i < PALP_AFFINE_MODES) {
                force = palp_madd(force, e->ones[i], f);
                x = palp_add(x, palp_vec3_at(e->position_m[i]));
            }
            moment = palp_add(moment, palp_cross(x, f));
        }
    }
    const palp_frame *frame = &a->world[zone];
    *force_N = palp_rotate(frame->r, force);
    *moment_Nm = palp_add(palp_rotate(frame->r, moment), palp_cross(frame->t, *force_N));
}
