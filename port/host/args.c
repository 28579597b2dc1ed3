/* SPDX-License-Identifier: MIT */
#include "core/base/version.h"
#include "port/host/args.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static const option *find_option(const option *table, const char *name) {
    for (; table->name != NULL; table++) {
        if (strcmp(table->name, name) == 0) return table;
    }
    return NULL;
}

/* Whether the index-th word behind an option can be its value: no other option, and behind the
 * first no file, but a number or a unit. */
static bool can_be_value(const char *word, int index) {
    double value;
    if (parse_double(word, &value)) return true;
    return word[0] != '-' && (index == 0 || strpbrk(word, "./") == NULL);
}

/* How many of the words behind an option are its values. */
static int values_behind(const option *o, int words, char **word) {
    int most = abs(o->values), count = 0;
    while (count < most && count < words && (o->values > 0 || can_be_value(word[count], count)))
        count++;
    if (count < (o->values < 0 ? 1 : most)) {
        die(EXIT_USAGE, "%s needs %s%d value(s)", o->name, o->values < 0 ? "1 to " : "", most);
    }
    return count;
}

void args_parse(int argc, char **argv, const option *table, const char *help,
                argument_handler handle, void *context) {
    for (int i = 1; i < argc; i++) {
        argument a = {.where = argv[i]};
        if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0) {
            fputs(help, stdout);
            exit(0);
        }
        if (strcmp(argv[i], "--version") == 0) {
            printf("palp %s\n", PALP_VERSION);
            exit(0);
        }
        if (argv[i][0] != '-' || argv[i][1] == '\0') {
            a.value[0] = argv[i];
            handle(context, &a);
            continue;
        }
        const option *o = find_option(table, argv[i]);
        if (o == NULL) die(EXIT_USAGE, "unknown option %s (--help lists the options)", argv[i]);
        a.option = o->name;
        a.count = values_behind(o, argc - i - 1, argv + i + 1);
        for (int k = 0; k < a.count; k++) a.value[k] = argv[i + 1 + k];
        i += a.count;
        handle(context, &a);
    }
}

static void parse_line(const char *path, size_t number, char *line, const option *table,
                       argument_handler handle, void *context) {
    char *word[MAX_OPTION_VALUES + 2];
    int words = 0;
    for (char *w = strtok(line, " \t\r"); w != NULL && words < MAX_OPTION_VALUES + 2;
         w = strtok(NULL, " \t\r")) {
        if (w[0] == '#') break;
        word[words++] = w;
    }
    if (words == 0) return;
    char name[64], where[512];
    snprintf(name, sizeof name, "--%s", word[0]);
    snprintf(where, sizeof where, "%s:%zu: %s", path, number, word[0]);
    const option *o = find_option(table, name);
    if (o == NULL) die(EXIT_USAGE, "%s:%zu: unknown key '%s'", path, number, word[0]);
    int count = words - 1, most = abs(o->values);
    if (count > most || count < (o->values < 0 ? 1 : most))
        die(EXIT_USAGE, "%s needs %s%d value(s)", where, o->values < 0 ? "1 to " : "", most);
    argument a = {.option = o->name, .where = copy_string(where), .count = count};
    for (int k = 0; k < count; k++) a.value[k] = copy_string(word[k + 1]);
    handle(context, &a);
}

void args_parse_text(const char *name, const char *text, const option *table,
                     argument_handler handle, void *context) {
    char *copy = copy_string(text);
    size_t number = 0;
    for (char *line = copy; line != NULL;) {
        char *next = strchr(line, '\n');
        if (next != NULL) *next++ = '\0';
        parse_line(name, ++number, line, table, handle, context);
        line = next;
    }
    free(copy);
}

void args_parse_file(const char *path, const option *table, argument_handler handle,
                     void *context) {
    size_t bytes;
    char *text = read_file(path, &bytes);
    args_parse_text(path, text, table, handle, context);
    free(text);
}

double arg_double(const argument *a, int index) {
    double v;
    if (!parse_double(a->value[index], &v)) {
        die(EXIT_USAGE, "%s: '%s' is not a finite number", a->where, a->value[index]);
    }
    return v;
}

double arg_upto(const argument *a, double high) {
    double value = arg_double(a, 0);
    if (!(value >= 0 && value <= high))
        die(EXIT_USAGE, "%s: %s is out of range: need 0 to %g", a->where, a->value[0], high);
    return value;
}

double arg_between(const argument *a, double low, double high) {
    double v = arg_double(a, 0);
    if (!(v > low && v < high)) {
        die(EXIT_USAGE, "%s: %s is out of range: need %g < value < %g", a->where, a->value[0], low,
            high);
    }
    return v;
}

uint32_t arg_u32(const argument *a, int index, uint32_t low, uint32_t high) {
    uint32_t v;
    if (!parse_u32(a->value[index], &v) || v < low || v > high) {
        die(EXIT_USAGE, "%s: '%s' is not a whole number from %" PRIu32 " to %" PRIu32, a->where,
            a->value[index], low, high);
    }
    return v;
}

int arg_axis(const argument *a, int index) {
    const char *v = a->value[index];
    if (v[0] < 'x' || v[0] > 'z' || v[1] != '\0')
        die(EXIT_USAGE, "%s: axis '%s' is not x, y or z", a->where, v);
    return v[0] - 'x';
}

int arg_word(const argument *a, const char *const *words) {
    for (int i = 0; words[i] != NULL; i++) {
        if (strcmp(a->value[0], words[i]) == 0) return i;
    }
    char list[256] = "";
    for (int i = 0; words[i] != NULL; i++) {
        size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s%s", i > 0 ? ", " : "", words[i]);
    }
    die(EXIT_USAGE, "%s: '%s' is not one of: %s", a->where, a->value[0], list);
}
