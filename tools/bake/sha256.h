/* SPDX-License-Identifier: MIT */
/* SHA-256 (FIPS 180-4), for the provenance of a blob. */
#ifndef PALP_TOOLS_SHA256_H
#define PALP_TOOLS_SHA256_H

#include <stddef.h>
#include <stdint.h>

void sha256(const void *data, size_t bytes, uint8_t digest[32]);

#endif
