/* SPDX-License-Identifier: MIT */
#include "tools/tet/tetsmooth.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SWEEPS 12 /* of smoothing */
#define SAFE_LOW                                                                                   \
    18.0 /* dihedral angles (degrees) inside which smoothing may change them freely                \
          */
#define SAFE_HIGH 150.0

/* Worst of a node's tetrahedra: how far its angles leave the safe range, and its shape. */
typedef struct {
    double low, high, shape;
} star;

static star star_of(const tetmesh *m, const uint32_t *tet, uint32_t count) {
    star s = {180, 0, HUGE_VAL};
    for (uint32_t i = 0; i < count; i++) {
        double x[4][3], low, high, sum = 0, volume = tet_volume(m, tet[i]);
        for (int k = 0; k < 4; k++) memcpy(x[k], m->x[m->t[tet[i]][k]], sizeof x[k]);
        for (int k = 0; k < 4; k++) {
            for (int j = 0; j < k; j++) sum += v_distance(x[k], x[j]) * v_distance(x[k], x[j]);
        }
        if (volume > 0) {
            tet_dihedral_deg(x, &low, &high);
            s.low = fmin(s.low, low);
            s.high = fmax(s.high, high);
        } else {
            s.low = 0;
            s.high = 180;
        }
        s.shape = fmin(s.shape, volume / pow(sum, 1.5));
    }
    return s;
}

static bool allowed(star old, star new, bool must_improve) {
    if (new.low < fmin(old.low, SAFE_LOW) || new.high > fmax(old.high, SAFE_HIGH)) return false;
    return !must_improve || new.shape > old.shape;
}

void tetmesh_smooth(tetmesh *m, const bvh *on) {
    uint32_t *offset, *list, count;
    tetmesh_around(m, &offset, &list);
    uint32_t(*face)[3] = tetmesh_boundary(m, &count);
    bool *outer = allocate((size_t)m->nodes + 1, sizeof *outer);
    for (uint32_t i = 0; i < 3 * count; i++) outer[face[i / 3][i % 3]] = true;
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        for (uint32_t i = 0; i < m->nodes; i++) {
            const uint32_t *tet = list + offset[i];
            uint32_t tets = offset[i + 1] - offset[i];
            double old[3], middle[3] = {0, 0, 0}, weight = 0;
            memcpy(old, m->x[i], sizeof old);
            for (uint32_t t = 0; t < tets; t++) {
                for (int k = 0; k < 4; k++) {
                    uint32_t n = m->t[tet[t]][k];
                    if (n == i || (outer[i] && !outer[n])) continue;
                    for (int a = 0; a < 3; a++) middle[a] += m->x[n][a];
                    weight++;
                }
            }
            star before = star_of(m, tet, tets);
            for (int half = 0; half < 3 && weight > 0; half++) {
                double goal[3], share = half == 0 ? 0.7 : half == 1 ? 0.3 : 0.0;
                if (half == 2 && !outer[i]) break;
                for (int a = 0; a < 3; a++)
                    goal[a] = old[a] + share * (middle[a] / weight - old[a]);
                if (outer[i])
                    (void)bvh_closest(on, goal, NULL, 0, m->x[i], NULL);
                else
                    memcpy(m->x[i], goal, sizeof goal);
                if (allowed(before, star_of(m, tet, tets), half < 2)) break;
                memcpy(m->x[i], old, sizeof old);
            }
        }
    }
    free(outer);
    free(face);
    free(offset);
    free(list);
}
