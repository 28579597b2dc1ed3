/* SPDX-License-Identifier: MIT */
#include "port/host/args.h"
#include "tools/cli/card.h"
#include "tools/cli/commands.h"
#include "port/host/blobfile.h"
#include "core/dyna/tets.h"
#include "core/green/columns.h"
#include "port/host/util.h"
#include "tools/zone/zonesolve.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp info BLOB [--json] [--html OUT.html]\n"
    "       palp info [BLOB] --device NAME|FILE [--rate HZ] [--json]\n"
    "\n"
    "Checks a blob and says what it holds. With a device, its worst-case "
    "bus load at this rate (default "
    "1000 Hz):\n"
    "a warning above 70 %, exit 1 above 100 %.\n"
    "--html writes the blob's card: a page with all of this, how stiff it is where, what its "
    "ticks may take on\n"
    "every shipped target, and how it will feel on every built-in device.\n";

static const option options[] = {
    {"--json", 0}, {"--html", 1}, {"--device", 1}, {"--rate", 1}, {NULL, 0}};

typedef struct {
    const char *blob, *device, *card;
    double rate_hz;
    bool json;
} info_spec;

static void set_option(void *context, const argument *a) {
    info_spec *s = context;
    if (a->option != NULL && strcmp(a->option, "--device") == 0) {
        s->device = a->value[0];
    } else if (a->option != NULL && strcmp(a->option, "--rate") == 0) {
        s->rate_hz = arg_between(a, 49.9, 20000.1);
    } else if (a->option != NULL && strcmp(a->option, "--html") == 0) {
        s->card = a->value[0];
    } else if (a->option != NULL) {
        s->json = true;
    } else if (s->blob == NULL) {
        s->blob = a->value[0];
    } else {
        die(EXIT_USAGE, "one blob, not also '%s'", a->value[0]);
    }
}

static uint64_t level_blocks(const palp_blob *b, uint32_t level) {
    const palp_columns *c = &b->level[level].columns;
    if (level == b->meta->constraint_level) return b->meta->free_blocks;
    uint64_t blocks = 0;
    for (uint32_t j = 0; j < b->level[level].nodes && c->columns > 0; j++)
        blocks += palp_columns_stored(c, j);
    return blocks;
}

static uint64_t table_bytes(const palp_blob *b, uint32_t level) {
    uint64_t n = b->level[level].nodes;
    return b->level[level].table != NULL ? 36 * n * (n + 1) / 2 : 0;
}

static const char *wavelet_name(const palp_blob *b) {
    return palp_blob_has(b, PALP_META_BUTTERFLY) ? "butterfly" : "linear";
}

static const char *form_name(const palp_blob *b) {
    return palp_blob_has(b, PALP_META_SPLIT) ? "split" : "wavelet";
}

/* Of the box around it (m). */
static void size_of(const palp_blob *b, double size[3]) {
    for (size_t k = 0; k < 3; k++) {
        double low = HUGE_VAL, high = -HUGE_VAL;
        for (size_t i = 0; i < b->meta->nodes; i++) {
            double x = (double)b->rest_m[3 * i + k];
            if (x < low) low = x;
            if (x > high) high = x;
        }
        size[k] = high - low;
    }
}

static void print_json(FILE *f, const palp_blob *b, const char *sha, double dense_bytes,
                       double compression) {
    const palp_meta *m = b->meta;
    fprintf(f,
            "{\"nodes\": %" PRIu32 ", \"free_nodes\": %" PRIu32 ", \"fixed_nodes\": %" PRIu32
            ", \"triangles\": %" PRIu32 ", \"levels\": %" PRIu32 ",\n",
            m->nodes, m->domain_nodes[PALP_FREE], m->domain_nodes[PALP_FIXED], m->triangles,
            m->levels);
    double size[3];
    size_of(b, size);
    fprintf(f, " \"size_m\": [%.6g, %.6g, %.6g],\n", size[0], size[1], size[2]);
    fprintf(f,
            " \"young_pa\": %.9g, \"poisson\": %.9g, \"density_kg_m3\": %.9g, \"epsilon\": %.9g,\n",
            (double)m->young_Pa, (double)m->poisson, (double)m->density_kg_m3, (double)m->epsilon);
    fprintf(f,
            " \"form\": \"%s\", \"wavelet\": \"%s\", \"lifted\": %s, \"storage\": \"%s\", "
            "\"reciprocity\": \"%s\",\n",
            form_name(b), wavelet_name(b), palp_blob_has(b, PALP_META_LIFTED) ? "true" : "false",
            palp_blob_has(b, PALP_META_HALF) ? "f16" : "f32",
            palp_blob_has(b, PALP_META_SYMMETRIC) ? "enforce" : "raw");
    fprintf(f, " \"bytes\": %zu, \"dense_bytes\": %.0f, \"compression\": %.9g,\n", b->bytes,
            dense_bytes, compression);
    fprintf(f,
            " \"rms_error\": %.9g, \"max_error\": %.9g, \"reciprocity_residual\": %.9g, "
            "\"equilibrium_residual\": %.9g,\n",
            (double)m->rms_error, (double)m->max_error, (double)m->reciprocity_residual,
            (double)m->equilibrium_residual);
    fprintf(f, " \"mesh_sha256\": \"%s\",\n", sha);
    fprintf(f, " \"stiffness_n_per_m\": {\"min\": %.9g, \"max\": %.9g},\n",
            (double)m->stiffness_min_N_per_m, (double)m->stiffness_max_N_per_m);
    fprintf(f, " \"modes\": %" PRIu32 ",\n", m->modes);
    fprintf(f, " \"scalar\": %s, \"detail_vertices\": %" PRIu32 ",\n",
            palp_blob_has(b, PALP_META_SCALAR) ? "true" : "false", m->detail_vertices);
    fprintf(f, " \"gravity\": %s, \"reactions\": %s,\n",
            palp_blob_has(b, PALP_META_GRAVITY) ? "true" : "false",
            palp_blob_has(b, PALP_META_REACTIONS) ? "true" : "false");
    fprintf(f, " \"constraint_levels\": [");
    for (uint32_t l = 0; l <= m->constraint_level; l++) {
        fprintf(f,
                "%s{\"level\": %" PRIu32 ", \"nodes\": %" PRIu32 ", \"blocks\": %" PRIu64
                ", \"table_bytes\": %" PRIu64 "}",
                l > 0 ? ", " : "", l, b->level[l].nodes, level_blocks(b, l), table_bytes(b, l));
    }
    fprintf(f, "]}\n");
}

static void print_text(FILE *f, const palp_blob *b, const char *sha, double dense_bytes,
                       double compression) {
    const palp_meta *m = b->meta;
    fprintf(f, "nodes                 %" PRIu32 " (%" PRIu32 " free, %" PRIu32 " fixed)\n",
            m->nodes, m->domain_nodes[PALP_FREE], m->domain_nodes[PALP_FIXED]);
    double size[3];
    size_of(b, size);
    fprintf(f, "size                  %.3g x %.3g x %.3g cm\n", 100 * size[0], 100 * size[1],
            100 * size[2]);
    fprintf(f, "triangles             %" PRIu32 ", mean edge %.4g m\n", m->triangles,
            (double)m->mean_edge_m);
    fprintf(f, "levels                %" PRIu32 ", free nodes per level", m->levels);
    for (uint32_t l = 0; l < m->levels; l++) {
        const uint32_t *start = b->domain[PALP_FREE].level_start;
        fprintf(f, " %" PRIu32, start[l + 1] - start[l]);
    }
    fprintf(f, "\nmaterial              Young %.9g Pa, Poisson %.4g, density %.9g kg/m3\n",
            (double)m->young_Pa, (double)m->poisson, (double)m->density_kg_m3);
    fprintf(f, "wavelet               %s %s, epsilon %g, %s form, %s storage\n", wavelet_name(b),
            palp_blob_has(b, PALP_META_LIFTED) ? "lifted" : "unlifted", (double)m->epsilon,
            form_name(b), palp_blob_has(b, PALP_META_HALF) ? "f16" : "f32");
    if (palp_blob_has(b, PALP_META_SPLIT)) {
        uint64_t corrections = 0;
        for (uint32_t j = 0; j < m->domain_nodes[PALP_FREE]; j++)
            corrections += palp_columns_stored(&b->columns[PALP_FREE][PALP_FREE], j);
        fprintf(f,
                "compression           %.2f (%" PRIu32
                " modes and %.1f corrections a node), RMS %.5f, MAX %.5f\n",
                compression, b->split.count,
                (double)corrections / (double)m->domain_nodes[PALP_FREE], (double)m->rms_error,
                (double)m->max_error);
    } else {
        fprintf(f, "compression           %.2f (%" PRIu64 " blocks of %.0f), RMS %.5f, MAX %.5f\n",
                compression, m->free_blocks, compression * (double)m->free_blocks,
                (double)m->rms_error, (double)m->max_error);
    }
    fprintf(f, "constraint levels     ");
    for (uint32_t l = 0; l <= m->constraint_level; l++) {
        fprintf(f, "%s%" PRIu32 ": %" PRIu32 " nodes, %" PRIu64 " blocks", l > 0 ? "; " : "", l,
                b->level[l].nodes, level_blocks(b, l));
        if (b->level[l].table != NULL) fprintf(f, ", table %" PRIu64 " bytes", table_bytes(b, l));
    }
    fprintf(f, "\nreciprocity residual  %.4f %%%s\n", 100 * (double)m->reciprocity_residual,
            palp_blob_has(b, PALP_META_SYMMETRIC) ? ", enforced" : ", kept (raw)");
    fprintf(f, "equilibrium residual  %.4f %%\n", 100 * (double)m->equilibrium_residual);
    fprintf(f, "node stiffness        %.4g to %.4g N/m\n", (double)m->stiffness_min_N_per_m,
            (double)m->stiffness_max_N_per_m);
    fprintf(f, "mesh SHA-256          %s\n", sha);
    fprintf(f, "contact               %" PRIu32 " modes of the regular part\n", m->modes);
    const float *off = b->regular.level_error;
    if (off != NULL) {
        fprintf(f, "levels of contact     ");
        for (uint32_t l = 0; l < PALP_LEVEL_ERRORS; l++)
            fprintf(f, "%s%" PRIu32 ": %.1f (%.1f)", l > 0 ? ", " : "", l, 100 * (double)off[2 * l],
                    100 * (double)off[2 * l + 1]);
        fprintf(f, " %% off the finest in the mean (at worst)\n");
    }
    fprintf(f, "bytes                 %zu (dense free-free block: %.0f)\n", b->bytes, dense_bytes);
}

static void print_body(FILE *f, const palp_blob *b, bool json) {
    char sha[65];
    for (size_t i = 0; i < 32; i++) snprintf(sha + 2 * i, 3, "%02x", b->meta->mesh_sha256[i]);
    double free_nodes = b->meta->domain_nodes[PALP_FREE];
    double columns = b->level[b->meta->constraint_level].nodes;
    double block = palp_blob_has(b, PALP_META_SCALAR) ? 4 : 36;
    double dense_bytes = block * free_nodes * columns;
    double compression = free_nodes * columns / (double)b->meta->free_blocks;
    (json ? print_json : print_text)(f, b, sha, dense_bytes, compression);
}

/* ---- multizone models ---- */

static const char *const joint_kinds[] = {"fixed", "revolute", "prismatic"};

static void print_zones_json(FILE *f, const palp_zones *z, size_t bytes) {
    fprintf(f, "{\"nodes\": %" PRIu32 ", \"bytes\": %zu,\n \"zones\": [", z->nodes, bytes);
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        fprintf(f,
                "%s{\"name\": \"%s\", \"first_node\": %" PRIu32 ", \"seam_modes\": %" PRIu32
                ", \"body\":\n",
                i > 0 ? ",\n  " : "", z->zone[i].name, z->part[i].first_node, z->zone[i].modes);
        print_body(f, &z->blob[i], true);
        fprintf(f, "}");
    }
    fprintf(f, "],\n \"joints\": [");
    for (uint32_t j = 0; j < z->meta->joints; j++) {
        const palp_joint_entry *e = &z->joint[j];
        fprintf(f,
                "%s{\"name\": \"%s\", \"kind\": \"%s\", \"parent\": \"%s\", \"child\": \"%s\", "
                "\"closure\": %s, \"axis\": [%.9g, %.9g, %.9g], \"origin_m\": [%.9g, %.9g, %.9g], "
                "\"low\": %.9g, \"high\": %.9g}",
                j > 0 ? ",\n  " : "", e->name, joint_kinds[e->kind], z->zone[e->parent].name,
                z->zone[e->child].name, e->closure != 0 ? "true" : "false", (double)e->axis[0],
                (double)e->axis[1], (double)e->axis[2], (double)e->origin_m[0],
                (double)e->origin_m[1], (double)e->origin_m[2], (double)e->low, (double)e->high);
    }
    fprintf(f, "],\n \"seams\": [");
    for (uint32_t s = 0; s < z->meta->seams; s++) {
        const palp_seam_entry *e = &z->seam[s];
        fprintf(f, "%s{\"zones\": [\"%s\", \"%s\"], \"nodes\": %" PRIu32 ", \"level_modes\": [",
                s > 0 ? ",\n  " : "", z->zone[e->zone[0]].name, z->zone[e->zone[1]].name, e->nodes);
        for (uint32_t l = 0; l < PALP_SEAM_LEVELS; l++)
            fprintf(f, "%s%" PRIu32, l > 0 ? ", " : "", e->level_modes[l]);
        fprintf(f, "]}");
    }
    fprintf(f, "]}\n");
}

static void print_zones(FILE *f, const palp_zones *z, size_t bytes) {
    fprintf(f,
            "multizone model       %" PRIu32 " zones, %" PRIu32 " seams, %" PRIu32
            " joints, %" PRIu32 " nodes, %zu bytes\n",
            z->meta->zones, z->meta->seams, z->meta->joints, z->nodes, bytes);
    for (uint32_t j = 0; j < z->meta->joints; j++) {
        const palp_joint_entry *e = &z->joint[j];
        fprintf(f, "joint %-15s %s from %s to %s", e->name, joint_kinds[e->kind],
                z->zone[e->parent].name, z->zone[e->child].name);
        if (e->kind != PALP_FIXED_JOINT && e->closure == 0)
            fprintf(f, ", %.6g to %.6g %s", (double)e->low, (double)e->high,
                    e->kind == PALP_REVOLUTE ? "rad" : "m");
        fprintf(f, "%s\n", e->closure != 0 ? ", closes a loop" : "");
    }
    for (uint32_t s = 0; s < z->meta->seams; s++) {
        const palp_seam_entry *e = &z->seam[s];
        fprintf(f, "seam                  %s - %s: %" PRIu32 " nodes, modes by level",
                z->zone[e->zone[0]].name, z->zone[e->zone[1]].name, e->nodes);
        for (uint32_t l = 0; l < PALP_SEAM_LEVELS; l++) fprintf(f, " %" PRIu32, e->level_modes[l]);
        fprintf(f, "\n");
    }
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        fprintf(f, "\nzone %s, nodes from %" PRIu32 "\n", z->zone[i].name, z->part[i].first_node);
        print_body(f, &z->blob[i], false);
    }
}

static void print_tets(FILE *f, const palp_tets *t, size_t bytes, bool json) {
    const palp_tets_meta *m = t->meta;
    if (json) {
        fprintf(
            f,
            "{\"dynamic\": true, \"nodes\": %" PRIu32 ", \"tetrahedra\": %" PRIu32
            ", \"bytes\": %zu, \"young_pa\": %.9g, \"poisson\": %.9g,\n \"density_kg_m3\": %.9g, "
            "\"damping_s\": %.9g, \"drag_per_s\": %.9g, \"diagonal_m\": %.9g, "
            "\"skin_vertices\": %" PRIu32 ",\n \"levels\": [",
            m->nodes, m->tets, bytes, (double)m->young_Pa, (double)m->poisson,
            (double)m->density_kg_m3, (double)m->damping_s, (double)m->drag_per_s,
            (double)m->diagonal_m, m->skin);
    } else {
        fprintf(f,
                "dynamic body          %" PRIu32 " levels, %" PRIu32 " nodes, %" PRIu32
                " tetrahedra, %" PRIu32 " skin vertices, %zu bytes\n",
                m->levels, m->nodes, m->tets, m->skin, bytes);
        fprintf(f,
                "material              Young's modulus %.4g Pa, Poisson's ratio %.4g, %.4g kg/m^3, "
                "damping %.3g s, drag %.3g 1/s\n",
                (double)m->young_Pa, (double)m->poisson, (double)m->density_kg_m3,
                (double)m->damping_s, (double)m->drag_per_s);
    }
    for (uint32_t l = 0; l < m->levels; l++) {
        uint32_t pinned = 0, first = m->first_node[l], end = m->first_node[l + 1];
        double volume = 0;
        for (uint32_t i = first; i < end; i++) {
            pinned += (t->node[i].flags & PALP_TET_PINNED) != 0;
            volume += (double)t->node[i].volume_m3;
        }
        uint32_t families = l + 1 < m->levels ? m->first_family[l + 1] - m->first_family[l] : 0;
        uint32_t tets = m->first_tet[l + 1] - m->first_tet[l];
        if (json) {
            fprintf(f,
                    "%s{\"nodes\": %" PRIu32 ", \"fixed\": %" PRIu32 ", \"tetrahedra\": %" PRIu32
                    ", \"families\": %" PRIu32 ", \"volume_m3\": %.9g}",
                    l > 0 ? ", " : "", end - first, pinned, tets, families, volume);
        } else {
            fprintf(f,
                    "level %" PRIu32 "               %" PRIu32 " nodes (%" PRIu32
                    " fixed), %" PRIu32 " tetrahedra, %" PRIu32 " families, %.4g m^3\n",
                    l, end - first, pinned, tets, families, volume);
        }
    }
    if (json) fprintf(f, "]}\n");
}

/* What is said of a blob of any kind. */
typedef struct {
    const char *path;
    char *data;
    size_t bytes;
    bool json;
} blob_here;

static void describe(FILE *f, const void *context) {
    const blob_here *s = context;
    if (palp_zones_are_here(s->data, s->bytes)) {
        palp_zones *z = open_zones(s->path, s->data, s->bytes);
        (s->json ? print_zones_json : print_zones)(f, z, s->bytes);
        free(z);
    } else if (palp_tets_are_here(s->data, s->bytes)) {
        palp_tets t;
        const palp_status status = palp_tets_open(&t, s->data, s->bytes);
        if (status != PALP_OK) die_of_blob(s->path, status, s->bytes);
        print_tets(f, &t, s->bytes, s->json);
    } else {
        const palp_blob b = open_blob(s->path, s->data, s->bytes);
        print_body(f, &b, s->json);
    }
}

int command_info(int argc, char **argv) {
    info_spec s = {.rate_hz = 1000};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.device != NULL) describe_device(s.device, s.rate_hz, s.json);
    if (s.device != NULL && s.blob == NULL) return EXIT_SUCCESS;
    if (s.blob == NULL) die(EXIT_USAGE, "no blob named (--help shows the usage)");
    blob_here here = {.path = s.blob, .json = s.json};
    here.data = read_file(s.blob, &here.bytes);
    describe(stdout, &here);
    here.json = false;
    if (s.card != NULL) card_write(s.blob, s.card, s.rate_hz, describe, &here);
    return EXIT_SUCCESS;
}
