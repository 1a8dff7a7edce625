"""The registry of quantities: an entry each is name, unit, description, value and derivatives.

``summary.json``, the csv tables, the fields, ``docs/output.md``, the command line's help,
`sensitivity` and `identify` take them from here. An entry with a `functional` needs no value:

    Quantity(
        "sink", "length · volume", "Integral of u_y over the body.",
        files=(SUMMARY, STEPS, SWEEP), functional=f.Integral(lambda u, phi: u[1]),
    )
"""

from __future__ import annotations

from typing import Any

import numpy as np

from contact._compat import versions
from contact.problem.problem import ContactProblem
from contact.problem.residuals import stored
from contact.results import functionals as f
from contact.results.functionals import Functional
from contact.results.quantity import (
    ADAPT,
    AGAINST,
    BODY,
    CONTACTS,
    ENDS,
    HISTORY,
    NODES,
    OPPOSITE,
    STATUS,
    STEPS,
    SUMMARY,
    SURFACE,
    SWEEP,
    VECTOR,
    Quantity,
)
from contact.results.resultants import part_columns, rigid_columns


def elsewhere(given: Any) -> None:
    """Return None, a placeholder: the writer fills this column."""


def of_law(given: Any) -> None:
    """Return None, a placeholder: laws may have an internal variable of this name."""


def _node_counts(record: Any) -> str:
    """Return the numbers of open, stick and slip nodes after an iteration; empty if unknown."""
    return "/".join(map(str, record.sizes or ()))


#: Of the contact nodes; fields of the contact part are NaN, or -1, at nodes that are constrained.
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
        "status", "", "0 open, 1 stick, 2 slip; -1 for a node that is constrained.",
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
    Quantity("entry", "", "Number of its contact, from 0.", files=(AGAINST, OPPOSITE)),
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
        "plastic_strain", "", "Of `j2`, nine components; `back_stress_1`, ... (stress) likewise.",
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


def quantities(file: str) -> list[Quantity]:
    """Return the quantities of a file, in their order there."""
    return [quantity for quantity in QUANTITIES if file in quantity.files]


def values_of(file: str, given: Any, only: str = "") -> dict[str, Any]:
    """Return the keys, columns or fields of a file for some object, or those of one name alone."""
    found: dict[str, Any] = {}
    for quantity in quantities(file):
        if only in ("", quantity.name):
            found |= quantity.in_file(file, given)
    return found


def named_functionals(problem: ContactProblem) -> dict[str, Functional]:
    """Return the quantities of a problem as functions of a state, by their columns. Collective."""
    found: dict[str, Functional] = {}
    for quantity in QUANTITIES:
        if quantity.functional is not None:
            found[quantity.name] = quantity.functional
        if quantity.functionals is None:
            continue
        if CONTACTS not in quantity.files:
            found |= quantity.functionals(problem)
        elif problem.by_contact:
            for number, contact in enumerate(problem.contacts):
                own = quantity.functionals(problem, number)
                found |= {f"{column}_{contact.label}": one for column, one in own.items()}
    return found


def _contact_columns(given: Any) -> dict[str, Any]:
    """Return the results of contacts by columns with their names at the end (`by_contact`)."""
    if not given.problem.by_contact:
        return {}
    return {
        f"{column}_{name}": value
        for name, share in given.contacts.items()
        for column, value in values_of(CONTACTS, share).items()
    }


def contact_key(quantity: Quantity) -> str:
    """Return the key of a quantity of a contact in `contacts` of the summary."""
    return quantity.name.removeprefix("contact_")


def _contact_column(quantity: Quantity) -> str:
    """Return the first column of a quantity of a contact of the name NAME."""
    return f"{quantity.component.format(name=quantity.name, axis='x') or quantity.name}_NAME"


def _reaction_columns(given: Any) -> dict[str, float]:
    """Return the reactions of supports by columns, ``reaction_x_left``."""
    return {
        f"reaction_{axis}_{part}": float(value)
        for part, support in given.supports.items()
        for axis, value in zip("xyz", support.force, strict=False)
    }


def _charge_columns(given: Any) -> dict[str, float] | None:
    """Return the charges of electrodes and foundation by columns; None without a potential."""
    if given.charges is None:
        return None
    columns = {f"charge_{part}": charge for part, charge in given.charges.electrodes.items()}
    return columns | {"charge_foundation": given.charges.foundation}


def _error(given: Any) -> float:
    """Return the estimated error; no number where the equations are not solved."""
    return float("nan") if given.error is None else float(given.error.relative)


_ALL = (SUMMARY, STEPS, SWEEP)
_MESHES = (*_ALL, ADAPT)
_TABLES = (STEPS, SWEEP, ADAPT)

#: Of each contact, which `contact_nodes.ContactShare` has in hand; `contact_` is left out of their
#: keys in `contacts` of the summary.
_OF_CONTACT = (
    Quantity(
        "contact_force", "force", "of the body on its foundation, or on the other body",
        lambda c: c.force, (CONTACTS,), VECTOR, functionals=f.contact_forces,
    ),
    Quantity(
        "contact_moment", "force · length", "its moment about the origin", lambda c: c.moment,
        (CONTACTS,), VECTOR, functionals=f.contact_moments,
    ),
    Quantity("contact_area", "area", "as `contact_area`", lambda c: c.area, (CONTACTS,)),
    Quantity(
        "max_pressure", "stress", "the largest", files=(CONTACTS,), functionals=f.max_pressures
    ),
    Quantity(
        "mean_pressure", "stress", "the mean over that area", files=(CONTACTS,),
        functionals=f.mean_pressures,
    ),
    Quantity("stick", "", "share of that area", files=(CONTACTS,)),
    Quantity("slip", "", "likewise", files=(CONTACTS,)),
    Quantity(
        "dissipation", "work", "by friction, in all steps", files=(CONTACTS,),
        functionals=f.dissipations,
    ),
)  # fmt: skip

_RUN = (
    Quantity("KEY", "", "A swept key, a column each: its value in this row.", elsewhere, (SWEEP,)),
    Quantity("title", "", "Title of the case."),
    Quantity("units", "", "Names of the units, those of `[case] units`.", lambda r: r.units.given),
    Quantity("t", "time", "End of the step.", lambda r: r.state.time, (STEPS,)),
    Quantity(
        "converged", "", "Whether all residuals are within the tolerance or their rounding floors.",
        files=(SUMMARY, SWEEP),
    ),
    Quantity("reason", "", "Why the run ended, in words.", lambda r: r.outcome.reason),
    Quantity("method", "", "The method, as in `[solver]`."),
    Quantity(
        "kinematics", "", "`plane_strain`, `plane_stress`, `axisymmetric` or `solid`.",
        lambda r: r.problem.kinematics,
    ),
    Quantity("dofs", "", "Number of unknowns.", lambda r: r.problem.body.layout.unknowns),
    Quantity(
        "cells", "", "Number of cells of the mesh.",
        lambda r: r.problem.domain.mesh.topology.index_map(r.problem.dim).size_global,
    ),
    Quantity(
        "ranks", "", "Number of MPI processes. The results do not depend on it.",
        lambda r: r.problem.comm.size,
    ),
    Quantity(
        "unknowns", "", "Number of unknowns of a mesh of `[mesh.adapt]`, a row each.",
        lambda r: r.problem.body.layout.unknowns, (ADAPT,),
    ),
    Quantity("error", "", "`energy` of `error`.", _error, (ADAPT,)),
    Quantity(
        "contact_force", "force", "Force that the body exerts on the foundation, a vector; in 2-D "
        "per unit of depth. Between bodies the one that the body with `on` exerts on the other. "
        "With several contacts their sum; `contacts` has the force of each.",
        files=_MESHES, component=VECTOR, functionals=f.contact_forces,
    ),
    Quantity(
        "contact_moment", "force · length", "Moment of the contact forces about the origin of "
        "coordinates, at points of the reference configuration: in 2-D a list of one number, about "
        "z and counter-clockwise, in 3-D a vector.",
        files=_ALL, component=VECTOR, functionals=f.contact_moments,
    ),
    Quantity(
        "contacts", "", "Results of each contact, by its `name`: "
        + ", ".join(f"`{contact_key(q)}` ({q.text})" for q in _OF_CONTACT) + ".",
        lambda r: {
            name: {contact_key(q): q.of(share) for q in quantities(CONTACTS)}
            for name, share in r.contacts.items()
        },
    ),
    Quantity(
        "contact_force_AXIS_NAME", "",
        "The same of each of several contacts, or of one with a `name`, in a step: "
        + ", ".join(f"`{_contact_column(q)}`" for q in _OF_CONTACT)
        + ", and other components; in 2-D `contact_moment_NAME`.",
        _contact_columns, (STEPS, SWEEP),
    ),
    Quantity("regions", "", "Names of the regions.", lambda r: sorted(r.problem.domain.regions)),
    Quantity(
        "reactions", "force", "Force of the support of each part on the body, a vector per part. "
        "A node of two parts counts for the first of them in the case. Their sum plus the loads, "
        "and the forces of `rigid_parts`, minus `contact_force` is zero, if forces between bodies "
        "are left out of the latter.",
        lambda r: {part: support.force for part, support in r.supports.items()}, component=VECTOR,
    ),
    Quantity(
        "reaction_AXIS_PART", "force", "Force of each support: `reaction_x_left`, ...",
        _reaction_columns, (STEPS,), functionals=f.reactions,
    ),
    Quantity(
        "reaction_moments", "force · length", "Moments of the reactions, as `contact_moment`.",
        lambda r: {part: support.moment for part, support in r.supports.items()}, component=VECTOR,
    ),
    Quantity(
        "region", "", "Place of the cell's region among `regions` of the summary, from 0; of "
        "several regions that of the fewest cells. In `fields.vtu` alone, cell by cell.",
        elsewhere, (BODY,),
    ),
    Quantity(
        "error", "",
        "Estimated discretisation error. `energy`: relative, in the energy norm; the elastic "
        "energy is off by about its square. `effectivity`: `null`, for it is the estimate over the "
        "error, which a run does not know. `intervals`: bounds of forces, of the largest "
        "displacement and of the largest pressure, by the last three meshes of `[mesh.adapt]` with "
        "`fraction = 1`; `null` for one that does not converge, such as a pressure at a corner. "
        "All are `null` where the equations are not solved.",
        lambda r: {
            "energy": _error(r), "effectivity": None, "intervals": r.intervals,
        }, component=VECTOR, entries=ENDS,
    ),
    Quantity(
        "max_pressure", "stress", "Largest contact pressure, -σ_ν >= 0.",
        files=_MESHES, functional=f.MaxPressure(),
    ),
    Quantity(
        "contact_nodes", "", "Number of contact nodes that touch: sticking and sliding ones.",
        lambda r: r.counts["stick"] + r.counts["slip"], _ALL,
    ),
    Quantity("stick_nodes", "", "Number of nodes that stick.", lambda r: r.counts["stick"], _ALL),
    Quantity(
        "slip_nodes", "", "Number of nodes that slide; without friction all that touch.",
        lambda r: r.counts["slip"], _ALL,
    ),
    Quantity(
        "max_displacement", "length", "Largest Euclidean norm of the displacement at a node.",
        files=_MESHES, functional=f.MaxDisplacement(),
    ),
    Quantity(
        "contact_area", "area",
        "Sum of the tributary areas of the nodes that touch; in 2-D a length.",
        files=(SUMMARY, SWEEP),
    ),
    Quantity("max_dev_strain", "", "Largest |dev ε| over the cells (at degree 2 their nodes)."),
    Quantity(
        "max_strain", "",
        "Largest Frobenius norm of ε in the middle of a cell; linear kinematics is for small ones.",
        lambda r: r.deformation and r.deformation[0],
    ),
    Quantity(
        "volume_ratio", "", "Least and largest deformed volume of a cell over its own.",
        lambda r: r.deformation and [*r.deformation[1:]], component=VECTOR, entries=ENDS,
    ),
    Quantity(
        "max_von_mises", "stress",
        "Largest von Mises stress over the cells (at degree 2 their nodes). At sharp corners it "
        "grows with each refinement.",
        files=(SUMMARY, SWEEP),
    ),
    Quantity(
        "plastic_share", "", "Share of the volume in the plastic range, 0 to 1: where |dev ε| is "
        "above the yield strain, with `j2` where there is plastic strain. `null` where no material "
        "yields.",
        lambda r: np.nan if r.plastic_share is None else r.plastic_share,
    ),
    Quantity("plastic_volume", "volume", "Volume with plastic strain, of bodies with `j2`."),
    Quantity(
        "equivalent_plastic_strain", "", "Largest equivalent plastic strain, of bodies with `j2`."
    ),
    Quantity(
        "contact_direction", "", "`[contact]` `direction`: whose normal ν is.",
        lambda r: ", ".join(dict.fromkeys(c.foundation.direction for c in r.problem.contacts)),
    ),
    Quantity(
        "work", "work",
        "Of loads, supports, electrodes, layer and charge in the step; that of pressures on an "
        "interference is not counted.",
        lambda r: r.energies.work, (STEPS,),
    ),
    Quantity(
        "energy", "work", "Stored in the body at the end of the step.",
        lambda r: r.energies.energy, (STEPS,), functional=stored,
    ),
    Quantity(
        "dissipation", "work", "By friction in the step; over a cycle the area of the loop.",
        lambda r: r.energies.dissipation, (STEPS,), functionals=f.dissipations,
    ),
    Quantity("dissipation", "work", "By friction in all steps.", files=(SWEEP,)),
    Quantity(
        "plastic_dissipation", "work",
        "In the materials in the step, by plastic flow, or as a law of your own says, for instance "
        "by damage; in the summary in all steps.",
        files=(SUMMARY, STEPS), functionals=f.plastic_dissipations,
    ),
    Quantity(
        "outer_iterations", "", "Outer iterations: rows of `history.csv`.",
        lambda r: len(r.history), (SUMMARY, SWEEP),
    ),
    Quantity(
        "inner_iterations", "", "Linear solves in each of them, a list.",
        lambda r: [r.inner for r in r.history],
    ),
    Quantity(
        "linear_solves", "", "Solves with the matrix of the whole body.",
        lambda r: r.counters.linear_solves, _ALL,
    ),
    Quantity(
        "linear_iterations", "", "Iterations of the linear solver in all of these; 1 each by LU.",
        lambda r: r.counters.linear_iterations,
    ),
    Quantity(
        "factorizations", "", "Factorisations of this matrix, or set-ups of multigrid.",
        lambda r: r.counters.factorizations, _ALL,
    ),
    Quantity(
        "contact_solves", "", "Linear solves of the problem condensed onto the contact nodes.",
        lambda r: r.counters.contact_solves,
    ),
    Quantity(
        "kkt", "", "Residuals of the equations, each relative to its own size: `equilibrium` "
        "(forces; of piezoelectric bodies charges, where these are farther from balance), "
        "`contact` (no penetration, no tension, one of them zero), `friction` (stick or slip).",
        lambda r: {key: getattr(r.outcome.residuals, key) for key in r.floors},
    ),
    Quantity("kkt", "", "The largest residual.", lambda r: r.outcome.residuals.largest, _TABLES),
    Quantity(
        "rounding", "", "Rounding floors of the residuals in `kkt`, up to which they are accepted; "
        "of `equilibrium` in an evolution the largest of all steps. Larger than the tolerance in "
        "slender bodies alone, with a warning.", lambda r: r.floors,
    ),
    Quantity(
        "rigid", "", "The foundation that moves: its `displacement` and `rotation` (degrees), and "
        "the `force` and `moment` on it from outside, given or reactions. With several such "
        "foundations one entry per part.",
        lambda r: r.movements.get("rigid"), component=VECTOR,
    ),
    Quantity(
        "rigid_parts", "", "As `rigid`, of each part that moves as a rigid body.",
        lambda r: r.movements.get("rigid_parts"), component=VECTOR,
    ),
    Quantity(
        "electrodes", "",
        "`potential` and `charge` of each electrode whose potential was unknown, by part.",
        lambda r: r.movements.get("electrodes"),
    ),
    Quantity(
        "bolts", "", "`shortening` and section `force` of each `[[bolt]]`, by part.",
        lambda r: r.movements.get("bolts"),
    ),
    Quantity(
        "rigid_AXIS", "length",
        "Displacement of a moving foundation, or of a rigid part, `rigid_x`...; `rigid_rotation` "
        "in degrees. Names end with the part, `rigid_x_top`, of several foundations, and of rigid "
        "parts unless there is one part alone.",
        lambda r: rigid_columns(r.movements, "displacement", "rotation"),
        _TABLES, functionals=f.rigid_motions,
    ),
    Quantity(
        "rigid_force_AXIS", "force",
        "Force on it, and `rigid_moment`..., with names like the displacement.",
        lambda r: rigid_columns(r.movements, "force", "moment"),
        _TABLES, functionals=f.rigid_forces,
    ),
    Quantity(
        "potential_PART", "potential", "Potential of an electrode.",
        lambda r: part_columns(r.movements, "electrodes", "", "potential"),
        _TABLES, functionals=f.potentials,
    ),
    Quantity(
        "bolt_KEY_PART", "length, force",
        "Of a bolt: `bolt_shortening_shank`, `bolt_force_shank`.",
        lambda r: part_columns(r.movements, "bolts", "bolt_", "shortening", "force"),
        _TABLES, functionals=f.bolt_shortenings,
    ),
    Quantity(
        "charge_PART", "charge", "Of an electrode; `charge_foundation` through the contact part.",
        _charge_columns, _TABLES, functionals=f.charges,
    ),
    Quantity(
        "driven", "length", "Mean displacement of the part that is moved or loaded in time.",
        lambda r: r.driven and r.driven[0], (STEPS,), VECTOR, functionals=f.driven_displacements,
    ),
    Quantity(
        "driven_force", "force",
        "Force of its own supports and loads on it: with `driven_x` it makes the loop.",
        lambda r: r.driven and r.driven[1], (STEPS,), VECTOR, functionals=f.driving_forces,
    ),
    Quantity("notes", "", "Assumptions that are met, or have not been checked, in words."),
    Quantity("warnings", "", "Reasons for care, in words."),
    Quantity(
        "phi_min", "potential", "Least potential at a node.",
        lambda r: r.potential_range and r.potential_range[0],
    ),
    Quantity(
        "phi_max", "potential", "Largest potential at a node.",
        lambda r: r.potential_range and r.potential_range[1],
    ),
    Quantity(
        "total_charge", "charge", "D·ν over the surface less the volume charge: 0 by Gauss's law.",
        lambda r: r.charges and r.charges.total,
    ),
    Quantity(
        "charges", "charge", "Charges D·ν integrated, ν out of the body: `electrodes` and "
        "`given` part by part, `foundation` (through the contact part), `body` (in the volume), "
        "`magnitude` (of all nodal ones, without sign).", lambda r: r.charges and vars(r.charges),
    ),
    Quantity(
        "conduction_ramp", "length",
        "1/delta: how far in front of the closed gap the foundation conducts, if it does.",
        lambda r: (r.conduction_ramp or np.nan) if r.problem.piezoelectric else None,
    ),
    Quantity(
        "case", "", "The case as it was solved, all defaults written out: a case file to run "
        "again. Empty where the problem was built or changed in Python.",
    ),
    Quantity("seconds", "s", "For `setup`, `solve` and `output`."),
    Quantity("versions", "", "Of Python, the libraries and the BLAS.", lambda r: versions()),
    Quantity("files", "", "Files of this run: a later run replaces them.", elsewhere),
    Quantity("seconds", "s", "Time for this row.", elsewhere, (SWEEP,)),
    Quantity("input", "", "Digests of the case's files.", elsewhere, (SWEEP,)),
)  # fmt: skip

QUANTITIES = (*_RUN, *_OF_CONTACT, *AT_NODES, *OF_ITERATIONS, *AT_OPPOSITE_NODES, *FIELDS)
