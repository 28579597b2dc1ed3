# SPDX-License-Identifier: MIT
"""The source's loops, and the counts that their limits stand for (counts.txt)."""
import fnmatch
import glob
import os
import re
import subprocess
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
import loops  # tests/loops.py
from polynomial import Polynomial

TOKEN = re.compile(r"\s*(?:(\d+)u?(?![\w.])|([A-Za-z_][\w]*(?:(?:->|\.)\w+|\[[^\[\]]*(?:\[[^\[\]]*\][^\[\]]*)*\])*)|([-+*/()]))")


class Unknown(Exception):
    pass


def plain(text):
    return " ".join(text.split())


class Source:
    def __init__(self, root, table):
        self.root, self.by_file, self.sections, self.constants = root, {}, [], {}
        self.used = set()
        section = None
        for number, line in enumerate(open(table), 1):
            line = line.split("#")[0].rstrip()
            if not line:
                continue
            if line.startswith("in "):
                section = (line[3:].strip(), {})
                self.sections.append(section)
                continue
            name, equals, value = line.partition(" = ")
            if not equals or section is None:
                raise SystemExit("%s:%d: NAME = COUNT below an 'in' line is expected" % (table, number))
            section[1][plain(name)] = value.strip()
        self.longest_first = sorted(self.sections, key=lambda s: -len(s[0]))
        self.functions = {f for name, _ in self.sections if "/" not in name for f in name.split(" < ")}
        self.scopes = {v.split(" in all of ")[1] for _, names in self.sections for v in names.values() if " in all of " in v}
        for path in glob.glob(os.path.join(root, "core/*/*.[ch]")):
            self.scopes |= set(re.findall(r"in all of (\w+)", open(path).read()))

    def loops(self, path):
        if path not in self.by_file:
            full = os.path.join(self.root, path)
            found = loops.loops_in(full) if os.path.exists(full) else []
            self.by_file[path] = {n: loop._replace(path=path) for loop in found for n in range(loop.first, loop.last + 1)}
        return self.by_file[path]

    def constant(self, name, path):
        """The value of a macro or an enumerator, by the compiler."""
        if (path, name) not in self.constants:
            text = '#include "core/palp.h"\n#include "%s"\nconst long long palp_value_ = (long long)(%s);\n' % (path or "core/palp.h", name)
            done = subprocess.run(["gcc", "-std=c11", "-ffreestanding", "-w", "-I", self.root, "-S", "-x", "c", "-", "-o", "-"],
                                  input=text, capture_output=True, text=True)
            m = re.search(r"palp_value_:\s*\n\s*\.(?:quad|zero)\s+(-?\d+)", done.stdout)
            zero = re.search(r"palp_value_:\s*\n\s*\.zero", done.stdout)
            self.constants[path, name] = (0 if zero else int(m.group(1))) if m else None
        return self.constants[path, name]

    def find(self, name, path, frames):
        """(value, frames outside of it) of a name: by the function that it stands in, then by its callers, by the file; or None."""
        for i in range(len(frames)):
            for where, names in self.longest_first:
                chain = where.split(" < ")
                if "/" not in where and name in names and frames[i:i + len(chain)] == chain:
                    self.used.add((where, name))
                    return names[name], frames[i + len(chain) - (len(chain) > 1):]
        for where, names in self.longest_first:
            if "/" in where and fnmatch.fnmatch(path, where) and name in names:
                self.used.add((where, name))
                return names[name], None
        return None

    def polynomial(self, text, path, frames, is_count=False):
        """(the bound that `text` names where it stands in `path`, in one of the functions `frames`, innermost first;
        the function in all of which it is the bound, or None)"""
        text, scope, outer = plain(text), None, frames
        found = self.find(text, path, frames)
        if found is not None:
            text, outer, is_count = found[0], found[1], True
        if " in all of " in text:
            text, scope = text.split(" in all of ")
        return Parser(text, lambda name: self.resolve(name, path, outer, is_count)).all(), scope

    def resolve(self, name, path, frames, is_count=False):
        """A name of the source; or of a count (in a value of counts.txt), unless `frames` say what it is."""
        found = self.find(name, path, frames) if frames is not None else None
        if found is not None and found[0] != name:
            return Parser(found[0], lambda n: self.resolve(n, path, found[1], True)).all()
        if re.fullmatch(r"[A-Z][A-Z_0-9]*", name):
            number = self.constant(name, path)
            if number is not None:
                return Polynomial.of(number)
        if is_count or found is not None:
            return Polynomial.count(name)
        raise Unknown(name)


class Parser:
    """Sums, differences (of which only what is added counts), products and quotients by a number."""

    def __init__(self, text, resolve):
        self.words, at = [], 0
        while at < len(text.rstrip()):
            m = TOKEN.match(text, at)
            if not m:
                raise Unknown(text)
            self.words.append(m.groups())
            at = m.end()
        self.at, self.resolve, self.text = 0, resolve, text

    def look(self):
        return self.words[self.at][2] if self.at < len(self.words) else None

    def all(self):
        value = self.sum()
        if self.at != len(self.words):
            raise Unknown(self.text)
        return value

    def sum(self):
        value = self.product()
        while self.look() in ("+", "-"):
            sign = self.look()
            self.at += 1
            term = self.product()
            if sign == "+":
                value = value + term
            elif not term.names() and not value.names():
                value = Polynomial.of(max(value.at({}) - term.at({}), 0))
        return value

    def product(self):
        value = self.one()
        while self.look() in ("*", "/"):
            sign = self.look()
            self.at += 1
            by = self.one()
            if sign == "*":
                value = value * by
            elif by.names():
                raise Unknown(self.text)
            else:
                value = value.scaled(1.0 / by.at({}))
        return value

    def one(self):
        if self.at >= len(self.words):
            raise Unknown(self.text)
        number, name, sign = self.words[self.at]
        self.at += 1
        if number is not None:
            return Polynomial.of(int(number))
        if name is not None:
            return self.resolve(name)
        if sign == "(":
            value = self.sum()
            if self.look() != ")":
                raise Unknown(self.text)
            self.at += 1
            return value
        raise Unknown(self.text)
