/* SPDX-License-Identifier: MIT */
/* CRC-32C (Castagnoli): reflected polynomial 0x82f63b78, initial and final inversion. */
#ifndef PALP_BASE_CRC32C_H
#define PALP_BASE_CRC32C_H

#include <stddef.h>
#include <stdint.h>

/*
 * CRC of `bytes` bytes at `data`, continuing `crc` (0 to start), so that
 * crc(ab) = palp_crc32c(palp_crc32c(0, a), b). Cost: one look-up per byte in a constant table of 1
 * KiB, of long runs four side by side; where the processor was promised to have it (-msse4.2,
 * -march=armv8-a+crc) one instruction per eight bytes.
 */
uint32_t palp_crc32c(uint32_t crc, const void *data, size_t bytes);

#endif
