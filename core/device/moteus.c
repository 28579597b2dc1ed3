/* SPDX-License-Identifier: MIT */
#include "moteus.h"

#define NOP 0x50u
#define REGISTER_MODE 0x000u
#define REGISTER_POSITION 0x001u
#define REGISTER_VELOCITY 0x002u
#define REGISTER_TORQUE 0x003u
#define REGISTER_FAULT 0x00fu
#define REGISTER_VOLTAGE 0x00du
#define REGISTER_COMMAND_POSITION 0x020u
#define REGISTER_COMMAND_TORQUE 0x022u
#define REGISTER_COMMAND_TORQUE_MAX 0x025u
#define REGISTER_COMMAND_TIMEOUT 0x027u
#define HOST 0u

/* Subframe types, without the count in their low two bits. */
#define WRITE 0x00u
#define READ 0x10u
#define ANSWER 0x20u
enum { I8 = 0, I16 = 4, I32 = 8, F32 = 12 };

static const float not_a_number = __builtin_nanf("");

static uint8_t flags_of(uint32_t id) { return (uint8_t)(PALP_CAN_FD | palp_can_id_flags(id)); }

/* Empty, its room filled with what pads it. */
static palp_can_frame frame_of(uint32_t id) {
    palp_can_frame f = {.id = id, .flags = flags_of(id)};
    for (uint32_t i = 0; i < PALP_CAN_MAX_DATA; i++) f.data[i] = NOP;
    return f;
}

static bool is_frame(const palp_can_frame *f, uint32_t id) {
    return f->id == id && f->flags == flags_of(id);
}

static void put(palp_can_frame *f, uint32_t byte) {
    if (f->length < PALP_CAN_MAX_DATA) f->data[f->length++] = (uint8_t)byte;
}
static void put_float(palp_can_frame *f, float v) {
    uint8_t bytes[4];
    palp_put_f32(bytes, v);
    for (uint32_t i = 0; i < 4u; i++) put(f, bytes[i]);
}

static palp_can_frame pad(palp_can_frame f) {
    f.length = palp_can_fd_length(f.length);
    return f;
}

static void put_query(palp_can_frame *f) {
    put(f, READ | I8 | 1u);
    put(f, REGISTER_MODE);
    put(f, READ | F32 | 3u);
    put(f, REGISTER_POSITION);
    put(f, READ | I8 | 3u);
    put(f, REGISTER_VOLTAGE);
}

palp_can_frame palp_moteus_encode_command(uint8_t node, const palp_moteus_command *command) {
    palp_can_frame f = frame_of(PALP_MOTEUS_REPLY | HOST << 8 | node);
    put(&f, WRITE | I8 | 1u);
    put(&f, REGISTER_MODE);
    put(&f, (uint32_t)command->mode);
    if (command->mode == PALP_MOTEUS_POSITION) {
        put(&f, WRITE | F32);
        put(&f, 8);
        put(&f, REGISTER_COMMAND_POSITION);
        put_float(&f, not_a_number); /* where it is */
        put_float(&f, 0.0f);
        put_float(&f, command->torque_Nm);
        put_float(&f, 0.0f); /* kp and kd scales */
        put_float(&f, 0.0f);
        put_float(&f, command->torque_max_Nm);
        put_float(&f, not_a_number); /* no stop position */
        put_float(&f, command->timeout_s);
    }
    put_query(&f);
    return pad(f);
}

palp_can_frame palp_moteus_encode_answer(uint8_t node, const palp_moteus_answer *answer) {
    palp_can_frame f = frame_of((uint32_t)node << 8 | HOST);
    put(&f, ANSWER | I8 | 1u);
    put(&f, REGISTER_MODE);
    put(&f, (uint32_t)answer->mode);
    put(&f, ANSWER | F32 | 3u);
    put(&f, REGISTER_POSITION);
    put_float(&f, answer->position_rev);
    put_float(&f, answer->velocity_rev_s);
    put_float(&f, answer->torque_Nm);
    put(&f, ANSWER | I8 | 3u);
    put(&f, REGISTER_VOLTAGE);
    put(&f, 48); /* half volts */
    put(&f, 30); /* degrees */
    put(&f, (uint32_t)answer->fault);
    return pad(f);
}

/* Integers are scaled by register: what one unit of i8, i16 and i32 stands for. */
static float unit_of(uint32_t reg, uint32_t format) {
    static const float position[3] = {0.01f, 0.0001f, 0.00001f};
    static const float velocity[3] = {0.1f, 0.00025f, 0.00001f};
    static const float torque[3] = {0.5f, 0.01f, 0.001f};
    static const float seconds[3] = {0.01f, 0.001f, 0.000001f};
    switch (reg) {
    case REGISTER_POSITION:
    case REGISTER_COMMAND_POSITION:
        return position[format / 4u];
    case REGISTER_VELOCITY:
        return velocity[format / 4u];
    case REGISTER_TORQUE:
    case REGISTER_COMMAND_TORQUE:
    case REGISTER_COMMAND_TORQUE_MAX:
        return torque[format / 4u];
    case REGISTER_COMMAND_TIMEOUT:
        return seconds[format / 4u];
    default:
        return 1.0f;
    }
}

static float value_at(const uint8_t *p, uint32_t reg, uint32_t format) {
    if (format == F32) return palp_get_f32(p);
    int32_t raw = format == I8    ? (p[0] < 0x80u ? (int32_t)p[0] : (int32_t)p[0] - 0x100)
                  : format == I16 ? palp_get_i16(p)
                                  : palp_get_i32(p);
    return (float)raw * unit_of(reg, format);
}

/* Registers 0..0x2f of a frame: value and whether it was there. */
#define REGISTERS 0x30u
typedef struct {
    float value[REGISTERS];
    uint64_t seen;
} registers;

/* False when the frame does not parse to its end. Reads carry no values and are passed over. */
static bool read_registers(const palp_can_frame *f, uint32_t kind, registers *r) {
    uint32_t at = 0;
    r->seen = 0;
    if (f->length > PALP_CAN_MAX_DATA) return false;
    /* at most PALP_CAN_MAX_DATA: each turn takes a byte of the frame */
    while (at < f->length) {
        uint32_t head = f->data[at++];
        if (head == NOP) continue;
        uint32_t type = head & 0xf0u, format = head & 0x0cu, count = head & 3u;
        if (type != kind && type != READ) return false;
        if (count == 0u) {
            if (at >= f->length) return false;
            count = f->data[at++];
        }
        if (at >= f->length) return false;
        uint32_t reg = f->data[at++]; /* below 0x80, one byte */
        if (reg >= 0x80u) return false;
        if (type == READ) continue;
        uint32_t size = format == I8 ? 1u : format == I16 ? 2u : 4u;
        if (count * size > f->length - at) return false;
        for (uint32_t i = 0; i < count; i++, at += size) {
            if (reg + i >= REGISTERS) continue;
            r->value[reg + i] = value_at(f->data + at, reg + i, format);
            r->seen |= 1ull << (reg + i);
        }
    }
    return true;
}

static bool has(const registers *r, uint32_t reg) { return (r->seen >> reg & 1u) != 0u; }
static float get(const registers *r, uint32_t reg, float otherwise) {
    return has(r, reg) ? r->value[reg] : otherwise;
}
static int32_t get_small(const registers *r, uint32_t reg) {
    return palp_saturate(get(r, reg, 0.0f), -1000, 1000);
}

bool palp_moteus_decode_command(const palp_can_frame *frame, uint8_t node,
                                palp_moteus_command *command) {
    registers r;
    if (!is_frame(frame, PALP_MOTEUS_REPLY | HOST << 8 | node)) return false;
    if (!read_registers(frame, WRITE, &r) || !has(&r, REGISTER_MODE)) return false;
    *command = (palp_moteus_command){.mode = get_small(&r, REGISTER_MODE),
                                     .torque_Nm = get(&r, REGISTER_COMMAND_TORQUE, 0.0f),
                                     .torque_max_Nm = get(&r, REGISTER_COMMAND_TORQUE_MAX, 0.0f),
                                     .timeout_s = get(&r, REGISTER_COMMAND_TIMEOUT, 0.1f)};
    return true;
}

bool palp_moteus_decode_answer(const palp_can_frame *frame, uint8_t node,
                               palp_moteus_answer *answer) {
    registers r;
    if (!is_frame(frame, (uint32_t)node << 8 | HOST)) return false;
    if (!read_registers(frame, ANSWER, &r) || !has(&r, REGISTER_MODE) ||
        !has(&r, REGISTER_POSITION))
        return false;
    *answer = (palp_moteus_answer){.mode = get_small(&r, REGISTER_MODE),
                                   .fault = get_small(&r, REGISTER_FAULT),
                                   .position_rev = r.value[REGISTER_POSITION],
                                   .velocity_rev_s = get(&r, REGISTER_VELOCITY, 0.0f),
                                   .torque_Nm = get(&r, REGISTER_TORQUE, 0.0f)};
    return true;
}
