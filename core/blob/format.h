/* SPDX-License-Identifier: MIT */
/*
 * The blob on disk and in flash, byte for byte; blobs/FORMAT.md says it in prose.
 *
 * Header, section table, then the sections in table order, each starting at the next multiple of 64
 * bytes. Little-endian. The gaps are zero and are covered by the CRC of the section before them, so
 * every byte of the file is covered by exactly one CRC.
 */
#ifndef PALP_BLOB_FORMAT_H
#define PALP_BLOB_FORMAT_H

#include "core/base/status.h"
#include <stddef.h>
#include <stdint.h>

#define PALP_BLOB_MAGIC "PALPBLOB"
#define PALP_BLOB_VERSION 3u /* written; what is read begins with: */
#define PALP_BLOB_OLDEST 2u
#define PALP_BLOB_BYTE_ORDER 0x01020304u
#define PALP_BLOB_ALIGN 64u
#define PALP_MAX_LEVELS 12u   /* levels 0..11 */
#define PALP_MAX_NODES 65535u /* row indices are 16 bits wide */
#define PALP_LANES 8u         /* 3x3 blocks per group in a column */
#define PALP_GROUP_VALUES 72u /* nine entries, each PALP_LANES wide */
#define PALP_FIXED_FLAG 0x80000000u

#define PALP_MAX_MODES 128u
#define PALP_MODE_LANES 8u
#define PALP_MODE_UNIT 32767.0f

/* The two domains of the reference boundary value problem (MR 21-24). */
#define PALP_FREE 0u  /* Lambda_p: unknown displacement u (m), given nodal force f (N) */
#define PALP_FIXED 1u /* Lambda_u: unknown traction p (Pa), given displacement u (m) */
#define PALP_DOMAINS 2u

typedef struct {
    char magic[8];
    uint32_t version;
    uint32_t byte_order;
    uint64_t total_bytes;
    uint32_t section_count;
    uint32_t header_crc; /* CRC-32C of header and table with this field zero */
    uint8_t reserved[32];
} palp_blob_header;

typedef struct {
    uint32_t type; /* palp_section, ascending */
    uint32_t element_bytes;
    uint64_t offset; /* from the start of the blob */
    uint64_t count;  /* elements */
    uint32_t crc;    /* CRC-32C of the section and of the padding behind it */
    uint32_t reserved;
} palp_blob_entry;

/* Per-domain and per-block sections add the domain (or 2 * row domain + column domain) to the type.
 */
typedef enum {
    PALP_SEC_META = 1,
    PALP_SEC_REST = 2,        /* f32[nodes][3] rest positions, m */
    PALP_SEC_NORMAL = 3,      /* f32[nodes][3] outward unit normals */
    PALP_SEC_AREA = 4,        /* f32[nodes] nodal areas a_j (MR 4), m^2 */
    PALP_SEC_TRIANGLE = 5,    /* u32[triangles][3] */
    PALP_SEC_SLOT = 6,        /* u32[nodes] slot in its domain, PALP_FIXED_FLAG set when fixed */
    PALP_SEC_RING_OFFSET = 7, /* u32[nodes + 1] */
    PALP_SEC_RING = 8,        /* u32[] neighbours of each node */
    PALP_SEC_CELL_OFFSET = 9, /* u32[cells + 1] search grid */
    PALP_SEC_CELL_NODE = 10,  /* u32[nodes] nodes sorted by cell */
    /* 11: of blobs of version 2, not read */
    PALP_SEC_LEVEL_AREA = 12, /* f32[] a_[l,k] of K(0), then of K(1), .. K(levels - 1), m^2 */
    /* The surface as contact meets it (core/surface); all or none. */
    PALP_SEC_ACROSS = 13,       /* u32[triangles][3] triangle across the edge facing each corner */
    PALP_SEC_MODE_VALUE = 14,   /* f32[modes] eigenvalues of H, largest magnitude first, m/N */
    PALP_SEC_MODE = 15,         /* i16[nodes][3][modes] eigenvectors over PALP_MODE_UNIT */
    PALP_SEC_NODE = 16,         /* + domain: u32[slots] node of each slot, coarse to fine */
    PALP_SEC_LEVEL_START = 20,  /* + domain: u32[levels + 1] first slot of each level */
    PALP_SEC_PARENT = 24,       /* + domain: u32[slots][2] */
    PALP_SEC_PREDICT = 28,      /* + domain: f32[slots][2] */
    PALP_SEC_UPDATE = 32,       /* + domain: f32[slots][2] */
    PALP_SEC_CHILD_OFFSET = 36, /* + domain: u32[slots + 1] */
    PALP_SEC_CHILD = 40,        /* + domain: u32[] odd slots that update this one, ascending */
    PALP_SEC_CHILD_WEIGHT = 44, /* + domain: f32[] what each of them updates it with */
    PALP_SEC_STENCIL_OFFSET = 80, /* + domain: u32[slots + 1], butterfly only */
    PALP_SEC_STENCIL = 84,        /* + domain: u32[] what predicts each odd slot */
    PALP_SEC_STENCIL_WEIGHT = 88, /* + domain: f32[] */
    PALP_SEC_COL_OFFSET = 48,     /* + block: u32[columns + 1], in groups of PALP_LANES blocks */
    PALP_SEC_COL_INDEX = 56,      /* + block: u16[groups][PALP_LANES] row slots, ascending */
    PALP_SEC_COL_VALUE = 64,      /* + block: f32 or f16 [groups][9][PALP_LANES] */
    PALP_SEC_COL_SCALE = 72,      /* + block: f32[columns] multiplier of the stored values */
    /* Display surface, a displaced subdivision of the nodes' (MR 9); all or none. */
    PALP_SEC_DETAIL_OFFSET = 96,    /* u32[detail_vertices + 1] */
    PALP_SEC_DETAIL_NODE = 97,      /* u32[] nodes that each vertex is a mean of */
    PALP_SEC_DETAIL_WEIGHT = 98,    /* f32[] */
    PALP_SEC_DETAIL_HEIGHT = 99,    /* f32[detail_vertices] displacement along the normal, m */
    PALP_SEC_DETAIL_TRIANGLE = 100, /* u32[detail_triangles][3] */
    PALP_SEC_DETAIL_NEAR = 101,     /* u32[nodes + 1] detail vertices around each node: offsets */
    PALP_SEC_DETAIL_LIST = 102,     /* u32[detail_vertices] and the vertices */
    PALP_SEC_NODE_TRIANGLE = 104,   /* with ACROSS: u32[nodes] one of the triangles of each node */
    PALP_SEC_LEVEL_ERROR = 105, /* f32[PALP_LEVEL_ERRORS][2]: error of the force on each level of
                                   contact against the finest, mean and worst; may be missing */
    PALP_SEC_SPLIT_VALUE =
        106, /* f32[split_modes] as MODE_VALUE and MODE, of the split form's own */
    PALP_SEC_SPLIT_MODE = 107, /* i16[nodes][3][split_modes] */
    /* Constraint hierarchy of the free domain: + PALP_LEVEL_STRIDE * level. The columns of level
     * constraint_level are those of block free-free above. */
    PALP_SEC_LEVEL_OFFSET = 128, /* the four column sections, as above */
    PALP_SEC_LEVEL_INDEX = 129,
    PALP_SEC_LEVEL_VALUE = 130,
    PALP_SEC_LEVEL_SCALE = 131,
    PALP_SEC_LEVEL_TABLE = 132, /* f32[n (n + 1) / 2][9] lower triangle of R_l G R_l^T, m/N */
    /* A multizone model holds none of the above, but whole blobs of its zones and what joins them.
     */
    PALP_SEC_ZONES = 512,         /* palp_zones_meta */
    PALP_SEC_ZONE = 513,          /* palp_zone_entry[zones], each behind the one that carries it */
    PALP_SEC_JOINT = 514,         /* palp_joint_entry[joints] */
    PALP_SEC_SEAM = 515,          /* palp_seam_entry[seams], in the order of elimination */
    PALP_SEC_SEAM_NODE = 516,     /* u32[][2] of each seam in turn: node in zone[0], in zone[1] */
    PALP_SEC_SEAM_MODE = 517,     /* f32[] of each seam in turn: [nodes][modes] orthonormal modes */
    PALP_SEC_ZONE_BLOB = 576,     /* + zone: the bytes of its blob */
    PALP_SEC_STIFFNESS = 608,     /* + zone: f32[M (M + 1) / 2][9] lower triangle, N/m */
    PALP_SEC_SEAM_RESPONSE = 640, /* + zone: f32[free slots][M][9] displacement by seam modes */
    PALP_SEC_REACTION = 672,      /* + zone: f32[fixed slots][M][9] reactions to seam modes, N/m */
    PALP_SEC_WEIGHT = 704,        /* + zone: f32[M][9] seam reaction to unit acceleration, kg */

    /* A body of tetrahedra at several resolutions; nodes, tetrahedra and families of all levels in
     * one count, coarse to fine. */
    PALP_SEC_TETS = 768,                 /* palp_tets_meta */
    PALP_SEC_TET_REST = 769,             /* f32[nodes][3] rest positions, m */
    PALP_SEC_TET_NODE = 770,             /* palp_tet_node[nodes] */
    PALP_SEC_TET = 771,                  /* palp_tet[tets] */
    PALP_SEC_TET_AROUND_OFFSET = 772,    /* u32[nodes + 1] */
    PALP_SEC_TET_AROUND = 773,           /* u32[4 tets] tetrahedra of each node */
    PALP_SEC_TET_CONTAINER = 774,        /* u32[nodes] of the next coarser level, at each node */
    PALP_SEC_TET_CONTAINER_WEIGHT = 775, /* f32[nodes][4] the node's place in it */
    PALP_SEC_TET_FAMILY = 776,           /* u32[nodes][2] that it is a child of, a parent of */
    PALP_SEC_TET_CHILD_OFFSET = 777,     /* u32[families + 1] */
    PALP_SEC_TET_CHILD = 778,            /* u32[] nodes of the finer level */
    PALP_SEC_TET_PARENT_OFFSET = 779,    /* u32[families + 1] */
    PALP_SEC_TET_PARENT = 780,           /* u32[] nodes of the coarser level */
    PALP_SEC_TET_MEAN_OFFSET = 781,      /* u32[nodes + 1] */
    PALP_SEC_TET_MEAN = 782,             /* u32[] children that stand for each parent */
    PALP_SEC_TET_MEAN_WEIGHT = 783,      /* f32[] and their shares */
    PALP_SEC_SKIN_NODE = 784,            /* u32[skin] nodes of the finest level */
    PALP_SEC_SKIN_TRIANGLE = 785,        /* u32[skin_triangles][3] outward */
    PALP_SEC_SKIN_NORMAL = 786,          /* f32[skin][3] */
    PALP_SEC_SKIN_TET = 787,             /* u32[skin][levels] that each vertex is embedded in */
    PALP_SEC_SKIN_WEIGHT = 788,          /* f32[skin][levels][4] */
    /* A rigid tool. */
    PALP_SEC_TOOL = 896,         /* palp_tool_meta */
    PALP_SEC_TOOL_SAMPLE = 897,  /* i16[count[2]][count[1]][count[0]] */
    PALP_SEC_TOOL_EXTREME = 898, /* f32[extremes][3] places of the mesh that lie outermost, m */
} palp_section;

#define PALP_MAX_ZONES 32u
#define PALP_MAX_JOINTS 48u
#define PALP_MAX_SEAMS 48u
#define PALP_MAX_ZONE_SEAMS 8u
#define PALP_SEAM_LEVELS 6u
#define PALP_AFFINE_MODES 4u /* the first modes of a seam span 1, x, y, z on it */
#define PALP_NAME_BYTES 24u  /* with the final zero */
#define PALP_NONE 0xffffffffu

typedef struct {
    uint32_t zones, joints, seams, flags;
    uint32_t reserved[12];
} palp_zones_meta;

/* Everything is in the coordinates of the model at rest (all joint values zero). */
typedef struct {
    char name[PALP_NAME_BYTES];
    uint32_t joint;                 /* that carries it; PALP_NONE for zone 0 */
    uint32_t modes;                 /* M, of all its seams in ascending order */
    float rotation[9], origin_m[3]; /* of its own frame, at rest */
    uint32_t reserved[4];
} palp_zone_entry;

typedef enum { PALP_FIXED_JOINT = 0, PALP_REVOLUTE = 1, PALP_PRISMATIC = 2 } palp_joint_kind;

typedef struct {
    char name[PALP_NAME_BYTES];
    uint32_t kind, parent, child;
    uint32_t closure; /* 1: closes a loop, carries no zone and has no value of its own */
    float axis[3], origin_m[3];
    float low, high; /* rad or m */
    uint32_t reserved[2];
} palp_joint_entry;

typedef struct {
    uint32_t zone[2]; /* the first one's frame is the seam's */
    uint32_t nodes, modes;
    uint32_t level_modes[PALP_SEAM_LEVELS]; /* first so many modes on each level; the last: all */
    uint32_t joint;                         /* between its zones; PALP_NONE if there is none */
    float ones[PALP_AFFINE_MODES];          /* the constant 1, in modes */
    float position_m[PALP_AFFINE_MODES][3]; /* the rest positions, in modes */
    float length_m;                         /* of its box's diagonal */
    uint32_t reserved[4];
} palp_seam_entry;

PALP_STATIC_ASSERT(sizeof(palp_zones_meta) == 64, "zones meta layout");
PALP_STATIC_ASSERT(sizeof(palp_zone_entry) == 96, "zone entry layout");
PALP_STATIC_ASSERT(sizeof(palp_joint_entry) == 80, "joint entry layout");
PALP_STATIC_ASSERT(sizeof(palp_seam_entry) == 128, "seam entry layout");

#define PALP_LEVEL_ERRORS 5u /* levels of contact */
#define PALP_LEVEL_STRIDE 8u

#define PALP_META_LIFTED 1u    /* lifted wavelets */
#define PALP_META_SYMMETRIC 2u /* reciprocity enforced: G_FF is symmetric positive definite */
#define PALP_META_GRAVITY 4u   /* the last column of each F column set is the gravity response */
#define PALP_META_FIXED_COLUMNS                                                                    \
    8u                          /* columns of the fixed nodes are there: they can be released      \
                                 */
#define PALP_META_REACTIONS 16u /* rows of the fixed nodes are there: reactions are known */
#define PALP_META_HALF 32u      /* IEEE half storage */
#define PALP_META_BUTTERFLY 64u /* butterfly predictor: the domains have stencils */
#define PALP_META_SCALAR                                                                           \
    128u /* one unknown per node: blocks of one entry, groups of PALP_LANES                        \
          */
#define PALP_META_SPLIT 256u /* free-free: half-space, modes and corrections (green/split.h) */

typedef struct {
    uint32_t nodes, triangles, levels, flags;
    uint32_t domain_nodes[PALP_DOMAINS];
    uint32_t max_ring;    /* largest valence */
    uint32_t max_row;     /* longest selective reconstruction row E^T W^-1 of either domain */
    uint32_t max_groups;  /* groups of the longest column of any constraint level */
    uint32_t cells[3];    /* search grid */
    uint64_t free_blocks; /* stored on the constraint level, gravity column apart */
    float young_Pa, poisson, density_kg_m3, epsilon;
    float rms_error, max_error;  /* MR 70, 71, on the constraint level */
    float reciprocity_residual;  /* |G - G^T|_F / |G|_F before it was enforced */
    float stiffness_min_N_per_m; /* 1 / (n^T G_jj n) over that level */
    float stiffness_max_N_per_m;
    float mean_edge_m;
    float box_min_m[3], box_max_m[3];
    float cell_origin_m[3], cell_size_m;
    float equilibrium_residual; /* largest |sum of reactions + load| / |load| over unit loads */
    uint8_t mesh_sha256[32];
    uint32_t constraint_level; /* finest level whose Green's functions are stored */
    uint32_t detail_vertices, detail_triangles; /* of the display surface; 0: none */
    uint32_t modes; /* of the regular part H, a multiple of PALP_MODE_LANES; 0: not to be touched */
    uint32_t split_modes; /* of the split form's own, likewise; 0: it has those of contact */
} palp_meta;

PALP_STATIC_ASSERT(sizeof(palp_blob_header) == 64, "header layout");
PALP_STATIC_ASSERT(sizeof(palp_blob_entry) == 32, "table entry layout");

PALP_STATIC_ASSERT(sizeof(palp_meta) == 192, "meta layout");
PALP_STATIC_ASSERT(sizeof(float) == 4, "IEEE single");

/* ---- dynamic bodies (AD) ---- */

#define PALP_TET_LEVELS 5u

typedef struct {
    uint32_t nodes, tets, families, levels, skin, skin_triangles;
    uint32_t first_node[PALP_TET_LEVELS + 1u], first_tet[PALP_TET_LEVELS + 1u];
    uint32_t first_family[PALP_TET_LEVELS + 1u];       /* [l]: between the levels l and l + 1 */
    float young_Pa, poisson, density_kg_m3, damping_s; /* phi = damping lambda, psi = damping mu */
    float drag_per_s;                                  /* damping of the velocity itself */
    float diagonal_m;                                  /* of the bounding box */
    float theta[PALP_TET_LEVELS]; /* K <= theta times its block diagonal, estimated; at most 4 */
    uint8_t mesh_sha256[32];
} palp_tets_meta;

#define PALP_TET_PINNED 1u

/* What a node is, without its material. */
typedef struct {
    float volume_m3; /* a quarter of that of its tetrahedra */
    /* S, the sum of V b b^T: xx, yy, zz, yz, zx, xy; the Jacobian at rest (AD 11) is
     * -((lambda + mu) S + mu tr(S) I) */
    float gradient_sum[6];
    float near_m; /* h: distance to its nearest neighbour (AD 9, 10) */
    uint32_t flags;
} palp_tet_node;

/* One element, one cache line. */
typedef struct {
    uint32_t node[4];
    float b[9];      /* rest gradients of the hats of nodes 1, 2, 3 (AD 5), 1/m */
    float volume_m3; /* positive */
    uint32_t unused[2];
} palp_tet;

/* ---- tools ---- */

/* A signed distance field (core/contact/tool_field.h), in the tool's own axes. */
typedef struct {
    uint32_t count[3]; /* samples, each 4 to 1,024 */
    uint32_t flags;    /* 0 */
    float origin_m[3]; /* of the first sample */
    float step_m, unit_m, radius_m;
    float size_m;      /* radius of the largest ball inside */
    float error_max_m; /* of the distance on the surface, measured by bake */
    uint8_t mesh_sha256[32];
    uint32_t extremes;   /* up to PALP_TOOL_EXTREMES */
    float extreme_off_m; /* how much farther the mesh reaches than any of them, at most */
    uint32_t reserved[10];
} palp_tool_meta;

#define PALP_TOOL_EXTREMES 64u

PALP_STATIC_ASSERT(sizeof(palp_tool_meta) == 128, "tool meta layout");

PALP_STATIC_ASSERT(sizeof(palp_tet_node) == 36 && sizeof(palp_tet) == 64, "no padding");

#endif
