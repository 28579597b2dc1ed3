/* SPDX-License-Identifier: MIT */
/* palp wcet --hunt: which path over a body does most in one tick. */
#include "port/host/args.h"
#include "tools/wcet/tool_path.h"
#include "port/host/util.h"
#include "tools/wcet/wcet.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TICKS 200
#define CHILL_BYTES (32u << 20)

/* The most expensive tick of a level, by the prices of the target, and how long it took here. */
typedef struct {
    path_tick tick;
    double instructions;
    tool_path path;
} costliest;

typedef struct {
    palp_contact_cost cost;
    costliest of[PALP_CONTACT_LEVELS];
    double best;           /* of the path under way */
    double longest_ns;     /* of any of its ticks, by the clock */
    const tool_path *path; /* under way */
    bool print;
    uint64_t ticks;
} search_state;

static uint64_t clock_ns(void *context) {
    (void)context;
    return (uint64_t)(now_s() * 1e9);
}

static void told(void *context, const path_tick *tick) {
    search_state *h = context;
    double instructions = (double)path_bound(&h->cost, tick);
    h->ticks++;
    h->longest_ns = fmax(h->longest_ns, (double)tick->cost);
    h->best = fmax(h->best, instructions);
    if (h->print)
        printf("%" PRIu64 ",%u,%u,%u,%u,%u,%.0f\n", h->ticks - 1, tick->level,
               tick->filled.fillings, tick->points, tick->active, tick->iterations, instructions);
    if (instructions > h->of[tick->level].instructions)
        h->of[tick->level] = (costliest){*tick, instructions, *h->path};
}

static search *make_search(const wcet_spec *s, const machine *m, const palp_blob *blob,
                           search_state *state) {
    search *h = allocate(1, sizeof *h);
    palp_tool ball = palp_tool_sphere(6.5f * blob->meta->mean_edge_m); /* the largest there is */
    ball.friction = s->friction ? 0.3f : 0.0f;
    *h = (search){.blob = blob,
                  .level = PALP_CONTACT_FINEST,
                  .friction = s->friction,
                  .port = {.now_ns = clock_ns},
                  .bytes = palp_answer_memsize(&(palp_contact_config){
                      .blob = blob, .tool_count = 1, .finest = PALP_CONTACT_FINEST}),
                  .told = told,
                  .context = state};
    h->memory = allocate_aligned(h->bytes, 1);
    state->cost = palp_contact_cost_of(blob, &ball, 1, &m->target.instructions);
    return h;
}

static void run(search *h, search_state *state, const tool_path *path) {
    state->path = path;
    state->best = 0;
    if (!path_run(h, path, TICKS)) die(EXIT_WORK, "the body cannot be touched: bake it again");
}

static void keep_path(const char *file, const costliest *d) {
    output out = open_output(file);
    const tool_path *p = &d->path;
    fprintf(out.file,
            "# the path of the most expensive tick that palp wcet --hunt found (--replay goes "
            "along it)\n"
            "dwell %u\nradius %.9g\nstiffness %.9g\nsunk %.9g\nswing %.9g\ntremble %.9g\nfar %.9g\n"
            "seed %" PRIu64 "\n",
            p->dwell, (double)p->radius, (double)p->stiffness, (double)p->sunk, (double)p->swing,
            (double)p->tremble, (double)p->far, p->seed);
    commit_output(&out);
}

static uint8_t *other; /* what the caches are filled with */
static void chill(void) {
    for (size_t i = 0; i < CHILL_BYTES; i += 64) other[i]++;
}

void wcet_search(const wcet_spec *spec, const machine *m, const palp_blob *blob) {
    search_state *state = allocate(1, sizeof *state);
    search *h = make_search(spec, m, blob, state);
    dice d = {1};
    const double each_s = spec->search_s / (PALP_CONTACT_FINEST + 1);
    tool_path best = path_random(&d);
    uint32_t paths = 0;
    for (uint32_t l = 0; l <= PALP_CONTACT_FINEST; l++) {
        double until = now_s() + each_s, most = 0;
        h->level = l;
        for (uint32_t i = 0; i == 0 || now_s() < until; i++, paths++) {
            tool_path p = i % 3 == 0 ? path_random(&d) : path_mutated(best, &d);
            run(h, state, &p);
            if (state->best <= most) continue;
            most = state->best;
            best = p;
        }
    }
    fprintf(stderr,
            "searched %" PRIu64 " ticks on %u paths; what was done, at the target's prices:\n",
            state->ticks, paths);
    for (uint32_t l = 0; l <= PALP_CONTACT_FINEST; l++) {
        const costliest *w = &state->of[l];
        double bound = (double)palp_answer_cost_full(&state->cost, l);
        fprintf(stderr,
                "  level %u: %.0f of at most %.0f instructions (%.2f): %u fillings, %u points, %u "
                "in contact, %u iterations\n",
                l, w->instructions, bound, w->instructions / bound, w->tick.filled.fillings,
                w->tick.points, w->tick.active, w->tick.iterations);
    }
    state->longest_ns = 0;
    run(h, state, &best);
    double warm = state->longest_ns;
    other = allocate(CHILL_BYTES, 1);
    h->chill = chill;
    state->longest_ns = 0;
    run(h, state, &best);
    fprintf(stderr,
            "  the most expensive path again on this machine: longest tick %.0f us, with caches "
            "filled by "
            "other data before every tick %.0f us (measured, no bound)\n",
            warm * 1e-3, state->longest_ns * 1e-3);
    if (spec->keep != NULL) keep_path(spec->keep, &state->of[PALP_CONTACT_FINEST]);
    free(other);
    free(h->memory);
    free(h);
    free(state);
}

/* ---- a kept path ---- */

static const option keys[] = {{"--dwell", 1}, {"--radius", 1}, {"--stiffness", 1},
                              {"--sunk", 1},  {"--swing", 1},  {"--tremble", 1},
                              {"--far", 1},   {"--seed", 1},   {NULL, 0}};

static void set_key(void *context, const argument *a) {
    tool_path *p = context;
    if (a->option == NULL) die(EXIT_WORK, "%s: not a path of palp wcet --keep", a->where);
    if (strcmp(a->option, "--dwell") == 0) {
        p->dwell = arg_u32(a, 0, 1, 1000000);
    } else if (strcmp(a->option, "--seed") == 0) {
        char *end;
        p->seed = strtoull(a->value[0], &end, 10);
        if (end == a->value[0] || *end != '\0') die(EXIT_WORK, "%s: not a whole number", a->where);
    } else {
        const struct {
            const char *name;
            float *value;
        } field[] = {{"--radius", &p->radius}, {"--stiffness", &p->stiffness}, {"--sunk", &p->sunk},
                     {"--swing", &p->swing},   {"--tremble", &p->tremble},     {"--far", &p->far}};
        for (size_t i = 0; i < sizeof field / sizeof field[0]; i++) {
            if (strcmp(a->option, field[i].name) == 0) *field[i].value = (float)arg_double(a, 0);
        }
    }
}

int wcet_replay(const wcet_spec *spec, const machine *m, const palp_blob *blob) {
    tool_path path = {.dwell = 0};
    args_parse_file(spec->replay, keys, set_key, &path);
    if (path.dwell == 0 || !(path.radius > 0) || !(path.stiffness > 0))
        die(EXIT_WORK, "%s: no path of palp wcet --keep: dwell, radius and stiffness are missing",
            spec->replay);
    search_state *state = allocate(1, sizeof *state);
    search *h = make_search(spec, m, blob, state);
    state->print = true;
    printf("tick,level,fillings,points,active,iterations,instructions_max\n");
    run(h, state, &path);
    free(h->memory);
    free(h);
    free(state);
    return EXIT_SUCCESS;
}
