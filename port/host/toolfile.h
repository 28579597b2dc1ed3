/* SPDX-License-Identifier: MIT */
/* Tools as people name them: a ball by its radius, or a file that `palp tool` has made. */
#ifndef PALP_HOST_TOOLFILE_H
#define PALP_HOST_TOOLFILE_H

#include "core/contact/tool.h"
#include <stddef.h>

typedef struct {
    palp_tool tool;
    const void *data;
    uint32_t bytes, crc; /* of the file; 0: not from a file */
} tool_file;

/* Opens a tool; its bytes stay for the life of the program. Exits with what is wrong, and what to do. */
tool_file tool_load(const char *path);

/* What a tool looks like: a shape about z, as wide and as long, and how that lies in the tool (row-major). Of balls a capsule or a
 * ball, of a pad half extents along x and y with its face at z = 0 looking along -z, of a field the largest ball inside. */
typedef struct {
    float radius_m, half_m, turn[9];
} tool_look;
tool_look tool_look_of(const palp_tool *tool);

/* In words, for what a program says of itself. */
void tool_text(const palp_tool *tool, char *text, size_t size);

#endif
