/* SPDX-License-Identifier: MIT */
#include "tools/zone/zonesolve.h"
#include "port/host/joints.h"
#include "tools/bake/conditions.h"
#include "tools/solver/dense.h"
#include "port/host/blobfile.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define OPEN_RAD 1e-4 /* of closures */

/* ---- opening ---- */

palp_zones *open_zones(const char *path, const char *data, size_t bytes) {
    palp_zones *z = allocate(1, sizeof *z);
    palp_status status = palp_zones_open(z, data, bytes);
    if (status != PALP_OK) die_of_blob(path, status, bytes);
    return z;
}

palp_seams *open_seams(const char *path, const palp_zones *zones) {
    palp_seams *q = allocate(1, sizeof *q);
    size_t need = palp_seams_memsize(zones, PALP_SEAM_LEVELS - 1);
    void *memory = allocate_aligned(need + 1, 1);
    palp_status status = palp_seams_init(q, zones, PALP_SEAM_LEVELS - 1, memory, need);
    if (status != PALP_OK) die(EXIT_WORK, "%s: %s", path, palp_status_text(status));
    return q;
}

void check_closures(const char *where, const palp_zones *zones,
                    const palp_configuration *configuration) {
    double size = 0;
    for (uint32_t i = 0; i < zones->meta->zones; i++) {
        const palp_meta *m = zones->blob[i].meta;
        palp_vec3 d = palp_sub(palp_vec3_at(m->box_max_m), palp_vec3_at(m->box_min_m));
        double length = (double)palp_norm(d);
        if (length > size) size = length;
    }
    if ((double)configuration->open_rad <= OPEN_RAD &&
        (double)configuration->open_m <= OPEN_RAD * size)
        return;
    die(EXIT_WORK,
        "%s: these joint values leave a loop open, by %.3g m and %.3g rad at its closure: change "
        "them together",
        where, (double)configuration->open_m, (double)configuration->open_rad);
}

/* ---- nodes ---- */

static uint32_t zone_of(const palp_zones *z, uint32_t node) {
    uint32_t i = z->meta->zones - 1;
    while (z->part[i].first_node > node) i--;
    return i;
}

/* ZONE:NODE, or a number through all zones. */
static bool find_node(const void *context, const char *word, uint32_t *node) {
    const palp_zones *z = context;
    const char *colon = strrchr(word, ':');
    if (colon == NULL) return parse_u32(word, node);
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        size_t length = strlen(z->zone[i].name);
        if (length != (size_t)(colon - word) || strncmp(word, z->zone[i].name, length) != 0)
            continue;
        if (!parse_u32(colon + 1, node) || *node >= z->blob[i].meta->nodes) return false;
        *node += z->part[i].first_node;
        return true;
    }
    return false;
}

/* ---- the problem ---- */

/* One scalar condition: the displacement of a free slot along a direction, in its zone's frame. */
typedef struct {
    uint32_t zone, node;
    palp_vec3 direction;
    double target;
} scalar_condition;

typedef struct {
    const palp_zones *z;
    const zone_solve_spec *spec;
    palp_seams *q;
    palp_configuration configuration;
    uint32_t level;
    palp_cma cma[PALP_MAX_ZONES];
    float *u[PALP_MAX_ZONES], *f[PALP_MAX_ZONES]; /* [nodes][3], zone's frame */
    float *load[PALP_MAX_ZONES];                  /* [nodes][3] given forces, zone's frame */
    scalar_condition *condition;
    uint32_t conditions;
    palp_vec3 gravity;
} problem;

static void pose(problem *p) {
    const zone_solve_spec *s = p->spec;
    float value[PALP_MAX_JOINTS] = {0};
    palp_frame rest = PALP_FRAME_IDENTITY;
    for (uint32_t k = 0; k < s->joints; k++) {
        uint32_t j = find_joint("--joint", p->z, s->joint[k].name);
        check_joint("--joint", p->z, j, s->joint[k].value);
        value[j] = (float)s->joint[k].value;
    }
    palp_configuration_rest(&p->configuration, p->z);
    palp_configuration_set(&p->configuration, p->z, value, &rest);
    check_closures(s->blob, p->z, &p->configuration);
}

static uint32_t choose_level(const char *word) {
    uint32_t level = PALP_SEAM_LEVELS - 1;
    if (word == NULL || strcmp(word, "finest") == 0 || strcmp(word, "auto") == 0) return level;
    if (strcmp(word, "diagonal") == 0) return PALP_DIAGONAL;
    if (!parse_u32(word, &level) || level >= PALP_SEAM_LEVELS)
        die(EXIT_USAGE, "--level: '%s' is not a seam level (0 to %u, finest, auto or diagonal)",
            word, PALP_SEAM_LEVELS - 1);
    return level;
}

static void take_condition(problem *p, const condition_line *c) {
    uint32_t zone = zone_of(p->z, c->node), node = c->node - p->z->part[zone].first_node;
    const palp_blob *b = &p->z->blob[zone];
    const float *turn = p->configuration.frame[zone].r;
    if (palp_node_is_fixed(b, node))
        die(EXIT_USAGE, "%s:%zu: node %" PRIu32 " of zone '%s' is held by a bone or a seam",
            p->spec->set, c->line, node, p->z->zone[zone].name);
    palp_vec3 value = palp_rotate_back(turn, c->value);
    float *load = p->load[zone] + 3 * (size_t)node;
    scalar_condition s = {.zone = zone, .node = node};
    switch (c->condition) {
    case PALP_PRESCRIBE_DISPLACEMENT:
        for (uint32_t k = 0; k < 3; k++) {
            const float part[3] = {value.x, value.y, value.z};
            s.direction =
                (palp_vec3){k == 0 ? 1.0f : 0.0f, k == 1 ? 1.0f : 0.0f, k == 2 ? 1.0f : 0.0f};
            s.target = (double)part[k];
            p->condition[p->conditions++] = s;
        }
        break;
    case PALP_PRESCRIBE_NORMAL:
        s.direction = palp_vec3_at(b->normal + 3 * (size_t)node);
        s.target = (double)c->value.x;
        p->condition[p->conditions++] = s;
        break;
    case PALP_PRESCRIBE_TRACTION:
        value = palp_scale(b->area_m2[node], value); /* fall through */
    case PALP_PRESCRIBE_FORCE:
        load[0] += value.x;
        load[1] += value.y;
        load[2] += value.z;
        break;
    case PALP_RELEASE:
        die(EXIT_USAGE,
            "%s:%zu: node %" PRIu32 " of zone '%s' is not held, so it cannot be released",
            p->spec->set, c->line, node, p->z->zone[zone].name);
    }
}

/* The local answer of a zone to its loads: u and f as if seams and bones stood still. */
static void solve_zone(problem *p, uint32_t zone, bool gravity) {
    palp_cma *c = &p->cma[zone];
    const float *load = p->load[zone];
    palp_cma_clear(c);
    for (uint32_t i = 0; i < p->z->blob[zone].meta->nodes; i++) {
        palp_vec3 force = palp_vec3_at(load + 3 * (size_t)i);
        if (palp_dot(force, force) > 0.0f)
            (void)palp_cma_prescribe(c, i, PALP_PRESCRIBE_FORCE, force);
    }
    if (gravity) {
        palp_vec3 g = palp_rotate_back(p->configuration.frame[zone].r, p->gravity);
        (void)palp_cma_gravity(c, g);
    }
    palp_status status = palp_cma_solve(c, p->u[zone], p->f[zone]);
    if (status != PALP_OK) die(EXIT_WORK, "%s: %s", p->spec->blob, palp_status_text(status));
}

/* Right-hand side of the seams for all loads. */
static void seam_loads(problem *p, bool bent, float *r) {
    if (bent) {
        palp_seams_mismatch(p->q, &p->configuration, p->level, r);
        palp_seams_gravity(p->q, &p->configuration, p->level, p->gravity, r);
    } else {
        memset(r, 0, 3 * (size_t)p->q->modes * sizeof *r);
    }
    for (uint32_t i = 0; i < p->z->meta->zones; i++) {
        float *felt = allocate(3 * (size_t)p->z->zone[i].modes + 1, sizeof *felt);
        for (uint32_t n = 0; n < p->z->blob[i].meta->nodes; n++) {
            palp_vec3 force = palp_vec3_at(p->load[i] + 3 * (size_t)n);
            if (palp_dot(force, force) > 0.0f)
                palp_zone_modal_load(p->z, PALP_SEAM_LEVELS - 1, i, n, force, felt);
        }
        palp_seams_load(p->q, &p->configuration, p->level, i, felt, r);
        free(felt);
    }
}

/* Displacements of all conditions under the present loads: their own zone's answer and the seams'.
 */
static void displacements(problem *p, bool bent, const float *w, double *out) {
    float *modes[PALP_MAX_ZONES];
    for (uint32_t i = 0; i < p->z->meta->zones; i++) {
        solve_zone(p, i, bent);
        modes[i] = allocate(3 * (size_t)p->z->zone[i].modes + 1, sizeof *modes[i]);
        if (bent) {
            palp_seams_zone(p->q, &p->configuration, p->level, i, w, modes[i]);
        } else {
            palp_seams_expand(p->q, &p->configuration, p->level, i, w, modes[i]);
        }
    }
    for (uint32_t k = 0; k < p->conditions; k++) {
        const scalar_condition *c = &p->condition[k];
        palp_vec3 u = palp_vec3_at(p->u[c->zone] + 3 * (size_t)c->node);
        u = palp_add(u, palp_zone_modal_displacement(p->z, PALP_SEAM_LEVELS - 1, c->zone, c->node,
                                                     modes[c->zone]));
        out[k] = (double)palp_dot(c->direction, u);
    }
    for (uint32_t i = 0; i < p->z->meta->zones; i++) free(modes[i]);
}

/* Finds the forces that bring about the conditions and adds them to the loads. */
static void solve_conditions(problem *p) {
    size_t n = p->conditions;
    if (n == 0) return;
    double *g = allocate_aligned(n * n, sizeof *g), *x = allocate(n, sizeof *x);
    double *column = allocate(n, sizeof *column);
    float *w = allocate(3 * (size_t)p->q->modes + 1, sizeof *w);
    uint32_t *perm = allocate(n, sizeof *perm);
    seam_loads(p, true, w);
    palp_seams_solve(p->q, w);
    displacements(p, true, w, x);
    for (size_t k = 0; k < n; k++) x[k] = p->condition[k].target - x[k];
    float *given[PALP_MAX_ZONES];
    for (uint32_t i = 0; i < p->z->meta->zones; i++) {
        size_t values = 3 * (size_t)p->z->blob[i].meta->nodes;
        given[i] = p->load[i];
        p->load[i] = allocate(values, sizeof *p->load[i]);
    }
    for (size_t k = 0; k < n; k++) {
        const scalar_condition *c = &p->condition[k];
        float *load = p->load[c->zone] + 3 * (size_t)c->node;
        const float unit[3] = {c->direction.x, c->direction.y, c->direction.z};
        memcpy(load, unit, sizeof unit);
        seam_loads(p, false, w);
        palp_seams_solve(p->q, w);
        displacements(p, false, w, column);
        for (size_t i = 0; i < n; i++) g[i * n + k] = column[i];
        memset(load, 0, sizeof unit);
    }
    if (dense_lu(g, n, n, perm) < n)
        die(EXIT_WORK, "%s: two conditions contradict each other", p->spec->set);
    dense_lu_solve(g, n, n, perm, x, 1, 1);
    for (uint32_t i = 0; i < p->z->meta->zones; i++) {
        free(p->load[i]);
        p->load[i] = given[i];
    }
    for (size_t k = 0; k < n; k++) {
        const scalar_condition *c = &p->condition[k];
        float *load = p->load[c->zone] + 3 * (size_t)c->node;
        load[0] += (float)x[k] * c->direction.x;
        load[1] += (float)x[k] * c->direction.y;
        load[2] += (float)x[k] * c->direction.z;
    }
    void *owned[] = {g, x, column, w, perm};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}

/* Adds what the seams do to u and f of a zone. */
static void add_seams(problem *p, uint32_t zone, const float *w) {
    const palp_zones *z = p->z;
    const palp_blob *b = &z->blob[zone];
    size_t modes = z->zone[zone].modes;
    float *m = allocate(3 * modes + 1, sizeof *m);
    palp_seams_zone(p->q, &p->configuration, p->level, zone, w, m);
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        uint32_t slot = palp_node_slot(b, i);
        bool held = palp_node_is_fixed(b, i);
        palp_vec3 v = {0.0f, 0.0f, 0.0f};
        const float *block =
            (held ? z->part[zone].reaction : z->part[zone].response) + 9 * modes * slot;
        for (size_t k = 0; k < modes; k++)
            v = palp_add(v, palp_rotate(block + 9 * k, palp_vec3_at(m + 3 * k)));
        float *to = (held ? p->f[zone] : p->u[zone]) + 3 * (size_t)i;
        to[0] += v.x;
        to[1] += v.y;
        to[2] += v.z;
    }
    for (uint32_t k = 0; k < z->part[zone].seams; k++) {
        uint32_t s = z->part[zone].seam[k];
        const palp_seam_entry *e = &z->seam[s];
        uint32_t side = e->zone[0] == zone ? 0 : 1;
        for (uint32_t i = 0; i < e->nodes; i++) {
            const uint32_t node = z->seam_node[s][2 * i + side];
            palp_vec3 v = palp_zone_modal_displacement(z, PALP_SEAM_LEVELS - 1, zone, node, m);
            float *to = p->u[zone] + 3 * (size_t)node;
            to[0] = v.x;
            to[1] = v.y;
            to[2] = v.z;
        }
    }
    free(m);
}

static void write_zone(const problem *p, FILE *f, uint32_t zone) {
    const palp_blob *b = &p->z->blob[zone];
    const palp_frame *frame = &p->configuration.frame[zone];
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        palp_vec3 local = palp_vec3_at(p->u[zone] + 3 * (size_t)i);
        palp_vec3 u = palp_rotate(frame->r, local);
        palp_vec3 force = palp_rotate(frame->r, palp_vec3_at(p->f[zone] + 3 * (size_t)i));
        palp_vec3 x = palp_carry(frame, palp_add(palp_vec3_at(b->rest_m + 3 * (size_t)i), local));
        fprintf(f, "%" PRIu32 ",%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g\n",
                p->z->part[zone].first_node + i, (double)u.x, (double)u.y, (double)u.z,
                (double)force.x, (double)force.y, (double)force.z, (double)x.x, (double)x.y,
                (double)x.z);
    }
}

static void prepare(problem *p) {
    for (uint32_t i = 0; i < p->z->meta->zones; i++) {
        const palp_blob *b = &p->z->blob[i];
        size_t values = 3 * (size_t)b->meta->nodes, bytes = palp_cma_memsize(b, 1);
        palp_status status = palp_cma_init(&p->cma[i], b, 1, allocate_aligned(bytes, 1), bytes);
        if (status != PALP_OK) die(EXIT_WORK, "%s: %s", p->spec->blob, palp_status_text(status));
        p->u[i] = allocate(values, sizeof *p->u[i]);
        p->f[i] = allocate(values, sizeof *p->f[i]);
        p->load[i] = allocate(values, sizeof *p->load[i]);
    }
}

int zone_solve(const zone_solve_spec *s, const char *data, size_t bytes) {
    problem *p = allocate(1, sizeof *p);
    size_t count = 0;
    *p = (problem){.spec = s, .level = choose_level(s->level), .gravity = s->gravity};
    p->z = open_zones(s->blob, data, bytes);
    pose(p);
    condition_line *list =
        s->set != NULL ? read_conditions(s->set, p->z->nodes, find_node, p->z, &count) : NULL;
    p->condition = allocate(3 * count + 1, sizeof *p->condition);
    prepare(p);
    for (size_t i = 0; i < count; i++) {
        for (size_t k = 0; k < i; k++) {
            if (list[k].node == list[i].node)
                die(EXIT_USAGE, "%s:%zu: node %" PRIu32 " already has a condition", s->set,
                    list[i].line, list[i].node);
        }
        take_condition(p, &list[i]);
    }
    for (uint32_t i = 0; i < p->z->meta->zones && s->gravity_given; i++) {
        if (!palp_blob_has(&p->z->blob[i], PALP_META_GRAVITY) || p->z->part[i].weight == NULL)
            die(EXIT_WORK, "%s: zone '%s' has no gravity response", s->blob, p->z->zone[i].name);
    }
    output out = open_output(s->output);
    p->q = open_seams(s->blob, p->z);
    if (palp_seams_refresh(p->q, &p->configuration, p->level) != PALP_OK)
        die(EXIT_WORK, "%s: the seams cannot be solved in this configuration", s->blob);
    solve_conditions(p);
    float *w = allocate(3 * (size_t)p->q->modes + 1, sizeof *w);
    seam_loads(p, true, w);
    palp_seams_solve(p->q, w);
    fputs("node,ux,uy,uz,fx,fy,fz,x,y,z\n", out.file);
    for (uint32_t i = 0; i < p->z->meta->zones; i++) {
        solve_zone(p, i, true);
        add_seams(p, i, w);
        write_zone(p, out.file, i);
    }
    for (uint32_t i = 0; i < p->z->meta->zones; i++)
        fprintf(out.file, "# zone=%s first=%" PRIu32 " nodes=%" PRIu32 "\n", p->z->zone[i].name,
                p->z->part[i].first_node, p->z->blob[i].meta->nodes);
    fprintf(out.file, "# level=%s unknowns=%" PRIu32 "\n",
            p->level == PALP_DIAGONAL ? "diagonal"
            : s->level != NULL        ? s->level
                                      : "finest",
            p->conditions + 3 * p->q->modes);
    commit_output(&out);
    return EXIT_SUCCESS;
}
