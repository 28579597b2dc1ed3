/* SPDX-License-Identifier: MIT */
#include "port/host/base64.h"
#include "core/device/canframe.h"
#include "port/host/util.h"
#include <stdlib.h>

void base64_write(FILE *f, const void *bytes, size_t count) {
    static const char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const uint8_t *x = bytes;
    for (size_t i = 0; i < count; i += 3) {
        const uint32_t v = (uint32_t)x[i] << 16 | (i + 1 < count ? (uint32_t)x[i + 1] << 8 : 0) |
                           (i + 2 < count ? x[i + 2] : 0);
        const char text[4] = {digit[v >> 18], digit[v >> 12 & 63],
                              i + 1 < count ? digit[v >> 6 & 63] : '=',
                              i + 2 < count ? digit[v & 63] : '='};
        fwrite(text, 1, 4, f);
    }
}

void base64_write_u32(FILE *f, const uint32_t *x, size_t count) {
    uint8_t *bytes = allocate(4 * count + 1, 1);
    for (size_t i = 0; i < count; i++) palp_put_u32(bytes + 4 * i, x[i]);
    base64_write(f, bytes, 4 * count);
    free(bytes);
}

void base64_write_f32(FILE *f, const float *x, size_t count) {
    uint8_t *bytes = allocate(4 * count + 1, 1);
    for (size_t i = 0; i < count; i++) palp_put_f32(bytes + 4 * i, x[i]);
    base64_write(f, bytes, 4 * count);
    free(bytes);
}

void base64_write_i16(FILE *f, const int16_t *x, size_t count) {
    uint8_t *bytes = allocate(2 * count + 1, 1);
    for (size_t i = 0; i < count; i++) palp_put_u16(bytes + 2 * i, (uint16_t)x[i]);
    base64_write(f, bytes, 2 * count);
    free(bytes);
}
