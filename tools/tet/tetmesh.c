/* SPDX-License-Identifier: MIT */
#include "tools/tet/tetmesh.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define DEGREES 57.29577951308232

/* Corners of the face against each corner, outward for a tetrahedron of positive volume. */
static const int face_of[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

void tetmesh_free(tetmesh *m) {
    free(m->x);
    free(m->t);
    *m = (tetmesh){.nodes = 0};
}

tetmesh tetmesh_block(const double size[3], const uint32_t n[3], bool mirrored) {
    static const uint8_t path[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2},
                                       {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
    tetmesh m = {.nodes = 0};
    m.x = allocate((size_t)(n[0] + 1) * (n[1] + 1) * (n[2] + 1), sizeof *m.x);
    m.t = allocate(6 * (size_t)n[0] * n[1] * n[2], sizeof *m.t);
    for (uint32_t k = 0; k <= n[2]; k++) {
        for (uint32_t j = 0; j <= n[1]; j++) {
            for (uint32_t i = 0; i <= n[0]; i++) {
                const uint32_t p[3] = {i, j, k};
                for (int a = 0; a < 3; a++) m.x[m.nodes][a] = size[a] * p[a] / n[a];
                m.nodes++;
            }
        }
    }
    for (uint32_t cell = 0; cell < n[0] * n[1] * n[2]; cell++) {
        const uint32_t at[3] = {cell % n[0], cell / n[0] % n[1], cell / n[0] / n[1]};
        for (int c = 0; c < 6; c++) {
            uint32_t p[3], corner[4];
            for (int a = 0; a < 3; a++) p[a] = at[a] + (mirrored ? at[a] % 2 : 0);
            for (int step = 0; step < 4; step++) {
                corner[step] = (p[2] * (n[1] + 1) + p[1]) * (n[0] + 1) + p[0];
                if (step == 3) break;
                uint8_t a = path[c][step];
                p[a] = mirrored && at[a] % 2 == 1 ? p[a] - 1 : p[a] + 1;
            }
            memcpy(m.t[m.tets++], corner, sizeof corner);
            if (tet_volume(&m, m.tets - 1) < 0) {
                m.t[m.tets - 1][2] = corner[3];
                m.t[m.tets - 1][3] = corner[2];
            }
        }
    }
    return m;
}

double tet_volume(const tetmesh *m, uint32_t tet) {
    const uint32_t *t = m->t[tet];
    double a[3], b[3], c[3], n[3];
    v_sub(m->x[t[1]], m->x[t[0]], a);
    v_sub(m->x[t[2]], m->x[t[0]], b);
    v_sub(m->x[t[3]], m->x[t[0]], c);
    v_cross(a, b, n);
    return v_dot(n, c) / 6;
}

void tet_gradients(const tetmesh *m, uint32_t tet, double b[3][3]) {
    const uint32_t *t = m->t[tet];
    double e[3][3], six = 6 * tet_volume(m, tet);
    for (int k = 0; k < 3; k++) v_sub(m->x[t[k + 1]], m->x[t[0]], e[k]);
    for (int k = 0; k < 3; k++) {
        v_cross(e[(k + 1) % 3], e[(k + 2) % 3], b[k]);
        for (int a = 0; a < 3; a++) b[k][a] /= six;
    }
}

void tet_dihedral_deg(double x[4][3], double *low, double *high) {
    double n[4][3];
    for (int f = 0; f < 4; f++) {
        triangle_normal(x[face_of[f][0]], x[face_of[f][1]], x[face_of[f][2]], n[f]);
        v_normalize(n[f]);
    }
    *low = 180;
    *high = 0;
    for (int f = 0; f < 4; f++) {
        for (int g = 0; g < f; g++) {
            double angle = DEGREES * acos(fmax(-1, fmin(1, -v_dot(n[f], n[g]))));
            *low = fmin(*low, angle);
            *high = fmax(*high, angle);
        }
    }
}

static int by_key(const void *a, const void *b) {
    const tet_face *p = a, *q = b;
    for (int k = 0; k < 3; k++) {
        if (p->key[k] != q->key[k]) return p->key[k] < q->key[k] ? -1 : 1;
    }
    return (p->tet > q->tet) - (p->tet < q->tet);
}

bool tet_face_same(const tet_face *a, const tet_face *b) {
    return memcmp(a->key, b->key, sizeof a->key) == 0;
}

tet_face *tetmesh_faces(const tetmesh *m) {
    size_t faces = 4 * (size_t)m->tets;
    tet_face *f = allocate(faces + 1, sizeof *f);
    for (size_t i = 0; i < faces; i++) {
        f[i].tet = (uint32_t)(i / 4);
        for (int k = 0; k < 3; k++) f[i].key[k] = f[i].corner[k] = m->t[i / 4][face_of[i % 4][k]];
        for (int p = 0; p < 2; p++) {
            for (int k = 0; k < 2; k++) {
                if (f[i].key[k] <= f[i].key[k + 1]) continue;
                uint32_t swap = f[i].key[k];
                f[i].key[k] = f[i].key[k + 1];
                f[i].key[k + 1] = swap;
            }
        }
    }
    qsort(f, faces, sizeof *f, by_key);
    return f;
}

static int by_corner(const void *a, const void *b) {
    return memcmp(a, b, 3 * sizeof(uint32_t)); /* any fixed order will do */
}

uint32_t (*tetmesh_boundary(const tetmesh *m, uint32_t *count))[3] {
    size_t faces = 4 * (size_t)m->tets;
    tet_face *f = tetmesh_faces(m);
    uint32_t(*out)[3] = allocate(faces + 1, sizeof *out);
    *count = 0;
    for (size_t i = 0; i < faces; i++) {
        bool twin = (i > 0 && tet_face_same(&f[i], &f[i - 1])) ||
                    (i + 1 < faces && tet_face_same(&f[i], &f[i + 1]));
        if (!twin) memcpy(out[(*count)++], f[i].corner, sizeof *out);
    }
    qsort(out, *count, sizeof *out, by_corner);
    free(f);
    return out;
}

void tetmesh_around(const tetmesh *m, uint32_t **offset, uint32_t **list) {
    *offset = allocate((size_t)m->nodes + 2, sizeof **offset);
    *list = allocate(4 * (size_t)m->tets + 1, sizeof **list);
    for (uint32_t i = 0; i < 4 * m->tets; i++) (*offset)[m->t[i / 4][i % 4] + 2]++;
    for (uint32_t i = 0; i < m->nodes; i++) (*offset)[i + 2] += (*offset)[i + 1];
    for (uint32_t i = 0; i < 4 * m->tets; i++) (*list)[(*offset)[m->t[i / 4][i % 4] + 1]++] = i / 4;
}

/* The boundary as a triangle mesh of its own. */
static mesh skin_of(const tetmesh *m) {
    uint32_t count;
    uint32_t(*t)[3] = tetmesh_boundary(m, &count);
    mesh s = {.vertices = m->nodes, .triangles = count, .t = t};
    s.x = allocate(m->nodes, sizeof *s.x);
    memcpy(s.x, m->x, m->nodes * sizeof *s.x);
    (void)mesh_drop_unused(&s);
    return s;
}

tet_quality tetmesh_quality(const tetmesh *m, const mesh *surface, const bvh *on_surface) {
    tet_quality q = {.low_deg = 180};
    double volume = 0, edges = 0;
    for (uint32_t i = 0; i < m->tets; i++) {
        double x[4][3], low, high;
        for (int k = 0; k < 4; k++) memcpy(x[k], m->x[m->t[i][k]], sizeof x[k]);
        tet_dihedral_deg(x, &low, &high);
        q.low_deg = fmin(q.low_deg, low);
        q.high_deg = fmax(q.high_deg, high);
        volume += tet_volume(m, i);
        for (int k = 0; k < 6; k++) {
            static const int end[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
            edges += v_distance(x[end[k][0]], x[end[k][1]]) / (6.0 * m->tets);
        }
    }
    q.edge_m = edges;
    if (on_surface == NULL) return q;
    q.volume_error = volume / mesh_volume(surface) - 1;
    mesh skin = skin_of(m);
    double sum = 0, point[3];
    size_t samples = (size_t)skin.vertices + skin.triangles;
    for (size_t i = 0; i < samples; i++) {
        double x[3];
        for (int k = 0; k < 3; k++) {
            if (i < skin.vertices) {
                x[k] = skin.x[i][k];
            } else {
                const uint32_t *t = skin.t[i - skin.vertices];
                x[k] = (skin.x[t[0]][k] + skin.x[t[1]][k] + skin.x[t[2]][k]) / 3;
            }
        }
        double d = bvh_closest(on_surface, x, NULL, 0, point, NULL);
        sum += d;
        q.largest_m = fmax(q.largest_m, d);
    }
    q.mean_m = sum / (double)samples;
    bvh *on_skin = bvh_build(&skin);
    for (uint32_t i = 0; i < surface->vertices; i++)
        q.far_m = fmax(q.far_m, bvh_closest(on_skin, surface->x[i], NULL, 0, point, NULL));
    bvh_free(on_skin);
    mesh_free(&skin);
    return q;
}

/* ---- Medit ---- */

typedef struct {
    const char *path;
    char *cursor;
    size_t line;
    char *word;      /* what is left of the line under way */
    size_t *line_of; /* of each tetrahedron */
} medit;

/* The next word of the file, NULL at its end. */
static char *next_word(medit *r) {
    for (;;) {
        while (r->word != NULL && (*r->word == ' ' || *r->word == '\t')) r->word++;
        if (r->word != NULL && *r->word != '\0') break;
        r->word = next_line(&r->cursor, &r->line);
        if (r->word == NULL) return NULL;
    }
    char *word = r->word;
    r->word += strcspn(r->word, " \t");
    if (*r->word != '\0') *r->word++ = '\0';
    return word;
}

static double next_number(medit *r) {
    double value = 0;
    char *word = next_word(r);
    if (word == NULL) die(EXIT_USAGE, "%s: ends where a number is needed", r->path);
    if (!parse_double(word, &value))
        die(EXIT_USAGE, "%s:%zu: '%s' is not a number", r->path, r->line, word);
    return value;
}

static uint32_t next_count(medit *r, double most) {
    double value = next_number(r);
    if (!(value >= 0 && value <= most) || value > floor(value))
        die(EXIT_USAGE, "%s:%zu: %g is not a whole number from 0 to %g", r->path, r->line, value,
            most);
    return (uint32_t)value;
}

static void read_vertices(medit *r, tetmesh *m) {
    m->nodes = next_count(r, 4e6);
    m->x = allocate((size_t)m->nodes + 1, sizeof *m->x);
    for (uint32_t i = 0; i < m->nodes; i++) {
        for (int k = 0; k < 3; k++) m->x[i][k] = next_number(r);
        (void)next_number(r); /* its reference */
    }
}

/* The corners as the file has them: the vertices may stand behind. */
static void read_corners(medit *r, tetmesh *m) {
    m->tets = next_count(r, 4e6);
    m->t = allocate((size_t)m->tets + 1, sizeof *m->t);
    r->line_of = allocate((size_t)m->tets + 1, sizeof *r->line_of);
    for (uint32_t i = 0; i < m->tets; i++) {
        for (int k = 0; k < 4; k++) m->t[i][k] = next_count(r, 4e6);
        (void)next_number(r); /* its reference */
        r->line_of[i] = r->line;
    }
}

static void check_corners(const medit *r, tetmesh *m) {
    for (uint32_t i = 0; i < m->tets; i++) {
        uint32_t *t = m->t[i];
        for (int k = 0; k < 4; k++) {
            if (t[k] == 0 || t[k] > m->nodes)
                die(EXIT_USAGE, "%s:%zu: vertex %" PRIu32 " is not one of 1 to %" PRIu32, r->path,
                    r->line_of[i], t[k], m->nodes);
            t[k]--;
        }
        double volume = tet_volume(m, i);
        if (volume < 0) {
            uint32_t swap = t[2];
            t[2] = t[3];
            t[3] = swap;
        } else if (!(volume > 0)) {
            die(EXIT_WORK, "%s:%zu: tetrahedron %" PRIu32 " has no volume", r->path, r->line_of[i],
                i);
        }
    }
}

static void drop_unused(tetmesh *m) {
    uint32_t *place = allocate((size_t)m->nodes + 1, sizeof *place), kept = 0;
    for (uint32_t i = 0; i < 4 * m->tets; i++) place[m->t[i / 4][i % 4]] = 1;
    for (uint32_t i = 0; i < m->nodes; i++) {
        if (place[i] == 0) continue;
        memmove(m->x[kept], m->x[i], sizeof m->x[i]);
        place[i] = kept++;
    }
    for (uint32_t i = 0; i < 4 * m->tets; i++) m->t[i / 4][i % 4] = place[m->t[i / 4][i % 4]];
    m->nodes = kept;
    free(place);
}

/* Sections that say nothing about the body (Corners, Ridges, Normals, ...) are passed over, word by
 * word; elements of other shapes would leave a hole in it. */
static void read_section(medit *r, const char *name, tetmesh *m) {
    static const char *const solids[] = {"Hexahedra", "Prisms", "Pyramids"};
    bool vertices = strcasecmp(name, "Vertices") == 0;
    bool tetrahedra = strcasecmp(name, "Tetrahedra") == 0;
    if ((vertices && m->x != NULL) || (tetrahedra && m->t != NULL))
        die(EXIT_USAGE, "%s:%zu: a second section '%s'", r->path, r->line, name);
    if (vertices) read_vertices(r, m);
    if (tetrahedra) read_corners(r, m);
    if (strcasecmp(name, "Dimension") == 0) {
        uint32_t dimension = next_count(r, 100);
        if (dimension != 3)
            die(EXIT_USAGE, "%s:%zu: a mesh of dimension %" PRIu32 ": palp reads dimension 3",
                r->path, r->line, dimension);
    }
    for (size_t i = 0; i < sizeof solids / sizeof *solids; i++) {
        uint32_t count = strcasecmp(name, solids[i]) == 0 ? next_count(r, 4e6) : 0;
        if (count > 0)
            die(EXIT_USAGE, "%s:%zu: %" PRIu32 " %s: cut them into tetrahedra first", r->path,
                r->line, count, solids[i]);
    }
}

tetmesh tetmesh_load(const char *path) {
    size_t bytes;
    char *text = read_file(path, &bytes), *word;
    medit r = {.path = path, .cursor = text};
    tetmesh m = {.nodes = 0};
    double number;
    while ((word = next_word(&r)) != NULL && strcasecmp(word, "End") != 0) {
        if (!parse_double(word, &number)) read_section(&r, word, &m);
    }
    if (m.tets == 0) die(EXIT_WORK, "%s: holds no section Tetrahedra", path);
    check_corners(&r, &m);
    drop_unused(&m);
    free(r.line_of);
    free(text);
    return m;
}

void tetmesh_save(const tetmesh *m, const char *path) {
    output out = open_output(path);
    fprintf(out.file, "MeshVersionFormatted 2\nDimension 3\nVertices %" PRIu32 "\n", m->nodes);
    for (uint32_t i = 0; i < m->nodes; i++)
        fprintf(out.file, "%.17g %.17g %.17g 0\n", m->x[i][0], m->x[i][1], m->x[i][2]);
    fprintf(out.file, "Tetrahedra %" PRIu32 "\n", m->tets);
    for (uint32_t i = 0; i < m->tets; i++)
        fprintf(out.file, "%" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 " 0\n", m->t[i][0] + 1,
                m->t[i][1] + 1, m->t[i][2] + 1, m->t[i][3] + 1);
    fputs("End\n", out.file);
    commit_output(&out);
}
