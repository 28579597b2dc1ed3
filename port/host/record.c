/* SPDX-License-Identifier: MIT */
#include "port/host/record.h"
#include "core/blob/format.h"
#include "port/host/candump.h"
#include "port/host/devfile.h"
#include "port/host/util.h"
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define CHANNEL "palp"
#define ID_TEXT 0x1fff0000u
#define ID_TICK 0x1fff0001u
#define ID_CLOCK 0x1fff0002u
#define ID_RESULT 0x1fff0003u
#define ID_GAP 0x1fff0004u
#define ID_TOTALS 0x1fff0005u
#define TOTALS (sizeof(run_totals) / sizeof(uint64_t))
#define TOTALS_PER_FRAME 8u
#define CLOCKS_PER_FRAME 16u

/* ---- digest ---- */

static uint64_t mix(uint64_t h, const void *data, size_t bytes) { /* FNV-1a */
    const uint8_t *p = data;
    for (size_t i = 0; i < bytes; i++) h = (h ^ p[i]) * 1099511628211ull;
    return h;
}

uint64_t record_digest(uint64_t digest, const palp_can_frame *out, uint32_t count,
                       const palp_report *r) {
    uint64_t h = digest != 0 ? digest : 14695981039346656037ull;
    const uint32_t words[] = {(uint32_t)r->state, r->faults, r->level,
                              r->points,          r->active, r->iterations};
    for (uint32_t i = 0; i < count; i++) {
        h = mix(h, &out[i].id, sizeof out[i].id);
        h = mix(h, out[i].data, out[i].length);
    }
    h = mix(h, words, sizeof words);
    h = mix(h, &r->force_N, sizeof r->force_N);
    h = mix(h, r->motor_torque_Nm, sizeof r->motor_torque_Nm);
    h = mix(h, &r->tip_m, sizeof r->tip_m);
    h = mix(h, &r->stored_J, sizeof r->stored_J);
    h = mix(h, &r->absorbed_J, sizeof r->absorbed_J);
    h = mix(h, &r->moment_Nm, sizeof r->moment_Nm);
    return mix(h, &r->tool, sizeof r->tool);
}

/* ---- writing ---- */

static void put_u64(uint8_t *p, uint64_t v) {
    palp_put_u32(p, (uint32_t)v);
    palp_put_u32(p + 4, (uint32_t)(v >> 32));
}

static palp_can_frame own_frame(uint32_t id, uint8_t length) {
    return (palp_can_frame){.id = id, .flags = PALP_CAN_EXTENDED | PALP_CAN_FD, .length = length};
}

static void write_text(FILE *f, const char *text) {
    size_t left = strlen(text);
    for (; left > 0; text += PALP_CAN_MAX_DATA) {
        palp_can_frame frame = own_frame(ID_TEXT, 64);
        size_t n = left < 64 ? left : 64;
        memcpy(frame.data, text, n);
        candump_write(f, 0, CHANNEL, &frame);
        left -= n;
    }
}

void record_write_session(FILE *f, const session_record *s) {
    const palp_servo_config *c = &s->config;
    const palp_placement *p = &c->placement;
    char *text = NULL;
    size_t bytes = 0;
    FILE *m = open_memstream(&text, &bytes);
    if (m == NULL) die(EXIT_WORK, "no memory for the log's header");
    fprintf(m,
            "palp-log 3\nbus %s\nblob %" PRIu32 " %" PRIu32 "\nrate %.9g\norigin %.9g %.9g %.9g\n",
            s->bus, s->blob_bytes, s->blob_crc, (double)c->device.drives.rate_hz,
            (double)p->origin_m.x, (double)p->origin_m.y, (double)p->origin_m.z);
    fprintf(m, "rotation");
    for (int i = 0; i < 9; i++) fprintf(m, " %.9g", (double)p->rotation[i]);
    fprintf(m, "\nscale %.9g\ntool %.9g %.9g\nsliding %.9g\n", (double)p->scale,
            (double)c->tool.ball[0].radius_m, (double)c->tool.friction, (double)c->tool.sliding);
    if (s->tool_bytes > 0)
        fprintf(m, "tool-file %" PRIu32 " %" PRIu32 "\n", s->tool_bytes, s->tool_crc);
    fprintf(m, "finest %" PRIu32 "\n", c->finest);
    fprintf(m, "cost %.9g %.9g %.9g\nprices", (double)c->cost.ns_per_instruction,
            (double)c->cost.ns_per_byte, (double)c->cost.margin);
    for (uint32_t k = 0; k < PALP_WORKS; k++)
        fprintf(m, " %.9g", (double)c->cost.target->instructions.of[k]);
    fprintf(m, "\nresume %d\ndevice\n%s\n", c->resume ? 1 : 0, s->device);
    fclose(m);
    write_text(f, text);
    free(text);
}

void record_write_tick(FILE *f, const char *bus, const tick_record *t) {
    const palp_report *r = &t->report;
    palp_can_frame frame = own_frame(ID_TICK, 24);
    float late = t->late_us < 65535.0f ? t->late_us : 65535.0f;
    put_u64(frame.data, r->tick);
    palp_put_u32(frame.data + 8, t->skipped);
    palp_put_u32(frame.data + 12, t->events);
    palp_put_u16(frame.data + 16, t->in_count);
    palp_put_u16(frame.data + 18, t->out_count);
    palp_put_u16(frame.data + 20, t->clock_full ? 0xffff : t->clock_count);
    palp_put_u16(frame.data + 22, (uint32_t)late);
    candump_write(f, t->time_s, CHANNEL, &frame);
    for (uint32_t i = 0; i < t->in_count; i++) candump_write(f, t->in_time_s[i], bus, &t->in[i]);
    for (uint32_t at = 0; at < t->clock_count; at += CLOCKS_PER_FRAME) {
        uint32_t n = t->clock_count - at;
        if (n > CLOCKS_PER_FRAME) n = CLOCKS_PER_FRAME;
        frame = own_frame(ID_CLOCK, palp_can_fd_length(4 * n));
        for (uint32_t i = 0; i < n; i++) palp_put_u32(frame.data + 4 * i, t->clock_ns[at + i]);
        candump_write(f, t->time_s, CHANNEL, &frame);
    }
    const float values[] = {r->force_N.x, r->force_N.y, r->force_N.z,  r->tip_m.x,    r->tip_m.y,
                            r->tip_m.z,   r->stored_J,  r->absorbed_J, r->elapsed_ns, r->given_J};
    frame = own_frame(ID_RESULT, 64);
    put_u64(frame.data, t->digest);
    frame.data[8] = (uint8_t)r->state;
    frame.data[9] = (uint8_t)r->level;
    frame.data[10] = (uint8_t)r->points;
    frame.data[11] = r->held ? 1 : 0;
    palp_put_u32(frame.data + 12, r->faults);
    palp_put_u32(frame.data + 16, r->active);
    for (uint32_t i = 0; i < 10; i++) palp_put_f32(frame.data + 20 + 4 * i, values[i]);
    candump_write(f, t->time_s, CHANNEL, &frame);
    for (uint32_t i = 0; i < t->out_count; i++) candump_write(f, t->time_s, bus, &t->out[i]);
}

void record_write_gap(FILE *f, double time_s, uint64_t lost) {
    palp_can_frame frame = own_frame(ID_GAP, 8);
    put_u64(frame.data, lost);
    candump_write(f, time_s, CHANNEL, &frame);
}

void record_write_totals(FILE *f, double time_s, const run_totals *totals) {
    uint64_t word[TOTALS];
    memcpy(word, totals, sizeof word);
    for (size_t at = 0; at < TOTALS; at += TOTALS_PER_FRAME) {
        palp_can_frame frame = own_frame(ID_TOTALS, 64);
        for (size_t i = at; i < at + TOTALS_PER_FRAME && i < TOTALS; i++)
            put_u64(frame.data + 8 * (i - at), word[i]);
        candump_write(f, time_s, CHANNEL, &frame);
    }
}

/* ---- reading ---- */

struct record_reader {
    FILE *file;
    const char *path;
    size_t line;
    char bus[32];
    bool pending; /* `interface` and `frame` have been read and not used */
    double time_s;
    char interface[CANDUMP_NAME];
    palp_can_frame frame;
    uint64_t total[TOTALS];
    size_t totals; /* of them read */
};

static uint64_t get_u64(const uint8_t *p) {
    return (uint64_t)palp_get_u32(p) | (uint64_t)palp_get_u32(p + 4) << 32;
}

/* The next frame of the log, kept until it is used; false at the end. */
static bool peek(record_reader *r) {
    char line[CANDUMP_LINE];
    if (r->pending) return true;
    if (fgets(line, sizeof line, r->file) == NULL) return false;
    r->line++;
    bool whole = strchr(line, '\n') != NULL;
    if (!whole && feof(r->file)) return false; /* cut off in mid line */
    if (r->line == 1 && strncmp(line, PALP_BLOB_MAGIC, strlen(PALP_BLOB_MAGIC)) == 0)
        die(EXIT_WORK, "%s: a blob, where a log is needed: the log comes first", r->path);
    if (!candump_read(line, &r->time_s, r->interface, &r->frame))
        die(EXIT_WORK, "%s:%zu: not a line of a candump log", r->path, r->line);
    r->pending = true;
    return true;
}

static bool is_own(const record_reader *r, uint32_t id, uint8_t least) {
    return strcmp(r->interface, CHANNEL) == 0 && r->frame.id == id && r->frame.length >= least;
}

/* The next frame, which must be one of ours. */
static bool take(record_reader *r, uint32_t id, uint8_t least, palp_can_frame *frame) {
    if (!peek(r)) return false;
    if (!is_own(r, id, least))
        die(EXIT_WORK, "%s:%zu: damaged: a frame %08" PRIX32 " of %u bytes or more should be here",
            r->path, r->line, id, least);
    *frame = r->frame;
    r->pending = false;
    return true;
}

/* `count` floats of a header line. */
static bool floats(const char *line, const char *key, float *value, int count) {
    size_t length = strlen(key);
    if (strncmp(line, key, length) != 0 || line[length] != ' ') return false;
    char *at;
    line += length;
    for (int i = 0; i < count; i++, line = at) {
        value[i] = strtof(line, &at);
        if (at == line) return false;
    }
    return true;
}

static bool parse_header_line(session_record *s, const char *line) {
    palp_servo_config *c = &s->config;
    float two[2], three[3], one;
    if (sscanf(line, "bus %31s", s->bus) == 1) return true;
    if (sscanf(line, "blob %" SCNu32 " %" SCNu32, &s->blob_bytes, &s->blob_crc) == 2) return true;
    if (floats(line, "rate", &c->device.drives.rate_hz, 1)) return true;
    if (floats(line, "origin", three, 3)) {
        c->placement.origin_m = palp_vec3_at(three);
        return true;
    }
    if (floats(line, "rotation", c->placement.rotation, 9)) return true;
    if (floats(line, "scale", &c->placement.scale, 1)) return true;
    if (floats(line, "tool", two, 2)) {
        c->tool = palp_tool_sphere(two[0]);
        c->tool.friction = two[1];
        return true;
    }
    if (floats(line, "sliding", &c->tool.sliding, 1)) return true;
    if (sscanf(line, "tool-file %" SCNu32 " %" SCNu32, &s->tool_bytes, &s->tool_crc) == 2)
        return true;
    if (sscanf(line, "finest %" SCNu32, &c->finest) == 1) return true;
    if (floats(line, "cost", three, 3)) {
        c->cost = (palp_cost_table){&s->target, three[0], three[1], three[2]};
        return true;
    }
    if (floats(line, "prices", s->target.instructions.of, PALP_WORKS)) return true;
    if (floats(line, "resume", &one, 1)) {
        c->resume = one > 0;
        return true;
    }
    return strcmp(line, "palp-log 3") == 0;
}

static void parse_header(session_record *s, const char *path, char *text) {
    if (strncmp(text, "palp-log 1\n", 11) == 0 || strncmp(text, "palp-log 2\n", 11) == 0)
        die(EXIT_WORK, "%s: written by an older palpd, whose contact was another: record it again",
            path);
    if (strncmp(text, "palp-log 3\n", 11) != 0)
        die(EXIT_WORK, "%s: not a log that palpd has written (--log)", path);
    for (char *line = text; line != NULL;) {
        char *next = strchr(line, '\n');
        if (next != NULL) *next++ = '\0';
        if (strcmp(line, "device") == 0) {
            float rate = s->config.device.drives.rate_hz;
            s->device = copy_string(next != NULL ? next : "");
            s->config.device = device_read(path, s->device).device;
            s->config.device.drives.rate_hz = rate;
            return;
        }
        if (!parse_header_line(s, line))
            die(EXIT_WORK, "%s: unknown line '%s' in the session's description", path, line);
        line = next;
    }
    die(EXIT_WORK, "%s: the session's description has no device", path);
}

record_reader *record_open(const char *path, session_record *session) {
    record_reader *r = allocate(1, sizeof *r);
    char *text = NULL;
    size_t capacity = 0, used = 0;
    *r = (record_reader){.path = path};
    r->file = strcmp(path, "-") == 0 ? stdin : fopen(path, "r");
    if (r->file == NULL) die(EXIT_USAGE, "%s: %s", path, strerror(errno));
    while (peek(r) && is_own(r, ID_TEXT, 64)) {
        text = grow(text, &capacity, used + 65, 1);
        memcpy(text + used, r->frame.data, 64);
        used += 64;
        text[used] = '\0';
        r->pending = false;
    }
    if (text == NULL) die(EXIT_WORK, "%s: not a log that palpd has written (--log)", path);
    *session = (session_record){.blob_crc = 0};
    parse_header(session, path, text);
    snprintf(r->bus, sizeof r->bus, "%s", session->bus);
    free(text);
    return r;
}

/* `count` frames of the bus. */
static bool take_frames(record_reader *r, palp_can_frame *frames, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        if (!peek(r)) return false;
        if (strcmp(r->interface, r->bus) != 0)
            die(EXIT_WORK, "%s:%zu: damaged: a frame on %s should be here", r->path, r->line,
                r->bus);
        frames[i] = r->frame;
        r->pending = false;
    }
    return true;
}

static void take_totals(record_reader *r) {
    while (peek(r) && is_own(r, ID_TOTALS, 64)) {
        for (uint32_t i = 0; i < TOTALS_PER_FRAME && r->totals < TOTALS; i++)
            r->total[r->totals++] = get_u64(r->frame.data + 8 * i);
        r->pending = false;
    }
}

bool record_totals(const record_reader *r, run_totals *totals) {
    memcpy(totals, r->total, sizeof *totals);
    return r->totals == TOTALS;
}

bool record_next(record_reader *r, tick_record *t, uint64_t *lost) {
    palp_can_frame frame;
    *lost = 0;
    while (peek(r) && is_own(r, ID_GAP, 8)) {
        *lost += get_u64(r->frame.data);
        r->pending = false;
    }
    take_totals(r);
    if (!take(r, ID_TICK, 24, &frame)) return false;
    memset(t, 0, sizeof *t);
    t->time_s = r->time_s;
    t->report.tick = get_u64(frame.data);
    t->skipped = palp_get_u32(frame.data + 8);
    t->events = palp_get_u32(frame.data + 12);
    t->in_count = palp_get_u16(frame.data + 16);
    t->out_count = palp_get_u16(frame.data + 18);
    t->clock_count = palp_get_u16(frame.data + 20);
    t->late_us = (float)palp_get_u16(frame.data + 22);
    t->clock_full = t->clock_count == 0xffff;
    if (t->clock_full) t->clock_count = RECORD_CLOCKS;
    if (t->in_count > RECORD_FRAMES || t->out_count > PALP_SERVO_FRAMES_OUT ||
        t->clock_count > RECORD_CLOCKS)
        die(EXIT_WORK, "%s:%zu: damaged: counts out of range", r->path, r->line);
    if (!take_frames(r, t->in, t->in_count)) return false;
    for (uint32_t at = 0; at < t->clock_count; at += CLOCKS_PER_FRAME) {
        uint32_t n = t->clock_count - at;
        if (n > CLOCKS_PER_FRAME) n = CLOCKS_PER_FRAME;
        if (!take(r, ID_CLOCK, (uint8_t)(4 * n), &frame)) return false;
        for (uint32_t i = 0; i < n; i++) t->clock_ns[at + i] = palp_get_u32(frame.data + 4 * i);
    }
    if (!take(r, ID_RESULT, 56, &frame)) return false;
    if (frame.data[8] > PALP_STATE_HOMING || frame.data[9] >= PALP_CONTACT_LEVELS)
        die(EXIT_WORK, "%s:%zu: damaged: state or level out of range", r->path, r->line);
    t->digest = get_u64(frame.data);
    t->report.state = (palp_state)frame.data[8];
    t->report.level = frame.data[9];
    t->report.points = frame.data[10];
    t->report.held = frame.data[11] != 0;
    t->report.faults = palp_get_u32(frame.data + 12);
    t->report.active = palp_get_u32(frame.data + 16);
    float v[10];
    for (uint32_t i = 0; i < 10; i++) v[i] = palp_get_f32(frame.data + 20 + 4 * i);
    t->report.force_N = palp_vec3_at(v);
    t->report.tip_m = palp_vec3_at(v + 3);
    t->report.stored_J = v[6];
    t->report.absorbed_J = v[7];
    t->report.elapsed_ns = v[8];
    t->report.given_J = v[9]; /* 0 in logs of before */
    return take_frames(r, t->out, t->out_count);
}

void record_close(record_reader *r) {
    if (r->file != stdin) fclose(r->file);
    free(r);
}
