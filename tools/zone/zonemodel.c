/* SPDX-License-Identifier: MIT */
#include "tools/zone/zonemodel.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define HALF_TURN 3.14159265358979323846

uint32_t zone_find(const zone_model *z, const char *name) {
    for (uint32_t i = 0; i < z->zones; i++) {
        if (strcmp(z->zone[i].name, name) == 0) return i;
    }
    return PALP_NONE;
}

static uint32_t named_zone(const zone_model *z, const argument *a, int index) {
    uint32_t found = zone_find(z, a->value[index]);
    if (found == PALP_NONE) {
        die(EXIT_USAGE, "%s: no zone named '%s' above this line", a->where, a->value[index]);
    }
    return found;
}

static void take_name(char name[PALP_NAME_BYTES], const argument *a) {
    size_t length = strlen(a->value[0]);
    if (length >= PALP_NAME_BYTES) {
        die(EXIT_USAGE, "%s: the name '%s' is longer than %u characters", a->where, a->value[0],
            PALP_NAME_BYTES - 1);
    }
    for (const char *p = a->value[0]; *p != '\0'; p++) {
        bool sound = (*p >= 'a' && *p <= 'z') || (*p >= 'A' && *p <= 'Z') ||
                     (*p >= '0' && *p <= '9') || *p == '_' || *p == '-' || *p == '.';
        if (!sound)
            die(EXIT_USAGE, "%s: the name '%s' may hold letters, digits, '_', '-' and '.' only",
                a->where, a->value[0]);
    }
    memcpy(name, a->value[0], length + 1);
}

body_spec *zone_body(zone_model *z, body_spec *common) {
    return z->zones > 0 ? &z->zone[z->zones - 1].body : common;
}

static void add_zone(zone_model *z, const body_spec *common, const argument *a) {
    if (z->zone == NULL) z->zone = allocate(PALP_MAX_ZONES, sizeof *z->zone);
    if (z->zones == PALP_MAX_ZONES)
        die(EXIT_USAGE, "%s: more than %u zones", a->where, PALP_MAX_ZONES);
    if (zone_find(z, a->value[0]) != PALP_NONE)
        die(EXIT_USAGE, "%s: there is a zone '%s' already", a->where, a->value[0]);
    zone_spec *s = &z->zone[z->zones++];
    *s = (zone_spec){.body = *common, .joint = PALP_NONE};
    s->body.mesh_path = NULL;
    take_name(s->name, a);
}

static void add_joint(zone_model *z, const argument *a, bool closure) {
    static const char *const kinds[] = {"fixed", "revolute", "prismatic", NULL};
    argument kind = {.where = a->where, .value = {a->value[1]}};
    if (z->joints == PALP_MAX_JOINTS)
        die(EXIT_USAGE, "%s: more than %u joints", a->where, PALP_MAX_JOINTS);
    for (uint32_t j = 0; j < z->joints; j++) {
        if (strcmp(z->joint[j].name, a->value[0]) == 0)
            die(EXIT_USAGE, "%s: there is a joint '%s' already", a->where, a->value[0]);
    }
    joint_spec *j = &z->joint[z->joints++];
    *j = (joint_spec){.axis = {0, 0, 1}, .where = a->where, .closure = closure};
    take_name(j->name, a);
    j->kind = (palp_joint_kind)arg_word(&kind, kinds);
    j->parent = named_zone(z, a, 2);
    j->child = named_zone(z, a, 3);
    if (j->parent == j->child)
        die(EXIT_USAGE, "%s: zone '%s' cannot hang on itself", a->where, a->value[3]);
}

static joint_spec *last_joint(zone_model *z, const argument *a) {
    if (z->joints == 0) die(EXIT_USAGE, "%s: comes behind the line of its joint", a->where);
    return &z->joint[z->joints - 1];
}

static void set_axis(joint_spec *j, const argument *a) {
    for (int k = 0; k < 3; k++) j->axis[k] = arg_double(a, k);
    if (!(v_norm(j->axis) > 0)) die(EXIT_USAGE, "%s: the axis is zero", a->where);
    v_normalize(j->axis);
}

static void set_limits(joint_spec *j, const argument *a) {
    j->low = arg_double(a, 0);
    j->high = arg_double(a, 1);
    j->has_limits = true;
    if (!(j->low >= -1e4 && j->high <= 1e4))
        die(EXIT_USAGE, "%s: limits lie between -10000 and 10000", a->where);
    if (!(j->low <= 0 && j->high >= 0)) {
        die(EXIT_USAGE, "%s: %s to %s leaves out 0, the rest configuration", a->where, a->value[0],
            a->value[1]);
    }
}

static void add_cut(zone_model *z, const argument *a) {
    if (z->cuts == MAX_CUTS) die(EXIT_USAGE, "%s: more than %d cuts", a->where, MAX_CUTS);
    cut_spec *c = &z->cut[z->cuts++];
    *c = (cut_spec){.from = named_zone(z, a, 0), .to = named_zone(z, a, 1), .where = a->where};
    for (int k = 0; k < 3; k++) c->point[k] = arg_double(a, 2 + k);
    for (int k = 0; k < 3; k++) c->normal[k] = arg_double(a, 5 + k);
    if (!(v_norm(c->normal) > 0)) die(EXIT_USAGE, "%s: the normal is zero", a->where);
    if (c->from == c->to) die(EXIT_USAGE, "%s: names zone '%s' twice", a->where, a->value[0]);
}

static void add_seam(zone_model *z, const body_spec *common, const argument *a) {
    if (a->count != 2 && a->count != 4)
        die(EXIT_USAGE, "%s: needs two zones, and two files of nodes or none", a->where);
    if (z->seams == PALP_MAX_SEAMS)
        die(EXIT_USAGE, "%s: more than %u seams", a->where, PALP_MAX_SEAMS);
    seam_spec *s = &z->seam[z->seams++];
    *s = (seam_spec){.zone = {named_zone(z, a, 0), named_zone(z, a, 1)}, .where = a->where};
    for (int k = 0; k < 2 && a->count == 4; k++) s->list[k] = body_path(common, a->value[2 + k]);
    if (s->zone[0] == s->zone[1])
        die(EXIT_USAGE, "%s: names zone '%s' twice", a->where, a->value[0]);
}

bool zone_option(zone_model *z, body_spec *common, const argument *a) {
    const char *o = a->option;
    if (strcmp(o, "--zone") == 0) {
        add_zone(z, common, a);
    } else if (strcmp(o, "--frame") == 0) {
        if (z->zones == 0) die(EXIT_USAGE, "%s: comes behind the line of its zone", a->where);
        for (int k = 0; k < 6; k++) z->zone[z->zones - 1].place[k] = arg_double(a, k);
    } else if (strcmp(o, "--labels") == 0) {
        z->labels = body_path(common, a->value[0]);
    } else if (strcmp(o, "--cut") == 0) {
        add_cut(z, a);
    } else if (strcmp(o, "--joint") == 0) {
        add_joint(z, a, false);
    } else if (strcmp(o, "--closure") == 0) {
        add_joint(z, a, true);
    } else if (strcmp(o, "--axis") == 0) {
        set_axis(last_joint(z, a), a);
    } else if (strcmp(o, "--origin") == 0) {
        joint_spec *j = last_joint(z, a);
        for (int k = 0; k < 3; k++) j->origin[k] = arg_double(a, k);
    } else if (strcmp(o, "--limits") == 0) {
        set_limits(last_joint(z, a), a);
    } else if (strcmp(o, "--seam") == 0) {
        add_seam(z, common, a);
    } else if (strcmp(o, "--seam-modes") == 0) {
        z->seam_modes = arg_u32(a, 0, 4, PALP_MAX_NODES);
    } else {
        return false;
    }
    return true;
}

/* ---- the tree ---- */

static void find_parents(zone_model *z) {
    for (uint32_t j = 0; j < z->joints; j++) {
        joint_spec *s = &z->joint[j];
        zone_spec *child = &z->zone[s->child];
        if (s->kind != PALP_FIXED_JOINT && !s->has_limits && !s->closure) {
            s->low = s->kind == PALP_REVOLUTE ? -HALF_TURN : -1;
            s->high = -s->low;
        }
        if (s->closure) continue;
        if (child->joint != PALP_NONE) {
            die(EXIT_USAGE,
                "%s: zone '%s' already hangs on joint '%s': a joint that closes a loop is a "
                "'closure'",
                s->where, child->name, z->joint[child->joint].name);
        }
        child->joint = j;
    }
}

uint32_t zone_depth(const zone_model *z, uint32_t zone) {
    uint32_t depth = 0;
    const char *where = "";
    for (; z->zone[zone].joint != PALP_NONE; depth++) {
        const joint_spec *j = &z->joint[z->zone[zone].joint];
        where = j->where;
        if (depth > z->zones) {
            die(EXIT_USAGE,
                "%s: the joints run in a circle through zone '%s': one of them has to be a "
                "'closure'",
                where, z->zone[zone].name);
        }
        zone = j->parent;
    }
    return depth;
}

void zone_model_check(zone_model *z, const char *path) {
    uint32_t order[PALP_MAX_ZONES], place[PALP_MAX_ZONES], depth[PALP_MAX_ZONES], filled = 0;
    find_parents(z);
    uint32_t deepest = 0, roots = 0;
    for (uint32_t i = 0; i < z->zones; i++) {
        depth[i] = zone_depth(z, i);
        if (depth[i] > deepest) deepest = depth[i];
        roots += depth[i] == 0;
    }
    if (roots != 1) {
        for (uint32_t i = 1; i < z->zones; i++) {
            if (depth[i] == 0 && z->zone[i].joint == PALP_NONE)
                die(EXIT_USAGE,
                    "%s: no joint carries zone '%s': one zone alone may be the root (a 'fixed' "
                    "joint will do)",
                    path, z->zone[i].name);
        }
    }
    for (uint32_t d = 0; d <= deepest; d++) {
        for (uint32_t i = 0; i < z->zones; i++) {
            if (depth[i] == d) order[filled++] = i;
        }
    }
    zone_spec *sorted = allocate(PALP_MAX_ZONES, sizeof *sorted);
    for (uint32_t i = 0; i < z->zones; i++) {
        sorted[i] = z->zone[order[i]];
        place[order[i]] = i;
    }
    free(z->zone);
    z->zone = sorted;
    for (uint32_t j = 0; j < z->joints; j++) {
        z->joint[j].parent = place[z->joint[j].parent];
        z->joint[j].child = place[z->joint[j].child];
    }
    for (uint32_t i = 0; i < z->cuts; i++) {
        z->cut[i].from = place[z->cut[i].from];
        z->cut[i].to = place[z->cut[i].to];
    }
    for (uint32_t i = 0; i < z->seams; i++) {
        for (int k = 0; k < 2; k++) z->seam[i].zone[k] = place[z->seam[i].zone[k]];
    }
}
