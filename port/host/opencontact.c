/* SPDX-License-Identifier: MIT */
#include "port/host/opencontact.h"
#include "port/host/util.h"
#include <stdlib.h>

#define FINEST (PALP_CONTACT_LEVELS - 1u)

palp_contact *contact_open(const palp_blob *blob, const palp_tool *tool, uint32_t tools,
                           uint32_t level) {
    const palp_contact_config config = {
        .blob = blob, .tools = tool, .tool_count = tools, .finest = FINEST};
    size_t bytes = palp_contact_memsize(&config);
    palp_contact *c = allocate(1, sizeof *c);
    palp_status status = palp_contact_init(c, &config, allocate_aligned(bytes, 1), bytes);
    if (status != PALP_OK)
        die(EXIT_WORK, "the body cannot be touched (%s): bake it again", palp_status_text(status));
    c->now = level;
    return c;
}

void contact_close(palp_contact *c) {
    free(c->surface); /* the first of its memory */
    free(c);
}
