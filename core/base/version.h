/* SPDX-License-Identifier: MIT */
/* The release. */
#ifndef PALP_BASE_VERSION_H
#define PALP_BASE_VERSION_H

#define PALP_VERSION "0.3"

#endif
