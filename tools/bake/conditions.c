/* SPDX-License-Identifier: MIT */
#include "tools/bake/conditions.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* Cuts the line at its commas; returns the number of fields. */
static int split_fields(char *line, char *field[6]) {
    int n = 0;
    for (char *p = line; n < 6; n++) {
        p += strspn(p, " \t");
        field[n] = p;
        char *comma = strchr(p, ',');
        char *end = comma != NULL ? comma : p + strlen(p);
        p = end;
        while (end > field[n] && (end[-1] == ' ' || end[-1] == '\t' || end[-1] == '\r')) end--;
        bool last = comma == NULL;
        *end = '\0';
        if (last) return n + 1;
        p = comma + 1;
    }
    return n + 1;
}

static condition_line parse_condition(const char *path, size_t line, char *field[6], int fields,
                                      uint32_t nodes, node_finder find, const void *context) {
    static const struct {
        const char *name;
        palp_condition condition;
        int values;
    } kinds[] = {{"u", PALP_PRESCRIBE_DISPLACEMENT, 3},
                 {"n", PALP_PRESCRIBE_NORMAL, 1},
                 {"f", PALP_PRESCRIBE_FORCE, 3},
                 {"p", PALP_PRESCRIBE_TRACTION, 3},
                 {"free", PALP_RELEASE, 0}};
    condition_line c = {.line = line};
    if (fields < 2 || fields > 5)
        die(EXIT_USAGE, "%s:%zu: need the fields node,kind,x,y,z", path, line);
    bool found = find != NULL ? find(context, field[0], &c.node) : parse_u32(field[0], &c.node);
    if (!found || c.node >= nodes) {
        die(EXIT_USAGE, "%s:%zu: '%s' is not a node from 0 to %" PRIu32, path, line, field[0],
            nodes - 1);
    }
    for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; k++) {
        if (strcmp(field[1], kinds[k].name) != 0) continue;
        float value[3] = {0};
        for (int i = 0; i < kinds[k].values; i++) {
            double v;
            if (i + 2 >= fields || !parse_double(field[i + 2], &v)) {
                die(EXIT_USAGE, "%s:%zu: kind '%s' needs %d finite number(s)", path, line, field[1],
                    kinds[k].values);
            }
            value[i] = (float)v;
        }
        for (int i = kinds[k].values + 2; i < fields; i++) {
            if (field[i][0] != '\0')
                die(EXIT_USAGE, "%s:%zu: kind '%s' takes no more values", path, line, field[1]);
        }
        c.condition = kinds[k].condition;
        c.value = (palp_vec3){value[0], value[1], value[2]};
        return c;
    }
    die(EXIT_USAGE, "%s:%zu: unknown kind '%s' (u, n, f, p or free)", path, line, field[1]);
}

condition_line *read_conditions(const char *path, uint32_t nodes, node_finder find,
                                const void *context, size_t *count) {
    size_t bytes, capacity = 0, number = 0;
    char *text = read_file(path, &bytes);
    bool marked = strncmp(text, "\xef\xbb\xbf", 3) == 0; /* byte order mark of some spreadsheets */
    condition_line *list = NULL;
    bool header = false;
    *count = 0;
    for (char *line = text + (marked ? 3 : 0); line != NULL;) {
        char *next = strchr(line, '\n');
        if (next != NULL) *next++ = '\0';
        number++;
        line[strcspn(line, "\r")] = '\0';
        if (line[strspn(line, " \t")] != '\0' && line[0] != '#') {
            char *field[6];
            int fields = split_fields(line, field);
            if (!header) {
                if (strcmp(field[0], "node") != 0)
                    die(EXIT_USAGE, "%s:%zu: the header must be node,kind,x,y,z", path, number);
                header = true;
            } else {
                list = grow(list, &capacity, *count + 1, sizeof *list);
                list[(*count)++] =
                    parse_condition(path, number, field, fields, nodes, find, context);
            }
        }
        line = next;
    }
    if (!header) die(EXIT_USAGE, "%s: empty: need the header node,kind,x,y,z", path);
    free(text);
    return list;
}
