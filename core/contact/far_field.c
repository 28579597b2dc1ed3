/* SPDX-License-Identifier: MIT */
#include "core/contact/far_field.h"
#include "core/base/linalg.h"

#define RIDGE 0.02f /* of the places' scatter, added in every direction */
#define STEEPEST 0.7f
#define REACH 3.0f /* over the RMS distance of the places, and a cell */

static palp_vec3 turned(const palp_far_field *far_field, palp_vec3 d) {
    const float *m = far_field->slope;
    return (palp_vec3){m[0] * d.x + m[1] * d.y + m[2] * d.z, m[3] * d.x + m[4] * d.y + m[5] * d.z,
                       m[6] * d.x + m[7] * d.y + m[8] * d.z};
}

palp_vec3 palp_far_field_turned_back(const palp_far_field *far_field, palp_vec3 d) {
    const float *m = far_field->slope;
    return (palp_vec3){m[0] * d.x + m[3] * d.y + m[6] * d.z, m[1] * d.x + m[4] * d.y + m[7] * d.z,
                       m[2] * d.x + m[5] * d.y + m[8] * d.z};
}

palp_vec3 palp_far_field_beside(const palp_far_field *far_field, palp_vec3 y, float *gone) {
    const palp_vec3 d = palp_sub(y, far_field->at_m);
    const float beyond =
        (palp_dot(d, d) * far_field->fade - 1.0f) * (1.0f / 3.0f); /* 1 at 2 reach */
    *gone = palp_clamp(beyond, 0.0f, 1.0f);
    return palp_madd(palp_scale(1.0f - *gone, turned(far_field, d)), -*gone, far_field->mean_m);
}

palp_far_field palp_far_field_times(const palp_far_field *far_field, float factor) {
    palp_far_field g = *far_field;
    g.mean_m = palp_scale(factor, g.mean_m);
    for (uint32_t k = 0; k < 9u; k++) g.slope[k] *= factor;
    return g;
}

/* m += w a b^T */
static void add_outer(float m[9], float w, palp_vec3 a, palp_vec3 b) {
    const float p[3] = {w * a.x, w * a.y, w * a.z}, q[3] = {b.x, b.y, b.z};
    for (uint32_t k = 0; k < 9u; k++) m[k] += p[k / 3u] * q[k % 3u];
}

void palp_far_field_add(palp_far_field_sums *sums, float weight, palp_vec3 y, palp_vec3 h,
                        float cell_m) {
    sums->weight += weight;
    sums->cell += weight * cell_m;
    sums->y = palp_madd(sums->y, weight, y);
    sums->h = palp_madd(sums->h, weight, h);
    add_outer(sums->yy, weight, y, y);
    add_outer(sums->hy, weight, h, y);
}

palp_far_field palp_far_field_fit(const palp_far_field_sums *sums, palp_vec3 origin_m) {
    palp_far_field g = {.at_m = origin_m};
    if (!(sums->weight > 0.0f)) return g;
    const float share = 1.0f / sums->weight;
    const palp_vec3 y = palp_scale(share, sums->y);
    float scatter[9], with[9], factor[9];
    g.mean_m = palp_scale(share, sums->h);
    g.at_m = palp_add(origin_m, y);
    for (uint32_t k = 0; k < 9u; k++) {
        scatter[k] = share * sums->yy[k];
        with[k] = share * sums->hy[k];
    }
    add_outer(scatter, -1.0f, y, y);
    add_outer(with, -1.0f, g.mean_m, y);
    const float across = palp_max(scatter[0] + scatter[4] + scatter[8], 0.0f);
    const float reach = REACH * (palp_sqrt(across) + share * sums->cell);
    g.fade = reach > 0.0f ? 1.0f / (reach * reach) : 0.0f;
    float ridge = RIDGE * across;
    if (!(ridge > 0.0f)) return g;
    for (uint32_t n = 0; n < 3u; n++) {
        float row[3];
        for (uint32_t k = 0; k <= n; k++) row[k] = scatter[3u * n + k] + (k == n ? ridge : 0.0f);
        if (palp_chol_append(factor, n, 3, row) != PALP_OK) return g;
    }
    float size2 = 0.0f;
    for (uint32_t k = 0; k < 3u; k++) {
        float *row = g.slope + 3u * k;
        for (uint32_t q = 0; q < 3u; q++) row[q] = with[3u * k + q];
        palp_chol_solve(factor, 3, 3, row);
        size2 += row[0] * row[0] + row[1] * row[1] + row[2] * row[2];
    }
    float size = palp_sqrt(size2);
    for (uint32_t k = 0; k < 9u && size > STEEPEST; k++) g.slope[k] *= STEEPEST / size;
    return g;
}
