/* SPDX-License-Identifier: MIT */
/* The body that a command works on: mesh, material and fixed nodes, from options or a model file.
 */
#ifndef PALP_TOOLS_BODY_H
#define PALP_TOOLS_BODY_H

#include "port/host/args.h"
#include "tools/bake/build.h"
#include "tools/mesh/choose.h"

#define MAX_FIXES 64

typedef enum { FIX_BELOW, FIX_ABOVE, FIX_BOX, FIX_NODES } fix_kind;
typedef struct {
    fix_kind kind;
    int axis;
    double value[6];
    const char *file;
} fix;

typedef struct {
    const char *mesh_path, *compliance;
    const char *folder; /* of the model file, for relative paths */
    bool as_is, levels_given, crisp;
    mesh_choice choice;
    bool collocation; /* in place of Galerkin boundary elements */
    uint32_t levels, base_faces, loop;
    double young_Pa, poisson, density;
    fix fixes[MAX_FIXES];
    int fix_count;
    bool anywhere;    /* may lie far from the origin: the blob's is moved (body_recentre) */
    double origin[3]; /* where the blob's origin is in the file */
} body_spec;

/* For option tables. */
#define BODY_OPTIONS                                                                               \
    {"--mesh", 1}, {"--levels", 1}, {"--base-faces", 1}, {"--as-is", 0}, {"--loop", 1},            \
        {"--young", -2}, {"--poisson", 1}, {"--density", 1}, {"--fix-below", 2},                   \
        {"--fix-above", 2}, {"--fix-box", 6}, {"--fix-nodes", 1}, {"--compliance", 1},             \
        {"--crisp", 0}, {"--method", 1}, MESH_OPTIONS, {                                           \
        "--threads", 1                                                                             \
    }

extern const body_spec body_defaults;

/* Takes one of BODY_OPTIONS; false if it is another. */
bool body_option(body_spec *s, const argument *a);

/* A path of the model file, relative to it. */
const char *body_path(const body_spec *s, const char *path);

/* The folder of a model file with its slash, NULL for the current one. */
const char *body_folder(const char *path);

/* Exits unless material, mesh and fixed nodes are given. */
void body_require(const body_spec *s);

/* Loads, remeshes or subdivides; exits if the mesh is not closed or too large. */
mesh body_mesh(const body_spec *s);

/* Moves the origin into the middle of a body that lies so far from its file's that single precision
 * would cost it more than 1e-6 of its size, and says so. Fixed nodes are still chosen in the file's
 * coordinates. */
void body_recentre(body_spec *s, mesh *m);

/* Whether the box of a mesh reaches into a place that is fixed; always with listed nodes. */
bool body_may_hold(const body_spec *s, const mesh *m);

/* Nodes from a file, one per line, each below `nodes`; exits 2 with the line. To be freed. */
uint32_t *body_node_list(const char *path, uint32_t nodes, uint32_t *count);

/* Exits unless the material is given. */
void body_require_material(const body_spec *s);

/* Warns of a Young's modulus that no material has. */
void body_warn_of_material(const body_spec *s);

/* fixed[vertices] as the fix-... options say. */
uint8_t *body_bones(const body_spec *s, const mesh *m);

/* The same; exits if none or all are fixed, or if the body could turn. */
uint8_t *body_fixed(const body_spec *s, const mesh *m);

/* Bytes that the dense matrices take with that many load columns; more than this machine has
 * exits. */
void body_require_memory(const body_spec *s, const mesh *m, double columns, bool has_levels);

/* Green's functions for loads on `level` of the free domain, reciprocal unless raw. */
greens body_greens(const body_spec *s, const mesh *m, const uint8_t *fixed, const domains *d,
                   uint32_t level, bool raw);

#endif
