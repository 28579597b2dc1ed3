/* SPDX-License-Identifier: MIT */
/*
 * What work costs. The bound of every operation is a sum of named counts (points, nodes in
 * contact, elements due ...) times what one of each kind of work costs: the `cost` headers beside
 * the operations give the sums, and these prices the rest. The same sums are instructions on a
 * target, bytes touched, or nanoseconds, by the prices that they are given (budget/target.h).
 */
#ifndef PALP_BUDGET_PRICE_H
#define PALP_BUDGET_PRICE_H

/* X(NAME, name in tables, what one of it is) */
#define PALP_WORK_LIST(X)                                                                          \
    X(BALL, "ball", "one ball of a tool evaluated at a node")                                      \
    X(PAD, "pad", "a pad evaluated")                                                               \
    X(CYLINDER, "cylinder", "a cylinder evaluated")                                                \
    X(FIELD, "field", "a distance field evaluated")                                                \
    X(ROOM, "room", "one contact point compared to make room")                                     \
    X(ROW, "row", "a row of W^-1 begun")                                                           \
    X(ROW_WORD, "row_word", "one word of marks scanned")                                           \
    X(ROW_MARK, "row_mark", "one marked slot visited")                                             \
    X(ROW_CHILD, "row_child", "one child of it visited")                                           \
    X(EXTRACT, "extract", "an extraction begun")                                                   \
    X(EXTRACT_ENTRY, "extract_entry", "one entry of the row in it")                                \
    X(EXTRACT_SKIP, "extract_skip", "one index of the column passed")                              \
    X(EXTRACT_MATCH, "extract_match", "one entry that may meet its block")                         \
    X(SUBSTITUTE, "substitute", "one row of a triangular solve")                                   \
    X(AXPY, "axpy", "one entry of it, side by side")                                               \
    X(DOT, "dot", "one entry of a sum in order")                                                   \
    X(GATHER, "gather", "one compliance gathered for the factor")                                  \
    X(ROW_BEGUN, "row_begun", "a row of compliances begun")                                        \
    X(ROW_MODE, "row_mode", "one mode read for it")                                                \
    X(COUPLE, "couple", "a tool's spring in one solve")                                            \
    X(LEAVE, "leave", "a tool's spring in one tick")                                               \
    X(TICK, "tick", "a bounded tick, its end and its report")                                      \
    X(QUANTUM, "quantum", "a reading of the clock and what it decides")                            \
    X(ADD, "add", "a column added to the details")                                                 \
    X(ADD_GROUP, "add_group", "eight blocks of it")                                                \
    X(ADD_HALF, "add_half", "the same stored in halves")                                           \
    X(EXTRACT_HALF, "extract_half", "one entry of an extraction from halves")                      \
    X(TRANSFORM, "transform", "one level of an inverse transform begun")                           \
    X(TRANSFORM_SLOT, "transform_slot", "one slot of it")                                          \
    X(TRANSFORM_TERM, "transform_term", "one parent or child of it")                               \
    X(SPREAD, "spread", "a force spread over a body in split form, or its modes")                  \
    X(SPREAD_NODE, "spread_node", "one node that a force displaces")                               \
    X(SPREAD_MODE, "spread_mode", "one mode that it loads")                                        \
    X(FIELD_NODE, "field_node", "one node that loaded modes displace")                             \
    X(FIELD_MODE, "field_mode", "one mode at it")                                                  \
    X(SEAM, "seam", "one seam visited")                                                            \
    X(SEAM_MODE, "seam_mode", "one unknown of a seam in a vector")                                 \
    X(SEAM_DOT, "seam_dot", "one product of a seam's row in order")                                \
    X(SEAM_TURN, "seam_turn", "one entry of a block turned and put in place")                      \
    X(SEAM_ROW, "seam_row", "one entry of a block divided or moved")                               \
    X(SEAM_PRODUCT, "seam_product", "one entry of a block eliminated")                             \
    X(TURN, "turn", "a place or a direction of a zone turned")                                     \
    X(POSITION, "position", "where a node of a zone is")                                           \
    X(POSITION_MODE, "position_mode", "one mode of its seams in that")                             \
    X(ELEMENT, "element", "one element evaluated")                                                 \
    X(NODE_STEP, "node_step", "one node in one step")                                              \
    X(SOURCE, "source", "one source of an interface node")                                         \
    X(NARROW, "narrow", "one narrow-phase test of a tool")                                         \
    X(IMPOSED, "imposed", "one point in one step")                                                 \
    X(SKIN, "skin", "one skin vertex tested")                                                      \
    X(SKIN_TOOL, "skin_tool", "by each tool")                                                      \
    X(NODE_TICK, "node_tick", "one node in one tick")                                              \
    X(LIST_NODE, "list_node", "one node listed anew")                                              \
    X(LIST_TET, "list_tet", "one tetrahedron listed anew")                                         \
    X(LIST_SKIN, "list_skin", "one skin vertex embedded anew")                                     \
    X(FAMILY, "family", "one family weighed")                                                      \
    X(ELEMENT_TEST, "element_test", "one element tested before a change of level")                 \
    X(SERVO, "servo", "a servo tick without its frames and the contact")                           \
    X(AXIS, "axis", "of one axis in it")                                                           \
    X(FRAME, "frame", "one frame received")                                                        \
    X(FRAME_BYTE, "frame_byte", "one byte of it, of as many as a frame may have")                  \
    X(FILLING, "filling", "one filling of a lattice, its table, what it follows")                  \
    X(AROUND, "around", "one node or row of cells around a tool visited")                          \
    X(NODE, "node", "one node within reach of a tool tested")                                      \
    X(FOOT, "foot", "the nearest point of the surface sought from a node")                         \
    X(KEPT, "kept", "one point of the last tick looked for in a lattice")                          \
    X(FOLLOWED, "followed", "one point that a lattice follows")                                    \
    X(FAR_FIELD, "far_field", "the body's far field at a place")                                   \
    X(SHOT, "shot", "one site of a lattice shot at")                                               \
    X(CROSSING, "crossing", "one triangle crossed by a shot")                                      \
    X(POINT, "point", "a contact point: what it asks, its share of the answer")                    \
    X(MODE_AT, "mode_at", "one mode at a point")                                                   \
    X(COMPLIANCE, "compliance", "one compliance of the half-space")                                \
    X(MODE_PAIR, "mode_pair", "one mode in it")                                                    \
    X(CORNER, "corner", "one corner of the points' triangles")                                     \
    X(CORNER_MODE, "corner_mode", "one mode at a corner")                                          \
    X(DISPLACE, "displace", "one force at one point")                                              \
    X(PULL, "pull", "the gradient of one force at one point")                                      \
    X(DERIVATIVE, "derivative", "derivatives of one site of a lattice")                            \
    X(ITERATION, "iteration", "a change of the active set")                                        \
    X(PRESSED, "pressed", "one point in contact in it, or outside")                                \
    X(FINISH, "finish", "the end of a contact for one tool")                                       \
    X(FRICTION, "friction", "the springs of one tool's friction, in four regions")                 \
    X(RUB, "rub", "one point in contact in it")                                                    \
    X(SOUGHT, "sought", "one node in the search for the nearest")

#define PALP_WORK_NAME(name, word, what) PALP_WORK_##name,
typedef enum { PALP_WORK_LIST(PALP_WORK_NAME) PALP_WORKS } palp_work;
#undef PALP_WORK_NAME

/* Of one of each kind of work. */
typedef struct {
    float of[PALP_WORKS];
} palp_prices;

#endif
