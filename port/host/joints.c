/* SPDX-License-Identifier: MIT */
#include "port/host/joints.h"
#include "port/host/util.h"
#include <string.h>

uint32_t find_joint(const char *where, const palp_zones *zones, const char *name) {
    for (uint32_t j = 0; j < zones->meta->joints; j++) {
        const palp_joint_entry *e = &zones->joint[j];
        if (strcmp(e->name, name) != 0) continue;
        if (e->closure != 0)
            die(EXIT_USAGE, "%s: joint '%s' closes a loop: its value follows from the others",
                where, name);
        if (e->kind == PALP_FIXED_JOINT)
            die(EXIT_USAGE, "%s: joint '%s' is fixed: it has no value", where, name);
        return j;
    }
    char list[512] = "";
    for (uint32_t j = 0; j < zones->meta->joints; j++) {
        const palp_joint_entry *e = &zones->joint[j];
        size_t used = strlen(list);
        if (e->closure == 0 && e->kind != PALP_FIXED_JOINT)
            snprintf(list + used, sizeof list - used, "%s%s", used > 0 ? ", " : "", e->name);
    }
    die(EXIT_USAGE, "%s: no joint named '%s' (there are: %s)", where, name,
        list[0] != '\0' ? list : "none");
}

void check_joint(const char *where, const palp_zones *zones, uint32_t joint, double value) {
    const palp_joint_entry *e = &zones->joint[joint];
    if (value >= (double)e->low - 1e-6 && value <= (double)e->high + 1e-6) return;
    die(EXIT_USAGE, "%s: joint '%s': %g is out of its range, %g to %g %s", where, e->name, value,
        (double)e->low, (double)e->high, e->kind == PALP_REVOLUTE ? "rad" : "m");
}
