/* SPDX-License-Identifier: MIT */
/* Blobs in files. */
#ifndef PALP_HOST_BLOBFILE_H
#define PALP_HOST_BLOBFILE_H

#include "core/blob/blob.h"
#include <stddef.h>

/* Reads and opens a blob; exits 2 if it cannot be read, 1 if it is not sound. The bytes stay
 * allocated. */
palp_blob load_blob(const char *path);
/* The same from bytes already read. */
palp_blob open_blob(const char *path, const void *data, size_t bytes);

/* Exits 1 with why bytes cannot be opened: they are no blob, or a damaged or an older one. */
_Noreturn void die_of_blob(const char *path, palp_status status, size_t bytes);

#endif
