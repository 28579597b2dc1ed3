# SPDX-License-Identifier: MIT
"""Loops of a control flow graph: dominators, natural loops, and graphs with loops of several entries, which
are made to have one each by copying the way from the other entries to the loop's head."""
import collections


class Flow:
    """Nodes are numbers; block[n] is the start of the block that node n stands for, so that a copy of a block
    is a node of its own."""

    def __init__(self, graph):
        self.graph = graph
        starts = sorted(graph.blocks)
        self.block = {s: s for s in starts}
        self.out = {s: list(graph.blocks[s][1]) for s in starts}
        self.entry = graph.addresses[0]
        self.copied = 0
        self.fresh = -1
        self.make_reducible()
        self.find_loops()

    # ---- several entries ----

    def components(self, nodes, out):
        """Strongly connected components of more than one node (or with an edge to itself), without recursion."""
        index, low, on, stack, found, counter = {}, {}, set(), [], [], 0
        for root in nodes:
            if root in index:
                continue
            work = [(root, 0)]
            while work:
                n, i = work.pop()
                if i == 0:
                    index[n] = low[n] = counter
                    counter += 1
                    stack.append(n)
                    on.add(n)
                again = False
                goes = [t for t in out[n] if t in nodes]
                while i < len(goes):
                    t = goes[i]
                    i += 1
                    if t not in index:
                        work.append((n, i))
                        work.append((t, 0))
                        again = True
                        break
                    if t in on:
                        low[n] = min(low[n], index[t])
                if again:
                    continue
                if low[n] == index[n]:
                    part = set()
                    while True:
                        t = stack.pop()
                        on.discard(t)
                        part.add(t)
                        if t == n:
                            break
                    if len(part) > 1 or n in out[n]:
                        found.append(part)
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[n])
        return found

    def several_entries(self):
        """(part, entries) of a loop that is entered in several places, from outside in; None when there is none."""
        todo = [set(self.out)]
        while todo:
            for part in self.components(todo.pop(), self.out):
                entries = sorted({t for s in self.out if s not in part for t in self.out[s] if t in part} |
                                 ({self.entry} & part))
                if len(entries) > 1:
                    return part, entries
                todo.append(part - set(entries))
        return None

    def make_reducible(self):
        while True:
            found = self.several_entries()
            if found is None:
                return
            part, entries = found
            back = {e: sum(e in self.out[s] for s in part) for e in entries}
            head = max(entries, key=lambda e: (back[e], -e))
            for e in entries:
                if e != head:
                    self.copy_from(e, head, part)
                    self.copied += 1
            self.forget_unreached()
            if self.copied > 200:
                raise SystemExit("%s has too many loops with several entries" % self.graph.function.name)

    def forget_unreached(self):
        reach, stack = set(), [self.entry]
        while stack:
            n = stack.pop()
            if n not in reach:
                reach.add(n)
                stack += self.out[n]
        self.out = {n: t for n, t in self.out.items() if n in reach}

    def copy_from(self, e, head, part):
        """Edges from outside to e go to a copy of e and of all that is reached from it before the head."""
        reach, stack = set(), [e]
        while stack:
            n = stack.pop()
            if n in reach or n == head or n not in part:
                continue
            reach.add(n)
            stack += self.out[n]
        copy = {}
        for n in sorted(reach):
            copy[n] = self.fresh
            self.block[self.fresh] = self.block[n]
            self.fresh -= 1
        for n in reach:
            self.out[copy[n]] = [copy.get(t, t) for t in self.out[n]]
        for s in list(self.out):
            if s not in part and s not in copy.values():
                self.out[s] = [copy[t] if t == e else t for t in self.out[s]]

    # ---- natural loops ----

    def find_loops(self):
        order, seen, stack = [], set(), [(self.entry, 0)]
        seen.add(self.entry)
        while stack:
            n, i = stack.pop()
            if i < len(self.out[n]):
                stack.append((n, i + 1))
                t = self.out[n][i]
                if t not in seen:
                    seen.add(t)
                    stack.append((t, 0))
            else:
                order.append(n)
        order.reverse()
        number = {n: i for i, n in enumerate(order)}
        self.before = collections.defaultdict(list)
        for n in order:
            for t in self.out[n]:
                self.before[t].append(n)
        parent = {self.entry: self.entry}
        changed = True
        while changed:
            changed = False
            for n in order:
                if n == self.entry:
                    continue
                new = None
                for p in self.before[n]:
                    if p in parent:
                        if new is None:
                            new = p
                        else:
                            a, b = p, new
                            while a != b:
                                while number[a] > number[b]:
                                    a = parent[a]
                                while number[b] > number[a]:
                                    b = parent[b]
                            new = a
                if parent.get(n) != new:
                    parent[n] = new
                    changed = True
        self.order, self.number = order, number

        def dominates(h, n):
            while number[n] > number[h]:
                n = parent[n]
            return n == h
        self.loops = {}  # head -> (body, latches)
        self.irreducible = False
        for s in order:
            for t in self.out[s]:
                if number[t] <= number[s]:
                    if not dominates(t, s):
                        self.irreducible = True
                        continue
                    body, latches = self.loops.setdefault(t, ({t}, []))
                    latches.append(s)
                    todo = [s]
                    while todo:
                        x = todo.pop()
                        if x not in body:
                            body.add(x)
                            todo += self.before[x]
        self.parent = {}
        for h, (body, _) in self.loops.items():
            around = [(len(b), g) for g, (b, _) in self.loops.items() if g != h and h in b]
            self.parent[h] = min(around)[1] if around else None
