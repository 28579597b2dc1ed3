/* SPDX-License-Identifier: MIT */
/* The commands of `palp`; each gets argv with its own name first and returns the exit code. */
#ifndef PALP_TOOLS_COMMANDS_H
#define PALP_TOOLS_COMMANDS_H

#include "core/zone/zones.h"

int command_remesh(int argc, char **argv);
int command_subdivide(int argc, char **argv);
int command_bake(int argc, char **argv);
int command_fill(int argc, char **argv);
int command_info(int argc, char **argv);
int command_solve(int argc, char **argv);
int command_study(int argc, char **argv);
int command_reproduce(int argc, char **argv);
int command_wcet(int argc, char **argv);
int command_feel(int argc, char **argv);
int command_calibrate(int argc, char **argv);
int command_pack(int argc, char **argv);
int command_unpack(int argc, char **argv);
/* Of sim, which uses tools. */
int command_replay(int argc, char **argv);
int command_zwidth(int argc, char **argv);
int command_report(int argc, char **argv);
int command_play(int argc, char **argv);
void describe_device(const char *name, double rate_hz, bool json);

/* Reads and opens a blob; exits 2 if it cannot be read, 1 if it is not sound. The bytes stay
 * allocated. */
palp_blob load_blob(const char *path);
/* The same from bytes already read. */
palp_blob open_blob(const char *path, const void *data, size_t bytes);

#endif
