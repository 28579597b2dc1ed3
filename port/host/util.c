/* SPDX-License-Identifier: MIT */
#include "port/host/util.h"
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

const char *program_name = "palp";
#define MAX_OUTPUTS 8
static char *pending[MAX_OUTPUTS]; /* temporaries of outputs not yet committed */

static void remove_pending(void) {
    for (int i = 0; i < MAX_OUTPUTS; i++) {
        if (pending[i] != NULL) unlink(pending[i]);
    }
}

static void on_signal(int number) {
    remove_pending();
    _exit(128 + number);
}

/* Replaces `from` by `to` in the list of temporaries. */
static void change_pending(const char *from, char *to) {
    for (int i = 0; i < MAX_OUTPUTS; i++) {
        if (pending[i] != from) continue;
        pending[i] = to;
        return;
    }
}

static void print_message(const char *format, va_list arguments) {
    fprintf(stderr, "%s: ", program_name);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
}

void die(int code, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    print_message(format, arguments);
    va_end(arguments);
    remove_pending();
    exit(code);
}

void warn(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    print_message(format, arguments);
    va_end(arguments);
}

void *allocate(size_t count, size_t size) {
    void *p = calloc(count > 0 ? count : 1, size);
    if (p == NULL) die(EXIT_WORK, "out of memory (%zu elements of %zu bytes)", count, size);
    return p;
}

void *allocate_aligned(size_t count, size_t size) {
    size_t bytes = (count * size + 63) / 64 * 64;
    void *p = aligned_alloc(64, bytes > 0 ? bytes : 64);
    if (p == NULL) die(EXIT_WORK, "out of memory (%zu elements of %zu bytes)", count, size);
    memset(p, 0, bytes);
    return p;
}

void *grow(void *array, size_t *capacity, size_t need, size_t size) {
    if (need <= *capacity) return array;
    size_t wanted = *capacity * 2 > need ? *capacity * 2 : need + 16;
    void *p = realloc(array, wanted * size);
    if (p == NULL) die(EXIT_WORK, "out of memory (%zu elements of %zu bytes)", wanted, size);
    *capacity = wanted;
    return p;
}

char *copy_string(const char *text) {
    size_t n = strlen(text) + 1;
    return memcpy(allocate(n, 1), text, n);
}

char *read_file(const char *path, size_t *bytes) {
    FILE *f = strcmp(path, "-") == 0 ? stdin : fopen(path, "rb");
    if (f == NULL) die(EXIT_USAGE, "cannot read %s: %s", path, strerror(errno));
    size_t used = 0;
    size_t capacity = 1 << 16;
    char *data = allocate_aligned(capacity, 1);
    for (;;) {
        size_t got = fread(data + used, 1, capacity - used - 1, f);
        used += got;
        if (got == 0) break;
        if (capacity - used < 2) {
            char *larger = allocate_aligned(capacity * 2, 1);
            memcpy(larger, data, used);
            free(data);
            data = larger;
            capacity *= 2;
        }
    }
    if (ferror(f)) die(EXIT_USAGE, "cannot read %s: %s", path, strerror(errno));
    if (f != stdin) fclose(f);
    data[used] = '\0';
    *bytes = used;
    return data;
}

output open_output(const char *path) {
    output out = {.path = path};
    struct stat status;
    if (strcmp(path, "-") == 0) {
        out.file = stdout;
        return out;
    }
    /* A symbolic link keeps pointing where it does; devices and pipes are written to, not replaced.
     */
    char *real = realpath(path, NULL);
    if (real != NULL) out.path = real;
    if (real != NULL && stat(real, &status) == 0 && !S_ISREG(status.st_mode)) {
        out.file = S_ISDIR(status.st_mode) ? NULL : fopen(real, "wb");
        if (out.file == NULL) die(EXIT_USAGE, "cannot write %s: %s", path, strerror(errno));
        return out;
    }
    size_t n = strlen(out.path) + 32;
    out.temporary = allocate(n, 1);
    snprintf(out.temporary, n, "%s.%ld.part", out.path, (long)getpid());
    out.file = fopen(out.temporary, "wb");
    if (out.file == NULL) die(EXIT_USAGE, "cannot write %s: %s", path, strerror(errno));
    change_pending(NULL, out.temporary);
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
    return out;
}

void commit_output(output *out) {
    bool bad = fflush(out->file) != 0 || ferror(out->file) != 0;
    if (out->temporary == NULL) {
        if (bad) die(EXIT_WORK, "cannot write %s: %s", out->path, strerror(errno));
        if (out->file != stdout) fclose(out->file);
        return;
    }
    bad |= fclose(out->file) != 0;
    if (bad || rename(out->temporary, out->path) != 0) {
        die(EXIT_WORK, "cannot write %s: %s", out->path, strerror(errno));
    }
    change_pending(out->temporary, NULL);
    free(out->temporary);
}

FILE *open_memory(char **text, size_t *bytes) {
    FILE *f = open_memstream(text, bytes);
    if (f == NULL) die(EXIT_WORK, "out of memory");
    return f;
}

char *next_line(char **cursor, size_t *number) {
    char *line = *cursor;
    if (line == NULL) return NULL;
    char *end = strchr(line, '\n');
    *cursor = end != NULL ? end + 1 : NULL;
    if (end != NULL) *end = '\0';
    (*number)++;
    line[strcspn(line, "#\r")] = '\0';
    line += strspn(line, " \t");
    size_t length = strlen(line);
    while (length > 0 && (line[length - 1] == ' ' || line[length - 1] == '\t'))
        line[--length] = '\0';
    return line;
}

bool parse_double(const char *text, double *value) {
    char *end;
    *value = strtod(text, &end);
    return end != text && *end == '\0' && isfinite(*value);
}

bool parse_u32(const char *text, uint32_t *value) {
    char *end;
    errno = 0;
    unsigned long v = strtoul(text, &end, 10);
    if (end == text || *end != '\0' || *text == '-' || errno != 0 || v > UINT32_MAX) return false;
    *value = (uint32_t)v;
    return true;
}

double now_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

void print_escaped(FILE *f, const char *text) {
    for (; *text != '\0'; text++) {
        if (strchr("<>&\"'", *text) != NULL)
            fprintf(f, "&#%d;", *text);
        else
            fputc(*text, f);
    }
}

bool has_extension(const char *path, const char *extension) {
    const char *dot = strrchr(path, '.');
    return dot != NULL && strcasecmp(dot, extension) == 0;
}

void numbered_path(const char *path, int number, char *name, size_t room) {
    const char *dot = strrchr(path, '.'), *slash = strrchr(path, '/');
    int stem =
        (int)(dot != NULL && (slash == NULL || dot > slash) ? dot - path : (int)strlen(path));
    if (number < 0)
        snprintf(name, room, "%s", path);
    else
        snprintf(name, room, "%.*s-%d%s", stem, path, number, path + stem);
}
