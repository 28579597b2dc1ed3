/* SPDX-License-Identifier: MIT */
/* palp play of a dynamic body: tools follow a scene, the body moves, every tick within a budget. */
#include "core/dyna/skin.h"
#include "core/servo/dynamic.h"
#include "tools/cli/play.h"
#include "port/host/scenefile.h"
#include "port/host/blobfile.h"
#include "port/host/page.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define POINTS 64

/* Orders of magnitude for soft things, from soft to stiff. */
static const struct {
    const char *name;
    double young_Pa, poisson, damping_s, drag_per_s;
} presets[] = {{"jelly", 600, 0.45, 5e-4, 1},      {"fat", 2e3, 0.45, 1e-3, 8},
               {"liver", 5e3, 0.45, 5e-4, 4},      {"muscle", 2e4, 0.45, 4e-4, 4},
               {"gel", 5e4, 0.4, 1e-4, 2},         {"rubber", 5e5, 0.45, 3e-5, 4},
               {"hard-rubber", 2e6, 0.45, 1e-5, 8}};

typedef struct {
    double t_s, wall_us, asked_us, displaced_m, energy_J;
    palp_dynamic_report r;
    palp_vec3 force_N[SCENE_TRACKS];
} dynamic_tick;

typedef struct {
    const play_spec *spec;
    scene_file *s;
    palp_tets tets;
    palp_dynamic body;
    palp_skin skin;
    palp_tool tool[SCENE_TRACKS];
    uint32_t tools, which[SCENE_TRACKS];
    uint64_t begun_ns, begun_work;
    double begun_s;
    size_t ticks;
    dynamic_tick *tick;
    motion motion;
    float *rest_m; /* [skin][3] */
    uint8_t *fixed;
    double jump_m, step_m, fade_m; /* of the surface: largest difference that a change left
                   to fade; largest motion, and beyond it, of a vertex in a tick */
} player;

static uint64_t now_ns(void *context) {
    const player *p = context;
    if (p->spec->wall) return p->begun_ns + (uint64_t)((now_s() - p->begun_s) * 1e9);
    return p->begun_ns + p->body.work_ns - p->begun_work;
}

static palp_material choose_material(const player *p) {
    const play_spec *s = p->spec;
    const palp_tets_meta *m = p->tets.meta;
    double young = (double)m->young_Pa, poisson = (double)m->poisson;
    double damping = (double)m->damping_s, drag = (double)m->drag_per_s;
    if (s->material != NULL) {
        bool found = false;
        char names[200] = "";
        for (size_t k = 0; k < sizeof presets / sizeof presets[0]; k++) {
            strcat(names, " ");
            strcat(names, presets[k].name);
            if (strcmp(presets[k].name, s->material) != 0) continue;
            found = true;
            young = presets[k].young_Pa;
            poisson = presets[k].poisson;
            damping = presets[k].damping_s;
            drag = presets[k].drag_per_s;
        }
        if (!found) die(EXIT_USAGE, "--material: no '%s'; there are:%s", s->material, names);
    }
    if (s->young_Pa >= 0) young = s->young_Pa;
    if (s->poisson > -1) poisson = s->poisson;
    if (s->damping_s >= 0) damping = s->damping_s;
    if (s->drag_per_s >= 0) drag = s->drag_per_s;
    return palp_material_of((float)young, (float)poisson, m->density_kg_m3, (float)damping,
                            (float)drag);
}

static palp_vec3 vec(const double x[3]) {
    return (palp_vec3){(float)x[0], (float)x[1], (float)x[2]};
}

static void open_motion(player *p) {
    const palp_tets *t = &p->tets;
    const uint32_t skin = t->meta->skin;
    p->rest_m = allocate(3 * (size_t)skin, sizeof *p->rest_m);
    p->fixed = allocate(skin, 1);
    for (uint32_t i = 0; i < skin; i++) {
        memcpy(p->rest_m + 3 * (size_t)i, t->rest_m + 3 * (size_t)t->skin_node[i],
               3 * sizeof(float));
        p->fixed[i] = (t->node[t->skin_node[i]].flags & PALP_TET_PINNED) != 0 ? 1 : 0;
    }
    motion *m = &p->motion;
    m->parts = 1;
    m->part[0] = (motion_part){.nodes = skin,
                               .triangles = t->meta->skin_triangles,
                               .triangle = t->skin_triangle,
                               .fixed = p->fixed,
                               .rest_m = p->rest_m};
    m->tools = p->tools;
    for (uint32_t k = 0; k < p->tools; k++) m->tool[k] = &p->tool[k];
    m->level = p->body.dyna.skin_level;
    motion_begin(m, MOTION_PAGE_BYTES);
}

static void open_body(player *p) {
    const play_spec *s = p->spec;
    scene_tools(p->s, p->tool, p->which, &p->tools);
    double budget = play_budget_us(s, p->s->rate_hz);
    palp_dynamic_config c = {.tets = &p->tets,
                             .material = choose_material(p),
                             .gravity_m_s2 = vec(p->s->body[0].gravity_m_s2),
                             .adapt = palp_adapt_defaults(&p->tets),
                             .tools = p->tool,
                             .tool_count = p->tools,
                             .max_points = POINTS,
                             .most_class = s->most_class,
                             .cost = machine_table(&s->machine, budget * 1e-6 * p->s->rate_hz),
                             .port = {.now_ns = now_ns, .context = p},
                             .tick_s = (float)(1 / p->s->rate_hz),
                             .uniform = s->uniform};
    if (s->refine_share > 0) {
        c.adapt.refine_m = (float)s->refine_share * p->tets.meta->diagonal_m;
        c.adapt.merge_m = 0.1f * c.adapt.refine_m;
    }
    size_t bytes = palp_dynamic_memsize(&p->tets, POINTS);
    palp_frame at[SCENE_TRACKS];
    float bound_ns = 0;
    scene_tools_at(p->s, p->which, p->tools, 0, at);
    palp_status status =
        palp_dynamic_init(&p->body, &c, at, allocate_aligned(bytes, 1), bytes, &bound_ns);
    if (status == PALP_ERR_BUDGET)
        die(EXIT_WORK,
            "%s: the coarsest mesh needs %.0f us on %s (palp wcet) and has %.0f us: use a lower "
            "rate, "
            "coarser meshes, or another machine by --target or --ns-per-operation",
            s->blob, (double)bound_ns * 1e-3, s->machine.target.name, budget);
    if (status != PALP_OK)
        die(EXIT_WORK, "%s: %s (is the material sound?)", s->blob, palp_status_text(status));
    bytes = palp_skin_memsize(&p->tets);
    (void)palp_skin_init(&p->skin, &p->body.dyna, allocate_aligned(bytes, 1), bytes);
    open_motion(p);
}

/* Largest displacement of the surface, and how it stepped. */
static void look_at_surface(player *p, dynamic_tick *k, const float *before) {
    for (uint32_t i = 0; i < p->tets.meta->skin; i++) {
        palp_vec3 now = palp_vec3_at(p->skin.position_m + 3 * i);
        palp_vec3 rest = palp_vec3_at(p->tets.rest_m + 3 * (size_t)p->tets.skin_node[i]);
        double moved = (double)palp_norm(palp_sub(now, palp_vec3_at(before + 3 * i)));
        double speed = (double)palp_norm(palp_skin_velocity(&p->body.dyna, i)) / p->s->rate_hz;
        k->displaced_m = fmax(k->displaced_m, (double)palp_norm(palp_sub(now, rest)));
        p->step_m = fmax(p->step_m, speed);
        p->fade_m = fmax(p->fade_m, moved - speed);
    }
    p->jump_m = fmax(p->jump_m, (double)p->skin.jump_m);
}

static void run(player *p) {
    const size_t skin = p->tets.meta->skin;
    p->ticks = (size_t)(p->s->seconds * p->s->rate_hz);
    if (p->ticks == 0) die(EXIT_USAGE, "%s: not one tick in its time", p->spec->scene);
    if (p->ticks > MOST_TICKS)
        die(EXIT_USAGE, "%s: %zu ticks; at most %d are kept", p->spec->scene, p->ticks, MOST_TICKS);
    p->tick = allocate(p->ticks + 1, sizeof *p->tick);
    float *before = allocate(3 * skin, sizeof *before);
    for (size_t i = 0; i < p->ticks; i++) {
        dynamic_tick *k = &p->tick[i];
        palp_frame at[SCENE_TRACKS];
        palp_wrench on_tool[SCENE_TRACKS];
        k->t_s = (double)(i + 1) / p->s->rate_hz;
        scene_tools_at(p->s, p->which, p->tools, k->t_s, at);
        p->begun_ns = (uint64_t)(k->t_s * 1e9);
        p->begun_work = p->body.work_ns;
        p->begun_s = now_s();
        palp_dynamic_tick(&p->body, p->begun_ns, at, on_tool, &k->r);
        k->wall_us = (now_s() - p->begun_s) * 1e6;
        k->asked_us = (double)(now_ns(p) - p->begun_ns) * 1e-3;
        for (uint32_t t = 0; t < p->tools && p->which[t] < SCENE_TRACKS; t++)
            k->force_N[p->which[t]] = on_tool[t].force_N;
        memcpy(before, p->skin.position_m, 3 * skin * sizeof *before);
        palp_skin_update(&p->skin, (float)(1 / p->s->rate_hz));
        look_at_surface(p, k, before);
        const float *const skin_m[1] = {p->skin.position_m};
        if (p->spec->report != NULL && motion_wants(&p->motion, k->t_s))
            motion_add(&p->motion, k->t_s, skin_m, at);
    }
    free(before);
}

/* ---- what it was like ---- */

static double force_of(const dynamic_tick *k) {
    return (double)palp_norm(palp_add(k->force_N[0], k->force_N[1]));
}

static size_t late_ticks(const player *p) {
    size_t late = 0;
    for (size_t i = 0; i < p->ticks; i++) late += p->tick[i].asked_us > 1e6 / p->s->rate_hz;
    return late;
}

/* Evaluations of a tick on the finest mesh alone. */
static double fine_work(const player *p) {
    const palp_tets_meta *m = p->tets.meta;
    double sum = 0;
    for (uint32_t i = m->first_tet[m->levels - 1]; i < m->tets; i++) {
        uint32_t fastest = 0;
        for (int c = 0; c < 4; c++) {
            uint32_t k = p->body.dyna.step_class[p->tets.tet[i].node[c]];
            fastest = k > fastest ? k : fastest;
        }
        sum += 1u << fastest;
    }
    return sum;
}

static percentiles times(const player *p, bool wall) {
    double *x = allocate(p->ticks, sizeof *x);
    for (size_t i = 0; i < p->ticks; i++) x[i] = wall ? p->tick[i].wall_us : p->tick[i].asked_us;
    percentiles s = percentiles_of(x, p->ticks);
    free(x);
    return s;
}

static void summary(FILE *f, const void *context) {
    const player *p = context;
    double force = 0, displaced = 0, work = 0, most = 0, fine = fine_work(p);
    uint32_t splits = 0, merges = 0, refused = 0, overflow = 0, active[PALP_TET_LEVELS] = {0};
    size_t shortened = 0, collapsed = 0, coasted = 0, energy_limited = 0, lost = 0;
    for (size_t i = 0; i < p->ticks; i++) {
        const palp_dynamic_report *r = &p->tick[i].r;
        force = fmax(force, force_of(&p->tick[i]));
        displaced = fmax(displaced, p->tick[i].displaced_m);
        work += (double)r->evaluations / (double)p->ticks;
        most = fmax(most, r->evaluations);
        splits += r->adapt.splits;
        merges += r->adapt.merges;
        refused += r->adapt.refused;
        overflow += r->overflow;
        shortened += r->shortened;
        collapsed += r->collapsed;
        coasted += r->coasted;
        energy_limited += r->energy_limited;
        lost += r->lost;
        for (uint32_t l = 0; l < p->tets.meta->levels; l++)
            active[l] = r->active[l] > active[l] ? r->active[l] : active[l];
    }
    percentiles asked = times(p, false), wall = times(p, true);
    fprintf(f, "ticks                 %zu at %g Hz, %zu late by the clock that is asked (%s)\n",
            p->ticks, p->s->rate_hz, late_ticks(p), p->spec->wall ? "wall" : "work");
    play_print_machine(f, p->spec);
    fprintf(f, "tick                  p50 %.1f, p99 %.1f, max %.1f us, budget %.0f us\n", asked.p50,
            asked.p99, asked.max, play_budget_us(p->spec, p->s->rate_hz));
    fprintf(f, "wall clock here       p50 %.1f, p99 %.1f, max %.1f us\n", wall.p50, wall.p99,
            wall.max);
    fprintf(f,
            "element evaluations   %.0f a tick in the mean, %.0f at most; the finest mesh alone: "
            "%.0f, %.1f times as many\n",
            work, most, fine, fine / work);
    fprintf(f, "active nodes          at most");
    for (uint32_t l = 0; l < p->tets.meta->levels; l++)
        fprintf(f, " %" PRIu32 " on level %" PRIu32 "%s", active[l], l,
                l + 1 < p->tets.meta->levels ? "," : "\n");
    fprintf(f,
            "families              %" PRIu32 " split, %" PRIu32 " merged, %" PRIu32
            " refused for the budget's sake\n",
            splits, merges, refused);
    fprintf(f,
            "in time by            larger steps in %zu ticks, the coarsest mesh in %zu; "
            "started too late %zu\n",
            shortened, collapsed, coasted);
    fprintf(
        f,
        "surface               changes of resolution leave at most %.2g m to fade; beyond its own "
        "motion it moves %.2g m a tick at most, largest motion %.2g m\n",
        p->jump_m, p->fade_m, p->step_m);
    if (lost > 0)
        fprintf(f, "motion lost           put back to rest in %zu ticks: not finite any more\n",
                lost);
    fprintf(f, "energy monitor        acted in %zu ticks\n", energy_limited);
    if (energy_limited > p->ticks / 10)
        warn(
            "the energy monitor held the motion back in %zu of %zu ticks: the material is too "
            "stiff "
            "for the smallest step at this rate, and what is shown is not the body's motion: use a "
            "higher rate, coarser meshes or a softer material",
            energy_limited, (size_t)p->ticks);
    fprintf(f, "contact               largest force %.3g N, largest displacement %.3g m%s\n", force,
            displaced, overflow > 0 ? "; some vertices had no room among the contact points" : "");
}

static void write_csv(const player *p, const char *path) {
    output out = open_output(path);
    fputs("t_s,steps,evaluations,elements", out.file);
    for (uint32_t l = 0; l < p->tets.meta->levels; l++) fprintf(out.file, ",active_%" PRIu32, l);
    fputs(",interface,splits,merges,refused,shortened,collapsed,coasted,object_fx,object_fy,"
          "object_fz,probe_fx,probe_fy,probe_fz,displaced_m,kinetic_J,total_J,tick_us,wall_us\n",
          out.file);
    for (size_t i = 0; i < p->ticks; i++) {
        const dynamic_tick *k = &p->tick[i];
        fprintf(out.file, "%.9g,%" PRIu32 ",%" PRIu32 ",%" PRIu32, k->t_s, k->r.steps,
                k->r.evaluations, k->r.elements);
        for (uint32_t l = 0; l < p->tets.meta->levels; l++)
            fprintf(out.file, ",%" PRIu32, k->r.active[l]);
        fprintf(out.file, ",%" PRIu32 ",%" PRIu32 ",%" PRIu32 ",%" PRIu32 ",%d,%d,%d",
                k->r.interface, k->r.adapt.splits, k->r.adapt.merges, k->r.adapt.refused,
                k->r.shortened, k->r.collapsed, k->r.coasted);
        for (int t = 0; t < SCENE_TRACKS; t++)
            fprintf(out.file, ",%.9g,%.9g,%.9g", (double)k->force_N[t].x, (double)k->force_N[t].y,
                    (double)k->force_N[t].z);
        fprintf(out.file, ",%.9g,%.9g,%.9g,%.3f,%.3f\n", k->displaced_m, (double)k->r.kinetic_J,
                (double)k->r.total_J, k->asked_us, k->wall_us);
    }
    commit_output(&out);
}

typedef struct {
    const char *title, *word, *unit;
    uint32_t series;
    double (*value)(const dynamic_tick *, uint32_t);
    const char *name[PALP_TET_LEVELS];
} graph;

static double value_force(const dynamic_tick *k, uint32_t t) {
    return (double)palp_norm(k->force_N[t]);
}
static double value_active(const dynamic_tick *k, uint32_t l) { return k->r.active[l]; }
static double value_work(const dynamic_tick *k, uint32_t unused) {
    (void)unused;
    return k->r.evaluations;
}
static double value_moved(const dynamic_tick *k, uint32_t unused) {
    (void)unused;
    return k->displaced_m;
}
static double value_energy(const dynamic_tick *k, uint32_t which) {
    return (double)(which == 0 ? k->r.kinetic_J : k->r.total_J);
}
static double value_time(const dynamic_tick *k, uint32_t which) {
    return which == 0 ? k->asked_us : k->wall_us;
}

/* What a curve shows. */
typedef struct {
    const player *p;
    const graph *g;
    uint32_t number;
} curve;

static double curve_value(const void *context, size_t i) {
    const curve *c = context;
    return c->g->value(&c->p->tick[i], c->number);
}

static void draw(page *to, const player *p, const graph *g) {
    page_chart(to, g->title, g->word, g->unit, PAGE_ZERO);
    for (uint32_t k = 0; k < g->series; k++) {
        if (g->value == value_force && !p->s->has[k]) continue;
        const curve c = {p, g, k};
        const page_curve_spec spec = {g->name[k], p->tick[0].t_s, 1 / p->s->rate_hz, p->ticks,
                                      false};
        page_curve(to, &spec, curve_value, &c);
    }
}

static void write_report(const player *p, const char *path) {
    const graph graphs[] = {{"Force on the tools",
                             "What each tool feels",
                             "N",
                             SCENE_TRACKS,
                             value_force,
                             {"object", "probe"}},
                            {"Largest displacement of the surface",
                             "Of any of its vertices, from rest",
                             "m",
                             1,
                             value_moved,
                             {"displacement"}},
                            {"Active nodes",
                             "Nodes at work on each mesh, coarse to fine",
                             "nodes",
                             p->tets.meta->levels,
                             value_active,
                             {"level 0", "level 1", "level 2", "level 3", "level 4"}},
                            {"Element evaluations in a tick",
                             "Work: an element counts once for each of its steps",
                             "evaluations",
                             1,
                             value_work,
                             {"evaluations"}},
                            {"Energy",
                             "Of motion; and all that can fall",
                             "J",
                             2,
                             value_energy,
                             {"kinetic", "with what is stored and can fall"}},
                            {"Time of a tick",
                             "By the clock that budgets it, and by this machine's",
                             "us",
                             2,
                             value_time,
                             {"by operations counted", "wall clock"}}};
    output out = open_output(path);
    page to;
    page_begin(&to, out.file, p->spec->blob);
    page_lines(&to, summary, p);
    page_curves(&to);
    for (size_t i = 0; i < sizeof graphs / sizeof graphs[0]; i++) draw(&to, p, &graphs[i]);
    page_events(&to);
    page_end(&to, &(page_rest){.motion = &p->motion});
    commit_output(&out);
}

int play_dynamic(const play_spec *s, const void *data, size_t bytes) {
    player *p = allocate(1, sizeof *p);
    p->spec = s;
    palp_status status = palp_tets_open(&p->tets, data, bytes);
    if (status != PALP_OK) die_of_blob(s->blob, status, bytes);
    p->s = scene_read(s->scene);
    if (p->s->body[0].motions > 0)
        die(EXIT_USAGE, "%s: a dynamic body has no joints", p->s->body[0].motion[0].where);
    open_body(p);
    run(p);
    summary(stdout, p);
    if (s->csv != NULL) write_csv(p, s->csv);
    if (s->report != NULL) write_report(p, s->report);
    bool late = late_ticks(p) > 0 && !s->wall;
    motion_free(&p->motion);
    free(p->rest_m);
    free(p->fixed);
    scene_free(p->s);
    free(p->tick);
    free(p);
    return late ? EXIT_WORK : EXIT_SUCCESS;
}
