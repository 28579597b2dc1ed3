/* SPDX-License-Identifier: MIT */
#include "core/contact/tool_field.h"
#include "core/blob/reader.h"

#define MOST_SAMPLES 1024u /* along one axis */

static bool is_positive(float x) { return x > 0.0f && palp_is_finite(x); }

palp_status palp_tool_field_open(palp_tool_field *field, const void *data, size_t bytes) {
    palp_reader r = palp_reader_open(data, bytes);
    if (r.status == PALP_OK && !palp_reader_has(&r, PALP_SEC_TOOL)) return PALP_ERR_ABSENT;
    const palp_tool_meta *m = palp_reader_section(&r, PALP_SEC_TOOL, 1, sizeof *m);
    if (m == NULL) return r.status;
    uint64_t samples = 1;
    for (uint32_t k = 0; k < 3u; k++) {
        palp_reader_require(&r, m->count[k] >= 4u && m->count[k] <= MOST_SAMPLES);
        samples *= m->count[k];
        if (!palp_is_finite(m->origin_m[k])) palp_reader_fail(&r, PALP_ERR_NOT_FINITE);
    }
    palp_reader_require(&r, is_positive(m->step_m) && is_positive(m->unit_m) &&
                                is_positive(m->size_m) && m->radius_m >= 0.0f &&
                                palp_is_finite(m->radius_m));
    if (r.status != PALP_OK) return r.status;
    const int16_t *sample = palp_reader_section(&r, PALP_SEC_TOOL_SAMPLE, samples, sizeof *sample);
    if (sample == NULL) return r.status;
    const float *extreme = NULL;
    palp_reader_require(&r, m->extremes <= PALP_TOOL_EXTREMES);
    if (m->extremes > 0u && r.status == PALP_OK)
        extreme = palp_reader_section(&r, PALP_SEC_TOOL_EXTREME, m->extremes, 3u * sizeof *extreme);
    for (uint32_t k = 0; extreme != NULL && k < 3u * m->extremes; k++) {
        const float from = extreme[k] - m->origin_m[k % 3u];
        palp_reader_require(&r, from >= 0.0f && from <= m->step_m * (float)(m->count[k % 3u] - 1u));
    }
    palp_reader_require(&r, m->extreme_off_m >= 0.0f && palp_is_finite(m->extreme_off_m));
    if (r.status != PALP_OK) return r.status;
    *field = (palp_tool_field){.sample = sample,
                               .count = {m->count[0], m->count[1], m->count[2]},
                               .origin_m = palp_vec3_at(m->origin_m),
                               .step_m = m->step_m,
                               .unit_m = m->unit_m,
                               .radius_m = m->radius_m,
                               .size_m = m->size_m,
                               .extreme = extreme,
                               .extremes = m->extremes,
                               .extreme_off_m = m->extreme_off_m};
    return PALP_OK;
}

palp_vec3 palp_tool_field_extreme(const palp_tool_field *f, palp_vec3 direction) {
    palp_vec3 outermost = {0.0f, 0.0f, 0.0f};
    float most = -1e30f;
    for (uint32_t k = 0; k < f->extremes; k++) {
        const palp_vec3 x = palp_vec3_at(f->extreme + 3u * (size_t)k);
        if (palp_dot(x, direction) <= most) continue;
        most = palp_dot(x, direction);
        outermost = x;
    }
    return outermost;
}

void palp_tool_field_box(const palp_tool_field *f, palp_vec3 *low_m, palp_vec3 *high_m) {
    const palp_vec3 size = {f->step_m * (float)(f->count[0] - 1u),
                            f->step_m * (float)(f->count[1] - 1u),
                            f->step_m * (float)(f->count[2] - 1u)};
    *low_m = f->origin_m;
    *high_m = palp_add(f->origin_m, size);
}

/* Weights of the three samples next to a place along one axis, with their slopes. */
typedef struct {
    uint32_t first;
    float weight[3], slope[3];
    float
        beyond_m; /* how far the place is beyond the grid, towards its end or (< 0) its beginning */
} axis_weights;

static axis_weights weights_at(float x_m, float origin_m, float step_m, uint32_t count) {
    const float last = (float)count - 1.5f, s = (x_m - origin_m) / step_m;
    const float within = palp_clamp(s, 0.5f, last);
    const uint32_t most = count - 2u, middle = (uint32_t)(within + 0.5f);
    axis_weights a = {.first = (middle < most ? middle : most) - 1u};
    const float t = within - (float)(a.first + 1u);
    a.weight[0] = 0.5f * (0.5f - t) * (0.5f - t);
    a.weight[1] = 0.75f - t * t;
    a.weight[2] = 0.5f * (0.5f + t) * (0.5f + t);
    a.beyond_m = step_m * (s - within);
    if (s >= 0.5f && s <= last) {
        a.slope[0] = t - 0.5f;
        a.slope[1] = -2.0f * t;
        a.slope[2] = t + 0.5f;
    }
    return a;
}

palp_tool_distance palp_tool_field_at(const palp_tool_field *f, palp_vec3 own) {
    const axis_weights x = weights_at(own.x, f->origin_m.x, f->step_m, f->count[0]);
    const axis_weights y = weights_at(own.y, f->origin_m.y, f->step_m, f->count[1]);
    const axis_weights z = weights_at(own.z, f->origin_m.z, f->step_m, f->count[2]);
    const size_t across = f->count[0], plane = across * f->count[1];
    const int16_t *first = f->sample + z.first * plane + y.first * across + x.first;
    float sum = 0.0f;
    palp_vec3 slope = {0.0f, 0.0f, 0.0f};
    for (uint32_t k = 0; k < 3u; k++) {
        float of_plane = 0.0f, along_x = 0.0f, along_y = 0.0f;
        for (uint32_t j = 0; j < 3u; j++) {
            const int16_t *c = first + k * plane + j * across;
            const float c0 = (float)c[0], c1 = (float)c[1], c2 = (float)c[2];
            const float row = x.weight[0] * c0 + x.weight[1] * c1 + x.weight[2] * c2;
            of_plane += y.weight[j] * row;
            along_y += y.slope[j] * row;
            along_x += y.weight[j] * (x.slope[0] * c0 + x.slope[1] * c1 + x.slope[2] * c2);
        }
        sum += z.weight[k] * of_plane;
        slope.x += z.weight[k] * along_x;
        slope.y += z.weight[k] * along_y;
        slope.z += z.slope[k] * of_plane;
    }
    palp_tool_distance d = {f->unit_m * sum - f->radius_m,
                            palp_scale(f->unit_m / f->step_m, slope)};
    const palp_vec3 beyond = {x.beyond_m, y.beyond_m, z.beyond_m};
    const float away = palp_norm(beyond);
    if (!(away > 0.0f)) return d;
    d.distance_m += away;
    d.slope = palp_madd(d.slope, 1.0f / away, beyond);
    return d;
}
