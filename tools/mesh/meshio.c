/* SPDX-License-Identifier: MIT */
/* Readers of OBJ, STL (binary and text) and PLY (binary and text). */
#include "tools/mesh/mesh.h"
#include "port/host/util.h"
#include <ctype.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define MAX_CORNERS 256

/* A mesh that grows while a file is read. */
typedef struct {
    const char *path;
    mesh m;
    size_t vertex_capacity, triangle_capacity;
} builder;

static void add_vertex(builder *b, const double x[3], size_t line) {
    for (int k = 0; k < 3; k++) {
        if (!isfinite(x[k])) {
            die(EXIT_WORK, "%s:%zu: coordinate %d of vertex %" PRIu32 " is not a finite number",
                b->path, line, k + 1, b->m.vertices);
        }
    }
    b->m.x = grow(b->m.x, &b->vertex_capacity, b->m.vertices + 1, sizeof *b->m.x);
    memcpy(b->m.x[b->m.vertices++], x, 3 * sizeof *x);
}

static void add_triangle(builder *b, uint32_t p, uint32_t q, uint32_t r) {
    b->m.t = grow(b->m.t, &b->triangle_capacity, b->m.triangles + 1, sizeof *b->m.t);
    uint32_t *t = b->m.t[b->m.triangles++];
    t[0] = p;
    t[1] = q;
    t[2] = r;
}

/* Newell's normal of a polygon. */
static void polygon_normal(const mesh *m, const uint32_t *corner, size_t n, double normal[3]) {
    memset(normal, 0, 3 * sizeof *normal);
    for (size_t i = 0; i < n; i++) {
        double c[3];
        v_cross(m->x[corner[i]], m->x[corner[(i + 1) % n]], c);
        for (int k = 0; k < 3; k++) normal[k] += c[k];
    }
}

static bool is_ear(const mesh *m, const uint32_t *corner, size_t n, size_t i,
                   const double normal[3]) {
    const double *a = m->x[corner[(i + n - 1) % n]];
    const double *b = m->x[corner[i]];
    const double *c = m->x[corner[(i + 1) % n]];
    double turn[3];
    triangle_normal(a, b, c, turn);
    if (v_dot(turn, normal) <= 0) return false;
    for (size_t k = 0; k < n; k++) {
        if (k == i || k == (i + 1) % n || k == (i + n - 1) % n) continue;
        double s[3][3];
        triangle_normal(a, b, m->x[corner[k]], s[0]);
        triangle_normal(b, c, m->x[corner[k]], s[1]);
        triangle_normal(c, a, m->x[corner[k]], s[2]);
        if (v_dot(s[0], normal) >= 0 && v_dot(s[1], normal) >= 0 && v_dot(s[2], normal) >= 0)
            return false;
    }
    return true;
}

/* Ear clipping, so that concave polygons keep their shape; convex ones become fans. */
static void add_polygon(builder *b, uint32_t *corner, size_t n) {
    double normal[3];
    polygon_normal(&b->m, corner, n, normal);
    while (n > 3) {
        size_t ear = 0;
        while (ear < n && !is_ear(&b->m, corner, n, ear, normal)) ear++;
        if (ear == n) ear = 0;
        add_triangle(b, corner[(ear + n - 1) % n], corner[ear], corner[(ear + 1) % n]);
        memmove(corner + ear, corner + ear + 1, (n - ear - 1) * sizeof *corner);
        n--;
    }
    if (n == 3) add_triangle(b, corner[0], corner[1], corner[2]);
}

/* ---- OBJ ---- */

static const char *skip_blanks(const char *p) {
    while (*p == ' ' || *p == '\t' || *p == '\r') p++;
    return p;
}

static void obj_vertex(builder *b, const char *p, size_t line) {
    double x[3];
    for (int k = 0; k < 3; k++) {
        char *end;
        p = skip_blanks(p);
        bool line_over = *p == '\n' || *p == '\0';
        x[k] = line_over ? 0 : strtod(p, &end);
        if (line_over || end == p)
            die(EXIT_WORK, "%s:%zu: a vertex needs three numbers", b->path, line);
        p = end;
    }
    add_vertex(b, x, line);
}

static void obj_face(builder *b, const char *p, size_t line, uint32_t so_far) {
    uint32_t corner[MAX_CORNERS];
    size_t n = 0;
    for (p = skip_blanks(p); *p != '\n' && *p != '\0' && *p != '#'; p = skip_blanks(p)) {
        char *end;
        long index = strtol(p, &end, 10);
        if (end == p)
            die(EXIT_WORK, "%s:%zu: a face needs vertex numbers, found '%.12s'", b->path, line, p);
        long absolute = index < 0 ? (long)so_far + index : index - 1;
        if (index == 0 || absolute < 0 || absolute >= (long)b->m.vertices) {
            die(EXIT_WORK, "%s:%zu: vertex %ld is out of range (%" PRIu32 " vertices)", b->path,
                line, index, b->m.vertices);
        }
        if (n == MAX_CORNERS)
            die(EXIT_WORK, "%s:%zu: more than %d corners", b->path, line, MAX_CORNERS);
        corner[n++] = (uint32_t)absolute;
        p = end;
        while (*p != '\0' && !isspace((unsigned char)*p)) p++; /* /vt/vn */
    }
    if (n < 3) die(EXIT_WORK, "%s:%zu: a face needs at least three corners", b->path, line);
    add_polygon(b, corner, n);
}

/* Faces may name vertices that follow, so vertices are read first; negative numbers count from the
 * face's own line. */
static void read_obj(builder *b, const char *text) {
    for (int pass = 0; pass < 2; pass++) {
        size_t line = 0;
        uint32_t so_far = 0;
        for (const char *p = text; *p != '\0';) {
            line++;
            const char *q = skip_blanks(p);
            bool blank_next = q[0] != '\0' && (q[1] == ' ' || q[1] == '\t');
            if (*q == 'v' && blank_next) so_far++;
            if (pass == 0 && *q == 'v' && blank_next) obj_vertex(b, q + 1, line);
            if (pass == 1 && *q == 'f' && blank_next) obj_face(b, q + 1, line, so_far);
            p = strchr(p, '\n');
            if (p == NULL) break;
            p++;
        }
    }
}

/* ---- STL ---- */

typedef struct {
    double x[3];
    uint32_t order;
} welding;

static int compare_welding(const void *a, const void *b) {
    const welding *p = a;
    const welding *q = b;
    for (int k = 0; k < 3; k++) {
        if (p->x[k] < q->x[k]) return -1;
        if (p->x[k] > q->x[k]) return 1;
    }
    return p->order < q->order ? -1 : p->order > q->order;
}

static bool same_point(const double a[3], const double b[3]) {
    for (int k = 0; k < 3; k++) {
        if (a[k] < b[k] || a[k] > b[k]) return false;
    }
    return true;
}

/* Merges corners with equal coordinates, numbered by first appearance; drops triangles that vanish.
 */
static void weld(builder *b) {
    mesh *m = &b->m;
    uint32_t n = m->vertices;
    welding *w = allocate(n, sizeof *w);
    uint32_t *first = allocate(n, sizeof *first);
    for (uint32_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++) w[i].x[k] = m->x[i][k] + 0.0; /* -0 and 0 are one point */
        w[i].order = i;
    }
    qsort(w, n, sizeof *w, compare_welding);
    for (uint32_t i = 0, run = 0; i < n; i++) {
        if (!same_point(w[i].x, w[run].x)) run = i;
        first[w[i].order] = w[run].order;
    }
    uint32_t *number = allocate(n, sizeof *number);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < n; i++) {
        if (first[i] != i) continue;
        memcpy(m->x[kept], m->x[i], sizeof m->x[i]);
        number[i] = kept++;
    }
    uint32_t triangles = 0;
    for (uint32_t i = 0; i < m->triangles; i++) {
        uint32_t t[3];
        for (int k = 0; k < 3; k++) t[k] = number[first[m->t[i][k]]];
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
        memcpy(m->t[triangles++], t, sizeof t);
    }
    m->vertices = kept;
    m->triangles = triangles;
    free(number);
    free(first);
    free(w);
}

static void add_corner(builder *b, const double x[3], size_t line) {
    add_vertex(b, x, line);
    if (b->m.vertices % 3 == 0) {
        add_triangle(b, b->m.vertices - 3, b->m.vertices - 2, b->m.vertices - 1);
    }
}

static void read_stl_binary(builder *b, const char *data, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        const char *p = data + 84 + 50 * (size_t)i + 12;
        for (int c = 0; c < 3; c++) {
            float f[3];
            memcpy(f, p + 12 * c, sizeof f);
            const double x[3] = {(double)f[0], (double)f[1], (double)f[2]};
            add_corner(b, x, i + 1);
        }
    }
}

static void read_stl_text(builder *b, const char *text) {
    size_t line = 0;
    bool ended = false;
    for (const char *p = text; *p != '\0';) {
        line++;
        const char *q = skip_blanks(p);
        if (strncmp(q, "endsolid", 8) == 0) ended = true;
        if (strncmp(q, "vertex", 6) == 0) {
            double x[3];
            char *end;
            q += 6;
            for (int k = 0; k < 3; k++) {
                x[k] = strtod(q, &end);
                if (end == q) die(EXIT_WORK, "%s:%zu: a vertex needs three numbers", b->path, line);
                q = end;
            }
            add_corner(b, x, line);
        }
        p = strchr(p, '\n');
        if (p == NULL) break;
        p++;
    }
    if (!ended || b->m.vertices % 3 != 0)
        die(EXIT_WORK, "%s:%zu: the file ends inside a solid", b->path, line);
}

static void read_stl(builder *b, const char *data, size_t bytes) {
    uint32_t count = 0;
    if (bytes >= 84) memcpy(&count, data + 80, sizeof count);
    bool exact = bytes >= 84 && bytes == 84 + 50 * (size_t)count;
    if (exact) {
        read_stl_binary(b, data, count);
    } else if (strncmp(skip_blanks(data), "solid", 5) == 0 && memchr(data, '\0', bytes) == NULL) {
        read_stl_text(b, data);
    } else {
        if (bytes < 84)
            die(EXIT_WORK,
                "%s: no STL file: it neither begins with 'solid' nor has the 84 bytes of a binary "
                "header",
                b->path);
        die(EXIT_WORK, "%s: binary STL with %" PRIu32 " triangles needs %zu bytes, has %zu",
            b->path, count, 84 + 50 * (size_t)count, bytes);
    }
    weld(b);
}

/* ---- PLY ---- */

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

static double ply_text_value(ply_cursor *c) {
    char *end;
    double v = strtod(c->p, &end);
    if (end == c->p)
        die(EXIT_WORK, "%s: the file ends, or holds no number, at '%.16s'", c->path, c->p);
    c->p = end;
    return v;
}

static double ply_binary_value(ply_cursor *c, ply_type type) {
    static const size_t size[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
    unsigned char raw[8] = {0};
    size_t n = size[type];
    if ((size_t)(c->end - c->p) < n) die(EXIT_WORK, "%s: the file is truncated", c->path);
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

static void ply_face(builder *b, ply_cursor *c, const ply_property *p, size_t element) {
    uint32_t corner[MAX_CORNERS];
    double n = ply_value(c, p->count_type);
    if (!(n >= 0 && n <= MAX_CORNERS))
        die(EXIT_WORK, "%s: face %zu has %g corners", b->path, element, n);
    for (size_t k = 0; k < (size_t)n; k++) {
        double v = ply_value(c, p->type);
        if (!(v >= 0 && v < (double)b->m.vertices)) {
            die(EXIT_WORK, "%s: face %zu: vertex %g is out of range (%" PRIu32 " vertices)",
                b->path, element, v, b->m.vertices);
        }
        corner[k] = (uint32_t)v;
    }
    if (n < 3) die(EXIT_WORK, "%s: face %zu has fewer than three corners", b->path, element);
    add_polygon(b, corner, (size_t)n);
}

static void ply_item(builder *b, ply_cursor *c, const ply_element *e, size_t item) {
    double x[3] = {0};
    bool vertex = strcmp(e->name, "vertex") == 0;
    bool face = strcmp(e->name, "face") == 0;
    for (size_t k = 0; k < e->properties; k++) {
        const ply_property *p = &e->property[k];
        bool corners =
            strcmp(p->name, "vertex_indices") == 0 || strcmp(p->name, "vertex_index") == 0;
        if (p->count_type != T_NONE && face && corners) {
            ply_face(b, c, p, item);
        } else if (p->count_type != T_NONE) {
            for (double n = ply_value(c, p->count_type); n > 0; n--) (void)ply_value(c, p->type);
        } else {
            double v = ply_value(c, p->type);
            bool axis = p->name[1] == '\0' && p->name[0] >= 'x' && p->name[0] <= 'z';
            if (vertex && axis) x[p->name[0] - 'x'] = v;
        }
    }
    if (vertex) add_vertex(b, x, item + 1);
}

/* One header line, split into at most five words; returns how many, or -1 at the end of the file.
 */
static int ply_words(ply_cursor *c, char word[5][32]) {
    const char *line_end = memchr(c->p, '\n', (size_t)(c->end - c->p));
    if (line_end == NULL) return -1;
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
    c->p = line_end + 1;
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
    if (p->type == T_NONE || (list && p->count_type == T_NONE)) {
        die(EXIT_WORK, "%s: unknown type of property '%s' in the PLY header", b->path, p->name);
    }
}

static void read_ply(builder *b, const char *data, size_t bytes) {
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

/* ---- */

mesh mesh_load(const char *path) {
    size_t bytes;
    char *data = read_file(path, &bytes);
    builder b = {.path = path};
    if (bytes == 0) die(EXIT_WORK, "%s: the file is empty", path);
    if (strncmp(data, "ply", 3) == 0 && isspace((unsigned char)data[3])) {
        read_ply(&b, data, bytes);
    } else if (has_extension(path, ".stl") || strncmp(data, "solid", 5) == 0) {
        read_stl(&b, data, bytes);
    } else if (has_extension(path, ".obj") || strcmp(path, "-") == 0) {
        if (memchr(data, '\0', bytes) != NULL) die(EXIT_WORK, "%s: not a text file", path);
        read_obj(&b, data);
    } else if (has_extension(path, ".ply")) {
        die(EXIT_WORK, "%s: no PLY file: its first line is not 'ply'", path);
    } else {
        die(EXIT_USAGE, "%s: unknown mesh format: need .obj, .stl or .ply", path);
    }
    free(data);
    if (b.m.vertices == 0 || b.m.triangles == 0)
        die(EXIT_WORK, "%s: no triangles in the file", path);
    return b.m;
}
