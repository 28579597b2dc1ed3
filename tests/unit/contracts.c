/* SPDX-License-Identifier: MIT */
/* What core/palp.h says of every call: blocks of memory, calls that fail, bounds of memory that are
 * constants. */
#include "port/host/devfile.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tests/models.h"
#include "tests/tap.h"

#include <stdlib.h>
#include <string.h>

static baked body;
static zoned zones;
static dynamic_body soft;
static palp_tool tool;
static palp_frame at;

static uint64_t no_time(void *context) {
    (void)context;
    return 0;
}
static const palp_cost_table cost = {
    .target = &palp_target_counted, .ns_per_instruction = 1e-3f, .margin = 0.9f};

/* ---- every init on a block of so many bytes ---- */

static palp_status open_cma(void *memory, size_t bytes) {
    static palp_cma x;
    return palp_cma_init(&x, &body.blob, 6, memory, bytes);
}
static palp_status open_field(void *memory, size_t bytes) {
    static palp_field x;
    return palp_field_init(&x, &body.blob, memory, bytes);
}
static palp_contact_config one_body(const palp_blob *blob, uint32_t tools, uint32_t finest) {
    return (palp_contact_config){
        .blob = blob, .tools = &tool, .tool_count = tools, .finest = finest};
}
static palp_status open_contact(void *memory, size_t bytes) {
    static palp_contact x;
    const palp_contact_config c = one_body(&body.blob, 1, 3);
    return palp_contact_init(&x, &c, memory, bytes);
}
static palp_status open_answer(void *memory, size_t bytes) {
    static palp_answer x;
    const palp_answer_config c = {
        .contact = {.blob = &body.blob, .tools = &tool, .tool_count = 1, .finest = 3},
        .cost = cost,
        .port = {.now_ns = no_time},
        .dt_s = 1e-3f};
    return palp_answer_init(&x, &c, memory, bytes, NULL);
}
static palp_servo_config servo_config(void) {
    static const palp_placement as_it_is = {.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .scale = 1};
    return (palp_servo_config){.device = device_load("arm3").device,
                               .placement = as_it_is,
                               .finest = 3,
                               .cost = cost,
                               .port = {.now_ns = no_time},
                               .tool = tool};
}
static palp_status open_servo(void *memory, size_t bytes) {
    palp_servo *x;
    const palp_servo_config c = servo_config();
    return palp_servo_open(&x, &body.blob, &c, memory, bytes, NULL);
}
static palp_status open_seams(void *memory, size_t bytes) {
    static palp_seams x;
    return palp_seams_init(&x, zones.zones, 2, memory, bytes);
}
static palp_status open_assembly(void *memory, size_t bytes) {
    static palp_assembly x;
    return palp_assembly_init(&x, zones.zones, 2, memory, bytes);
}
static palp_assembly *posed;
static palp_contact_config all_zones(void) {
    return (palp_contact_config){
        .assembly = posed, .pairs = true, .tools = &tool, .tool_count = 1, .finest = 3};
}
static palp_status open_contact_zones(void *memory, size_t bytes) {
    static palp_contact x;
    const palp_contact_config c = all_zones();
    return palp_contact_init(&x, &c, memory, bytes);
}
static const palp_material material = {
    .lambda_Pa = 1e4f, .mu_Pa = 1e4f, .phi_Pa_s = 1, .psi_Pa_s = 1, .density_kg_m3 = 1000};
static palp_dyna dyna;
static palp_status open_dyna(void *memory, size_t bytes) {
    const palp_dyna_config c = {.material = material, .tick_s = 1e-3f, .most_class = 3};
    return palp_dyna_init(&dyna, &soft.tets, &c, memory, bytes);
}
static palp_adapt adapt;
static palp_status open_adapt(void *memory, size_t bytes) {
    const palp_adapt_config c = palp_adapt_defaults(&soft.tets);
    return palp_adapt_init(&adapt, &dyna, &c, memory, bytes);
}
static palp_status open_impose(void *memory, size_t bytes) {
    static palp_impose x;
    const palp_impose_config c = {.dyna = &dyna,
                                  .adapt = &adapt,
                                  .tools = &tool,
                                  .tool_count = 1,
                                  .at = &at,
                                  .max_points = 16};
    return palp_impose_init(&x, &c, memory, bytes);
}
static palp_status open_skin(void *memory, size_t bytes) {
    static palp_skin x;
    return palp_skin_init(&x, &dyna, memory, bytes);
}
static palp_status open_dynamic(void *memory, size_t bytes) {
    static palp_dynamic x;
    const palp_dynamic_config c = {.tets = &soft.tets,
                                   .material = material,
                                   .adapt = palp_adapt_defaults(&soft.tets),
                                   .tools = &tool,
                                   .tool_count = 1,
                                   .max_points = 16,
                                   .most_class = 3,
                                   .cost = cost,
                                   .port = {.now_ns = no_time},
                                   .tick_s = 1e-3f};
    return palp_dynamic_init(&x, &c, &at, memory, bytes, NULL);
}

/* In the order in which they stand on each other. The block that an init succeeds on stays. */
static void check_block(const char *name, palp_status (*open)(void *, size_t), size_t bytes) {
    uint8_t *block = allocate_aligned(bytes + PALP_ALIGN, 1);
    const palp_status none = open(NULL, bytes), less = open(block, bytes - 1),
                      off = open(block + 4, bytes), off_short = open(block + 4, bytes - 1),
                      good = open(block, bytes);
    CHECK(none == PALP_ERR_MEMORY && less == PALP_ERR_MEMORY && off_short == PALP_ERR_MEMORY &&
              off == PALP_ERR_ALIGNMENT && good == PALP_OK,
          "%s on no block, a short one, one off its place, %zu bytes: %d %d %d %d", name, bytes,
          (int)none, (int)less, (int)off, (int)good);
}

static void check_blocks(void) {
    const palp_contact_config one = one_body(&body.blob, 1, 3), all = all_zones();
    check_block("palp_cma_init", open_cma, palp_cma_memsize(&body.blob, 6));
    check_block("palp_field_init", open_field, palp_field_memsize(&body.blob));
    check_block("palp_contact_init", open_contact, palp_contact_memsize(&one));
    check_block("palp_answer_init", open_answer, palp_answer_memsize(&one));
    check_block("palp_servo_open", open_servo, palp_servo_memsize(&body.blob, 3));
    check_block("palp_seams_init", open_seams, palp_seams_memsize(zones.zones, 2));
    check_block("palp_assembly_init", open_assembly, palp_assembly_memsize(zones.zones, 2));
    check_block("palp_contact_init of zones", open_contact_zones, palp_contact_memsize(&all));
    check_block("palp_dyna_init", open_dyna, palp_dyna_memsize(&soft.tets));
    check_block("palp_adapt_init", open_adapt, palp_adapt_memsize(&soft.tets));
    check_block("palp_impose_init", open_impose, palp_impose_memsize(&soft.tets, 16));
    check_block("palp_skin_init", open_skin, palp_skin_memsize(&soft.tets));
    check_block("palp_dynamic_init", open_dynamic, palp_dynamic_memsize(&soft.tets, 16));
}

/* ---- constants for static memory ---- */

static void check_constant(const char *name, size_t constant, size_t needed, double room) {
    CHECK(constant >= needed && (double)constant <= room * (double)needed, "%s: %zu bytes for %zu",
          name, constant, needed);
}

static void check_constants(void) {
    palp_blob most = body.blob; /* of a body with as many modes as there can be */
    most.regular.modes = PALP_MAX_MODES;
    for (uint32_t level = 0; level < PALP_CONTACT_LEVELS; level++) {
        for (uint32_t tools = 1; tools <= PALP_CONTACT_TOOLS; tools++) {
            const palp_contact_config config = one_body(&most, tools, level);
            char name[64];
            snprintf(name, sizeof name, "PALP_ANSWER_BYTES(%u, %u)", tools, level);
            check_constant(name, PALP_ANSWER_BYTES(tools, level), palp_answer_memsize(&config),
                           1.15);
        }
        check_constant("PALP_SERVO_BYTES", PALP_SERVO_BYTES(level),
                       palp_servo_memsize(&most, level), 1.15);
    }
    uint32_t all = 0;
    for (uint32_t l = 0; l <= body.blob.meta->constraint_level; l++)
        all += body.blob.level[l].nodes;
    check_constant("PALP_FIELD_BYTES",
                   PALP_FIELD_BYTES(body.blob.meta->domain_nodes[PALP_FREE], all),
                   palp_field_memsize(&body.blob), 1.1);
    const palp_tets_meta *m = soft.tets.meta;
    check_constant("PALP_DYNAMIC_BYTES",
                   PALP_DYNAMIC_BYTES(m->nodes, m->tets, m->families, m->skin, 16),
                   palp_dynamic_memsize(&soft.tets, 16), 1.2);
}

/* ---- calls that fail change nothing ---- */

/* What the solver answers to a press, with or without calls before it that fail. */
static void solve_press(bool fail_first, float *u_m, float *f_N) {
    const size_t bytes = palp_cma_memsize(&body.blob, 6);
    void *memory = allocate_aligned(bytes, 1);
    palp_cma cma;
    (void)palp_cma_init(&cma, &body.blob, 6, memory, bytes);
    const uint32_t node = body.blob.domain[PALP_FREE].node[3];
    (void)palp_cma_prescribe(&cma, node, PALP_PRESCRIBE_DISPLACEMENT, (palp_vec3){0, 0, -1e-3f});
    if (fail_first) {
        const palp_vec3 good = {0, 0, 1}, bad = {0, NAN, 0};
        const uint32_t other = body.blob.domain[PALP_FREE].node[5];
        bool failed = true;
        failed = failed && palp_cma_prescribe(&cma, node, PALP_PRESCRIBE_FORCE, good) != PALP_OK;
        failed = failed && palp_cma_prescribe(&cma, other, PALP_PRESCRIBE_FORCE, bad) != PALP_OK;
        failed = failed && palp_cma_prescribe(&cma, body.blob.meta->nodes, PALP_PRESCRIBE_FORCE,
                                              good) != PALP_OK;
        failed = failed && palp_cma_level(&cma, 99, PALP_ENERGETIC) != PALP_OK;
        failed = failed && palp_cma_gravity(&cma, bad) != PALP_OK;
        CHECK(failed, "calls of the solver that must fail do");
    }
    CHECK(palp_cma_solve(&cma, u_m, f_N) == PALP_OK, "a press is solved");
    free(memory);
}

static void check_failures(void) {
    const size_t values = 3 * (size_t)body.blob.meta->nodes;
    float *u[2], *f[2];
    for (int k = 0; k < 2; k++) {
        u[k] = allocate(values, sizeof *u[k]);
        f[k] = allocate(values, sizeof *f[k]);
        solve_press(k == 1, u[k], f[k]);
    }
    CHECK(memcmp(u[0], u[1], values * sizeof *u[0]) == 0 &&
              memcmp(f[0], f[1], values * sizeof *f[0]) == 0,
          "and leave its answer as it was, bit for bit");
    palp_blob opened = body.blob;
    CHECK(palp_blob_open(&opened, body.bytes, body.size - 64) != PALP_OK &&
              memcmp(&opened, &body.blob, sizeof opened) == 0,
          "a blob that cannot be opened leaves the one before");
    static palp_zones some_zones;
    palp_tets some_tets;
    CHECK(palp_blob_open(&opened, NULL, 64) == PALP_ERR_TRUNCATED &&
              palp_zones_open(&some_zones, NULL, 64) == PALP_ERR_TRUNCATED &&
              palp_tets_open(&some_tets, NULL, 64) == PALP_ERR_TRUNCATED,
          "no bytes are a blob that is cut off");
    const palp_vec3 before = posed->gravity_m_s2, bad = {0, 0, NAN};
    CHECK(palp_assembly_gravity(posed, bad) == PALP_ERR_NOT_FINITE &&
              memcmp(&before, &posed->gravity_m_s2, sizeof before) == 0,
          "gravity that is no number leaves the one before");
    palp_servo *servo = NULL;
    palp_servo_config c = servo_config();
    c.tool.friction = NAN;
    const size_t bytes = palp_servo_memsize(&body.blob, 3);
    void *memory = allocate_aligned(bytes, 1);
    CHECK(palp_servo_open(&servo, &body.blob, &c, memory, bytes, NULL) == PALP_ERR_ARGUMENT &&
              servo == NULL,
          "a servo that is refused is none");
    for (int k = 0; k < 2; k++) {
        free(u[k]);
        free(f[k]);
    }
    free(memory);
}

int main(void) {
    progress_quiet(1);
    body = model_bake(model_sphere(2), -0.5, 0.05, false, false);
    const mesh box = model_box(0.06, 4);
    zones = model_zones(&box,
                        "young 2e4\npoisson 0.4\nzone a\nfix-below x 1e-6\nzone b\n"
                        "fix-above x 0.0599\ncut a b 0.03 0 0 1 0 0\njoint j revolute a b\n"
                        "axis 0 1 0\norigin 0.03 0 0\nlimits -1 1\n",
                        0.05);
    posed = model_assembly(zones.zones, 2);
    const double phase[3] = {0.3, 0.3, 0.3};
    tetmesh level[2];
    const mesh ball = model_sphere(3);
    bvh *on = bvh_build(&ball);
    double dropped;
    level[0] = stuff(&ball, on, 0.9, phase, &dropped);
    level[1] = stuff(&ball, on, 0.5, phase, &dropped);
    soft = model_dynamic_body(level, 2, -0.9, 1e4, 0.4, 1e-4);
    tool = palp_tool_sphere(0.1f);
    at = palp_frame_at((palp_vec3){0, 0, 3});
    check_blocks();
    check_constants();
    check_failures();
    return tap_done();
}
