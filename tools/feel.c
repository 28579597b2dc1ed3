/* SPDX-License-Identifier: MIT */
/* palp feel: what reaches the hand, against exact solutions and under disturbance, in virtual time.
 */
#include "feel.h"
#include "args.h"
#include "commands.h"
#include "core/servo/answer.h"
#include "nodal.h"
#include "parallel.h"
#include "places.h"
#include "press.h"
#include "util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define RATE_HZ 1000.0
#define MARGIN 0.7 /* share of the period for the answer */
#define NS_PER_OPERATION 0.5
#define PLACES 20         /* where the body is pressed */
#define PATH_TICKS 240    /* of a slide */
#define PATH_EDGES 4.0    /* its length */
#define FORCE_THRESHOLD 7 /* per cent, just noticeable */
#define AFTER_TICKS 100   /* after a disturbance */

static const char help[] =
    "usage: palp feel BLOB [-o DIR] [--json] [--places N] [--every N]\n"
    "\n"
    "Measures what a hand would feel of an elastostatic body, in virtual time, the same on every\n"
    "machine: contact against Hertz' law, ripple while sliding, coarser levels, stalls of the\n"
    "machine and late starts, slow controllers, teleports, closed paths. One line for each "
    "measure,\n"
    "with the threshold of perception and the goal beside it.\n"
    "\n"
    "  -o DIR      also write feel.json and feel.html there\n"
    "  --json      print JSON in place of the table\n"
    "  --places N  where the body is pressed (default 20)\n"
    "  --every N   disturb every N-th tick of the script, one run for each (default 20; 1: all)\n"
    "\n"
    "Exit 0 also where goals are missed: the table is the answer.\n";
static const option options[] = {
    {"-o", 1}, {"--json", 0}, {"--places", 1}, {"--every", 1}, {NULL, 0}};

typedef struct {
    const char *blob, *folder;
    bool json;
    uint32_t places, every;
} feel_spec;

static void set_option(void *context, const argument *a) {
    feel_spec *s = context;
    if (a->option == NULL) {
        if (s->blob != NULL) die(EXIT_USAGE, "one blob, not also '%s'", a->value[0]);
        s->blob = a->value[0];
    } else if (strcmp(a->option, "-o") == 0) {
        s->folder = a->value[0];
    } else if (strcmp(a->option, "--places") == 0) {
        s->places = arg_u32(a, 0, 1, 1000);
    } else if (strcmp(a->option, "--every") == 0) {
        s->every = arg_u32(a, 0, 1, 10000);
    } else {
        s->json = true;
    }
}

/* ---- rows ---- */

void feel_add(feel_table *t, const char *measure, const char *of, double value, const char *unit,
              double threshold, double goal) {
    t->row = grow(t->row, &t->room, t->count + 1, sizeof *t->row);
    feel_row *r = &t->row[t->count++];
    *r = (feel_row){.value = value, .unit = unit, .threshold = threshold, .goal = goal};
    snprintf(r->measure, sizeof r->measure, "%s", measure);
    snprintf(r->of, sizeof r->of, "%s", of);
}

static void number(FILE *f, double x) {
    if (isfinite(x)) {
        fprintf(f, "%.4g", x);
    } else {
        fputs("null", f);
    }
}

void feel_json(FILE *f, const feel_table *t) {
    fputs("[", f);
    for (size_t i = 0; i < t->count; i++) {
        const feel_row *r = &t->row[i];
        fprintf(f, "%s\n {\"measure\":\"%s\",\"case\":\"%s\",\"value\":", i > 0 ? "," : "",
                r->measure, r->of);
        number(f, r->value);
        fprintf(f, ",\"unit\":\"%s\",\"threshold\":", r->unit);
        number(f, r->threshold);
        fputs(",\"goal\":", f);
        number(f, r->goal);
        fputs("}", f);
    }
    fputs("\n]\n", f);
}

static const char *verdict(const feel_row *r) {
    if (!isfinite(r->goal)) return "";
    return fabs(r->value) <= r->goal ? "reached" : "missed";
}

void feel_text(FILE *f, const feel_table *t) {
    fprintf(f, "%-22s %-42s %10s %-6s %9s %9s\n", "measure", "case", "value", "unit", "felt from",
            "goal");
    for (size_t i = 0; i < t->count; i++) {
        const feel_row *r = &t->row[i];
        fprintf(f, "%-22s %-42s %10.4g %-6s ", r->measure, r->of, r->value, r->unit);
        if (isfinite(r->threshold)) {
            fprintf(f, "%9.3g ", r->threshold);
        } else {
            fprintf(f, "%9s ", "");
        }
        if (isfinite(r->goal)) fprintf(f, "%9.3g %s", r->goal, verdict(r));
        fputc('\n', f);
    }
}

void feel_html(FILE *f, const feel_table *t) {
    fputs(
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><title>Palp: felt "
        "quality</title><style>body{font:15px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem "
        "auto;padding:0 "
        "1rem;color:#222}table{border-collapse:collapse;width:100%}td,th{padding:3px "
        "10px;border-bottom:1px solid #e2ddd4;text-align:left}td.n{text-align:right}.missed{"
        "font-weight:bold}</style></head><body><h1>Felt quality</h1><p>Virtual time; the "
        "threshold is what a hand just notices.</p><table><tr><th>measure<th>case<th>value"
        "<th>unit<th>felt from<th>goal<th></tr>\n",
        f);
    for (size_t i = 0; i < t->count; i++) {
        const feel_row *r = &t->row[i];
        fprintf(f, "<tr><td>%s<td>%s<td class='n'>%.4g<td>%s<td class='n'>", r->measure, r->of,
                r->value, r->unit);
        if (isfinite(r->threshold)) fprintf(f, "%.3g", r->threshold);
        fputs("<td class='n'>", f);
        if (isfinite(r->goal)) fprintf(f, "%.3g", r->goal);
        fprintf(f, "<td class='%s'>%s</tr>\n", verdict(r), verdict(r));
    }
    fputs("</table></body></html>\n", f);
}

/* ---- the body and its places ---- */

typedef struct {
    const palp_blob *blob;
    const feel_spec *spec;
    feel_table table;
    double edge_m;
    uint64_t seed;
    uint32_t *place; /* free nodes, away from fixed ones */
    uint32_t places;
} bench;

static double roll(bench *b) {
    b->seed = b->seed * 6364136223846793005ull + 1442695040888963407ull;
    return (double)(b->seed >> 33) / 2147483648.0;
}

/* Free nodes whose neighbourhood of `edges` edges is free as well. */
static void choose_places(bench *b, double edges) {
    const palp_blob *m = b->blob;
    uint32_t nodes = m->meta->nodes, candidates = 0;
    uint32_t *list = allocate(nodes, sizeof *list);
    for (uint32_t i = 0; i < nodes; i++) {
        bool away = !palp_node_is_fixed(m, i);
        for (uint32_t k = 0; k < nodes && away; k++) {
            if (!palp_node_is_fixed(m, k)) continue;
            palp_vec3 d = palp_sub(at_node(m->rest_m, i), at_node(m->rest_m, k));
            away = (double)palp_norm(d) > edges * b->edge_m;
        }
        if (away) list[candidates++] = i;
    }
    if (candidates == 0)
        die(EXIT_WORK, "no node is farther than %g edges from the fixed ones", edges);
    b->places = b->spec->places;
    b->place = allocate(b->places, sizeof *b->place);
    for (uint32_t i = 0; i < b->places; i++)
        b->place[i] = list[(size_t)(roll(b) * candidates) % candidates];
    free(list);
}

/* Half of the trace of the curvature, from how normals turn towards the neighbours. */
static double curvature(const palp_blob *b, uint32_t node) {
    double sum = 0;
    uint32_t first = b->ring_offset[node], end = b->ring_offset[node + 1];
    for (uint32_t k = first; k < end; k++) {
        palp_vec3 dx = palp_sub(at_node(b->rest_m, b->ring[k]), at_node(b->rest_m, node));
        palp_vec3 dn = palp_sub(at_node(b->normal, b->ring[k]), at_node(b->normal, node));
        sum += (double)(palp_dot(dn, dx) / palp_dot(dx, dx)) / (end - first);
    }
    return sum;
}

/* n . H n at a point: what the body as a whole gives way by. */
static double regular_compliance(const palp_contact *c, const palp_surface_point *p) {
    float row[PALP_MAX_MODES];
    const palp_regular *g = &c->surface->blob->regular;
    palp_surface_modes(c->surface, p, p->n, g->modes, row, 1);
    double sum = 0;
    for (uint32_t a = 0; a < g->modes; a++) sum += (double)(g->value[a] * row[a] * row[a]);
    return sum;
}

/* ---- measures ---- */

static void against_hertz(bench *b) {
    static const double size[] = {0.1, 0.2, 0.5, 1};
    const palp_meta *m = b->blob->meta;
    double nu = (double)m->poisson, stiff = (double)m->young_Pa / (1 - nu * nu);
    for (size_t s = 0; s < sizeof size / sizeof size[0]; s++) {
        double sum = 0, square = 0, a = size[s] * b->edge_m, radius = a / 0.3;
        uint32_t used = 0;
        for (uint32_t i = 0; i < b->places; i++) {
            double k = curvature(b->blob, b->place[i]);
            double effective = 1 / (1 / radius + k);
            if (!(effective > 0) || effective > 4 * radius) continue;
            double depth = a * a / effective, force = 0;
            palp_tool tool = palp_tool_sphere((float)radius);
            palp_contact *c = press_open(b->blob, &tool, 1, PALP_CONTACT_FINEST);
            palp_surface_point p = press_start(c, b->place[i]);
            double h = regular_compliance(c, &p);
            palp_vec3 at = palp_madd(p.y, (float)(radius - depth), p.n);
            press_hold(c, at, 8);
            if (!press_is_clear(b->blob, at, radius, depth)) {
                press_close(c);
                continue;
            }
            for (int it = 0; it < 60; it++) { /* depth = depth of Hertz + force H */
                double left = fmax(depth - force * h, 0);
                force = 0.5 * force + 0.5 * 4.0 / 3 * stiff * sqrt(effective) * pow(left, 1.5);
            }
            double error = (double)palp_norm(c->force_N[0]) / force - 1;
            sum += error;
            square += error * error;
            used++;
            press_close(c);
        }
        char of[72];
        double mean = used > 0 ? sum / used : (double)NAN;
        snprintf(of, sizeof of, "contact radius %g edges, %u places", size[s], used);
        feel_add(&b->table, "Hertz, mean", of, 100 * mean, "%", FORCE_THRESHOLD, s == 0 ? 5 : 3);
        feel_add(&b->table, "Hertz, spread", of, 100 * sqrt(fmax(square / used - mean * mean, 0)),
                 "%", FORCE_THRESHOLD, s == 0 ? 9 : 3);
    }
}

/* What differs from a parabola through its surroundings of `window` ticks to each side, rms over
 * the force (Savitzky and Golay's smoothing, of second order). */
static double roughness(const double *f, const double *force, int count, int window) {
    const double m = window, scale = 3 / ((2 * m - 1) * (2 * m + 1) * (2 * m + 3));
    double square = 0;
    for (int k = window; k + window < count; k++) {
        double smooth = 0;
        for (int j = -window; j <= window; j++)
            smooth += scale * (3 * m * m + 3 * m - 1 - 5.0 * j * j) * f[k + j];
        square += pow((f[k] - smooth) / force[k], 2) / (count - 2 * window);
    }
    return sqrt(square);
}

/* Ripple of a path: of the force, and of its part along the path. */
typedef struct {
    double force, along;
} path_ripple;

/* Slides at constant depth; the ripple over a window of one edge to each side. False where the path
 * ends or the rest of the body is in the way; *lost counts ticks without force. */
static bool slide(bench *b, uint32_t node, double radius, double depth, uint32_t level,
                  uint32_t *lost, path_ripple *r) {
    palp_tool tool = palp_tool_sphere((float)radius);
    palp_contact *c = press_open(b->blob, &tool, 1, level);
    palp_surface_point p = press_start(c, node);
    palp_vec3 along = {0.3f, 0.5f, 0.8f};
    double f[PATH_TICKS], t[PATH_TICKS];
    uint32_t without = 0;
    bool whole = true;
    for (int i = -20; i < PATH_TICKS && whole; i++) {
        along = palp_madd(along, -palp_dot(along, p.n), p.n);
        along = palp_scale(1.0f / palp_norm(along), along);
        double advance = i < 0 ? 0 : PATH_EDGES * b->edge_m / PATH_TICKS;
        palp_vec3 y = palp_madd(p.y, (float)advance, along);
        whole = press_point(c, palp_madd(y, (float)b->edge_m, p.n), p.n, &p);
        palp_vec3 at = palp_madd(p.y, (float)(radius - depth), p.n);
        whole = whole && press_is_clear(b->blob, at, radius, depth);
        press_hold(c, at, 1);
        if (i < 0) continue;
        f[i] = (double)palp_norm(c->force_N[0]);
        t[i] = (double)palp_dot(c->force_N[0], along);
        without += !(f[i] > 0);
    }
    press_close(c);
    if (!whole) return false;
    *lost += without;
    const int window = (int)(PATH_TICKS / PATH_EDGES);
    *r = (path_ripple){roughness(f, f, PATH_TICKS, window), roughness(t, f, PATH_TICKS, window)};
    return true;
}

static int ascending(const void *a, const void *b) {
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* Rows of one tool and depth: the median and the worst path. */
static void ripple_of(bench *b, double size, double depth, uint32_t level, double goal,
                      double goal_along, uint32_t *lost) {
    double *force = allocate(b->places, sizeof *force), *along = allocate(b->places, sizeof *along);
    uint32_t paths = 0;
    char of[72];
    for (uint32_t i = 0; i < b->places; i++) {
        path_ripple r;
        const double radius = size * b->edge_m;
        if (!slide(b, b->place[i], radius, depth * radius, level, lost, &r)) continue;
        force[paths] = 100 * r.force;
        along[paths++] = 100 * r.along;
    }
    qsort(force, paths, sizeof *force, ascending);
    qsort(along, paths, sizeof *along, ascending);
    snprintf(of, sizeof of, "level %u, tool %g edges, depth %g R, %u paths", level, size, depth,
             paths);
    if (paths > 0) {
        feel_add(&b->table, "ripple", of, force[paths / 2], "% rms", (double)NAN, goal);
        feel_add(&b->table, "ripple, worst path", of, force[paths - 1], "% rms", NAN, NAN);
        feel_add(&b->table, "ripple, tangential", of, along[paths / 2], "% rms", NAN, goal_along);
    }
    free(force);
    free(along);
}

static void ripple(bench *b) {
    static const double size[] = {0.75, 1.5, 3, 6}, depth[] = {0.03, 0.1, 0.3},
                        goal[] = {2, 0.7, 0.3};
    uint32_t lost = 0;
    for (size_t s = 0; s < 4; s++) {
        for (size_t d = 0; d < 3; d++)
            ripple_of(b, size[s], depth[d], PALP_CONTACT_FINEST, goal[d], 0.2, &lost);
    }
    for (uint32_t l = 0; l < PALP_CONTACT_FINEST; l++) {
        for (size_t s = 1; s < 4; s++) ripple_of(b, size[s], 0.1, l, 2, NAN, &lost);
    }
    feel_add(&b->table, "contact lost", "on all these paths", lost, "ticks", (double)NAN, 0);
}

static void levels(bench *b) {
    static const double goal[PALP_CONTACT_LEVELS] = {4, 4, 4, 2, 2};
    const press_errors e = press_levels(b->blob, b->place, b->places);
    for (uint32_t l = 0; l + 1 < PALP_CONTACT_LEVELS; l++) {
        char of[72];
        snprintf(of, sizeof of, "level %u against %u, tools of 1 to 6 edges", l,
                 PALP_CONTACT_LEVELS - 1u);
        feel_add(&b->table, "level, mean", of, 100 * e.mean[l], "%", FORCE_THRESHOLD, goal[l]);
        feel_add(&b->table, "level, worst", of, 100 * e.worst[l], "%", FORCE_THRESHOLD, NAN);
    }
}

/* Largest change of the force in a tick over the largest ordinary one: the median of the ticks
 * about it. 1 where the force is smooth. */
static double largest_jump(const palp_vec3 *f, int count) {
    enum { BESIDE = 8 };
    double *step = allocate((size_t)count, sizeof *step), ordinary = 0, most = 0;
    for (int k = 1; k < count; k++) step[k] = (double)palp_norm(palp_sub(f[k], f[k - 1]));
    for (int k = 1 + BESIDE; k + BESIDE < count; k++) {
        double about[2 * BESIDE + 1];
        memcpy(about, step + k - BESIDE, sizeof about);
        qsort(about, 2 * BESIDE + 1, sizeof *about, ascending);
        ordinary = fmax(ordinary, about[BESIDE]);
        most = fmax(most, step[k]);
    }
    free(step);
    return ordinary > 0 ? most / ordinary : HUGE_VAL;
}

/* Presses and slides where contact is hard; the press against all nodes in double. */
#define HARD_PLACES 4u
#define HARD_EDGES 6.0 /* of the tool: fine enough for the nodes to be right */
#define HARD_DEPTH 0.2 /* over the radius */
#define HARD_TICKS 200 /* of the press, and of the slide */

typedef struct {
    double off, turned_deg, jump;
    bool compared;
} hard_press;

static hard_press press_hard_place(const bench *b, const place *at, double radius) {
    const palp_tool tool = palp_tool_sphere((float)radius);
    palp_contact *c = press_open(b->blob, &tool, 1, PALP_CONTACT_FINEST);
    palp_vec3 side = palp_cross(at->push, (palp_vec3){0.3f, 0.5f, 0.8f});
    side = palp_scale(1.0f / palp_norm(side), side);
    palp_vec3 f[2 * HARD_TICKS], held = {0};
    for (int k = 0; k < 2 * HARD_TICKS; k++) {
        double down = fmin((k + 1.0) / HARD_TICKS, 1) * HARD_DEPTH * radius;
        double aside = fmax((k + 1.0) / HARD_TICKS - 1, 0) * HARD_DEPTH * radius;
        palp_vec3 where = palp_madd(at->at_m, (float)down, at->push);
        press_hold(c, palp_madd(where, (float)aside, side), 1);
        f[k] = c->force_N[0];
        if (k + 1 == HARD_TICKS) held = where;
    }
    press_close(c);
    const double center[3] = {(double)held.x, (double)held.y, (double)held.z};
    const nodal_press truth = nodal_hold(b->blob, center, radius);
    const palp_vec3 felt = f[HARD_TICKS - 1];
    const palp_vec3 right = {(float)truth.force_N[0], (float)truth.force_N[1],
                             (float)truth.force_N[2]};
    const double size = (double)palp_norm(right), along = (double)palp_dot(felt, right);
    hard_press p = {.compared = truth.settled && size > 0, .jump = largest_jump(f, 2 * HARD_TICKS)};
    p.off = fabs((double)palp_norm(felt) / size - 1);
    p.turned_deg = 180;
    if (palp_norm(felt) > 0)
        p.turned_deg =
            acos(fmax(fmin(along / (size * (double)palp_norm(felt)), 1), -1)) * 180 / acos(-1.0);
    return p;
}

static void hard_places(bench *b) {
    static const char *const name[PLACE_KINDS] = {"tips", "valleys", "two regions"};
    const double radius = HARD_EDGES * b->edge_m;
    for (place_kind kind = PLACE_TIP; kind < PLACE_KINDS; kind++) {
        place at[HARD_PLACES];
        uint32_t found = places_find(b->blob, kind, radius, HARD_DEPTH * radius, at, HARD_PLACES);
        double mean = 0, worst = 0, turned = 0, jump = 0;
        uint32_t used = 0;
        for (uint32_t i = 0; i < found; i++) {
            hard_press p = press_hard_place(b, &at[i], radius);
            jump = fmax(jump, p.jump);
            if (!p.compared) continue;
            used++;
            mean += p.off;
            worst = fmax(worst, p.off);
            turned = fmax(turned, p.turned_deg);
        }
        if (found == 0) continue;
        char of[72];
        snprintf(of, sizeof of, "%s, tool %g edges, depth %g R, %u places", name[kind], HARD_EDGES,
                 HARD_DEPTH, used);
        if (used > 0) {
            feel_add(&b->table, "against all nodes, mean", of, 100 * mean / used, "%",
                     FORCE_THRESHOLD, 7);
            feel_add(&b->table, "against all nodes, worst", of, 100 * worst, "%", FORCE_THRESHOLD,
                     NAN);
            feel_add(&b->table, "direction, worst", of, turned, "deg", NAN, NAN);
        }
        feel_add(&b->table, "largest step", of, jump, "times", NAN, 1.5);
    }
}

/* ---- a hand in virtual time ---- */

/* A script: approach, press, hold, slide, hold, leave; device places at 1 kHz. */
#define SCRIPT_TICKS 1400
typedef struct {
    palp_answer answer;
    palp_tool tool;
    void *memory;
    size_t bytes;
    uint64_t base_ns, base_work;
    uint32_t looks, leap_at; /* clock readings in this tick; at which it leaps, 0: never */
    uint64_t leap_ns;
    double ns_per_operation;
} hand;

static uint64_t virtual_ns(void *context) {
    hand *h = context;
    double work = (double)(h->answer.contact.work_done - h->base_work);
    if (h->leap_at > 0 && ++h->looks == h->leap_at) h->base_ns += h->leap_ns;
    return h->base_ns + (uint64_t)(work * h->ns_per_operation);
}

static hand *open_hand(bench *b, double radius, double ns_per_operation, double stiffness) {
    hand *h = allocate(1, sizeof *h);
    h->tool = palp_tool_sphere((float)radius);
    h->ns_per_operation = ns_per_operation;
    const palp_answer_config config = {
        .blob = b->blob,
        .tools = &h->tool,
        .tool_count = 1,
        .finest = PALP_CONTACT_FINEST,
        .cost = {&palp_target_counted, (float)ns_per_operation, 0, (float)MARGIN},
        .port = {virtual_ns, h},
        .dt_s = (float)(1 / RATE_HZ)};
    h->bytes = palp_answer_memsize(b->blob, 1, PALP_CONTACT_FINEST);
    h->memory = allocate_aligned(h->bytes, 1);
    float bound = 0;
    palp_status status = palp_answer_init(&h->answer, &config, h->memory, h->bytes, &bound);
    if (status != PALP_OK) {
        free(h->memory);
        free(h);
        return NULL;
    }
    h->answer.coupling.tool[0].stiffness_N_per_m = (float)stiffness;
    return h;
}

static void close_hand(hand *h) {
    free(h->memory);
    free(h);
}

static palp_coupling_result tick(hand *h, palp_vec3 device, palp_answer_report *report) {
    palp_coupling_result result;
    palp_answer_report r;
    h->looks = 0;
    h->base_work = h->answer.contact.work_done;
    uint64_t start = virtual_ns(h);
    palp_answer_tick(&h->answer, start, &device, &result, &r);
    h->base_ns += 1000000;
    if (report != NULL) *report = r;
    return result;
}

/* Where the device is; `depth` of the press in the model. */
typedef struct {
    palp_vec3 at[SCRIPT_TICKS];
} script;

static script write_script(bench *b, uint32_t node, double radius, double depth) {
    script s;
    palp_tool tool = palp_tool_sphere((float)radius);
    palp_contact *c = press_open(b->blob, &tool, 1, 0);
    palp_surface_point p = press_start(c, node);
    palp_vec3 along = {0.5f, 0.2f, 0.7f};
    for (int i = 0; i < SCRIPT_TICKS; i++) {
        double t = i / (double)SCRIPT_TICKS, down;
        down = t < 0.2 ? t / 0.2 : t < 0.85 ? 1 : (1 - t) / 0.15;
        down = down * down * (3 - 2 * down);
        if (t > 0.35 && t < 0.7) {
            along = palp_madd(along, -palp_dot(along, p.n), p.n);
            along = palp_scale(1.0f / palp_norm(along), along);
            palp_vec3 y = palp_madd(p.y, (float)(2 * b->edge_m / (0.35 * SCRIPT_TICKS)), along);
            (void)press_point(c, palp_madd(y, (float)b->edge_m, p.n), p.n, &p);
        }
        s.at[i] = palp_madd(p.y, (float)(1.3 * radius - down * (0.3 * radius + depth)), p.n);
    }
    press_close(c);
    return s;
}

typedef struct {
    palp_vec3 force[SCRIPT_TICKS];
    double largest, step;
    uint32_t held, coarsest;
} felt;

/* Largest change of the force from tick to tick. */
static double largest_step(const palp_vec3 *f, int from, int to) {
    float most = 0;
    for (int i = from > 0 ? from : 1; i < to; i++) {
        palp_vec3 d = palp_sub(f[i], f[i - 1]);
        if (palp_dot(d, d) > most) most = palp_dot(d, d);
    }
    return sqrt((double)most);
}

static double largest_difference(const palp_vec3 *a, const palp_vec3 *b) {
    float most = 0;
    for (int i = 0; i < SCRIPT_TICKS; i++) {
        palp_vec3 d = palp_sub(a[i], b[i]);
        if (palp_dot(d, d) > most) most = palp_dot(d, d);
    }
    return sqrt((double)most);
}

static felt feel_script(hand *h, const script *s) {
    felt f = {.coarsest = PALP_CONTACT_LEVELS};
    for (int i = 0; i < SCRIPT_TICKS; i++) {
        palp_answer_report r;
        f.force[i] = tick(h, s->at[i], &r).force_N;
        f.largest = fmax(f.largest, (double)palp_norm(f.force[i]));
        f.held += r.held;
        if (r.level < f.coarsest) f.coarsest = r.level;
    }
    f.step = largest_step(f.force, 0, SCRIPT_TICKS);
    return f;
}

/* One tick of the script is disturbed, each in its turn, from a copy of the state before it. */
static void disturb(bench *b, const char *name, uint64_t leap_ns, uint32_t leap_at, double radius,
                    double depth, double stiffness) {
    hand *h = open_hand(b, radius, NS_PER_OPERATION, stiffness);
    if (h == NULL) die(EXIT_WORK, "the body does not fit %g Hz here", RATE_HZ);
    script s = write_script(b, b->place[0], radius, depth);
    felt plain = feel_script(h, &s);
    close_hand(h);
    h = open_hand(b, radius, NS_PER_OPERATION, stiffness);
    hand kept;
    uint8_t *memory = allocate_aligned(h->bytes, 1);
    double off = 0, step = 0;
    uint32_t runs = 0, changed = 0, held = 0;
    progress_begin(name, SCRIPT_TICKS);
    for (int i = 0; i < SCRIPT_TICKS; i++) {
        if ((uint32_t)i % b->spec->every == 0) {
            palp_vec3 force[AFTER_TICKS + 2];
            memcpy(memory, h->memory, h->bytes);
            kept = *h;
            int k = 0;
            force[k++] = i > 0 ? plain.force[i - 1] : (palp_vec3){0};
            for (; k <= AFTER_TICKS + 1 && i + k - 1 < SCRIPT_TICKS; k++) {
                palp_answer_report r;
                h->leap_at = k == 1 ? leap_at : 0;
                h->leap_ns = leap_ns;
                force[k] = tick(h, s.at[i + k - 1], &r).force_N;
                changed += r.level != h->answer.limit;
                held += r.held;
            }
            double error = (double)palp_norm(palp_sub(force[k - 1], plain.force[i + k - 2]));
            off = fmax(
                off, error / fmax((double)palp_norm(plain.force[i + k - 2]), 0.05 * plain.largest));
            step = fmax(step, largest_step(force, 1, k));
            runs++;
            memcpy(h->memory, memory, h->bytes);
            *h = kept;
        }
        (void)tick(h, s.at[i], NULL);
        progress_add(1);
    }
    progress_end();
    char of[72];
    snprintf(of, sizeof of, "%s, %u moments", name, runs);
    feel_add(&b->table, "off after 100 ms", of, 100 * off, "%", FORCE_THRESHOLD, 2);
    feel_add(&b->table, "largest step", of, step / plain.step, "times", NAN, 1.5);
    feel_add(&b->table, "level changed", of, changed, "ticks", NAN, 0);
    feel_add(&b->table, "went on as foreseen", of, (double)held / runs, "ticks", NAN, NAN);
    free(memory);
    close_hand(h);
}

static void slow(bench *b, double radius, double depth, double stiffness) {
    static const double times[] = {2, 5, 10, 20}, goal[] = {2, 2, 4, 7};
    script s = write_script(b, b->place[0], radius, depth);
    hand *h = open_hand(b, radius, NS_PER_OPERATION, stiffness);
    felt plain = feel_script(h, &s);
    close_hand(h);
    for (size_t k = 0; k < 4; k++) {
        char of[72];
        h = open_hand(b, radius, times[k] * NS_PER_OPERATION, stiffness);
        if (h == NULL) {
            snprintf(of, sizeof of, "%g times: refused at open", times[k]);
            feel_add(&b->table, "slow controller", of, 0, "%", FORCE_THRESHOLD, goal[k]);
            continue;
        }
        uint32_t level = h->answer.limit;
        felt f = feel_script(h, &s);
        double off = largest_difference(f.force, plain.force) / plain.largest;
        snprintf(of, sizeof of, "%g times, level %u, %u ticks foreseen", times[k], level, f.held);
        feel_add(&b->table, "slow controller", of, 100 * off, "%", FORCE_THRESHOLD, goal[k]);
        close_hand(h);
    }
}

/* The device jumps into the body; the force must come to be that of a slow press. */
static void teleport(bench *b, double radius, double depth, double stiffness) {
    double worst = 0;
    const uint32_t places = b->places < 8 ? b->places : 8;
    for (uint32_t i = 0; i < places; i++) {
        hand *h = open_hand(b, radius, NS_PER_OPERATION, stiffness);
        palp_contact *c = &h->answer.contact;
        palp_surface_point p = press_start(c, b->place[i]);
        palp_vec3 in = palp_madd(p.y, (float)(radius - depth), p.n);
        palp_vec3 out = palp_madd(p.y, (float)(1.5 * radius), p.n), slow_force = {0}, fast = {0};
        for (int k = 0; k <= 400; k++)
            slow_force =
                tick(h, palp_madd(out, palp_min((float)k / 300.0f, 1.0f), palp_sub(in, out)), NULL)
                    .force_N;
        for (int k = 0; k < 100; k++) (void)tick(h, out, NULL);
        for (int k = 0; k < 200; k++) fast = tick(h, in, NULL).force_N;
        worst =
            fmax(worst, (double)(palp_norm(palp_sub(fast, slow_force)) / palp_norm(slow_force)));
        close_hand(h);
    }
    feel_add(&b->table, "teleport", "into the body, after 200 ms, worst of 8", 100 * worst, "%",
             FORCE_THRESHOLD, 2);
}

/* Net work over a closed path of a rigid tool about a place, over what is stored on it. */
static double closed_path(const bench *b, uint32_t node, uint32_t level) {
    static const int ticks = 4000;
    double radius = 2 * b->edge_m, depth = 0.15 * radius, work = 0, stored = 0;
    palp_tool tool = palp_tool_sphere((float)radius);
    palp_contact *c = press_open(b->blob, &tool, 1, level);
    palp_surface_point p = press_start(c, node);
    palp_vec3 t = {0.3f, 0.5f, 0.8f}, before_m = {0}, before_N = {0};
    t = palp_madd(t, -palp_dot(t, p.n), p.n);
    t = palp_scale(1.0f / palp_norm(t), t);
    palp_vec3 t2 = palp_cross(p.n, t);
    for (int k = 0; k <= 2 * ticks; k++) {
        double q = 2 * acos(-1.0) * k / ticks;
        palp_vec3 at = palp_madd(p.y, (float)(radius - depth * (1 + 0.5 * sin(2 * q))), p.n);
        at = palp_madd(at, (float)(0.3 * radius * cos(q)), t);
        at = palp_madd(at, (float)(0.3 * radius * sin(q)), t2);
        press_hold(c, at, 1);
        if (k > ticks) {
            palp_vec3 mean = palp_scale(0.5f, palp_add(before_N, c->force_N[0]));
            work += (double)palp_dot(mean, palp_sub(at, before_m));
            stored = fmax(stored, (double)c->energy_J);
        }
        before_m = at;
        before_N = c->force_N[0];
    }
    press_close(c);
    return work / stored;
}

/* Both signs: what is lost one way round is given the other. */
static void closed_paths(bench *b) {
    const uint32_t paths = b->places < 10 ? b->places : 10;
    for (uint32_t l = 0; l < PALP_CONTACT_LEVELS; l++) {
        double given[10] = {0}, worst = 0;
        for (uint32_t i = 0; i < paths; i++) {
            given[i] = fabs(closed_path(b, b->place[i], l));
            worst = fmax(worst, given[i]);
        }
        qsort(given, paths, sizeof *given, ascending);
        char of[72];
        snprintf(of, sizeof of, "level %u, work over stored, %u paths", l, paths);
        feel_add(&b->table, "closed path, median", of, given[paths / 2], "1", NAN, 1e-4);
        feel_add(&b->table, "closed path, worst", of, worst, "1", NAN, 1e-4);
    }
}

static void touch_and_release(bench *b, double radius, double depth, double stiffness) {
    hand *h = open_hand(b, radius, NS_PER_OPERATION, stiffness);
    palp_surface_point p = press_start(&h->answer.contact, b->place[0]);
    const double speed = 0.1 / RATE_HZ;
    double first = 0, last = 0, largest = 0, pull = 0;
    palp_vec3 force = {0};
    int ticks = (int)((0.2 * radius + depth) / speed);
    for (int k = 0; k < 2 * ticks; k++) {
        double down = speed * (k < ticks ? k : 2 * ticks - k);
        palp_vec3 at = palp_madd(p.y, (float)(1.2 * radius - down), p.n);
        double before = (double)palp_norm(force);
        force = tick(h, at, NULL).force_N;
        double now = (double)palp_norm(force);
        if (!(before > 0) && now > 0) first = now;
        if (!(now > 0) && before > 0) last = before;
        largest = fmax(largest, now);
        pull = fmax(pull, -(double)palp_dot(force, p.n));
    }
    feel_add(&b->table, "first touch", "0.1 m/s, first force over the largest",
             100 * first / largest, "%", NAN, NAN);
    feel_add(&b->table, "release", "0.1 m/s, last force over the largest", 100 * last / largest,
             "%", NAN, NAN);
    feel_add(&b->table, "pull", "largest against the surface, over the largest",
             100 * pull / largest, "%", NAN, 0.1);
    close_hand(h);
}

int command_feel(int argc, char **argv) {
    feel_spec spec = {.places = PLACES, .every = 20};
    args_parse(argc, argv, options, help, set_option, &spec);
    if (spec.blob == NULL) die(EXIT_USAGE, "no blob named (--help shows the usage)");
    palp_blob blob = load_blob(spec.blob);
    if (blob.regular.modes == 0)
        die(EXIT_WORK, "%s: has no modes for contact on its surface: bake it again", spec.blob);
    bench b = {.blob = &blob, .spec = &spec, .edge_m = (double)blob.meta->mean_edge_m, .seed = 7};
    if (spec.folder != NULL && mkdir(spec.folder, 0777) != 0) {
        struct stat status;
        if (stat(spec.folder, &status) != 0 || !S_ISDIR(status.st_mode))
            die(EXIT_USAGE, "cannot make the folder %s", spec.folder);
    }
    choose_places(&b, 3);
    double radius = 2 * b.edge_m, depth = 0.5 * radius;
    double stiffness = 2 * (double)blob.meta->stiffness_max_N_per_m;
    against_hertz(&b);
    ripple(&b);
    levels(&b);
    hard_places(&b);
    closed_paths(&b);
    touch_and_release(&b, radius, depth, stiffness);
    disturb(&b, "stall of 3 ms in the tick", 3000000, 3, radius, depth, stiffness);
    disturb(&b, "600 us late", 600000, 2, radius, depth, stiffness);
    slow(&b, radius, depth, stiffness);
    teleport(&b, radius, depth, stiffness);
    if (spec.folder != NULL) {
        char path[4096];
        snprintf(path, sizeof path, "%s/feel.json", spec.folder);
        output out = open_output(path);
        feel_json(out.file, &b.table);
        commit_output(&out);
        snprintf(path, sizeof path, "%s/feel.html", spec.folder);
        out = open_output(path);
        feel_html(out.file, &b.table);
        commit_output(&out);
    }
    (spec.json ? feel_json : feel_text)(stdout, &b.table);
    free(b.place);
    free(b.table.row);
    return EXIT_SUCCESS;
}
