/* SPDX-License-Identifier: MIT */
/* palp feel: argv with the command's name first; returns the exit code. */
#ifndef PALP_TOOLS_FEEL_FEEL_H
#define PALP_TOOLS_FEEL_FEEL_H

int command_feel(int argc, char **argv);

#endif
