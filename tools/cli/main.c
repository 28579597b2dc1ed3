/* SPDX-License-Identifier: MIT */
#include "core/base/version.h"
#include "tools/cli/commands.h"
#include "tools/export/export.h"
#include "tools/mesh/remesh.h"
#include "tools/study/study.h"
#include "tools/study/reproduce.h"
#include "tools/wcet/wcet.h"
#include "tools/feel/feel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

static const struct {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *summary;
} commands[] = {
    {"remesh", command_remesh, "turn a triangle mesh into one with subdivision connectivity"},
    {"check", command_check, "say what a mesh is and what bake will do with it"},
    {"subdivide", command_subdivide, "refine a control mesh by Loop's scheme"},
    {"bake", command_bake, "compute and compress Green's functions: mesh in, blob out"},
    {"fill", command_fill, "fill a surface with tetrahedra, and say how good they are"},
    {"tool", command_tool, "make a rigid tool of a closed mesh, to touch bodies with"},
    {"info", command_info, "say what a blob holds"},
    {"solve", command_solve, "solve one boundary value problem with a blob"},
    {"study", command_study, "error against compression of a body, every wavelet and level"},
    {"reproduce", command_reproduce, "the paper's tables and figures from our own models"},
    {"wcet", command_wcet, "bound every step of a tick on a target, and say whether it is in time"},
    {"feel", command_feel, "the bench of felt quality: accuracy, ripple, stalls, slow controllers"},
    {"calibrate", command_calibrate, "measure how fast this machine does what the bounds count"},
    {"pack", command_pack, "quantise and entropy-code a blob for transport"},
    {"unpack", command_unpack, "a packed blob back into a blob"},
    {"replay", command_replay, "re-run a recorded session bit for bit"},
    {"report", command_report, "draw a recorded session: one self-contained HTML page"},
    {"view", command_view, "see and touch a body, scene or log on a page in the browser"},
    {"export", command_export,
     "a recording or a blob for other programs: glTF, ParaView, CSV, MCAP"},
    {"play", command_play, "move a multizone model along a scene, in bounded time"},
    {"embed", command_embed, "a scene as C source, for controllers without files"},
    {"zwidth", command_zwidth, "the largest stable stiffness against rate, delay and damping"},
};
#define COMMANDS (sizeof commands / sizeof commands[0])

static void usage(FILE *f) {
    fputs("usage: palp COMMAND [ARGUMENTS]\n\n", f);
    for (size_t i = 0; i < COMMANDS; i++)
        fprintf(f, "  %-10s %s\n", commands[i].name, commands[i].summary);
    fputs("\n'palp COMMAND --help' lists the options of a command.\n", f);
}

int main(int argc, char **argv) {
    if (argc < 2) {
        usage(stderr);
        return EXIT_USAGE;
    }
    if (strcmp(argv[1], "--version") == 0) {
        printf("palp %s\n", PALP_VERSION);
        return EXIT_SUCCESS;
    }
    if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0) {
        usage(stdout);
        return EXIT_SUCCESS;
    }
    for (size_t i = 0; i < COMMANDS; i++) {
        if (strcmp(argv[1], commands[i].name) != 0) continue;
        static char name[32];
        snprintf(name, sizeof name, "palp %s", argv[1]);
        program_name = name;
        return commands[i].run(argc - 1, argv + 1);
    }
    die(EXIT_USAGE, "unknown command '%s' (palp --help lists the commands)", argv[1]);
}
