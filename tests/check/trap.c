/* SPDX-License-Identifier: MIT */
/* Preloaded into palpd: counts what the loop's thread allocates and frees, and says so at the end.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>

static unsigned long in_loop, elsewhere;

static void count(void) {
    char name[16] = "";
    prctl(PR_GET_NAME, name);
    if (strcmp(name, "palp-loop") == 0)
        __atomic_add_fetch(&in_loop, 1, __ATOMIC_RELAXED);
    else
        __atomic_add_fetch(&elsewhere, 1, __ATOMIC_RELAXED);
}

extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void __libc_free(void *);
void *malloc(size_t n) {
    count();
    return __libc_malloc(n);
}
void *calloc(size_t n, size_t m) {
    count();
    return __libc_calloc(n, m);
}
void *realloc(void *p, size_t n) {
    count();
    return __libc_realloc(p, n);
}
void free(void *p) {
    if (p != NULL) count(); /* a thread's end frees nothing */
    __libc_free(p);
}

__attribute__((destructor)) static void tell(void) {
    fprintf(stderr, "trap: %lu in the loop, %lu elsewhere\n", in_loop, elsewhere);
}
