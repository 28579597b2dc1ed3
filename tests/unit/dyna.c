/* SPDX-License-Identifier: MIT */
/* Elements, steps and interfaces of dynamic bodies, against energies in double, conservation laws
 * and exact solutions. */
#include "core/dyna/adapt.h"
#include "core/dyna/skin.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

#define YOUNG 2e4
static const palp_vec3 no_gravity = {0, 0, 0};

static palp_material material(double young, double poisson, double damping_s) {
    return palp_material_of((float)young, (float)poisson, 1000.0f, (float)damping_s, 0.0f);
}

/* ---- elements ---- */

/* Stored energy of a tetrahedron in double, from the texts of element.h. */
static double energy(double u[4][3], double b[3][3], double volume, const palp_material *m) {
    double d[3][3], eps[3][3], trace = 0, square = 0;
    double lambda = (double)m->lambda_Pa, mu = (double)m->mu_Pa;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            d[i][j] = i == j;
            for (int k = 0; k < 3; k++) d[i][j] += (u[k + 1][i] - u[0][i]) * b[k][j];
        }
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            eps[i][j] = i == j ? -1 : 0;
            for (int a = 0; a < 3; a++) eps[i][j] += d[a][i] * d[a][j];
            square += eps[i][j] * eps[i][j];
        }
        trace += eps[i][i];
    }
    double det = d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) -
                 d[0][1] * (d[1][0] * d[2][2] - d[1][2] * d[2][0]) +
                 d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
    double under = fmax(0, (double)PALP_CRUSHED - det);
    double plain = lambda / 8 * trace * trace + mu / 4 * square +
                   (double)PALP_WALL * (lambda + 2 * mu) / 2 * under * under;
    double most = (double)PALP_YIELDING * (lambda + 2 * mu);
    return volume * 2 * most * (sqrt(1 + plain / most) - 1);
}

static void check_elements(void) {
    uint64_t seed = 5;
    palp_material m = material(YOUNG, 0.4, 0);
    double worst_force = 0, worst_energy = 0, worst_sum = 0;
    static palp_element_lanes e;
    for (int round = 0; round < 200; round++) {
        double u[PALP_LANES][4][3], b[PALP_LANES][3][3], size = round % 4 == 0 ? 1.5 : 0.3;
        for (uint32_t k = 0; k < PALP_LANES; k++) {
            for (int i = 0; i < 12; i++) {
                double v = 0.01 * size * tap_random(&seed);
                u[k][i / 3][i % 3] = (double)(float)v;
                e.u[i / 3][i % 3][k] = (float)v;
                e.v[i / 3][i % 3][k] = 0.0f;
            }
            for (int i = 0; i < 9; i++) {
                double v = 50 * tap_random(&seed) + (i % 4 == 0 ? 100 : 0);
                b[k][i / 3][i % 3] = (double)(float)v;
                e.b[i][k] = (float)v;
            }
            e.volume[k] = 1e-7f;
        }
        palp_element_forces(&e, &m);
        for (uint32_t k = 0; k < PALP_LANES; k++) {
            double scale = 0, off = 0, volume = (double)e.volume[k];
            double stored = energy(u[k], b[k], volume, &m);
            for (int i = 0; i < 12; i++) {
                double *at = &u[k][i / 3][i % 3], here = *at, h = 1e-7;
                *at = here + h;
                double high = energy(u[k], b[k], volume, &m);
                *at = here - h;
                double low = energy(u[k], b[k], volume, &m);
                *at = here;
                double f = -(high - low) / (2 * h);
                off = fmax(off, fabs(f - (double)e.f[i / 3][i % 3][k]));
                scale = fmax(scale, fabs(f));
            }
            worst_force = fmax(worst_force, off / scale);
            worst_energy = fmax(worst_energy, fabs(stored - (double)e.energy_J[k]) / stored);
            for (int a = 0; a < 3; a++)
                worst_sum =
                    fmax(worst_sum,
                         fabs((double)(e.f[0][a][k] + e.f[1][a][k] + e.f[2][a][k] + e.f[3][a][k])) /
                             scale);
        }
    }
    AT_MOST(worst_force, 5e-5, "forces are minus the gradient of the energy, crushed or not");
    AT_MOST(worst_energy, 1e-5, "energy");
    AT_MOST(worst_sum, 1e-6, "the four forces add to zero");
}

/* ---- bodies ---- */

static dynamic_body make(uint32_t levels, double below, double poisson) {
    static const double size[3] = {0.08, 0.04, 0.04};
    static const uint32_t n[3][3] = {{3, 2, 2}, {7, 4, 4}, {13, 7, 7}};
    tetmesh level[3];
    for (uint32_t l = 0; l < levels; l++) level[l] = tetmesh_block(size, n[l], l % 2 == 1);
    return model_dynamic_body(level, levels, below, YOUNG, poisson, 0);
}

static void set(float *at, double x, double y, double z) {
    at[0] = (float)x;
    at[1] = (float)y;
    at[2] = (float)z;
}

/* Largest force on a node over what a clamp would have to bear at strain 1. */
static double force_share(const palp_dyna *d, bool inside_only) {
    double worst = 0;
    for (uint32_t i = 0; i < d->active_count; i++) {
        uint32_t n = d->active[i];
        const float *x = d->tets->rest_m + 3 * n;
        bool inside = x[0] > 1e-6f && x[0] < 0.0799f && x[1] > 1e-6f && x[1] < 0.0399f &&
                      x[2] > 1e-6f && x[2] < 0.0399f;
        if (inside_only && !inside) continue;
        double h = (double)d->tets->node[n].near_m;
        worst = fmax(worst, (double)palp_norm(palp_vec3_at(d->force_N + 3 * n)) / (YOUNG * h * h));
    }
    return worst;
}

static void place_affinely(palp_dyna *d, const double a[9], const double shift[3]) {
    for (uint32_t i = 0; i < d->active_count; i++) {
        uint32_t n = d->active[i];
        const float *x = d->tets->rest_m + 3 * n;
        double y[3];
        for (int k = 0; k < 3; k++)
            y[k] = shift[k] + a[3 * k] * (double)x[0] + a[3 * k + 1] * (double)x[1] +
                   a[3 * k + 2] * (double)x[2] - (double)x[k];
        set(d->u_m + 3 * n, y[0], y[1], y[2]);
    }
    palp_dyna_interpolate(d);
}

/* Splits what lies at x below `end`, one level deeper below half of that. */
static void refine_part(palp_dyna *d, float end) {
    const palp_tets *t = d->tets;
    for (uint32_t l = 0; l + 1 < t->meta->levels; l++, end *= 0.5f) {
        for (uint32_t f = t->meta->first_family[l]; f < t->meta->first_family[l + 1]; f++) {
            uint32_t p = t->parent[t->parent_offset[f]];
            if (d->state[p] != PALP_ACTIVE || !(t->rest_m[3 * p] < end)) continue;
            for (uint32_t k = t->child_offset[f]; k < t->child_offset[f + 1]; k++)
                if (!palp_dyna_pinned(d, t->child[k])) palp_dyna_embed(d, t->child[k]);
            d->split[f] = 1;
        }
        palp_dyna_relist(d);
    }
}

static void check_patch(void) {
    dynamic_body b = make(3, -1, 0.4);
    palp_dyna *d = model_dyna(&b.tets, material(YOUNG, 0.4, 0), 1e-3f, no_gravity);
    refine_part(d, 0.045f);
    uint32_t states[3] = {0, 0, 0};
    for (uint32_t i = 0; i < b.tets.meta->nodes; i++) states[d->state[i]]++;
    CHECK(states[PALP_SPLIT] > 10 && d->up_count > 0 && d->down_count > 0 &&
              d->class_start[1] < d->element_count,
          "three levels side by side: %u active, %u split, %u followers up, %u down, %u steps",
          d->active_count, states[PALP_SPLIT], d->up_count, d->down_count, palp_dyna_steps(d, 7));
    const double stretch[9] = {1.2, 0.1, 0, -0.05, 0.9, 0.2, 0.1, 0, 1.05}, shift[3] = {1, 2, 3};
    place_affinely(d, stretch, shift);
    double off = 0;
    for (uint32_t i = 0; i < b.tets.meta->nodes; i++) {
        if (d->needed[i] == 0) continue;
        const float *x = b.tets.rest_m + 3 * i;
        for (int k = 0; k < 3; k++) {
            double y = shift[k] + stretch[3 * k] * (double)x[0] +
                       stretch[3 * k + 1] * (double)x[1] + stretch[3 * k + 2] * (double)x[2];
            off = fmax(off, fabs(y - (double)x[k] - (double)d->u_m[3 * i + (uint32_t)k]));
        }
    }
    AT_MOST(off / 0.08, 5e-5, "interface nodes of an affine motion, of the length");
    palp_dyna_forces(d, 0, palp_dyna_steps(d, 7));
    AT_MOST(force_share(d, true), 3e-4, "patch test: elements around nodes inside are in balance");
    double outside = force_share(d, false);
    CHECK(outside > 0.05, "while its surface is loaded: %.3g", outside);
    double seam = 0;
    for (uint32_t i = 0; i < d->active_count; i++) {
        uint32_t n = d->active[i];
        const float *x = d->tets->rest_m + 3 * n;
        double h = (double)d->tets->node[n].near_m, step = 1e-3;
        for (uint32_t c = d->step_class[n]; c > 0; c--) step /= 2;
        double f = (double)palp_norm(palp_vec3_at(d->impulse_Ns + 3 * n)) / step / (YOUNG * h * h);
        bool inside = x[1] > 1e-6f && x[1] < 0.0399f && x[2] > 1e-6f && x[2] < 0.0399f;
        if (inside && x[0] > 1e-6f && x[0] < 0.07f) seam = fmax(seam, f);
    }
    AT_MOST(seam / outside, 2.5,
            "what interfaces add under that strain, of the largest load on a node of the surface");
    const double c = cos(2), s = sin(2);
    const double turn[9] = {c, -s, 0, s, c, 0, 0, 0, 1}, none[3] = {0, 0, 0};
    place_affinely(d, turn, none);
    palp_dyna_forces(d, 0, palp_dyna_steps(d, 7));
    AT_MOST(force_share(d, false), 1e-4, "rotation by two radians gives no force");
}

/* ---- conservation ---- */

typedef struct {
    double p[3], l[3];
} momenta;

static momenta momenta_of(const palp_dyna *d) {
    momenta m = {{0}, {0}};
    for (uint32_t i = 0; i < d->active_count; i++) {
        uint32_t n = d->active[i];
        double x[3], v[3], mass = (double)d->mass_kg[n];
        for (int k = 0; k < 3; k++) {
            x[k] =
                (double)d->tets->rest_m[3 * n + (uint32_t)k] + (double)d->u_m[3 * n + (uint32_t)k];
            v[k] = mass * (double)d->v_m_s[3 * n + (uint32_t)k];
            m.p[k] += v[k];
        }
        double c[3];
        v_cross(x, v, c);
        for (int k = 0; k < 3; k++) m.l[k] += c[k];
    }
    return m;
}

/* Spin about z, and a bending and stretching motion on top. */
static void set_spinning(palp_dyna *d, double vibration) {
    for (uint32_t i = 0; i < d->active_count; i++) {
        uint32_t n = d->active[i];
        const float *x = d->tets->rest_m + 3 * n;
        double q = (double)x[0] - 0.04;
        set(d->v_m_s + 3 * n, -20 * ((double)x[1] - 0.02) + vibration * q / 0.04, 20 * q,
            vibration * (q * q / 0.0016 - 1.0 / 3));
    }
    palp_dyna_interpolate(d);
}

static void check_momentum(const char *name, bool graded, bool adaptive) {
    dynamic_body b = make(adaptive ? 3 : 2, -1, 0.4);
    if (graded) { /* one dense node: steps of different classes side by side */
        palp_tet_node *n = (palp_tet_node *)(uintptr_t)b.tets.node;
        for (uint32_t i = 0; i < b.tets.meta->first_node[1]; i += 3) n[i].volume_m3 *= 0.1f;
    }
    palp_dyna *d = model_dyna(&b.tets, material(YOUNG, 0.4, 0),
                              graded     ? 5e-3f
                              : adaptive ? 5e-4f
                                         : 2e-3f,
                              no_gravity);
    if (adaptive) refine_part(d, 0.045f);
    uint32_t classes = 0;
    for (uint32_t c = 0; c < PALP_STEP_CLASSES; c++)
        classes += d->class_start[c + 1] > d->class_start[c];
    CHECK(classes >= (graded ? 2u : 1u) && (d->down_count > 0) == adaptive,
          "%s: %u classes of steps, %u interface nodes", name, classes,
          d->up_count + d->down_count);
    double stiffness_ratio = 1;
    for (uint32_t i = 0; i < d->active_count; i++)
        stiffness_ratio = fmax(stiffness_ratio, (double)d->stiffness_ratio[d->active[i]]);
    printf("# %s: interfaces stiffen nodes by %.2f at most\n", name, stiffness_ratio);
    set_spinning(d, 0.2);
    momenta first = momenta_of(d);
    double spin = v_norm(first.l), drift_p = 0, drift_l = 0, mass = 0, speed = 0;
    for (uint32_t i = 0; i < d->active_count; i++) mass += (double)d->mass_kg[d->active[i]];
    speed = 20 * 0.04;
    for (int k = 0; k < 10000; k++) palp_dyna_tick(d, 7);
    momenta last = momenta_of(d);
    for (int k = 0; k < 3; k++) {
        drift_p = fmax(drift_p, fabs(last.p[k] - first.p[k]) / (mass * speed));
        drift_l = fmax(drift_l, fabs(last.l[k] - first.l[k]) / spin);
    }
    AT_MOST(drift_p, 1e-5, "%s: linear momentum after 10,000 ticks", name);
    AT_MOST(drift_l, 1e-3, "%s: angular momentum", name);
}

/* The energy at the beginning of a tick, which is then done: velocities are brought to the time of
 * the positions by half of the first kick. */
static double energy_now(palp_dyna *d) {
    double kinetic = 0, stored = 0;
    float *before = allocate(3 * d->tets->meta->nodes, sizeof *before);
    uint32_t steps = palp_dyna_steps(d, 7);
    for (uint32_t s = 0; s < steps; s++) {
        memcpy(before, d->v_m_s, 3 * d->tets->meta->nodes * sizeof *before);
        palp_dyna_forces(d, s, steps);
        palp_dyna_move(d, steps);
        if (s == 0) stored = (double)d->stored_J;
        for (uint32_t i = 0; s == 0 && i < d->active_count; i++) {
            uint32_t n = d->active[i];
            for (uint32_t k = 3 * n; k < 3 * n + 3; k++)
                kinetic += 0.5 * (double)d->mass_kg[n] * (double)before[k] * (double)d->v_m_s[k];
        }
        palp_dyna_interpolate(d);
    }
    free(before);
    return kinetic + stored;
}

static void check_energy(const char *name, bool adaptive) {
    dynamic_body b = make(3, -1, 0.4);
    palp_dyna *d = model_dyna(&b.tets, material(YOUNG, 0.4, 0), 5e-4f, no_gravity);
    if (adaptive) refine_part(d, 0.045f);
    set_spinning(d, 0.3);
    double first = 0, last = 0, low = HUGE_VAL, high = 0;
    CHECK(adaptive == (d->down_count > 0), "%s: %u steps a tick, %u interface nodes", name,
          palp_dyna_steps(d, 7), d->up_count + d->down_count);
    for (int k = 0; k < 10000; k++) {
        double e = energy_now(d);
        first += k < 1000 ? e / 1000 : 0;
        last += k >= 9000 ? e / 1000 : 0;
        low = fmin(low, e);
        high = fmax(high, e);
    }
    AT_MOST(fabs(last / first - 1), 0.01, "%s: undamped energy over 10,000 steps: drift", name);
    AT_MOST(high / low - 1, 0.05, "%s: and its largest swing", name);
}

/* ---- exact solutions: a bar that hangs by its end, Poisson's ratio 0 ---- */

/* Mean displacement of the end. */
static double end_of(const palp_dyna *d) {
    double sum = 0;
    uint32_t count = 0;
    for (uint32_t i = 0; i < d->tets->meta->nodes; i++) {
        if (d->tets->rest_m[3 * i] < 0.0799f) continue;
        sum += (double)d->u_m[3 * i];
        count++;
    }
    return sum / count;
}

static void check_bar(void) {
    static const double size[3] = {0.08, 0.02, 0.02};
    double sag[2], period[2];
    for (uint32_t fine = 0; fine < 2; fine++) {
        const uint32_t n[3] = {8u << fine, 2u << fine, 2u << fine};
        tetmesh level = tetmesh_block(size, n, false);
        dynamic_body b = model_dynamic_body(&level, 1, 1e-9, YOUNG, 0, 0);
        float tick = 2.5e-4f;
        palp_dyna *d = model_dyna(&b.tets, material(YOUNG, 0, 0.02), tick, (palp_vec3){1, 0, 0});
        for (int k = 0; k < 8000; k++) palp_dyna_tick(d, 7);
        sag[fine] = end_of(d);
        d->config.gravity_m_s2 = no_gravity;
        d->config.material = material(YOUNG, 0, 0);
        for (uint32_t i = 0; i < b.tets.meta->nodes; i++) d->c_N_s_per_m[i] = 0.0f;
        double crossing[2] = {0, 0}; /* released: zeros of the end's displacement, four apart */
        int crossings = 0;
        double before = end_of(d);
        for (int k = 1; k < 8000 && crossings < 9; k++) {
            palp_dyna_tick(d, 7);
            double now = end_of(d);
            if ((before > 0) != (now > 0)) {
                double at = (double)tick * (k - now / (now - before));
                if (crossings == 0) crossing[0] = at;
                crossing[1] = at;
                crossings++;
            }
            before = now;
        }
        period[fine] = (crossing[1] - crossing[0]) / 4;
        palp_dyna_reset(d);
    }
    double exact_sag = 1000.0 * 1 * 0.08 * 0.08 / (2 * YOUNG), wave = sqrt(YOUNG / 1000);
    double exact_period = 4 * 0.08 / wave;
    AT_MOST(fabs(sag[1] / exact_sag - 1), 0.01, "a hanging bar's end against rho g L^2 / (2 E)");
    AT_MOST(fabs(period[0] / exact_period - 1), 0.01, "its period against 4 L sqrt(rho / E)");
    AT_MOST(fabs(period[1] / exact_period - 1), 0.004, "the same on a mesh twice as fine");
}

/* ---- steps beyond the limit, inversion ---- */

static void check_filter(void) {
    dynamic_body b = make(2, 1e-9, 0.45);
    palp_dyna *d = model_dyna(&b.tets, material(1e6, 0.45, 0), 1e-3f, (palp_vec3){0, 0, -9.81f});
    double own = HUGE_VAL;
    for (uint32_t i = 0; i < d->active_count; i++)
        own = fmin(own, (double)d->limit_s[d->active[i]]);
    double largest = 0, late = 0;
    for (int k = 0; k < 20000; k++) {
        palp_dyna_tick(d, 0);
        double e = (double)palp_dyna_kinetic_J(d);
        if (k < 2000)
            largest = fmax(largest, e);
        else
            late = fmax(late, e);
    }
    CHECK(1e-3 / own > 4, "a step of %.1f times the limit", 1e-3 / own);
    AT_MOST(late / largest, 1.15, "kinetic energy later over that of the first swings");
}

/* The smallest det D of the elements at work. */
static double least_det(const palp_dyna *d) {
    double least = HUGE_VAL;
    for (uint32_t i = 0; i < d->element_count; i++) {
        const palp_tet *e = &d->tets->tet[d->element[i]];
        double x[4][3], n[3];
        for (int c = 0; c < 4; c++) {
            palp_vec3 p = palp_dyna_position(d, e->node[c]);
            x[c][0] = (double)p.x, x[c][1] = (double)p.y, x[c][2] = (double)p.z;
        }
        for (int c = 1; c < 4; c++) v_sub(x[c], x[0], x[c]);
        v_cross(x[1], x[2], n);
        least = fmin(least, v_dot(n, x[3]) / 6 / (double)e->volume_m3);
    }
    return least;
}

static void check_inversion(const char *name, double young, double poisson, int how) {
    dynamic_body b = make(2, how == 0 ? -1 : 1e-9, poisson);
    palp_dyna *d = model_dyna(&b.tets, material(young, poisson, 0.01), 1e-3f, no_gravity);
    uint64_t seed = 3;
    for (uint32_t i = 0; i < d->active_count; i++) {
        uint32_t n = d->active[i];
        if (palp_dyna_pinned(d, n)) continue;
        const float *x = d->tets->rest_m + 3 * n;
        if (how == 0) set(d->u_m + 3 * n, -2.0 * (double)x[0], 0, 0); /* mirrored */
        if (how == 1) set(d->u_m + 3 * n, -(double)x[0], 0, 0);       /* flat */
        if (how == 2)                                                 /* stirred */
            set(d->u_m + 3 * n, 0.05 * tap_random(&seed), 0.05 * tap_random(&seed),
                0.05 * tap_random(&seed));
    }
    palp_dyna_interpolate(d);
    double first = least_det(d), whole = YOUNG * 1e-4, left = HUGE_VAL;
    int ticks = 0;
    for (; ticks < 40000 && !(left < 1e-4 * whole * young / YOUNG); ticks++) {
        palp_dyna_tick(d, 7);
        left = (double)d->stored_J;
    }
    double last = least_det(d);
    CHECK(first < 0.01 && last > 0.7 && ticks < 40000,
          "%s: back in shape after %d ticks (smallest det D %.2g, then %.2g)", name, ticks, first,
          last);
}

/* ---- adaptivity ---- */

static void check_adapt(void) {
    dynamic_body b = make(3, 1e-9, 0.4);
    palp_material m = material(YOUNG, 0.4, 0.002);
    m.drag_per_s = 4;
    palp_dyna *d = model_dyna(&b.tets, m, 1e-3f, no_gravity);
    palp_adapt_config c = palp_adapt_defaults(&b.tets);
    palp_adapt a;
    palp_skin skin;
    size_t bytes = palp_adapt_memsize(&b.tets), skin_bytes = palp_skin_memsize(&b.tets);
    CHECK(palp_adapt_init(&a, d, &c, allocate_aligned(bytes, 1), bytes) == PALP_OK &&
              palp_skin_init(&skin, d, allocate_aligned(skin_bytes, 1), skin_bytes) == PALP_OK,
          "open");
    uint32_t splits = 0, merges = 0, most = 0, cap = 6000, refused = 0, at_most = 0;
    double jump = 0, step = 0, fade = 0;
    uint32_t split_apart = 0;
    float *before = allocate(3 * b.tets.meta->skin, sizeof *before);
    for (int k = 0; k < 4500; k++) {
        if (k < 100) { /* the end is thrown */
            for (uint32_t i = 0; i < d->active_count; i++) {
                uint32_t n = d->active[i];
                if (d->tets->rest_m[3 * n] > 0.06f) d->v_m_s[3 * n + 2] = 0.25f;
            }
        }
        palp_dyna_tick(d, 7);
        memcpy(before, skin.position_m, 3 * b.tets.meta->skin * sizeof *before);
        bool renewed = skin.lists != d->lists;
        palp_skin_update(&skin, 1e-3f);
        for (uint32_t i = 0; i < b.tets.meta->skin; i++) {
            double moved = (double)palp_norm(
                palp_sub(palp_vec3_at(skin.position_m + 3 * i), palp_vec3_at(before + 3 * i)));
            double speed = 1e-3 * (double)palp_norm(palp_skin_velocity(d, i));
            step = fmax(step, speed);
            if (renewed) jump = fmax(jump, moved - speed);
            fade = fmax(fade, moved - speed);
        }
        const palp_adapt_room room = {(float)cap - (float)palp_dyna_work(d, 7), 1, 0};
        palp_adapt_report r = palp_adapt_tick(&a, room);
        splits += r.splits;
        merges += r.merges;
        refused += r.refused;
        for (uint32_t f = 0; f < b.tets.meta->families; f++) {
            for (uint32_t q = b.tets.parent_offset[f]; q < b.tets.parent_offset[f + 1]; q++)
                split_apart += d->split[f] != 0 && d->state[b.tets.parent[q]] != PALP_SPLIT;
        }
        uint32_t work = palp_dyna_work(d, 7);
        most = work > most ? work : most;
        at_most = d->active_count > at_most ? d->active_count : at_most;
    }
    CHECK(splits > 3 && merges == splits, "%u families split and merged again", splits);
    CHECK(most <= cap + cap / 4 && refused > 0,
          "about the cap: %u of %u evaluations at most, %u refused", most, cap, refused);
    CHECK(split_apart == 0, "every parent of a split family is split");
    AT_MOST(fmax(jump, 0) / step, 0.2,
            "no popping: surface when families change, beyond its motion, of the largest motion");
    AT_MOST(fade / step, 1, "and while the difference fades");
    double off = 0;
    for (uint32_t i = 0; i < d->active_count; i++)
        off = fmax(off, (double)palp_norm(palp_vec3_at(d->u_m + 3 * d->active[i])));
    AT_MOST(off, 1e-3, "at rest again, on the coarsest mesh (m)");
    free(before);
}

int main(void) {
    check_elements();
    check_patch();
    check_momentum("uniform steps", false, false);
    check_momentum("mixed steps", true, false);
    check_momentum("three levels", false, true);
    check_energy("coarsest mesh", false);
    check_energy("three levels", true);
    check_bar();
    check_filter();
    check_inversion("mirrored, free", 2e4, 0.4, 0);
    check_inversion("flattened", 2e4, 0.4, 1);
    check_inversion("stirred", 2e4, 0.4, 2);
    check_inversion("mirrored, free, soft", 1e2, 0.45, 0);
    check_inversion("stirred, stiff", 1e6, 0.45, 2);
    check_adapt();
    return tap_done();
}
