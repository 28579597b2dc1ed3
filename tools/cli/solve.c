/* SPDX-License-Identifier: MIT */
#include "port/host/args.h"
#include "tools/cli/commands.h"
#include "port/host/blobfile.h"
#include "tools/bake/conditions.h"
#include "port/host/util.h"
#include "tools/zone/zonesolve.h"
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
    "with --pairing collocated at its node.\n"
    "Of a multizone model --joint NAME VALUE (rad or m, repeatable) poses it, --level is the "
    "seams' (0 to\n"
    "5, or diagonal for the block diagonal approximation), nodes are counted through all zones or\n"
    "written ZONE:NODE, vectors are in the model's coordinates, displacements from the posed rest\n"
    "shape, and three more columns x,y,z say where each node is.\n";

static const option options[] = {{"--set", 1},     {"-o", 1},      {"--level", 1}, {"--pairing", 1},
                                 {"--gravity", 3}, {"--joint", 2}, {NULL, 0}};

typedef struct {
    const char *blob, *set, *output, *level, *level_where;
    palp_vec3 gravity;
    bool gravity_given;
    palp_pairing pairing;
    uint32_t joints;
    zone_solve_joint joint[PALP_MAX_JOINTS];
} solve_spec;

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
    } else if (strcmp(a->option, "--joint") == 0) {
        if (s->joints == PALP_MAX_JOINTS) die(EXIT_USAGE, "--joint: too many");
        s->joint[s->joints++] = (zone_solve_joint){a->value[0], arg_double(a, 1)};
    } else {
        s->gravity =
            (palp_vec3){(float)arg_double(a, 0), (float)arg_double(a, 1), (float)arg_double(a, 2)};
        s->gravity_given = true;
    }
}

static int solve_zones(const solve_spec *s, const char *data, size_t size) {
    if (s->pairing != PALP_ENERGETIC) die(EXIT_USAGE, "--pairing is for one body");
    zone_solve_spec z = {.blob = s->blob,
                         .set = s->set,
                         .output = s->output,
                         .level = s->level,
                         .gravity = s->gravity,
                         .gravity_given = s->gravity_given,
                         .joints = s->joints};
    memcpy(z.joint, s->joint, sizeof z.joint);
    return zone_solve(&z, data, size);
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
    palp_status status = palp_cma_prescribe(cma, c->node, c->condition, c->value);
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
    if (s.set == NULL && !s.gravity_given && s.joints == 0)
        die(EXIT_USAGE, "nothing to solve: add --set IN.csv or --gravity X Y Z");
    size_t size;
    char *data = read_file(s.blob, &size);
    if (palp_zones_are_here(data, size)) return solve_zones(&s, data, size);
    palp_blob b = open_blob(s.blob, data, size);
    if (s.joints > 0) die(EXIT_USAGE, "%s: one body has no joints", s.blob);
    uint32_t level = choose_level(&b, s.level);
    size_t count = 0;
    condition_line *list =
        s.set != NULL ? read_conditions(s.set, b.meta->nodes, NULL, NULL, &count) : NULL;
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
            (double)b.meta->rms_error, cma.solved);
    commit_output(&out);
    return EXIT_SUCCESS;
}
