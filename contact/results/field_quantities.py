"""The quantities of nodes, cells and iterations, as in `quantities` an entry each."""

from typing import Any

import numpy as np

from contact.results.quantity import (
    AGAINST,
    BODY,
    HISTORY,
    NODES,
    OPPOSITE,
    STATUS,
    SURFACE,
    VECTOR,
    Quantity,
    elsewhere,
    of_law,
)


def _node_counts(record: Any) -> str:
    """Return the numbers of open, stick and slip nodes after an iteration; empty if unknown."""
    return "/".join(map(str, record.sizes or ()))


#: Of the contact nodes; fields of the contact part are NaN, or -1, at nodes that are held.
AT_NODES = (
    Quantity(
        "on", "", "Part of the node; where there are several contacts.", lambda n: n.part, (NODES,),
    ),
    Quantity("x", "length", "Reference place of the node.", lambda n: n.points, (NODES,), "{axis}"),
    Quantity(
        "weight", "area", "Tributary area of the node; sums with it are integrals over Γ₃.",
        files=(NODES, SURFACE),
    ),
    Quantity(
        "gap", "length", "Initial distance to the foundation, along the contact direction ν.",
        files=(NODES, SURFACE),
    ),
    Quantity(
        "u_n", "length", "Displacement along ν, out of the body; gap - u_n is the open gap. If "
        "the foundation moves, all displacements here are relative to it. At degree 2 on "
        "triangular facets it is (u - (u₁ + u₂)/5)/(3/5) at mid-edge nodes, with u₁ and u₂ at the "
        "ends of the edge, and gaps likewise: the pressure there acts on it, not on u.",
        lambda n: n.normal_displacement, (NODES,),
    ),
    Quantity(
        "u_t", "length", "Tangential displacement u_τ: its components in 3-D, `u_t` in 2-D.",
        lambda n: n.tangential(n.slip), (NODES,), "{name}{axis}",
    ),
    Quantity(
        "pressure", "stress", "Contact pressure -σ_ν, of the foundation and its layer.",
        files=(NODES, SURFACE),
    ),
    Quantity(
        "tau", "stress",
        "Friction stress -σ_τ of the body on the foundation: its components, `tau` in 2-D.",
        lambda n: n.tangential(n.friction), (NODES,), VECTOR,
    ),
    Quantity(
        "bound", "stress", "Friction bound: `tau` is no larger.",
        lambda n: n.friction_bound, (NODES,),
    ),
    Quantity("status", "", "`open`, `stick` or `slip`.", files=(NODES,)),
    Quantity(
        "phi", "potential", "Potential; of piezoelectric bodies.", lambda n: n.potential, (NODES,),
    ),
    Quantity(
        "d_n", "charge/area", "Charge D·ν that leaves through the foundation; of piezoelectric "
        "bodies. Nodes that supports hold conduct too, but have no row: `charges` of the summary "
        "includes them.",
        lambda n: n.charge, (NODES,),
    ),
    Quantity(
        "traction", "stress", "Stress of the body on the foundation, a vector: p ν - σ_τ.",
        files=(SURFACE,),
    ),
    Quantity("opening", "length", "gap - u_n: the open gap.", files=(SURFACE,)),
    Quantity("slip", "length", "Tangential displacement, a vector.", files=(SURFACE,)),
    Quantity("friction_bound", "stress", "As `bound`.", files=(SURFACE,)),
    Quantity("normal", "", "Contact direction ν, out of the body.", files=(SURFACE,)),
    Quantity("charge", "charge/area", "As `d_n`; of piezoelectric bodies.", files=(SURFACE,)),
    Quantity(
        "status", "", "0 open, 1 stick, 2 slip; -1 for a node that is held.",
        lambda n: np.array([STATUS[name] for name in n.status], np.int32), (SURFACE,),
    ),
    Quantity(
        "row", "", "Row of the node in `contact.csv`, from 0; -1 for none.",
        lambda n: np.arange(n.status.size, dtype=np.int32), (SURFACE,),
    ),
    Quantity("entry", "", "Number of its `[[contact]]`, from 0.", elsewhere, (SURFACE,)),
    Quantity(
        "rigid", "", "1 in front of a rigid foundation, 0 in front of another body.",
        elsewhere, (SURFACE,),
    ),
)  # fmt: skip

#: Of the nodes of the opposite side.
AT_OPPOSITE_NODES = (
    Quantity("on", "", "Part of the node: one that is `against` in a contact.", files=(AGAINST,)),
    Quantity("x", "length", "Reference place of the node.", None, (AGAINST,), "{axis}"),
    Quantity("weight", "area", "Tributary area of the node.", files=(AGAINST, OPPOSITE)),
    Quantity(
        "pressure", "stress", "Normal contact force on the node over its area.",
        files=(AGAINST, OPPOSITE),
    ),
    Quantity(
        "traction", "stress", "Whole contact force on the node over its area, a vector.",
        None, (AGAINST, OPPOSITE), VECTOR,
    ),
    Quantity(
        "u", "length", "Displacement of the node.",
        lambda f: f["displacement"], (AGAINST,), VECTOR,
    ),
    Quantity("displacement", "length", "Displacement.", files=(OPPOSITE,)),
    Quantity("normal", "", "Out of the body.", files=(OPPOSITE,)),
    Quantity("entry", "", "Number of its contact, from 0.", files=(OPPOSITE,)),
)  # fmt: skip

#: Fields of the body; the derived ones have a companion NAME_cell, cell by cell.
FIELDS = (
    Quantity("displacement", "length", "Displacement.", elsewhere, (BODY, SURFACE)),
    Quantity(
        "potential", "potential", "Potential; of piezoelectric bodies.",
        elsewhere, (BODY, SURFACE),
    ),
    Quantity(
        "stress", "stress", "σ, nine components, row by row; tension is positive.", files=(BODY,),
    ),
    Quantity(
        "principal_stress", "stress", "σ1 ≥ σ2 ≥ σ3, eigenvalues of `stress`: at nodes those of "
        "the averaged tensor.", files=(BODY,),
    ),
    Quantity(
        "von_mises", "stress", "Von Mises stress; at nodes the average of those of the cells, "
        "which is not less than that of the averaged tensor.", files=(BODY,),
    ),
    Quantity("strain", "", "ε, nine components as of the stress.", files=(BODY,)),
    Quantity("dev_strain", "", "|dev ε|, the norm of the strain deviator.", files=(BODY,)),
    Quantity(
        "plastic_strain", "", "Of `j2`, nine components; `back_stress_1`, ... likewise.",
        of_law, (BODY,),
    ),
    Quantity(
        "equivalent_plastic_strain", "", "Of `j2`; other internal variables have fields too.",
        of_law, (BODY,),
    ),
    Quantity("electric_displacement", "charge/area", "D; of piezoelectric bodies.", files=(BODY,)),
    Quantity("electric_field", "potential/length", "E = -grad φ; likewise.", files=(BODY,)),
    Quantity(
        "error", "",
        "Estimated discretisation error of the cell over the energy norm of the solution: the "
        "squares add up to that of `error` in the summary. In `fields.vtu` alone, cell by cell.",
        elsewhere, (BODY,),
    ),
)  # fmt: skip

#: Of the outer iterations.
OF_ITERATIONS = (
    Quantity(
        "iteration", "", "Number of the outer iteration; 0 is a frictionless start.",
        files=(HISTORY,),
    ),
    Quantity("inner", "", "Linear solves of the iteration.", files=(HISTORY,)),
    Quantity(
        "equilibrium", "", "Residual after the iteration, as in `kkt`.",
        lambda r: r.residuals.equilibrium, (HISTORY,),
    ),
    Quantity("contact", "", "Likewise.", lambda r: r.residuals.contact, (HISTORY,)),
    Quantity("friction", "", "Likewise.", lambda r: r.residuals.friction, (HISTORY,)),
    Quantity(
        "change", "", "Relative change of the friction bound; `nan` where there is none.",
        files=(HISTORY,),
    ),
    Quantity("seconds", "s", "Since the solve began.", files=(HISTORY,)),
    Quantity("note", "", "Kind of the iteration, for instance `tangent`.", files=(HISTORY,)),
    Quantity(
        "contact_solves", "", "Linear solves of the condensed problem in the iteration.",
        lambda r: r.contact_solves, (HISTORY,),
    ),
    Quantity(
        "active_set", "", "Numbers of open, stick and slip nodes at its end, for instance `3/5/1`; "
        "empty where the active set is not known.", _node_counts, (HISTORY,),
    ),
    Quantity(
        "steps", "", "The active sets after each Newton iteration on the condensed problem, "
        "separated by blanks; `-` where one is not known.",
        lambda r: " ".join(_node_counts(step) or "-" for step in r.steps), (HISTORY,),
    ),
)  # fmt: skip
