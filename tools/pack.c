/* SPDX-License-Identifier: MIT */
#include "commands.h"
int command_pack(int argc, char **argv) { (void)argc; (void)argv; return 0; }
int command_unpack(int argc, char **argv) { (void)argc; (void)argv; return 0; }
