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
#define ID_DEVICE 0x1fff0006u
#define ID_DEVICE_RESULT 0x1fff0007u
#define ID_BODY 0x1fff0008u
#define ID_EXCHANGE 0x1fff0009u
#define TOTALS (sizeof(run_totals) / sizeof(uint64_t))
#define TOTALS_PER_FRAME 8u
#define CLOCKS_PER_FRAME 16u
#define DESCRIPTION "== device ==" /* a line; a description follows, or the end */

size_t record_bytes(uint32_t hands) { return sizeof(tick_record) + hands * sizeof(tick_hand); }

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

void record_write_session(FILE *f, const scene_setup *setup) {
    const scene_file *scene = setup->file;
    const palp_cost_table *cost = &setup->config.cost;
    char *text = NULL;
    size_t bytes = 0;
    FILE *m = open_memory(&text, &bytes);
    fprintf(m, "palp-log 4\ncost %.9g %.9g %.9g\nprices", (double)cost->ns_per_instruction,
            (double)cost->ns_per_byte, (double)cost->margin);
    for (uint32_t k = 0; k < PALP_WORKS; k++)
        fprintf(m, " %.9g", (double)cost->target->instructions.of[k]);
    fprintf(m, "\nresume %d\n", setup->hand[0].resume ? 1 : 0);
    for (uint32_t b = 0; b < scene->bodies; b++)
        fprintf(m, "blob %" PRIu32 " %" PRIu32 "\n", setup->part[b].bytes, setup->part[b].crc);
    for (uint32_t t = 0; t < scene->tools; t++)
        fprintf(m, "tool-file %" PRIu32 " %" PRIu32 "\n", setup->tool_bytes[t], setup->tool_crc[t]);
    fprintf(m, "scene\n");
    scene_write(m, scene);
    for (uint32_t d = 0; d < scene->devices; d++)
        fprintf(m, "%s\n%s", DESCRIPTION, scene->device[d].text);
    fprintf(m, "%s\n", DESCRIPTION);
    fclose(m);
    write_text(f, text);
    free(text);
}

static void write_own(FILE *f, const tick_record *t, const palp_can_frame *frame) {
    candump_write(f, t->time_s, CHANNEL, frame);
}

static void write_result(FILE *f, const tick_record *t, uint32_t hand) {
    const palp_report *r = &t->hand[hand].report;
    const float values[] = {r->force_N.x, r->force_N.y, r->force_N.z,  r->tip_m.x,    r->tip_m.y,
                            r->tip_m.z,   r->stored_J,  r->absorbed_J, r->elapsed_ns, r->given_J};
    palp_can_frame frame = own_frame(hand == 0 ? ID_RESULT : ID_DEVICE_RESULT, 64);
    put_u64(frame.data, hand == 0 ? t->digest : hand);
    frame.data[8] = (uint8_t)r->state;
    frame.data[9] = (uint8_t)r->level;
    frame.data[10] = (uint8_t)r->points;
    frame.data[11] = r->held ? 1 : 0;
    palp_put_u32(frame.data + 12, r->faults);
    palp_put_u32(frame.data + 16, r->active);
    for (uint32_t i = 0; i < 10; i++) palp_put_f32(frame.data + 20 + 4 * i, values[i]);
    write_own(f, t, &frame);
}

/* Bodies have frames of their own where the devices' results do not say it all. */
static bool has_bodies(uint32_t bodies, const palp_body_kind *kind) {
    return bodies > 1 || kind[0] != PALP_BODY_ELASTIC;
}

static void write_body(FILE *f, const tick_record *t, uint32_t body) {
    const palp_body_report *r = &t->body[body];
    palp_can_frame frame = own_frame(ID_BODY, 20);
    frame.data[0] = (uint8_t)body;
    frame.data[1] = (uint8_t)t->kind[body];
    frame.data[2] = (uint8_t)r->level;
    frame.data[3] = r->held ? 1 : 0;
    palp_put_u16(frame.data + 4, r->points);
    palp_put_u16(frame.data + 6, r->active);
    palp_put_u32(frame.data + 8, r->flags);
    palp_put_f32(frame.data + 12, r->stored_J);
    palp_put_f32(frame.data + 16, r->doubt_N);
    write_own(f, t, &frame);
}

static void write_clock(FILE *f, const tick_record *t) {
    for (uint32_t at = 0; at < t->clock_count; at += CLOCKS_PER_FRAME) {
        uint32_t n = t->clock_count - at;
        if (n > CLOCKS_PER_FRAME) n = CLOCKS_PER_FRAME;
        palp_can_frame frame = own_frame(ID_CLOCK, palp_can_fd_length(4 * n));
        for (uint32_t i = 0; i < n; i++) palp_put_u32(frame.data + 4 * i, t->clock_ns[at + i]);
        write_own(f, t, &frame);
    }
}

void record_write_tick(FILE *f, const scene_file *scene, const tick_record *t) {
    const float late = t->late_us < 65535.0f ? t->late_us : 65535.0f;
    const palp_can_frame exchange = own_frame(ID_EXCHANGE, 0);
    if (t->exchanged) write_own(f, t, &exchange);
    for (uint32_t h = 0; h < t->hands; h++) {
        const tick_hand *hand = &t->hand[h];
        palp_can_frame frame = own_frame(h == 0 ? ID_TICK : ID_DEVICE, h == 0 ? 24 : 12);
        if (h == 0) {
            put_u64(frame.data, hand->report.tick);
            palp_put_u32(frame.data + 8, t->skipped);
            palp_put_u32(frame.data + 12, hand->events);
            palp_put_u16(frame.data + 16, hand->in_count);
            palp_put_u16(frame.data + 18, hand->out_count);
            palp_put_u16(frame.data + 20, t->clock_full ? 0xffff : t->clock_count);
            palp_put_u16(frame.data + 22, (uint32_t)late);
        } else {
            palp_put_u32(frame.data, h);
            palp_put_u32(frame.data + 4, hand->events);
            palp_put_u16(frame.data + 8, hand->in_count);
            palp_put_u16(frame.data + 10, hand->out_count);
        }
        write_own(f, t, &frame);
        for (uint32_t i = 0; i < hand->in_count; i++)
            candump_write(f, hand->in_time_s[i], scene->device[h].bus, &hand->in[i]);
    }
    write_clock(f, t);
    for (uint32_t h = 0; h < t->hands; h++) {
        write_result(f, t, h);
        for (uint32_t i = 0; i < t->hand[h].out_count; i++)
            candump_write(f, t->time_s, scene->device[h].bus, &t->hand[h].out[i]);
    }
    for (uint32_t b = 0; b < t->bodies && has_bodies(t->bodies, t->kind); b++) write_body(f, t, b);
}

void record_write_gap(FILE *f, double time_s, uint64_t lost) {
    palp_can_frame frame = own_frame(ID_GAP, 8);
    put_u64(frame.data, lost);
    candump_write(f, time_s, CHANNEL, &frame);
}

void record_write_totals(FILE *f, double time_s, const run_totals *totals, uint32_t devices) {
    uint64_t word[TOTALS * PALP_SCENE_HANDS];
    memcpy(word, totals, devices * sizeof *totals);
    for (size_t at = 0; at < TOTALS * devices; at += TOTALS_PER_FRAME) {
        palp_can_frame frame = own_frame(ID_TOTALS, 64);
        for (size_t k = 0; k < TOTALS_PER_FRAME; k++)
            put_u64(frame.data + 8 * k, at + k < TOTALS * devices ? word[at + k] : 0);
        candump_write(f, time_s, CHANNEL, &frame);
    }
}

/* ---- reading ---- */

struct record_reader {
    FILE *file;
    const char *path;
    size_t line;
    uint32_t hands;
    char bus[PALP_SCENE_HANDS][32];
    bool pending; /* `interface` and `frame` have been read and not used */
    double time_s;
    char interface[CANDUMP_NAME];
    palp_can_frame frame;
    uint64_t total[TOTALS * PALP_SCENE_HANDS];
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

/* How many of the session's blobs and tools have been named so far. */
typedef struct {
    uint32_t blobs, tools;
} header_counts;

static bool parse_header_line(session_record *s, header_counts *n, const char *line) {
    float three[3], one;
    uint32_t bytes, crc;
    if (n->blobs < PALP_SCENE_BODIES &&
        sscanf(line, "blob %" SCNu32 " %" SCNu32, &bytes, &crc) == 2) {
        s->blob_bytes[n->blobs] = bytes;
        s->blob_crc[n->blobs++] = crc;
        return true;
    }
    if (n->tools < PALP_CONTACT_TOOLS &&
        sscanf(line, "tool-file %" SCNu32 " %" SCNu32, &bytes, &crc) == 2) {
        s->tool_bytes[n->tools] = bytes;
        s->tool_crc[n->tools++] = crc;
        return true;
    }
    if (floats(line, "cost", three, 3)) {
        s->cost = (palp_cost_table){&s->target, three[0], three[1], three[2]};
        return true;
    }
    if (floats(line, "prices", s->target.instructions.of, PALP_WORKS)) return true;
    if (floats(line, "resume", &one, 1)) {
        s->resume = one > 0;
        return true;
    }
    return strcmp(line, "palp-log 4") == 0;
}

/* Cuts a text behind the next line that says where a description begins; NULL if there is none. */
static char *cut_description(char *text) {
    char *mark = strstr(text, DESCRIPTION "\n");
    if (mark == NULL || (mark > text && mark[-1] != '\n')) return NULL;
    *mark = '\0';
    return mark + strlen(DESCRIPTION) + 1;
}

static void parse_scene(session_record *s, const char *path, char *text) {
    char *description = cut_description(text);
    if (description == NULL) die(EXIT_WORK, "%s: the session's description has no device", path);
    s->scene = scene_read_text(path, NULL, text);
    for (uint32_t d = 0; d < s->scene->devices; d++) {
        char *next = cut_description(description);
        if (next == NULL)
            die(EXIT_WORK, "%s: the session lacks the description of device %" PRIu32, path, d);
        s->scene->device[d].text = copy_string(description);
        (void)device_read(path, description);
        description = next;
    }
    if (s->scene->devices == 0 || s->scene->bodies == 0)
        die(EXIT_WORK, "%s: the session's description has no device or no body", path);
}

static void parse_header(session_record *s, const char *path, char *text) {
    header_counts n = {0};
    int version = 0;
    if (sscanf(text, "palp-log %d\n", &version) != 1)
        die(EXIT_WORK, "%s: not a log that palpd has written (--log)", path);
    if (version >= 1 && version < 4)
        die(EXIT_WORK, "%s: written by an older palpd, whose contact was another: record it again",
            path);
    for (char *line = text; line != NULL;) {
        char *next = strchr(line, '\n');
        if (next != NULL) *next++ = '\0';
        if (strcmp(line, "scene") == 0) {
            parse_scene(s, path, next != NULL ? next : line + strlen(line));
            return;
        }
        const bool known = parse_header_line(s, &n, line);
        if (!known && strncmp(line, "prices ", 7) == 0)
            die(EXIT_WORK,
                "%s: written by a palpd that counts other kinds of work than the %d of this one: "
                "replay it with that version, or record it again",
                path, PALP_WORKS);
        if (!known)
            die(EXIT_WORK, "%s: unknown line '%s' in the session's description", path, line);
        line = next;
    }
    die(EXIT_WORK, "%s: the session's description has no scene", path);
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
    *session = (session_record){.resume = false};
    parse_header(session, path, text);
    r->hands = session->scene->devices;
    for (uint32_t h = 0; h < r->hands; h++)
        snprintf(r->bus[h], sizeof r->bus[h], "%s", session->scene->device[h].bus);
    free(text);
    return r;
}

/* `count` frames of a device's bus. */
static bool take_frames(record_reader *r, uint32_t hand, palp_can_frame *frames, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        if (!peek(r)) return false;
        if (strcmp(r->interface, r->bus[hand]) != 0)
            die(EXIT_WORK, "%s:%zu: damaged: a frame on %s should be here", r->path, r->line,
                r->bus[hand]);
        frames[i] = r->frame;
        r->pending = false;
    }
    return true;
}

static void take_totals(record_reader *r) {
    while (peek(r) && is_own(r, ID_TOTALS, 64)) {
        for (uint32_t i = 0; i < TOTALS_PER_FRAME && r->totals < TOTALS * r->hands; i++)
            r->total[r->totals++] = get_u64(r->frame.data + 8 * i);
        r->pending = false;
    }
}

bool record_totals(const record_reader *r, run_totals *totals) {
    memcpy(totals, r->total, r->hands * sizeof *totals);
    return r->totals == TOTALS * r->hands;
}

static void need_range(const record_reader *r, bool good, const char *what) {
    if (!good) die(EXIT_WORK, "%s:%zu: damaged: %s out of range", r->path, r->line, what);
}

static bool take_input(record_reader *r, tick_record *t, uint32_t hand) {
    tick_hand *of = &t->hand[hand];
    palp_can_frame frame;
    const uint32_t at = hand == 0 ? 16 : 8;
    if (!take(r, hand == 0 ? ID_TICK : ID_DEVICE, hand == 0 ? 24 : 12, &frame)) return false;
    if (hand == 0) {
        t->time_s = r->time_s;
        of->report.tick = get_u64(frame.data);
        t->skipped = palp_get_u32(frame.data + 8);
        t->clock_count = palp_get_u16(frame.data + 20);
        t->late_us = (float)palp_get_u16(frame.data + 22);
        t->clock_full = t->clock_count == 0xffff;
        if (t->clock_full) t->clock_count = RECORD_CLOCKS;
        need_range(r, t->clock_count <= RECORD_CLOCKS, "counts");
    } else {
        need_range(r, palp_get_u32(frame.data) == hand, "the device");
        of->report.tick = t->hand[0].report.tick;
    }
    of->events = palp_get_u32(frame.data + at - 4);
    of->in_count = palp_get_u16(frame.data + at);
    of->out_count = palp_get_u16(frame.data + at + 2);
    need_range(r, of->in_count <= RECORD_FRAMES && of->out_count <= PALP_SERVO_FRAMES_OUT,
               "counts");
    return take_frames(r, hand, of->in, of->in_count);
}

static bool take_clock(record_reader *r, tick_record *t) {
    palp_can_frame frame;
    for (uint32_t at = 0; at < t->clock_count; at += CLOCKS_PER_FRAME) {
        uint32_t n = t->clock_count - at;
        if (n > CLOCKS_PER_FRAME) n = CLOCKS_PER_FRAME;
        if (!take(r, ID_CLOCK, (uint8_t)(4 * n), &frame)) return false;
        for (uint32_t i = 0; i < n; i++) t->clock_ns[at + i] = palp_get_u32(frame.data + 4 * i);
    }
    return true;
}

static bool take_result(record_reader *r, tick_record *t, uint32_t hand) {
    palp_report *p = &t->hand[hand].report;
    palp_can_frame frame;
    if (!take(r, hand == 0 ? ID_RESULT : ID_DEVICE_RESULT, 56, &frame)) return false;
    need_range(r, frame.data[8] <= PALP_STATE_HOMING && frame.data[9] < PALP_CONTACT_LEVELS,
               "state or level");
    if (hand == 0)
        t->digest = get_u64(frame.data);
    else
        need_range(r, get_u64(frame.data) == hand, "the device");
    p->state = (palp_state)frame.data[8];
    p->level = frame.data[9];
    p->points = frame.data[10];
    p->held = frame.data[11] != 0;
    p->faults = palp_get_u32(frame.data + 12);
    p->active = palp_get_u32(frame.data + 16);
    float v[10];
    for (uint32_t i = 0; i < 10; i++) v[i] = palp_get_f32(frame.data + 20 + 4 * i);
    p->force_N = palp_vec3_at(v);
    p->tip_m = palp_vec3_at(v + 3);
    p->stored_J = v[6];
    p->absorbed_J = v[7];
    p->elapsed_ns = v[8];
    p->given_J = v[9];
    return take_frames(r, hand, t->hand[hand].out, t->hand[hand].out_count);
}

static void take_bodies(record_reader *r, tick_record *t) {
    while (peek(r) && is_own(r, ID_BODY, 20)) {
        const uint8_t *d = r->frame.data;
        need_range(
            r, d[0] < PALP_SCENE_BODIES && d[1] <= PALP_BODY_DYNAMIC && d[2] < PALP_CONTACT_LEVELS,
            "body, kind or level");
        palp_body_report *p = &t->body[d[0]];
        t->kind[d[0]] = (palp_body_kind)d[1];
        p->level = d[2];
        p->held = d[3] != 0;
        p->points = palp_get_u16(d + 4);
        p->active = palp_get_u16(d + 6);
        p->flags = palp_get_u32(d + 8);
        p->stored_J = palp_get_f32(d + 12);
        p->doubt_N = palp_get_f32(d + 16);
        if (t->bodies <= d[0]) t->bodies = d[0] + 1u;
        r->pending = false;
    }
}

bool record_next(record_reader *r, tick_record *t, uint64_t *lost) {
    *lost = 0;
    while (peek(r) && is_own(r, ID_GAP, 8)) {
        *lost += get_u64(r->frame.data);
        r->pending = false;
    }
    take_totals(r);
    memset(t, 0, record_bytes(r->hands));
    t->hands = r->hands;
    while (peek(r) && is_own(r, ID_EXCHANGE, 0)) {
        t->exchanged = true;
        r->pending = false;
    }
    for (uint32_t h = 0; h < r->hands; h++) {
        if (!take_input(r, t, h)) return false;
    }
    if (!take_clock(r, t)) return false;
    for (uint32_t h = 0; h < r->hands; h++) {
        if (!take_result(r, t, h)) return false;
    }
    take_bodies(r, t);
    return true;
}

void record_close(record_reader *r) {
    if (r->file != stdin) fclose(r->file);
    free(r);
}
