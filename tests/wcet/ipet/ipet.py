# SPDX-License-Identifier: MIT
"""Bounds from the machine code.

usage: ipet.py survey TARGET BINARY             every loop of core, and what there is to know of its graphs
       ipet.py bound TARGET BINARY FUNCTION...  their bounds, in named counts
       ipet.py hold TARGET BINARY LINES [COUNTED]   formulas (the output of `formulas`) at the target's prices against the bounds;
                                                and how near to its bound a counted case came (what cases.sh prints with hold)
       ipet.py facts TARGET BINARY LINES        the loops' bounds as flow facts of OTAWA (.ff), at the largest counts in LINES
       ipet.py prices TARGET BINARY LINES [CASES]   the lowest prices at which no formula is below its bound, as C (glpsol)

TARGET: x86-64, x86-64-avx2, cortex-a53 or cortex-m7; or cortex-m7-cycles: the same in cycles, as cycles.py states them. BINARY: all of core with its debug information, linked (tests/wcet/proof.sh)."""
import collections
import os
import re
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from binary import Binary, Graph
from bound import Bounds
import cycles
from operations import OPERATIONS, of_other_shapes
from polynomial import ZERO, Polynomial
from source import Source

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.abspath(os.path.join(HERE, "..", "..", ".."))
COPY_CALL, COPY_BYTE = 40, 0.75  # instructions of memcpy and the like at most: stated, not derived
FITTED_ROOM = 1.5                # of operations that are not derived, over the most counted
ROOM = 1.025                     # of prices, over the derivation at the counts that they are fitted at: others come near;
MORE_ROOM = {"filled": 1.06, "inverse": 1.08}  # of operations with many counts, or with few bodies to fit on
BODY = 10.0                      # weight of the counts that a body has against those that any might have
CLOCK = 60                       # of one reading of the port's clock: stated, not derived
AT_MOST = 4                      # cycles of an instruction where only instructions are known: of these, and of counted cases


class Proof:
    def __init__(self, target, path):
        self.target, self.cycles = target, target.endswith("-cycles")
        self.binary = Binary(target.replace("-cycles", ""), path, ROOT)
        self.source = Source(ROOT, os.path.join(HERE, "counts.txt"))
        self.shared = None
        self.faults, self.cache = collections.OrderedDict(), {}
        self.made = []  # Bounds, each with what it has found

    def bounds(self, never=(), apart=()):
        each = AT_MOST if self.cycles else 1
        copy = lambda name, count: Polynomial.of(each * COPY_CALL) + count.scaled(each * COPY_BYTE)
        weigh = {"weigh": cycles.weigh} if self.cycles else {}
        b = Bounds(self.binary, self.source, outside=copy, indirect=Polynomial.of(each * CLOCK), **weigh)
        b.stops = {n: ZERO for n in list(never) + list(apart)}
        if self.shared is not None:
            b.parts = self.shared
        self.shared = b.parts
        b.faults = self.faults
        self.made.append(b)
        return b

    def of(self, name, tool):
        """The bound of an operation with a kind of tool: a polynomial."""
        if (name, tool) not in self.cache:
            op, never = OPERATIONS[name]
            never = list(never) + op.never + (of_other_shapes(tool, name not in ("around", "glue", "quantum")) if tool != "-" else [])
            b, total = self.bounds(never, op.apart), ZERO
            for function, times in op.functions.items():
                factor = Polynomial.of(float(times)) if times[0].isdigit() else Polynomial.count(times)
                total = total + factor * b.of(function)
            if op.times is not None:
                total = Polynomial({(t if set(t) & op.in_all else tuple(sorted(t + (op.times,)))): c for t, c in total.terms.items()})
            if op.of is not None:
                total = Polynomial({t: c for t, c in total.terms.items() if set(t) & op.of})
            self.cache[name, tool] = total
        return self.cache[name, tool]


def fail(proof):
    for where, what in proof.faults.items():
        print("FAULT %s: %s" % (where, what))
    return 1 if proof.faults else 0


def survey(target, path):
    proof = Proof(target, path)
    b = proof.bounds()
    called = {t for f in proof.binary.functions.values() for t in Graph(proof.binary, f).calls.values()}
    for f in list(proof.binary.functions.values()):
        if f.start not in called and f.name.startswith("palp_"):
            b.of(f.name)
    parts = b.parts.values()
    print("%s: %d functions, %d instructions, %d loops, %d of several loops of the source, %d ways copied to loops of several entries" %
          (target, len(parts), sum(len(p.graph.code) for p in parts), sum(len(p.flow.loops) for p in parts),
           sum(len(c) > 1 for p in parts for c in p.named.values()), sum(p.flow.copied for p in parts)))
    return fail(proof)


def bound(target, path, names):
    proof = Proof(target, path)
    b = proof.bounds()
    for n in names:
        print("%s = %s" % (n, b.of(n)))
    return fail(proof)


def facts(target, path, lines):
    """A loop's bound for each entry; where it is known for all of a function's call only, that, which is at least as much. A loop
    whose counts stand in no line (opening a blob, seams) is a comment."""
    proof = Proof(target, path)
    most = {}
    for _, _, counts, _ in read_lines(lines):
        for name, n in counts.items():
            most[name] = max(most.get(name, 0), n)
    for op, tool in operations_in(lines):
        proof.of(op, tool)
    b = proof.bounds()
    called = {t for f in proof.binary.functions.values() for t in Graph(proof.binary, f).calls.values()}
    for f in list(proof.binary.functions.values()):
        if f.start not in called and f.name.startswith("palp_"):
            b.of(f.name)
    found = collections.defaultdict(list)
    for one in proof.made:
        for key, said in one.facts.items():
            found[key] += said
    print("// Flow facts of core on %s, for OTAWA. Counts: %s" % (target, " ".join("%s=%g" % c for c in sorted(most.items()))))
    known = 0
    for (start, head), said in sorted(found.items()):
        name, place = proof.binary.functions[start].name, said[0][2]
        missing = sorted({n for turns, _, _ in said for n in turns.names()} - set(most))
        if missing:
            print("// loop 0x%x ; %s in %s: needs %s" % (head, place, name, ", ".join(missing)))
            continue
        known += 1
        print("loop 0x%x MAX %d ; // %s in %s: %s" % (head, max(-(-turns.at(most) // 1) for turns, _, _ in said), place, name,
                                                      " or ".join(sorted({str(turns) for turns, _, _ in said}))))
    print("// %s: %d loops, %d with a number" % (target, len(found), known))
    return fail(proof)


def operations_in(lines):
    return list(collections.OrderedDict(((op, tool), None) for op, tool, _, _ in read_lines(lines)))


def read_lines(path):
    for line in open(path):
        head, _, tail = line.partition("|")
        word = head.split()
        yield word[0], word[1], {k: float(v) for k, v in (w.split("=") for w in word[2:])}, {
            int(k): float(v) for k, v in (w.split(":") for w in tail.split())}


def kinds():
    return re.findall(r"X\((\w+), \"(\w+)\"", open(os.path.join(ROOT, "core/budget/price.h")).read())


def prices_of(target):
    text = open(os.path.join(ROOT, "core/budget/targets.c")).read()
    block = text.split("palp_target_%s = {" % target.replace("-", "_"))[1].split("};")[0]
    found = dict(re.findall(r"\[PALP_WORK_(\w+)\]\s*=\s*([\d.]+)f?", block))
    return [float(found.get(k, 0)) for k, _ in kinds()]


def value(proof, op, tool, counts):
    """The bound of an operation at a formula's counts."""
    p = proof.of(op, tool)
    at = {**counts, **OPERATIONS[op][0].counts}
    try:
        return p.at(at)
    except KeyError as missing:
        proof.faults["%s %s" % (op, tool)] = "the formula's case does not say %s" % missing
        return 0.0


CASES = {"filled": "fill", "dynamic_rubbing": "dynamic", "finish_rubbing": "", "fill": ""}  # whose names differ


def nearest(path):
    """Of each operation the most that cases took of their own bounds: (most instructions counted, share)."""
    found = {}
    for line in open(path) if path is not None else []:
        word = line.split()
        if len(word) == 7:
            most, share = found.get(word[0], (0, 0.0))
            found[word[0]] = (max(most, int(word[3])), max(share, float(word[5])))
    return found


def hold(target, path, lines, counted_path=None):
    proof, price, near = Proof(target, path), prices_of(target), nearest(counted_path)
    rows = collections.OrderedDict()
    for op, tool, counts, features in read_lines(lines):
        derived = value(proof, op, tool, counts)
        formula = sum(n * price[k] for k, n in features.items())
        r = rows.setdefault((op, tool), [0, 0, float("inf"), 0.0, 0, 0])
        r[0] += 1
        r[1] += formula < derived
        if derived > 0 and formula / derived < r[2]:
            r[2], r[4], r[5] = formula / derived, derived, formula
        r[3] = max(r[3], formula / derived if derived > 0 else 0)
    print("%-16s %-9s %6s %6s %10s %10s %7s %7s %9s %7s" % ("operation", "tool", "asked", "below", "derived", "formula", "least", "most",
                                                            "counted", "nearest"))
    for (op, tool), r in rows.items():
        most, share = near.get(CASES.get(op, op), (0, 0))
        said = "%9d %7.3f" % (most, share) if most > 0 else "%9s %7s" % ("-", "-")
        print("%-16s %-9s %6d %6d %10.0f %10.0f %7.3f %7.3f %s" % (op, tool, r[0], r[1], r[4], r[5], r[2], r[3], said))
    below = sum(r[1] for r in rows.values())
    print("%s: %d formulas at %d counts, %d below the derivation" % (target, len(rows), sum(r[0] for r in rows.values()), below))
    return 1 if fail(proof) or below else 0


def solve(goal, rows, floor):
    """The least goal . w with every row . w >= 1 and w >= floor."""
    with tempfile.TemporaryDirectory() as folder:
        model, out = os.path.join(folder, "p.lp"), os.path.join(folder, "p.out")
        with open(model, "w") as f:
            f.write("Minimize\n obj: " + "\n + ".join("%.9g w%d" % (c, k) for k, c in sorted(goal.items()) if c > 0) + "\nSubject To\n")
            for row in rows:
                f.write(" " + " + ".join("%.9g w%d" % (n, k) for k, n in row.items()) + " >= 1\n")
            f.write("Bounds\n" + "".join(" w%d >= %.9g\n" % (k, x) for k, x in floor.items()) + "End\n")
        done = subprocess.run(["glpsol", "--lp", model, "-o", out], capture_output=True, text=True)
        if done.returncode != 0 or "OPTIMAL" not in open(out).read():
            raise SystemExit("glpsol: " + done.stdout[-400:])
        text = open(out).read()
    return {int(k): float(v) for k, v in re.findall(r"\sw(\d+)\s+(?:B|NL|NU|NF|NS)\s+([\d.e+-]+)", text)}


def solve_all(goal, rows, floor):
    """The same, with few of the rows at first, and those that its answer does not meet after each time."""
    chosen = set(range(0, len(rows), 8))
    while True:
        found = solve(goal, [rows[i] for i in sorted(chosen)], floor)
        at = lambda k: found.get(k, floor[k])
        missed = [i for i, row in enumerate(rows) if i not in chosen and sum(n * at(k) for k, n in row.items()) < 0.9999]
        if not missed:
            return found
        chosen.update(missed)


def fitted(path):
    """Counted cases of what is not derived: of each features the most counted."""
    worst = {}
    for line in open(path):
        word = line.split()
        if len(word) > 3:
            key = (word[0], word[1], " ".join(word[3:]))
            worst[key] = max(worst.get(key, 0), int(word[2]))
    for (op, _, text), count in worst.items():
        yield op, count, {int(k): float(v) for k, v in (pair.split(":") for pair in text.split())}


def prices(target, path, lines, cases=None):
    """The table of a target, in C: the lowest prices at which no formula is below the derivation at any of the counts, and none below
    what was counted of operations that are not derived, by a quarter of room."""
    proof, names = Proof(target, path), kinds()
    text = open(os.path.join(ROOT, "core/budget/counted.c")).read().split("palp_bytes")[0]
    counts_of = {k: float(n) for k, n in re.findall(r"\[PALP_WORK_(\w+)\] = (\d+)", text)}
    weight, goal, rows = collections.Counter(), collections.Counter(), []
    every = list(read_lines(lines))
    for op, tool, counts, _ in every:
        weight[op, tool, counts.get("here", 0)] += 1

    def add(features, need, share):
        if need > 0:
            rows.append({k: n / need for k, n in features.items()})
            for k, n in features.items():
                goal[k] += n / need * share
    for op, tool, counts, features in every:
        here = counts.get("here", 0)
        add(features, MORE_ROOM.get(op, ROOM) * value(proof, op, tool, counts), (BODY if here else 1.0) / weight[op, tool, here])
    if fail(proof):
        return 1
    more = list(fitted(cases)) if cases is not None else []
    weight = collections.Counter(op for op, _, _ in more)
    for op, count, features in more:
        add(features, FITTED_ROOM * count * (AT_MOST if proof.cycles else 1), 0.1 / weight[op])
    found = solve_all(goal, rows, {i: 0.5 * counts_of.get(k, 0) for i, (k, _) in enumerate(names)})
    print("const palp_target palp_target_%s = {\n    \"%s\"," % (target.replace("-", "_"), target.replace("-cycles", "")))
    terms = ["[PALP_WORK_%s] = %sf" % (k, "%.2f" % (found.get(i, 0.5 * counts_of.get(k, 0)) * 1.0001 + 0.005)) for i, (k, _) in enumerate(names)]
    print("    {{" + ", ".join(terms) + "}}};\n")
    return 0


def main():
    if len(sys.argv) < 4:
        print(__doc__)
        return 2
    command, target, path = sys.argv[1:4]
    if command == "survey":
        return survey(target, path)
    if command == "bound":
        return bound(target, path, sys.argv[4:])
    if command == "facts":
        return facts(target, path, sys.argv[4])
    if command == "hold":
        return hold(target, path, *sys.argv[4:6])
    if command == "prices":
        return prices(target, path, *sys.argv[4:6])
    print(__doc__)
    return 2


if __name__ == "__main__":
    sys.exit(main())
