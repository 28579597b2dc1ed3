/* SPDX-License-Identifier: MIT */
#include "port/host/toolfile.h"
#include "core/base/crc32c.h"
#include "port/host/util.h"
#include <inttypes.h>

tool_file tool_load(const char *path) {
    size_t bytes;
    const char *data = read_file(path, &bytes);
    tool_file t = {.tool = {.shape = PALP_TOOL_FIELD},
                   .data = data,
                   .bytes = (uint32_t)bytes,
                   .crc = palp_crc32c(0, data, bytes)};
    const palp_status status = palp_tool_field_open(&t.tool.field, data, bytes);
    if (status == PALP_ERR_ABSENT)
        die(EXIT_WORK, "%s: a blob, but not a tool: palp tool makes one of a mesh", path);
    if (status == PALP_ERR_MAGIC)
        die(EXIT_WORK, "%s: not a tool: make one of a mesh first: palp tool MESH -o OUT.tool",
            path);
    if (status != PALP_OK)
        die(EXIT_WORK, "%s: %s: bake it again with palp tool", path, palp_status_text(status));
    return t;
}

void tool_text(const palp_tool *t, char *text, size_t size) {
    palp_vec3 low, high;
    switch (t->shape) {
    case PALP_TOOL_FIELD:
        palp_tool_field_box(&t->field, &low, &high);
        snprintf(text, size, "a tool within %.3g x %.3g x %.3g cm", 100 * (double)(high.x - low.x),
                 100 * (double)(high.y - low.y), 100 * (double)(high.z - low.z));
        return;
    case PALP_TOOL_CYLINDER:
        snprintf(text, size, "a cylinder of %.4g m radius", (double)t->cylinder.radius_m);
        return;
    case PALP_TOOL_PAD:
        snprintf(text, size, "a pad of %.4g x %.4g m", 2 * (double)t->pad.half_m[0],
                 2 * (double)t->pad.half_m[1]);
        return;
    default:
        snprintf(text, size, "tool radius %.4g m", (double)t->ball[0].radius_m);
    }
}

/* Columns x, y, z of a turn. */
static tool_look looking(float radius_m, float half_m, palp_vec3 x, palp_vec3 y, palp_vec3 z) {
    return (tool_look){radius_m, half_m, {x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z}};
}

static tool_look along(float radius_m, float half_m, palp_vec3 axis) {
    palp_vec3 side[2];
    palp_tangents(axis, side);
    return looking(radius_m, half_m, side[0], side[1], axis);
}

tool_look tool_look_of(const palp_tool *t) {
    const palp_vec3 z = {0.0f, 0.0f, 1.0f};
    if (t->shape == PALP_TOOL_PAD)
        return looking(t->pad.half_m[0], t->pad.half_m[1], t->pad.axis[0],
                       palp_scale(-1.0f, t->pad.axis[1]), palp_scale(-1.0f, t->pad.axis[2]));
    if (t->shape == PALP_TOOL_CYLINDER)
        return along(t->cylinder.radius_m, t->cylinder.half_m, t->cylinder.axis);
    if (t->shape == PALP_TOOL_FIELD) return along(palp_tool_size(t), 0.0f, z);
    const palp_vec3 end = t->ball[t->balls - 1u].center_m;
    const float half = palp_norm(end);
    return along(t->ball[0].radius_m, half, half > 0.0f ? palp_scale(1.0f / half, end) : z);
}
