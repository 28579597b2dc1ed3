/* SPDX-License-Identifier: MIT */
/*
 * Contact with one rigid sphere, without a device: sphere BLOB
 *
 * The sphere is pressed into the body from above, a hundredth of its radius at a time, and the
 * force on it is printed. A solve begins from where the last one ended; a few in the same place
 * settle.
 */
#include "blob.h"

#define LEVEL PALP_CONTACT_FINEST
#define SETTLE 8

static _Alignas(PALP_ALIGN) uint8_t memory[PALP_CONTACT_BYTES(1, LEVEL)];

int main(int argc, char **argv) {
    palp_blob blob;
    static palp_contact contact;
    if (argc != 2) return 2;
    if (!read_blob(&blob, argv[1])) return 1;
    const palp_tool sphere = palp_tool_sphere(3.0f * blob.meta->mean_edge_m);
    const float radius = sphere.ball[0].radius_m;
    const palp_contact_config config = {
        .blob = &blob, .tools = &sphere, .tool_count = 1, .finest = LEVEL};
    const palp_status status = palp_contact_init(&contact, &config, memory, sizeof memory);
    if (status != PALP_OK) {
        fprintf(stderr, "contact: %s (it takes %zu bytes)\n", palp_status_text(status),
                palp_contact_memsize(&config));
        return 1;
    }
    const uint32_t top = highest_node(&blob);
    const palp_vec3 x = palp_vec3_at(blob.rest_m + 3u * top);
    const palp_vec3 n = palp_vec3_at(blob.normal + 3u * top);
    printf("depth_m,force_N,points\n");
    for (int step = 0; step <= 20; step++) {
        const float depth = 0.01f * (float)step * radius;
        const palp_frame at = palp_frame_at(palp_madd(x, radius - depth, n));
        const palp_contact_spring held = {.held = at}; /* stiffness 0: rigidly */
        for (int i = 0; i < SETTLE; i++) palp_contact_solve(&contact, &at, &held);
        printf("%g,%g,%u\n", (double)depth, (double)palp_norm(contact.force_N[0]),
               (unsigned)contact.active_count);
    }
    return 0;
}
