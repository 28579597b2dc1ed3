/* SPDX-License-Identifier: MIT */
#include "port/host/shape.h"
#include "core/contact/loads.h"
#include "core/dyna/skin.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

#define MOST_LOADS PALP_SERVO_LOADS

static void put(float *to, palp_vec3 x) {
    to[0] = x.x;
    to[1] = x.y;
    to[2] = x.z;
}

/* ---- opening ---- */

static shape_part *add_part(shape *s, uint32_t body, uint32_t nodes, uint32_t triangles,
                            const uint32_t *triangle) {
    shape_part *p = &s->part[s->parts++];
    *p = (shape_part){.body = body, .nodes = nodes, .triangles = triangles, .triangle = triangle};
    p->rest_m = allocate(3 * (size_t)nodes, sizeof *p->rest_m);
    p->at_m = allocate(3 * (size_t)nodes, sizeof *p->at_m);
    p->pressure_Pa = allocate(nodes, sizeof *p->pressure_Pa);
    uint8_t *fixed = allocate(nodes, 1);
    p->fixed = fixed;
    return p;
}

static void add_blob(shape *s, uint32_t body, uint32_t zone, const palp_blob *b) {
    shape_part *p = add_part(s, body, b->meta->nodes, b->meta->triangles, b->triangle);
    uint8_t *fixed = (uint8_t *)(uintptr_t)p->fixed;
    const size_t bytes = palp_field_memsize(b);
    p->zone = zone;
    for (uint32_t i = 0; i < p->nodes; i++) fixed[i] = palp_node_is_fixed(b, i) ? 1 : 0;
    p->field_memory = allocate_aligned(bytes, 1);
    if (palp_field_init(&p->field, b, p->field_memory, bytes) != PALP_OK)
        die(EXIT_WORK, "the surface of %s does not open", s->setup->file->body[body].name);
}

static void add_skin(shape *s, uint32_t body, const palp_tets *t) {
    shape_part *p = add_part(s, body, t->meta->skin, t->meta->skin_triangles, t->skin_triangle);
    uint8_t *fixed = (uint8_t *)(uintptr_t)p->fixed;
    for (uint32_t i = 0; i < p->nodes; i++)
        fixed[i] = (t->node[t->skin_node[i]].flags & PALP_TET_PINNED) != 0 ? 1 : 0;
}

shape *shape_open(const scene_setup *setup, palp_scene *scene) {
    shape *s = allocate(1, sizeof *s);
    s->setup = setup;
    s->scene = scene;
    for (uint32_t b = 0; b < setup->config.bodies; b++) {
        const scene_part *part = &setup->part[b];
        if (part->kind == PALP_BODY_DYNAMIC) add_skin(s, b, &part->tets);
        if (part->kind == PALP_BODY_ELASTIC) add_blob(s, b, 0, &part->blob);
        if (part->kind != PALP_BODY_ZONES) continue;
        for (uint32_t z = 0; z < part->zones.meta->zones; z++) {
            add_blob(s, b, z, &part->zones.blob[z]);
            s->part[s->parts - 1].modes =
                allocate(3 * (size_t)part->zones.zone[z].modes + 1, sizeof(float));
        }
    }
    shape_update(s);
    return s;
}

void shape_close(shape *s) {
    for (uint32_t i = 0; i < s->parts; i++) {
        shape_part *p = &s->part[i];
        void *owned[] = {p->rest_m,       p->at_m, p->pressure_Pa, (void *)(uintptr_t)p->fixed,
                         p->field_memory, p->modes};
        for (size_t k = 0; k < sizeof owned / sizeof owned[0]; k++) free(owned[k]);
    }
    free(s);
}

/* ---- surfaces ---- */

/* The tools' forces on a blob, shared out to its nodes. */
static void load(shape_part *p, const palp_body *body) {
    const palp_contact *c = &body->answer->contact;
    const palp_blob *b = p->field.blob;
    palp_load list[MOST_LOADS];
    palp_load_list loads = {.load = list, .capacity = MOST_LOADS};
    for (uint32_t k = 0; k < c->patches; k++) {
        palp_vec3 friction = {0.0f, 0.0f, 0.0f};
        if (k < c->tool_count) friction = body->answer->coupling.tool[k].friction.force_N;
        if (c->frame != NULL) friction = palp_rotate_back(c->frame[p->zone].r, friction);
        palp_contact_loads(c, k, p->zone, friction, &loads);
    }
    palp_field_update(&p->field, list, loads.count);
    memset(p->pressure_Pa, 0, p->nodes * sizeof *p->pressure_Pa);
    const palp_domain *d = &b->domain[PALP_FREE];
    for (uint32_t i = 0; i < loads.count; i++) {
        const uint32_t node = d->node[list[i].at.slot];
        p->pressure_Pa[node] = palp_norm(list[i].force_N) / b->area_m2[node];
    }
}

/* Displacement of a node by the forces on its blob alone. */
static palp_vec3 field_at(const shape_part *p, const float *x, uint32_t node) {
    const palp_vec3 none = {0.0f, 0.0f, 0.0f};
    if (p->fixed[node] != 0) return none;
    return palp_vec3_at(x + PALP_FIELD_LANES * (size_t)palp_node_slot(p->field.blob, node));
}

static void update_blob(shape_part *p, const palp_body *body) {
    const palp_blob *b = p->field.blob;
    const palp_frame *at = &body->config.at;
    load(p, body);
    const float *x = palp_field_reconstruct(&p->field, b->meta->levels - 1);
    for (uint32_t i = 0; i < p->nodes; i++) {
        const palp_vec3 rest = palp_vec3_at(b->rest_m + 3 * (size_t)i);
        put(p->rest_m + 3 * (size_t)i, palp_carry(at, rest));
        put(p->at_m + 3 * (size_t)i, palp_carry(at, palp_add(rest, field_at(p, x, i))));
    }
}

/* What contact does to the seams; the assembly is left as it was. */
typedef struct {
    float *total, *load, *pushed[PALP_MAX_ZONES];
    uint64_t contact_work, seam_work;
} seam_state;

static float *copy(const float *x, size_t n) {
    float *y = allocate(n + 1, sizeof *y);
    memcpy(y, x, n * sizeof *y);
    return y;
}

static void give_back(float *to, float *from, size_t n) {
    memcpy(to, from, n * sizeof *to);
    free(from);
}

static const float *seams_in_contact(const palp_body *body, seam_state *before) {
    palp_assembly *a = body->config.assembly;
    const size_t n = 3 * (size_t)a->seams.modes;
    before->load = copy(a->load, n);
    for (uint32_t z = 0; z < a->zones->meta->zones; z++)
        before->pushed[z] = copy(a->pushed[z], 3 * (size_t)a->zones->zone[z].modes);
    before->total = copy(a->total, n);
    before->contact_work = body->answer->contact.work_done;
    before->seam_work = a->seams.work_done;
    palp_contact_load_seams(&body->answer->contact);
    (void)palp_assembly_total(a);
    for (size_t i = 0; i < n; i++) a->total[i] -= a->w[i];
    return a->total;
}

static void restore(const palp_body *body, seam_state *before) {
    palp_assembly *a = body->config.assembly;
    const size_t n = 3 * (size_t)a->seams.modes;
    give_back(a->load, before->load, n);
    give_back(a->total, before->total, n);
    body->answer->contact.work_done = before->contact_work;
    a->seams.work_done = before->seam_work;
    for (uint32_t z = 0; z < a->zones->meta->zones; z++)
        give_back(a->pushed[z], before->pushed[z], 3 * (size_t)a->zones->zone[z].modes);
}

static void update_zone(shape_part *p, const palp_body *body, const float *contact) {
    palp_assembly *a = body->config.assembly;
    const palp_blob *b = p->field.blob;
    const palp_frame at = palp_frame_compose(&body->config.at, &a->world[p->zone]);
    load(p, body);
    const float *x = palp_field_reconstruct(&p->field, b->meta->levels - 1);
    palp_seams_expand(&a->seams, a->configuration, a->seams.finest, p->zone, contact, p->modes);
    for (uint32_t i = 0; i < p->nodes; i++) {
        const palp_vec3 rest = palp_vec3_at(b->rest_m + 3 * (size_t)i);
        const palp_vec3 bent =
            palp_add(palp_assembly_bent(a, p->zone, i),
                     palp_zone_modal_displacement(a->zones, a->seams.finest, p->zone, i, p->modes));
        put(p->rest_m + 3 * (size_t)i, palp_carry(&at, rest));
        put(p->at_m + 3 * (size_t)i,
            palp_carry(&at, palp_add(rest, palp_add(bent, field_at(p, x, i)))));
    }
}

static void update_skin(shape_part *p, const palp_body *body) {
    const palp_dyna *d = &body->dynamic->dyna;
    const palp_frame *at = &body->config.at;
    for (uint32_t i = 0; i < p->nodes; i++) {
        const palp_vec3 rest = palp_vec3_at(d->tets->rest_m + 3 * (size_t)d->tets->skin_node[i]);
        put(p->rest_m + 3 * (size_t)i, palp_carry(at, rest));
        put(p->at_m + 3 * (size_t)i, palp_carry(at, palp_skin_position(d, i)));
    }
}

/* ---- points in contact ---- */

static void add_points(shape *s, const palp_body *body) {
    const palp_contact *c = &body->answer->contact;
    if (!c->solved) return;
    for (uint32_t k = 0; k < c->count; k++) {
        const palp_contact_point *p = &c->point[k];
        const size_t most = sizeof s->point / sizeof s->point[0];
        if (!(p->force_N > 0.0f) || s->points == most) continue;
        palp_frame at = body->config.at;
        if (c->frame != NULL) at = palp_frame_compose(&at, &c->frame[p->at.body]);
        shape_point *to = &s->point[s->points++];
        put(to->at_m, palp_carry(&at, palp_add(p->at.y, p->u_m)));
        put(to->force_N, palp_scale(p->force_N, palp_rotate(at.r, p->m)));
    }
}

void shape_update(shape *s) {
    s->points = 0;
    for (uint32_t i = 0; i < s->parts;) {
        const palp_body *body = palp_scene_body(s->scene, s->part[i].body);
        const palp_body_kind kind = body->config.kind;
        if (kind == PALP_BODY_DYNAMIC) {
            update_skin(&s->part[i++], body);
            continue;
        }
        add_points(s, body);
        if (kind == PALP_BODY_ELASTIC) {
            update_blob(&s->part[i++], body);
            continue;
        }
        seam_state before;
        const float *contact = seams_in_contact(body, &before);
        const uint32_t of = s->part[i].body;
        for (; i < s->parts && s->part[i].body == of; i++) update_zone(&s->part[i], body, contact);
        restore(body, &before);
    }
}

/* ---- motions ---- */

void shape_to_motion(const shape *s, motion *m, size_t bytes) {
    const palp_scene_config *c = &s->setup->config;
    m->parts = s->parts;
    for (uint32_t i = 0; i < s->parts; i++) {
        const shape_part *p = &s->part[i];
        const scene_part *of = &s->setup->part[p->body];
        m->part[i] = (motion_part){.nodes = p->nodes,
                                   .triangles = p->triangles,
                                   .triangle = p->triangle,
                                   .fixed = p->fixed,
                                   .far_off = of->kind == PALP_BODY_ZONES};
        m->part[i].rest_m = copy(p->rest_m, 3 * (size_t)p->nodes); /* a zone moves */
        m->part[i].name = of->kind == PALP_BODY_ZONES ? of->zones.zone[p->zone].name
                                                      : s->setup->file->body[p->body].name;
    }
    m->tools = c->tools;
    for (uint32_t t = 0; t < m->tools; t++) m->tool[t] = &s->setup->tool[t].tool;
    motion_begin(m, bytes);
}

void shape_add_frame(shape *s, motion *m, double t_s, const palp_frame *tool) {
    const float *at[SHAPE_PARTS];
    shape_update(s);
    for (uint32_t i = 0; i < s->parts; i++) at[i] = s->part[i].at_m;
    motion_add(m, t_s, at, tool);
}
