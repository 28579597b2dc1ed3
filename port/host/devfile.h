/* SPDX-License-Identifier: MIT */
/* Device files: what a controller and a simulation must know of a haptic device. */
#ifndef PALP_HOST_DEVFILE_H
#define PALP_HOST_DEVFILE_H

#include "core/device/device.h"

/* A device file, read: what the controller knows and what only the simulation needs. */
typedef struct {
    palp_device device;
    double friction_N, weight_N;
    char name[64];
} device_file;

/* Reads `name_or_path`: a built-in description or a file. Exits 2 with the line named when it is
 * wrong. The rate of its drives is 1000 Hz until the caller sets another. */
device_file device_load(const char *name_or_path);
/* Names of the built-in descriptions, one after the other; NULL behind the last. */
const char *device_builtin(size_t number);
/* The same from text that stands by itself (device_text): it opens no other file, and exits 1 where
 * it is `like` another. `name` is what messages call it. */
device_file device_read(const char *name, const char *text);
/* The text of a built-in description, or of a file, with what it is `like` written out. To be
 * freed.
 */
char *device_text(const char *name_or_path);

/* The bus load at the device's rate, in a line; exits 1 above 100 %, warns above 70 %. */
void device_check_load(const device_file *d, char *text, size_t size);

#endif
