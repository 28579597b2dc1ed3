/* SPDX-License-Identifier: MIT */
/* A hosted program on a bare Cortex-M under QEMU: newlib over semihosting, and the arguments from
 * the command line there (-append, or -semihosting-config arg=...). */
#include "port/cortexm/semihost.h"
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(void);
int hosted_main(int argc, char **argv); /* the program's main, renamed on the command line */
void initialise_monitor_handles(void);
void _init(void); /* newlib's exit wants them */
void _fini(void);
void _init(void) {}
void _fini(void) {}

/* With -Wl,--wrap=_sbrk: the heap in the board's PSRAM, which newlib does not know of. */
void *__wrap__sbrk(ptrdiff_t bytes);
void *__wrap__sbrk(ptrdiff_t bytes) {
    static uint8_t *heap = (uint8_t *)0x60000000u;
    uint8_t *block = heap;
    heap += bytes;
    return block;
}

int main(void) {
    static char line[512];
    static char *argument[16];
    const struct {
        char *text;
        uint32_t bytes;
    } block = {line, sizeof line};
    int count = 0;
    initialise_monitor_handles();
    (void)semihost_call(0x15u, &block);
    for (char *word = strtok(line, " "); word != NULL && count < 15; word = strtok(NULL, " "))
        argument[count++] = word;
    int status = hosted_main(count, argument);
    fflush(stdout);
    return status;
}
