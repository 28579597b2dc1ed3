/* SPDX-License-Identifier: MIT */
/*
 * MCAP (mcap.dev): messages with times, in chunks with their indices, for Foxglove and others. Messages are JSON with
 * their schemas in the file.
 */
#ifndef PALP_TOOLS_MCAP_H
#define PALP_TOOLS_MCAP_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

typedef struct mcap mcap;

/* Begins a file. */
mcap *mcap_open(FILE *out);
/* A channel of JSON messages: its topic, and the name and text of its schema. Before any message. */
uint16_t mcap_channel(mcap *m, const char *topic, const char *schema_name, const char *schema);
void mcap_message(mcap *m, uint16_t channel, uint64_t time_ns, const char *text, size_t bytes);
/* The summary; frees m. */
void mcap_close(mcap *m);

#endif
