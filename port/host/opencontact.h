/* SPDX-License-Identifier: MIT */
/* Contact in memory of its own. */
#ifndef PALP_HOST_OPENCONTACT_H
#define PALP_HOST_OPENCONTACT_H

#include "core/contact/contact.h"

/* A contact of so many tools, on `level` of the finest there is. Exits when the body cannot be
 * touched. */
palp_contact *contact_open(const palp_blob *blob, const palp_tool *tool, uint32_t tools,
                           uint32_t level);
void contact_close(palp_contact *contact);

#endif
