/* SPDX-License-Identifier: MIT */
/* palp feel: what reaches the hand, against exact solutions and under disturbance, in virtual time.
 */
#include "tools/feel/feel_device.h"
#include "port/host/args.h"
#include "port/host/blobfile.h"
#include "tools/feel/feel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define PLACES 20 /* where the body is pressed */

static const char help[] =
    "usage: palp feel BLOB [-o DIR] [--json] [--finer BLOB] [--places N] [--every N]\n"
    "\n"
    "Measures what a hand would feel of an elastostatic body, in virtual time, the same on every\n"
    "machine: contact against Hertz' law, ripple while sliding, coarser levels, stalls of the\n"
    "machine and late starts, slow controllers, teleports, closed paths; and with a device, "
    "frames\n"
    "lost, energy given, a tap, a force held by friction. One line for each measure,\n"
    "with the threshold of perception and the goal beside it.\n"
    "\n"
    "  -o DIR        also write feel.json and feel.html there\n"
    "  --json        print JSON in place of the table\n"
    "  --finer BLOB  the same body on a finer mesh: how much the force differs from that\n"
    "  --places N    where the body is pressed (default 20)\n"
    "  --every N     disturb every N-th tick of the script, one run for each (default 20; 1: all)\n"
    "\n"
    "Exit 0 also where goals are missed: the table is the answer.\n";
static const option options[] = {{"-o", 1},       {"--json", 0},  {"--finer", 1},
                                 {"--places", 1}, {"--every", 1}, {NULL, 0}};

typedef struct {
    const char *blob, *finer, *folder;
    bool json;
    uint32_t places, every;
} feel_spec;

static void set_option(void *context, const argument *a) {
    feel_spec *s = context;
    if (a->option == NULL) {
        if (s->blob != NULL) die(EXIT_USAGE, "one blob, not also '%s'", a->value[0]);
        s->blob = a->value[0];
    } else if (strcmp(a->option, "-o") == 0) {
        s->folder = a->value[0];
    } else if (strcmp(a->option, "--finer") == 0) {
        s->finer = a->value[0];
    } else if (strcmp(a->option, "--places") == 0) {
        s->places = arg_u32(a, 0, 1, 1000);
    } else if (strcmp(a->option, "--every") == 0) {
        s->every = arg_u32(a, 0, 1, 10000);
    } else {
        s->json = true;
    }
}

static palp_blob load_touchable(const char *path) {
    palp_blob blob = load_blob(path);
    if (blob.regular.modes == 0)
        die(EXIT_WORK, "%s: has no modes for contact on its surface: bake it again", path);
    return blob;
}

static void write_file(const char *folder, const char *name, const feel_table *t,
                       void (*as)(FILE *, const feel_table *)) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    output out = open_output(path);
    as(out.file, t);
    commit_output(&out);
}

int command_feel(int argc, char **argv) {
    feel_spec spec = {.places = PLACES, .every = 20};
    args_parse(argc, argv, options, help, set_option, &spec);
    if (spec.blob == NULL) die(EXIT_USAGE, "no blob named (--help shows the usage)");
    palp_blob blob = load_touchable(spec.blob), finer = {0};
    if (spec.finer != NULL) finer = load_touchable(spec.finer);
    if (spec.folder != NULL && mkdir(spec.folder, 0777) != 0) {
        struct stat status;
        if (stat(spec.folder, &status) != 0 || !S_ISDIR(status.st_mode))
            die(EXIT_USAGE, "cannot make the folder %s", spec.folder);
    }
    bench b = {.blob = &blob,
               .finer = spec.finer != NULL ? &finer : NULL,
               .every = spec.every,
               .edge_m = (double)blob.meta->mean_edge_m,
               .seed = 7};
    bench_open(&b, spec.places, 3);
    feel_hertz(&b);
    feel_ripple(&b);
    feel_levels(&b);
    feel_hard_places(&b);
    if (b.finer != NULL) feel_finer_mesh(&b);
    feel_closed_paths(&b);
    feel_disturbances(&b);
    feel_device(&b);
    if (spec.folder != NULL) {
        write_file(spec.folder, "feel.json", &b.table, feel_json);
        write_file(spec.folder, "feel.html", &b.table, feel_html);
    }
    (spec.json ? feel_json : feel_text)(stdout, &b.table);
    bench_close(&b);
    return EXIT_SUCCESS;
}
