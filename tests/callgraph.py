# SPDX-License-Identifier: MIT
"""Worst-case stack, recursion and indirect calls, from the compiler's own call graph.

usage: callgraph.py [--calls] FILE.ci ...      (gcc -fcallgraph-info=su)

Adds the frames along the deepest chain of calls from every function that other files can see, and
prints the deepest ones, what is recursive, and what is called through a pointer: that may be the
port's clock alone (palp_port in servo/budget.h), whose own stack is the integrator's. Functions
that another library brings (memcpy) count 64 bytes. Exit code 1 if a frame is dynamic, a call
recursive, or a pointer called outside core/servo.
"""
import re
import sys

frame, calls, public, indirect, dynamic = {}, {}, set(), [], []
for path in (p for p in sys.argv[1:] if not p.startswith("--")):
    text = open(path).read()
    for m in re.finditer(r'node: \{ title: "([^"]+)" label: "([^"]+)"', text):
        title, label = m.group(1), m.group(2)
        size = re.search(r"(\d+) bytes \(([\w,]+)\)", label)
        if size is None:
            continue
        frame[title] = int(size.group(1))
        if size.group(2) == "dynamic":
            dynamic.append(title)
        if ":" not in title:
            public.add(title)
    for m in re.finditer(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"(?: label: "([^"]+)")?', text):
        calls.setdefault(m.group(1), set()).add(m.group(2))
        if m.group(2) == "__indirect_call":
            indirect.append((m.group(1), m.group(3) or path))

depth, recursive = {}, set()


def deepest(name, chain):
    if name in chain:
        recursive.add(name)
        return 0, ()
    if name in depth:
        return depth[name]
    if name == "__indirect_call":
        return 0, ()
    best, way = 0, ()
    for target in sorted(calls.get(name, ())):
        d, w = deepest(target, chain + (name,))
        if d > best:
            best, way = d, w
    depth[name] = (frame.get(name, 64) + best, (name,) + way)
    return depth[name]


table = sorted(((deepest(n, ())[0], n) for n in public), reverse=True)
largest = max(frame.items(), key=lambda f: f[1])
print("largest frame %d bytes (%s)" % (largest[1], largest[0].split(":")[-1]))
for bytes_, name in table[:6 if "--calls" not in sys.argv else len(table)]:
    print("%6d  %-28s %s" % (bytes_, name, " > ".join(n.split(":")[-1] for n in deepest(name, ())[1][1:])))
outside = [i for i in indirect if "core/servo" not in i[1] and "servo" not in i[0]]
print("%d functions, %d recursive, %d dynamic frames, %d indirect calls (the port's clock), %d of them outside core/servo" %
      (len(frame), len(recursive), len(dynamic), len(indirect), len(outside)))
for what in sorted(recursive) + dynamic + [i[0] for i in outside]:
    print("  " + what)
sys.exit(1 if recursive or dynamic or outside else 0)
