/* SPDX-License-Identifier: MIT */
/* Feeds the drives' frames of a candump log to the servo and prints a hash of every frame and force
 * it gives; then, with a multizone model, of every force and seam displacement while it moves,
 * and of every force and motion of a dynamic body; and with the same frames a scene with two devices
 * and four tools, whose bodies are exchanged while they are touched. */
#include "core/palp.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint64_t still_clock(void *context) {
    (void)context;
    return 0;
}

static uint64_t hash = 1469598103934665603ull;
static void mix(const void *data, size_t bytes) {
    const uint8_t *p = data;
    for (size_t i = 0; i < bytes; i++) hash = (hash ^ p[i]) * 1099511628211ull;
}

/* For good; not every target's libc has aligned_alloc. */
static void *aligned(size_t bytes) {
    uint8_t *p = malloc(bytes + 64);
    return p == NULL ? NULL : p + (64 - (uintptr_t)p % 64);
}

static void *load(const char *path, size_t *bytes) {
    FILE *f = fopen(path, "rb");
    if (f == NULL) exit(2);
    fseek(f, 0, SEEK_END);
    *bytes = (size_t)ftell(f);
    rewind(f);
    void *data = aligned(*bytes);
    if (fread(data, 1, *bytes, f) != *bytes) exit(1);
    fclose(f);
    return data;
}

/* The tool goes round over the model while its joints swing; levels change by the work done. */
static palp_answer answer;
static uint64_t work_clock(void *context) {
    (void)context;
    return palp_answer_work(&answer);
}

static void move_zones(const char *path) {
    static palp_zones zones;
    static palp_assembly assembly;
    size_t bytes;
    void *data = load(path, &bytes);
    if (palp_zones_open(&zones, data, bytes) != PALP_OK) exit(1);
    size_t room = palp_assembly_memsize(&zones, 4);
    if (palp_assembly_init(&assembly, &zones, 4, aligned(room), room) != PALP_OK) exit(1);
    const palp_tool tool = palp_tool_sphere(0.008f);
    const palp_frame rest = PALP_FRAME_IDENTITY;
    palp_answer_config config = {.contact = {.assembly = &assembly,
                                             .pairs = true,
                                             .tools = &tool,
                                             .tool_count = 1,
                                             .finest = PALP_CONTACT_FINEST},
                                 .cost = {&palp_target_counted, 1.0f, 0.0f, 0.95f},
                                 .port = {.now_ns = work_clock},
                                 .dt_s = 4e-3f};
    room = palp_answer_memsize(&config.contact);
    if (palp_answer_init(&answer, &config, aligned(room), room, NULL) != PALP_OK) exit(1);
    answer.coupling.tool[0].stiffness_N_per_m = 200.0f;
    for (uint32_t i = 0; i < 1500; i++) {
        float s = (float)i / 1500.0f, sine, cosine, value[PALP_MAX_JOINTS] = {0};
        palp_coupling_result result;
        palp_answer_report report;
        palp_sincos(6.2831853f * s, &sine, &cosine);
        value[0] = 0.3f * sine;
        value[1] = 0.2f * cosine - 0.2f;
        const palp_frame hand = palp_frame_at(
            (palp_vec3){0.037f + 0.008f * sine, 0.010f, 0.0300f - 0.006f * (1.0f - cosine)});
        palp_answer_pose(&answer, value, &rest);
        palp_answer_tick(&answer, work_clock(NULL), &hand, &result, &report);
        palp_answer_spare(&answer);
        mix(&result.force_N, sizeof result.force_N);
        mix(assembly.w, 3 * assembly.seams.modes * sizeof(float));
        mix(&report.moving.level, sizeof report.moving.level);
    }
    printf("%016llx zones, ", (unsigned long long)hash);
}

/* Contact on the surface: a ball with friction, then a cylinder, pressed and drawn over the body by
 * the clock of the work done, which leaps now and then. */
static uint64_t leaps;
static uint64_t answer_clock(void *context) {
    (void)context;
    return answer.contact.work_done + leaps;
}

static void move_surface(const palp_blob *blob, palp_vec3 top) {
    const float edge = blob->meta->mean_edge_m;
    palp_tool tool[2] = {palp_tool_sphere(2.0f * edge), palp_tool_sphere(edge)};
    tool[0].friction = 0.3f;
    tool[1].shape = PALP_TOOL_CYLINDER;
    tool[1].cylinder = (palp_cylinder){
        .axis = {1, 0, 0}, .radius_m = 1.5f * edge, .half_m = edge, .rim_m = 0.5f * edge};
    for (uint32_t t = 0; t < 2; t++) {
        const palp_answer_config config = {.contact = {.blob = blob,
                                                       .tools = &tool[t],
                                                       .tool_count = 1,
                                                       .finest = PALP_CONTACT_FINEST},
                                           .cost = {&palp_target_counted, 0.5f, 0.0f, 0.9f},
                                           .port = {.now_ns = answer_clock},
                                           .dt_s = 1e-3f};
        size_t room = palp_answer_memsize(&config.contact);
        if (palp_answer_init(&answer, &config, aligned(room), room, NULL) != PALP_OK) exit(1);
        answer.coupling.tool[0].stiffness_N_per_m = 300.0f;
        for (uint32_t i = 0; i < 500; i++) {
            palp_coupling_result result;
            palp_answer_report report;
            float s = (float)i / 500.0f;
            palp_frame at = palp_frame_turn((palp_vec3){0.6f, 0.0f, 0.8f}, top, 0.7f * s);
            at.t = (palp_vec3){top.x + edge * s, top.y - 0.5f * edge * s,
                               top.z + edge * (2.2f - 2.0f * s)};
            uint64_t start = answer_clock(NULL);
            if (i % 50u == 7u) leaps += 700000u;
            palp_answer_tick(&answer, start, &at, &result, &report);
            mix(&result.force_N, sizeof result.force_N);
            mix(&result.tool, sizeof result.tool);
            mix(&report.points, sizeof report.points);
            mix(&report.active, sizeof report.active);
        }
    }
    printf("%016llx surface, ", (unsigned long long)hash);
}

/* The deformed surface under loads, and one problem of every kind of condition. */
static void deform(const palp_blob *blob) {
    static palp_field field;
    static palp_cma cma;
    const palp_domain *loose = &blob->domain[PALP_FREE], *fixed = &blob->domain[PALP_FIXED];
    const uint32_t finest = blob->meta->levels - 1u;
    const size_t nodes = blob->meta->nodes;
    size_t room = palp_field_memsize(blob);
    palp_load load[8];
    if (palp_field_init(&field, blob, aligned(room), room) != PALP_OK) exit(1);
    for (uint32_t k = 0; k < 8u; k++)
        load[k] = (palp_load){{finest, 61u * k % loose->slots}, {0.1f, 0.02f * (float)k, -0.3f}};
    palp_field_update(&field, load, 5);
    palp_field_update(&field, load + 3, 5);
    for (uint32_t l = 0; l <= finest; l++)
        mix(palp_field_reconstruct(&field, l), 16u * loose->level_start[l + 1u]);
    room = palp_cma_memsize(blob, 40);
    float *u = aligned(12u * nodes), *f = aligned(12u * nodes);
    if (palp_cma_init(&cma, blob, 40, aligned(room), room) != PALP_OK) exit(1);
    for (uint32_t k = 0; k < 4u; k++)
        (void)palp_cma_prescribe(&cma, loose->node[7u * k + 1u], PALP_PRESCRIBE_DISPLACEMENT,
                                 (palp_vec3){1e-3f, 0, 1e-4f * (float)k});
    (void)palp_cma_prescribe(&cma, loose->node[3], PALP_PRESCRIBE_NORMAL, (palp_vec3){1e-3f, 0, 0});
    (void)palp_cma_prescribe(&cma, loose->node[9], PALP_PRESCRIBE_TRACTION, (palp_vec3){9, 0, -50});
    (void)palp_cma_prescribe(&cma, fixed->node[0], PALP_PRESCRIBE_DISPLACEMENT,
                             (palp_vec3){0, 1e-3f, 0});
    (void)palp_cma_prescribe(&cma, fixed->node[2], PALP_RELEASE, (palp_vec3){0, 0, 0});
    (void)palp_cma_gravity(&cma, (palp_vec3){0, 0, -9.81f});
    if (palp_cma_solve(&cma, u, f) != PALP_OK) exit(1);
    mix(u, 12u * nodes);
    mix(f, 12u * nodes);
    printf("%016llx deformed, ", (unsigned long long)hash);
}

/* Two hands on the body, and after an exchange on a dynamic one as well. */
#define SCENE_TICKS 1750u
#define EXCHANGE_AT 1400u
static palp_tets tets;
static bool has_tets;
static palp_scene *scene, *next_scene;
static uint32_t touched; /* tools on bodies, bit by bit */

static palp_scene *open_scene(const palp_servo_config *c, const palp_blob *blob, bool both) {
    palp_body_config body[2] = {
        {.kind = PALP_BODY_ELASTIC, .at = PALP_FRAME_IDENTITY, .blob = blob, .finest = c->finest}};
    palp_hand_config hand[2] = {{.device = c->device, .placement = c->placement},
                                {.device = c->device, .placement = c->placement}};
    palp_scene_tool tool[4];
    palp_scene *opened;
    hand[1].placement.origin_m.x += 0.006f;
    for (uint32_t t = 0; t < 4u; t++) {
        tool[t] = (palp_scene_tool){
            .tool = palp_tool_sphere(0.012f),
            .hand = t / 2u,
            .at = palp_frame_at((palp_vec3){0, t % 2u ? 0.006f : 0.0f, t % 2u ? -0.003f : 0.0f})};
        tool[t].tool.friction = 0.3f;
    }
    tool[3].tool = palp_tool_capsule((palp_vec3){0, 0.6f, 0.8f}, 0.006f, 0.01f);
    if (has_tets) { /* its surface comes under the first tip */
        const palp_vec3 x = c->placement.origin_m;
        body[1] = (palp_body_config){
            .kind = PALP_BODY_DYNAMIC,
            .at = palp_frame_at((palp_vec3){x.x - 0.05f, x.y - 0.01f, x.z - 0.012f - 0.02f}),
            .tets = &tets,
            .material = palp_material_of(1e4f, 0.4f, 1000, 2e-4f, 4),
            .adapt = palp_adapt_defaults(&tets),
            .max_points = 32,
            .most_class = 5};
    }
    const palp_scene_config config = {.body = body,
                                      .tool = tool,
                                      .hand = hand,
                                      .bodies = both && has_tets ? 2 : 1,
                                      .tools = 4,
                                      .hands = 2,
                                      .cost = c->cost,
                                      .port = c->port};
    const size_t bytes = palp_scene_memsize(&config);
    if (palp_scene_open(&opened, &config, aligned(bytes), bytes, NULL) != PALP_OK) exit(1);
    return opened;
}

static void tick_scene(uint32_t number, const palp_can_frame *in, uint32_t count) {
    const palp_tick_input input[2] = {{.frames = in, .count = count},
                                      {.frames = in, .count = count}};
    palp_can_frame out[2][PALP_SERVO_FRAMES_OUT];
    palp_scene_report report;
    uint32_t sent[2];
    if (number > SCENE_TICKS) return;
    if (number == EXCHANGE_AT) palp_scene_leave(scene);
    if (palp_scene_has_left(scene) && palp_scene_take_over(next_scene, scene) == PALP_OK)
        scene = next_scene;
    palp_scene_tick(scene, input, out, sent, &report);
    for (uint32_t h = 0; h < 2; h++) {
        for (uint32_t i = 0; i < sent[h]; i++) mix(out[h][i].data, out[h][i].length);
        mix(&report.hand[h].force_N, sizeof report.hand[h].force_N);
        mix(&report.hand[h].contact_moment_Nm, sizeof report.hand[h].contact_moment_Nm);
    }
    for (uint32_t b = 0; b < palp_scene_bodies(scene); b++) {
        for (uint32_t t = 0; t < 4u; t++) {
            mix(&report.felt[b][t].wrench, sizeof(palp_wrench));
            if (report.felt[b][t].touching) touched |= 1u << (4u * b + t);
        }
    }
}

/* A dynamic body, poked: forces, displacements and velocities of every tick. */
static void move_body(const char *path) {
    static palp_dynamic body;
    size_t bytes;
    void *data = load(path, &bytes);
    if (palp_tets_open(&tets, data, bytes) != PALP_OK) exit(1);
    has_tets = true;
    const palp_tool ball = palp_tool_sphere(0.006f);
    const palp_dynamic_config config = {.tets = &tets,
                                        .material = palp_material_of(1e4f, 0.4f, 1000, 2e-4f, 4),
                                        .gravity_m_s2 = {0, 0, -1},
                                        .adapt = palp_adapt_defaults(&tets),
                                        .tools = &ball,
                                        .tool_count = 1,
                                        .max_points = 32,
                                        .most_class = 5,
                                        .cost = {&palp_target_counted, 0.3f, 0.0f, 0.8f},
                                        .port = {.now_ns = still_clock},
                                        .tick_s = 1e-3f};
    palp_frame at = palp_frame_at((palp_vec3){0.05f, 0.01f, 0.04f});
    palp_wrench on_tool;
    size_t size = palp_dynamic_memsize(&tets, 32);
    if (palp_dynamic_init(&body, &config, &at, aligned(size), size, NULL) != PALP_OK) exit(1);
    for (int k = 0; k < 500; k++) {
        palp_dynamic_report report;
        at.t.z = 0.04f - 0.00008f * (float)(k < 250 ? k : 500 - k);
        palp_dynamic_tick(&body, 0, &at, &on_tool, &report);
        mix(&on_tool, sizeof on_tool);
        mix(&report.evaluations, sizeof report.evaluations);
        for (uint32_t i = 0; i < body.dyna.active_count; i++) {
            mix(body.dyna.u_m + 3 * body.dyna.active[i], 3 * sizeof(float));
            mix(body.dyna.v_m_s + 3 * body.dyna.active[i], 3 * sizeof(float));
        }
    }
}

int main(int argc, char **argv) {
    palp_blob blob;
    palp_servo *servo;
    if (argc < 3) return 2;
    size_t bytes;
    void *data = load(argv[1], &bytes);
    if (palp_blob_open(&blob, data, bytes) != PALP_OK) return 1;
    if (argc > 3) move_zones(argv[3]);
    if (argc > 4) move_body(argv[4]);
    palp_servo_config config = {.device = {.kinematics = {PALP_ARM3, 0.14f, 0.14f, 0},
                                           .drives = {.protocol = PALP_PROTOCOL_ODRIVE,
                                                      .counts_per_rev = 8192,
                                                      .torque_max_Nm = 0.35f,
                                                      .watchdog_s = 0.05f,
                                                      .rate_hz = 1000},
                                           .node_id = {1, 2, 3},
                                           .gear = {10, 10, 10},
                                           .joint_min_rad = {-2, -2, -2},
                                           .joint_max_rad = {2, 2, 2},
                                           .force_max_N = 8.5f,
                                           .slew_max_N_per_s = 4000,
                                           .speed_max_m_s = 1.5f,
                                           .workspace_radius_m = 0.06f,
                                           .stiffness_max_N_per_m = 700,
                                           .damping_max_Ns_per_m = 1.5f,
                                           .damping_Ns_per_m = 0.6f},
                                .placement = {.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .scale = 1},
                                .finest = PALP_CONTACT_FINEST,
                                .cost = {&palp_target_counted, 0.01f, 0.0f, 0.8f},
                                .port = {.now_ns = still_clock},
                                .tool = palp_tool_sphere(0.012f)};
    /* The highest free node lies under the tool at the home position. */
    uint32_t top = blob.domain[PALP_FREE].node[0];
    for (uint32_t i = 0; i < blob.meta->nodes; i++) {
        if (!palp_node_is_fixed(&blob, i) && blob.rest_m[3 * i + 2] > blob.rest_m[3 * top + 2])
            top = i;
    }
    config.placement.origin_m = (palp_vec3){blob.rest_m[3 * top], blob.rest_m[3 * top + 1],
                                            blob.rest_m[3 * top + 2] + 0.012f};
    move_surface(&blob, palp_vec3_at(blob.rest_m + 3 * top));
    deform(&blob);
    size_t size = palp_servo_memsize(&blob, config.finest);
    if (palp_servo_open(&servo, &blob, &config, aligned(size), size, NULL) != PALP_OK) return 1;

    scene = open_scene(&config, &blob, false);
    next_scene = open_scene(&config, &blob, true);
    uint32_t ticks = 0;
    FILE *log = fopen(argv[2], "r");
    palp_can_frame in[64], out[PALP_SERVO_FRAMES_OUT];
    palp_report report;
    uint32_t n = 0;
    char line[256], stamp[64] = "", last[64] = "", hex[160];
    unsigned id;
    float largest = 0;
    for (;;) {
        bool more = fgets(line, sizeof line, log) != NULL &&
                    sscanf(line, "%63s %*s %x#%159s", stamp, &id, hex) >= 2;
        if (more && strstr(line, " loop ") == NULL) continue; /* what else is on record */
        if ((!more || strcmp(stamp, last) != 0) && last[0] != '\0') {
            uint32_t sent =
                palp_servo_tick(servo, &(palp_tick_input){.frames = in, .count = n}, out, &report);
            for (uint32_t i = 0; i < sent; i++)
                mix(&out[i].id, sizeof out[i].id), mix(out[i].data, out[i].length);
            mix(&report.force_N, sizeof report.force_N);
            mix(&report.tool, sizeof report.tool);
            largest = palp_max(largest, palp_norm(report.force_N));
            tick_scene(ticks++, in, n);
            n = 0;
        }
        if (!more) break;
        strcpy(last, stamp);
        unsigned command = id & 31u;
        if ((command != 1 && command != 9) || n == 64) continue; /* only what the drives sent */
        palp_can_frame *frame = &in[n++];
        *frame = (palp_can_frame){.id = id, .length = (uint8_t)(strlen(hex) / 2)};
        for (uint32_t i = 0; i < frame->length; i++) {
            unsigned byte;
            sscanf(hex + 2 * i, "%2x", &byte);
            frame->data[i] = (uint8_t)byte;
        }
    }
    printf("%016llx largest %.9g N, %u faults, touched %02x\n", (unsigned long long)hash,
           (double)largest, report.faults, (unsigned)touched);
    return 0;
}
