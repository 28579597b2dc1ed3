/* SPDX-License-Identifier: MIT */
#include "tools/export/export.h"
#include "core/blob/format.h"
#include "port/host/args.h"
#include "port/host/report.h"
#include "port/host/stiffness.h"
#include "port/host/util.h"
#include "tools/export/gltf.h"
#include "tools/export/mcap.h"
#include "tools/export/vtu.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define GLTF_FPS 30.0
#define VTU_FPS 10.0
#define MOST_LINE 1024u

static const char help[] =
    "usage: palp export BLOB --gltf|--vtu|--csv -o OUT\n"
    "       palp export LOG BLOB|SCENE --gltf|--vtu -o OUT [--fps N] [--from S] [--to S] [--tool "
    "FILE]\n"
    "       palp export LOG --csv|--mcap -o OUT [--from S] [--to S]\n"
    "\n"
    "Writes what a blob holds, or what was recorded by 'palpd --log LOG', for other programs.\n"
    "\n"
    "  --gltf      glTF 2.0: surfaces and tools, of a log in motion; OUT.glb is binary, OUT.gltf "
    "text\n"
    "  --vtu       ParaView: of a blob OUT.vtu; of a log OUT.pvd, with a file for each frame "
    "beside it\n"
    "  --csv       of a blob a line for each node, of a log one for each tick and device\n"
    "  --mcap      Foxglove and others: JSON messages with their schemas, a topic for each device\n"
    "  --fps N     frames a second (--gltf: 30, --vtu: 10)\n"
    "  --from S, --to S  the part of a log from and to these times, in s from its beginning\n"
    "  --tool FILE the tool of a session with one blob, if it had one of its own\n";

static const option options[] = {{"--gltf", 0}, {"--vtu", 0}, {"--csv", 0},  {"--mcap", 0},
                                 {"-o", 1},     {"--fps", 1}, {"--from", 1}, {"--to", 1},
                                 {"--tool", 1}, {NULL, 0}};

typedef enum { AS_NOTHING, AS_GLTF, AS_VTU, AS_CSV, AS_MCAP } form;

typedef struct {
    form as;
    const char *first, *second, *output;
    film_spec film;
    bool ranged, is_blob;
} export_spec;

static void choose(export_spec *s, form as) {
    if (s->as != AS_NOTHING && s->as != as)
        die(EXIT_USAGE, "one of --gltf, --vtu, --csv and --mcap");
    s->as = as;
}

static void set_option(void *context, const argument *a) {
    static const char *const forms[] = {"", "--gltf", "--vtu", "--csv", "--mcap"};
    export_spec *s = context;
    const char *o = a->option;
    for (int i = 1; o != NULL && i < 5; i++)
        if (strcmp(o, forms[i]) == 0) choose(s, (form)i);
    if (o == NULL && s->first == NULL)
        s->first = a->value[0];
    else if (o == NULL && s->second == NULL)
        s->second = a->value[0];
    else if (o == NULL)
        die(EXIT_USAGE, "one blob, or one log and its blob or scene, not also '%s'", a->value[0]);
    else if (strcmp(o, "-o") == 0)
        s->output = a->value[0];
    else if (strcmp(o, "--fps") == 0)
        s->film.fps = arg_between(a, 0, 20000);
    else if (strcmp(o, "--tool") == 0)
        s->film.tool = a->value[0];
    else if (strcmp(o, "--from") == 0)
        s->film.from_s = arg_double(a, 0);
    else if (strcmp(o, "--to") == 0)
        s->film.to_s = arg_double(a, 0);
    s->ranged = s->ranged || (o != NULL && (strcmp(o, "--fps") == 0 || strcmp(o, "--from") == 0 ||
                                            strcmp(o, "--to") == 0));
}

static bool is_blob(const char *path) {
    char magic[sizeof PALP_BLOB_MAGIC] = "";
    FILE *f = fopen(path, "rb");
    if (f == NULL) die(EXIT_USAGE, "cannot read %s", path);
    const size_t n = fread(magic, 1, strlen(PALP_BLOB_MAGIC), f);
    fclose(f);
    return n == strlen(PALP_BLOB_MAGIC) && memcmp(magic, PALP_BLOB_MAGIC, n) == 0;
}

static film *take_film(export_spec *s) {
    if (s->is_blob) return film_of_blob(s->first);
    if (s->second == NULL)
        die(EXIT_USAGE, "a log holds forces, not bodies: name its blob or scene behind it");
    s->film.log = s->first;
    s->film.body = s->second;
    if (!(s->film.fps > 0)) s->film.fps = s->as == AS_GLTF ? GLTF_FPS : VTU_FPS;
    return film_of_log(&s->film);
}

/* ---- surfaces ---- */

static int export_gltf(export_spec *s) {
    const bool text = has_extension(s->output, ".gltf");
    if (!text && !has_extension(s->output, ".glb"))
        die(EXIT_USAGE, "-o %s: need a name that ends in .glb or .gltf", s->output);
    const film *f = take_film(s);
    output out = open_output(s->output);
    const gltf_report r = gltf_write(out.file, f, !text);
    const long bytes = ftell(out.file);
    commit_output(&out);
    printf("%s: %" PRIu32 " surfaces, %" PRIu32 " nodes, %ld bytes\n", s->output, f->parts,
           f->nodes, bytes);
    if (f->frames > 0)
        printf("%zu frames from %.4g to %.4g s, by %" PRIu32
               " shapes: off by at most %.2g mm of %.3g mm\n",
               f->frames, f->frame[0].t_s, f->frame[f->frames - 1].t_s, r.shapes, 1e3 * r.missed_m,
               1e3 * r.largest_m);
    return EXIT_SUCCESS;
}

static int export_vtu(export_spec *s) {
    const char *end = s->is_blob ? ".vtu" : ".pvd";
    if (!has_extension(s->output, end))
        die(EXIT_USAGE, "-o %s: need a name that ends in %s", s->output, end);
    const film *f = take_film(s);
    if (s->is_blob) {
        output out = open_output(s->output);
        vtu_write_rest(out.file, f);
        commit_output(&out);
        printf("%s: %" PRIu32 " nodes\n", s->output, f->nodes);
        return EXIT_SUCCESS;
    }
    const int stem = (int)(strlen(s->output) - strlen(end));
    char name[1024];
    for (size_t i = 0; i < f->frames; i++) {
        snprintf(name, sizeof name, "%.*s_%04zu.vtu", stem, s->output, i);
        output out = open_output(name);
        vtu_write_frame(out.file, f, i);
        commit_output(&out);
    }
    const char *slash = strrchr(s->output, '/');
    const int folder = slash != NULL ? (int)(slash + 1 - s->output) : 0;
    snprintf(name, sizeof name, "%.*s", stem - folder, s->output + folder);
    output out = open_output(s->output);
    pvd_write(out.file, f, name);
    commit_output(&out);
    printf("%s: %zu frames of %" PRIu32 " nodes\n", s->output, f->frames, f->nodes);
    return EXIT_SUCCESS;
}

static int nodes_csv(const export_spec *s) {
    const film *f = film_of_blob(s->first);
    output out = open_output(s->output);
    fputs("part,node,x,y,z,nx,ny,nz,fixed,area_m2,stiffness_N_per_m\n", out.file);
    for (uint32_t k = 0; k < f->parts; k++) {
        const film_part *p = &f->part[k];
        film one = {.parts = 1, .nodes = p->nodes};
        float *normal = allocate(3 * (size_t)p->nodes, sizeof *normal),
              *stiffness = allocate(p->nodes, sizeof *stiffness);
        one.part[0] = *p;
        film_normals(&one, p->rest_m, normal);
        const bool known = p->blob != NULL && !palp_blob_has(p->blob, PALP_META_SCALAR);
        if (p->blob != NULL) memcpy(normal, p->blob->normal, 3 * (size_t)p->nodes * sizeof *normal);
        if (known) node_stiffness(p->blob, stiffness);
        for (uint32_t i = 0; i < p->nodes; i++) {
            fprintf(out.file, "%s,%" PRIu32, p->name, i);
            for (size_t e = 0; e < 3; e++) fprintf(out.file, ",%.9g", (double)p->rest_m[3 * i + e]);
            for (size_t e = 0; e < 3; e++) fprintf(out.file, ",%.9g", (double)normal[3 * i + e]);
            fprintf(out.file, ",%d", p->fixed[i]);
            if (p->blob != NULL)
                fprintf(out.file, ",%.9g", (double)p->blob->area_m2[i]);
            else
                fputc(',', out.file);
            if (known)
                fprintf(out.file, ",%.9g\n", (double)stiffness[i]);
            else
                fputs(",\n", out.file);
        }
        free(normal);
        free(stiffness);
    }
    commit_output(&out);
    return EXIT_SUCCESS;
}

/* ---- ticks ---- */

/* Calls put(to, tick, device, t_s) for each tick of a log and device that is wanted. */
typedef void put_tick(void *to, const tick_record *t, uint32_t device, double t_s);

static size_t each_tick(const export_spec *s, put_tick *put, void *to, uint32_t *devices) {
    session_record session;
    record_reader *reader = record_open(s->first, &session);
    *devices = session.scene->devices;
    tick_record *t = allocate(1, record_bytes(*devices));
    size_t count = 0;
    for (uint64_t lost; record_next(reader, t, &lost);) {
        const double t_s = (double)t->hand[0].report.tick / session.scene->rate_hz;
        if (t_s < s->film.from_s || t_s > s->film.to_s) continue;
        for (uint32_t h = 0; h < t->hands; h++) put(to, t, h, t_s);
        count++;
    }
    record_close(reader);
    free(t);
    if (count == 0)
        die(EXIT_WORK, "%s: no tick on record between %g and %g s", s->first, s->film.from_s,
            s->film.to_s);
    return count;
}

static void put_line(void *to, const tick_record *t, uint32_t device, double t_s) {
    const palp_report *r = &t->hand[device].report;
    const float v[] = {r->tip_m.x,   r->tip_m.y,  r->tip_m.z,    r->force_N.x, r->force_N.y,
                       r->force_N.z, r->stored_J, r->absorbed_J, r->given_J};
    fprintf(to, "%.9g,%" PRIu32 ",%s,%" PRIu32 ",%" PRIu32 ",%" PRIu32 ",%" PRIu32 ",%d", t_s,
            device, report_state(r->state), r->faults, r->level, r->points, r->active,
            r->held ? 1 : 0);
    for (int i = 0; i < 9; i++) fprintf(to, ",%.9g", (double)v[i]);
    fprintf(to, ",%.9g,%.9g,%" PRIu32 "\n", 1e-3 * (double)r->elapsed_ns, (double)t->late_us,
            t->hand[device].events);
}

static int ticks_csv(const export_spec *s) {
    uint32_t devices;
    output out = open_output(s->output);
    fputs("t_s,device,state,faults,level,points,active,held,x,y,z,fx,fy,fz,stored_J,absorbed_J,"
          "given_J,tick_us,late_us,events\n",
          out.file);
    const size_t n = each_tick(s, put_line, out.file, &devices);
    commit_output(&out);
    if (strcmp(s->output, "-") != 0)
        printf("%s: %zu ticks of %" PRIu32 " devices\n", s->output, n, devices);
    return EXIT_SUCCESS;
}

#define VECTOR                                                                                     \
    "{\"type\":\"object\",\"properties\":{\"x\":{\"type\":\"number\"},\"y\":{\"type\":\"number\"}" \
    ",\"z\":{\"type\":\"number\"}}}"
#define NUMBER(name) "\"" name "\":{\"type\":\"number\"}"
#define WHOLE(name) "\"" name "\":{\"type\":\"integer\"}"

static const char schema[] = "{\"type\":\"object\",\"title\":\"palp.Tick\",\"properties\":{" NUMBER("t_s") ",\"state\":{\"type\":\"string\"}," WHOLE("faults") "," WHOLE(
    "level") "," WHOLE("points") "," WHOLE("active") ",\"held\":{\"type\":\"boolean\"},\"tip_"
                                                     "m\":" VECTOR ",\"force_N\":" VECTOR
                                                     "," NUMBER("stored_J") "," NUMBER("absorbed_J") "," NUMBER("given_J") "," NUMBER(
                                                         "tick_us") "," NUMBER("late_us") "," WHOLE("events") "}}";

typedef struct {
    mcap *file;
    uint16_t channel[PALP_SCENE_HANDS];
    uint32_t channels;
} mcap_target;

static void put_message(void *to, const tick_record *t, uint32_t device, double t_s) {
    const mcap_target *m = to;
    const palp_report *r = &t->hand[device].report;
    char text[MOST_LINE];
    const int n = snprintf(text, sizeof text,
                           "{\"t_s\":%.9g,\"state\":\"%s\",\"faults\":%" PRIu32
                           ",\"level\":%" PRIu32 ",\"points\":%" PRIu32 ",\"active\":%" PRIu32
                           ",\"held\":%s,\"tip_m\":{\"x\":%.9g,\"y\":%.9g,\"z\":%.9g},\"force_N\":{"
                           "\"x\":%.9g,\"y\":%.9g,\"z\":%.9g},"
                           "\"stored_J\":%.9g,\"absorbed_J\":%.9g,\"given_J\":%.9g,\"tick_us\":%."
                           "9g,\"late_us\":%.9g,\"events\":%" PRIu32 "}",
                           t_s, report_state(r->state), r->faults, r->level, r->points, r->active,
                           r->held ? "true" : "false", (double)r->tip_m.x, (double)r->tip_m.y,
                           (double)r->tip_m.z, (double)r->force_N.x, (double)r->force_N.y,
                           (double)r->force_N.z, (double)r->stored_J, (double)r->absorbed_J,
                           (double)r->given_J, 1e-3 * (double)r->elapsed_ns, (double)t->late_us,
                           t->hand[device].events);
    mcap_message(m->file, m->channel[device], (uint64_t)llrint(1e9 * t_s), text, (size_t)n);
}

static int ticks_mcap(const export_spec *s) {
    static const char *const topics[] = {"/palp/device0", "/palp/device1", "/palp/device2",
                                         "/palp/device3"};
    session_record session;
    record_close(record_open(s->first, &session));
    output out = open_output(s->output);
    mcap_target m = {.file = mcap_open(out.file)};
    for (uint32_t d = 0; d < session.scene->devices; d++)
        m.channel[d] = mcap_channel(m.file, topics[d], "palp.Tick", schema);
    uint32_t devices;
    const size_t n = each_tick(s, put_message, &m, &devices);
    mcap_close(m.file);
    commit_output(&out);
    printf("%s: %zu ticks of %" PRIu32 " devices\n", s->output, n, devices);
    return EXIT_SUCCESS;
}

int command_export(int argc, char **argv) {
    export_spec s = {.film = {.from_s = 0, .to_s = HUGE_VAL}};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.first == NULL) die(EXIT_USAGE, "no blob or log (--help shows the usage)");
    if (s.as == AS_NOTHING) die(EXIT_USAGE, "what as? One of --gltf, --vtu, --csv and --mcap");
    if (s.output == NULL) die(EXIT_USAGE, "no output: add -o OUT");
    if (scene_is_here(s.first))
        die(EXIT_USAGE, "%s: a scene has nothing to export: its blobs have, and logs of it",
            s.first);
    s.is_blob = is_blob(s.first);
    if (s.is_blob && s.second != NULL)
        die(EXIT_USAGE, "%s is a blob: the log comes first", s.first);
    if (s.is_blob && (s.ranged || s.film.tool != NULL))
        die(EXIT_USAGE, "--fps, --from, --to and --tool are for logs; %s is a blob", s.first);
    if (s.is_blob && s.as == AS_MCAP) die(EXIT_USAGE, "--mcap is for logs; %s is a blob", s.first);
    if (!(s.film.from_s >= 0 && s.film.from_s < s.film.to_s))
        die(EXIT_USAGE, "--from %g --to %g: need 0 <= from < to", s.film.from_s, s.film.to_s);
    switch (s.as) {
    case AS_GLTF:
        return export_gltf(&s);
    case AS_VTU:
        return export_vtu(&s);
    case AS_MCAP:
        return ticks_mcap(&s);
    default:
        return s.is_blob ? nodes_csv(&s) : ticks_csv(&s);
    }
}
