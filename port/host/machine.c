/* SPDX-License-Identifier: MIT */
#include "port/host/machine.h"
#include "port/host/args.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

#define WORD_OF(name, word, what) word,
#define WHAT_OF(name, word, what) what,
static const char *const words[PALP_WORKS] = {PALP_WORK_LIST(WORD_OF)};
static const char *const whats[PALP_WORKS] = {PALP_WORK_LIST(WHAT_OF)};

/* How fast the shipped targets are taken to be unless a file says otherwise. */
static const struct {
    const palp_target *target;
    float ns_per_instruction, ns_per_byte;
    const char *basis;
    const palp_target *cycles;
    float ns_per_cycle;
} shipped[] = {{&palp_target_x86_64, 0.5f, 0.1f,
                "3 GHz, 1.5 cycles per instruction, memory at 10 GB/s", NULL, 0.0f},
               {&palp_target_x86_64_avx2, 0.5f, 0.1f,
                "3 GHz, 1.5 cycles per instruction, memory at 10 GB/s", NULL, 0.0f},
               {&palp_target_cortex_a53, 1.7f, 0.3f,
                "1.2 GHz, 2 cycles per instruction, memory at 3 GB/s", NULL, 0.0f},
               {&palp_target_cortex_m7, 5.0f, 0.0f,
                "400 MHz, code and data in tightly coupled memory", &palp_target_cortex_m7_cycles,
                2.5f},
               {&palp_target_counted, 0.5f, 0.0f,
                "not a machine: operations that the code counts itself", NULL, 0.0f}};
#define SHIPPED (sizeof shipped / sizeof shipped[0])

const char *machine_word(palp_work kind) { return words[kind]; }
const char *machine_what(palp_work kind) { return whats[kind]; }

const palp_target *machine_of_this_build(void) {
#if defined(__x86_64__) && defined(__AVX2__)
    return &palp_target_x86_64_avx2;
#elif defined(__x86_64__)
    return &palp_target_x86_64;
#elif defined(__aarch64__)
    return &palp_target_cortex_a53;
#else
    return NULL;
#endif
}

static void take(machine *m, size_t k) {
    m->target = *shipped[k].target;
    snprintf(m->basis, sizeof m->basis, "%s", shipped[k].basis);
    m->ns_per_instruction = shipped[k].ns_per_instruction;
    m->ns_per_byte = shipped[k].ns_per_byte;
    m->cycles = shipped[k].cycles;
    m->ns_per_cycle = shipped[k].ns_per_cycle;
}

/* Words of a table go into JSON and logs as they are. */
static void require_plain(const argument *a, const char *word) {
    for (const char *p = word; *p != '\0'; p++) {
        if ((unsigned char)*p < ' ' || *p == '"' || *p == '\\')
            die(EXIT_WORK, "%s: '%s': quotes and backslashes cannot be part of it", a->where, word);
    }
}

static void set_value(void *context, const argument *a) {
    machine *m = context;
    if (a->option == NULL) die(EXIT_WORK, "%s: not a line of a cost table", a->where);
    const char *key = a->option + 2;
    for (int i = 0; i < a->count; i++) require_plain(a, a->value[i]);
    if (strcmp(key, "name") == 0) {
        snprintf(m->target.name, sizeof m->target.name, "%.23s", a->value[0]);
    } else if (strcmp(key, "basis") == 0) {
        m->basis[0] = '\0';
        for (int i = 0; i < a->count; i++) {
            size_t used = strlen(m->basis);
            snprintf(m->basis + used, sizeof m->basis - used, "%s%s", i > 0 ? " " : "",
                     a->value[i]);
        }
    } else if (strcmp(key, "ns-per-instruction") == 0) {
        m->ns_per_instruction = (float)arg_between(a, 0, 1e6);
    } else if (strcmp(key, "ns-per-byte") == 0) {
        m->ns_per_byte = (float)arg_upto(a, 1e6);
    } else {
        for (palp_work k = 0; k < PALP_WORKS; k++) {
            if (strcmp(key, words[k]) == 0) m->target.instructions.of[k] = (float)arg_upto(a, 1e9);
        }
    }
}

static void read_table(machine *m, const char *path) {
    option table[PALP_WORKS + 5] = {{"--name", 1},
                                    {"--basis", -MAX_OPTION_VALUES},
                                    {"--ns-per-instruction", 1},
                                    {"--ns-per-byte", 1}};
    static char name[PALP_WORKS][32];
    for (palp_work k = 0; k < PALP_WORKS; k++) {
        snprintf(name[k], sizeof name[k], "--%s", words[k]);
        table[4 + k] = (option){name[k], 1};
        m->target.instructions.of[k] = -1;
    }
    m->ns_per_byte = -1;
    args_parse_file(path, table, set_value, m);
    for (palp_work k = 0; k < PALP_WORKS; k++) {
        if (m->target.instructions.of[k] < 0)
            die(EXIT_WORK, "%s: no line '%s' (%s); palp calibrate writes whole tables", path,
                words[k], whats[k]);
    }
    if (!(m->ns_per_instruction > 0))
        die(EXIT_WORK, "%s: no line 'ns-per-instruction'; palp calibrate writes one", path);
    if (m->ns_per_byte < 0)
        die(EXIT_WORK, "%s: no line 'ns-per-byte' (0 where memory is as fast as the core)", path);
}

void machine_find(machine *m, const char *name_or_file) {
    memset(m, 0, sizeof *m);
    for (size_t k = 0; k < SHIPPED; k++) {
        if (strcmp(name_or_file, shipped[k].target->name) != 0) continue;
        take(m, k);
        return;
    }
    FILE *f = fopen(name_or_file, "r");
    if (f == NULL) {
        char list[256] = "";
        for (size_t k = 0; k < SHIPPED; k++) {
            size_t used = strlen(list);
            snprintf(list + used, sizeof list - used, "%s%s", k > 0 ? ", " : "",
                     shipped[k].target->name);
        }
        die(EXIT_USAGE, "'%s' is neither a file nor a target (%s)", name_or_file, list);
    }
    fclose(f);
    read_table(m, name_or_file);
}

void machine_choose(machine *m, const char *name_or_file, double ns_per_operation) {
    const palp_target *own = machine_of_this_build();
    if (name_or_file != NULL && ns_per_operation > 0)
        die(EXIT_USAGE, "--target and --ns-per-operation: one machine, please");
    if (name_or_file == NULL && !(ns_per_operation > 0) && own == NULL)
        die(EXIT_USAGE, "no cost table is shipped for this machine: give one with --target");
    if (name_or_file != NULL || !(ns_per_operation > 0)) {
        machine_find(m, name_or_file != NULL ? name_or_file : own->name);
        return;
    }
    machine_find(m, palp_target_counted.name);
    m->ns_per_instruction = (float)ns_per_operation;
    snprintf(m->basis, sizeof m->basis, "an assumed machine, by operations that the code counts");
}

palp_cost_table machine_table(const machine *m, double margin) {
    if (m->cycles != NULL)
        return (palp_cost_table){m->cycles, m->ns_per_cycle, m->ns_per_byte, (float)margin};
    return (palp_cost_table){&m->target, m->ns_per_instruction, m->ns_per_byte, (float)margin};
}

void machine_write(FILE *f, const machine *m) {
    fprintf(f,
            "# What work costs on one machine (palp calibrate). Instructions at most, but for "
            "the speed.\nname %s\nbasis %s\nns-per-instruction %.9g\nns-per-byte %.9g\n",
            m->target.name, m->basis, (double)m->ns_per_instruction, (double)m->ns_per_byte);
    for (palp_work k = 0; k < PALP_WORKS; k++)
        fprintf(f, "%-16s %-10.9g # %s\n", words[k], (double)m->target.instructions.of[k],
                whats[k]);
}
