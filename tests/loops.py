# SPDX-License-Identifier: MIT
"""Every loop of core and what bounds it.

usage: loops.py [--list] FILE.c ...

A loop is bounded when it is a `for` that counts one variable up to a limit (one by one, by a
constant, or from marked slot to marked slot) or down to one, and does not assign it in its body; or when a comment on its line or the one before names
the bound with the words "at most". All others are printed, and make the exit code 1.

The bound in a comment is an expression of counts, `at most 2 seams`, for each time that the loop is entered; or
`at most points in all of palp_contact_finish`: as often as that in one call of the function, however often the loop is entered.
tests/wcet/ipet reads them too.
"""
import collections
import re
import sys

# first, last: the lines of its header; end: the last line of its body; limit: its bound, or None; step: by which it counts, or None;
# counted: it counts to its limit
Loop = collections.namedtuple("Loop", "path first last end limit step counted empty head")


def header(text, at):
    """The parenthesis that begins at text[at], and where it ends."""
    depth = 0
    for i in range(at, len(text)):
        depth += {"(": 1, ")": -1}.get(text[i], 0)
        if depth == 0:
            return text[at + 1:i], i + 1
    raise SystemExit("unbalanced parentheses")


def body_of(text, at):
    """The statement or block after a loop's header, and where it ends."""
    while text[at].isspace():
        at += 1
    if text[at] != "{":
        end = text.index(";", at)
        return text[at:end], end
    depth = 0
    for i in range(at, len(text)):
        depth += {"{": 1, "}": -1}.get(text[i], 0)
        if depth == 0:
            return text[at:i], i
    return text[at:], len(text) - 1


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
            name, limit = fall.group(1), re.search(r"= (.+)", part[0])
            limit = limit.group(1) if limit else fall.group(1)
        elif up and re.search(r"(^|, )%s(\+\+| \+= (?:\d+u?|[A-Z_0-9]+|\d+u \* [A-Z]+|width))" % up.group(1), step):
            name, limit = up.group(1), up.group(3) + (" + 1" if up.group(2) == "<=" else "")
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


def loops_in(path):
    """The loops of a file, in order."""
    source = open(path).read()
    lines = source.split("\n")
    bare = re.sub(r"/\*.*?\*/|\"(?:\\.|[^\"\\])*\"", lambda m: re.sub(r"[^\n]", " ", m.group()), source,
                  flags=re.S)
    found = []
    for m in re.finditer(r"\b(for|while|do)\b", bare):
        first = bare.count("\n", 0, m.start())
        if m.group(1) == "do":
            found.append(Loop(path, first + 1, first + 1, first + 1, None, None, False, False, "do"))
            continue
        head, end = header(bare, bare.index("(", m.start()))
        last = bare.count("\n", 0, end)
        body, close = body_of(bare, end)
        limit = counter_bound(" ".join(head.split()), body) if m.group(1) == "for" else None
        near = " ".join(lines[max(0, first - 1):last + 1])
        comment = re.search(r"at most ([^*]*(?:\*(?!/)[^*]*)*?)\s*\*/", near)
        counted = limit is not None and not comment
        step = re.search(r"; *\w+ \+= (\w+(?: \* \w+)*)[^;]*$", " ".join(head.split()))
        if comment:
            limit = comment.group(1)
        found.append(Loop(path, first + 1, last + 1, bare.count("\n", 0, close) + 1, limit,
                          step.group(1) if step and counted else None, counted, body.strip("{ \n\t") == "", m.group(1) + " (" + " ".join(head.split()) + ")"))
    return found


def main():
    loops = [loop for f in sys.argv[1:] if not f.startswith("--") for loop in loops_in(f)]
    without = [loop for loop in loops if loop.limit is None]
    if "--list" in sys.argv:
        for loop in loops:
            if loop.limit is not None:
                print("%s:%d: %s%s" % (loop.path, loop.first, "" if loop.counted else "at most ", loop.limit))
    counted = sum(loop.counted for loop in loops)
    print("%d loops count to a limit, %d have their bound in a comment, %d are without" %
          (counted, len(loops) - counted - len(without), len(without)))
    for loop in without:
        print("  %s:%d: %s" % (loop.path, loop.first, loop.head))
    return 1 if without else 0


if __name__ == "__main__":
    sys.exit(main())
