/* SPDX-License-Identifier: MIT */
#include "core/servo/scene.h"
#include "core/base/arena.h"

#define NS_PER_S 1e9f
#define NEAR_M 1e-5f
#define OUT_TICKS                                                                                  \
    64u /* more than a contact takes to be found, and its lattice to fit (PALP_CONTACT_FULL) */

struct palp_scene {
    palp_body body[PALP_SCENE_BODIES];
    palp_hand *hand;        /* [hands] */
    palp_tool *tool;        /* [tools] */
    palp_scene_tool *mount; /* [tools] */
    palp_hand_spring spring[PALP_CONTACT_TOOLS];
    palp_body_felt felt[PALP_SCENE_BODIES][PALP_CONTACT_TOOLS];
    palp_hand_report hand_report[PALP_SCENE_HANDS];
    palp_body_report body_report[PALP_SCENE_BODIES];
    palp_scene_drive drive[PALP_SCENE_DRIVES];
    palp_setpoint setpoint[PALP_SCENE_DRIVES];
    float value[PALP_SCENE_BODIES][PALP_MAX_JOINTS]; /* of multizone models */
    palp_frame root[PALP_SCENE_BODIES];
    float part[PALP_SCENE_HANDS];        /* of the springs of its tools */
    bool leaving[PALP_SCENE_HANDS];      /* fades, tools where they were */
    bool left;                           /* the scene is being left: fades, tools as they move */
    palp_vec3 off_m[PALP_CONTACT_TOOLS]; /* after an exchange: from where they are held, */
    palp_vec3 out[PALP_CONTACT_TOOLS];   /* this way, */
    uint32_t within[PALP_CONTACT_TOOLS]; /* ticks for which it has to be free until it is out */
    palp_frame last[PALP_CONTACT_TOOLS];
    palp_vec3 pushed_N[PALP_SCENE_HANDS]; /* by what was touched last */
    uint32_t touched[PALP_SCENE_HANDS];   /* bodies, bit by bit */
    /* of the tick under way */
    palp_hand_place tip[PALP_SCENE_HANDS];
    palp_body_tool held[PALP_CONTACT_TOOLS];
    palp_hand_felt sum[PALP_SCENE_HANDS];
    uint32_t bodies, tools, hands, drives;
    palp_port port;
    float dt_s, bound_ns;
    uint64_t ticks;
};

PALP_STATIC_ASSERT(sizeof(palp_scene) <= PALP_SCENE_OBJECT, "PALP_SCENE_OBJECT");

/* ---- opening ---- */

static bool counts_are_sound(const palp_scene_config *c) {
    return c->bodies >= 1u && c->bodies <= PALP_SCENE_BODIES && c->tools >= 1u &&
           c->tools <= PALP_CONTACT_TOOLS && c->hands >= 1u && c->hands <= PALP_SCENE_HANDS &&
           c->drives <= PALP_SCENE_DRIVES;
}

static palp_scene *lay_out(palp_arena *arena, const palp_scene_config *c,
                           void *body[PALP_SCENE_BODIES], size_t bytes[PALP_SCENE_BODIES]) {
    palp_scene *s = palp_take(arena, 1, sizeof *s);
    palp_hand *hand = palp_take(arena, c->hands, sizeof *hand);
    palp_tool *tool = palp_take(arena, c->tools, sizeof *tool);
    palp_scene_tool *mount = palp_take(arena, c->tools, sizeof *mount);
    for (uint32_t b = 0; b < c->bodies; b++) {
        bytes[b] = palp_body_memsize(&c->body[b], c->tools);
        if (bytes[b] == 0u) arena->used = SIZE_MAX;
        body[b] = palp_take(arena, bytes[b], 1);
    }
    if (s == NULL) return NULL;
    *s = (palp_scene){.hand = hand, .tool = tool, .mount = mount};
    return s;
}

size_t palp_scene_memsize(const palp_scene_config *config) {
    palp_arena arena = {0};
    void *body[PALP_SCENE_BODIES];
    size_t bytes[PALP_SCENE_BODIES];
    if (!counts_are_sound(config)) return 0;
    (void)lay_out(&arena, config, body, bytes);
    return arena.used == SIZE_MAX ? 0 : arena.used;
}

static bool drive_is_sound(const palp_scene_config *c, const palp_scene_drive *d) {
    if (d->body >= c->bodies || d->hand >= c->hands || !palp_scene_drive_is_sound(d) ||
        c->body[d->body].kind != PALP_BODY_ZONES)
        return false;
    return d->joint < c->body[d->body].assembly->zones->meta->joints &&
           (d->by != PALP_DRIVEN_BY_AXIS ||
            d->axis < palp_axes(&c->hand[d->hand].device.kinematics));
}

static palp_status check(const palp_scene_config *c) {
    if (!counts_are_sound(c) || !palp_cost_table_is_sound(&c->cost) || c->port.now_ns == NULL)
        return PALP_ERR_ARGUMENT;
    for (uint32_t b = 0; b < c->bodies; b++) {
        const palp_body_config *body = &c->body[b];
        if (body->kind == PALP_BODY_ELASTIC && body->blob->regular.modes == 0u)
            return PALP_ERR_ABSENT;
        if (body->finest >= PALP_CONTACT_LEVELS) return PALP_ERR_LIMITS;
    }
    bool sound = true;
    for (uint32_t h = 0; h < c->hands; h++)
        sound = sound && palp_hand_config_is_sound(&c->hand[h]) &&
                palp_same_bits(c->hand[h].device.drives.rate_hz, c->hand[0].device.drives.rate_hz);
    for (uint32_t t = 0; t < c->tools; t++)
        sound = sound && palp_tool_is_sound(&c->tool[t].tool) && c->tool[t].hand < c->hands &&
                palp_is_rotation(c->tool[t].at.r) && palp_vec3_is_finite(c->tool[t].at.t) &&
                palp_abs(c->tool[t].jaw) <= 1.0f;
    for (uint32_t d = 0; d < c->drives && sound; d++) sound = drive_is_sound(c, &c->drive[d]);
    return sound ? PALP_OK : PALP_ERR_ARGUMENT;
}

static uint32_t tools_of(const palp_scene_config *c, uint32_t hand) {
    uint32_t count = 0;
    for (uint32_t t = 0; t < c->tools; t++) count += c->tool[t].hand == hand ? 1u : 0u;
    return count;
}

/* Hands, tools, and the springs between them: those of one device share what it renders. */
static void set_up(palp_scene *s, const palp_scene_config *c) {
    s->bodies = c->bodies;
    s->tools = c->tools;
    s->hands = c->hands;
    s->drives = c->drives;
    s->port = c->port;
    s->dt_s = 1.0f / c->hand[0].device.drives.rate_hz;
    for (uint32_t h = 0; h < c->hands; h++) palp_hand_init(&s->hand[h], &c->hand[h]);
    for (uint32_t d = 0; d < c->drives; d++) {
        s->drive[d] = c->drive[d];
        palp_setpoint_init(&s->setpoint[d], &s->drive[d]);
    }
    for (uint32_t b = 0; b < c->bodies; b++) s->root[b] = PALP_FRAME_IDENTITY;
    for (uint32_t t = 0; t < c->tools; t++) {
        const uint32_t hand = c->tool[t].hand;
        const float share = 1.0f / (float)(tools_of(c, hand) * c->bodies);
        const palp_hand_spring k = palp_hand_spring_of(&c->hand[hand]);
        s->mount[t] = c->tool[t];
        s->tool[t] = c->tool[t].tool;
        s->spring[t] = (palp_hand_spring){share * k.N_per_m, share * k.Ns_per_m,
                                          share * k.Nm_per_rad, share * k.Nms_per_rad};
    }
}

/* Opens all bodies with what comes before and after each: at first as if each were alone, to know
 * what it takes at least. */
static palp_status open_bodies(palp_scene *s, const palp_scene_config *c,
                               void *memory[PALP_SCENE_BODIES],
                               const size_t bytes[PALP_SCENE_BODIES], float *bound_ns) {
    const palp_prices ns = palp_prices_of(&c->cost);
    float first_ns = palp_scene_drives_cost(&ns, c->drives);
    for (uint32_t h = 0; h < c->hands; h++)
        first_ns += palp_servo_cost_before(&ns, &c->hand[h].device);
    float last_ns = 0.0f;
    for (uint32_t h = 0; h < c->hands; h++)
        last_ns += palp_servo_cost_after(&ns, &c->hand[h].device);
    float least_ns[PALP_SCENE_BODIES] = {0.0f}, all_ns = 0.0f;
    s->bound_ns = first_ns + last_ns;
    for (uint32_t pass = 0; pass < 2u; pass++) {
        float earlier_ns = 0.0f;
        for (uint32_t b = 0; b < c->bodies; b++) {
            const float later_ns = palp_max(all_ns - earlier_ns - least_ns[b], 0.0f);
            const palp_body_room room = {.tools = s->tool,
                                         .tool_count = c->tools,
                                         .spring = s->spring,
                                         .cost = c->cost,
                                         .port = c->port,
                                         .dt_s = s->dt_s,
                                         .before_ns = first_ns + earlier_ns,
                                         .after_ns = last_ns + (pass == 0u ? 0.0f : later_ns)};
            const palp_status status =
                palp_body_init(&s->body[b], &c->body[b], &room, memory[b], bytes[b], bound_ns);
            if (status != PALP_OK) return status;
            if (pass == 1u) {
                earlier_ns += least_ns[b];
                s->bound_ns += s->body[b].most_ns;
                continue;
            }
            least_ns[b] = s->body[b].least_ns;
            all_ns += least_ns[b];
        }
    }
    s->bound_ns = palp_min(s->bound_ns, c->cost.margin * NS_PER_S * s->dt_s);
    return PALP_OK;
}

palp_status palp_scene_open(palp_scene **scene, const palp_scene_config *config, void *memory,
                            size_t bytes, float *bound_ns) {
    palp_arena arena = {.base = memory};
    void *body[PALP_SCENE_BODIES];
    size_t part[PALP_SCENE_BODIES];
    palp_status status = check(config);
    if (status != PALP_OK) return status;
    const size_t need = palp_scene_memsize(config);
    if (need == 0u) return PALP_ERR_ARGUMENT;
    status = palp_check_block(memory, bytes, need);
    if (status != PALP_OK) return status;
    palp_scene *s = lay_out(&arena, config, body, part);
    set_up(s, config);
    status = open_bodies(s, config, body, part, bound_ns);
    if (status == PALP_OK) *scene = s;
    return status;
}

const palp_counters *palp_scene_counters(const palp_scene *scene, uint32_t hand) {
    return &scene->hand[hand].counters;
}

palp_drive_trouble palp_scene_trouble(const palp_scene *scene, uint32_t hand, uint32_t axis) {
    const palp_hand *h = &scene->hand[hand];
    if (axis >= h->axes.count) return (palp_drive_trouble){.kind = PALP_TROUBLE_NONE};
    return palp_drive_trouble_of(&h->axes.drive[axis], &h->config.device.drives);
}

uint32_t palp_scene_drives(const palp_scene *scene) { return scene->drives; }
const palp_setpoint *palp_scene_setpoint(const palp_scene *scene, uint32_t drive) {
    return &scene->setpoint[drive];
}
uint32_t palp_scene_bodies(const palp_scene *scene) { return scene->bodies; }
uint32_t palp_scene_tools(const palp_scene *scene) { return scene->tools; }
const palp_scene_tool *palp_scene_mount(const palp_scene *scene, uint32_t tool) {
    return &scene->mount[tool];
}
const palp_body *palp_scene_body(const palp_scene *scene, uint32_t body) {
    return &scene->body[body];
}
const palp_hand *palp_scene_hand(const palp_scene *scene, uint32_t hand) {
    return &scene->hand[hand];
}

/* ---- exchange ---- */

void palp_scene_leave(palp_scene *s) { s->left = true; }

bool palp_scene_has_left(const palp_scene *s) {
    bool any = false;
    for (uint32_t h = 0; h < s->hands; h++) any = any || s->part[h] > 0.0f;
    return s->left && !any;
}

/* The way on which what a hand touched last pushed it, or the device's z. */
static palp_vec3 way_out(const palp_scene *from, uint32_t hand) {
    const float *r = from->hand[hand].config.placement.rotation;
    const palp_vec3 force = palp_rotate_back(r, from->pushed_N[hand]), up = {0.0f, 0.0f, 1.0f};
    const float size = palp_norm(force);
    return size > 0.0f ? palp_scale(1.0f / size, force) : up;
}

static const palp_joint_entry *joint_of(const palp_scene *s, const palp_scene_drive *d) {
    return &s->body[d->body].config.assembly->zones->joint[d->joint];
}

/* Joints go on where the same frames have led them. */
static void keep_setpoints(palp_scene *s, const palp_scene *from) {
    for (uint32_t d = 0; d < s->drives; d++) {
        const palp_scene_drive *a = &s->drive[d];
        if (a->by != PALP_DRIVEN_BY_FRAMES) continue;
        for (uint32_t o = 0; o < from->drives; o++) {
            const palp_scene_drive *b = &from->drive[o];
            if (b->by != a->by || b->hand != a->hand || b->id != a->id || b->byte != a->byte)
                continue;
            const palp_joint_entry *joint = joint_of(s, a);
            s->setpoint[d] = from->setpoint[o];
            s->setpoint[d].value = palp_clamp(s->setpoint[d].value, joint->low, joint->high);
            s->setpoint[d].goal = palp_clamp(s->setpoint[d].goal, joint->low, joint->high);
        }
    }
}

palp_status palp_scene_take_over(palp_scene *s, const palp_scene *from) {
    bool same =
        s->hands == from->hands && palp_same_bits(s->dt_s, from->dt_s) && palp_scene_has_left(from);
    for (uint32_t h = 0; h < s->hands && same; h++)
        same = palp_axes(&s->hand[h].config.device.kinematics) ==
               palp_axes(&from->hand[h].config.device.kinematics);
    if (!same) return PALP_ERR_ARGUMENT;
    for (uint32_t h = 0; h < s->hands; h++) {
        const palp_placement placement = s->hand[h].config.placement;
        s->hand[h] = from->hand[h];
        s->hand[h].config.placement = placement;
    }
    for (uint32_t t = 0; t < s->tools; t++) {
        const uint32_t hand = s->mount[t].hand;
        s->out[t] = palp_rotate(s->hand[hand].config.placement.rotation, way_out(from, hand));
        s->pushed_N[hand] = s->out[t];
        s->within[t] = s->hand[hand].feels ? OUT_TICKS : 0u;
    }
    for (uint32_t h = 0; h < s->hands; h++) s->part[h] = s->hand[h].feels ? 1.0f : 0.0f;
    keep_setpoints(s, from);
    s->ticks = from->ticks;
    return PALP_OK;
}

/* ---- the tick ---- */

void palp_scene_pose(palp_scene *s, uint32_t body, const float *value, const palp_frame *root) {
    if (s->body[body].config.kind != PALP_BODY_ZONES) return;
    const uint32_t joints = s->body[body].config.assembly->zones->meta->joints;
    for (uint32_t j = 0; j < joints; j++) s->value[body][j] = value[j];
    s->root[body] = *root;
}

/* Whether a frame has set-points for joints of the scene. */
static bool take_setpoints(palp_scene *s, uint32_t hand, const palp_can_frame *frame) {
    bool any = false;
    for (uint32_t d = 0; d < s->drives; d++) {
        const palp_scene_drive *of = &s->drive[d];
        if (of->hand == hand && of->by == PALP_DRIVEN_BY_FRAMES)
            any |= palp_setpoint_take(&s->setpoint[d], of, joint_of(s, of), frame);
    }
    return any;
}

/* Joints that are driven by frames on a device's bus; returns which of its frames those were. */
static uint64_t listen(palp_scene *s, uint32_t hand, const palp_tick_input *input) {
    uint64_t heard = 0;
    uint32_t frames;
    const palp_can_frame *frame = palp_tick_frames(input, &frames);
    for (uint32_t f = 0; f < frames && s->drives > 0u; f++)
        heard |= take_setpoints(s, hand, &frame[f]) ? 1ull << f : 0u;
    return heard;
}

/* Joints that are driven, and the configuration of each multizone model. */
static void pose_zones(palp_scene *s) {
    for (uint32_t d = 0; d < s->drives; d++) {
        const palp_scene_drive *of = &s->drive[d];
        const palp_hand *h = &s->hand[of->hand];
        float *value = &s->value[of->body][of->joint];
        if (of->by == PALP_DRIVEN_BY_FRAMES)
            *value = s->setpoint[d].value;
        else if (h->feels)
            *value = of->offset + of->scale * h->axes.joint[of->axis].believed_rad;
    }
    for (uint32_t b = 0; b < s->bodies; b++) {
        if (s->body[b].config.kind == PALP_BODY_ZONES)
            palp_answer_pose(s->body[b].answer, s->value[b], &s->root[b]);
    }
}

/* Whether all hands that feel have just entered RUN: then nothing goes on from before. */
static bool begins_anew(palp_scene *s) {
    bool any = false, others = false;
    for (uint32_t h = 0; h < s->hands; h++) {
        any = any || (s->hand[h].feels && s->hand[h].entered);
        others = others || (s->hand[h].feels && !s->hand[h].entered);
    }
    for (uint32_t b = 0; b < s->bodies && any && !others; b++) palp_body_reset(&s->body[b]);
    return any && !others;
}

/* Whether nobody else is on the bodies. */
static bool is_alone(const palp_scene *s, uint32_t hand) {
    for (uint32_t o = 0; o < s->hands; o++) {
        if (o != hand && (s->part[o] > 0.0f || s->hand[o].feels)) return false;
    }
    return true;
}

/* How much of each device's springs there is. */
static void fade(palp_scene *s, bool anew) {
    const float step = s->dt_s / PALP_SCENE_FADE_S;
    if (s->left) {
        for (uint32_t h = 0; h < s->hands; h++) s->part[h] = palp_max(s->part[h] - step, 0.0f);
        return;
    }
    for (uint32_t h = 0; h < s->hands; h++) {
        const palp_hand *hand = &s->hand[h];
        float *part = &s->part[h];
        if (hand->feels && (anew || !hand->entered) && !s->leaving[h])
            *part =
                anew || (!(*part > 0.0f) && is_alone(s, h)) ? 1.0f : palp_min(*part + step, 1.0f);
        else
            *part = is_alone(s, h) ? 0.0f : palp_max(*part - step, 0.0f);
        s->leaving[h] = *part > 0.0f && (s->leaving[h] || !hand->feels || (hand->entered && !anew));
    }
}

/* Where tools are, by the tips that carry them. */
static void place_tools(palp_scene *s) {
    palp_body_tool *tool = s->held;
    for (uint32_t t = 0; t < s->tools; t++) {
        const palp_scene_tool *m = &s->mount[t];
        const palp_hand_place *p = &s->tip[m->hand];
        palp_frame on_tip = m->at;
        on_tip.t.y += m->jaw * p->opening_m;
        tool[t] = (palp_body_tool){.at = s->last[t], .part = s->part[m->hand]};
        if (s->leaving[m->hand]) continue;
        tool[t].at = palp_frame_compose(&p->at, &on_tip);
        tool[t].turning_rad_s = p->turning_rad_s;
        const palp_vec3 arm = palp_sub(tool[t].at.t, p->at.t);
        tool[t].at.t = palp_add(tool[t].at.t, s->off_m[t]);
        s->last[t] = tool[t].at;
        tool[t].velocity_m_s = palp_add(p->velocity_m_s, palp_cross(p->turning_rad_s, arm));
    }
}

/* Nobody feels it. */
static void rest(const palp_body *b, palp_body_report *r) {
    *r = (palp_body_report){.level = b->answer->contact.now, .limit = b->answer->limit};
}

/* What is stored by a tool, at most. */
static float stored_by(const palp_scene *s, uint32_t tool) {
    float sum = 0.0f;
    for (uint32_t b = 0; b < s->bodies; b++) {
        const palp_body_felt *f = &s->felt[b][tool];
        if (f->touching) sum += palp_max(f->held_J, 0.0f) + s->body_report[b].stored_J;
    }
    return sum;
}

/* Whether it is known of all bodies, and it is where it is held unless it is kept from there. */
static bool has_arrived(const palp_scene *s, uint32_t tool) {
    bool arrived = true;
    for (uint32_t b = 0; b < s->bodies; b++) {
        const palp_body_felt *f = &s->felt[b][tool];
        const float off = palp_norm(palp_sub(f->tool.t, s->held[tool].at.t));
        arrived = arrived && f->found && (f->touching || off < NEAR_M);
    }
    return arrived;
}

/* After an exchange: out of the bodies, and back as far as nothing presses. */
static void lead_tools(palp_scene *s) {
    for (uint32_t t = 0; t < s->tools; t++) {
        const bool loose = !(stored_by(s, t) > PALP_SCENE_BACK_J);
        const float off = palp_dot(s->off_m[t], s->out[t]);
        if (!s->hand[s->mount[t].hand].feels) {
            s->within[t] = 0;
            s->off_m[t] = (palp_vec3){0.0f, 0.0f, 0.0f};
        } else if (s->within[t] > 0u && !loose) {
            s->within[t] = OUT_TICKS;
            s->off_m[t] = palp_scale(off + PALP_SCENE_OUT_M_S * s->dt_s, s->out[t]);
        } else if (s->within[t] > 0u) {
            s->within[t] = has_arrived(s, t) ? s->within[t] - 1u : OUT_TICKS;
        } else if (loose && off > 0.0f) {
            s->off_m[t] =
                palp_scale(palp_max(off - PALP_SCENE_BACK_M_S * s->dt_s, 0.0f), s->out[t]);
        }
    }
}

/* Whether a tool of a hand is on its way out, and nobody is to feel it. */
static bool is_within(const palp_scene *s, uint32_t hand) {
    bool any = false;
    for (uint32_t t = 0; t < s->tools; t++)
        any = any || (s->mount[t].hand == hand && s->within[t] > 0u);
    return any;
}

/* What a hand feels of all bodies by all of its tools, about its tip. */
static void gather(const palp_scene *s, uint32_t hand, palp_hand_felt *sum) {
    const palp_hand_place *tip = &s->tip[hand];
    const palp_body_tool *tool = s->held;
    const palp_vec3 y = {tip->at.r[1], tip->at.r[4], tip->at.r[7]};
    for (uint32_t b = 0; b < s->bodies; b++) {
        bool touches = false;
        for (uint32_t t = 0; t < s->tools; t++) {
            const palp_body_felt *f = &s->felt[b][t];
            if (s->mount[t].hand != hand || !(tool[t].part > 0.0f)) continue;
            const palp_vec3 arm = palp_sub(palp_sub(tool[t].at.t, s->off_m[t]), tip->at.t);
            const palp_vec3 moment =
                palp_add(f->wrench.moment_Nm, palp_cross(arm, f->wrench.force_N));
            sum->wrench.force_N = palp_add(sum->wrench.force_N, f->wrench.force_N);
            sum->wrench.moment_Nm = palp_add(sum->wrench.moment_Nm, moment);
            sum->opens_N += s->mount[t].jaw * palp_dot(f->wrench.force_N, y);
            sum->stored_J += f->held_J;
            sum->damped_W += f->damped_W;
            sum->brought_J += f->brought_J;
            touches = touches || f->touching;
        }
        if (touches) sum->stored_J += s->body_report[b].stored_J;
    }
}

/* Bodies that tools of a hand touch, bit by bit. */
static uint32_t touched_by(const palp_scene *s, uint32_t hand) {
    uint32_t bodies = 0;
    for (uint32_t b = 0; b < s->bodies; b++) {
        for (uint32_t t = 0; t < s->tools; t++) {
            if (s->mount[t].hand == hand && s->part[hand] > 0.0f && s->felt[b][t].touching)
                bodies |= 1u << b;
        }
    }
    return bodies;
}

/* A body between hands passes on what one puts in: so do their books, of those that touch the same
 * body, or did a tick ago. */
static void share_energy(palp_scene *s) {
    uint32_t touches[PALP_SCENE_HANDS], before[PALP_SCENE_HANDS];
    for (uint32_t h = 0; h < s->hands; h++) {
        before[h] = s->touched[h];
        touches[h] = s->touched[h] = touched_by(s, h);
    }
    for (uint32_t h = 0; h < s->hands; h++) {
        for (uint32_t o = 0; o < s->hands; o++) {
            const bool both = ((touches[h] | before[h]) & (touches[o] | before[o])) != 0u;
            if (o == h || !both || !s->hand[h].feels || !s->hand[o].feels) continue;
            palp_passivity_pass_on(&s->hand[h].output.passivity, s->sum[h].stored_J,
                                   &s->hand[o].output.passivity, s->sum[o].stored_J);
        }
    }
}

static void count(palp_scene *s, palp_scene_report *r) {
    const float period_ns = NS_PER_S * s->dt_s;
    uint64_t coarsened = 0, refined = 0, held = 0;
    bool shortened = false, feels = false;
    for (uint32_t b = 0; b < s->bodies; b++) {
        const palp_answer *a = s->body[b].answer;
        shortened = shortened || s->body_report[b].shortened;
        if (a == NULL) continue;
        coarsened += a->coarsened;
        refined += a->refined;
        held += a->held;
    }
    for (uint32_t h = 0; h < s->hands; h++) feels = feels || s->hand[h].feels;
    for (uint32_t h = 0; h < s->hands; h++) {
        palp_counters *c = &s->hand[h].counters;
        c->ticks = s->ticks;
        c->coarsened = coarsened;
        c->refined = refined;
        c->held = held;
        if (feels && shortened) c->shortened++;
        if (r->elapsed_ns > period_ns) c->overruns++;
    }
}

void palp_scene_tick(palp_scene *s, const palp_tick_input *input,
                     palp_can_frame out[][PALP_SERVO_FRAMES_OUT], uint32_t *sent,
                     palp_scene_report *report) {
    const uint64_t start_ns = s->port.now_ns(s->port.context);
    bool feels = false;
    *report = (palp_scene_report){.tick = s->ticks++,
                                  .bound_ns = s->bound_ns,
                                  .hand = s->hand_report,
                                  .body = s->body_report};
    for (uint32_t h = 0; h < s->hands; h++) {
        s->hand_report[h] = (palp_hand_report){.faults = 0};
        const uint64_t heard = listen(s, h, &input[h]);
        palp_hand_begin(&s->hand[h], &input[h], heard, &s->hand_report[h]);
        s->tip[h] = palp_hand_tip(&s->hand[h]);
        feels = feels || s->hand[h].feels;
    }
    for (uint32_t d = 0; d < s->drives; d++)
        palp_setpoint_step(&s->setpoint[d], &s->drive[d], s->dt_s);
    fade(s, begins_anew(s));
    place_tools(s);
    if (feels) pose_zones(s);
    for (uint32_t b = 0; b < s->bodies; b++) {
        report->felt[b] = s->felt[b];
        /* a body that moves does so by itself */
        if (feels || s->body[b].dynamic != NULL)
            palp_body_tick(&s->body[b], start_ns, s->held, s->felt[b], &s->body_report[b]);
        else
            rest(&s->body[b], &s->body_report[b]);
    }
    for (uint32_t h = 0; h < s->hands; h++) {
        s->sum[h] = (palp_hand_felt){.opens_N = 0.0f};
        if (!s->hand[h].feels || is_within(s, h)) continue;
        gather(s, h, &s->sum[h]);
        const palp_vec3 force = s->sum[h].wrench.force_N;
        if (!s->left && palp_dot(force, force) > 0.0f) s->pushed_N[h] = force;
        palp_passivity_bring(&s->hand[h].output.passivity, s->hand[h].gain * s->sum[h].brought_J);
    }
    lead_tools(s);
    if (s->hands > 1u) share_energy(s);
    for (uint32_t h = 0; h < s->hands; h++)
        sent[h] = palp_hand_end(&s->hand[h], &s->sum[h], &input[h], report->tick, out[h],
                                &s->hand_report[h]);
    report->elapsed_ns = palp_elapsed_ns(start_ns, s->port.now_ns(s->port.context));
    count(s, report);
}

void palp_scene_spare(palp_scene *scene) {
    for (uint32_t b = 0; b < scene->bodies; b++) palp_body_spare(&scene->body[b]);
}
