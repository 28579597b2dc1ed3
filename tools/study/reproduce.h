/* SPDX-License-Identifier: MIT */
/* What the parts of `palp reproduce` share. */
#ifndef PALP_TOOLS_REPRODUCE_H
#define PALP_TOOLS_REPRODUCE_H

#include "tools/study/plot.h"
#include "tools/study/study.h"

#define CASES 3 /* L = 2, 3, 4 */
#define LARGE_LEVEL 1

typedef struct {
    const char *folder;
    FILE *page;
    study_case small[CASES], large;
    palp_blob blob[CASES]; /* lifted linear, epsilon 0.05 */
    uint8_t *bytes[CASES];
    uint32_t loops[CASES];
} work;

typedef enum { BY_COMPRESSION, BY_EPSILON } abscissa;
typedef enum { RMS_ERROR, MAX_ERROR } ordinate;

/* A blob of a case in memory: lifted linear, tables up to 8 MB. */
built build_case(const study_case *c, double epsilon);
uint32_t free_nodes(const study_case *c);

/* A CSV file in the folder of `w`, with its header line. */
output begin_csv(const work *w, const char *name, const char *header);
/* Heads a section of the page, with what the paper says. */
void begin_figure(const work *w, const char *title, const char *paper);

void save_curves(const work *w, const char *name, const study_case *c, const study_point *curve[],
                 size_t curves);
/* One chart of curves; labels are made by the caller. */
void add_chart(const work *w, const char *name, const char *title, abscissa a, ordinate o,
               const study_point *curve[], const char *const *label, size_t curves);

/* A chart in a file of its own and on the page. */
void add_plot(const work *w, const char *name, const plot_chart *chart);

/* The paper on dynamic bodies (dynamics.c), with a model that has 'tets'. */
void reproduce_dynamics(work *w, const char *model);

/* Beyond the paper: other compressions and the split form at equal error (compressions.c); forces on
 * coarser levels, and an electrostatic problem (beyond.c). */
void compare_compressions(work *w, const study_point *wavelets);
void compare_levels(work *w);
void show_electrostatics(work *w);

/* palp reproduce: argv with the command's name first; returns the exit code. */
int command_reproduce(int argc, char **argv);

#endif
