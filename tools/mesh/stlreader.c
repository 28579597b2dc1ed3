/* SPDX-License-Identifier: MIT */
/* STL, binary and text: three vertices for each triangle. */
#include "tools/mesh/builder.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define HEADER 84   /* of a binary file, the count of triangles at its end */
#define TRIANGLE 50 /* bytes: normal, three vertices, two bytes */

static void add_corner(builder *b, const double x[3], size_t line) {
    if (b->vertices % 3 == 0) builder_face(b, line);
    builder_corner(b, (int64_t)b->vertices);
    builder_vertex(b, x, line);
}

static void read_binary(builder *b, const char *data, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const char *p = data + HEADER + TRIANGLE * i + 12;
        for (int c = 0; c < 3; c++) {
            float f[3];
            memcpy(f, p + 12 * c, sizeof f);
            const double x[3] = {(double)f[0], (double)f[1], (double)f[2]};
            add_corner(b, x, i + 1);
        }
    }
}

/* Whether a line begins with a word, in capitals or not; *rest: what follows it. */
static bool begins(const char *p, const char *word, const char **rest) {
    const size_t n = strlen(word);
    if (strncasecmp(p, word, n) != 0) return false;
    *rest = skip_blanks(p + n);
    return true;
}

static void read_text(builder *b, const char *text) {
    size_t line = 0;
    bool ended = false;
    for (const char *p = text; *p != '\0';) {
        const char *q = skip_blanks(p), *rest;
        line++;
        if (begins(q, "endsolid", &rest) ||
            (begins(q, "end", &rest) && begins(rest, "solid", &rest)))
            ended = true;
        if (begins(q, "vertex", &rest)) {
            double x[3];
            for (int k = 0; k < 3; k++) {
                char *end;
                x[k] = strtod(rest, &end);
                if (end == rest)
                    die(EXIT_WORK, "%s:%zu: a vertex needs three numbers", b->path, line);
                rest = end;
            }
            add_corner(b, x, line);
        }
        p = strchr(p, '\n');
        if (p == NULL) break;
        p++;
    }
    if (!ended || b->vertices % 3 != 0)
        die(EXIT_WORK, "%s:%zu: the file ends inside a solid", b->path, line);
}

/* A binary file whose size does not say the same as its count: the size is believed where it holds
 * whole triangles, and what lies behind the last is passed over. */
static size_t count_of(const char *path, uint32_t says, size_t bytes) {
    const size_t holds = (bytes - HEADER) / TRIANGLE, left = (bytes - HEADER) % TRIANGLE;
    if (holds < says && (says != UINT32_MAX || left > 0)) /* which stands for "not known" */
        die(EXIT_WORK, "%s: binary STL with %" PRIu32 " triangles needs %zu bytes, has %zu", path,
            says, HEADER + TRIANGLE * (size_t)says, bytes);
    if (left == 0 && holds != says) {
        warn("%s: the header says %" PRIu32 " triangles, the file holds %zu: these are read", path,
             says, holds);
        return holds;
    }
    if (bytes > HEADER + TRIANGLE * (size_t)says)
        warn("%s: %zu bytes behind the last of %" PRIu32 " triangles are passed over", path,
             bytes - HEADER - TRIANGLE * (size_t)says, says);
    return says;
}

void read_stl(builder *b, const char *data, size_t bytes) {
    b->separate = true;
    uint32_t says = 0;
    if (bytes >= HEADER) memcpy(&says, data + 80, sizeof says);
    const bool exact = bytes >= HEADER && bytes == HEADER + TRIANGLE * (size_t)says;
    const char *rest;
    if (!exact && begins(skip_blanks(data), "solid", &rest) && memchr(data, '\0', bytes) == NULL) {
        read_text(b, data);
        return;
    }
    if (bytes < HEADER)
        die(EXIT_WORK,
            "%s: no STL file: it neither begins with 'solid' nor has the %d bytes of a binary "
            "header",
            b->path, HEADER);
    read_binary(b, data, count_of(b->path, says, bytes));
}
