/* SPDX-License-Identifier: MIT */
/* Adaptive binary arithmetic coding of bits and of numbers. Writer and reader adapt alike, so a
 * stream needs no tables. */
#ifndef PALP_TOOLS_RANGECODER_H
#define PALP_TOOLS_RANGECODER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    bool reading;
    uint8_t *data;
    size_t bytes, capacity; /* written so far, or all there is */
    size_t at;              /* read so far; beyond the end zeros are read */
    uint32_t low, high, code;
} coder;

/* Bytes that one byte of a stream can stand for at most: a number of 4 bytes takes 6 bits or more,
 * each of log2(65536 / 65472) = 0.0014 bits or more: 4 * 8 / (6 * 0.0014) = 3,784. */
#define CODER_MOST_EXPANSION 4000u

/* One adaptive bit: 16-bit probability of a one. */
typedef uint16_t bit_model;

/* A number in 0..2^32 - 1: its bit length, then its leading bits, adaptive; the rest as they are.
 */
#define NUMBER_LENGTHS 33u
typedef struct {
    bit_model length[64];
    bit_model lead[NUMBER_LENGTHS][2];
} number_model;

void coder_write(coder *c);
void coder_read(coder *c, const uint8_t *data, size_t bytes);
/* Ends a stream that is written; c->data (to be freed) holds c->bytes. */
void coder_finish(coder *c);

void number_model_init(number_model *m);

/* Codes `bit` or returns the one that was coded. */
uint32_t code_bit(coder *c, bit_model *m, uint32_t bit);
uint32_t code_number(coder *c, number_model *m, uint32_t value);
/* The same for signed values. */
int32_t code_signed(coder *c, number_model *m, int32_t value);
/* Eight bits through a tree of 255 models. */
uint8_t code_byte(coder *c, bit_model tree[256], uint8_t value);

/* Bit length of x, 0 for 0. */
uint32_t bit_length(uint32_t x);

#endif
