# SPDX-License-Identifier: MIT
"""Functions of a linked binary: instructions, blocks, branches, calls, and the source they come from."""
import collections
import re
import subprocess

TOOLS = {"cortex-m7": "arm-none-eabi-", "cortex-a53": "aarch64-linux-gnu-", "x86-64": "", "x86-64-avx2": ""}
ARM_CONDITION = "eq ne cs cc mi pl vs vc hi ls ge lt gt le hs lo".split()
COPIES = {"memcpy", "memset", "memmove", "memcmp"}  # stand-ins in the link: their cost is by bytes
SIZE_REGISTER = {"cortex-m7": ("r2",), "cortex-a53": ("x2", "w2"), "x86-64": ("%rdx", "%edx"), "x86-64-avx2": ("%rdx", "%edx")}


class Function:
    def __init__(self, name, start):
        self.name, self.start = name, start
        self.code = {}  # address -> (mnemonic, operands)


Place = collections.namedtuple("Place", "file line column function")


def kind_of(target, mnemonic, operands):
    """(what it does: next, jump, branch, call, return, indirect; the operand has its target's address)"""
    if target == "cortex-m7":
        base = mnemonic.split(".")[0]
        conditional = base[1:] in ARM_CONDITION and base[0] == "b" and len(base) == 3
        if base in ("bl", "blx"):
            return "call"
        if base in ("cbz", "cbnz") or conditional:
            return "branch"
        if base == "b":
            return "jump"
        if base in ("tbb", "tbh"):
            return "indirect"
        m = re.match(r"(bx|pop|ldmia|ldm|ldr)(%s)?$" % "|".join(ARM_CONDITION), base)
        writes_pc = base.startswith("bx") or re.search(r"\bpc\}?$", operands.split(";")[0].strip()) or (
            base.startswith("ldr") and operands.startswith("pc,"))
        if m and writes_pc:
            return "branch-return" if m.group(2) else ("return" if "lr" in operands or "pc" in operands else "indirect")
        return "next"
    if target == "cortex-a53":
        if mnemonic in ("bl", "blr"):
            return "call"
        if mnemonic == "ret":
            return "return"
        if mnemonic == "br":
            return "indirect"
        if mnemonic == "b":
            return "jump"
        if mnemonic.startswith("b.") or mnemonic in ("cbz", "cbnz", "tbz", "tbnz"):
            return "branch"
        return "next"
    if mnemonic.startswith("call"):
        return "call"
    if mnemonic.startswith("ret") or operands == "ret":
        return "return"
    if mnemonic == "jmp":
        return "indirect" if operands.startswith("*") else "jump"
    if mnemonic.startswith("j"):
        return "branch"
    return "next"


class Binary:
    def __init__(self, target, path, root):
        self.target, self.path, self.root = target, path, root
        self.functions = {}  # by address
        self.symbolizer = None
        self.read()
        self.places = {}

    def read(self):
        text = subprocess.run([TOOLS[self.target] + "objdump", "-d", "--no-show-raw-insn", "-w", self.path],
                              capture_output=True, text=True, check=True).stdout
        f = None
        for line in text.split("\n"):
            m = re.match(r"^([0-9a-f]+) <(.+)>:$", line)
            if m:
                f = self.functions[int(m.group(1), 16)] = Function(m.group(2), int(m.group(1), 16))
                continue
            m = re.match(r"^\s*([0-9a-f]+):\s+(\S+)\s*(.*)$", line)
            if m and f is not None and not m.group(2).startswith((".word", ".short", ".byte", ".inst")):
                mnemonic, operands = m.group(2), m.group(3)
                if self.target.startswith("x86-64") and mnemonic in ("rep", "repz", "bnd", "notrack", "data16"):
                    mnemonic, _, operands = operands.partition(" ")
                if self.target == "cortex-m7" and mnemonic == "@":
                    continue
                f.code[int(m.group(1), 16)] = (mnemonic, re.split(r";|//|@", operands)[0].strip())
        self.functions = {a: f for a, f in self.functions.items() if f.code}

    def ask(self, addresses):
        """The lines that llvm-symbolizer, which is kept open, says of each address; each answer ends with an empty line."""
        if self.symbolizer is None:
            self.symbolizer = subprocess.Popen(["llvm-symbolizer", "--obj=" + self.path, "--inlining", "--output-style=LLVM"],
                                               stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        answers = []
        for first in range(0, len(addresses), 100):  # no more than the pipes hold
            some = addresses[first:first + 100]
            self.symbolizer.stdin.write("".join("0x%x\n" % a for a in some))
            self.symbolizer.stdin.flush()
            for _ in some:
                lines = []
                while True:
                    line = self.symbolizer.stdout.readline()
                    if line == "":
                        raise SystemExit("llvm-symbolizer ended")
                    if line == "\n":
                        break
                    lines.append(line.rstrip("\n"))
                answers.append(lines)
        return answers

    def locate(self, addresses):
        """Fills self.places: of each address the chain of places, innermost inlined function first."""
        addresses = sorted(set(addresses) - set(self.places))
        if not addresses:
            return
        for address, answer in zip(addresses, self.ask(addresses)):
            chain, lines = [], answer
            for function, where in zip(lines[::2], lines[1::2]):
                m = re.match(r"^(.*):(\d+):(\d+)$", where)
                if m and m.group(1) != "??":
                    at = m.group(1).find("core/")
                    chain.append(Place(m.group(1)[max(at, 0):], int(m.group(2)), int(m.group(3)), function.split(".")[0]))
            self.places[address] = chain


class Graph:
    """The control flow of a function: blocks, their instructions and successors, calls."""

    def __init__(self, binary, function):
        self.binary, self.function = binary, function
        self.code = function.code
        self.addresses = sorted(self.code)
        self.after = dict(zip(self.addresses, self.addresses[1:]))
        self.calls = {}  # address -> name or address of what is called
        self.unknown = []
        self.out = {}    # instruction -> successors
        self.build()

    def target_of(self, operands):
        m = re.search(r"([0-9a-f]+)\s*<", operands)
        return int(m.group(1), 16) if m else None

    def build(self):
        lead = {self.addresses[0]}
        for a in self.addresses:
            mnemonic, operands = self.code[a]
            kind, nxt = kind_of(self.binary.target, mnemonic, operands), self.after.get(a)
            goes = [nxt] if nxt is not None else []
            if kind == "call":
                self.calls[a] = self.target_of(operands)
            elif kind in ("jump", "branch"):
                t = self.target_of(operands)
                if t in self.code:
                    goes = [t] + (goes if kind == "branch" else [])
                    lead.add(t)
                else:  # a call in the last place
                    self.calls[a] = t
                    goes = goes if kind == "branch" else []
                lead.update([nxt] if nxt is not None else [])
            elif kind in ("return", "branch-return", "indirect"):
                goes = goes if kind == "branch-return" else []
                lead.update([nxt] if nxt is not None else [])
                if kind == "indirect":
                    if mnemonic.startswith(("tb", "jmp")) and not operands.startswith("*%r"):
                        self.unknown.append("switch at %x" % a)
                    else:
                        self.calls[a] = None
            self.out[a] = goes
        self.blocks = {}  # start -> (addresses, successors)
        for s in sorted(lead):
            run = [s]
            while len(self.out[run[-1]]) == 1 and self.out[run[-1]][0] == self.after.get(run[-1]) and self.out[run[-1]][0] not in lead:
                run.append(self.after[run[-1]])
            self.blocks[s] = (run, sorted(set(self.out[run[-1]])))
        seen, todo = set(), [self.addresses[0]]
        while todo:
            s = todo.pop()
            if s not in seen:
                seen.add(s)
                todo += self.blocks[s][1]
        self.blocks = {s: b for s, b in self.blocks.items() if s in seen}

    def bytes_at(self, call):
        """The constant number of bytes that a call of memcpy and the like has, or None."""
        a, register = call, SIZE_REGISTER[self.binary.target]
        before = {b: x for x, b in self.after.items()}
        for _ in range(60):
            a = before.get(a)
            if a is None or kind_of(self.binary.target, *self.code[a]) not in ("next",):
                return None
            mnemonic, operands = self.code[a]
            words = [w.strip() for w in operands.split(",")]
            if self.binary.target.startswith("x86-64"):
                if words and words[-1] in register:
                    m = re.match(r"^\$(0x[0-9a-f]+|\d+)$", words[0])
                    return int(m.group(1), 0) if mnemonic.startswith("mov") and m else None
            elif words and words[0] in register:
                m = re.match(r"^#(0x[0-9a-f]+|\d+)$", words[1]) if len(words) == 2 else None
                return int(m.group(1), 0) if mnemonic.startswith("mov") and m else None
        return None
