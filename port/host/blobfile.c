/* SPDX-License-Identifier: MIT */
#include "port/host/blobfile.h"
#include "core/dyna/tets.h"
#include "core/zone/zones.h"
#include "port/host/util.h"

palp_blob open_blob(const char *path, const void *data, size_t bytes) {
    palp_blob blob;
    if (palp_zones_are_here(data, bytes))
        die(EXIT_WORK, "%s: a multizone model, where one body is needed", path);
    if (palp_tets_are_here(data, bytes))
        die(EXIT_WORK, "%s: a dynamic body, which has no Green's functions: 'palp play' moves it",
            path);
    palp_status status = palp_blob_open(&blob, data, bytes);
    if (status != PALP_OK) {
        die(EXIT_WORK, "%s: %s (%zu bytes): bake it again", path, palp_status_text(status), bytes);
    }
    return blob;
}

palp_blob load_blob(const char *path) {
    size_t bytes;
    void *data = read_file(path, &bytes);
    return open_blob(path, data, bytes);
}
