/* SPDX-License-Identifier: MIT */
#include "tools/mesh/choose.h"
#include "port/host/util.h"
#include "tools/mesh/components.h"
#include "tools/mesh/holes.h"
#include "tools/mesh/meshmend.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define LARGEST_BODY_M 2.0
#define SMALLEST_BODY_M 1e-3

bool mesh_option(mesh_choice *c, const argument *a) {
    static const char *const units[] = {"m", "cm", "mm", "inch", NULL};
    static const double metres[] = {1, 1e-2, 1e-3, 0.0254};
    if (a->option == NULL) return false;
    if (strcmp(a->option, "--units") == 0) {
        c->unit_m = metres[arg_word(a, units)];
    } else if (strcmp(a->option, "--largest") == 0) {
        c->one = true;
        c->component = 0;
    } else if (strcmp(a->option, "--component") == 0) {
        c->one = true;
        c->component = arg_u32(a, 0, 0, UINT32_MAX);
    } else if (strcmp(a->option, "--holes") == 0) {
        c->holes_given = true;
        c->holes_m = arg_between(a, 0, 1e6);
    } else {
        return false;
    }
    return true;
}

void mesh_warn_of_size(const mesh *m, const char *path) {
    double size[3], across;
    mesh_extent(m, size);
    across = fmax(size[0], fmax(size[1], size[2]));
    if (across > LARGEST_BODY_M * (1 + 1e-9)) {
        warn("%s: the body is %.3g m across: if the file is in millimetres, add --units mm", path,
             across);
    } else if (across < SMALLEST_BODY_M) {
        warn("%s: the body is %.3g mm across: is the file in metres? (--units mm, cm or inch)",
             path, 1e3 * across);
    }
}

static void close_holes(mesh *m, const char *path, double longest_m) {
    mesh_hole longest, left;
    const uint32_t closed = mesh_close_holes(m, longest_m, &longest, &left);
    if (closed == 0) return;
    (void)mesh_turn_slivers(m);
    warn("%s: %" PRIu32 " hole(s) closed, the longest rim %.3g cm around (%.4g, %.4g, %.4g)", path,
         closed, 100 * longest.rim_m, longest.middle[0], longest.middle[1], longest.middle[2]);
}

void mesh_place(mesh *m, double unit_m, const double origin[3]) {
    for (uint32_t i = 0; i < m->vertices; i++) {
        for (int k = 0; k < 3; k++) m->x[i][k] = m->x[i][k] * (unit_m > 0 ? unit_m : 1) - origin[k];
    }
}

mesh mesh_load_as(const char *path, const mesh_choice *c, double usual) {
    mesh m = mesh_load(path);
    static const double origin[3];
    mesh_place(&m, c->unit_m, origin);
    /* before a component is kept, so that its number is that of palp check */
    close_holes(&m, path, c->holes_given ? c->holes_m : usual * mesh_diagonal(&m));
    if (c->one) mesh_keep_component(&m, path, c->component);
    return m;
}
