# SPDX-License-Identifier: MIT
"""How much instructions differ between cases with the very same counts: spread.py CASES...

By operation and level: cases, groups of two or more with equal counts, and the median and the largest of (most - least) / most in
a group. What is left is branches that counts do not tell: where in the list a contact is let out, which way a tool is touched,
how many of the proposed are new, how many entries of a row meet a block.
"""
import collections
import statistics
import sys

groups = collections.defaultdict(lambda: [0, 0, 0])
for path in sys.argv[1:]:
    for line in open(path):
        word = line.split()
        if len(word) > 3:
            g = groups[(word[0], word[1], " ".join(word[3:]))]
            n = int(word[2])
            g[0] += 1
            g[1] = min(g[1] or n, n)
            g[2] = max(g[2], n)
by = collections.defaultdict(list)
for (op, level, _), (count, least, most) in groups.items():
    if count > 1:
        by[op].append(((most - least) / most, count))
print("%-10s %8s %8s %8s %8s" % ("operation", "cases", "groups", "median", "largest"))
for op, all_ in sorted(by.items()):
    print("%-10s %8d %8d %8.3f %8.3f" % (op, sum(c for _, c in all_), len(all_), statistics.median(s for s, _ in all_),
                                         max(s for s, _ in all_)))
