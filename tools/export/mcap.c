/* SPDX-License-Identifier: MIT */
#include "tools/export/mcap.h"
#include "core/base/version.h"
#include "core/device/canframe.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

#define CHANNELS 16u
#define CHUNK_BYTES 1000000u

enum {
    OP_HEADER = 1,
    OP_FOOTER = 2,
    OP_SCHEMA = 3,
    OP_CHANNEL = 4,
    OP_MESSAGE = 5,
    OP_CHUNK = 6,
    OP_MESSAGE_INDEX = 7,
    OP_CHUNK_INDEX = 8,
    OP_STATISTICS = 11,
    OP_DATA_END = 15
};

static const char magic[8] = "\x89MCAP0\r\n";

/* Bytes that grow. */
typedef struct {
    uint8_t *at;
    size_t used, room;
} buffer;

static uint8_t *take(buffer *b, size_t bytes) {
    b->at = grow(b->at, &b->room, b->used + bytes, 1);
    uint8_t *at = b->at + b->used;
    b->used += bytes;
    return at;
}
static void put_u16(buffer *b, uint32_t v) { palp_put_u16(take(b, 2), v); }
static void put_u32(buffer *b, uint32_t v) { palp_put_u32(take(b, 4), v); }
static void put_u64(buffer *b, uint64_t v) {
    put_u32(b, (uint32_t)v);
    put_u32(b, (uint32_t)(v >> 32));
}
static void put_bytes(buffer *b, const void *data, size_t bytes) {
    if (bytes > 0) memcpy(take(b, bytes), data, bytes);
}
static void put_string(buffer *b, const char *text) {
    put_u32(b, (uint32_t)strlen(text));
    put_bytes(b, text, strlen(text));
}

typedef struct {
    uint64_t start_ns, end_ns, offset, length, index_bytes, bytes;
    uint64_t index_at[CHANNELS]; /* 0: none */
} chunk_index;

struct mcap {
    FILE *out;
    uint64_t written, messages, start_ns, end_ns;
    uint16_t channels;
    const char *topic[CHANNELS], *schema_name[CHANNELS], *schema[CHANNELS];
    uint64_t count[CHANNELS];
    buffer chunk, index[CHANNELS];
    uint64_t chunk_start_ns, chunk_end_ns;
    chunk_index *done;
    size_t chunks, room;
};

static void write_bytes(mcap *m, const void *data, size_t bytes) {
    fwrite(data, 1, bytes, m->out);
    m->written += bytes;
}

/* A record to the file; its content is freed. */
static void write_record(mcap *m, uint8_t code, buffer *content) {
    buffer head = {0};
    *take(&head, 1) = code;
    put_u64(&head, content->used);
    write_bytes(m, head.at, head.used);
    write_bytes(m, content->at, content->used);
    free(head.at);
    free(content->at);
}

static buffer schema_record(const mcap *m, uint16_t c) {
    buffer b = {0};
    put_u16(&b, c + 1u);
    put_string(&b, m->schema_name[c]);
    put_string(&b, "jsonschema");
    put_string(&b, m->schema[c]);
    return b;
}

static buffer channel_record(const mcap *m, uint16_t c) {
    buffer b = {0};
    put_u16(&b, c);
    put_u16(&b, c + 1u);
    put_string(&b, m->topic[c]);
    put_string(&b, "json");
    put_u32(&b, 0); /* no metadata */
    return b;
}

mcap *mcap_open(FILE *out) {
    mcap *m = allocate(1, sizeof *m);
    buffer head = {0};
    m->out = out;
    write_bytes(m, magic, sizeof magic);
    put_string(&head, "");
    put_string(&head, "palp " PALP_VERSION);
    write_record(m, OP_HEADER, &head);
    return m;
}

static void write_channels(mcap *m) {
    for (uint16_t c = 0; c < m->channels; c++) {
        buffer b = schema_record(m, c);
        write_record(m, OP_SCHEMA, &b);
        b = channel_record(m, c);
        write_record(m, OP_CHANNEL, &b);
    }
}

uint16_t mcap_channel(mcap *m, const char *topic, const char *schema_name, const char *schema) {
    if (m->channels == CHANNELS) die(EXIT_WORK, "at most %u channels", CHANNELS);
    m->topic[m->channels] = topic;
    m->schema_name[m->channels] = schema_name;
    m->schema[m->channels] = schema;
    return m->channels++;
}

static void end_chunk(mcap *m) {
    if (m->chunk.used == 0) return;
    m->done = grow(m->done, &m->room, m->chunks + 1, sizeof *m->done);
    chunk_index *i = &m->done[m->chunks++];
    *i = (chunk_index){.start_ns = m->chunk_start_ns,
                       .end_ns = m->chunk_end_ns,
                       .offset = m->written,
                       .bytes = m->chunk.used};
    buffer b = {0};
    put_u64(&b, m->chunk_start_ns);
    put_u64(&b, m->chunk_end_ns);
    put_u64(&b, m->chunk.used);
    put_u32(&b, 0); /* no checksum */
    put_string(&b, "");
    put_u64(&b, m->chunk.used);
    put_bytes(&b, m->chunk.at, m->chunk.used);
    write_record(m, OP_CHUNK, &b);
    i->length = m->written - i->offset;
    const uint64_t before = m->written;
    for (uint16_t c = 0; c < m->channels; c++) {
        if (m->index[c].used == 0) continue;
        buffer index = {0};
        i->index_at[c] = m->written;
        put_u16(&index, c);
        put_u32(&index, (uint32_t)m->index[c].used);
        put_bytes(&index, m->index[c].at, m->index[c].used);
        write_record(m, OP_MESSAGE_INDEX, &index);
        m->index[c].used = 0;
    }
    i->index_bytes = m->written - before;
    m->chunk.used = 0;
}

void mcap_message(mcap *m, uint16_t channel, uint64_t time_ns, const char *text, size_t bytes) {
    if (m->messages == 0) {
        write_channels(m);
        m->start_ns = time_ns;
    }
    if (m->chunk.used == 0) m->chunk_start_ns = m->chunk_end_ns = time_ns;
    if (time_ns < m->chunk_start_ns) m->chunk_start_ns = time_ns;
    if (time_ns > m->chunk_end_ns) m->chunk_end_ns = time_ns;
    if (time_ns < m->start_ns) m->start_ns = time_ns;
    if (time_ns > m->end_ns) m->end_ns = time_ns;
    put_u64(&m->index[channel], time_ns);
    put_u64(&m->index[channel], m->chunk.used);
    *take(&m->chunk, 1) = OP_MESSAGE;
    put_u64(&m->chunk, 2 + 4 + 8 + 8 + bytes);
    put_u16(&m->chunk, channel);
    put_u32(&m->chunk, (uint32_t)m->count[channel]++);
    put_u64(&m->chunk, time_ns);
    put_u64(&m->chunk, time_ns);
    put_bytes(&m->chunk, text, bytes);
    m->messages++;
    if (m->chunk.used > CHUNK_BYTES) end_chunk(m);
}

static void write_chunk_index(mcap *m, const chunk_index *i) {
    buffer b = {0}, offsets = {0};
    for (uint16_t c = 0; c < m->channels; c++) {
        if (i->index_at[c] == 0) continue;
        put_u16(&offsets, c);
        put_u64(&offsets, i->index_at[c]);
    }
    put_u64(&b, i->start_ns);
    put_u64(&b, i->end_ns);
    put_u64(&b, i->offset);
    put_u64(&b, i->length);
    put_u32(&b, (uint32_t)offsets.used);
    put_bytes(&b, offsets.at, offsets.used);
    put_u64(&b, i->index_bytes);
    put_string(&b, "");
    put_u64(&b, i->bytes);
    put_u64(&b, i->bytes);
    write_record(m, OP_CHUNK_INDEX, &b);
    free(offsets.at);
}

static void write_statistics(mcap *m) {
    buffer b = {0};
    put_u64(&b, m->messages);
    put_u16(&b, m->channels);
    put_u32(&b, m->channels);
    put_u32(&b, 0); /* attachments, */
    put_u32(&b, 0); /* metadata */
    put_u32(&b, (uint32_t)m->chunks);
    put_u64(&b, m->start_ns);
    put_u64(&b, m->end_ns);
    put_u32(&b, 10u * m->channels);
    for (uint16_t c = 0; c < m->channels; c++) {
        put_u16(&b, c);
        put_u64(&b, m->count[c]);
    }
    write_record(m, OP_STATISTICS, &b);
}

void mcap_close(mcap *m) {
    if (m->messages == 0) write_channels(m);
    end_chunk(m);
    buffer end = {0}, foot = {0};
    put_u32(&end, 0); /* no checksum */
    write_record(m, OP_DATA_END, &end);
    const uint64_t summary = m->written;
    write_channels(m);
    for (size_t i = 0; i < m->chunks; i++) write_chunk_index(m, &m->done[i]);
    write_statistics(m);
    put_u64(&foot, summary);
    put_u64(&foot, 0); /* no offsets of it */
    put_u32(&foot, 0);
    write_record(m, OP_FOOTER, &foot);
    write_bytes(m, magic, sizeof magic);
    for (uint16_t c = 0; c < m->channels; c++) free(m->index[c].at);
    free(m->chunk.at);
    free(m->done);
    free(m);
}
