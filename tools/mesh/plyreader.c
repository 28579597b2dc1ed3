/* SPDX-License-Identifier: MIT */
/* PLY, text and binary of either byte order: vertex, face and tristrips, in any order. */
#include "tools/mesh/builder.h"
#include "port/host/util.h"
#include <ctype.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

typedef enum { PLY_TEXT, PLY_LITTLE, PLY_BIG } ply_format;
typedef enum { T_NONE, T_I8, T_U8, T_I16, T_U16, T_I32, T_U32, T_F32, T_F64 } ply_type;

typedef struct {
    ply_type count_type, type; /* count_type != T_NONE: a list */
    char name[32];
} ply_property;

typedef struct {
    char name[32];
    size_t count, properties;
    ply_property property[64];
} ply_element;

typedef struct {
    const char *path, *p, *end;
    ply_format format;
    const char *element, *property; /* that is being read, and the element's number from 1 */
    size_t item;
} ply_cursor;

static ply_type ply_type_of(const char *name) {
    static const struct {
        const char *name;
        ply_type type;
    } table[] = {{"char", T_I8},   {"int8", T_I8},     {"uchar", T_U8},   {"uint8", T_U8},
                 {"short", T_I16}, {"int16", T_I16},   {"ushort", T_U16}, {"uint16", T_U16},
                 {"int", T_I32},   {"int32", T_I32},   {"uint", T_U32},   {"uint32", T_U32},
                 {"float", T_F32}, {"float32", T_F32}, {"double", T_F64}, {"float64", T_F64}};
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        if (strcmp(name, table[i].name) == 0) return table[i].type;
    }
    return T_NONE;
}

static const char *skip_space(const char *p) {
    while (isspace((unsigned char)*p)) p++;
    return p;
}

static double ply_text_value(ply_cursor *c) {
    char *end;
    double v = strtod(c->p, &end);
    if (end == c->p)
        die(EXIT_WORK, "%s: %s %zu: %s should be a number, found '%.16s'", c->path, c->element,
            c->item, c->property,
            *skip_space(c->p) == '\0' ? "the end of the file" : skip_space(c->p));
    c->p = end;
    return v;
}

static double ply_binary_value(ply_cursor *c, ply_type type) {
    static const size_t size[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
    unsigned char raw[8] = {0};
    size_t n = size[type];
    if ((size_t)(c->end - c->p) < n)
        die(EXIT_WORK, "%s: the file ends inside %s %zu of those that the header counts", c->path,
            c->element, c->item);
    for (size_t i = 0; i < n; i++)
        raw[c->format == PLY_BIG ? n - 1 - i : i] = (unsigned char)c->p[i];
    c->p += n;
    int8_t i8;
    int16_t i16;
    uint16_t u16;
    int32_t i32;
    uint32_t u32;
    float f32;
    double f64;
    switch (type) {
    case T_I8:
        memcpy(&i8, raw, 1);
        return i8;
    case T_U8:
        return raw[0];
    case T_I16:
        memcpy(&i16, raw, 2);
        return i16;
    case T_U16:
        memcpy(&u16, raw, 2);
        return u16;
    case T_I32:
        memcpy(&i32, raw, 4);
        return i32;
    case T_U32:
        memcpy(&u32, raw, 4);
        return u32;
    case T_F32:
        memcpy(&f32, raw, 4);
        return (double)f32;
    case T_F64:
        memcpy(&f64, raw, 8);
        return f64;
    case T_NONE:
        break;
    }
    return 0;
}

static double ply_value(ply_cursor *c, ply_type type) {
    return c->format == PLY_TEXT ? ply_text_value(c) : ply_binary_value(c, type);
}

static int64_t ply_index(const builder *b, ply_cursor *c, ply_type type, size_t element) {
    const double v = ply_value(c, type);
    if (!(v >= -1 && v <= (double)UINT32_MAX))
        die(EXIT_WORK, "%s: face %zu: no vertex has the number %g", b->path, element, v);
    return (int64_t)v;
}

static void ply_face(builder *b, ply_cursor *c, const ply_property *p, size_t element) {
    const double n = ply_value(c, p->count_type);
    if (!(n >= 0 && n <= (double)UINT32_MAX))
        die(EXIT_WORK, "%s: face %zu has %g corners", b->path, element, n);
    builder_face(b, element);
    for (size_t k = 0; k < (size_t)n; k++) builder_corner(b, ply_index(b, c, p->type, element));
}

/* A strip of triangles, each turned against the one before; -1 begins a new one. */
static void ply_strip(builder *b, ply_cursor *c, const ply_property *p, size_t element) {
    const double n = ply_value(c, p->count_type);
    int64_t last[2] = {-1, -1};
    size_t length = 0;
    for (double k = 0; k < n; k++) {
        const int64_t v = ply_index(b, c, p->type, element);
        if (v < 0) {
            length = 0;
            continue;
        }
        if (length >= 2) {
            const int odd = (int)(length % 2);
            builder_face(b, element);
            builder_corner(b, last[odd]);
            builder_corner(b, last[1 - odd]);
            builder_corner(b, v);
        }
        last[0] = length >= 1 ? last[1] : last[0];
        last[1] = v;
        length++;
    }
}

static bool names_corners(const char *property) {
    return strcmp(property, "vertex_indices") == 0 || strcmp(property, "vertex_index") == 0;
}

static void ply_item(builder *b, ply_cursor *c, const ply_element *e, size_t item) {
    double x[3] = {0};
    bool vertex = strcmp(e->name, "vertex") == 0;
    bool face = strcmp(e->name, "face") == 0, strips = strcmp(e->name, "tristrips") == 0;
    for (size_t k = 0; k < e->properties; k++) {
        const ply_property *p = &e->property[k];
        const bool corners = names_corners(p->name);
        c->element = e->name;
        c->property = p->name;
        c->item = item + 1;
        if (p->count_type != T_NONE && face && corners) {
            ply_face(b, c, p, item + 1);
        } else if (p->count_type != T_NONE && strips && corners) {
            ply_strip(b, c, p, item + 1);
        } else if (p->count_type != T_NONE) {
            for (double n = ply_value(c, p->count_type); n > 0; n--) (void)ply_value(c, p->type);
        } else {
            double v = ply_value(c, p->type);
            bool axis = p->name[1] == '\0' && p->name[0] >= 'x' && p->name[0] <= 'z';
            if (vertex && axis) x[p->name[0] - 'x'] = v;
        }
    }
    if (vertex) builder_vertex(b, x, item + 1);
}

/* One header line, split into at most five words; returns how many, or -1 at the end of the file. A
 * line ends in '\n', '\r' or both; behind the last one data follow at once. */
static int ply_words(ply_cursor *c, char word[5][32]) {
    const char *line_end = c->p;
    while (line_end < c->end && *line_end != '\n' && *line_end != '\r') line_end++;
    if (line_end == c->end) return -1;
    int n = 0;
    while (c->p < line_end && n < 5) {
        while (c->p < line_end && isspace((unsigned char)*c->p)) c->p++;
        size_t k = 0;
        for (; c->p < line_end && !isspace((unsigned char)*c->p); c->p++) {
            if (k + 1 < sizeof word[0]) word[n][k++] = *c->p;
        }
        word[n][k] = '\0';
        if (k > 0) n++;
    }
    const bool both = line_end + 1 < c->end && line_end[0] == '\r' && line_end[1] == '\n';
    c->p = line_end + (both ? 2 : 1);
    return n;
}

static void ply_property_line(builder *b, ply_element *e, char word[5][32], int n) {
    bool list = n == 5 && strcmp(word[1], "list") == 0;
    if (e == NULL || e->properties == 64 || (n != 3 && !list)) {
        die(EXIT_WORK, "%s: malformed property in the PLY header", b->path);
    }
    ply_property *p = &e->property[e->properties++];
    p->count_type = list ? ply_type_of(word[2]) : T_NONE;
    p->type = ply_type_of(word[list ? 3 : 1]);
    memcpy(p->name, word[list ? 4 : 2], sizeof p->name);
    if (list && names_corners(p->name) && strcmp(e->name, "vertex") == 0)
        die(EXIT_WORK,
            "%s: the header lists %s among the properties of vertices: a line 'element face N' is "
            "missing before it",
            b->path, p->name);
    if (p->type == T_NONE || (list && p->count_type == T_NONE)) {
        die(EXIT_WORK, "%s: unknown type of property '%s' in the PLY header", b->path, p->name);
    }
}

void read_ply(builder *b, const char *data, size_t bytes) {
    static ply_element element[16];
    size_t elements = 0;
    ply_cursor c = {.path = b->path, .p = data, .end = data + bytes};
    char word[5][32];
    memset(element, 0, sizeof element);
    for (;;) {
        int n = ply_words(&c, word);
        if (n < 0) die(EXIT_WORK, "%s: the PLY header has no end", b->path);
        if (n >= 1 && strcmp(word[0], "end_header") == 0) break;
        if (n >= 2 && strcmp(word[0], "format") == 0) {
            c.format = strcmp(word[1], "ascii") == 0               ? PLY_TEXT
                       : strcmp(word[1], "binary_big_endian") == 0 ? PLY_BIG
                                                                   : PLY_LITTLE;
        } else if (n == 3 && strcmp(word[0], "element") == 0 && elements < 16) {
            ply_element *e = &element[elements++];
            memcpy(e->name, word[1], sizeof e->name);
            e->count = strtoul(word[2], NULL, 10);
        } else if (n >= 1 && strcmp(word[0], "property") == 0) {
            ply_property_line(b, elements > 0 ? &element[elements - 1] : NULL, word, n);
        }
    }
    for (size_t e = 0; e < elements; e++) {
        if (element[e].properties == 0) continue;
        for (size_t i = 0; i < element[e].count; i++) ply_item(b, &c, &element[e], i);
    }
}
