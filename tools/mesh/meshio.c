/* SPDX-License-Identifier: MIT */
/* Mesh files, by content and extension. */
#include "tools/mesh/builder.h"
#include "port/host/util.h"
#include "tools/mesh/meshmend.h"
#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

const char *skip_blanks(const char *p) {
    while (*p == ' ' || *p == '\t' || *p == '\r') p++;
    return p;
}

size_t text_normalise(char *text, size_t bytes) {
    while (bytes > 0 && text[bytes - 1] == '\0') bytes--;
    for (size_t i = 0; i < bytes; i++) {
        if (text[i] == '\r' && (i + 1 == bytes || text[i + 1] != '\n')) text[i] = '\n';
    }
    text[bytes] = '\0';
    return bytes;
}

/* The mark that some programs put before text in UTF-8. */
static size_t mark_of(const char *data, size_t bytes) {
    return bytes >= 3 && memcmp(data, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
}

/* Text in UTF-16 as bytes: what is read here is all below 128. Returns the length that is left. */
static size_t text_from_utf16(char *data, size_t bytes) {
    const bool big = memcmp(data, "\xfe\xff", 2) == 0;
    if (bytes < 4 || (!big && memcmp(data, "\xff\xfe", 2) != 0)) return bytes;
    size_t n = 0;
    for (size_t i = 2; i + 1 < bytes; i += 2)
        data[n++] = data[big ? i : i + 1] == 0 ? data[big ? i + 1 : i] : '?';
    data[n] = '\0';
    return n;
}

/* Whether there is no zero but at the end. */
static bool is_text(const char *data, size_t bytes) {
    while (bytes > 0 && data[bytes - 1] == '\0') bytes--;
    return memchr(data, '\0', bytes) == NULL;
}

static bool is_stl(const char *path, const char *data) {
    return has_extension(path, ".stl") || strncasecmp(skip_blanks(data), "solid", 5) == 0;
}

static void read_by_kind(builder *b, char *data, size_t bytes) {
    const char *path = b->path;
    if (strncmp(data, "ply", 3) == 0 && isspace((unsigned char)data[3])) {
        read_ply(b, data, bytes);
    } else if (is_stl(path, data)) {
        if (strncasecmp(skip_blanks(data), "solid", 5) == 0 && is_text(data, bytes))
            bytes = text_normalise(data, bytes);
        read_stl(b, data, bytes);
    } else if (has_extension(path, ".obj") || strcmp(path, "-") == 0) {
        if (!is_text(data, bytes)) die(EXIT_WORK, "%s: not a text file", path);
        (void)text_normalise(data, bytes);
        read_obj(b, data);
    } else if (has_extension(path, ".ply")) {
        die(EXIT_WORK, "%s: no PLY file: its first line is not 'ply'", path);
    } else {
        die(EXIT_USAGE, "%s: unknown mesh format: need .obj, .stl or .ply", path);
    }
}

mesh mesh_load(const char *path) {
    size_t bytes;
    char *data = read_file(path, &bytes);
    bytes = text_from_utf16(data, bytes);
    const size_t mark = mark_of(data, bytes);
    builder b = {.path = path};
    if (bytes == mark) die(EXIT_WORK, "%s: the file is empty", path);
    read_by_kind(&b, data + mark, bytes - mark);
    free(data);
    mesh m = builder_finish(&b);
    if (m.vertices == 0 || m.triangles == 0) die(EXIT_WORK, "%s: no triangles in the file", path);
    mesh_mend(&m, &b.mended);
    if (b.separate) b.mended.welded = 0; /* as in every such file */
    mesh_report_mended(path, &b.mended);
    return m;
}
