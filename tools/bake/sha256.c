/* SPDX-License-Identifier: MIT */
#include "tools/bake/sha256.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* First 32 bits of the fractional part of the `root`-th root of `prime`. */
static uint32_t fraction_bits(uint32_t prime, int root) {
    long double r = root == 2 ? sqrtl((long double)prime) : cbrtl((long double)prime);
    return (uint32_t)((r - floorl(r)) * 4294967296.0L);
}

static uint32_t next_prime(uint32_t p) {
    for (;;) {
        uint32_t d = 2;
        p++;
        while (d * d <= p && p % d != 0) d++;
        if (d * d > p) return p;
    }
}

static uint32_t rotate(uint32_t x, int n) { return x >> n | x << (32 - n); }

static void process(uint32_t h[8], const uint32_t k[64], const uint8_t *block) {
    uint32_t w[64], s[8];
    for (int i = 0; i < 16; i++) {
        w[i] = (uint32_t)block[4 * i] << 24 | (uint32_t)block[4 * i + 1] << 16 |
               (uint32_t)block[4 * i + 2] << 8 | block[4 * i + 3];
    }
    for (int i = 16; i < 64; i++) {
        uint32_t a = rotate(w[i - 15], 7) ^ rotate(w[i - 15], 18) ^ w[i - 15] >> 3;
        uint32_t b = rotate(w[i - 2], 17) ^ rotate(w[i - 2], 19) ^ w[i - 2] >> 10;
        w[i] = w[i - 16] + a + w[i - 7] + b;
    }
    memcpy(s, h, sizeof s);
    for (int i = 0; i < 64; i++) {
        uint32_t sum1 = rotate(s[4], 6) ^ rotate(s[4], 11) ^ rotate(s[4], 25);
        uint32_t choose = (s[4] & s[5]) ^ (~s[4] & s[6]);
        uint32_t t1 = s[7] + sum1 + choose + k[i] + w[i];
        uint32_t sum0 = rotate(s[0], 2) ^ rotate(s[0], 13) ^ rotate(s[0], 22);
        uint32_t majority = (s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]);
        memmove(s + 1, s, 7 * sizeof *s);
        s[4] += t1;
        s[0] = t1 + sum0 + majority;
    }
    for (int i = 0; i < 8; i++) h[i] += s[i];
}

void sha256(const void *data, size_t bytes, uint8_t digest[32]) {
    uint32_t h[8], k[64];
    for (uint32_t i = 0, p = 2; i < 64; i++, p = next_prime(p)) {
        if (i < 8) h[i] = fraction_bits(p, 2);
        k[i] = fraction_bits(p, 3);
    }
    size_t blocks = (bytes + 9 + 63) / 64;
    uint8_t *padded = allocate(blocks, 64);
    memcpy(padded, data, bytes);
    padded[bytes] = 0x80;
    for (size_t i = 0; i < 8; i++)
        padded[64 * blocks - 1 - i] = (uint8_t)((uint64_t)bytes * 8 >> (8 * i));
    for (size_t i = 0; i < blocks; i++) process(h, k, padded + 64 * i);
    for (size_t i = 0; i < 32; i++) digest[i] = (uint8_t)(h[i / 4] >> (24 - 8 * (i % 4)));
    free(padded);
}
