/* SPDX-License-Identifier: MIT */
#include "port/host/scenefile.h"
#include "core/blob/format.h"
#include "port/host/args.h"
#include "port/host/util.h"
#include "port/host/vec3.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FAR_M 1e3 /* where a tool touches nothing */
#define RAD_PER_DEGREE 0.017453292519943295

static const option keys[] = {
    {"--seconds", 1},   {"--rate", 1},     {"--stiffness", 1}, {"--gravity", 3}, {"--pose", 3},
    {"--cylinder", 5},  {"--object", 4},   {"--probe", 1},     {"--touch", 4},   {"--body", -2},
    {"--at", -6},       {"--finest", 1},   {"--no-pairs", 0},  {"--young", 1},   {"--poisson", 1},
    {"--damping", 1},   {"--drag", 1},     {"--follow", -5},   {"--device", 1},  {"--bus", 1},
    {"--hand", 1},      {"--place", -4},   {"--node", -2},     {"--turn", 3},    {"--scale", 1},
    {"--placement", 4}, {"--rotation", 9}, {"--tool", -8},     {"--mount", -6},  {"--jaw", 1},
    {"--friction", -2}, {"--listen", -5},  {NULL, 0}};

typedef struct {
    scene_file *s;
    const char *folder; /* NULL: paths as they are */
    enum { IN_SCENE, IN_BODY, IN_DEVICE, IN_TOOL } within;
} reading;

/* ---- making one ---- */

scene_file *scene_empty(const char *name) {
    scene_file *s = allocate(1, sizeof *s);
    *s = (scene_file){.name = name, .seconds = 5, .rate_hz = 1000, .stiffness_N_per_m = 2000};
    return s;
}

static void put_word(const char *where, char word[SCENE_WORD], const char *text) {
    const int n = snprintf(word, SCENE_WORD, "%s", text);
    if (n < 0 || n >= (int)SCENE_WORD)
        die(EXIT_USAGE, "%s: more than %u letters: '%.40s...'", where, SCENE_WORD - 1u, text);
}

/* A path in a scene, from where its file is. */
static void put_path(const reading *r, const char *where, char path[SCENE_WORD], const char *text) {
    char whole[2 * SCENE_WORD];
    const bool relative = r->folder != NULL && text[0] != '/';
    snprintf(whole, sizeof whole, "%s%s", relative ? r->folder : "", text);
    put_word(where, path, whole);
}

scene_body *scene_add_body(scene_file *s, const char *where, const char *path) {
    if (s->bodies == PALP_SCENE_BODIES)
        die(EXIT_USAGE, "%s: more than %u bodies", where, PALP_SCENE_BODIES);
    scene_body *b = &s->body[s->bodies++];
    *b = (scene_body){.finest = PALP_CONTACT_FINEST,
                      .young_Pa = -1,
                      .poisson = -1,
                      .damping_s = -1,
                      .drag_per_s = -1};
    put_word(where, b->path, path);
    const char *file = strrchr(path, '/');
    put_word(where, b->name, file != NULL ? file + 1 : path);
    char *ending = strrchr(b->name, '.');
    if (ending != NULL) *ending = '\0';
    return b;
}

scene_device *scene_add_device(scene_file *s, const char *where, const char *name) {
    if (s->devices == PALP_SCENE_HANDS)
        die(EXIT_USAGE, "%s: more than %u devices", where, PALP_SCENE_HANDS);
    scene_device *d = &s->device[s->devices++];
    *d = (scene_device){.where = SCENE_CHOSEN};
    put_word(where, d->name, name);
    return d;
}

scene_mount *scene_add_tool(scene_file *s, const char *where) {
    if (s->tools == PALP_CONTACT_TOOLS)
        die(EXIT_USAGE, "%s: more than %u tools", where, PALP_CONTACT_TOOLS);
    if (s->devices == 0) die(EXIT_USAGE, "%s: a tool follows the device that holds it", where);
    scene_mount *t = &s->tool[s->tools++];
    *t = (scene_mount){.tool = palp_tool_sphere(1.0f), .device = s->devices - 1};
    return t;
}

/* ---- reading ---- */

static void add_key(scene_track *track, const argument *a, int first_value) {
    scene_key k = {.t_s = arg_double(a, 0)};
    for (int i = first_value; i < a->count; i++) k.value[i - first_value] = arg_double(a, i);
    if (track->count > 0 && !(k.t_s > track->key[track->count - 1].t_s))
        die(EXIT_USAGE, "%s: time %s is not behind the one before", a->where, a->value[0]);
    track->key = grow(track->key, &track->room, track->count + 1, sizeof k);
    track->key[track->count++] = k;
}

static double positive(const argument *a, int index) {
    double v = arg_double(a, index);
    if (!(v > 0)) die(EXIT_USAGE, "%s: %s must be above 0", a->where, a->value[index]);
    return v;
}

static void take_vector(const argument *a, int first, double v[3]) {
    for (int k = 0; k < 3; k++) v[k] = arg_double(a, first + k);
}

/* Three numbers, or six with a turn. */
static scene_place take_place(const argument *a) {
    scene_place p = {.place_m = {0}};
    if (a->count != 3 && a->count != 6)
        die(EXIT_USAGE, "%s: need X Y Z, or X Y Z RX RY RZ with a turn in degrees", a->where);
    take_vector(a, 0, p.place_m);
    if (a->count == 6) take_vector(a, 3, p.turn_deg);
    if (!(v_norm(p.place_m) <= FAR_M) || !(v_norm(p.turn_deg) <= 1e3))
        die(EXIT_USAGE, "%s: more than %g m or 1000 degrees", a->where, FAR_M);
    return p;
}

/* The body that keys are about: that of the command line, where none has been named. */
static scene_body *current_body(const reading *r, const argument *a) {
    scene_file *s = r->s;
    if (s->bodies == 0) (void)scene_add_body(s, a->where, "");
    return &s->body[s->bodies - 1];
}

static scene_device *current_device(const reading *r, const argument *a) {
    if (r->s->devices == 0) die(EXIT_USAGE, "%s: needs a 'device' line before it", a->where);
    return &r->s->device[r->s->devices - 1];
}

static scene_mount *current_tool(const reading *r, const argument *a) {
    if (r->within != IN_TOOL) die(EXIT_USAGE, "%s: needs a 'tool' line before it", a->where);
    return &r->s->tool[r->s->tools - 1];
}

static scene_track *motion_of(scene_body *b, const argument *a) {
    for (size_t i = 0; i < b->motions; i++) {
        if (strcmp(b->motion[i].joint, a->value[1]) == 0) return &b->motion[i].track;
    }
    b->motion = grow(b->motion, &b->room, b->motions + 1, sizeof *b->motion);
    scene_motion *m = &b->motion[b->motions++];
    *m = (scene_motion){.track = {0}};
    put_word(a->where, m->joint, a->value[1]);
    put_word(a->where, m->where, a->where);
    return &m->track;
}

static scene_follow *add_follow(const reading *r, const argument *a) {
    scene_file *s = r->s;
    if (s->follows == PALP_SCENE_DRIVES)
        die(EXIT_USAGE, "%s: more than %u joints follow axes or frames", a->where,
            PALP_SCENE_DRIVES);
    (void)current_body(r, a);
    scene_follow *f = &s->follow[s->follows++];
    *f = (scene_follow){.body = s->bodies - 1, .device = arg_u32(a, 1, 0, PALP_SCENE_HANDS - 1)};
    put_word(a->where, f->joint, a->value[0]);
    put_word(a->where, f->where, a->where);
    return f;
}

static void take_follow(const reading *r, const argument *a) {
    if (a->count < 4) die(EXIT_USAGE, "%s: need JOINT DEVICE AXIS SCALE [OFFSET]", a->where);
    scene_follow *f = add_follow(r, a);
    f->axis = arg_u32(a, 2, 0, PALP_AXES - 1);
    f->scale = arg_double(a, 3);
    f->offset = a->count > 4 ? arg_double(a, 4) : 0;
}

/* Decimal, or hexadecimal behind 0x. */
static uint32_t take_id(const argument *a, int index) {
    const char *text = a->value[index];
    char *end;
    const bool hex = text[0] == '0' && (text[1] == 'x' || text[1] == 'X');
    const unsigned long id = strtoul(text, &end, hex ? 16 : 10);
    if (text[0] < '0' || text[0] > '9' || *end != '\0' || id > 0x1fffffffu)
        die(EXIT_USAGE, "%s: '%s' is no id of a frame: 0x0 to 0x1fffffff", a->where, text);
    return (uint32_t)id;
}

static void take_listen(const reading *r, const argument *a) {
    if (a->count < 3) die(EXIT_USAGE, "%s: need JOINT DEVICE ID [BYTE [FASTEST]]", a->where);
    scene_follow *f = add_follow(r, a);
    f->listens = true;
    f->id = take_id(a, 2);
    f->byte = a->count > 3 ? arg_u32(a, 3, 0, PALP_CAN_MAX_DATA - 4u) : 0;
    f->fastest = a->count > 4 ? positive(a, 4) : 0;
}

/* Of a body: true if the key is one of those. */
static bool take_body_key(reading *r, const argument *a) {
    const char *o = a->option + 2;
    if (strcmp(o, "body") == 0) {
        char path[SCENE_WORD];
        put_path(r, a->where, path, a->value[0]);
        scene_body *b = scene_add_body(r->s, a->where, path);
        if (a->count > 1) put_word(a->where, b->name, a->value[1]);
        for (uint32_t i = 0; i + 1 < r->s->bodies; i++) {
            if (strcmp(r->s->body[i].name, b->name) == 0)
                die(EXIT_USAGE, "%s: another body is called '%s': name this one, 'body FILE NAME'",
                    a->where, b->name);
        }
        r->within = IN_BODY;
    } else if (strcmp(o, "at") == 0) {
        current_body(r, a)->at = take_place(a);
    } else if (strcmp(o, "finest") == 0) {
        current_body(r, a)->finest = arg_u32(a, 0, 0, PALP_CONTACT_LEVELS - 1u);
    } else if (strcmp(o, "no-pairs") == 0) {
        current_body(r, a)->alone = true;
    } else if (strcmp(o, "young") == 0) {
        current_body(r, a)->young_Pa = arg_between(a, 0, 1e12);
    } else if (strcmp(o, "poisson") == 0) {
        current_body(r, a)->poisson = arg_between(a, -0.9999, 0.4999);
    } else if (strcmp(o, "damping") == 0) {
        current_body(r, a)->damping_s = arg_upto(a, 100);
    } else if (strcmp(o, "drag") == 0) {
        current_body(r, a)->drag_per_s = arg_upto(a, 1000);
    } else if (strcmp(o, "gravity") == 0) {
        double *g = current_body(r, a)->gravity_m_s2;
        take_vector(a, 0, g);
        if (!(v_norm(g) <= 1e4)) die(EXIT_USAGE, "%s: more than 10000 m/s^2", a->where);
    } else if (strcmp(o, "pose") == 0) {
        (void)arg_double(a, 2);
        add_key(motion_of(current_body(r, a), a), a, 2);
    } else if (strcmp(o, "follow") == 0) {
        take_follow(r, a);
    } else if (strcmp(o, "listen") == 0) {
        take_listen(r, a);
    } else {
        return false;
    }
    return true;
}

static void stand_at(scene_device *d, const argument *a, scene_where where) {
    if (d->where != SCENE_CHOSEN && d->where != where)
        die(EXIT_USAGE, "%s: where the device is has been said by another key", a->where);
    d->where = where;
}

static bool take_device_key(reading *r, const argument *a) {
    const char *o = a->option + 2;
    if (strcmp(o, "device") == 0) {
        char path[SCENE_WORD];
        const bool is_file = strchr(a->value[0], '.') != NULL || strchr(a->value[0], '/') != NULL;
        put_word(a->where, path, a->value[0]);
        if (is_file) put_path(r, a->where, path, a->value[0]);
        (void)scene_add_device(r->s, a->where, path);
        r->within = IN_DEVICE;
    } else if (strcmp(o, "bus") == 0) {
        scene_device *d = current_device(r, a);
        if (strlen(a->value[0]) >= sizeof d->bus)
            die(EXIT_USAGE, "%s: '%s' is no name of a bus", a->where, a->value[0]);
        snprintf(d->bus, sizeof d->bus, "%s", a->value[0]);
    } else if (strcmp(o, "hand") == 0) {
        scene_device *d = current_device(r, a);
        put_word(a->where, d->hand, a->value[0]);
        if (strcmp(a->value[0], "touch") != 0) put_path(r, a->where, d->hand, a->value[0]);
    } else if (strcmp(o, "place") == 0) {
        scene_device *d = current_device(r, a);
        if (a->count < 3) die(EXIT_USAGE, "%s: need X Y Z [BODY]", a->where);
        stand_at(d, a, SCENE_NEAR);
        take_vector(a, 0, d->place_m);
        if (a->count > 3) put_word(a->where, d->body, a->value[3]);
    } else if (strcmp(o, "node") == 0) {
        scene_device *d = current_device(r, a);
        stand_at(d, a, SCENE_AT_NODE);
        d->node = arg_u32(a, 0, 0, UINT32_MAX - 1);
        if (a->count > 1) put_word(a->where, d->body, a->value[1]);
    } else if (strcmp(o, "turn") == 0) {
        take_vector(a, 0, current_device(r, a)->turn_deg);
        current_device(r, a)->turned = true;
    } else if (strcmp(o, "scale") == 0) {
        current_device(r, a)->scale = arg_between(a, 1e-6, 1e6);
    } else if (strcmp(o, "placement") == 0) {
        scene_device *d = current_device(r, a);
        stand_at(d, a, SCENE_STATED);
        d->stated.origin_m =
            (palp_vec3){(float)arg_double(a, 0), (float)arg_double(a, 1), (float)arg_double(a, 2)};
        d->stated.scale = (float)positive(a, 3);
    } else if (strcmp(o, "rotation") == 0) {
        scene_device *d = current_device(r, a);
        for (int e = 0; e < 9; e++) d->stated.rotation[e] = (float)arg_double(a, e);
        if (d->where != SCENE_STATED || !palp_is_rotation(d->stated.rotation))
            die(EXIT_USAGE, "%s: need a rotation, row by row, after 'placement'", a->where);
    } else {
        return false;
    }
    return true;
}

/* Its numbers, each above 0. */
static void need_sizes(const argument *a, int count, const char *names) {
    if (a->count != count + 1) die(EXIT_USAGE, "%s: %s needs %s", a->where, a->value[0], names);
    for (int k = 1; k <= count; k++) (void)positive(a, k);
}

/* Along the tip's z, from which the device reaches down. */
static palp_tool tool_of(const argument *a) {
    const palp_vec3 up = {0, 0, 1};
    const char *kind = a->value[0];
    float v[MAX_OPTION_VALUES] = {0};
    for (int k = 1; k < a->count; k++) v[k] = (float)arg_double(a, k);
    palp_tool t = palp_tool_sphere(1.0f);
    if (strcmp(kind, "ball") == 0) {
        need_sizes(a, 1, "its radius");
        t = palp_tool_sphere(v[1]);
    } else if (strcmp(kind, "capsule") == 0) {
        need_sizes(a, 2, "a radius and half of its length");
        t = palp_tool_capsule(up, v[2], v[1]);
    } else if (strcmp(kind, "cylinder") == 0) {
        need_sizes(a, 2, "a radius and half of its length");
        t.shape = PALP_TOOL_CYLINDER;
        t.cylinder =
            (palp_cylinder){.axis = up, .radius_m = v[1], .half_m = v[2], .rim_m = 0.25f * v[1]};
    } else if (strcmp(kind, "pad") == 0) {
        need_sizes(a, 3, "half of its two sides and the radius of its edges");
        t.shape = PALP_TOOL_PAD;
        t.pad = (palp_pad){
            .axis = {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}, .half_m = {v[1], v[2]}, .edge_m = v[3]};
    } else {
        die(EXIT_USAGE,
            "%s: no tool '%s': ball R, capsule R HALF, cylinder R HALF, pad HX HY EDGE, "
            "or a file.tool of palp tool",
            a->where, kind);
    }
    if (!palp_tool_is_sound(&t)) die(EXIT_USAGE, "%s: not a sound tool", a->where);
    return t;
}

static void take_friction(const reading *r, const argument *a) {
    const double mu = arg_upto(a, 10);
    double sliding = 0;
    if (a->count > 1) {
        sliding = arg_double(a, 1);
        if (!(sliding > 0 && sliding <= mu))
            die(EXIT_USAGE, "%s: sliding friction %g: need more than 0 and at most the static %g",
                a->where, sliding, mu);
    }
    palp_tool *t = &current_tool(r, a)->tool;
    t->friction = (float)mu;
    t->sliding = (float)sliding;
}

static bool take_tool_key(reading *r, const argument *a) {
    const char *o = a->option + 2;
    if (strcmp(o, "tool") == 0) {
        scene_mount *t = scene_add_tool(r->s, a->where);
        if (has_extension(a->value[0], ".tool"))
            put_path(r, a->where, t->path, a->value[0]);
        else if (strcmp(a->value[0], "ball") != 0 || a->count > 1)
            t->tool = tool_of(a);
        t->sized = t->path[0] != '\0' || a->count > 1;
        r->within = IN_TOOL;
    } else if (strcmp(o, "mount") == 0) {
        current_tool(r, a)->at = take_place(a);
    } else if (strcmp(o, "jaw") == 0) {
        current_tool(r, a)->jaw = arg_between(a, -1.0001, 1.0001);
    } else if (strcmp(o, "friction") == 0) {
        take_friction(r, a);
    } else {
        return false;
    }
    return true;
}

/* Of palp play, which has no devices. */
static void take_play_key(scene_file *s, const argument *a) {
    const char *o = a->option + 2;
    if (strcmp(o, "stiffness") == 0) {
        s->stiffness_N_per_m = positive(a, 0);
    } else if (strcmp(o, "cylinder") == 0) {
        for (int k = 0; k < 5; k++) s->cylinder[k] = k < 2 ? positive(a, k) : arg_double(a, k);
        if (!(v_norm(s->cylinder + 2) > 0)) die(EXIT_USAGE, "%s: the axis is zero", a->where);
        v_normalize(s->cylinder + 2);
        s->has[SCENE_OBJECT] = true;
    } else if (strcmp(o, "object") == 0) {
        add_key(&s->track[SCENE_OBJECT], a, 1);
    } else if (strcmp(o, "probe") == 0) {
        s->probe_radius_m = positive(a, 0);
        s->has[SCENE_PROBE] = true;
    } else {
        add_key(&s->track[SCENE_PROBE], a, 1);
    }
}

static void take_key(void *context, const argument *a) {
    reading *r = context;
    const char *o = a->option + 2;
    if (strcmp(o, "seconds") == 0)
        r->s->seconds = arg_between(a, 0, 3600);
    else if (strcmp(o, "rate") == 0)
        r->s->rate_hz = arg_between(a, 49, 20001);
    else if (!take_body_key(r, a) && !take_device_key(r, a) && !take_tool_key(r, a))
        take_play_key(r->s, a);
}

static uint32_t body_called(const scene_file *s, const char *name) {
    for (uint32_t b = 0; b < s->bodies; b++) {
        if (strcmp(s->body[b].name, name) == 0) return b;
    }
    return UINT32_MAX;
}

static void check(const scene_file *s) {
    static const char *const shape[] = {"object", "touch"}, *const needed[] = {"cylinder", "probe"};
    for (int k = 0; k < SCENE_TRACKS; k++) {
        bool moves = s->track[k].count > 0;
        if (moves && !s->has[k])
            die(EXIT_USAGE, "%s: '%s' lines need a '%s' line", s->name, shape[k], needed[k]);
        if (!moves && s->has[k])
            die(EXIT_USAGE, "%s: '%s' needs '%s' lines that say where it is", s->name, needed[k],
                shape[k]);
    }
    for (uint32_t d = 0; d < s->devices; d++) {
        if (s->device[d].body[0] != '\0' && body_called(s, s->device[d].body) == UINT32_MAX)
            die(EXIT_USAGE, "%s: device %s: no body is called '%s'", s->name, s->device[d].name,
                s->device[d].body);
    }
    for (uint32_t f = 0; f < s->follows; f++) {
        if (s->follow[f].device >= s->devices)
            die(EXIT_USAGE, "%s: there are %" PRIu32 " devices, counted from 0", s->follow[f].where,
                s->devices);
    }
}

scene_file *scene_read_text(const char *name, const char *folder, const char *text) {
    reading r = {.s = scene_empty(name), .folder = folder};
    args_parse_text(name, text, keys, take_key, &r);
    check(r.s);
    return r.s;
}

scene_file *scene_read(const char *path) {
    char folder[SCENE_WORD] = "";
    size_t bytes;
    char *text = read_file(path, &bytes);
    const char *slash = strrchr(path, '/');
    if (slash != NULL) snprintf(folder, sizeof folder, "%.*s", (int)(slash + 1 - path), path);
    scene_file *s = scene_read_text(path, folder, text);
    free(text);
    return s;
}

void scene_free(scene_file *s) {
    for (uint32_t b = 0; b < s->bodies; b++) {
        for (size_t i = 0; i < s->body[b].motions; i++) free(s->body[b].motion[i].track.key);
        free(s->body[b].motion);
    }
    for (uint32_t d = 0; d < s->devices; d++) free(s->device[d].text);
    for (size_t k = 0; k < SCENE_TRACKS; k++) free(s->track[k].key);
    free(s);
}

const scene_track *scene_joint_track(const scene_body *b, const char *joint) {
    for (size_t i = 0; i < b->motions; i++) {
        if (strcmp(b->motion[i].joint, joint) == 0) return &b->motion[i].track;
    }
    return NULL;
}

bool scene_is_here(const char *path) { return has_extension(path, ".scene"); }

/* ---- writing ---- */

/* A name that is one word: of a file without its folder; blanks and '#' would end it. */
static void write_name(FILE *f, const char *path) {
    const char *file = strrchr(path, '/');
    for (const char *c = file != NULL ? file + 1 : path; *c != '\0'; c++)
        fputc(*c > ' ' && *c != '#' ? *c : '_', f);
}

static void write_place(FILE *f, const char *key, const scene_place *p) {
    fprintf(f, "%s %.17g %.17g %.17g %.17g %.17g %.17g\n", key, p->place_m[0], p->place_m[1],
            p->place_m[2], p->turn_deg[0], p->turn_deg[1], p->turn_deg[2]);
}

static void write_body(FILE *f, const scene_file *s, uint32_t number) {
    const scene_body *b = &s->body[number];
    fputs("body ", f);
    write_name(f, b->path);
    fputc(' ', f);
    write_name(f, b->name);
    fputc('\n', f);
    write_place(f, "at", &b->at);
    fprintf(f, "finest %" PRIu32 "\n%s", b->finest, b->alone ? "no-pairs\n" : "");
    fprintf(f, "gravity %.17g %.17g %.17g\n", b->gravity_m_s2[0], b->gravity_m_s2[1],
            b->gravity_m_s2[2]);
    if (b->young_Pa >= 0) fprintf(f, "young %.17g\n", b->young_Pa);
    if (b->poisson > -1) fprintf(f, "poisson %.17g\n", b->poisson);
    if (b->damping_s >= 0) fprintf(f, "damping %.17g\n", b->damping_s);
    if (b->drag_per_s >= 0) fprintf(f, "drag %.17g\n", b->drag_per_s);
    for (size_t i = 0; i < b->motions; i++) {
        const scene_motion *m = &b->motion[i];
        for (size_t k = 0; k < m->track.count; k++)
            fprintf(f, "pose %.17g %s %.17g\n", m->track.key[k].t_s, m->joint,
                    m->track.key[k].value[0]);
    }
    for (uint32_t i = 0; i < s->follows; i++) {
        const scene_follow *w = &s->follow[i];
        if (w->body != number) continue;
        if (w->listens)
            fprintf(f, "listen %s %" PRIu32 " 0x%" PRIx32 " %" PRIu32 " %.17g\n", w->joint,
                    w->device, w->id, w->byte, w->fastest);
        else
            fprintf(f, "follow %s %" PRIu32 " %" PRIu32 " %.17g %.17g\n", w->joint, w->device,
                    w->axis, w->scale, w->offset);
    }
}

static void write_shape(FILE *f, const scene_mount *m) {
    const palp_tool *t = &m->tool;
    if (m->path[0] != '\0') {
        fputs("tool ", f);
        write_name(f, m->path);
        fputs(has_extension(m->path, ".tool") ? "\n" : ".tool\n", f);
        return;
    }
    switch (t->shape) {
    case PALP_TOOL_CYLINDER:
        fprintf(f, "tool %s %.9g %.9g\n",
                t->cylinder.rim_m < t->cylinder.radius_m ? "cylinder" : "capsule",
                (double)t->cylinder.radius_m, (double)t->cylinder.half_m);
        return;
    case PALP_TOOL_PAD:
        fprintf(f, "tool pad %.9g %.9g %.9g\n", (double)t->pad.half_m[0], (double)t->pad.half_m[1],
                (double)t->pad.edge_m);
        return;
    default:
        fprintf(f, "tool ball %.9g\n", (double)t->ball[0].radius_m);
    }
}

static void write_device(FILE *f, const scene_file *s, uint32_t number) {
    const scene_device *d = &s->device[number];
    const palp_placement *p = &d->stated;
    fputs("device ", f);
    write_name(f, d->name);
    fprintf(f, "\nbus %s\nplacement %.9g %.9g %.9g %.9g\nrotation", d->bus, (double)p->origin_m.x,
            (double)p->origin_m.y, (double)p->origin_m.z, (double)p->scale);
    for (int e = 0; e < 9; e++) fprintf(f, " %.9g", (double)p->rotation[e]);
    fputc('\n', f);
    for (uint32_t t = 0; t < s->tools; t++) {
        const scene_mount *m = &s->tool[t];
        if (m->device != number) continue;
        write_shape(f, m);
        write_place(f, "mount", &m->at);
        fprintf(f, "jaw %.17g\nfriction %.9g", m->jaw, (double)m->tool.friction);
        if (m->tool.sliding > 0) fprintf(f, " %.9g", (double)m->tool.sliding);
        fputc('\n', f);
    }
}

void scene_write(FILE *f, const scene_file *s) {
    fprintf(f, "rate %.9g\n", s->rate_hz);
    for (uint32_t b = 0; b < s->bodies; b++) write_body(f, s, b);
    for (uint32_t d = 0; d < s->devices; d++) write_device(f, s, d);
}

/* ---- places in time ---- */

palp_frame scene_frame(const scene_place *p) {
    const palp_vec3 turn = {(float)(RAD_PER_DEGREE * p->turn_deg[0]),
                            (float)(RAD_PER_DEGREE * p->turn_deg[1]),
                            (float)(RAD_PER_DEGREE * p->turn_deg[2])};
    palp_frame f = palp_frame_at(
        (palp_vec3){(float)p->place_m[0], (float)p->place_m[1], (float)p->place_m[2]});
    const palp_frame straight = PALP_FRAME_IDENTITY;
    palp_turn_by(turn, straight.r, f.r);
    return f;
}

void scene_at(const scene_track *track, double t_s, double value[3]) {
    memset(value, 0, 3 * sizeof *value);
    if (track->count == 0) return;
    size_t i = 0;
    while (i + 1 < track->count && track->key[i + 1].t_s <= t_s) i++;
    const scene_key *a = &track->key[i], *b = i + 1 < track->count ? a + 1 : a;
    double s = b->t_s > a->t_s ? (t_s - a->t_s) / (b->t_s - a->t_s) : 0;
    s = s < 0 ? 0 : s > 1 ? 1 : s;
    s = s * s * s * (10 - s * (15 - 6 * s));
    for (int k = 0; k < 3; k++) value[k] = a->value[k] + s * (b->value[k] - a->value[k]);
}

void scene_tools(const scene_file *s, palp_tool tool[SCENE_TRACKS], uint32_t which[SCENE_TRACKS],
                 uint32_t *count) {
    *count = 0;
    if (s->has[SCENE_OBJECT]) {
        const double *c = s->cylinder;
        which[*count] = SCENE_OBJECT;
        tool[(*count)++] = (palp_tool){.shape = PALP_TOOL_CYLINDER,
                                       .cylinder = {.axis = {(float)c[2], (float)c[3], (float)c[4]},
                                                    .radius_m = (float)c[0],
                                                    .half_m = (float)c[1],
                                                    .rim_m = 0.25f * (float)c[0]}};
    }
    if (s->has[SCENE_PROBE]) {
        which[*count] = SCENE_PROBE;
        tool[(*count)++] = palp_tool_sphere((float)s->probe_radius_m);
    }
    if (*count > 0) return;
    which[0] = SCENE_TRACKS;
    tool[(*count)++] = palp_tool_sphere(1e-3f);
}

void scene_tools_at(const scene_file *s, const uint32_t *which, uint32_t count, double t_s,
                    palp_frame *at) {
    for (uint32_t t = 0; t < count; t++) {
        double x[3] = {FAR_M, FAR_M, FAR_M};
        if (which[t] < SCENE_TRACKS) scene_at(&s->track[which[t]], t_s, x);
        at[t] = palp_frame_at((palp_vec3){(float)x[0], (float)x[1], (float)x[2]});
    }
}
