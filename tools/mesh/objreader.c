/* SPDX-License-Identifier: MIT */
/* Wavefront OBJ: v and f; everything else is passed over. */
#include "tools/mesh/builder.h"
#include "port/host/util.h"
#include <ctype.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* One statement, which a backslash at the end of a line, blanks behind it or not, takes on to the
 * next; the backslash is a blank. Returns where the next one begins, and adds the lines. */
typedef struct {
    char *text;
    size_t capacity;
} statement;

static const char *next_statement(const char *p, statement *s, size_t *lines) {
    size_t n = 0;
    for (; *p != '\0'; p++) {
        char c = *p;
        if (c == '\\') {
            const char *q = skip_blanks(p + 1);
            if (*q == '\n') {
                p = q;
                c = ' ';
                (*lines)++;
            }
        } else if (c == '\n') {
            (*lines)++;
            p++;
            break;
        }
        s->text = grow(s->text, &s->capacity, n + 2, 1);
        s->text[n++] = c;
    }
    s->text = grow(s->text, &s->capacity, n + 1, 1);
    s->text[n] = '\0';
    return p;
}

static void read_vertex(builder *b, const char *p, size_t line) {
    double x[3];
    for (int k = 0; k < 3; k++) {
        char *end = NULL;
        p = skip_blanks(p);
        x[k] = *p == '\0' ? 0 : strtod(p, &end);
        if (*p == '\0' || end == p)
            die(EXIT_WORK, "%s:%zu: a vertex needs three numbers", b->path, line);
        p = end;
    }
    builder_vertex(b, x, line);
}

/* Negative numbers count back from the last vertex so far. */
static void read_face(builder *b, const char *p, size_t line) {
    builder_face(b, line);
    for (p = skip_blanks(p); *p != '\0' && *p != '#'; p = skip_blanks(p)) {
        char *end;
        const long long index = strtoll(p, &end, 10);
        if (end == p)
            die(EXIT_WORK, "%s:%zu: a face needs vertex numbers, found '%.12s'", b->path, line, p);
        builder_corner(b, index < 0 ? (int64_t)b->vertices + index : index - 1);
        p = end;
        while (*p != '\0' && !isspace((unsigned char)*p)) p++; /* /vt/vn */
    }
}

void read_obj(builder *b, const char *text) {
    b->first_number = 1;
    statement s = {.text = NULL};
    size_t line = 1;
    for (const char *p = text; *p != '\0';) {
        size_t lines = 0;
        p = next_statement(p, &s, &lines);
        const char *q = skip_blanks(s.text);
        const bool blank_next = q[0] != '\0' && (q[1] == ' ' || q[1] == '\t');
        if (*q == 'v' && blank_next) read_vertex(b, q + 1, line);
        if (*q == 'f' && blank_next) read_face(b, q + 1, line);
        line += lines;
    }
    free(s.text);
}
