/* SPDX-License-Identifier: MIT */
/* Command lines and key files, read against a table of options. */
#ifndef PALP_TOOLS_ARGS_H
#define PALP_TOOLS_ARGS_H

#include <stdint.h>

#define MAX_OPTION_VALUES 9

typedef struct {
    const char *name; /* "--young" */
    int values;       /* how many words follow; -n: from 1 to n, up to the next option */
} option;

/* What each word was: option is NULL for a positional word, which is then value[0]. */
typedef struct {
    const char *option;
    const char *value[MAX_OPTION_VALUES];
    int count;         /* of values */
    const char *where; /* for messages: "--young", or "file:line: young" */
} argument;

typedef void (*argument_handler)(void *context, const argument *a);

/*
 * Calls `handle` for each option and positional word in order. --help prints `help` and exits 0; an
 * unknown option or a missing value exits 2.
 */
void args_parse(int argc, char **argv, const option *table, const char *help,
                argument_handler handle, void *context);

/* The same for a file of lines `key value...` with the option names without dashes; '#' starts a
 * comment. */
void args_parse_file(const char *path, const option *table, argument_handler handle, void *context);
/* The same for text already in memory; `name` is what messages call it. */
void args_parse_text(const char *name, const char *text, const option *table,
                     argument_handler handle, void *context);

/* Values checked; each exits 2 with the option named. arg_between excludes both bounds. */
double arg_double(const argument *a, int index);
double arg_upto(const argument *a, double high); /* 0 to high, both included */
double arg_between(const argument *a, double low, double high);
uint32_t arg_u32(const argument *a, int index, uint32_t low, uint32_t high);
int arg_axis(const argument *a, int index);
/* Position of value[0] in the NULL-terminated list of words. */
int arg_word(const argument *a, const char *const *words);

#endif
