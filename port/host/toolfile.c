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
