/* SPDX-License-Identifier: MIT */
/* Commands of `palp` that are in this folder; those of others stand in the headers there. Each gets
 * argv with its own name first and returns the exit code. */
#ifndef PALP_TOOLS_COMMANDS_H
#define PALP_TOOLS_COMMANDS_H

#include <stdbool.h>

int command_bake(int argc, char **argv);
int command_check(int argc, char **argv);
int command_fill(int argc, char **argv);
int command_info(int argc, char **argv);
int command_solve(int argc, char **argv);
int command_calibrate(int argc, char **argv);
int command_pack(int argc, char **argv);
int command_unpack(int argc, char **argv);
int command_replay(int argc, char **argv);
int command_zwidth(int argc, char **argv);
int command_report(int argc, char **argv);
int command_tool(int argc, char **argv);
int command_play(int argc, char **argv);
int command_embed(int argc, char **argv);
int command_view(int argc, char **argv);

/* palp info --device. */
void describe_device(const char *name, double rate_hz, bool json);

#endif
