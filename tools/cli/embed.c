/* SPDX-License-Identifier: MIT */
/* palp embed: a scene as C source, for controllers without files (port/embedded). */
#include "port/host/args.h"
#include "port/host/openscene.h"
#include "port/host/util.h"
#include "tools/cli/commands.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp embed SCENE -o OUT.c [OPTIONS]\n"
    "\n"
    "Writes a scene as C source: bodies, devices, tools and joints as constants, with blobs and "
    "tools "
    "in the\n"
    "section .blob. port/embedded/embedded_scene.h opens it on a controller without files.\n"
    "\n"
    "  -o OUT.c                the source\n"
    "  --rate HZ               in place of the scene's\n";

static const option options[] = {{"-o", 1}, {"--rate", 1}, {NULL, 0}};

typedef struct {
    const char *scene, *output;
    double rate_hz;
} embed_spec;

static void set_option(void *context, const argument *a) {
    embed_spec *s = context;
    if (a->option == NULL) {
        if (s->scene != NULL) die(EXIT_USAGE, "one scene at a time");
        s->scene = a->value[0];
    } else if (strcmp(a->option, "-o") == 0) {
        s->output = a->value[0];
    } else {
        s->rate_hz = arg_between(a, 49, 20001);
    }
}

/* ---- constants ---- */

/* Exact, whatever reads it. */
static void put_float(FILE *f, float x) { fprintf(f, "%af", (double)x); }

static void put_floats(FILE *f, const float *x, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        fputs(i == 0 ? "{" : ", ", f);
        put_float(f, x[i]);
    }
    fputc('}', f);
}

static void put_vector(FILE *f, palp_vec3 v) {
    const float x[3] = {v.x, v.y, v.z};
    put_floats(f, x, 3);
}

static void put_frame(FILE *f, const palp_frame *at) {
    fputc('{', f);
    put_floats(f, at->r, 9);
    fputs(", ", f);
    put_vector(f, at->t);
    fputc('}', f);
}

static void put_field(FILE *f, const char *name, float x) {
    fprintf(f, ".%s = ", name);
    put_float(f, x);
    fputs(", ", f);
}

static void put_axes(FILE *f, const char *name, const float *x) {
    fprintf(f, ".%s = ", name);
    put_floats(f, x, PALP_AXES);
    fputs(",\n     ", f);
}

/* ---- a device ---- */

static void put_drives(FILE *f, const palp_drive_config *d) {
    fprintf(f,
            ".drives = {.protocol = (palp_protocol)%d, .fd = %d, .form = (palp_mit_form)%d, "
            ".master_id = %" PRIu32 ", ",
            (int)d->protocol, d->fd ? 1 : 0, (int)d->form, d->master_id);
    put_field(f, "counts_per_rev", d->counts_per_rev);
    put_field(f, "rated_torque_Nm", d->rated_torque_Nm);
    put_field(f, "torque_max_Nm", d->torque_max_Nm);
    put_field(f, "watchdog_s", d->watchdog_s);
    put_field(f, "torque_lag_s", d->torque_lag_s);
    put_field(f, "rate_hz", d->rate_hz);
    fputs(".range = {", f);
    put_field(f, "position_rad", d->range.position_rad);
    put_field(f, "velocity_rad_s", d->range.velocity_rad_s);
    put_field(f, "torque_Nm", d->range.torque_Nm);
    fputs("}},\n     ", f);
}

static void put_mechanism(FILE *f, const palp_kinematics *k) {
    fprintf(f, ".kinematics = {.mechanism = (palp_mechanism)%d, .wrist = %d, ", (int)k->mechanism,
            k->wrist ? 1 : 0);
    put_field(f, "upper_m", k->upper_m);
    put_field(f, "fore_m", k->fore_m);
    put_field(f, "base_m", k->base_m);
    put_field(f, "gripper_m_per_rad", k->gripper_m_per_rad);
    fputs("},\n     ", f);
}

static void put_device(FILE *f, const palp_device *d) {
    fputs("{", f);
    put_mechanism(f, &d->kinematics);
    put_drives(f, &d->drives);
    fputs(".node_id = {", f);
    for (uint32_t i = 0; i < PALP_AXES; i++) fprintf(f, "%d, ", d->node_id[i]);
    fprintf(f, "}, .passive = %" PRIu32 "u, .homes = %d,\n     ", d->passive, d->homes ? 1 : 0);
    put_axes(f, "gear", d->gear);
    put_axes(f, "joint_zero_rad", d->joint_zero_rad);
    put_axes(f, "joint_home_rad", d->joint_home_rad);
    put_axes(f, "joint_min_rad", d->joint_min_rad);
    put_axes(f, "joint_max_rad", d->joint_max_rad);
    put_field(f, "force_max_N", d->force_max_N);
    put_field(f, "slew_max_N_per_s", d->slew_max_N_per_s);
    put_field(f, "speed_max_m_s", d->speed_max_m_s);
    put_field(f, "workspace_radius_m", d->workspace_radius_m);
    put_field(f, "tool_radius_m", d->tool_radius_m);
    put_field(f, "stiffness_max_N_per_m", d->stiffness_max_N_per_m);
    put_field(f, "damping_max_Ns_per_m", d->damping_max_Ns_per_m);
    put_field(f, "moment_max_Nm", d->moment_max_Nm);
    put_field(f, "stiffness_max_Nm_per_rad", d->stiffness_max_Nm_per_rad);
    put_field(f, "damping_max_Nms_per_rad", d->damping_max_Nms_per_rad);
    put_field(f, "mass_kg", d->mass_kg);
    put_field(f, "damping_Ns_per_m", d->damping_Ns_per_m);
    put_field(f, "bit_rate_bps", d->bit_rate_bps);
    put_field(f, "data_rate_bps", d->data_rate_bps);
    fputs("\n     .compensation = {.gravity_compensation_N = ", f);
    put_vector(f, d->compensation.gravity_compensation_N);
    fputs(",\n     ", f);
    put_axes(f, "coulomb_Nm", d->compensation.coulomb_Nm);
    put_axes(f, "viscous_Nms", d->compensation.viscous_Nms);
    fputs("}}", f);
}

static void put_hand(FILE *f, const palp_hand_config *h) {
    fputs("    {.device =\n     ", f);
    put_device(f, &h->device);
    fprintf(f, ",\n     .resume = %d, .placement = {.origin_m = ", h->resume ? 1 : 0);
    put_vector(f, h->placement.origin_m);
    fputs(", .rotation = ", f);
    put_floats(f, h->placement.rotation, 9);
    fputs(", ", f);
    put_field(f, "scale", h->placement.scale);
    fputs("}},\n", f);
}

/* ---- bodies and tools ---- */

/* A file, as it is, between two names. */
static void put_file(FILE *f, const char *name, uint32_t number, const char *path) {
    char *whole = realpath(path, NULL);
    if (whole == NULL) die(EXIT_WORK, "%s: cannot be found", path);
    if (strpbrk(whole, "\"\\") != NULL)
        die(EXIT_USAGE, "%s: a path with quotes or backslashes cannot stand in C source", whole);
    fprintf(f,
            "__asm__(\".section .blob, \\\"a\\\"\\n.balign 64\\n.global %s_%u\\n%s_%u:\\n"
            ".incbin \\\"%s\\\"\\n.global %s_%u_end\\n%s_%u_end:\\n.text\\n\");\n"
            "extern const uint8_t %s_%u[], %s_%u_end[];\n",
            name, number, name, number, whole, name, number, name, number, name, number, name,
            number);
    free(whole);
}

static void put_tracks(FILE *f, const scene_setup *s, uint32_t number) {
    const scene_part *p = &s->part[number];
    if (p->kind != PALP_BODY_ZONES) return;
    for (uint32_t j = 0; j < p->zones.meta->joints; j++) {
        if (p->joint[j] == NULL) continue;
        fprintf(f, "static const embedded_key key_%u_%u[] = {", number, j);
        for (size_t k = 0; k < p->joint[j]->count; k++)
            fprintf(f, "{%a, %a}, ", p->joint[j]->key[k].t_s, p->joint[j]->key[k].value[0]);
        fputs("};\n", f);
    }
    fprintf(f, "static const embedded_track track_%u[PALP_MAX_JOINTS + 1] = {\n", number);
    for (uint32_t j = 0; j < p->zones.meta->joints; j++) {
        if (p->joint[j] != NULL)
            fprintf(f, "    {%u, %zu, key_%u_%u},\n", j, p->joint[j]->count, number, j);
    }
    fputs("    {0, 0, 0}};\n", f);
}

static uint32_t count_tracks(const scene_part *p) {
    uint32_t count = 0;
    for (uint32_t j = 0; p->kind == PALP_BODY_ZONES && j < p->zones.meta->joints; j++)
        count += p->joint[j] != NULL ? 1 : 0;
    return count;
}

static void put_body(FILE *f, const scene_setup *s, uint32_t number) {
    const palp_body_config *c = &s->body[number];
    const scene_part *p = &s->part[number];
    const double *g = s->file->body[number].gravity_m_s2;
    fprintf(f,
            "    {.config = {.kind = (palp_body_kind)%d, .finest = %" PRIu32 ", .pairs = %d,\n"
            "                .max_points = %" PRIu32 ", .most_class = %" PRIu32 ", .at = ",
            (int)c->kind, c->finest, c->pairs ? 1 : 0, c->max_points, c->most_class);
    put_frame(f, &c->at);
    fputs(",\n                .gravity_m_s2 = ", f);
    put_vector(f, (palp_vec3){(float)g[0], (float)g[1], (float)g[2]});
    fputs(", .material = {", f);
    put_field(f, "lambda_Pa", c->material.lambda_Pa);
    put_field(f, "mu_Pa", c->material.mu_Pa);
    put_field(f, "phi_Pa_s", c->material.phi_Pa_s);
    put_field(f, "psi_Pa_s", c->material.psi_Pa_s);
    put_field(f, "density_kg_m3", c->material.density_kg_m3);
    put_field(f, "drag_per_s", c->material.drag_per_s);
    fprintf(f, "}},\n     .data = body_%u, .end = body_%u_end", number, number);
    if (p->kind == PALP_BODY_ZONES)
        fprintf(f, ", .seams_finest = %" PRIu32 ", .track = track_%u, .tracks = %" PRIu32,
                p->assembly.seams.finest, number, count_tracks(p));
    fputs("},\n", f);
}

static void put_shape(FILE *f, const palp_tool *t) {
    fprintf(f, ".shape = (palp_tool_shape)%d, ", (int)t->shape);
    put_field(f, "friction", t->friction);
    put_field(f, "sliding", t->sliding);
    if (t->shape == PALP_TOOL_OF_BALLS) {
        fputs(".balls = 1, .ball = {{", f);
        put_vector(f, t->ball[0].center_m);
        fputs(", ", f);
        put_float(f, t->ball[0].radius_m);
        fputs("}}, ", f);
    } else if (t->shape == PALP_TOOL_CYLINDER) {
        fputs(".cylinder = {.axis = ", f);
        put_vector(f, t->cylinder.axis);
        fputs(", ", f);
        put_field(f, "radius_m", t->cylinder.radius_m);
        put_field(f, "half_m", t->cylinder.half_m);
        put_field(f, "rim_m", t->cylinder.rim_m);
        fputs("}, ", f);
    } else if (t->shape == PALP_TOOL_PAD) {
        fputs(".pad = {.axis = {", f);
        for (int k = 0; k < 3; k++) {
            put_vector(f, t->pad.axis[k]);
            fputs(", ", f);
        }
        fputs("}, .half_m = ", f);
        put_floats(f, t->pad.half_m, 2);
        fputs(", ", f);
        put_field(f, "edge_m", t->pad.edge_m);
        fputs("}, ", f);
    }
}

static void put_tool(FILE *f, const scene_setup *s, uint32_t number) {
    const palp_scene_tool *t = &s->tool[number];
    fputs("    {.mount = {.tool = {", f);
    put_shape(f, &t->tool);
    fprintf(f, "},\n               .hand = %" PRIu32 ", .at = ", t->hand);
    put_frame(f, &t->at);
    fputs(", ", f);
    put_field(f, "jaw", t->jaw);
    fputs("}", f);
    if (t->tool.shape == PALP_TOOL_FIELD)
        fprintf(f, ", .data = tool_%u, .end = tool_%u_end", number, number);
    fputs("},\n", f);
}

static void put_drive(FILE *f, const palp_scene_drive *d) {
    fprintf(f,
            "    {.body = %" PRIu32 ", .joint = %" PRIu32 ", .hand = %" PRIu32
            ", .by = (palp_driven_by)%d, .axis = %" PRIu32 ", .id = 0x%" PRIx32 ", .byte = %" PRIu32
            ", ",
            d->body, d->joint, d->hand, (int)d->by, d->axis, d->id, d->byte);
    put_field(f, "scale", d->scale);
    put_field(f, "offset", d->offset);
    put_field(f, "fastest", d->fastest);
    fputs("},\n", f);
}

/* ---- all together ---- */

static void take(size_t *sum, size_t bytes) {
    *sum += (bytes + PALP_ALIGN - 1) / PALP_ALIGN * PALP_ALIGN;
}

/* Bytes of all that is opened; of pointers of this machine, so it is enough on smaller ones. */
static size_t memory_of(const scene_setup *s) {
    size_t sum = 0;
    take(&sum, palp_scene_memsize(&s->config));
    for (uint32_t b = 0; b < s->config.bodies; b++) {
        const scene_part *p = &s->part[b];
        if (p->kind == PALP_BODY_ZONES) {
            take(&sum, sizeof p->zones);
            take(&sum, sizeof p->assembly);
            take(&sum, palp_assembly_memsize(&p->zones, p->assembly.seams.finest));
        } else if (p->kind == PALP_BODY_DYNAMIC) {
            take(&sum, sizeof p->tets);
        } else {
            take(&sum, sizeof p->blob);
        }
    }
    return sum;
}

static void put_scene(FILE *f, const scene_setup *s) {
    const palp_scene_config *c = &s->config;
    fprintf(f,
            "/* Made by palp embed from %s. */\n"
            "#include \"port/embedded/embedded_scene.h\"\n\n",
            s->file->name);
    for (uint32_t b = 0; b < c->bodies; b++) put_file(f, "body", b, s->file->body[b].path);
    for (uint32_t t = 0; t < c->tools; t++) {
        if (s->tool[t].tool.shape == PALP_TOOL_FIELD) put_file(f, "tool", t, s->file->tool[t].path);
    }
    for (uint32_t b = 0; b < c->bodies; b++) put_tracks(f, s, b);
    fprintf(f,
            "\nstatic _Alignas(PALP_ALIGN) uint8_t memory[%zu];\n\n"
            "const embedded_scene embedded = {\n"
            "    .bodies = %" PRIu32 ", .tools = %" PRIu32 ", .hands = %" PRIu32
            ", .drives = %" PRIu32 ",\n    ",
            memory_of(s), c->bodies, c->tools, c->hands, c->drives);
    put_field(f, "rate_hz", (float)s->file->rate_hz);
    fputs(".memory = memory, .bytes = sizeof memory,\n    .body = {\n", f);
    for (uint32_t b = 0; b < c->bodies; b++) put_body(f, s, b);
    fputs("    },\n    .tool = {\n", f);
    for (uint32_t t = 0; t < c->tools; t++) put_tool(f, s, t);
    fputs("    },\n    .hand = {\n", f);
    for (uint32_t h = 0; h < c->hands; h++) put_hand(f, &s->hand[h]);
    fputs("    },\n    .drive = {\n", f);
    for (uint32_t d = 0; d < c->drives; d++) put_drive(f, &s->drive[d]);
    fputs(c->drives == 0 ? "    {.body = 0}},\n};\n" : "    },\n};\n", f);
}

int command_embed(int argc, char **argv) {
    embed_spec spec = {.scene = NULL};
    args_parse(argc, argv, options, help, set_option, &spec);
    if (spec.scene == NULL || spec.output == NULL)
        die(EXIT_USAGE, "need a scene and -o OUT.c ('palp embed --help')");
    scene_file *file = scene_read(spec.scene);
    if (spec.rate_hz > 0) file->rate_hz = spec.rate_hz;
    scene_setup *s = scene_set_up(file);
    uint64_t blobs = 0;
    output out = open_output(spec.output);
    put_scene(out.file, s);
    commit_output(&out);
    for (uint32_t b = 0; b < s->config.bodies; b++) blobs += s->part[b].bytes;
    for (uint32_t t = 0; t < s->config.tools; t++) blobs += s->tool_bytes[t];
    printf("%s: %" PRIu64 " bytes of blobs for flash, %zu bytes of memory\n", spec.output, blobs,
           memory_of(s));
    scene_tear_down(s, NULL);
    return EXIT_SUCCESS;
}
