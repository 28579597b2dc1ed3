/* SPDX-License-Identifier: MIT */
/*
 * The surface of one elastostatic body: where its points are, and how it gives way between them.
 *
 * A point is a place on a triangle. The smooth surface through nodes x_i with normals n_i lies off
 * the facet by
 *
 *     y = q + 1/2 sum_i b_i ((x_i - q) . n_i) n_i,   q = sum_i b_i x_i
 *
 * which is exact for a quadratic surface; b are barycentric weights. A force on a point is spread
 * over the corners with the same weights, and its displacement is the corners' mean with them, so
 * the compliance between two points (m/N, 3x3)
 *
 *     C_ij = B(y_i - y_j) + sum_kl b_ik b_jl H_kl
 *
 * is symmetric. B is the half-space's response (Boussinesq, Cerruti), singular at the load, and H
 * the body's regular rest by its modes (blob.h):
 *
 *     B(r) = (1 + nu) / (pi E |r|) ((1 - nu) I + nu e e^T + (1/2 - nu) (e n^T - n e^T))
 *     e = r / |r|
 *
 * with n = (n_i + n_j) / 2. A point that stands for a cell of a regular hexagonal lattice of
 * spacing s has 1 / |r| -> PALP_LATTICE_SELF / s and r r^T / |r|^2 -> (I - n n^T) / 2 in its own B.
 */
#ifndef PALP_SURFACE_SURFACE_H
#define PALP_SURFACE_SURFACE_H

#include "core/zone/assembly.h"

#define PALP_LATTICE_SELF 4.2134225f /* sum over a hexagonal lattice, against its integral */
#define PALP_SURFACE_CROSSINGS 32u   /* triangles that one shot crosses at most */

typedef struct {
    const palp_blob *blob;   /* kept by reference; has a regular part */
    palp_assembly *assembly; /* that it is a zone of; NULL: a body at rest */
    uint32_t zone;
    float compliance_m2_per_N; /* (1 + nu) / (pi E) */
    float poisson;
} palp_surface;

typedef struct {
    uint32_t body; /* of several that are one model; 0 */
    uint32_t triangle;
    float weight[3]; /* barycentric, not negative, sum 1 */
    palp_vec3 q;     /* on the facet */
    palp_vec3 y, n;  /* on the smooth surface; unit normal, outward */
} palp_surface_point;

/* Error: ABSENT when the blob has no regular part: bake it again. */
palp_status palp_surface_open(palp_surface *surface, const palp_blob *blob);
palp_status palp_surface_open_zone(palp_surface *surface, palp_assembly *assembly, uint32_t zone);

/* How far a node is moved without contact (m): zones are bent by their seams and by gravity. */
static inline palp_vec3 palp_surface_bent(const palp_surface *surface, uint32_t node) {
    const palp_vec3 none = {0.0f, 0.0f, 0.0f};
    return surface->assembly != NULL ? palp_assembly_bent(surface->assembly, surface->zone, node)
                                     : none;
}

/* Whether a triangle lies inside the model, on a seam: nothing touches it. */
static inline bool palp_surface_is_inner(const palp_surface *surface, uint32_t triangle) {
    const uint32_t *across = surface->blob->regular.across + 3u * (size_t)triangle;
    return across[0] == triangle && across[1] == triangle && across[2] == triangle;
}

/* Whether a place (frame of the body, m) is within its box at rest, or `reach_m` beyond it. */
bool palp_surface_is_within(const palp_blob *blob, palp_vec3 x, float reach_m);

/*
 * The point where the line through `origin` along `direction` enters the surface, found by walking
 * from triangle to triangle from point->triangle on. False, with only point->triangle changed, when
 * the walk comes to a triangle that faces away, takes PALP_SURFACE_CROSSINGS steps, or has used up
 * *crossings, from which every step is taken away. Cost: about 45 operations per triangle and 60
 * for the point.
 */
bool palp_surface_shoot(const palp_surface *surface, palp_vec3 origin, palp_vec3 direction,
                        uint32_t *crossings, palp_surface_point *point);

/* The same, telling a walk that ends at a seam from one that ends: *edge is then the edge, by the
 * corner that it faces, of point->triangle. */
typedef enum { PALP_MISSED, PALP_ENTERED, PALP_AT_SEAM } palp_walk;
palp_walk palp_surface_walk(const palp_surface *surface, palp_vec3 origin, palp_vec3 direction,
                            uint32_t *crossings, palp_surface_point *point, uint32_t *edge);

/* How a point moves when its shot does: derivatives of y and n with respect to q, row-major. */
void palp_surface_slopes(const palp_surface *surface, const palp_surface_point *point,
                         float dy_dq[9], float dn_dq[9]);

/* Gradients of the barycentric weights in the plane of a triangle: weight k changes by
 * gradient[k] . dq. */
void palp_surface_gradients(const palp_surface *surface, uint32_t triangle, palp_vec3 gradient[3]);

/*
 * row[a * stride] = sum_k b_k U_ka . d for the first `modes` modes: what a unit force along d at
 * the point gives them. modes a multiple of PALP_MODE_LANES. Cost: 9 modes.
 */
void palp_surface_modes(const palp_surface *surface, const palp_surface_point *point, palp_vec3 d,
                        uint32_t modes, float *row, size_t stride);

/* What modes with the weights load[modes] (eigenvalue times force) displace a corner by. 3 modes.
 */
palp_vec3 palp_surface_corner(const palp_surface *surface, uint32_t node, uint32_t modes,
                              const float *load);

#endif
