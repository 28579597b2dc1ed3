/* SPDX-License-Identifier: MIT */
/*
 * Work that splits into independent items. Items are handed out dynamically, and each writes only
 * what belongs to it, so results do not depend on the number of threads.
 */
#ifndef PALP_TOOLS_PARALLEL_H
#define PALP_TOOLS_PARALLEL_H

#include <stddef.h>
#include <stdint.h>

typedef void (*work_item)(void *context, size_t item);

/* Threads used by parallel_for; 0 = one per processor. */
void set_threads(uint32_t count);
uint32_t thread_count(void);

/* Runs work(context, i) for i in [0, items); returns when all are done. */
void parallel_for(size_t items, work_item work, void *context);

/*
 * Progress of one stage on stderr: a line that is rewritten with the time left on a terminal, a
 * line every tenth otherwise. progress_add may be called from any thread. A total of 0 stands for a
 * stage of unknown length: only its time is told. Amounts beyond the total count as all of it.
 */
void progress_begin(const char *stage, double total);
void progress_add(double amount);
void progress_end(void);
void progress_quiet(int quiet);

#endif
