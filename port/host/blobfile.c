/* SPDX-License-Identifier: MIT */
#include "port/host/blobfile.h"
#include "core/dyna/tets.h"
#include "core/zone/zones.h"
#include "port/host/util.h"

void die_of_blob(const char *path, palp_status status, size_t bytes) {
    if (status == PALP_ERR_MAGIC || bytes < sizeof(palp_blob_header))
        die(EXIT_WORK, "%s: not a Palp blob (%zu bytes): 'palp bake' makes one from a mesh", path,
            bytes);
    die(EXIT_WORK, "%s: %s (%zu bytes): bake it again", path, palp_status_text(status), bytes);
}

palp_blob open_blob(const char *path, const void *data, size_t bytes) {
    palp_blob blob;
    if (palp_zones_are_here(data, bytes))
        die(EXIT_WORK, "%s: a multizone model, where one body is needed", path);
    if (palp_tets_are_here(data, bytes))
        die(EXIT_WORK, "%s: a dynamic body, which has no Green's functions: 'palp play' moves it",
            path);
    palp_status status = palp_blob_open(&blob, data, bytes);
    if (status != PALP_OK) die_of_blob(path, status, bytes);
    return blob;
}

palp_blob load_blob(const char *path) {
    size_t bytes;
    void *data = read_file(path, &bytes);
    return open_blob(path, data, bytes);
}
