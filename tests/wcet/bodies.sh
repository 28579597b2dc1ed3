# SPDX-License-Identifier: MIT
# Bodies of many kinds to count cases on: bodies.sh FOLDER; prints the blobs. Long, round, pointed and with a hole; of one level, fine,
# compressed in every way; multizone; dynamic.
set -e
mkdir -p "$1"
cd "$1"
palp=${PALP:?the program palp}
blobs=${BLOBS:?the folder of meshes}
bake() { # bake NAME LINES: of a model
    [ -s "$1.palp" ] || {
        printf '%b' "$2" > "$1.model"
        "$palp" bake "$1.model" -o "$1.palp" > "$1.log" 2>&1 || { echo "bodies.sh: $1: $(tail -1 "$1.log")" >&2; exit 1; }
    }
    echo "$PWD/$1.palp"
}
# a ring of rings: N around, M about; R and r; a torus
awk 'BEGIN { N = 20; M = 10; for (i = 0; i < N; i++) for (j = 0; j < M; j++) { a = 6.2831853 * i / N; b = 6.2831853 * j / M
    printf "v %.7g %.7g %.7g\n", (0.03 + 0.01 * cos(b)) * cos(a), (0.03 + 0.01 * cos(b)) * sin(a), 0.01 * sin(b) }
    for (i = 0; i < N; i++) for (j = 0; j < M; j++) { p = i * M + j + 1; q = ((i + 1) % N) * M + j + 1; r = i * M + (j + 1) % M + 1; s = ((i + 1) % N) * M + (j + 1) % M + 1
        printf "f %d %d %d\nf %d %d %d\n", p, q, s, p, s, r } }' > torus.obj
# a cone of 24 sides: a tip of valence 24, and the middle of its base
awk 'BEGIN { N = 24; L = 8; print "v 0 0 0.06"; print "v 0 0 0"
    for (l = 1; l <= L; l++) for (i = 0; i < N; i++) { a = 6.2831853 * i / N; r = 0.025 * l / L; printf "v %.7g %.7g %.7g\n", r * cos(a), r * sin(a), 0.06 * (1 - l / L) }
    for (i = 0; i < N; i++) { j = (i + 1) % N; printf "f 1 %d %d\n", 3 + i, 3 + j; printf "f 2 %d %d\n", 3 + (L - 1) * N + j, 3 + (L - 1) * N + i }
    for (l = 1; l < L; l++) for (i = 0; i < N; i++) { j = (i + 1) % N; p = 3 + (l - 1) * N; q = p + N
        printf "f %d %d %d\nf %d %d %d\n", p + i, q + i, q + j, p + i, q + j, p + j } }' > cone.obj
# a rod of 24 by 1 by 1 squares
awk 'BEGIN { n = 24; for (k = 0; k <= n; k++) for (i = 0; i < 4; i++) printf "v %.7g %.7g %.7g\n", 0.005 * k, 0.005 * (i == 1 || i == 2), 0.005 * (i > 1)
    for (k = 0; k < n; k++) for (i = 0; i < 4; i++) { j = (i + 1) % 4; p = 4 * k + i + 1; q = 4 * k + j + 1; printf "f %d %d %d\nf %d %d %d\n", p, q, q + 4, p, q + 4, p + 4 }
    printf "f 1 4 3\nf 1 3 2\nf %d %d %d\nf %d %d %d\n", 4 * n + 1, 4 * n + 2, 4 * n + 3, 4 * n + 1, 4 * n + 3, 4 * n + 4 }' > rod.obj
rabbit="mesh $blobs/rabbit.obj\nyoung 3e4\npoisson 0.45\nfix-below z 0.004\n"
bake torus "mesh torus.obj\nloop 1\nyoung 2e4\npoisson 0.4\nfix-below x -0.03\n"
bake cone "mesh cone.obj\nas-is\nyoung 2e4\npoisson 0.3\nfix-below z 1e-4\n"
bake rod "mesh rod.obj\nloop 1\nyoung 5e4\npoisson 0.45\nfix-below x 0.004\n"
bake flat "mesh $blobs/bean.obj\nas-is\nyoung 3e4\npoisson 0.45\nfix-below z 0.0339\n"
bake fine "${rabbit}loop 3\nepsilon 0.5\nstorage f16\ntable-mb 1\n"
bake whole "${rabbit}loop 2\nepsilon 0\nthreshold global\ntable-mb 2\n"
bake coarse "${rabbit}loop 2\nepsilon 0.5\ntable-mb 0.2\n"
bake butterfly "${rabbit}loop 2\nwavelet butterfly\nepsilon 0.02\ntable-mb 0.5\n"
bake split "${rabbit}loop 2\nmodes 120\n"
bake half "${rabbit}loop 2\nstorage f16\nepsilon 0.01\ntable-mb 0.5\nmodes 128\n"
bake tables "${rabbit}loop 2\ntable-mb 16\nmodes 24\n"
bake chain "young 3e4\npoisson 0.4\nmesh rod.obj\nas-is\nzone a\nfix-box -1 -1 -1 0.011 1 1\nzone b\nfix-box 0.049 -1 -1 0.071 1 1\nzone c\nfix-box 0.109 -1 -1 1 1 1\ncut a b 0.04 0 0 1 0 0\ncut b c 0.08 0 0 1 0 0\njoint ab revolute a b\naxis 0 1 0\norigin 0.04 0.0025 0.0025\njoint bc revolute b c\naxis 0 0.8 0.6\norigin 0.08 0.0025 0.0025\n"
bake cube "mesh $blobs/box.obj\nyoung 5e3\npoisson 0.4\nfix-below z 0.001\ntets 200 900 4000\n"
bake slab "mesh $blobs/plate.obj\nyoung 5e3\npoisson 0.4\nfix-below x 0.001\ntets 150 600 2000\n"
bake moving "mesh $blobs/liver.obj\nyoung 5e3\npoisson 0.45\nfix-above y 0.026\ntets 90 300 1000\n"
