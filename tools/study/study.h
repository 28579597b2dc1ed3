/* SPDX-License-Identifier: MIT */
/* Error against compression of one body's Green's functions: every wavelet, threshold, rule and
 * constraint level (MR 10). */
#ifndef PALP_TOOLS_STUDY_H
#define PALP_TOOLS_STUDY_H

#include "tools/bake/body.h"
#include "tools/study/plot.h"
#include "port/host/util.h"

typedef struct {
    char name[64];
    mesh m;
    uint8_t *fixed;
    double *area;
    greens g;
    double young_Pa, poisson;
    uint32_t levels, stored; /* levels, and the constraint level of the columns in g */
    double seconds;          /* what the Green's functions took */
} study_case;

typedef struct {
    wavelet w;
    threshold_rule rule;
    uint32_t level;
    double epsilon, blocks, compression, rms, max;
} study_point;

#define STUDY_EPSILONS 11u
extern const double study_epsilons[STUDY_EPSILONS];

/* One curve: STUDY_EPSILONS points of rising epsilon. */
void study_curve(const study_case *c, wavelet w, threshold_rule rule, uint32_t level,
                 study_point *point);

/* The point at a given RMS error, log-linear between those of a curve. */
double study_compression_at(const study_point *point, double rms);

/* "linear", "linear lifted", ... */
const char *wavelet_label(wavelet w);

/* Opens DIR/NAME for writing; DIR is made if needed. */
output study_file(const char *folder, const char *name);

/* A header line and one line per point. */
void study_csv_header(FILE *f);
void study_csv(FILE *f, const study_case *c, const study_point *point, size_t count);

/* The body's mesh; then, once its fixed nodes are chosen, everything else, with Green's functions
 * up to level `finest` or the mesh's own. */
study_case study_case_begin(const body_spec *body);
void study_case_bake(study_case *c, const body_spec *body, uint32_t finest);
void study_free(study_case *c);

/* palp study: argv with the command's name first; returns the exit code. */
int command_study(int argc, char **argv);

#endif
