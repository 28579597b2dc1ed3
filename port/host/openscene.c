/* SPDX-License-Identifier: MIT */
#include "port/host/openscene.h"
#include "core/base/crc32c.h"
#include "port/host/blobfile.h"
#include "port/host/joints.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SEAMS_FINEST 4u /* levels of the seams of a multizone model; as palp play */
#define DYNAMIC_POINTS 64u

static palp_vec3 vec(const double x[3]) {
    return (palp_vec3){(float)x[0], (float)x[1], (float)x[2]};
}

/* ---- bodies ---- */

static void need_regular(const char *path, const palp_blob *blob) {
    if (palp_blob_has(blob, PALP_META_SCALAR))
        die(EXIT_WORK, "%s: a scalar problem: there is nothing to touch", path);
    if (blob->meta->modes == 0)
        die(EXIT_WORK,
            "%s: has no regular part, which contact needs (baked by an older palp, with --modes 0 "
            "or "
            "--reciprocity raw): bake it again",
            path);
}

/* Where joints are at time t. */
static void values_at(const scene_part *part, double t_s, float value[PALP_MAX_JOINTS]) {
    for (uint32_t j = 0; j < part->zones.meta->joints; j++) {
        double x[3] = {0};
        if (part->joint[j] != NULL) scene_at(part->joint[j], t_s, x);
        value[j] = (float)x[0];
    }
}

void scene_joints(const scene_body *b, const palp_zones *zones,
                  const scene_track *joint[PALP_MAX_JOINTS]) {
    for (size_t i = 0; i < b->motions; i++) {
        const scene_motion *m = &b->motion[i];
        const uint32_t j = find_joint(m->where, zones, m->joint);
        for (size_t k = 0; k < m->track.count; k++)
            check_joint(m->where, zones, j, m->track.key[k].value[0]);
        joint[j] = &m->track;
    }
}

static void open_zones(const scene_body *b, scene_part *part, const void *data) {
    palp_status status = palp_zones_open(&part->zones, data, part->bytes);
    if (status != PALP_OK) die_of_blob(b->path, status, part->bytes);
    for (uint32_t i = 0; i < part->zones.meta->zones; i++)
        need_regular(b->path, &part->zones.blob[i]);
    const size_t bytes = palp_assembly_memsize(&part->zones, SEAMS_FINEST);
    part->memory = allocate_aligned(bytes + 1, 1);
    status = palp_assembly_init(&part->assembly, &part->zones, SEAMS_FINEST, part->memory, bytes);
    if (status != PALP_OK) die(EXIT_WORK, "%s: %s", b->path, palp_status_text(status));
    const palp_vec3 gravity = vec(b->gravity_m_s2);
    if (palp_norm(gravity) > 0 && palp_assembly_gravity(&part->assembly, gravity) != PALP_OK)
        die(EXIT_WORK, "%s: a zone has no gravity response", b->path);
    scene_joints(b, &part->zones, part->joint);
    const palp_frame rest = PALP_FRAME_IDENTITY;
    float value[PALP_MAX_JOINTS];
    values_at(part, 0, value);
    palp_assembly_pose(&part->assembly, value, &rest);
    palp_assembly_settle(&part->assembly);
}

static palp_material material_of(const scene_body *b, const palp_tets_meta *m) {
    return palp_material_of(b->young_Pa >= 0 ? (float)b->young_Pa : m->young_Pa,
                            b->poisson > -1 ? (float)b->poisson : m->poisson, m->density_kg_m3,
                            b->damping_s >= 0 ? (float)b->damping_s : m->damping_s,
                            b->drag_per_s >= 0 ? (float)b->drag_per_s : m->drag_per_s);
}

static void open_body(scene_setup *s, uint32_t number) {
    const scene_body *b = &s->file->body[number];
    scene_part *part = &s->part[number];
    palp_body_config *c = &s->body[number];
    if (b->path[0] == '\0')
        die(EXIT_USAGE, "%s: names no body: add a line 'body FILE' before what belongs to it",
            s->file->name);
    size_t bytes;
    void *data = read_file(b->path, &bytes);
    part->data = data;
    part->bytes = (uint32_t)bytes;
    part->crc = palp_crc32c(0, data, bytes);
    *c = (palp_body_config){.at = scene_frame(&b->at), .finest = b->finest, .pairs = !b->alone};
    if (palp_tets_are_here(data, bytes)) {
        const palp_status status = palp_tets_open(&part->tets, data, bytes);
        if (status != PALP_OK) die_of_blob(b->path, status, bytes);
        c->kind = PALP_BODY_DYNAMIC;
        c->tets = &part->tets;
        c->material = material_of(b, part->tets.meta);
        c->gravity_m_s2 = vec(b->gravity_m_s2);
        c->adapt = palp_adapt_defaults(&part->tets);
        c->max_points = DYNAMIC_POINTS;
        c->most_class = PALP_STEP_CLASSES - 1u;
    } else if (palp_zones_are_here(data, bytes)) {
        open_zones(b, part, data);
        c->kind = PALP_BODY_ZONES;
        c->assembly = &part->assembly;
    } else {
        part->blob = open_blob(b->path, data, bytes);
        need_regular(b->path, &part->blob);
        c->kind = PALP_BODY_ELASTIC;
        c->blob = &part->blob;
        if (palp_norm(vec(b->gravity_m_s2)) > 0)
            die(EXIT_USAGE, "%s: gravity: %s is elastostatic, and lies as it was baked",
                s->file->name, b->name);
    }
    part->kind = c->kind;
    if (part->kind != PALP_BODY_ZONES && b->motions > 0)
        die(EXIT_USAGE, "%s: %s has no joints", b->motion[0].where, b->name);
    if (part->kind != PALP_BODY_DYNAMIC &&
        (b->young_Pa >= 0 || b->poisson > -1 || b->damping_s >= 0 || b->drag_per_s >= 0))
        die(EXIT_USAGE,
            "%s: the material of %s was baked into it: only that of a dynamic body can be changed",
            s->file->name, b->name);
}

static void open_axis(const scene_setup *s, const scene_follow *f, palp_scene_drive *d) {
    const uint32_t axes = palp_axes(&s->device[f->device].device.kinematics);
    if (s->part[f->body].joint[d->joint] != NULL)
        die(EXIT_USAGE, "%s: joint '%s' is on a track already", f->where, f->joint);
    if (f->axis >= axes)
        die(EXIT_USAGE, "%s: device %" PRIu32 " has %" PRIu32 " axes, counted from 0", f->where,
            f->device, axes);
    d->by = PALP_DRIVEN_BY_AXIS;
    d->axis = f->axis;
    d->offset = (float)f->offset;
    d->scale = (float)f->scale;
}

/* Exits 2 if a drive on the same bus answers with the id. */
static void check_id(const scene_setup *s, const scene_follow *f) {
    const palp_can_filter wanted = {.id = f->id, .flags = palp_can_id_flags(f->id)};
    const char *bus = s->file->device[f->device].bus;
    for (uint32_t h = 0; h < s->file->devices; h++) {
        const palp_device *device = &s->device[h].device;
        palp_can_filter of[PALP_DRIVE_FILTERS];
        if (h != f->device && strcmp(s->file->device[h].bus, bus) != 0) continue;
        for (uint32_t i = 0; i < palp_axes(&device->kinematics); i++) {
            const uint32_t n = palp_drive_filters(&device->drives, device->node_id[i], of);
            for (uint32_t k = 0; k < n; k++) {
                if ((wanted.id & of[k].mask) == of[k].id &&
                    wanted.flags == (of[k].flags & PALP_CAN_EXTENDED))
                    die(EXIT_USAGE,
                        "%s: frames 0x%" PRIx32 " come from node %d of device %s: choose another "
                        "id",
                        f->where, f->id, device->node_id[i], s->file->device[h].name);
            }
        }
    }
}

/* Where the simulated controller begins, the joint waits; by default it may cross its range in a second. */
static void open_listen(scene_setup *s, scene_follow *f, palp_scene_drive *d) {
    scene_part *part = &s->part[f->body];
    const palp_joint_entry *e = &part->zones.joint[d->joint];
    const scene_track *track = part->joint[d->joint];
    const double start = track != NULL ? track->key[0].value[0] : 0;
    check_id(s, f);
    if (f->byte + 4u > 8u && !s->device[f->device].device.drives.fd)
        die(EXIT_USAGE,
            "%s: a classic frame has 8 bytes: byte %" PRIu32 " needs a device with fd 1", f->where,
            f->byte);
    part->joint[d->joint] = NULL;
    if (!(f->fastest > 0)) f->fastest = (double)(e->high - e->low);
    if (!(f->fastest > 0 && f->fastest <= 1000))
        die(EXIT_USAGE, "%s: joint '%s': at most %g rad/s or m/s: need more than 0 and up to 1000",
            f->where, f->joint, f->fastest);
    d->by = PALP_DRIVEN_BY_FRAMES;
    d->offset = palp_clamp((float)start, e->low, e->high);
    d->id = f->id;
    d->byte = f->byte;
    d->fastest = (float)f->fastest;
}

static void open_follow(scene_setup *s, uint32_t number) {
    scene_follow *f = &s->file->follow[number];
    const scene_part *part = &s->part[f->body];
    if (part->kind != PALP_BODY_ZONES)
        die(EXIT_USAGE, "%s: %s has no joints", f->where, s->file->body[f->body].name);
    const uint32_t joint = find_joint(f->where, &part->zones, f->joint);
    palp_scene_drive *d = &s->drive[number];
    for (uint32_t o = 0; o < number; o++) {
        if (s->drive[o].body == f->body && s->drive[o].joint == joint)
            die(EXIT_USAGE, "%s: joint '%s' has a 'follow' or 'listen' already", f->where,
                f->joint);
    }
    *d = (palp_scene_drive){.body = f->body, .joint = joint, .hand = f->device};
    if (f->listens)
        open_listen(s, f, d);
    else
        open_axis(s, f, d);
}

/* ---- places ---- */

/* What is nearest so far, in a body's coordinates; without a place the highest. */
typedef struct {
    const double *near_m; /* NULL: the highest */
    double least;
    surface_spot spot;
} spot_search;

static void look_at(spot_search *q, palp_vec3 x, palp_vec3 n, uint32_t node) {
    const double away = q->near_m != NULL ? (double)palp_norm(palp_sub(x, vec(q->near_m)))
                                          : -(double)x.z - 1e-3 * (double)n.z;
    if (away >= q->least) return;
    q->least = away;
    q->spot.at_m = x;
    q->spot.normal = n;
    q->spot.node = node;
}

static surface_spot spot_of_zones(const scene_part *part, const double *near_m) {
    spot_search q = {.near_m = near_m, .least = HUGE_VAL};
    palp_vec3 low = {HUGE_VALF, HUGE_VALF, HUGE_VALF}, high = palp_scale(-1, low);
    for (uint32_t i = 0; i < part->zones.meta->zones; i++) {
        const palp_blob *b = &part->zones.blob[i];
        const palp_frame *at = &part->assembly.world[i];
        for (uint32_t n = 0; n < b->meta->nodes; n++) {
            const palp_vec3 x = palp_carry(at, palp_vec3_at(b->rest_m + 3 * (size_t)n));
            low = (palp_vec3){fminf(low.x, x.x), fminf(low.y, x.y), fminf(low.z, x.z)};
            high = (palp_vec3){fmaxf(high.x, x.x), fmaxf(high.y, x.y), fmaxf(high.z, x.z)};
            if (palp_node_is_fixed(b, n)) continue;
            look_at(&q, x, palp_rotate(at->r, palp_vec3_at(b->normal + 3 * (size_t)n)), n);
        }
    }
    q.spot.size_m = palp_norm(palp_sub(high, low));
    q.spot.edge_m = part->zones.blob[0].meta->mean_edge_m;
    return q.spot;
}

static surface_spot spot_of_tets(const palp_tets *t, const double *near_m) {
    spot_search q = {.near_m = near_m, .least = HUGE_VAL};
    for (uint32_t i = 0; i < t->meta->skin; i++)
        look_at(&q, palp_vec3_at(t->rest_m + 3 * (size_t)t->skin_node[i]),
                palp_vec3_at(t->skin_normal + 3 * (size_t)i), i);
    q.spot.size_m = t->meta->diagonal_m;
    return q.spot;
}

static uint32_t body_of(const scene_file *f, const scene_device *d) {
    uint32_t b = 0;
    while (d->body[0] != '\0' && strcmp(f->body[b].name, d->body) != 0) b++;
    return b;
}

static surface_spot spot_for(const scene_setup *s, const scene_device *d, const palp_device *device,
                             const spot_tool *held) {
    const scene_part *part = &s->part[body_of(s->file, d)];
    const double *near_m = d->where == SCENE_NEAR ? d->place_m : NULL;
    if (part->kind == PALP_BODY_ELASTIC) {
        const palp_blob *b = &part->blob;
        uint32_t node = d->node;
        if (d->where == SCENE_AT_NODE && (node >= b->meta->nodes || palp_node_is_fixed(b, node)))
            die(EXIT_USAGE,
                "%s: node %" PRIu32 " is not a free one of the blob's nodes 0 to %" PRIu32,
                s->file->name, node, b->meta->nodes - 1);
        if (near_m != NULL) node = nearest_free_node(b, near_m);
        if (d->where == SCENE_CHOSEN)
            node = place_body(b, device, UINT32_MAX, held->tool, (double)held->radius_m).node;
        return spot_of_blob(b, node);
    }
    if (d->where == SCENE_AT_NODE)
        die(EXIT_USAGE, "%s: nodes are those of an elastostatic body: say 'place X Y Z'",
            s->file->name);
    return part->kind == PALP_BODY_ZONES ? spot_of_zones(part, near_m)
                                         : spot_of_tets(&part->tets, near_m);
}

#define DOUBT_OFF 0.25f /* of a body's size, beyond which a place was hardly meant */

/* Warnings where a device is hardly where it was meant to be. */
static void doubt_place(const scene_setup *s, uint32_t number, const surface_spot *spot,
                        float radius_m) {
    const scene_device *d = &s->file->device[number];
    const char *scene = s->file->name, *body = s->file->body[body_of(s->file, d)].name;
    const float off = palp_norm(palp_sub(spot->at_m, vec(d->place_m)));
    if (d->where == SCENE_NEAR && off > DOUBT_OFF * spot->size_m)
        warn("%s: the place of device %" PRIu32 " is %.3g m off the nearest point of %s, which is "
             "%.3g m large: is it in the body's coordinates, in metres?",
             scene, number, (double)off, body, (double)spot->size_m);
    if (radius_m > spot->size_m)
        warn("%s: the tool of device %" PRIu32 " is larger (%.3g m) than %s (%.3g m): is it in "
             "metres?",
             scene, number, (double)radius_m, body, (double)spot->size_m);
}

/* Where a device stands, and how large its ball is where nothing was said; both are then stated. */
static void place_device(scene_setup *s, uint32_t number) {
    scene_device *d = &s->file->device[number];
    const palp_device *device = &s->device[number].device;
    scene_mount *first = NULL;
    for (uint32_t t = s->file->tools; t-- > 0;)
        if (s->file->tool[t].device == number) first = &s->file->tool[t];
    if (first == NULL)
        die(EXIT_USAGE, "%s: device %s holds no tool: add a line 'tool ball'", s->file->name,
            d->name);
    if (d->where != SCENE_STATED) {
        const bool ball = palp_tool_is_ball(&first->tool);
        const spot_tool held = {.tool = first->sized && !ball ? &first->tool : NULL,
                                .radius_m = !first->sized ? 0
                                            : ball        ? first->tool.ball[0].radius_m
                                                          : palp_tool_size(&first->tool),
                                .at = scene_frame(&first->at)};
        surface_spot spot = spot_for(s, d, device, &held);
        doubt_place(s, number, &spot, held.radius_m);
        const palp_frame *at = &s->body[body_of(s->file, d)].at;
        spot.at_m = palp_carry(at, spot.at_m);
        spot.normal = palp_rotate(at->r, spot.normal);
        const scene_place turn = {.turn_deg = {d->turn_deg[0], d->turn_deg[1], d->turn_deg[2]}};
        const palp_frame turned = scene_frame(&turn);
        s->touch[number] = place_under(&spot, device, &held, d->turned ? turned.r : NULL, d->scale);
        d->stated = s->touch[number].placement;
        d->where = SCENE_STATED;
        for (uint32_t o = 0; o < number; o++) {
            if (palp_norm(palp_sub(d->stated.origin_m, s->file->device[o].stated.origin_m)) > 0)
                continue;
            warn("%s: devices %" PRIu32 " and %" PRIu32 " are at the same place, one tool in the "
                 "other: give each a 'place'",
                 s->file->name, o, number);
        }
    } else {
        s->touch[number] =
            (touch_frame){.placement = d->stated, .tool_radius_m = palp_tool_size(&first->tool)};
    }
    for (uint32_t t = 0; t < s->file->tools; t++) {
        scene_mount *m = &s->file->tool[t];
        if (m->device != number || m->sized) continue;
        const palp_tool ball = palp_tool_sphere(s->touch[number].tool_radius_m);
        m->tool.ball[0] = ball.ball[0];
        m->sized = true;
    }
}

/* ---- devices and tools ---- */

static void open_device(scene_setup *s, uint32_t number) {
    scene_device *d = &s->file->device[number];
    if (d->text != NULL) {
        s->device[number] = device_read(d->name, d->text);
    } else {
        s->device[number] = device_load(d->name);
        d->text = device_text(d->name);
    }
    s->device[number].device.drives.rate_hz = (float)s->file->rate_hz;
}

static void open_tool(scene_setup *s, uint32_t number) {
    scene_mount *m = &s->file->tool[number];
    if (m->path[0] != '\0') {
        const tool_file t = tool_load(m->path);
        const float friction = m->tool.friction, sliding = m->tool.sliding;
        m->tool = t.tool;
        m->tool.friction = friction;
        m->tool.sliding = sliding;
        s->tool_data[number] = t.data;
        s->tool_bytes[number] = t.bytes;
        s->tool_crc[number] = t.crc;
    }
    const palp_kinematics *k = &s->device[m->device].device.kinematics;
    if (fabs(m->jaw) > 0 && !(palp_gripper_axis(k) < palp_axes(k)))
        die(EXIT_USAGE, "%s: device %s has no gripper for a jaw to be on", s->file->name,
            s->file->device[m->device].name);
}

scene_setup *scene_set_up(scene_file *file) {
    scene_setup *s = allocate(1, sizeof *s);
    s->file = file;
    if (file->bodies == 0) die(EXIT_USAGE, "%s: no body: add a line 'body FILE'", file->name);
    if (file->devices == 0)
        die(EXIT_USAGE, "%s: no device to feel with: add lines 'device NAME' and 'tool ball'",
            file->name);
    if (file->has[SCENE_OBJECT] || file->has[SCENE_PROBE])
        warn("%s: 'cylinder' and 'probe' are of palp play alone and are left aside", file->name);
    for (uint32_t b = 0; b < file->bodies; b++) open_body(s, b);
    for (uint32_t d = 0; d < file->devices; d++) open_device(s, d);
    for (uint32_t t = 0; t < file->tools; t++) open_tool(s, t);
    for (uint32_t f = 0; f < file->follows; f++) open_follow(s, f);
    for (uint32_t d = 0; d < file->devices; d++) {
        place_device(s, d);
        s->hand[d] =
            (palp_hand_config){.device = s->device[d].device, .placement = file->device[d].stated};
    }
    for (uint32_t t = 0; t < file->tools; t++) {
        const scene_mount *m = &file->tool[t];
        s->tool[t] = (palp_scene_tool){
            .tool = m->tool, .hand = m->device, .at = scene_frame(&m->at), .jaw = (float)m->jaw};
    }
    s->config = (palp_scene_config){.body = s->body,
                                    .tool = s->tool,
                                    .hand = s->hand,
                                    .drive = s->drive,
                                    .bodies = file->bodies,
                                    .tools = file->tools,
                                    .hands = file->devices,
                                    .drives = file->follows};
    return s;
}

palp_scene *scene_try_open(const scene_setup *setup, palp_status *status, char *text, size_t room) {
    const palp_scene_config *c = &setup->config;
    const size_t bytes = palp_scene_memsize(c);
    *status = PALP_ERR_ARGUMENT;
    if (bytes == 0) {
        snprintf(text, room, "%s: a level of contact is none", setup->file->name);
        return NULL;
    }
    void *memory = memset(allocate_aligned(bytes, 1), 1, bytes);
    palp_scene *scene;
    float bound_ns = 0;
    *status = palp_scene_open(&scene, c, memory, bytes, &bound_ns);
    if (*status == PALP_OK) return scene;
    free(memory);
    const double have = (double)c->cost.margin * 1e6 / setup->file->rate_hz;
    if (*status == PALP_ERR_BUDGET)
        snprintf(text, room,
                 "the coarsest answer may take %.0f us, %.0f us more than the %.0f us that %.0f Hz "
                 "leave: lower --rate",
                 (double)bound_ns * 1e-3, (double)bound_ns * 1e-3 - have, have,
                 setup->file->rate_hz);
    else
        snprintf(text, room, "cannot open the servo: %s", palp_status_text(*status));
    return NULL;
}

palp_scene *scene_open(const scene_setup *setup) {
    char text[256];
    palp_status status;
    palp_scene *scene = scene_try_open(setup, &status, text, sizeof text);
    if (scene == NULL) die(EXIT_WORK, "%s", text);
    return scene;
}

void scene_tear_down(scene_setup *s, palp_scene *scene) {
    free(scene); /* the first of its memory */
    for (uint32_t b = 0; b < s->config.bodies; b++) {
        free(s->part[b].data);
        free(s->part[b].memory);
    }
    for (uint32_t t = 0; t < s->config.tools; t++) free((void *)(uintptr_t)s->tool_data[t]);
    scene_free(s->file);
    free(s);
}

void scene_move(const scene_setup *setup, palp_scene *scene, double t_s) {
    const palp_frame rest = PALP_FRAME_IDENTITY;
    for (uint32_t b = 0; b < setup->config.bodies; b++) {
        float value[PALP_MAX_JOINTS];
        if (setup->part[b].kind != PALP_BODY_ZONES) continue;
        values_at(&setup->part[b], t_s, value);
        palp_scene_pose(scene, b, value, &rest);
    }
}

const palp_blob *scene_blob(const scene_setup *setup) {
    for (uint32_t b = 0; b < setup->config.bodies; b++) {
        const scene_part *part = &setup->part[b];
        if (part->kind == PALP_BODY_ELASTIC) return &part->blob;
        if (part->kind == PALP_BODY_ZONES) return &part->zones.blob[0];
    }
    return NULL;
}
