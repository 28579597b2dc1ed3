# SPDX-License-Identifier: MIT
"""Over 100 shapes of many kinds, each written as some program exports it: shapes.py DIR; on standard output a line for each file:
name, file, options that its reader needs, height (m) below which it is held."""
import math
import struct
import sys

out = sys.argv[1]


def extrude(outline, height, holes=()):
    """A prism over a polygon with round holes; caps are triangulated by bridges to the holes."""
    rings = [outline] + [list(reversed(h)) for h in holes]
    points, sides = [], []
    for ring in rings:
        n, first = len(ring), len(points)
        points += [(x, y, 0.0) for x, y in ring] + [(x, y, height) for x, y in ring]
        sides += [[first + k, first + (k + 1) % n, first + n + (k + 1) % n, first + n + k] for k in range(n)]
    if not holes:
        n = len(outline)
        return points, sides + [list(range(n - 1, -1, -1)), list(range(n, 2 * n))]
    n, m = len(outline), len(rings[1])  # one hole: join nearest corners, a ring of quads needs equal counts
    assert n == m
    ring = list(range(n))
    hole = [2 * n + (n - 1 - k) for k in range(n)]  # outline order
    shift = min(ring, key=lambda s: sum((points[k][0] - points[hole[(k + s) % n]][0]) ** 2 + (points[k][1] - points[hole[(k + s) % n]][1]) ** 2 for k in ring))
    caps = []
    for k in ring:
        a, b = k, (k + 1) % n
        c, d = hole[(k + 1 + shift) % n], hole[(k + shift) % n]
        caps += [[b, a, d, c], [a + n, b + n, c + n, d + n]]
    return points, sides + caps


def turned(profile, n):
    """A profile of (radius, z) with ends on the axis, turned about z."""
    points, faces, rows = [], [], []
    for r, z in profile:
        if r == 0:
            rows.append([len(points)] * n)
            points.append((0.0, 0.0, z))
        else:
            rows.append(list(range(len(points), len(points) + n)))
            points += [(r * math.cos(2 * math.pi * k / n), r * math.sin(2 * math.pi * k / n), z) for k in range(n)]
    for a, b in zip(rows, rows[1:]):
        for k in range(n):
            faces.append([a[k], a[(k + 1) % n], b[(k + 1) % n], b[k]])
    return points, [[i for j, i in enumerate(f) if i != f[j - 1]] for f in faces]


def tube(path, radius, n):
    """Round a closed path in space."""
    points, faces, count = [], [], len(path)
    for i, p in enumerate(path):
        q, o = path[(i + 1) % count], path[i - 1]
        t = [b - a for a, b in zip(o, q)]
        s = math.sqrt(sum(c * c for c in t))
        t = [c / s for c in t]
        u = [-t[1], t[0], 0.0] if abs(t[2]) < 0.9 else [1.0, 0.0, 0.0]
        d = sum(a * b for a, b in zip(u, t))
        u = [a - d * b for a, b in zip(u, t)]
        s = math.sqrt(sum(c * c for c in u))
        u = [c / s for c in u]
        v = [t[1] * u[2] - t[2] * u[1], t[2] * u[0] - t[0] * u[2], t[0] * u[1] - t[1] * u[0]]
        points += [tuple(p[k] + radius * (math.cos(2 * math.pi * j / n) * u[k] + math.sin(2 * math.pi * j / n) * v[k]) for k in range(3)) for j in range(n)]
    for i in range(count):
        for j in range(n):
            a, b = i * n, (i + 1) % count * n
            faces.append([a + j, b + j, b + (j + 1) % n, a + (j + 1) % n])
    return points, faces


def voxels(cells, size):
    index, faces = {}, []
    cells = set(cells)
    for c in sorted(cells):
        for axis in range(3):
            for side in (0, 1):
                d = list(c)
                d[axis] += 2 * side - 1
                if tuple(d) in cells:
                    continue
                u, v = (axis + 1) % 3, (axis + 2) % 3
                q = []
                for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    p = list(c)
                    p[axis] += side
                    p[u] += a
                    p[v] += b
                    q.append(index.setdefault(tuple(p), len(index)))
                faces.append(q if side else q[::-1])
    return [tuple(size[k] * p[k] for k in range(3)) for p in index], faces


def ball(n, f):
    """f(direction) -> radius."""
    rows = []
    for i in range(n + 1):
        z = -math.cos(math.pi * i / n)
        rows.append((math.sqrt(max(1 - z * z, 0)) if 0 < i < n else 0, z))
    points, faces = turned(rows, 2 * n)
    return [tuple(c * f(p) for c in p) for p in points], faces


def circle(r, n, x=0.0, y=0.0):
    return [(x + r * math.cos(2 * math.pi * k / n), y + r * math.sin(2 * math.pi * k / n)) for k in range(n)]


shapes = []


def add(name, shape):
    shapes.append((name, shape))


for i, (w, t) in enumerate([(20, 20), (20, 10), (20, 8), (20, 4), (10, 4), (6, 6), (40, 4), (30, 2)]):
    add("bar-80-%d-%d" % (w, t), extrude([(0, 0), (.08, 0), (.08, w * 1e-3), (0, w * 1e-3)], t * 1e-3))
for t in (20, 8, 4, 2, 1, .8):
    add("plate-80-80-%g" % t, extrude([(0, 0), (.08, 0), (.08, .08), (0, .08)], t * 1e-3))
for n in (5, 6, 8, 12, 24, 48):
    add("prism-%d" % n, extrude(circle(.03, n), .04))
for teeth, depth in ((6, .3), (8, .3), (10, .25), (12, .2), (16, .2), (20, .15)):
    add("gear-%d" % teeth, extrude([(.03 * (1 - depth * (k % 4 >= 2)) * math.cos(2 * math.pi * k / (4 * teeth)), .03 * (1 - depth * (k % 4 >= 2)) * math.sin(2 * math.pi * k / (4 * teeth)))
                                    for k in range(4 * teeth)], .012))
for inner in (.2, .4, .6, .75, .85, .92):
    add("ring-%g" % inner, extrude(circle(.03, 24), .015, [circle(.03 * inner, 24)]))
for a, b in ((.04, .02), (.04, .01), (.06, .008), (.05, .015), (.03, .012)):
    square = [(a * c, a * s) for c, s in ((1, -1), (1, -.33), (1, .33), (1, 1), (.33, 1), (-.33, 1), (-1, 1), (-1, .33), (-1, -.33), (-1, -1), (-.33, -1), (.33, -1))]
    add("bracket-%g-%g" % (a, b), extrude(square, .01, [circle(b, 12)]))
for d in (.1, .2, .3, .4, .5):
    add("dimple-%g" % d, ball(14, lambda p, d=d: .03 * (1 - d * math.exp(-((p[0] - 1) ** 2 + p[1] ** 2 + p[2] ** 2) / .1))))
for d in (.1, .2, .3, .4):
    add("bumps-%g" % d, ball(16, lambda p, d=d: .03 * (1 + d * math.sin(5 * p[0]) * math.sin(5 * p[1] + 1) * math.sin(5 * p[2] + 2))))
for e in (.2, .35, .5, .7, 1.5, 2):
    s = ball(12, lambda p: .03)
    add("ellipsoid-%g" % e, ([(x, y, z * e) for x, y, z in s[0]], s[1]))
for e in (3, 4, 6, 10):
    add("superquadric-%d" % e, ball(14, lambda p, e=e: .03 / sum(abs(c) ** e for c in p) ** (1 / e)))
for r in (.015, .01, .007, .005, .003):
    add("torus-%g" % r, tube([(.03 * math.cos(2 * math.pi * k / 36), .03 * math.sin(2 * math.pi * k / 36), 0) for k in range(36)], r, 10))
for r in (.008, .005, .003):
    add("knot-%g" % r, tube([(.01 * (math.sin(s) + 2 * math.sin(2 * s)), .01 * (math.cos(s) - 2 * math.cos(2 * s)), -.012 * math.sin(3 * s)) for s in (2 * math.pi * k / 72 for k in range(72))], r, 8))
for w in (.01, .006, .004, .002):
    outer = [(.03 * math.sin(a), -.03 * math.cos(a)) for a in (math.pi / 2 * k / 8 for k in range(9))]
    inner = [((.03 - w) * math.sin(a), -(.03 - w) * math.cos(a)) for a in (math.pi / 2 * k / 8 for k in range(9))]
    add("bowl-%g" % w, turned([(0, -.03)] + outer[1:] + inner[:0:-1] + [(0, -(.03 - w))], 24))
for top in (.9, .5, .2, .05):
    add("cone-%g" % top, turned([(0, 0), (.02, 0), (.02 * (1 + top) / 2, .03), (.02 * top, .06), (0, .06)], 20))
for w in (.012, .008, .004):
    add("cup-%g" % w, turned([(0, 0), (.03, 0), (.03, .02), (.03, .04), (.03 - w, .04), (.03 - w, .02), (.03 - w, w), (0, w)], 24))
L = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (0, 2, 0)]
for name, cells in (("angle", L), ("tee", L + [(-1, 0, 0), (-2, 0, 0)]), ("cross", L + [(-1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]),
                    ("channel", [(i, 0, k) for i in range(4) for k in range(3)] + [(i, 1, k) for i in range(4) for k in (0, 2)]),
                    ("frame", [(i, k, 0) for i in range(4) for k in range(4) if i in (0, 3) or k in (0, 3)]),
                    ("steps", [(i, k, 0) for i in range(4) for k in range(i + 1)]), ("comb", [(i, 0, 0) for i in range(7)] + [(i, k, 0) for i in (0, 2, 4, 6) for k in (1, 2, 3)]),
                    ("chair", [(i, k, 1) for i in range(3) for k in range(3)] + [(i, k, 0) for i in (0, 2) for k in (0, 2)] + [(0, k, 2) for k in range(3)])):
    add(name, voxels(cells, (.01, .01, .01)))
seed = 1
for i in range(22):
    cells = {(0, 0, 0)}
    while len(cells) < 14:
        seed = (seed * 1103515245 + 12345) % 2 ** 31
        c = sorted(cells)[seed // 7 % len(cells)]
        d = list(c)
        d[seed // 65536 % 3] += 1 if seed // 1048576 % 2 else -1
        trial = cells | {tuple(d)}
        # no edge or corner may be shared by cells that share no face: the surface would touch itself
        ok = True
        for a in trial:
            for dx in (-1, 0, 1):
                for dy in (-1, 0, 1):
                    for dz in (-1, 0, 1):
                        b = (a[0] + dx, a[1] + dy, a[2] + dz)
                        if b not in trial or abs(dx) + abs(dy) + abs(dz) < 2:
                            continue
                        steps = [(a[0] + dx, a[1], a[2]), (a[0], a[1] + dy, a[2]), (a[0], a[1], a[2] + dz)]
                        steps = [s for s, e in zip(steps, (dx, dy, dz)) if e]
                        ok = ok and any(s in trial for s in steps)
        if ok:
            cells = trial
    add("blocks-%d" % i, voxels(cells, (.01, .01, .01)))


def write(i, name, points, faces):
    """One of seven ways of exporting; returns the file's name and the options for its reader."""
    way = i % 7
    obj = lambda p, f: "".join("v %.9g %.9g %.9g\n" % q for q in p) + "".join("f " + " ".join(str(k + 1) for k in g) + "\n" for g in f)
    if way == 0:
        text, file, options = obj(points, faces), name + ".obj", "-"
    elif way == 1:  # every face with corners of its own
        text = obj([points[k] for f in faces for k in f], [list(range(sum(map(len, faces[:j])), sum(map(len, faces[:j])) + len(f))) for j, f in enumerate(faces)])
        file, options = name + ".obj", "-"
    elif way == 2:
        text, file, options = obj([tuple(1e3 * c for c in p) for p in points], faces), name + ".obj", "--units=mm"
    elif way == 3:
        text, file, options = "\ufeff" + obj(points, faces).replace("\n", "\r\n"), name + ".obj", "-"
    elif way == 4:
        text = "ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n" % (len(points), len(faces))
        text += "".join("%.9g %.9g %.9g\n" % p for p in points) + "".join("%d %s\n" % (len(f), " ".join(map(str, f))) for f in faces)
        file, options = name + ".ply", "-"
    elif way == 5:  # inside out, negative numbers
        n = len(points)
        text = "".join("v %.9g %.9g %.9g\n" % p for p in points) + "".join("f " + " ".join(str(k - n) for k in reversed(f)) + "\n" for f in faces)
        file, options = name + ".obj", "-"
    else:  # groups, a spare vertex, a wire
        text, file, options = "g a\nusemtl b\n" + obj(points + [(9.0, 9.0, 9.0)], faces) + "l 1 2\n", name + ".obj", "-"
    open("%s/%s" % (out, file), "w", encoding="utf-8", newline="").write(text)
    return file, options


for i, (name, (points, faces)) in enumerate(shapes):
    low, high = min(p[2] for p in points), max(p[2] for p in points)
    file, options = write(i, name, points, faces)
    print(name, file, options, "%.9g" % (low + .15 * (high - low)))
