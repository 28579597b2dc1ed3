/* SPDX-License-Identifier: MIT */
#include "tools/study/oscillate.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

const char *const law_name[LAWS] = {"springs", "Cauchy", "Green"};

typedef struct {
    const tetmesh *m;
    const swing_setup *s;
    double (*x)[3], (*v)[3], (*f)[3], *mass;
    double (*gradient)[4][3], *volume;
    struct spring {
        uint32_t a, b;
        double stiffness, length;
    } * spring;
    size_t springs;
} swinging;

static int by_ends(const void *a, const void *b) {
    const struct spring *p = a, *q = b;
    if (p->a != q->a) return p->a < q->a ? -1 : 1;
    return (p->b > q->b) - (p->b < q->b);
}

static void make_springs(swinging *w) {
    const swing_setup *s = w->s;
    double young = s->mu_Pa * (3 * s->lambda_Pa + 2 * s->mu_Pa) / (s->lambda_Pa + s->mu_Pa);
    w->spring = allocate(6 * (size_t)w->m->tets, sizeof *w->spring);
    for (uint32_t t = 0; t < w->m->tets; t++) {
        for (int i = 0; i < 4; i++) {
            for (int j = 0; j < i; j++) {
                uint32_t a = w->m->t[t][i], b = w->m->t[t][j];
                double length = v_distance(w->m->x[a], w->m->x[b]);
                w->spring[w->springs++] = (struct spring){
                    a < b ? a : b, a < b ? b : a, young * w->volume[t] / (length * length), length};
            }
        }
    }
    qsort(w->spring, w->springs, sizeof *w->spring, by_ends);
    size_t kept = 0;
    for (size_t i = 0; i < w->springs; i++) {
        if (kept > 0 && by_ends(&w->spring[kept - 1], &w->spring[i]) == 0) {
            w->spring[kept - 1].stiffness += w->spring[i].stiffness;
        } else {
            w->spring[kept++] = w->spring[i];
        }
    }
    w->springs = kept;
}

static void pull(swinging *w) {
    for (size_t i = 0; i < w->springs; i++) {
        const struct spring *k = &w->spring[i];
        double d[3];
        v_sub(w->x[k->b], w->x[k->a], d);
        double length = v_norm(d), f = k->stiffness * (length - k->length) / length;
        for (int a = 0; a < 3; a++) {
            w->f[k->a][a] += f * d[a];
            w->f[k->b][a] -= f * d[a];
        }
    }
}

/* D or its rate: sum of y_k b_k^T. */
static void gradient_of(const swinging *w, uint32_t t, double (*y)[3], double d[3][3]) {
    memset(d, 0, 9 * sizeof(double));
    for (int k = 0; k < 4; k++) {
        for (int e = 0; e < 9; e++)
            d[e / 3][e % 3] += y[w->m->t[t][k]][e / 3] * w->gradient[t][k][e % 3];
    }
}

/* strain: what sigma is made of; Green's in the paper's convention (AD 1), Cauchy's twice, so that
 * both laws agree for small strains with f = -V/2 (D) sigma b. */
static void strain_of(force_law law, double d[3][3], double r[3][3], double e[3][3],
                      double n[3][3]) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            double one = i == j;
            if (law == LAW_CAUCHY) {
                e[i][j] = d[i][j] + d[j][i] - 2 * one;
                n[i][j] = r[i][j] + r[j][i];
                continue;
            }
            e[i][j] = -one;
            n[i][j] = 0;
            for (int a = 0; a < 3; a++) {
                e[i][j] += d[a][i] * d[a][j];
                n[i][j] += r[a][i] * d[a][j] + d[a][i] * r[a][j];
            }
        }
    }
}

static void strain_forces(swinging *w, force_law law) {
    const swing_setup *s = w->s;
    for (uint32_t t = 0; t < w->m->tets; t++) {
        double d[3][3], r[3][3], e[3][3], n[3][3], sigma[3][3];
        gradient_of(w, t, w->x, d);
        gradient_of(w, t, w->v, r);
        strain_of(law, d, r, e, n);
        double trace = e[0][0] + e[1][1] + e[2][2] + s->damping_s * (n[0][0] + n[1][1] + n[2][2]);
        for (int k = 0; k < 9; k++)
            sigma[k / 3][k % 3] =
                2 * s->mu_Pa * (e[k / 3][k % 3] + s->damping_s * n[k / 3][k % 3]) +
                (k % 4 == 0 ? s->lambda_Pa * trace : 0);
        for (int k = 0; k < 4; k++) {
            double p[3];
            for (int a = 0; a < 3; a++) p[a] = v_dot(sigma[a], w->gradient[t][k]);
            for (int a = 0; a < 3; a++) {
                double f = law == LAW_CAUCHY ? p[a] : v_dot(d[a], p);
                w->f[w->m->t[t][k]][a] -= 0.5 * w->volume[t] * f;
            }
        }
    }
}

static void step(swinging *w, force_law law) {
    const swing_setup *s = w->s;
    memset(w->f, 0, w->m->nodes * sizeof *w->f);
    if (law == LAW_SPRINGS)
        pull(w);
    else
        strain_forces(w, law);
    for (uint32_t i = 0; i < w->m->nodes; i++) {
        if (w->m->x[i][0] <= s->below) continue;
        for (int a = 0; a < 3; a++) {
            w->v[i][a] += s->step_s * (w->f[i][a] / w->mass[i] + s->gravity_m_s2[a]);
            w->x[i][a] += s->step_s * w->v[i][a];
        }
    }
}

void oscillate(const tetmesh *m, force_law law, const swing_setup *s, uint32_t watched,
               uint32_t every, double *z, uint32_t count, double (*x)[3]) {
    swinging w = {.m = m, .s = s};
    w.x = allocate(m->nodes, sizeof *w.x);
    w.v = allocate(m->nodes, sizeof *w.v);
    w.f = allocate(m->nodes, sizeof *w.f);
    w.mass = allocate(m->nodes, sizeof *w.mass);
    w.gradient = allocate(m->tets, sizeof *w.gradient);
    w.volume = allocate(m->tets, sizeof *w.volume);
    memcpy(w.x, m->x, m->nodes * sizeof *w.x);
    for (uint32_t t = 0; t < m->tets; t++) {
        double(*b)[3] = w.gradient[t];
        w.volume[t] = tet_volume(m, t);
        tet_gradients(m, t, b + 1);
        for (int a = 0; a < 3; a++) b[0][a] = -b[1][a] - b[2][a] - b[3][a];
        for (int k = 0; k < 4; k++) w.mass[m->t[t][k]] += s->density * w.volume[t] / 4;
    }
    if (law == LAW_SPRINGS) make_springs(&w);
    for (uint32_t k = 0; k < count; k++) {
        z[k] = w.x[watched][2];
        for (uint32_t i = 0; i < every; i++) step(&w, law);
    }
    if (x != NULL) memcpy(x, w.x, m->nodes * sizeof *w.x);
    void *owned[] = {w.x, w.v, w.f, w.mass, w.gradient, w.volume, w.spring};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}

double frequency_of(const double *z, uint32_t count, double interval_s) {
    double mean = 0, first = 0, last = 0;
    uint32_t crossings = 0;
    for (uint32_t k = 0; k < count; k++) mean += z[k] / count;
    for (uint32_t k = 1; k < count; k++) {
        if (!(z[k - 1] < mean && z[k] >= mean)) continue;
        double at = k - (z[k] - mean) / (z[k] - z[k - 1]);
        if (crossings == 0) first = at;
        last = at;
        crossings++;
    }
    return crossings < 3 ? 0 : (crossings - 1) / ((last - first) * interval_s);
}
