/* SPDX-License-Identifier: MIT */
#include "core/green/split.h"
#include "core/base/linalg.h"
#include "core/green/half_space.h"

#define LANES PALP_FIELD_LANES

static palp_vec3 place_of(const palp_blob *b, uint32_t slot) {
    return palp_vec3_at(b->rest_m + 3u * (size_t)b->domain[PALP_FREE].node[slot]);
}
static palp_vec3 normal_of(const palp_blob *b, uint32_t slot) {
    return palp_vec3_at(b->normal + 3u * (size_t)b->domain[PALP_FREE].node[slot]);
}
static const int16_t *modes_of(const palp_blob *b, uint32_t slot) {
    return b->split.vector +
           3u * (size_t)b->domain[PALP_FREE].node[slot] * (size_t)b->split.count;
}
static float factor_of(const palp_blob *b) {
    return (1.0f + b->meta->poisson) / (PALP_PI_F * b->meta->young_Pa);
}

/* Places and normals of PALP_BESIDE slots, component by component, and what they are displaced by. */
typedef struct {
    float x[3][PALP_BESIDE], n[3][PALP_BESIDE], u[3][PALP_BESIDE];
} strip;

static void read_strip(const palp_blob *b, uint32_t first, strip *s) {
    const uint32_t *node = b->domain[PALP_FREE].node + first;
    for (uint32_t e = 0; e < PALP_BESIDE; e++) {
        const float *x = b->rest_m + 3u * (size_t)node[e], *n = b->normal + 3u * (size_t)node[e];
        for (uint32_t k = 0; k < 3u; k++) {
            s->x[k][e] = x[k];
            s->n[k][e] = n[k];
        }
    }
}

/* palp_half_space_displacement, in the same order, with the factor in f. */
static void displace_strip(float nu, palp_vec3 at, palp_vec3 normal, palp_vec3 f, strip *s) {
    const float rest = 0.5f - nu, fx = (1.0f - nu) * f.x, fy = (1.0f - nu) * f.y,
                fz = (1.0f - nu) * f.z;
    for (uint32_t e = 0; e < PALP_BESIDE; e++) {
        const float rx = s->x[0][e] - at.x, ry = s->x[1][e] - at.y, rz = s->x[2][e] - at.z;
        const float nx = 0.5f * (s->n[0][e] + normal.x), ny = 0.5f * (s->n[1][e] + normal.y),
                    nz = 0.5f * (s->n[2][e] + normal.z);
        const float r2 = rx * rx + ry * ry + rz * rz;
        const float inverse = r2 > 0.0f ? 1.0f / palp_sqrt(r2) : 0.0f;
        const float ex = inverse * rx, ey = inverse * ry, ez = inverse * rz;
        const float along = ex * f.x + ey * f.y + ez * f.z, across = nx * f.x + ny * f.y + nz * f.z;
        const float out = nu * along + rest * across, in = -rest * along;
        s->u[0][e] = inverse * (fx + out * ex + in * nx);
        s->u[1][e] = inverse * (fy + out * ey + in * ny);
        s->u[2][e] = inverse * (fz + out * ez + in * nz);
    }
}

static void add_half_space(const palp_blob *b, uint32_t slot, palp_vec3 f, float *field) {
    const palp_vec3 at = place_of(b, slot), normal = normal_of(b, slot);
    const uint32_t slots = b->domain[PALP_FREE].slots, whole = slots / PALP_BESIDE;
    const float nu = b->meta->poisson;
    for (uint32_t q = 0; q < whole; q++) {
        strip s;
        read_strip(b, PALP_BESIDE * q, &s);
        displace_strip(nu, at, normal, f, &s);
        for (uint32_t e = 0; e < PALP_BESIDE; e++) {
            float *u = field + LANES * (size_t)(PALP_BESIDE * q + e);
            for (uint32_t k = 0; k < 3u; k++) u[k] += s.u[k][e];
        }
    }
    for (uint32_t i = PALP_BESIDE * whole; i < slots; i++) { /* at most 3 */
        const palp_vec3 u =
            palp_half_space_displacement(nu, palp_sub(place_of(b, i), at),
                                         palp_scale(0.5f, palp_add(normal_of(b, i), normal)), f);
        field[LANES * (size_t)i] += u.x;
        field[LANES * (size_t)i + 1u] += u.y;
        field[LANES * (size_t)i + 2u] += u.z;
    }
}

void palp_split_add(const palp_blob *blob, uint32_t slot, const float force_N[3], float *load,
                    float *field) {
    const uint32_t modes = blob->split.count;
    const int16_t *u = modes_of(blob, slot);
    add_half_space(blob, slot, palp_scale(factor_of(blob), palp_vec3_at(force_N)), field);
    palp_columns_add(&blob->columns[PALP_FREE][PALP_FREE], slot, force_N, field);
    for (uint32_t a = 0; a < modes; a++)
        load[a] += (float)u[a] * force_N[0] + (float)u[modes + a] * force_N[1] +
                   (float)u[2u * modes + a] * force_N[2];
}

/* What each mode weighs: its eigenvalue, and the unit of both vectors. */
static void weigh(const palp_split_modes *g, const float *load, float *weighed) {
    const float unit = 1.0f / (PALP_MODE_UNIT * PALP_MODE_UNIT);
    for (uint32_t a = 0; a < g->count; a++) weighed[a] = g->value[a] * unit * load[a];
}

/* sum_a u[a] v[a] over the modes, in PALP_MODE_LANES sums. */
static float along_modes(const int16_t *u, const float *v, uint32_t modes) {
    float lane[PALP_MODE_LANES] = {0}, sum = 0.0f;
    for (uint32_t a = 0; a < modes; a += PALP_MODE_LANES) {
        for (uint32_t k = 0; k < PALP_MODE_LANES; k++) lane[k] += v[a + k] * (float)u[a + k];
    }
    for (uint32_t k = 0; k < PALP_MODE_LANES; k++) sum += lane[k];
    return sum;
}

void palp_split_add_modes(const palp_blob *blob, const float *load, uint32_t slots, float *field) {
    const uint32_t modes = blob->split.count;
    float weighed[PALP_MAX_MODES];
    weigh(&blob->split, load, weighed);
    for (uint32_t i = 0; i < slots; i++) {
        const int16_t *u = modes_of(blob, i);
        for (uint32_t k = 0; k < 3u; k++)
            field[LANES * (size_t)i + k] += along_modes(u + k * modes, weighed, modes);
    }
}

void palp_nodal_response(const palp_blob *blob, uint32_t slot, const float force_N[3],
                         float *field) {
    const palp_domain *d = &blob->domain[PALP_FREE];
    float load[PALP_MAX_MODES] = {0};
    for (uint32_t i = 0; i < d->slots * LANES; i++) field[i] = 0.0f;
    if (palp_blob_has(blob, PALP_META_SPLIT)) {
        palp_split_add(blob, slot, force_N, load, field);
        palp_split_add_modes(blob, load, d->slots, field);
    } else {
        palp_columns_add(&blob->columns[PALP_FREE][PALP_FREE], slot, force_N, field);
        palp_wavelet_inverse(d, field, d->levels - 1u);
    }
}

/* mode[k][a] = sum_i weight_i U_ia,k, in units */
static void gather_modes(const palp_blob *b, const palp_row *row, float mode[3][PALP_MAX_MODES]) {
    const uint32_t modes = b->split.count;
    for (uint32_t k = 0; k < 3u; k++) {
        for (uint32_t a = 0; a < modes; a++) mode[k][a] = 0.0f;
    }
    for (uint32_t i = 0; i < row->count; i++) {
        const int16_t *u = modes_of(b, row->index[i]);
        for (uint32_t k = 0; k < 3u; k++) {
            for (uint32_t a = 0; a < modes; a++)
                mode[k][a] += row->weight[i] * (float)u[k * modes + a];
        }
    }
}

/* block += weight B(x_i - x_j) */
static void add_between(const palp_blob *b, uint32_t i, uint32_t j, float weight, float block[9]) {
    const palp_vec3 r = palp_sub(place_of(b, i), place_of(b, j));
    const palp_vec3 n = palp_scale(0.5f, palp_add(normal_of(b, i), normal_of(b, j)));
    for (uint32_t c = 0; c < 3u; c++) {
        const palp_vec3 unit = {c == 0u ? weight : 0.0f, c == 1u ? weight : 0.0f,
                                c == 2u ? weight : 0.0f};
        const palp_vec3 u = palp_half_space_displacement(b->meta->poisson, r, n, unit);
        block[c] += u.x;
        block[3u + c] += u.y;
        block[6u + c] += u.z;
    }
}

void palp_split_between(const palp_blob *blob, const palp_row *a, const palp_row *b,
                        float block[9]) {
    const palp_split_modes *g = &blob->split;
    float left[3][PALP_MAX_MODES], right[3][PALP_MAX_MODES];
    gather_modes(blob, a, left);
    gather_modes(blob, b, right);
    for (uint32_t k = 0; k < 3u; k++) weigh(g, right[k], right[k]);
    for (uint32_t e = 0; e < 9u; e++) {
        block[e] = 0.0f;
        for (uint32_t m = 0; m < g->count; m++) block[e] += left[e / 3u][m] * right[e % 3u][m];
    }
    for (uint32_t j = 0; j < b->count; j++) {
        const float share = factor_of(blob) * b->weight[j];
        float missed[9];
        for (uint32_t i = 0; i < a->count; i++)
            add_between(blob, a->index[i], b->index[j], share * a->weight[i], block);
        palp_columns_extract(&blob->columns[PALP_FREE][PALP_FREE], b->index[j], a, missed);
        for (uint32_t e = 0; e < 9u; e++) block[e] += b->weight[j] * missed[e];
    }
}
