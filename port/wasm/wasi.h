/* SPDX-License-Identifier: MIT */
/* What the programs use and wasi-libc lacks; included before every file (build.sh). */
#ifndef PALP_WASM_WASI_H
#define PALP_WASM_WASI_H

#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

/* The page's files have no links. */
static inline char *no_links(const char *path, char *resolved) {
    (void)path;
    (void)resolved;
    return NULL;
}
#define realpath no_links

/* Memory only grows: what there is now is the most that there was, in KB as on Linux. */
struct memory_usage {
    long ru_maxrss;
};
static inline int memory_in_use(int who, struct memory_usage *usage) {
    (void)who;
    usage->ru_maxrss = (long)__builtin_wasm_memory_size(0) * 64;
    return 0;
}
/* A page may have 4 GB. */
static inline long system_size(int which) {
    return which == _SC_PHYS_PAGES ? 65536 : which == _SC_PAGESIZE ? 65536 : 1;
}
#define sysconf system_size

#define rusage memory_usage
#define getrusage memory_in_use

#endif
