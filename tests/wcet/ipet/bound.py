# SPDX-License-Identifier: MIT
"""The most that a function can take, as a polynomial in named counts, from its machine code.

A turn of a loop takes at most the longest way from the loop's head back to it; loops inside are one node of that way, which
takes what its turns take. A loop of N turns goes N times around and once out of it; where its test stands at the end, it
goes around N times in all. Copies that the compiler made of one loop of the source (for alignment, or with several turns in one)
share the N turns. The larger of two branches is taken term by term, which is at least either."""
import collections

from binary import COPIES, Graph, kind_of
from flow import Flow
from polynomial import ONE, ZERO, Polynomial
from source import Unknown


class Fault(Exception):
    pass


class Part:
    """A function's graph, its loops and their names."""

    def __init__(self, binary, function, source):
        self.graph = Graph(binary, function)
        self.flow = Flow(self.graph)
        self.binary, self.source = binary, source
        binary.locate([a for h, (body, latches) in self.flow.loops.items() for n in [h] + latches
                       for a in self.graph.blocks[self.flow.block[n]][0]] + list(self.graph.calls))
        self.named = {h: self.name(h) for h in self.flow.loops}
        for h in sorted(self.flow.loops, key=lambda h: -len(self.flow.loops[h][0])):
            self.look_outside(h)
        self.regions, self.copied, self.head_of = {}, {}, {n: None for n in self.flow.out}
        for h in sorted(self.flow.loops, key=lambda h: -len(self.flow.loops[h][0])):
            for n in self.flow.loops[h][0]:
                self.head_of[n] = h

    def candidates(self, addresses):
        """(loop of the source, functions it is inlined in, innermost first, with the places of the calls)"""
        found = []
        for a in addresses:
            chain = self.binary.places.get(a, [])
            for i, place in enumerate(chain[:1]):
                loop = self.source.loops(place.file).get(place.line)
                if loop is not None:
                    one = (loop, tuple(chain[i:]))
                    if not any(o[0] == loop and o[1][1:] == one[1][1:] for o in found):
                        found.append(one)
        return found

    def name(self, head):
        body, latches = self.flow.loops[head]
        code = lambda n: self.graph.blocks[self.flow.block[n]][0]
        tail = self.candidates([a for n in latches for a in code(n)[-3:]])
        ending = [t for t in tail if self.ends_with(head, *t)]
        if len(tail) > 1 and len(ending) == 1:  # the test of one of them is what leads back to the head
            tail = ending
        if len(tail) != 1:
            wider = self.candidates([a for n in latches + [head] for a in code(n)])
            tail = tail or wider
        if not tail:
            self.binary.locate([a for n in body for a in code(n)])
            tail = self.candidates([a for n in sorted(body, key=lambda n: self.flow.number[n]) for a in code(n)])
        # where the loop's own instructions are of the header of a loop around that one as well, it may be either: two loops of the
        # source with one head
        inner = set().union(*[flow_body for h, (flow_body, _) in self.flow.loops.items() if self.flow.parent[h] == head] or [set()])
        own = [n for n in body if n not in inner]
        self.binary.locate([a for n in own for a in code(n)])
        places = [self.binary.places.get(a, []) for n in own for a in code(n)]
        places = [p for p in places if p]

        def within(loop, chain):  # share of the loop's own instructions that stand in a loop of the source
            inside = sum(any(p.file == loop.path and loop.first <= p.line <= loop.end and tuple(place[i + 1:]) == tuple(chain[1:])
                             for i, p in enumerate(place)) for place in places)
            return inside / max(len(places), 1)
        if len(tail) == 1 and self.ends_with(head, *tail[0]) and not any(
                self.named_early(h) == tail[0][0] for h in self.flow.loops if h != head and h in body):
            return tail
        if len(tail) == 1 and within(*tail[0]) < 0.5:  # the innermost loop that most of it stands in
            around = {}
            for place in places:
                for i, p in enumerate(place):
                    for loop in set(self.source.loops(p.file).values()):
                        if loop.first <= p.line <= loop.end:
                            around[loop, tuple(place[i + 1:])] = (loop, tuple(place[i:]))
            around = [c for c in around.values() if within(*c) >= 0.5]
            if around:
                tail = [max(around, key=lambda c: (len(c[1]), c[0].first - c[0].end))]
        for loop, chain in [t for t in tail if within(*t) < 0.8]:
            for other, around in self.candidates([a for n in own for a in code(n)]):
                encloses = other.path == loop.path and other.first <= loop.first and other.end >= loop.end
                if encloses and other != loop and around[1:] == chain[1:] and all(t[0] != other for t in tail):
                    tail.append((other, around))
        if not tail:  # no instruction is of a loop's header: the smallest loop of the source around the head
            chain = self.binary.places.get(code(head)[0], [])
            around = [(loop.end - loop.first, i, loop) for i, place in enumerate(chain[:1])
                      for loop in set(self.source.loops(place.file).values()) if loop.first <= place.line <= loop.end]
            if around:
                _, i, loop = min(around, key=lambda a: a[0])
                tail = [(loop, tuple(chain[i:]))]
        if len(tail) > 1:
            # of several, those whose lines hold the head's
            chain = self.binary.places.get(code(head)[0], [])
            holding = [t for t in tail if any(p.file == t[0].path and t[0].first <= p.line <= t[0].end for p in chain)]
            tail = holding or tail
            inner = [self.named_early(h) for h in self.flow.loops if self.flow.parent[h] == head]
            rest = [t for t in tail if t[0] not in inner]
            tail = rest or tail
        return tail

    def ends_with(self, head, loop, chain):
        """Whether each way back to the head is the test of that loop of the source, which else leaves."""
        body, latches = self.flow.loops[head]

        def tests(n):
            place = self.binary.places.get(self.graph.blocks[self.flow.block[n]][0][-1], [])
            return any(p.file == loop.path and loop.first <= p.line <= loop.last and tuple(place[i + 1:]) == tuple(chain[1:])
                       for i, p in enumerate(place))
        return all(tests(n) and any(t not in body for t in self.flow.out[n]) for n in latches)

    def own(self, head):
        """Places of the instructions of a loop that are in no loop inside of it."""
        inner = set().union(*[b for h, (b, _) in self.flow.loops.items() if self.flow.parent[h] == head] or [set()])
        chains = [self.binary.places.get(a, []) for n in self.flow.loops[head][0] - inner
                  for a in self.graph.blocks[self.flow.block[n]][0]]
        return [chain for chain in chains if chain]

    @staticmethod
    def stands_in(place, loop, around):
        return any(p.file == loop.path and loop.first <= p.line <= loop.end and tuple(place[i + 1:]) == around
                   for i, p in enumerate(place))

    def look_outside(self, head):
        """A loop and one inside it that have the same name are copies of one loop of the source; but not where the outer one does what
        stands outside of that: then it is the loop around it."""
        ids = {(c[0], c[1][1:]) for c in self.named[head]}
        if not any(ids & {(c[0], c[1][1:]) for c in self.named[h]} for h in self.flow.loops if h != head and h in self.flow.loops[head][0]):
            return
        places = self.own(head)
        for loop, around in ids:
            if self.ends_with(head, loop, (None,) + around) or all(self.stands_in(p, loop, around) for p in places):
                continue
            found = {}
            for place in places:
                for i, p in enumerate(place):
                    for other in set(self.source.loops(p.file).values()):
                        key = (other, tuple(place[i + 1:]))
                        if other != loop and all(self.stands_in(q, *key) for q in places):
                            found[key] = (other, tuple(place[i:]))
            if found:
                self.named[head] = [max(found.values(), key=lambda c: (len(c[1]), c[0].first - c[0].end))]

    def region(self, within):
        """(nodes, successors, nodes that leave, nodes that go back) of a function or of a turn of a loop; loops inside are one node."""
        if within not in self.regions:
            flow = self.flow
            body = flow.loops[within][0] if within is not None else set(flow.out)
            node = {n: self.node_in(within, n) for n in body}
            out, leaves, back = collections.defaultdict(set), set(), set()
            for n in body:
                if not flow.out[n]:
                    leaves.add(node[n])
                for t in flow.out[n]:
                    if t == within:
                        back.add(node[n])
                    elif t not in body:
                        leaves.add(node[n])
                    elif node[t] != node[n]:
                        out[node[n]].add(node[t])
            self.regions[within] = (set(node.values()), {n: sorted(t) for n, t in out.items()}, leaves, back)
        return self.regions[within]

    def copies(self, head):
        """(the region around all copies of a loop of the source, those copies): beside each other, or within each other where the
        ways to the next turn were split. They share the loop's turns."""
        if head not in self.copied:
            flow = self.flow
            ids = lambda h: {(c[0], c[1][1:]) for c in self.named[h]}
            top = lambda h: h if flow.parent[h] is None or not ids(h) & ids(flow.parent[h]) else top(flow.parent[h])
            region = flow.parent[top(head)]
            self.copied[head] = (region, tuple(sorted(
                h for h in flow.loops if flow.parent[top(h)] == region and ids(h) & ids(head))))
        return self.copied[head]

    def node_in(self, within, n):
        """n itself, or the head of the outermost loop inside `within` that holds it."""
        h, last = self.head_of[n], n
        while h is not None and h != within:
            last, h = h, self.flow.parent[h]
        return last

    def test_at_end(self, head):
        """Whether each pass through the loop, the last one too, is one turn of the source's: only its end leaves it. Else there is one pass
        more than there are turns, for the test."""
        flow = self.flow
        body, latches = flow.loops[head]
        leaving = {n for n in body if not flow.out[n] or any(t not in body for t in flow.out[n])}
        if len(body) == 1:
            return not any(c[0].empty for c in self.named[head])
        if leaving == set(latches):
            return True
        # or others leave it from within: by a return or a break, not by its test
        def tests(n):
            place = self.binary.places.get(self.graph.blocks[self.flow.block[n]][0][-1], [])
            return any(p.file == loop.path and loop.first <= p.line <= loop.last and tuple(place[i + 1:]) == chain[1:]
                       for loop, chain in self.named[head] for i, p in enumerate(place))
        self.binary.locate([self.graph.blocks[self.flow.block[n]][0][-1] for n in leaving | set(latches)])
        return all(n in leaving and tests(n) for n in latches) and not any(tests(n) for n in leaving - set(latches))

    def named_early(self, head):
        latches = self.flow.loops[head][1]
        tail = self.candidates([a for n in latches for a in self.graph.blocks[self.flow.block[n]][0][-3:]])
        return tail[0][0] if len(tail) == 1 else None


class Bounds:
    """weigh(mnemonic, operands): what an instruction counts. outside(name, bytes): what a call of a stand-in takes."""

    def __init__(self, binary, source, weigh=lambda mnemonic, operands: 1, outside=None, indirect=ZERO):
        self.binary, self.source, self.weigh = binary, source, weigh
        self.outside, self.indirect = outside, indirect
        self.parts, self.memo, self.faults, self.matched = {}, {}, collections.OrderedDict(), set()
        self.facts = collections.defaultdict(list)  # (function, head of a loop) -> (turns, function in all of which, place)
        self.by_name = collections.defaultdict(list)
        for a, f in binary.functions.items():
            self.by_name[f.name].append(a)
        self.stops = {}  # name of a function -> what its call takes instead of its own bound

    def part(self, start):
        if start not in self.parts:
            self.parts[start] = Part(self.binary, self.binary.functions[start], self.source)
        return self.parts[start]

    def of(self, name):
        """The bound of a public function."""
        starts = self.by_name.get(name, [])
        if len(starts) != 1:
            raise Fault("%d functions are called %s" % (len(starts), name))
        return self.call(starts[0], ())[0]

    def frames(self, chain, context):
        names = [p.function for p in chain] + list(context)
        return [n for i, n in enumerate(names) if i == 0 or n != names[i - 1]]  # a part of a function is called by the rest of it

    def turns(self, part, head, context):
        """(polynomial, function in all of which these are the turns, or None)"""
        candidates = part.named[head]
        where = "%s at %x" % (part.graph.function.name, part.flow.block[head])
        if not candidates:
            self.faults[where] = "a loop of no loop of the source"
            return ZERO, None
        most, scopes = None, set()
        for loop, chain in candidates:
            frames = self.frames(chain, context)
            at = "%s:%d in %s" % (loop.path, loop.first, " < ".join(dict.fromkeys(frames)))
            limit = loop.limit or "?"
            if not loop.counted:
                limit = limit.split(":")[0].split(";")[0]
            try:
                value, scope = self.source.polynomial(limit, loop.path, frames, not loop.counted)
                if loop.step is not None and scope is None:
                    step = self.source.polynomial(loop.step, loop.path, frames)[0].at({})
                    whole = all(c % step == 0 for c in value.terms.values())  # of whole numbers
                    value = (Polynomial.of(-(-value.at({}) // step)) if not value.names()
                             else value.scaled(1.0 / step) + Polynomial.of(0 if whole else (step - 1.0) / step))
            except Unknown as e:
                self.faults[at] = "%s is no count (%s)" % (e, limit)
                value, scope = ZERO, None
            if scope is not None and scope not in frames:
                self.faults[at] = "%s in all of %s, which does not call it" % (limit, scope)
                scope = None
            self.matched.add((loop.path, loop.first))
            most = value if most is None else most.most(value)
            scopes.add(scope)
        scope = scopes.pop() if len(scopes) == 1 else None
        place = candidates[0][0]
        self.facts[part.graph.function.start, part.flow.block[head]].append((most, scope, "%s:%d" % (place.path, place.first)))
        return most, scope

    def copies_bytes(self, part, a, context):
        number = part.graph.bytes_at(a)
        if number is not None:
            return Polynomial.of(number)
        self.binary.locate([a])
        chain = self.binary.places.get(a, [])
        frames = self.frames(chain, context)
        path = chain[0].file if chain else ""
        try:
            return self.source.resolve("bytes", path, frames)
        except Unknown:
            at = "%s:%d" % (chain[0].file, chain[0].line) if chain else "%s at %x" % (part.graph.function.name, a)
            self.faults["%s in %s" % (at, " < ".join(dict.fromkeys(frames)))] = "how many bytes are copied is not said"
            return ZERO

    def call(self, start, context):
        key = (start, context)
        if key not in self.memo:
            self.memo[key] = None
            self.memo[key] = self.function(start, context)
        if self.memo[key] is None:
            raise Fault("%s calls itself" % self.binary.functions[start].name)
        return self.memo[key]

    def called(self, part, a, context):
        """What the call at `a` takes beside its own instruction, and what is pending."""
        target = part.graph.calls[a]
        if target is None:
            return self.indirect, {}
        f = self.binary.functions.get(target)
        name = f.name.split(".")[0] if f is not None else "?"
        if f is None:
            self.faults["%s at %x" % (part.graph.function.name, a)] = "calls what is not here"
            return ZERO, {}
        if name in COPIES:
            return self.outside(name, self.copies_bytes(part, a, context)), {}
        if name in self.stops:
            return self.stops[name], {}
        frames = self.frames(self.binary.places.get(a, []), context)
        inner = tuple(x for x in frames if x in self.source.functions or x in self.source.scopes)
        value, pending = self.call(target, inner)
        total = self.source.find("calls of " + name, "", list(frames))
        if total is None:
            return value, pending
        times, scope = self.source.polynomial("calls of " + name, "", list(frames))
        pending = dict(pending)
        gather(pending, {(scope, name, 0): times * value})
        return ZERO, pending

    def function(self, start, context):
        part = self.part(start)
        name = part.graph.function.name.split(".")[0]
        if part.flow.irreducible:
            self.faults[name] = "irreducible"
        for u in part.graph.unknown:
            self.faults[name] = u
        return Evaluation(self, part, name, context).all()


def gather(sums, more):
    """What is still to be added in all of a function, by (function, loop): copies of a loop share it."""
    for key, value in more.items():
        sums[key] = sums[key].most(value) if key in sums else value


class Evaluation:
    """Of one function, called from `context`."""

    def __init__(self, bounds, part, name, context):
        self.bounds, self.part, self.flow, self.name, self.context = bounds, part, part.flow, name, context
        self.takes, self.pending = {}, {}  # of nodes, and of loops by their heads as seen from around
        self.shared = {None: {}}           # region -> copies -> (turns, turn)
        self.head_of = part.head_of

    def all(self):
        flow, graph = self.flow, self.part.graph
        for n in flow.out:
            value, pending = Polynomial.of(sum(self.bounds.weigh(*graph.code[a]) for a in graph.blocks[flow.block[n]][0])), {}
            for a in graph.blocks[flow.block[n]][0]:
                if a in graph.calls:
                    more, wait = self.bounds.called(self.part, a, self.context)
                    value = value + more
                    gather(pending, wait)
            self.takes[n], self.pending[n] = value, pending
        self.loop_takes, self.loop_pending = {}, {}
        for h in sorted(flow.loops, key=lambda h: len(flow.loops[h][0])):
            self.loop(h)
        start = self.part.node_in(None, flow.entry)
        value, pending = self.way(None, start, None), self.pending_in(None)
        keep = {k: v for k, v in pending.items() if k[0] in self.context and k[0] != self.name}
        for k, v in pending.items():
            if k not in keep:
                value = value + v
        return value + self.copies_in(None), keep

    def copies_in(self, region):
        total = ZERO
        for turns, turn in self.shared.get(region, {}).values():
            total = total + turns * turn
        return total

    def pending_in(self, region):
        sums = {}
        for n in self.part.region(region)[0]:
            gather(sums, self.loop_pending[n] if n in self.flow.loops and n != region else self.pending[n])
        return sums

    def way(self, region, start, ends):
        """The longest way from start to one of `ends` (or to wherever it ends), or None."""
        _, out, _, _ = self.part.region(region)
        best, todo = {}, [start]
        while todo:
            n = todo[-1]
            if n in best:
                todo.pop()
                continue
            later = [t for t in out.get(n, ()) if t not in best]
            if later:
                todo += later
                continue
            most = ZERO if ends is None or n in ends else None
            for t in out.get(n, ()):
                if best[t] is not None:
                    most = best[t] if most is None else most.most(best[t])
            own = self.loop_takes[n] if n in self.flow.loops and n != region else self.takes[n]
            best[n] = None if most is None else own + most
            todo.pop()
        return best[start]

    def loop(self, head):
        """What a loop takes each time that it is entered, and what of it is pending in all of a function."""
        flow, part, bounds = self.flow, self.part, self.bounds
        _, _, leaves, back = part.region(head)
        full = self.way(head, head, back) or ZERO
        leave = self.way(head, head, leaves) or ZERO
        copies = self.copies_in(head)
        turns, scope = bounds.turns(part, head, self.context)
        frames = bounds.frames(part.named[head][0][1], self.context) if part.named[head] else []
        keep = {}
        for key, value in self.pending_in(head).items():
            if key[0] in frames:
                keep[key] = value
            else:
                copies = copies + value
        full, leave = full + copies, leave + copies
        at_end = part.test_at_end(head)
        turn, once = full, leave.beyond(full) if at_end else leave
        region, same = part.copies(head)
        if scope is not None:
            loop = part.named[head][0][0]
            gather(keep, {(scope, loop.path, loop.first): turns * turn})
        elif len(same) > 1:
            group = self.shared.setdefault(region, {})
            old = group.get(same)
            group[same] = (turns, turn) if old is None else (turns.most(old[0]), turn.most(old[1]))
        else:
            once = once + turns * turn
        self.loop_takes[head], self.loop_pending[head] = once, keep
