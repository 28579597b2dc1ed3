/* SPDX-License-Identifier: MIT */
#include "args.h"
#include "commands.h"
#include "core/green/cma.h"
#include "util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp solve BLOB --set IN.csv [-o OUT.csv] [--level L|finest|auto] [--gravity X Y Z]\n"
    "\n"
    "Solves one boundary value problem. IN.csv has the header node,kind,x,y,z and a line per "
    "condition:\n"
    "  17,u,0.001,0,0     displacement (m), all components\n"
    "  18,n,0.001,,       displacement along the outward normal (m), no tangential traction\n"
    "  40,f,0,0,-0.5      nodal force (N)\n"
    "  41,p,0,0,-100      traction (Pa)\n"
    "  55,free,,,         a fixed node released\n"
    "OUT.csv (default: standard output) gets node,ux,uy,uz,fx,fy,fz for every node.\n"
    "--gravity takes an acceleration in m/s^2.\n"
    "--level imposes displacements on a coarser constraint level, in the mean under each hat, or\n"
    "with --pairing collocated at its node.\n";

static const option options[] = {{"--set", 1},     {"-o", 1},        {"--level", 1},
                                 {"--pairing", 1}, {"--gravity", 3}, {NULL, 0}};

typedef struct {
    const char *blob, *set, *output, *level, *level_where;
    palp_vec3 gravity;
    bool gravity_given;
    palp_pairing pairing;
} solve_spec;

typedef struct {
    uint32_t node;
    palp_condition condition;
    palp_vec3 value;
    size_t line;
} condition_line;

static void set_option(void *context, const argument *a) {
    solve_spec *s = context;
    if (a->option == NULL) {
        if (s->blob != NULL) die(EXIT_USAGE, "one blob, not also '%s'", a->value[0]);
        s->blob = a->value[0];
    } else if (strcmp(a->option, "--set") == 0) {
        s->set = a->value[0];
    } else if (strcmp(a->option, "-o") == 0) {
        s->output = a->value[0];
    } else if (strcmp(a->option, "--level") == 0) {
        s->level = a->value[0];
    } else if (strcmp(a->option, "--pairing") == 0) {
        static const char *const pairings[] = {"energetic", "collocated", NULL};
        s->pairing = arg_word(a, pairings) == 1 ? PALP_COLLOCATED : PALP_ENERGETIC;
    } else {
        s->gravity =
            (palp_vec3){(float)arg_double(a, 0), (float)arg_double(a, 1), (float)arg_double(a, 2)};
        s->gravity_given = true;
    }
}

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
                                      uint32_t nodes) {
    static const struct {
        const char *name;
        palp_condition condition;
        int values;
    } kinds[] = {{"u", PALP_GIVE_DISPLACEMENT, 3},
                 {"n", PALP_GIVE_NORMAL, 1},
                 {"f", PALP_GIVE_FORCE, 3},
                 {"p", PALP_GIVE_TRACTION, 3},
                 {"free", PALP_RELEASE, 0}};
    condition_line c = {.line = line};
    if (fields < 2 || fields > 5)
        die(EXIT_USAGE, "%s:%zu: need the fields node,kind,x,y,z", path, line);
    if (!parse_u32(field[0], &c.node) || c.node >= nodes) {
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

static condition_line *read_conditions(const char *path, uint32_t nodes, size_t *count) {
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
                list[(*count)++] = parse_condition(path, number, field, fields, nodes);
            }
        }
        line = next;
    }
    if (!header) die(EXIT_USAGE, "%s: empty: need the header node,kind,x,y,z", path);
    free(text);
    return list;
}

static uint32_t choose_level(const palp_blob *b, const char *level) {
    uint32_t number;
    if (level == NULL || strcmp(level, "finest") == 0 || strcmp(level, "auto") == 0)
        return b->meta->constraint_level;
    if (!parse_u32(level, &number) || number > b->meta->constraint_level) {
        die(EXIT_USAGE,
            "--level: '%s' is not a constraint level of this blob (0 to %" PRIu32
            ", finest or auto)",
            level, b->meta->constraint_level);
    }
    return number;
}

static void apply(palp_cma *cma, const char *path, const condition_line *c) {
    palp_status status = palp_cma_give(cma, c->node, c->condition, c->value);
    if (status == PALP_ERR_ARGUMENT && c->condition == PALP_RELEASE &&
        !palp_node_is_fixed(cma->blob, c->node)) {
        die(EXIT_USAGE, "%s:%zu: node %" PRIu32 " is not fixed, so it cannot be released", path,
            c->line, c->node);
    }
    if (status == PALP_ERR_ARGUMENT) {
        die(EXIT_USAGE, "%s:%zu: node %" PRIu32 " already has a condition", path, c->line, c->node);
    }
    if (status == PALP_ERR_ABSENT) {
        die(EXIT_WORK,
            "%s:%zu: the blob has no column of fixed node %" PRIu32
            " (baked from a compliance matrix)",
            path, c->line, c->node);
    }
    if (status != PALP_OK) die(EXIT_WORK, "%s:%zu: %s", path, c->line, palp_status_text(status));
}

int command_solve(int argc, char **argv) {
    solve_spec s = {.output = "-"};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.blob == NULL) die(EXIT_USAGE, "no blob named (--help shows the usage)");
    if (s.set == NULL && !s.gravity_given)
        die(EXIT_USAGE, "nothing to solve: add --set IN.csv or --gravity X Y Z");
    palp_blob b = load_blob(s.blob);
    uint32_t level = choose_level(&b, s.level);
    size_t count = 0;
    condition_line *list = s.set != NULL ? read_conditions(s.set, b.meta->nodes, &count) : NULL;
    output out = open_output(s.output);

    size_t unknowns = 3 * count;
    if (unknowns > 3 * (size_t)b.meta->nodes) unknowns = 3 * (size_t)b.meta->nodes;
    palp_cma cma;
    size_t bytes = palp_cma_memsize(&b, (uint32_t)unknowns);
    void *memory = allocate_aligned(bytes, 1);
    palp_status status = palp_cma_init(&cma, &b, (uint32_t)unknowns, memory, bytes);
    if (status != PALP_OK) die(EXIT_WORK, "%s", palp_status_text(status));
    (void)palp_cma_level(&cma, level, s.pairing);
    for (size_t i = 0; i < count; i++) apply(&cma, s.set, &list[i]);
    if (s.gravity_given && palp_cma_gravity(&cma, s.gravity) != PALP_OK) {
        die(EXIT_WORK, "%s: the blob has no gravity response (baked from a compliance matrix)",
            s.blob);
    }
    float *u = allocate(3 * (size_t)b.meta->nodes, sizeof *u);
    float *f = allocate(3 * (size_t)b.meta->nodes, sizeof *f);
    status = palp_cma_solve(&cma, u, f);
    if (status == PALP_ERR_SINGULAR)
        die(EXIT_WORK, "%s: the body is no longer held: keep nodes fixed or displaced", s.set);
    if (status == PALP_ERR_ABSENT) {
        die(EXIT_WORK,
            "%s: a displaced node lies off constraint level %" PRIu32
            ", the finest in this blob, and away from its displaced nodes: displace the level's "
            "nodes (the first %" PRIu32 " free ones)",
            s.set, b.meta->constraint_level, b.level[b.meta->constraint_level].nodes);
    }
    if (status == PALP_ERR_NOT_SPD) {
        die(EXIT_WORK,
            "%s: compression at epsilon %g cannot resolve so many constraints: bake with a smaller "
            "--epsilon",
            s.set, (double)b.meta->epsilon);
    }
    if (status != PALP_OK) die(EXIT_WORK, "%s", palp_status_text(status));
    fputs("node,ux,uy,uz,fx,fy,fz\n", out.file);
    for (uint32_t i = 0; i < b.meta->nodes; i++) {
        fprintf(out.file, "%" PRIu32 ",%.9g,%.9g,%.9g,%.9g,%.9g,%.9g\n", i, (double)u[3 * i],
                (double)u[3 * i + 1], (double)u[3 * i + 2], (double)f[3 * i], (double)f[3 * i + 1],
                (double)f[3 * i + 2]);
    }
    fprintf(out.file, "# level=%" PRIu32 " rms_bound=%.6g unknowns=%" PRIu32 "\n", level,
            (double)b.meta->rms_error, cma.count);
    commit_output(&out);
    return EXIT_SUCCESS;
}
