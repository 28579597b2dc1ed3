# SPDX-License-Identifier: MIT
"""A blob whose Green's functions have the other sign, with sums that are right: pulled.py IN OUT."""
import struct
import sys

table = []
for i in range(256):
    c = i
    for _ in range(8):
        c = c >> 1 ^ (0x82f63b78 if c & 1 else 0)
    table.append(c)


def crc32c(data, c=0):
    c ^= 0xffffffff
    for byte in data:
        c = c >> 8 ^ table[(c ^ byte) & 0xff]
    return c ^ 0xffffffff


HEADER, SCALE = 64, 72  # bytes; columns of free nodes: multiplier of the stored values
blob = bytearray(open(sys.argv[1], "rb").read())
total, sections = struct.unpack_from("<QI", blob, 16)
entries = [list(struct.unpack_from("<IIQQII", blob, HEADER + 32 * i)) for i in range(sections)]
for i, e in enumerate(entries):
    if e[0] == SCALE:
        for k in range(e[3]):
            at = e[2] + 4 * k
            struct.pack_into("<f", blob, at, -struct.unpack_from("<f", blob, at)[0])
    end = entries[i + 1][2] if i + 1 < sections else total
    e[4] = crc32c(blob[e[2]:end])
    struct.pack_into("<IIQQII", blob, HEADER + 32 * i, *e)
struct.pack_into("<I", blob, 28, 0)
struct.pack_into("<I", blob, 28, crc32c(blob[:HEADER + 32 * sections]))
open(sys.argv[2], "wb").write(blob)
