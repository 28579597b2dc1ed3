/* SPDX-License-Identifier: MIT */
#include "candump.h"
#include <inttypes.h>

void candump_line(FILE *f, double time_s, const char *interface, const palp_can_frame *frame) {
    fprintf(f, "(%017.6f) %s ", time_s, interface);
    fprintf(f, (frame->flags & PALP_CAN_EXTENDED) != 0 ? "%08" PRIX32 "#" : "%03" PRIX32 "#",
            frame->id);
    for (uint32_t i = 0; i < frame->length; i++) fprintf(f, "%02X", frame->data[i]);
    fputc('\n', f);
}
