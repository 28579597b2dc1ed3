/* SPDX-License-Identifier: MIT */
#include "tools/zone/zonebake.h"
#include "core/zone/seams.h"
#include "port/host/parallel.h"
#include "tools/zone/seam.h"
#include "tools/bake/sha256.h"
#include "port/host/util.h"
#include "tools/zone/zonerest.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define ZONE_MODES 32u               /* of the regular part, for each zone beyond the first */
#define LIFT (1.01 * DEFINITE_FLOOR) /* of the diagonal, so that rigid motions pass as definite */

typedef struct {
    mesh m;
    uint8_t *fixed, *seam; /* [vertices] held, and held by a seam */
    uint32_t bones;        /* held nodes that no seam holds */
    uint32_t seams, list[PALP_MAX_ZONE_SEAMS], first[PALP_MAX_ZONE_SEAMS], modes;
    float *stiffness, *response, *reaction, *weight;
    uint32_t *seam_of; /* [vertices] PALP_NONE: on none */
    greens g;
    domains dom;
    built blob;
    double raised; /* change that kept the stiffness from rewarding any displacement */
} zone_data;

typedef struct {
    zone_model *z;
    const char *path;
    double diagonal, snapped;
    zone_data zone[PALP_MAX_ZONES];
    uint32_t seams;
    seam_list *seam;
    double *mode[PALP_MAX_SEAMS];
    palp_seam_entry entry[PALP_MAX_SEAMS];
} zone_bakery;

/* ---- meshes ---- */

/* Rotation by the vector w about the origin (Rodrigues). */
static void rotation_of(const double w[3], double r[9]) {
    double angle = v_norm(w), axis[3] = {0, 0, 1};
    for (int k = 0; k < 3 && angle > 0; k++) axis[k] = w[k] / angle;
    double s = sin(angle), c = 1 - cos(angle);
    const double cross[9] = {0, -axis[2], axis[1], axis[2], 0, -axis[0], -axis[1], axis[0], 0};
    for (int e = 0; e < 9; e++) {
        double one = e % 4 == 0 ? 1 : 0;
        r[e] = one + s * cross[e] + c * (axis[e / 3] * axis[e % 3] - one);
    }
}

static void place_mesh(mesh *m, const double place[6]) {
    double r[9];
    rotation_of(place + 3, r);
    for (uint32_t i = 0; i < m->vertices; i++) {
        double x[3];
        for (int k = 0; k < 3; k++)
            x[k] = place[k] + r[3 * k] * m->x[i][0] + r[3 * k + 1] * m->x[i][1] +
                   r[3 * k + 2] * m->x[i][2];
        memcpy(m->x[i], x, sizeof x);
    }
}

static uint32_t find_label(const void *context, const char *name) {
    return zone_find(context, name);
}

/* Each zone closed on its own, all of them together the body. */
static void check_volumes(const zone_bakery *b, double whole) {
    double sum = 0;
    for (uint32_t i = 0; i < b->z->zones; i++) {
        double volume = mesh_volume(&b->zone[i].m);
        sum += volume;
        if (!(volume > 1e-6 * whole)) {
            die(EXIT_WORK,
                "%s: the cuts leave zone '%s' no inside: each zone must be in one piece, and two "
                "zones "
                "may meet at one cut only",
                b->path, b->z->zone[i].name);
        }
    }
    if (fabs(sum - whole) > 1e-3 * whole)
        die(EXIT_WORK, "%s: the zones do not add up to the body: a cut closes the wrong way round",
            b->path);
}

/* Cuts the whole body. */
static void cut_body(zone_bakery *b, const body_spec *common) {
    const zone_model *z = b->z;
    const char *name[PALP_MAX_ZONES];
    mesh part[PALP_MAX_ZONES];
    for (uint32_t i = 0; i < z->zones; i++) {
        name[i] = z->zone[i].name;
        if (z->zone[i].body.mesh_path != NULL)
            die(EXIT_USAGE, "%s: zone '%s' has a mesh of its own, but so has the whole model",
                b->path, name[i]);
    }
    if (z->cuts == 0 && z->labels == NULL)
        die(EXIT_USAGE, "%s: one mesh for several zones needs 'cut' lines or 'labels'", b->path);
    cutting c = cut_begin(body_mesh(common));
    if (z->labels != NULL) cut_labels(&c, z->labels, find_label, z);
    for (uint32_t i = 0; i < z->cuts; i++)
        cut_plane(&c, z->cut[i].from, z->cut[i].to, z->cut[i].point, z->cut[i].normal,
                  z->cut[i].where);
    b->seams = cut_finish(&c, z->zones, name, part, &b->seam);
    for (uint32_t i = 0; i < z->zones; i++) b->zone[i].m = part[i];
    b->snapped = c.snapped_m;
    check_volumes(b, mesh_volume(&c.m));
    mesh_free(&c.m);
    free(c.label);
}

static void load_zones(zone_bakery *b) {
    const zone_model *z = b->z;
    for (uint32_t i = 0; i < z->zones; i++) {
        if (z->zone[i].body.mesh_path == NULL)
            die(EXIT_USAGE,
                "%s: zone '%s' has no 'mesh FILE' line, and there is no mesh above the "
                "zones to cut",
                b->path, z->zone[i].name);
        body_spec body = z->zone[i].body;
        body.as_is = true; /* or the seams would not match */
        b->zone[i].m = body_mesh(&body);
        place_mesh(&b->zone[i].m, z->zone[i].place);
    }
}

static double diagonal_of(const zone_bakery *b) {
    double low[3], high[3];
    for (uint32_t i = 0; i < b->z->zones; i++) {
        for (uint32_t v = 0; v < b->zone[i].m.vertices; v++) {
            for (int k = 0; k < 3; k++) {
                double x = b->zone[i].m.x[v][k];
                low[k] = (i == 0 && v == 0) ? x : fmin(low[k], x);
                high[k] = (i == 0 && v == 0) ? x : fmax(high[k], x);
            }
        }
    }
    return v_distance(low, high);
}

static void find_seams(zone_bakery *b) {
    zone_model *z = b->z;
    if (b->seam == NULL) {
        b->seam = allocate(PALP_MAX_SEAMS, sizeof *b->seam);
        for (uint32_t i = 0; i < z->seams; i++) {
            mesh part[PALP_MAX_ZONES];
            for (uint32_t k = 0; k < z->zones; k++) part[k] = b->zone[k].m;
            b->seam[b->seams++] = seam_match(&z->seam[i], z, part, b->diagonal);
        }
    } else if (z->seams > 0) {
        die(EXIT_USAGE, "%s: seams of a mesh that is cut are found by themselves",
            z->seam[0].where);
    }
    if (b->seams > PALP_MAX_SEAMS)
        die(EXIT_WORK, "%s: more than %u seams", b->path, PALP_MAX_SEAMS);
}

/* ---- graph ---- */

/* The first zone of each seam is the one nearer to the root. */
static void orient_seams(zone_bakery *b) {
    for (uint32_t s = 0; s < b->seams; s++) {
        seam_list *l = &b->seam[s];
        uint32_t d0 = zone_depth(b->z, l->zone[0]), d1 = zone_depth(b->z, l->zone[1]);
        if (d0 < d1 || (d0 == d1 && l->zone[0] < l->zone[1])) continue;
        uint32_t swap = l->zone[0];
        l->zone[0] = l->zone[1];
        l->zone[1] = swap;
        for (uint32_t i = 0; i < l->nodes; i++) {
            swap = l->node[i][0];
            l->node[i][0] = l->node[i][1];
            l->node[i][1] = swap;
        }
    }
}

static bool touch(const seam_list *a, const seam_list *b) {
    return a->zone[0] == b->zone[0] || a->zone[0] == b->zone[1] || a->zone[1] == b->zone[0] ||
           a->zone[1] == b->zone[1];
}

/* Order of elimination: always the seam that meets the fewest others that are left, ties by number.
 */
static void order_seams(zone_bakery *b) {
    uint64_t meets[PALP_MAX_SEAMS];
    uint32_t n = b->seams;
    seam_list *sorted = allocate(PALP_MAX_SEAMS, sizeof *sorted);
    bool gone[PALP_MAX_SEAMS] = {false};
    for (uint32_t s = 0; s < n; s++) {
        meets[s] = 0;
        for (uint32_t t = 0; t < n; t++) {
            if (t != s && touch(&b->seam[s], &b->seam[t])) meets[s] |= 1ull << t;
        }
    }
    for (uint32_t k = 0; k < n; k++) {
        uint32_t best = n;
        for (uint32_t s = 0; s < n; s++) {
            bool fewer =
                best == n || __builtin_popcountll(meets[s]) < __builtin_popcountll(meets[best]);
            if (!gone[s] && fewer) best = s;
        }
        gone[best] = true;
        sorted[k] = b->seam[best];
        for (uint32_t s = 0; s < n; s++) {
            if ((meets[best] >> s & 1) == 0) continue;
            meets[s] = (meets[s] | meets[best]) & ~(1ull << best | 1ull << s);
        }
    }
    free(b->seam);
    b->seam = sorted;
}

/* Whether the bones of the zones of one group leave it no motion: three nodes off one line. */
static bool group_is_held(const zone_bakery *b, const uint32_t *group, uint32_t which) {
    const double *first = NULL, *second = NULL;
    double apart = 0, off = 0;
    for (int pass = 0; pass < 3; pass++) {
        for (uint32_t i = 0; i < b->z->zones; i++) {
            const zone_data *d = &b->zone[i];
            for (uint32_t v = 0; v < d->m.vertices && group[i] == which; v++) {
                if (d->fixed[v] == 0 || d->seam[v] != 0) continue;
                if (first == NULL) first = d->m.x[v];
                if (pass == 1 && v_distance(first, d->m.x[v]) > apart) {
                    second = d->m.x[v];
                    apart = v_distance(first, second);
                }
                if (pass == 2 && second != NULL) {
                    double n[3];
                    triangle_normal(first, second, d->m.x[v], n);
                    off = fmax(off, v_norm(n) / apart);
                }
            }
        }
    }
    return off > 1e-6 * b->diagonal;
}

/* A zone of a group, hanging together by seams, that its bones do not hold; PALP_NONE. */
static uint32_t loose_zone(const zone_bakery *b) {
    uint32_t group[PALP_MAX_ZONES];
    for (uint32_t i = 0; i < b->z->zones; i++) group[i] = i;
    for (uint32_t round = 0; round < b->z->zones; round++) {
        for (uint32_t s = 0; s < b->seams; s++) {
            uint32_t *a = &group[b->seam[s].zone[0]], *c = &group[b->seam[s].zone[1]];
            if (*a < *c) *c = *a;
            if (*c < *a) *a = *c;
        }
    }
    for (uint32_t i = 0; i < b->z->zones; i++) {
        if (!group_is_held(b, group, group[i])) return i;
    }
    return PALP_NONE;
}

/* ---- one zone ---- */

static void hold_seams(zone_bakery *b, uint32_t i) {
    zone_data *d = &b->zone[i];
    d->seam = allocate(d->m.vertices, 1);
    d->seam_of = allocate(d->m.vertices, sizeof *d->seam_of);
    for (uint32_t v = 0; v < d->m.vertices; v++) d->seam_of[v] = PALP_NONE;
    for (uint32_t s = 0; s < b->seams; s++) {
        for (int side = 0; side < 2; side++) {
            if (b->seam[s].zone[side] != i) continue;
            if (d->seams == PALP_MAX_ZONE_SEAMS)
                die(EXIT_WORK, "%s: zone '%s' has more than %u seams", b->path, b->z->zone[i].name,
                    PALP_MAX_ZONE_SEAMS);
            d->list[d->seams] = s;
            d->first[d->seams++] = d->modes;
            d->modes += b->entry[s].modes;
            for (uint32_t k = 0; k < b->seam[s].nodes; k++) {
                uint32_t node = b->seam[s].node[k][side];
                if (d->seam[node] != 0)
                    die(EXIT_WORK, "%s: node %" PRIu32 " of zone '%s' lies on two seams", b->path,
                        node, b->z->zone[i].name);
                d->seam[node] = 1;
                d->seam_of[node] = s;
            }
        }
    }
    d->fixed = body_bones(&b->z->zone[i].body, &d->m);
    for (uint32_t k = 0; k < d->m.vertices; k++) {
        d->bones += d->fixed[k] != 0 && d->seam[k] == 0;
        d->fixed[k] |= d->seam[k];
    }
    uint32_t held = 0;
    for (uint32_t k = 0; k < d->m.vertices; k++) held += d->fixed[k];
    if (held == 0)
        die(EXIT_WORK, "%s: zone '%s' has neither bone nodes nor seams", b->path,
            b->z->zone[i].name);
    if (held == d->m.vertices)
        die(EXIT_WORK, "%s: all nodes of zone '%s' are held: nothing is left to touch", b->path,
            b->z->zone[i].name);
}

/* Rows of `node` times the modes of the zone's seams: out[M][9]. */
static void modal_rows(const zone_bakery *b, uint32_t i, const greens *g, uint32_t node,
                       double *out) {
    const zone_data *d = &b->zone[i];
    memset(out, 0, 9 * (size_t)d->modes * sizeof *out);
    for (uint32_t k = 0; k < d->seams; k++) {
        const seam_list *l = &b->seam[d->list[k]];
        int side = l->zone[0] == i ? 0 : 1;
        uint32_t modes = b->entry[d->list[k]].modes;
        for (uint32_t n = 0; n < l->nodes; n++) {
            const double *q = b->mode[d->list[k]] + (size_t)n * modes;
            for (uint32_t e = 0; e < 9; e++) {
                double value = greens_row(g, node, e / 3)[3 * (size_t)l->node[n][side] + e % 3];
                for (uint32_t m = 0; m < modes; m++) out[9 * (d->first[k] + m) + e] += value * q[m];
            }
        }
    }
}

/* Q^T K Q, dense, and the modal weight. */
static double *modal_stiffness(const zone_bakery *b, uint32_t i, const greens *g, double *weight) {
    const zone_data *d = &b->zone[i];
    size_t order = 3 * (size_t)d->modes;
    double *k = allocate_aligned(order * order + 1, sizeof *k);
    double *row = allocate(9 * (size_t)d->modes + 1, sizeof *row);
    for (uint32_t s = 0; s < d->seams; s++) {
        const seam_list *l = &b->seam[d->list[s]];
        int side = l->zone[0] == i ? 0 : 1;
        uint32_t modes = b->entry[d->list[s]].modes;
        for (uint32_t n = 0; n < l->nodes; n++) {
            uint32_t node = l->node[n][side];
            modal_rows(b, i, g, node, row);
            for (uint32_t m = 0; m < modes; m++) {
                double q = b->mode[d->list[s]][(size_t)n * modes + m];
                size_t first = 3 * (size_t)(d->first[s] + m);
                for (size_t e = 0; e < 9 * (size_t)d->modes; e++)
                    k[(first + e % 9 / 3) * order + e / 9 * 3 + e % 3] += q * row[e];
                for (size_t e = 0; e < 9 && g->gravity; e++)
                    weight[3 * first + e] +=
                        q * greens_row(g, node, e / 3)[3 * (size_t)g->nodes + e % 3];
            }
        }
    }
    free(row);
    for (size_t p = 0; p < order; p++) {
        for (size_t q = 0; q < p; q++)
            k[p * order + q] = k[q * order + p] = 0.5 * (k[p * order + q] + k[q * order + p]);
    }
    return k;
}

/*
 * Collocation can leave the stiffness slightly indefinite. With a little of its own diagonal added,
 * rigid motions stay nearly free; make_definite raises what is below.
 */
static double raise(double *k, size_t order) {
    if (order == 0) return 0;
    double *copy = allocate_aligned(order * order, sizeof *copy);
    memcpy(copy, k, order * order * sizeof *k);
    for (size_t i = 0; i < order; i++) copy[i * order + i] *= 1 + LIFT;
    definite_report r = make_definite(copy, order, order);
    if (r.raised > 0) {
        for (size_t i = 0; i < order; i++) copy[i * order + i] -= LIFT * k[i * order + i];
        memcpy(k, copy, order * order * sizeof *k);
    }
    free(copy);
    return r.raised > 0 ? r.change : 0;
}

static void condense(zone_bakery *b, uint32_t i, const greens *g, const domains *dom) {
    zone_data *d = &b->zone[i];
    size_t modes = d->modes, order = 3 * modes;
    double *weight = allocate(9 * modes + 1, sizeof *weight);
    double *k = modal_stiffness(b, i, g, weight), *row = allocate(9 * modes + 1, sizeof *row);
    d->raised = raise(k, order);
    d->stiffness = allocate(9 * modes * (modes + 1) / 2 + 1, sizeof *d->stiffness);
    float *at = d->stiffness;
    for (size_t p = 0; p < modes; p++) {
        for (size_t q = 0; q <= p; q++) {
            for (size_t e = 0; e < 9; e++)
                *at++ = (float)k[(3 * p + e / 3) * order + 3 * q + e % 3];
        }
    }
    const domain_data *domain = dom->domain;
    float **out[PALP_DOMAINS] = {&d->response, &d->reaction};
    for (uint32_t w = 0; w < PALP_DOMAINS; w++) {
        uint32_t slots = domain[w].view.slots;
        *out[w] = allocate(9 * modes * slots + 1, sizeof **out[w]);
        for (uint32_t s = 0; s < slots; s++) {
            modal_rows(b, i, g, domain[w].node[s], row);
            for (size_t e = 0; e < 9 * modes; e++) (*out[w])[9 * modes * s + e] = (float)row[e];
        }
    }
    if (g->gravity) {
        d->weight = allocate(9 * modes + 1, sizeof *d->weight);
        for (size_t e = 0; e < 9 * modes; e++) d->weight[e] = (float)weight[e];
    }
    free(weight);
    free(k);
    free(row);
}

/* The Green's functions of one zone, and what its seams need of them. */
static void solve_one(zone_bakery *b, uint32_t i, const build_options *options) {
    zone_data *d = &b->zone[i];
    const body_spec *body = &b->z->zone[i].body;
    double *area = allocate(d->m.vertices, sizeof *area);
    double(*normal)[3] = allocate(d->m.vertices, sizeof *normal);
    mesh_nodal(&d->m, area, normal);
    d->dom = domains_build(&d->m, d->fixed, area, options->wavelet);
    body_require_memory(body, &d->m, d->m.vertices, false);
    body_spec crisp = *body;
    crisp.crisp = true;
    d->g = body_greens(&crisp, &d->m, d->fixed, &d->dom, d->dom.domain[PALP_FREE].view.levels - 1,
                       false);
    condense(b, i, &d->g, &d->dom);
    free(area);
    free(normal);
}

static rest_model model_at_rest(const zone_bakery *b) {
    rest_model r = {.zones = b->z->zones, .seams = b->seams, .seam = b->seam, .entry = b->entry};
    for (uint32_t i = 0; i < r.zones; i++) {
        const zone_data *d = &b->zone[i];
        const body_spec *body = &b->z->zone[i].body;
        r.zone[i] = (rest_zone){.m = &d->m,
                                .seam_of = d->seam_of,
                                .g = &d->g,
                                .dom = &d->dom,
                                .stiffness = d->stiffness,
                                .response = d->response,
                                .seams = d->seams,
                                .modes = d->modes,
                                .material = {body->young_Pa, body->poisson}};
        memcpy(r.zone[i].list, d->list, sizeof d->list);
        memcpy(r.zone[i].first, d->first, sizeof d->first);
    }
    return r;
}

/* The blob of one zone; nodes at its seams have the normals of the whole model's surface. */
static void pack_zone(zone_bakery *b, uint32_t i, const rest_surface *surface,
                      const regular_data *regular, const build_options *options) {
    zone_data *d = &b->zone[i];
    const body_spec *body = &b->z->zone[i].body;
    double *area = allocate(d->m.vertices, sizeof *area);
    double(*normal)[3] = allocate(d->m.vertices, sizeof *normal);
    mesh_nodal(&d->m, area, normal);
    for (uint32_t v = 0; v < d->m.vertices; v++) {
        if (surface->vertex[i][v] != PALP_NONE)
            memcpy(normal[v], surface->normal[surface->vertex[i][v]], sizeof normal[v]);
    }
    build_options build = *options;
    build.loads_only = true;
    build.constraint_level = d->dom.domain[PALP_FREE].view.levels - 1;
    build.regular = regular;
    palp_meta meta = {.young_Pa = (float)body->young_Pa,
                      .poisson = (float)body->poisson,
                      .density_kg_m3 = (float)body->density};
    sha256((const char *)d->m.x, d->m.vertices * sizeof *d->m.x, meta.mesh_sha256);
    d->blob = blob_build(&d->m, &d->g, &d->dom, area, normal, meta, &build);
    free(area);
    free(normal);
}

/* The Green's functions of all zones, and the compliance of the model's surface, are dense. */
static void require_memory(const zone_bakery *b) {
    double all = 0, zones = 0, have;
    for (uint32_t i = 0; i < b->z->zones; i++) {
        const double n = b->zone[i].m.vertices;
        all += n;
        zones += 72 * n * n;
    }
    const double need = 1.05 * (zones + 72 * all * all);
    have = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    if (need <= have) return;
    die(EXIT_WORK,
        "%s: the zones have %.0f vertices together: what contact needs of them takes %.1f GB of "
        "memory, this machine has %.1f GB: use coarser meshes, or --modes 0 for a model that is "
        "not touched",
        b->path, all, need * 1e-9, have * 1e-9);
}

static void bake_zones(zone_bakery *b, const build_options *options) {
    if (options->modes > 0) require_memory(b);
    for (uint32_t i = 0; i < b->z->zones; i++) {
        fprintf(stderr, "zone '%s' (%" PRIu32 " of %" PRIu32 ")\n", b->z->zone[i].name, i + 1,
                b->z->zones);
        solve_one(b, i, options);
    }
    rest_model rest = model_at_rest(b);
    rest_surface surface = rest_surface_build(&rest);
    regular_data common = {.modes = 0};
    if (options->modes > 0) {
        uint32_t modes = options->modes + ZONE_MODES * (b->z->zones - 1);
        common = rest_regular(&rest, &surface, modes < PALP_MAX_MODES ? modes : PALP_MAX_MODES);
    }
    for (uint32_t i = 0; i < b->z->zones; i++) {
        regular_data regular = rest_share(&rest, &surface, &common, i);
        pack_zone(b, i, &surface, &regular, options);
        regular_free(&regular);
    }
    for (uint32_t i = 0; i < b->z->zones; i++) {
        free(b->zone[i].g.m);
        domains_free(&b->zone[i].dom);
    }
    rest_surface_free(&surface, b->z->zones);
    regular_free(&common);
}

/* ---- the file ---- */

static palp_joint_entry joint_entry(const joint_spec *j) {
    palp_joint_entry e = {.kind = (uint32_t)j->kind,
                          .parent = j->parent,
                          .child = j->child,
                          .closure = j->closure ? 1 : 0,
                          .low = (float)j->low,
                          .high = (float)j->high};
    memcpy(e.name, j->name, sizeof e.name);
    for (int k = 0; k < 3; k++) {
        e.axis[k] = (float)j->axis[k];
        e.origin_m[k] = (float)j->origin[k];
    }
    return e;
}

static palp_zone_entry zone_entry(const zone_spec *s, uint32_t modes) {
    palp_zone_entry e = {.joint = s->joint, .modes = modes};
    double r[9];
    rotation_of(s->place + 3, r);
    memcpy(e.name, s->name, sizeof e.name);
    for (int k = 0; k < 9; k++) e.rotation[k] = (float)r[k];
    for (int k = 0; k < 3; k++) e.origin_m[k] = (float)s->place[k];
    return e;
}

static uint8_t *write_model(zone_bakery *b, size_t *bytes) {
    const zone_model *z = b->z;
    static section_list t;
    palp_zones_meta meta = {.zones = z->zones, .joints = z->joints, .seams = b->seams};
    palp_zone_entry zones[PALP_MAX_ZONES];
    palp_joint_entry joints[PALP_MAX_JOINTS];
    size_t nodes = 0, values = 0;
    t.count = 0;
    for (uint32_t s = 0; s < b->seams; s++) {
        nodes += b->entry[s].nodes;
        values += (size_t)b->entry[s].nodes * b->entry[s].modes;
    }
    uint32_t(*node)[2] = allocate(nodes + 1, sizeof *node);
    float *mode = allocate(values + 1, sizeof *mode);
    nodes = values = 0;
    for (uint32_t s = 0; s < b->seams; s++) {
        for (uint32_t i = 0; i < b->entry[s].nodes; i++)
            memcpy(node[nodes++], b->seam[s].node[i], sizeof *node);
        for (size_t i = 0; i < (size_t)b->entry[s].nodes * b->entry[s].modes; i++)
            mode[values++] = (float)b->mode[s][i];
    }
    for (uint32_t i = 0; i < z->zones; i++) zones[i] = zone_entry(&z->zone[i], b->zone[i].modes);
    for (uint32_t j = 0; j < z->joints; j++) joints[j] = joint_entry(&z->joint[j]);
    section_add(&t, PALP_SEC_ZONES, &meta, 1, sizeof meta);
    section_add(&t, PALP_SEC_ZONE, zones, z->zones, sizeof *zones);
    section_add(&t, PALP_SEC_JOINT, joints, z->joints, sizeof *joints);
    section_add(&t, PALP_SEC_SEAM, b->entry, b->seams, sizeof *b->entry);
    section_add(&t, PALP_SEC_SEAM_NODE, node, nodes, sizeof *node);
    section_add(&t, PALP_SEC_SEAM_MODE, mode, values, sizeof *mode);
    for (uint32_t i = 0; i < z->zones; i++) {
        const zone_data *d = &b->zone[i];
        uint64_t m = d->modes;
        section_add(&t, PALP_SEC_ZONE_BLOB + i, d->blob.bytes, d->blob.size, 1);
        section_add(&t, PALP_SEC_STIFFNESS + i, d->stiffness, m * (m + 1) / 2, 36);
        section_add(&t, PALP_SEC_SEAM_RESPONSE + i, d->response,
                    m * d->blob.meta.domain_nodes[PALP_FREE], 36);
        section_add(&t, PALP_SEC_REACTION + i, d->reaction,
                    m * d->blob.meta.domain_nodes[PALP_FIXED], 36);
        if (d->weight != NULL) section_add(&t, PALP_SEC_WEIGHT + i, d->weight, m, 36);
    }
    uint8_t *out = blob_assemble(t.entry, t.data, t.count, bytes);
    free(node);
    free(mode);
    return out;
}

/* Opens what was made, as the run time will, and factors it in the rest configuration. */
static void try_out(const zone_bakery *b, const uint8_t *bytes, size_t size) {
    palp_zones *zones = allocate(1, sizeof *zones);
    palp_seams *seams = allocate(1, sizeof *seams);
    palp_status status = palp_zones_open(zones, bytes, size);
    if (status == PALP_OK) {
        size_t need = palp_seams_memsize(zones, PALP_SEAM_LEVELS - 1);
        void *memory = allocate_aligned(need + 1, 1);
        status = palp_seams_init(seams, zones, PALP_SEAM_LEVELS - 1, memory, need);
        free(memory);
    }
    free(seams);
    free(zones);
    if (status == PALP_ERR_NOT_SPD)
        die(EXIT_WORK, "%s: the seams' stiffness is not positive definite: use a finer mesh",
            b->path);
    if (status == PALP_ERR_LIMITS) die(EXIT_WORK, "%s: too many seams meet each other", b->path);
    if (status != PALP_OK)
        die(EXIT_WORK, "%s: the finished model does not open: %s", b->path,
            palp_status_text(status));
}

static void report(FILE *f, const zone_bakery *b, size_t size) {
    for (uint32_t i = 0; i < b->z->zones; i++) {
        const zone_data *d = &b->zone[i];
        fprintf(f,
                "zone %-16s %" PRIu32 " nodes, %" PRIu32
                " bone, reciprocity %.2f %%, RMS %.4f, %zu "
                "bytes\n",
                b->z->zone[i].name, d->m.vertices, d->bones,
                100 * (double)d->blob.meta.reciprocity_residual, (double)d->blob.meta.rms_error,
                d->blob.size);
        if (d->raised > 1e-6)
            fprintf(f, "                      stiffness raised by %.2g to keep it definite\n",
                    d->raised);
    }
    for (uint32_t s = 0; s < b->seams; s++) {
        const palp_seam_entry *e = &b->entry[s];
        fprintf(f, "seam %s - %s: %" PRIu32 " nodes, modes by level", b->z->zone[e->zone[0]].name,
                b->z->zone[e->zone[1]].name, e->nodes);
        for (uint32_t l = 0; l < PALP_SEAM_LEVELS; l++) fprintf(f, " %" PRIu32, e->level_modes[l]);
        fprintf(f, "\n");
    }
    const built *one = &b->zone[0].blob;
    if (one->meta.modes > 0)
        fprintf(f,
                "regular part          %" PRIu32
                " modes for all zones, %.2g of the compliance left over\n",
                one->meta.modes, one->left_over);
    if (b->snapped > 0)
        fprintf(f, "cuts                  vertices moved onto them by at most %.3g m\n",
                b->snapped);
    fprintf(f, "blob                  %zu bytes\n", size);
}

static void save_meshes(const zone_bakery *b, const char *path) {
    const char *name_part = strrchr(path, '/');
    const char *dot = strrchr(name_part != NULL ? name_part : path, '.');
    int stem = dot != NULL ? (int)(dot - path) : (int)strlen(path);
    for (uint32_t i = 0; i < b->z->zones; i++) {
        size_t n = strlen(path) + PALP_NAME_BYTES + 8;
        char *name = allocate(n, 1);
        snprintf(name, n, "%.*s-%s.obj", stem, path, b->z->zone[i].name);
        mesh_save_obj(&b->zone[i].m, name);
        free(name);
    }
}

static uint32_t joint_between(const zone_model *z, const uint32_t zone[2]) {
    uint32_t joint = z->zone[zone[1]].joint;
    return joint != PALP_NONE && z->joint[joint].parent == zone[0] ? joint : PALP_NONE;
}

uint8_t *zone_bake(zone_model *z, const body_spec *common, const build_options *options,
                   const char *path, const char *save_mesh, FILE *f, size_t *bytes) {
    zone_bakery *b = allocate(1, sizeof *b);
    b->z = z;
    b->path = path;
    zone_model_check(z, path);
    for (uint32_t i = 0; i < z->zones; i++) {
        body_require_material(&z->zone[i].body);
        if (z->zone[i].body.compliance != NULL)
            die(EXIT_USAGE,
                "%s: zone '%s': a compliance matrix says nothing of reactions at seams: leave "
                "'compliance' out",
                path, z->zone[i].name);
    }
    if (common->mesh_path != NULL) {
        cut_body(b, common);
    } else {
        load_zones(b);
    }
    b->diagonal = diagonal_of(b);
    find_seams(b);
    orient_seams(b);
    order_seams(b);
    for (uint32_t i = 0; i < z->zones; i++) mesh_require_closed(&b->zone[i].m, z->zone[i].name);
    for (uint32_t s = 0; s < b->seams; s++) {
        palp_seam_entry *e = &b->entry[s];
        memcpy(e->zone, b->seam[s].zone, sizeof e->zone);
        e->joint = joint_between(z, e->zone);
        b->mode[s] = seam_modes(&b->seam[s], &b->zone[e->zone[0]].m, z->seam_modes, e);
    }
    for (uint32_t i = 0; i < z->zones; i++) hold_seams(b, i);
    uint32_t loose = loose_zone(b);
    if (loose != PALP_NONE) {
        die(EXIT_WORK,
            "%s: nothing holds zone '%s' against every motion: give it, or a zone that it is "
            "bonded to, "
            "three bone nodes off one line (fix-...)",
            path, z->zone[loose].name);
    }
    if (save_mesh != NULL) save_meshes(b, save_mesh);
    bake_zones(b, options);
    uint8_t *out = write_model(b, bytes);
    try_out(b, out, *bytes);
    if (f != NULL) report(f, b, *bytes);
    return out;
}
