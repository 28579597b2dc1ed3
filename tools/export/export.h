/* SPDX-License-Identifier: MIT */
#ifndef PALP_TOOLS_EXPORT_H
#define PALP_TOOLS_EXPORT_H

/* palp export: a recording or a blob in files that other programs open. */
int command_export(int argc, char **argv);

#endif
