# SPDX-License-Identifier: MIT
"""The operations whose bounds core states by a formula, and the functions that they are.

An operation is a sum of functions, each so often; `never` are functions that are not called in it, because the body, the tool or
the configuration is of another kind; `apart` those that have a formula of their own. Counts that a formula does not name are given
in `counts`."""

SHAPES = {"balls": "gap_of_balls exit_of_balls balls_at",
          "cylinder": "gap_of_cylinder exit_of_cylinder cylinder_at capsule_at palp_tool_core",
          "pad": "gap_of_pad pad_at largest_height",
          "field": "along_field gap_of_field field_at field_may_meet palp_tool_field_at palp_tool_field_extreme palp_tool_tip"}
ZONES_ALONE = ("palp_contact_bond palp_contact_bond_row palp_contact_bond_corners palp_contact_load_seams palp_assembly_bent "
               "palp_surface_bent palp_facing_gap palp_facing_find palp_moving_tick palp_assembly_wrench meet_zones keep_up palp_contact_carried add_other_side displace_other_side meet").split()
FRICTION = "palp_friction_solve palp_friction_settle palp_friction_carry".split()
STEPS = "palp_contact_fill palp_contact_points palp_contact_assemble palp_contact_iterate palp_contact_finish".split()


def of_other_shapes(shape, flares):
    """What is not called with a tool of a shape; `flares`: in operations that ask how far it extends only where it flares."""
    return [f for s, names in SHAPES.items() if s != shape for f in names.split()] + (
        ["palp_tool_support"] if flares and shape != "cylinder" else [])


class Operation:
    def __init__(self, functions, never=(), apart=(), counts=None, in_all=(), times=None, of=None):
        self.functions = functions if isinstance(functions, dict) else {f: "1" for f in functions.split()}
        self.never, self.apart, self.counts = list(never), list(apart), counts or {}
        self.in_all, self.times = set(in_all), times  # terms without a count of in_all come `times` times
        self.of = set(of) if of else None                  # only terms with one of these


ELASTIC = {
    "fill": Operation("palp_contact_fill"),
    "filled": Operation("palp_contact_fill"),
    "points": Operation("palp_contact_points"),
    "assemble": Operation("palp_contact_assemble", in_all=("rows", "pairs"), times="batches"),
    "iterate": Operation("palp_contact_iterate"),
    "finish": Operation("palp_contact_finish"),
    "finish_rubbing": Operation({"palp_contact_finish": "1", "palp_friction_solve": "tools", "palp_friction_settle": "tools"}),
    "around": Operation("palp_answer_tick", apart=STEPS + FRICTION[:2], counts={"fillings": 0, "batches": 0, "rounds": 0, "zones": 0}),
    "glue": Operation("palp_answer_tick", apart=STEPS + FRICTION[:2]),
    "quantum": Operation("palp_answer_tick", apart=STEPS + FRICTION[:2], of=("fillings", "batches", "rounds")),
}
OPERATIONS = {name: (op, ZONES_ALONE) for name, op in ELASTIC.items()}
OPERATIONS.update({
    "servo": (Operation("palp_servo_tick", apart=["palp_answer_tick", "palp_dynamic_tick"]), ZONES_ALONE),
    "dynamic": (Operation("palp_dynamic_tick", apart=["palp_dyna_collapse", "palp_adapt_reset", "palp_dynamic_refine_all"], never=["rub"]), ()),
    "dynamic_rubbing": (Operation("palp_dynamic_tick", apart=["palp_dyna_collapse", "palp_adapt_reset", "palp_dynamic_refine_all"]), ()),
    "collapse": (Operation("palp_dyna_collapse"), ()),
    "reset": (Operation("palp_adapt_reset"), ()),
    "row": (Operation("palp_wavelet_row"), ()),
    "basis": (Operation("palp_basis_row"), ()),
    "extract": (Operation("palp_columns_extract"), ()),
    "extract_half": (Operation("palp_columns_extract"), ()),
    "add": (Operation("palp_columns_add", never=["decode"]), ()),
    "add_half": (Operation("palp_columns_add"), ()),
    "split_add": (Operation("palp_split_add", never=["decode"]), ()),
    "split_add_half": (Operation("palp_split_add"), ()),
    "split_modes": (Operation("palp_split_add_modes"), ()),
    "inverse": (Operation("palp_wavelet_inverse"), ()),
    "inverse_butterfly": (Operation("palp_wavelet_inverse"), ()),
})
