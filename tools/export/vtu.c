/* SPDX-License-Identifier: MIT */
#include "tools/export/vtu.h"
#include "core/device/canframe.h"
#include "port/host/stiffness.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define VTK_TRIANGLE 5

/* Values that are appended: where each begins is said before they come. */
typedef struct {
    FILE *out;
    uint8_t *bytes;
    size_t used, room;
} appendix;

static void open_file(appendix *a, FILE *out, const film *f) {
    size_t triangles = 0;
    for (uint32_t i = 0; i < f->parts; i++) triangles += f->part[i].triangles;
    *a = (appendix){.out = out};
    fprintf(out,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
            "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
            "<UnstructuredGrid>\n<Piece NumberOfPoints=\"%" PRIu32 "\" NumberOfCells=\"%zu\">\n",
            f->nodes, triangles);
}

/* Begins an array of so many bytes; they go where is returned. */
static uint8_t *array(appendix *a, const char *type, const char *name, uint32_t components,
                      size_t bytes) {
    fprintf(a->out,
            "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%" PRIu32
            "\" format=\"appended\" offset=\"%zu\"/>\n",
            type, name, components, a->used);
    a->bytes = grow(a->bytes, &a->room, a->used + 8 + bytes, 1);
    uint8_t *at = a->bytes + a->used;
    palp_put_u32(at, (uint32_t)bytes);
    palp_put_u32(at + 4, (uint32_t)((uint64_t)bytes >> 32));
    a->used += 8 + bytes;
    return at + 8;
}

static void put_floats(appendix *a, const char *name, uint32_t components, const float *x,
                       size_t count) {
    uint8_t *to = array(a, "Float32", name, components, 4 * count * components);
    for (size_t i = 0; i < count * components; i++) palp_put_f32(to + 4 * i, x[i]);
}

static void put_cells(appendix *a, const film *f) {
    size_t triangles = 0, first = 0, at = 0;
    for (uint32_t i = 0; i < f->parts; i++) triangles += f->part[i].triangles;
    fputs("<Cells>\n", a->out);
    uint8_t *to = array(a, "Int32", "connectivity", 1, 12 * triangles);
    for (uint32_t i = 0; i < f->parts; first += f->part[i++].nodes) {
        const film_part *p = &f->part[i];
        for (size_t k = 0; k < 3 * (size_t)p->triangles; k++, at++)
            palp_put_u32(to + 4 * at, (uint32_t)(first + p->triangle[k]));
    }
    to = array(a, "Int32", "offsets", 1, 4 * triangles);
    for (size_t t = 0; t < triangles; t++) palp_put_u32(to + 4 * t, (uint32_t)(3 * (t + 1)));
    memset(array(a, "UInt8", "types", 1, triangles), VTK_TRIANGLE, triangles);
    fputs("</Cells>\n", a->out);
}

static void put_points(appendix *a, const float *x, const film *f) {
    fputs("<Points>\n", a->out);
    put_floats(a, "Points", 3, x, f->nodes);
    fputs("</Points>\n", a->out);
}

static void put_fixed(appendix *a, const film *f) {
    uint8_t *to = array(a, "UInt8", "fixed", 1, f->nodes);
    for (uint32_t i = 0; i < f->parts; to += f->part[i++].nodes)
        memcpy(to, f->part[i].fixed, f->part[i].nodes);
    to = array(a, "UInt8", "part", 1, f->nodes);
    for (uint32_t i = 0; i < f->parts; to += f->part[i++].nodes)
        memset(to, (int)i, f->part[i].nodes);
}

static void close_file(appendix *a) {
    fputs("</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_", a->out);
    fwrite(a->bytes, 1, a->used, a->out);
    fputs("\n</AppendedData>\n</VTKFile>\n", a->out);
    free(a->bytes);
}

static float *rest_of(const film *f) {
    float *x = allocate(3 * (size_t)f->nodes, sizeof *x), *to = x;
    for (uint32_t i = 0; i < f->parts; to += 3 * (size_t)f->part[i++].nodes)
        memcpy(to, f->part[i].rest_m, 3 * (size_t)f->part[i].nodes * sizeof *x);
    return x;
}

void vtu_write_rest(FILE *out, const film *f) {
    appendix a;
    open_file(&a, out, f);
    float *x = rest_of(f), *normal = allocate(3 * (size_t)f->nodes, sizeof *normal);
    float *area = allocate(f->nodes, sizeof *area),
          *stiffness = allocate(f->nodes, sizeof *stiffness);
    size_t first = 0;
    bool known = true;
    film_normals(f, x, normal);
    for (uint32_t i = 0; i < f->parts; first += f->part[i++].nodes) {
        const palp_blob *b = f->part[i].blob;
        known = known && b != NULL && !palp_blob_has(b, PALP_META_SCALAR);
        if (!known) break;
        memcpy(normal + 3 * first, b->normal, 3 * (size_t)b->meta->nodes * sizeof *normal);
        memcpy(area + first, b->area_m2, b->meta->nodes * sizeof *area);
        node_stiffness(b, stiffness + first);
    }
    fputs("<PointData>\n", out);
    put_floats(&a, "normal", 3, normal, f->nodes);
    if (known) put_floats(&a, "area_m2", 1, area, f->nodes);
    if (known) put_floats(&a, "stiffness_N_per_m", 1, stiffness, f->nodes);
    put_fixed(&a, f);
    fputs("</PointData>\n", out);
    put_points(&a, x, f);
    put_cells(&a, f);
    close_file(&a);
    free(x);
    free(normal);
    free(area);
    free(stiffness);
}

void vtu_write_frame(FILE *out, const film *f, size_t number) {
    appendix a;
    const film_frame *k = &f->frame[number];
    float *u = rest_of(f);
    open_file(&a, out, f);
    for (size_t i = 0; i < 3 * (size_t)f->nodes; i++) u[i] = k->at_m[i] - u[i];
    fputs("<PointData Vectors=\"displacement_m\">\n", out);
    put_floats(&a, "displacement_m", 3, u, f->nodes);
    put_floats(&a, "pressure_Pa", 1, k->pressure_Pa, f->nodes);
    put_fixed(&a, f);
    fputs("</PointData>\n", out);
    put_points(&a, k->at_m, f);
    put_cells(&a, f);
    close_file(&a);
    free(u);
}

void pvd_write(FILE *out, const film *f, const char *name) {
    fputs("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" "
          "byte_order=\"LittleEndian\">\n<Collection>\n",
          out);
    for (size_t i = 0; i < f->frames; i++) {
        fprintf(out, "<DataSet timestep=\"%.9g\" part=\"0\" file=\"", f->frame[i].t_s);
        print_escaped(out, name);
        fprintf(out, "_%04zu.vtu\"/>\n", i);
    }
    fputs("</Collection>\n</VTKFile>\n", out);
}
