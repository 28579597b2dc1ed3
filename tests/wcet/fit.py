# SPDX-License-Identifier: MIT
"""Prices from counted cases: the cheapest that no case exceeds.

usage: fit.py CASES... [--head-room 1.03] [--table NAME IDENTIFIER] [--keep TARGETS_C]

Reads the output of `cases` and finds prices w >= 0, one for each kind of work, with

    w . f >= head_room * counted      for every case (f: how many of each kind)

and, over the operations and levels, the least sum of the largest bound over the most counted (and,
weighing little, of the mean of bound over counted): a linear program. Prints how near the bounds come, by operation, and with --table the C table.
"""
import argparse
import collections
import re
import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_matrix, hstack, vstack

# How much the tightness of an operation's bound matters: sums of many steps are held, but shape
# little, as their slack is that of counts, not of prices.
SAY = {"whole": 2, "session": 0.01, "tick": 0.01, "drop": 0.05, "climb": 0.05, "follow": 0.05,
       "load": 0.2, "step": 6, "begin": 4, "search": 3, "admit": 2, "leave": 2}
p = argparse.ArgumentParser()
p.add_argument("cases", nargs="+")
p.add_argument("--head-room", type=float, default=1.03)
p.add_argument("--table", nargs=2, metavar=("NAME", "IDENTIFIER"))
p.add_argument("--levels", action="store_true")
p.add_argument("--keep", metavar="TARGETS_C", help="prices that stand in this file for the table's identifier stay")
p.add_argument("--price", default="core/budget/price.h")
p.add_argument("--counted", default="core/budget/counted.c")
a = p.parse_args()
names = re.findall(r"X\((\w+), \"(\w+)\"", open(a.price).read())

# No kind is for nothing, even where the cases cannot tell it from another: half of what the code
# itself counts for it.
least = np.zeros(len(names))
for kind, ops in re.findall(r"\[PALP_WORK_(\w+)\] = (\d+)", open(a.counted).read().split("palp_bytes")[0]):
    least[[n[0] for n in names].index(kind)] = 0.5 * float(ops)

kept = {}
if a.keep:
    block = open(a.keep).read().split("palp_target_%s = {" % a.table[1])[1].split("};")[0]
    kept = {k: float(x) for k, x in re.findall(r"\[PALP_WORK_(\w+)\]\s*=\s*([\d.]+)", block)}

worst = {}  # (operation, level, features) -> most instructions
for path in a.cases:
    for line in open(path):
        word = line.split()
        if len(word) < 4:
            continue
        key = (word[0] + ("@" + word[1] if a.levels else ""), int(word[1]), " ".join(word[3:]))
        worst[key] = max(worst.get(key, 0), int(word[2]))

rows, cols, vals, counted, ops = [], [], [], [], []
for i, ((op, level, text), n) in enumerate(worst.items()):
    for pair in text.split():
        k, v = pair.split(":")
        rows.append(i)
        cols.append(int(k))
        vals.append(float(v))
    counted.append(n)
    ops.append(op)
counted = np.array(counted, float)
f = csr_matrix((vals, (rows, cols)), shape=(len(counted), len(names)))
ops = np.array(ops)
classes = sorted({k[:2] for k in worst})
number = {c: i for i, c in enumerate(classes)}
cls = np.array([number[k[:2]] for k in worst])
most = np.zeros(len(classes))
np.maximum.at(most, cls, counted)
used = np.asarray(f.sum(axis=0)).ravel() > 0
u, c, n = used.sum(), len(classes), len(counted)
say = np.array([SAY.get(k[0].split("@")[0], 1) for k in classes])
# Dynamic bodies and changes of level are rarer among the cases, and what an extraction meets is not counted: more room
# for what was not met.
MORE = {"steps": 1.06, "impose": 1.06, "adapt": 1.06, "drop": 1.12, "climb": 1.12, "load": 1.25, "follow": 1.12,
        "extract": 1.1, "finish": 1.3, "fill": 1.1, "points": 1.1, "tick": 1.2}
room = np.array([a.head_room * MORE.get(o.split("@")[0], 1) for o in ops])
floor = hstack([-f[:, used], csr_matrix((n, c))])
largest = hstack([f[:, used], csr_matrix((-most[cls], (np.arange(n), cls)), shape=(n, c))])
r = linprog(np.concatenate([f[:, used].T @ (say[cls] / np.bincount(cls)[cls] / counted), say]), A_ub=vstack([floor, largest]),
            b_ub=np.concatenate([-room * counted, np.zeros(n)]), bounds=[(kept[n[0]],) * 2 if n[0] in kept else (x, None) for n, x in zip(np.array(names)[used], least[used])] + [(0, None)] * c, method="highs")
if r.status != 0:
    raise SystemExit("no fit: " + r.message)
r.x = r.x[:u]
w = 2 * least
w[used] = r.x
for i, n in enumerate(names):
    w[i] = kept.get(n[0], w[i])
bound = f @ w
if a.table:
    print("const palp_target palp_target_%s = {" % a.table[1])
    print('    "%s",' % a.table[0])
    terms = ["[PALP_WORK_%s] = %.7gf" % (n[0], x) if "." in "%.7g" % x else
             "[PALP_WORK_%s] = %d" % (n[0], x) for n, x in zip(names, w) if x > 0]
    print("    {{" + ", ".join(terms) + "}}};\n")
else:
    print("%-10s %8s %9s %9s %9s %10s" % ("operation", "cases", "counted", "bound", "over", "mean over"))
    for op in sorted(set(ops)):
        m = ops == op
        over = bound[m] / counted[m]
        print("%-10s %8d %9d %9d %9.3f %10.3f" % (op, m.sum(), counted[m].max(), bound[m].max(),
              bound[m].max() / counted[m].max(), (over * counted[m]).sum() / counted[m].sum()))
    print(" ".join("%s %.4g" % (n[1], x) for n, x in zip(names, w) if x > 0))
    import sys
    if "PALP_TIGHT" in __import__("os").environ:
        keys = list(worst)
        for i in np.argsort(bound / counted)[:40]:
            print(keys[i][0], keys[i][1], counted[i], "%.3f" % (bound[i] / counted[i]), " ".join("%s:%s" % (names[int(q.split(":")[0])][1], q.split(":")[1]) for q in keys[i][2].split()))
