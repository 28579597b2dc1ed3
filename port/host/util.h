/* SPDX-License-Identifier: MIT */
/* What every host program needs: fatal errors, checked allocation, output files that appear whole.
 */
#ifndef PALP_TOOLS_UTIL_H
#define PALP_TOOLS_UTIL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#define EXIT_WORK 1  /* the work itself failed: bad mesh, singular system, corrupt blob */
#define EXIT_USAGE 2 /* unknown option, missing file, bad value */

/* Name put before every message; set once in main. */
extern const char *program_name;

/* Prints one line on stderr and exits with `code`; temporary files are removed. */
_Noreturn void die(int code, const char *format, ...) __attribute__((format(printf, 2, 3)));
void warn(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* Zeroed memory for count elements of `size` bytes; exits when there is none. */
void *allocate(size_t count, size_t size);
/* The same, 64-byte aligned (release with free). */
void *allocate_aligned(size_t count, size_t size);
/* Grows `array` (capacity in elements) so that it holds at least `need` elements. */
void *grow(void *array, size_t *capacity, size_t need, size_t size);
char *copy_string(const char *text);

/* Whole file, NUL-terminated behind `bytes`, 64-byte aligned; "-" reads standard input. Exits if
 * absent. */
char *read_file(const char *path, size_t *bytes);

/* Text in a page of HTML or SVG: what would be markup is not. */
void print_escaped(FILE *f, const char *text);

/*
 * An output file that is written beside its final name and renamed by commit_output, so that a
 * failure leaves nothing. "-" is standard output.
 */
typedef struct {
    FILE *file;
    const char *path;
    char *temporary;
} output;
output open_output(const char *path);
void commit_output(output *out);

/* The next line of a text that is cut up on the way, without its comment (#) and the blanks around
 * it; NULL at the end. `number` counts. */
char *next_line(char **cursor, size_t *number);

/* A file in memory: when it is closed (*text)[0..*bytes) is what was written, ended by a 0, to be freed. */
FILE *open_memory(char **text, size_t *bytes);

/* Strict number parsing: the whole text must be one finite number. */
bool parse_double(const char *text, double *value);
bool parse_u32(const char *text, uint32_t *value);

double now_s(void);

/* Whether a path ends in an extension, ".obj", in capitals or not. */
bool has_extension(const char *path, const char *extension);

/* One of several files: "-NUMBER" before the extension of `path`; -1: as it is. */
void numbered_path(const char *path, int number, char *name, size_t room);

#endif
