/* SPDX-License-Identifier: MIT */
/* Functions that are never inlined, where a bound says how often they are called: tests/wcet/ipet
 * finds them in the binary by their names. */
#ifndef PALP_BASE_APART_H
#define PALP_BASE_APART_H

#define PALP_APART __attribute__((noinline))

#endif
