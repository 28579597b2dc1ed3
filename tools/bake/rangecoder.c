/* SPDX-License-Identifier: MIT */
#include "tools/bake/rangecoder.h"
#include "port/host/util.h"
#include <stdlib.h>

#define EVEN 32768u
#define RATE 5

void coder_write(coder *c) { *c = (coder){.high = UINT32_MAX}; }

static uint8_t next_byte(coder *c) {
    uint8_t b = c->at < c->bytes ? c->data[c->at] : 0;
    c->at++;
    return b;
}

void coder_read(coder *c, const uint8_t *data, size_t bytes) {
    *c = (coder){
        .reading = true, .data = (uint8_t *)(uintptr_t)data, .bytes = bytes, .high = UINT32_MAX};
    for (int i = 0; i < 4; i++) c->code = c->code << 8 | next_byte(c);
}

static void put_byte(coder *c, uint32_t byte) {
    c->data = grow(c->data, &c->capacity, c->bytes + 1, 1);
    c->data[c->bytes++] = (uint8_t)byte;
}

void coder_finish(coder *c) {
    for (int i = 0; i < 4; i++) {
        put_byte(c, c->high >> 24);
        c->high <<= 8;
    }
}

/* Splits low..high in proportion and keeps the part of the bit. */
static uint32_t code_with(coder *c, uint32_t chance, uint32_t bit) {
    uint32_t middle = c->low + (uint32_t)(((uint64_t)(c->high - c->low) * chance) >> 16);
    if (c->reading) bit = c->code <= middle;
    if (bit != 0) c->high = middle;
    if (bit == 0) c->low = middle + 1;
    while (((c->low ^ c->high) & 0xff000000u) == 0) {
        if (c->reading) {
            c->code = c->code << 8 | next_byte(c);
        } else {
            put_byte(c, c->high >> 24);
        }
        c->low <<= 8;
        c->high = c->high << 8 | 255u;
    }
    return bit;
}

uint32_t code_bit(coder *c, bit_model *m, uint32_t bit) {
    uint32_t chance = *m < 64 ? 64 : *m > 65472 ? 65472 : *m;
    bit = code_with(c, chance, bit);
    *m = (bit_model)(bit != 0 ? *m + ((65535 - *m) >> RATE) : *m - (*m >> RATE));
    return bit;
}

void number_model_init(number_model *m) {
    for (int i = 0; i < 64; i++) m->length[i] = EVEN;
    for (uint32_t i = 0; i < NUMBER_LENGTHS; i++) m->lead[i][0] = m->lead[i][1] = EVEN;
}

uint32_t bit_length(uint32_t x) {
    uint32_t n = 0;
    for (; x != 0; x >>= 1) n++;
    return n;
}

uint32_t code_number(coder *c, number_model *m, uint32_t value) {
    uint32_t length = bit_length(value), node = 1;
    for (int i = 5; i >= 0; i--) node = node << 1 | code_bit(c, &m->length[node], length >> i & 1u);
    length = (node & 63u) < NUMBER_LENGTHS ? node & 63u : NUMBER_LENGTHS - 1;
    uint32_t result = length > 0 ? 1 : 0;
    for (uint32_t i = 1; i < length; i++) {
        uint32_t bit = value >> (length - 1 - i) & 1u;
        bit = i <= 2 ? code_bit(c, &m->lead[length][i - 1], bit) : code_with(c, EVEN, bit);
        result = result << 1 | bit;
    }
    return result;
}

int32_t code_signed(coder *c, number_model *m, int32_t value) {
    uint32_t size = code_number(c, m, (uint32_t)(value < 0 ? -value : value)) & 0x7fffffffu;
    uint32_t negative = size > 0 ? code_with(c, EVEN, value < 0) : 0;
    return negative != 0 ? -(int32_t)size : (int32_t)size;
}

uint8_t code_byte(coder *c, bit_model tree[256], uint8_t value) {
    uint32_t node = 1;
    for (int i = 7; i >= 0; i--)
        node = node << 1 | code_bit(c, &tree[node], (uint32_t)value >> i & 1u);
    return (uint8_t)node;
}
