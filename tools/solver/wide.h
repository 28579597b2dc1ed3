/* SPDX-License-Identifier: MIT */
/* Functions compiled for AVX2 as well, chosen when the program starts. Without fused multiply-adds wider vectors
 * give the same bits. */
#ifndef PALP_TOOLS_WIDE_H
#define PALP_TOOLS_WIDE_H

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) &&                             \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif

#endif
