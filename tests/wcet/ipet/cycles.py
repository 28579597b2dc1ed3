# SPDX-License-Identifier: MIT
"""What an instruction takes on a Cortex-M7 at most, in cycles: stated, not proved.

For code and data in tightly coupled memory and a processor that does nothing else. Nothing is issued beside anything, each result is
waited for (latencies of gcc's scheduling model of this processor, cortex-m7.md, or larger), each branch empties the pipeline, taken or
not. An interrupt, an access to slower memory or a cache are not in it. tests/wcet/README.md says how a board is held against this by its
cycle counter."""
import re

INTEGER = 2    # and its result used at once
MULTIPLY = 3
FLUSH = 9      # a branch, call or return: six stages, two of them twice, and the first fetch
LOAD = 3       # the same
STORE = 2
DIVIDE = 20    # of integers
FLOAT = 3      # add, subtract, multiply, convert, compare and its way to the flags
FUSED = 6
FLOAT_DIVIDE = 18
FLOAT_ROOT = 18
BRANCHES = re.compile(r"^(b|bl|bx|blx|cbz|cbnz|tbb|tbh)(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le|hs|lo)?$")


def registers(operands):
    """How many registers a list like {r4, r6-r8} has."""
    count, inside = 0, re.search(r"\{(.*?)\}", operands)
    for part in inside.group(1).split(",") if inside else []:
        ends = re.findall(r"\d+", part)
        count += int(ends[1]) - int(ends[0]) + 1 if "-" in part and len(ends) == 2 else 1
    return count


def weigh(mnemonic, operands):
    m = re.sub(r"\.[nw]$", "", mnemonic)
    if m in ("tbb", "tbh"):
        return FLUSH + LOAD
    if BRANCHES.match(m) or (m.startswith(("pop", "ldm")) and "pc" in operands) or (m.startswith(("ldr", "mov")) and operands.startswith("pc")):
        return FLUSH + registers(operands) + (LOAD if "{" in operands or m.startswith("ldr") else 0)
    if m.startswith(("ldm", "pop", "vldm", "vpop")):
        return LOAD + registers(operands)
    if m.startswith(("stm", "push", "vstm", "vpush")):
        return STORE + registers(operands)
    if m.startswith(("ldrd", "strd")):
        return LOAD + 1
    if m.startswith(("ldr", "vldr")):
        return LOAD
    if m.startswith(("str", "vstr")):
        return STORE
    if m.startswith(("udiv", "sdiv")):
        return DIVIDE
    if m.startswith("vdiv"):
        return FLOAT_DIVIDE
    if m.startswith("vsqrt"):
        return FLOAT_ROOT
    if m.startswith(("vmla", "vmls", "vfma", "vfms", "vnml", "vfnm")):
        return FUSED
    if m.startswith("v"):
        return FLOAT
    if m.startswith(("mul", "mla", "mls", "umull", "smul", "umla", "smla", "smm", "smu")):
        return MULTIPLY
    return INTEGER
