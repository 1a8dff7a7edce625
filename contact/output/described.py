"""What the files of a run say, key by key: `contact.output.reference` makes a page of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Item(NamedTuple):
    """A key, column or field.

    Attributes
    ----------
    unit
        In words: "length", "stress", ...; empty for none.
    text
        What it is, with its sign.
    """

    unit: str
    text: str


SUMMARY: Mapping[str, Item] = {
    "title": Item("", "Title of the case."),
    "units": Item("", "Names of the units, those of `[case] units`."),
    "converged": Item("", "Whether all residuals are within the tolerance."),
    "reason": Item("", "Why the run ended, in words."),
    "method": Item("", "The method, as in `[solver]`."),
    "kinematics": Item("", "`plane_strain`, `axisymmetric` or `solid`."),
    "dofs": Item("", "Number of unknowns."),
    "cells": Item("", "Number of triangles or tetrahedra."),
    "ranks": Item("", "Number of MPI processes. The results do not depend on it."),
    "outer_iterations": Item("", "Outer iterations: rows of `history.csv`."),
    "inner_iterations": Item("", "Linear solves in each of them, a list."),
    "linear_solves": Item("", "Solves with the matrix of the whole body."),
    "linear_iterations": Item("", "Iterations of the linear solver in all of these; 1 each by LU."),
    "factorizations": Item("", "Factorisations of it, or set-ups of multigrid."),
    "contact_solves": Item("", "Dense solves at the contact nodes alone."),
    "kkt": Item(
        "",
        "What is left of the equations, each relative to its own size: `equilibrium` (forces; of "
        "piezoelectric bodies charges, where these are farther from balance), `contact` (no "
        "penetration, no tension, one of them zero), `friction` (stick or slip).",
    ),
    "rounding": Item(
        "",
        "Forces out of balance, or charges, that are no more than rounding, over all of them: "
        "`equilibrium` is without them. Of an evolution the most in a step. More than the "
        "tolerance in slender bodies alone, with a warning then.",
    ),
    "max_pressure": Item("stress", "Largest contact pressure, -σ_ν >= 0."),
    "contact_area": Item(
        "area", "Sum of the weights of the nodes that touch; in the plane a length."
    ),
    "contact_force": Item(
        "force",
        "What the body exerts on the foundation, a vector; in the plane a unit of depth. Between "
        "bodies what the one with `on` exerts on the other; of several contacts the sum, and "
        "`traction`, `weight` and `entry` of `contact.vtu` have the force of each.",
    ),
    "contact_moment": Item(
        "force · length",
        "Moment of these about the origin of coordinates, of points at rest: in the plane a list "
        "of one, about z and counter-clockwise, in space a vector.",
    ),
    "reactions": Item(
        "force",
        "What the support of each part exerts on the body, a vector a part. A node of two parts "
        "counts for the one that stands first in the case. With the loads and minus "
        "`contact_force` they add up to nothing; what passes between bodies is no part of that.",
    ),
    "reaction_moments": Item("force · length", "Moments of these, as `contact_moment`."),
    "max_displacement": Item("length", "Largest Euclidean norm of the displacement at a node."),
    "max_dev_strain": Item("", "Largest |dev ε| over the cells (at degree 2 their nodes)."),
    "max_strain": Item(
        "",
        "Largest Frobenius norm of ε in the middle of a cell; linear kinematics is for small ones.",
    ),
    "volume_ratio": Item("", "Least and largest volume of a cell over that at rest."),
    "max_von_mises": Item(
        "stress",
        "Largest von Mises stress over the same. At sharp corners it grows with each refinement.",
    ),
    "share_beyond_yield": Item(
        "",
        "Share of the volume in which |dev ε| is beyond the material's first yield, 0 to 1; "
        "`null` where no material has such a limit.",
    ),
    "contact_nodes": Item("", "Number of contact nodes that touch: sticking and sliding ones."),
    "stick_nodes": Item("", "Number of those that stick."),
    "slip_nodes": Item("", "Number of those that slide; without friction all that touch."),
    "contact_direction": Item("", "`[contact]` `direction`: whose normal ν is."),
    "rigid": Item(
        "",
        "The foundation that moves: its `displacement` and `rotation` (degrees), and the `force` "
        "and `moment` on it from outside, given or held. Of several, one entry a part.",
    ),
    "rigid_parts": Item("", "The same of each part that moves as a rigid body, by part."),
    "electrodes": Item(
        "", "`potential` and `charge` of each electrode whose potential was unknown, by part."
    ),
    "notes": Item("", "What has been looked at and found good, in words."),
    "warnings": Item("", "What there is to beware of, in words."),
    "phi_min": Item("potential", "Least potential at a node."),
    "phi_max": Item("potential", "Largest potential at a node."),
    "total_charge": Item("charge", "Sum of all charges: 0 up to the tolerance, by Gauss's law."),
    "charges": Item(
        "charge",
        "Free charges D·ν integrated, ν out of the body: `electrodes` and `given` part by part, "
        "`foundation` (through the contact part), `body` (in the volume), `magnitude` (of all "
        "nodal ones, without sign).",
    ),
    "conduction_ramp": Item(
        "length", "1/delta: how far in front of the closed gap the foundation conducts, if it does."
    ),
    "case": Item(
        "",
        "The case as it was solved, all defaults written out: a case file to run again. Empty "
        "where the problem was built or changed in Python.",
    ),
    "seconds": Item("s", "Time for `setup`, `solve` and `output`."),
    "versions": Item("", "Of Python, the libraries and the BLAS."),
    "files": Item("", "What belongs to this run in the folder: a later run replaces it."),
}

_NODE: dict[str, Item] = {
    "on": Item("", "Part of the node; where there are several contacts."),
    "x": Item("length", "Place of the node at rest."),
    "y": Item("length", "The same."),
    "z": Item("length", "The same; in space."),
    "weight": Item("area", "Area that the node stands for; sums with it are integrals over Γ₃."),
    "gap": Item("length", "Distance to the foundation at rest, along the contact direction ν."),
    "u_n": Item(
        "length",
        "Displacement along ν, out of the body; gap - u_n is what stays open. Where "
        "the foundation moves, relative to that; so are the tangential ones. At degree 2 in space "
        "mid-edges have (u - (u₁ + u₂)/5)/(3/5), u₁ and u₂ being at the ends of the edge, and so "
        "has the gap: that, not u, is what the pressure there acts against.",
    ),
    "u_t": Item("length", "Tangential displacement u_τ; in the plane."),
    "u_tx": Item("length", "Its components; in space."),
    "u_ty": Item("length", "The same."),
    "u_tz": Item("length", "The same."),
    "pressure": Item("stress", "Contact pressure -σ_ν, of the foundation and its layer."),
    "tau": Item("stress", "Friction stress -σ_τ that the body exerts on the foundation; plane."),
    "tau_x": Item("stress", "Its components; in space."),
    "tau_y": Item("stress", "The same."),
    "tau_z": Item("stress", "The same."),
    "bound": Item("stress", "Friction bound: `tau` is no larger."),
    "status": Item("", "`open`, `stick` or `slip`."),
    "phi": Item("potential", "Potential; of piezoelectric bodies."),
    "d_n": Item(
        "charge/area",
        "Charge D·ν that leaves through the foundation; likewise. Nodes that supports hold "
        "conduct too, and have no row: `charges` of the summary has all.",
    ),
}

_HISTORY: dict[str, Item] = {
    "iteration": Item("", "Number of the outer iteration; 0 is a frictionless start."),
    "inner": Item("", "Linear solves that it took."),
    "equilibrium": Item("", "Residual after it, as in `kkt`."),
    "contact": Item("", "The same."),
    "friction": Item("", "The same."),
    "change": Item("", "Relative change of the friction bound, (3.46); `nan` where there is none."),
    "seconds": Item("s", "Since the start of the solve."),
    "note": Item("", "What was special about it, for instance `tangent`."),
    "contact_solves": Item("", "Dense solves at the contact nodes that it took."),
}

_STEPS: dict[str, Item] = {
    "t": Item("time", "End of the step."),
    "contact_force_x": Item("force", "As in `summary.json`; `_y`, in space `_z`."),
    "max_pressure": Item("stress", "As in `summary.json`."),
    "contact_nodes": Item("", "The same; `stick_nodes`, `slip_nodes`."),
    "max_displacement": Item("length", "The same."),
    "work": Item("work", "That loads and supports do in the step."),
    "energy": Item("work", "Stored in body and layer at its end."),
    "dissipation": Item("work", "By friction in the step; over a cycle the area of the loop."),
    "linear_solves": Item("", "In this step; `factorizations` likewise."),
    "kkt": Item("", "The largest residual."),
    "rigid_x": Item("length", "Displacement of a foundation that moves; `rigid_rotation`..."),
    "rigid_force_x": Item("force", "Force on it; `rigid_moment`... Several end with their part."),
    "driven_x": Item("length", "Mean displacement of the part that is moved or loaded in time."),
    "driven_force_x": Item("force", "What drives it: with `driven_x` it makes the loop."),
    "potential_PART": Item("potential", "Of electrodes."),
    "charge_PART": Item("charge", "Likewise; `charge_foundation` through the contact part."),
}

_AGAINST: dict[str, Item] = {
    "on": Item("", "Part of the node: one that is `against` in a contact."),
    "x": _NODE["x"],
    "y": _NODE["y"],
    "z": _NODE["z"],
    "weight": _NODE["weight"],
    "pressure": Item("stress", "Forces of the contact on the node, over its area: the pressure."),
    "traction_x": Item("stress", "Of all of the force: what the body with `on` exerts here."),
    "traction_y": Item("stress", "The same."),
    "traction_z": Item("stress", "The same; in space."),
    "u_x": Item("length", "Displacement of the node."),
    "u_y": Item("length", "The same."),
    "u_z": Item("length", "The same; in space."),
}

_SWEEP: dict[str, Item] = {
    "KEY": Item("", "What was swept, a column a key: the value of this row."),
    "converged": Item("", "As in `summary.json`; rows that are not are computed again."),
    "contact_force_x": Item("force", "As in `summary.json`; `_y`, in space `_z`."),
    "max_pressure": Item("stress", "The same; `contact_nodes`, `stick_nodes`, `slip_nodes`."),
    "max_displacement": Item("length", "The same."),
    "contact_area": Item("area", "The same; in the plane a length."),
    "rigid_x": Item("length", "As in `steps.csv`, and so are the others there of what moves."),
    "charge_PART": Item("charge", "The same; `potential_PART`."),
    "outer_iterations": Item("", "As in `summary.json`; `linear_solves`, `factorizations`."),
    "kkt": Item("", "The largest residual."),
    "seconds": Item("s", "For this row."),
}

#: Tables by the name of their file.
TABLES: Mapping[str, Mapping[str, Item]] = {
    "contact.csv": _NODE,
    "contact-against.csv": _AGAINST,
    "history.csv": _HISTORY,
    "steps.csv": _STEPS,
    "sweep.csv": _SWEEP,
}

#: Fields of fields.vtu; the derived ones have a companion NAME_cell, cell by cell.
BODY: Mapping[str, Item] = {
    "displacement": Item("length", "Displacement."),
    "potential": Item("potential", "Potential; of piezoelectric bodies."),
    "stress": Item("stress", "σ, nine components, row by row; tension is positive."),
    "von_mises": Item("stress", "Von Mises stress."),
    "dev_strain": Item("", "|dev ε|, the norm of the strain deviator."),
    "electric_displacement": Item("charge/area", "D; of piezoelectric bodies."),
    "electric_field": Item("potential/length", "E = -grad φ; likewise."),
}

#: Fields of contact.vtu.
SURFACE: Mapping[str, Item] = {
    "displacement": Item("length", "Displacement."),
    "pressure": Item("stress", "As in `contact.csv`."),
    "traction": Item("stress", "What the body exerts on the foundation, a vector: p ν - σ_τ."),
    "gap": Item("length", "As in `contact.csv`: at rest."),
    "opening": Item("length", "gap - u_n: what is open now."),
    "slip": Item("length", "Tangential displacement, a vector."),
    "friction_bound": Item("stress", "`bound` of `contact.csv`."),
    "normal": Item("", "Contact direction ν, out of the body."),
    "weight": Item("area", "As in `contact.csv`."),
    "potential": Item("potential", "Potential; of piezoelectric bodies."),
    "charge": Item("charge/area", "`d_n` of `contact.csv`; likewise."),
    "status": Item("", "0 open, 1 stick, 2 slip; -1 for a node that is held."),
    "row": Item("", "Row of the node in `contact.csv`, from 0; -1 for none."),
    "entry": Item("", "Number of its `[[contact]]`, from 0."),
    "rigid": Item("", "1 in front of a rigid foundation, 0 in front of another body."),
}

#: Fields of contact-against.vtu.
OPPOSITE: Mapping[str, Item] = {
    "displacement": SURFACE["displacement"],
    "pressure": Item("stress", "As in `contact-against.csv`."),
    "traction": Item("stress", "The same, a vector."),
    "normal": Item("", "Out of the body."),
    "weight": Item("area", "As in `contact-against.csv`."),
    "entry": SURFACE["entry"],
}
