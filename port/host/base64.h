/* SPDX-License-Identifier: MIT */
/* Bytes as text, for pages and exports. */
#ifndef PALP_HOST_BASE64_H
#define PALP_HOST_BASE64_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

void base64_write(FILE *f, const void *bytes, size_t count);
/* Little-endian, whatever this machine is. */
void base64_write_f32(FILE *f, const float *x, size_t count);
void base64_write_u32(FILE *f, const uint32_t *x, size_t count);
void base64_write_i16(FILE *f, const int16_t *x, size_t count);

#endif
