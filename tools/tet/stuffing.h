/* SPDX-License-Identifier: MIT */
/*
 * Isosurface stuffing (Labelle and Shewchuk 2007): a body-centred cubic lattice, its points near
 * the surface moved onto it, its tetrahedra cut where the surface crosses them. Before smoothing
 * every dihedral angle lies between 10.7 and 164.8 degrees; smoothing never widens that range.
 */
#ifndef PALP_TOOLS_STUFFING_H
#define PALP_TOOLS_STUFFING_H

#include "tools/tet/tetmesh.h"

/*
 * Fills the closed surface with tetrahedra on a lattice of that pitch (m), its points at `phase`
 * (shares of the pitch) from the middle of the bounding box. Parts that the lattice separates are
 * dropped but for the largest; *dropped tells what share of the volume they were. `on` is a tree of
 * `surface`. No tetrahedra when the lattice is too coarse for the body.
 */
tetmesh stuff(const mesh *surface, const bvh *on, double pitch, const double phase[3],
              double *dropped);

#define TET_LEVELS 5 /* resolutions of one body */

/* The same with a pitch that gives about `nodes` nodes, which *pitch tells; lattices of different
 * `level` have different phases, so that meshes of one body are not nested. Exits with the reason
 * if no lattice will do. */
tetmesh stuff_level(const mesh *surface, const bvh *on, uint32_t nodes, uint32_t level,
                    double *pitch, double *dropped);

#endif
