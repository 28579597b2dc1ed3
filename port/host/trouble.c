/* SPDX-License-Identifier: MIT */
#include "port/host/trouble.h"
#include "core/device/cia402.h"
#include <inttypes.h>
#include <stdio.h>

/* CiA 402 and CiA 301; PDOs by their first. */
static const char *object_name(uint16_t index) {
    static const struct {
        uint16_t first, last;
        const char *name;
    } table[] = {{0x1016, 0x1016, "heartbeats it listens to"},
                 {0x1017, 0x1017, "time of its own heartbeat"},
                 {0x1400, 0x15ff, "parameters of a PDO to the drive"},
                 {0x1600, 0x17ff, "mapping of a PDO to the drive"},
                 {0x1800, 0x19ff, "parameters of a PDO from the drive"},
                 {0x1a00, 0x1bff, "mapping of a PDO from the drive"},
                 {0x6007, 0x6007, "reaction to silence"},
                 {0x6060, 0x6060, "mode"},
                 {0x6061, 0x6061, "mode that it is in"},
                 {0x6076, 0x6076, "rated torque, mNm"},
                 {0x60c2, 0x60c2, "cycle time"},
                 {0x6502, 0x6502, "modes that it has"}};
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        if (index >= table[i].first && index <= table[i].last) return table[i].name;
    }
    return "object";
}

/* CiA 301, table of SDO abort codes. */
static const char *abort_name(uint32_t code) {
    static const struct {
        uint32_t code;
        const char *name;
    } table[] = {{0x05030000, "toggle bit"},
                 {0x05040000, "timed out"},
                 {0x05040001, "unknown command"},
                 {0x06010000, "no access"},
                 {0x06010001, "can only be written"},
                 {0x06010002, "can only be read"},
                 {0x06020000, "no such object"},
                 {0x06040041, "cannot be mapped to a PDO"},
                 {0x06040042, "the PDO would be too long"},
                 {0x06060000, "fault of the hardware"},
                 {0x06070010, "wrong length"},
                 {0x06070012, "too long"},
                 {0x06070013, "too short"},
                 {0x06090011, "no such sub-index"},
                 {0x06090030, "value out of range"},
                 {0x06090031, "value too high"},
                 {0x06090032, "value too low"},
                 {0x08000000, "general error"},
                 {0x08000020, "cannot be stored"},
                 {0x08000021, "cannot be stored: local control"},
                 {0x08000022, "not in this state of the drive"}};
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        if (code == table[i].code) return table[i].name;
    }
    return "a code of the maker";
}

static const char *remedy(const palp_drive_trouble *t) {
    if (t->index == 0x6502) return "; it must have cyclic synchronous torque, bit 9";
    if (t->index == 0x6076) return "; 'rated-torque' of the device file must be the drive's own";
    if (t->index == 0x6060 || t->index == 0x6061)
        return "; 10 is cyclic synchronous torque: look whether the drive's settings allow it";
    return "";
}

void trouble_text(const palp_drive_trouble *t, palp_protocol protocol, char *text, size_t size) {
    char object[80] = "";
    if (t->index != 0)
        snprintf(object, sizeof object, "0x%04x:%02x (%s)", t->index, t->sub,
                 object_name(t->index));
    switch (t->kind) {
    case PALP_TROUBLE_SILENT:
        if (t->index != 0)
            snprintf(text, size,
                     "node %u does not answer for %s: is anything else on the bus "
                     "talking to it?",
                     t->node, object);
        else
            snprintf(text, size,
                     "node %u says nothing: is it powered, and are its number and the "
                     "bit rate right?",
                     t->node);
        break;
    case PALP_TROUBLE_REFUSED:
        if (t->written)
            snprintf(text, size,
                     "node %u refuses %" PRIu32 " (0x%" PRIx32 ") in %s: abort code 0x%08" PRIx32
                     ", %s%s",
                     t->node, t->value, t->value, object, t->answer, abort_name(t->answer),
                     remedy(t));
        else
            snprintf(text, size,
                     "node %u does not let %s be read: abort code 0x%08" PRIx32 ", %s%s", t->node,
                     object, t->answer, abort_name(t->answer), remedy(t));
        break;
    case PALP_TROUBLE_DIFFERENT:
        snprintf(text, size,
                 "node %u: %s reads %" PRIu32 " (0x%" PRIx32 "), %" PRIu32 " is needed%s", t->node,
                 object, t->answer, t->answer, t->value, remedy(t));
        break;
    case PALP_TROUBLE_ERROR:
        if ((t->answer & ~7u) == PALP_DRIVE_ERROR_PARTS) {
            snprintf(text, size, "node %u reports an error of its%s%s%s", t->node,
                     (t->answer & 1u) != 0 ? " motor" : "", (t->answer & 2u) != 0 ? " encoder" : "",
                     (t->answer & 4u) != 0 ? " controller" : "");
            break;
        }
        snprintf(text, size, "node %u reports error 0x%" PRIx32 "%s", t->node, t->answer,
                 protocol == PALP_PROTOCOL_CIA402 ? " (emergency code, or statusword)" : "");
        break;
    case PALP_TROUBLE_NONE:
        text[0] = '\0';
        break;
    }
}
