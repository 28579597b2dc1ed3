/* SPDX-License-Identifier: MIT */
#include "port/host/candump.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

void candump_write(FILE *f, double time_s, const char *interface, const palp_can_frame *frame) {
    static const char digits[] = "0123456789ABCDEF";
    char data[2 * PALP_CAN_MAX_DATA + 1];
    for (uint32_t i = 0; i < frame->length; i++) {
        data[2 * i] = digits[frame->data[i] >> 4];
        data[2 * i + 1] = digits[frame->data[i] & 15];
    }
    data[2 * frame->length] = '\0';
    fprintf(f, "(%017.6f) %s %0*" PRIX32 "%s%s\n", time_s, interface,
            (frame->flags & PALP_CAN_EXTENDED) != 0 ? 8 : 3, frame->id,
            (frame->flags & PALP_CAN_FD) != 0 ? "##1" : "#",
            (frame->flags & PALP_CAN_REMOTE) != 0 ? "R" : data);
}

static int hex_digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/* "id#data", "id#R" or "id##<flags>data". */
static bool read_frame(const char *word, palp_can_frame *frame) {
    char *end;
    *frame = (palp_can_frame){.id = (uint32_t)strtoul(word, &end, 16)};
    if (*end != '#') return false;
    if (end - word == 8) frame->flags |= PALP_CAN_EXTENDED;
    const char *data = end + 1;
    if (*data == '#') {
        frame->flags |= PALP_CAN_FD;
        if (hex_digit(data[1]) < 0) return false;
        data += 2;
    } else if (*data == 'R') {
        frame->flags |= PALP_CAN_REMOTE;
        return true;
    }
    size_t digits = strlen(data), most = (frame->flags & PALP_CAN_FD) != 0 ? 64 : 8;
    if (digits % 2 != 0 || digits / 2 > most) return false;
    frame->length = (uint8_t)(digits / 2);
    for (size_t i = 0; i < digits / 2; i++) {
        int high = hex_digit(data[2 * i]), low = hex_digit(data[2 * i + 1]);
        if (high < 0 || low < 0) return false;
        frame->data[i] = (uint8_t)(16 * high + low);
    }
    return true;
}

bool candump_read(const char *line, double *time_s, char interface[CANDUMP_NAME],
                  palp_can_frame *frame) {
    char word[CANDUMP_LINE];
    return sscanf(line, "(%lf) %31s %255s", time_s, interface, word) == 3 &&
           read_frame(word, frame);
}
