# SPDX-License-Identifier: MIT
"""Every loop of core and what bounds it.

usage: loops.py [--list] FILE.c ...

A loop is bounded when it is a `for` that counts one variable up to a limit (one by one, by a
constant, or from marked slot to marked slot) or down to one, and does not assign it in its body; or when a comment on its line or the one before names
the bound with the words "at most". All others are printed, and make the exit code 1.
"""
import re
import sys

listing = "--list" in sys.argv
files = [f for f in sys.argv[1:] if not f.startswith("--")]
counted = named = 0
without = []


def header(text, at):
    """The parenthesis that begins at text[at], and where it ends."""
    depth = 0
    for i in range(at, len(text)):
        depth += {"(": 1, ")": -1}.get(text[i], 0)
        if depth == 0:
            return text[at + 1:i], i + 1
    raise SystemExit("unbalanced parentheses")


def body_of(text, at):
    """The statement or block after a loop's header."""
    while text[at].isspace():
        at += 1
    if text[at] != "{":
        return text[at:text.index(";", at)]
    depth = 0
    for i in range(at, len(text)):
        depth += {"{": 1, "}": -1}.get(text[i], 0)
        if depth == 0:
            return text[at:i]
    return text[at:]


def counter_bound(head, body):
    """The limit of a counting `for`, or None."""
    part = head.split(";")
    if len(part) != 3:
        return None
    step = part[2].strip()
    for condition in part[1].strip().split(" && "):
        down = re.fullmatch(r"(\w+)-- > (?:0u?|.+)", condition)
        fall = re.fullmatch(r"([\w>-]+) > (.+)", condition)
        up = re.match(r"(\w+)(?: \+ [\w *]+?)? (<|<=) (.+)", condition)
        if down and step == "":
            name, limit = down.group(1), re.search(r"= (.+)", part[0])
            limit = limit.group(1) if limit else condition
        elif fall and step == fall.group(1) + "--":
            name, limit = fall.group(1), "down to " + fall.group(2)
        elif up and re.search(r"(^|, )%s(\+\+| \+= (?:\d+u?|[A-Z_0-9]+|\d+u \* [A-Z]+|width))" % up.group(1), step):
            name, limit = up.group(1), up.group(3)
        elif up and re.fullmatch(r"%s = palp_row_next\(.+, %s \+ 1u?, .+\)" % (up.group(1), up.group(1)), step):
            name, limit = up.group(1), "marked slots below " + up.group(3)
        else:
            continue
        break
    else:
        return None
    # neither the variable nor, where it is a plain name, the limit changes on the way
    plain = re.fullmatch(r"[a-z]\w*", limit)
    if plain and re.search(r"(?<![\w.>])%s\s*([-+*/|&]?=[^=]|\+\+|--)|&%s\b" % (limit, limit), body):
        return None
    assigned = re.search(r"&%s\b" % name, body) or re.search(r"(?<![\w.>])%s\s*(=[^=]|[-+*/|&]=|\+\+|--)" % name, body)
    return None if assigned else limit


for path in files:
    source = open(path).read()
    lines = source.split("\n")
    bare = re.sub(r"/\*.*?\*/|\"(?:\\.|[^\"\\])*\"", lambda m: re.sub(r"[^\n]", " ", m.group()), source,
                  flags=re.S)
    for m in re.finditer(r"\b(for|while|do)\b", bare):
        if m.group(1) == "do":
            number = bare.count("\n", 0, m.start())
            without.append("%s:%d: do" % (path, number + 1))
            continue
        head, end = header(bare, bare.index("(", m.start()))
        number = bare.count("\n", 0, m.start())
        last = bare.count("\n", 0, end)
        limit = counter_bound(" ".join(head.split()), body_of(bare, end)) if m.group(1) == "for" else None
        near = " ".join(lines[max(0, number - 1):last + 1])
        comment = re.search(r"(at most [^*]*?)\s*\*/", near)
        if limit is not None:
            counted += 1
            what = limit
        elif comment:
            named += 1
            what = comment.group(1)
        else:
            without.append("%s:%d: %s (%s)" % (path, number + 1, m.group(1), " ".join(head.split())))
            continue
        if listing:
            print("%s:%d: %s" % (path, number + 1, what))
print("%d loops count to a limit, %d have their bound in a comment, %d are without" %
      (counted, named, len(without)))
for line in without:
    print("  " + line)
sys.exit(1 if without else 0)
