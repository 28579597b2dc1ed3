# SPDX-License-Identifier: MIT
"""Writes one surface as programs export it, with every quirk: exports.py BALL.obj DIR; a line for each file on standard
output: name, vertices and triangles that are right, volume (m^3, 0: as the ball's), a word that stderr must hold (or -)."""
import math
import struct
import sys

x, faces = [], []
for line in open(sys.argv[1]):
    w = line.split()
    if w and w[0] == "v":
        x.append(tuple(float(c) for c in w[1:4]))
    if w and w[0] == "f":
        faces.append([int(c) - 1 for c in w[1:4]])
out = sys.argv[2]
V, T = len(x), len(faces)


def save(name, data, vertices=V, triangles=T, volume=0, says="-"):
    open("%s/%s" % (out, name), "wb").write(data if isinstance(data, bytes) else data.encode())
    print(name, vertices, triangles, volume, says)


def obj(points, polygons):
    return "".join("v %.17g %.17g %.17g\n" % p for p in points) + "".join(
        "f " + " ".join(str(i + 1) for i in p) + "\n" for p in polygons)


def volume(points, polygons):
    s = 0.0
    for p in polygons:
        for k in range(1, len(p) - 1):
            a, b, c = points[p[0]], points[p[k]], points[p[k + 1]]
            s += (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])) / 6
    return s


ball = obj(x, faces)
save("plain.obj", ball)
save("bom.obj", b"\xef\xbb\xbf" + ball.encode())
save("nul.obj", ball.encode() + b"\0\0\0")
save("cr.obj", ball.replace("\n", "\r"))
save("crlf.obj", ball.replace("\n", "\r\n"))
save("continued.obj", "".join(l.replace(" ", " \\\n ", 2) + "\n" if l[0] == "f" else l + "\n" for l in ball.splitlines()))
places = "".join("v %.17g %.17g %.17g\n" % p for p in x)
save("glued.obj", places + "".join("f %d/1\\\n %d/1\\  \n%d/1\n" % tuple(i + 1 for i in f) for f in faces))
save("negative.obj", places + "".join("f %d %d %d\n" % tuple(i - V for i in f) for f in faces))
save("faces-first.obj", "".join("f %d %d %d\n" % tuple(i + 1 for i in f) for f in faces) + places)
soup = [x[i] for f in faces for i in f]
save("soup.obj", obj(soup, [[3 * k, 3 * k + 1, 3 * k + 2] for k in range(T)]), says="welded")
near = [tuple(c * (1 + 3e-8 * ((k % 5) - 2)) for c in p) for k, p in enumerate(soup)]
save("soup-rounded.obj", obj(near, [[3 * k, 3 * k + 1, 3 * k + 2] for k in range(T)]), says="welded")
save("repeated.obj", obj(x, [[f[0], f[1], f[2], f[2]] for f in faces]), says="repeated")
save("wire.obj", ball + "f 1 2\nl 1 2 3\n", says="fewer")
save("spare.obj", ball + "v 5 5 5\nv nan 0 0\n", says="unused")
# a cube whose top edge has a vertex on one side only, and the same closed by a triangle without area
c = [(a, b, d) for a in (0.0, 1.0) for b in (0.0, 1.0) for d in (0.0, 1.0)] + [(0.5, 1.0, 1.0)]
q = [[0, 2, 6, 4], [1, 5, 7, 3], [0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1]]
save("junction.obj", obj(c, q + [[2, 3, 8], [2, 8, 7, 6]]), 9, 14, 1, "cut")
save("sliver.obj", obj(c, q + [[2, 3, 8], [2, 8, 7, 6], [3, 7, 8]]), 9, 14, 1, "without")
n = 300
ring = [(math.cos(2 * math.pi * k / n), math.sin(2 * math.pi * k / n)) for k in range(n)]
cap = [(a, b, 0.0) for a, b in ring] + [(a, b, 2.0) for a, b in ring]
walls = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
cylinder = [list(range(n - 1, -1, -1)), list(range(n, 2 * n))] + walls
save("caps.obj", obj(cap, cylinder), 2 * n, 2 * (n - 2) + 2 * n, volume(cap, cylinder))
star = [(math.cos(2 * math.pi * k / 12) * (1, 0.4)[k % 2], math.sin(2 * math.pi * k / 12) * (1, 0.4)[k % 2]) for k in range(12)]
horn = [(a, b, 0.0) for a, b in star] + [(a, b, 1.0) for a, b in star]
sides = [list(range(11, -1, -1)), list(range(12, 24))] + [[k, (k + 1) % 12, 12 + (k + 1) % 12, 12 + k] for k in range(12)]
save("concave.obj", obj(horn, sides), 24, 44, volume(horn, sides))

save("utf-16le.obj", b"\xff\xfe" + ball.encode("utf-16-le"))
save("utf-16be.obj", b"\xfe\xff" + ball.encode("utf-16-be"))
save("rounds.obj", obj(x, [f * 3 for f in faces]), says="repeated")
f = faces[7]
save("facing.obj", obj(x, faces + [[f[1], f[0], f[2]], f]), says="face each other")
save("fin.obj", obj(x + [tuple(3 * c for c in x[0])], faces + [[f[0], f[1], V], [f[1], f[0], V]]), says="face each other")
# a plate with a hole whose faces are one polygon each, with a bridge to the hole
square = [(0, 0), (3, 0), (3, 3), (0, 3), (1, 1), (2, 1), (2, 2), (1, 2)]
plate = [(a / 2, b / 2, z / 2) for z in (0, 1) for a, b in square]
top = [8, 9, 10, 11, 8, 12, 15, 14, 13, 12]
rim = [[k, (k + 1) % 4, 8 + (k + 1) % 4, 8 + k] for k in range(4)]
inner = [[4 + (k + 1) % 4, 4 + k, 12 + k, 12 + (k + 1) % 4] for k in range(4)]
save("bridge.obj", obj(plate, [top, [i - 8 for i in reversed(top)]] + rim + inner), 16, 32, 1)
# the fan of vertex 0 in two halves, each with its own copy of it: an edge without length between them
fan = {f[(f.index(0) + 1) % 3]: f[(f.index(0) + 2) % 3] for f in faces if 0 in f}
around = [min(fan)]
while fan[around[-1]] != around[0]:
    around.append(fan[around[-1]])
half = set(around[:3])
copies = [[V if i == 0 and f[(f.index(0) + 1) % 3] in half else i for i in f] if 0 in f else f for f in faces]
save("no-length.obj", obj(x + [x[0]], copies + [[0, V, around[0]], [V, 0, around[3]]]), says="without length")
# two full layers, between them two blocks that share an edge: its faces are joined at both of its ends
blocks = {(a, b, c) for a in (0, 1) for b in (0, 1) for c in (0, 1, 2) if c != 1 or a == b}
number, skin = {}, []
for block in sorted(blocks):
    for axis in range(3):
        for side in (0, 1):
            beyond = list(block)
            beyond[axis] += 2 * side - 1
            if tuple(beyond) in blocks:
                continue
            corners = []
            for u, v in ((0, 0), (1, 0), (1, 1), (0, 1)):
                at = list(block)
                at[axis] += side
                at[(axis + 1) % 3] += u
                at[(axis + 2) % 3] += v
                corners.append(number.setdefault(tuple(at), len(number)))
            skin.append(corners if side else corners[::-1])
corner = [tuple(c / 2 for c in at) for at in number]
save("joined-ends.obj", obj(corner, skin), len(corner) + 2, 2 * len(skin) + 4, len(blocks) / 8, "touches itself")


def stl(name, head="solid a b", tail="endsolid a b", upper=False):
    s = head + "\n" + "".join("facet normal 0 0 0\nouter loop\n" + "".join("vertex %.9g %.9g %.9g\n" % x[i] for i in f) +
                              "endloop\nendfacet\n" for f in faces) + tail + "\n"
    return s.upper() if upper else s


save("text.stl", stl("a"))
save("upper.stl", stl("a", upper=True))
save("bom.stl", b"\xef\xbb\xbf" + stl("a").encode())
save("end-solid.stl", stl("a", tail="end solid a b"))
save("cr.stl", stl("a").replace("\n", "\r"))
body = b"".join(struct.pack("<12f", 0, 0, 0, *[v for i in f for v in x[i]]) + b"\0\0" for f in faces)
save("binary.stl", b"\0" * 80 + struct.pack("<I", T) + body)
save("solid-binary.stl", b"solid but not text".ljust(80, b"\0") + struct.pack("<I", T) + body)
save("trailing.stl", b"\0" * 80 + struct.pack("<I", T) + body + b"xyz", says="behind")
save("count-less.stl", b"\0" * 80 + struct.pack("<I", T - 1) + body, says="holds")
save("count-unknown.stl", b"\0" * 80 + struct.pack("<I", 0xffffffff) + body, says="holds")
head = "ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n" % V
points = b"".join(struct.pack("<3f", *p) for p in x)
lists = "element face %d\nproperty list uchar int vertex_indices\nend_header\n" % T
indices = b"".join(struct.pack("<B3i", 3, *f) for f in faces)
save("binary.ply", (head + lists).encode() + points + indices)
save("cr.ply", (head + lists).replace("\n", "\r").encode() + points + indices)
save("crlf.ply", (head + lists).replace("\n", "\r\n").encode() + points + indices)
strip = [i for f in faces for i in f + [-1]]
save("strips.ply", (head + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n").encode() + points +
     struct.pack("<%di" % (len(strip) + 1), len(strip), *strip))
text = "ply\nformat ascii 1.0\nelement face %d\nproperty list uchar int vertex_indices\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\nend_header\n" % (
    T, V + 1) + "".join("3 %d %d %d\n" % tuple(f) for f in faces) + "".join("%.9g %.9g %.9g\n" % p for p in x) + "nan nan nan\n"
save("faces-first.ply", text, says="unused")
save("faces-first-cr.ply", text.replace("\n", "\r"), says="unused")
