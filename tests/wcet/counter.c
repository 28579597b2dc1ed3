/* SPDX-License-Identifier: MIT */
/*
 * A plugin for QEMU's user mode that counts the instructions a program executes, exactly, into a
 * file that the program has mapped too, so that it can read its own count as a clock:
 *
 *   qemu-aarch64 -plugin counter.so,count=COUNT program      (COUNT: 8 bytes, the program's)
 *
 * Blocks of code are counted when they begin, so two readings differ by the instructions between
 * them but for a constant of a few, which instructions.h takes off.
 */
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

/* Of QEMU's plugin interface, version 1; Debian does not package its header. */
typedef uint64_t qemu_plugin_id_t;
typedef struct qemu_info_t qemu_info_t;
struct qemu_plugin_tb;
enum { INLINE_ADD_U64 = 0 };
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *block);
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id,
                                           void (*translated)(qemu_plugin_id_t,
                                                              struct qemu_plugin_tb *));
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb *block, int operation,
                                              void *target, uint64_t value);
extern int qemu_plugin_version;
int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t *info, int argc, char **argv);

int qemu_plugin_version = 1;
static uint64_t *count;

static void translated(qemu_plugin_id_t id, struct qemu_plugin_tb *block) {
    (void)id;
    qemu_plugin_register_vcpu_tb_exec_inline(block, INLINE_ADD_U64, count,
                                             qemu_plugin_tb_n_insns(block));
}

int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t *info, int argc, char **argv) {
    (void)info;
    for (int i = 0; i < argc; i++) {
        if (strncmp(argv[i], "count=", 6) != 0) continue;
        int f = open(argv[i] + 6, O_RDWR | O_CREAT | O_TRUNC, 0600);
        if (f < 0 || ftruncate(f, 4096) != 0) return 1;
        count = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, f, 0);
        close(f);
    }
    if (count == NULL || count == MAP_FAILED) return 1;
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    return 0;
}
