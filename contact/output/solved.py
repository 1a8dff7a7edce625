"""A solved problem as tables and figures see it: its state, and the quantities on Gamma_3."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.interface.jump import Multipliers
from contact.output.options import OutputOptions, Units
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array

#: Columns of ``steps.csv`` that a look at a step shows.
SHOWN = ("t", "max_pressure", "contact_nodes", "max_displacement", "kkt")


def tangent_of(normal: Array) -> Array:
    """Return the unit tangents t of contact directions nu in the plane, shape (n, 2).

    t is nu turned counter-clockwise by 90 degrees: on the bottom of a body, where
    nu = (0, -1), t points along x.
    """
    return np.column_stack([-normal[:, 1], normal[:, 0]])


@dataclass(frozen=True, repr=False)
class StepRecord:
    """The end of a step of an evolution, and its rows in the tables.

    Attributes
    ----------
    row
        The columns of ``steps.csv``.
    table
        The contact nodes, as `table.contact_table` returns them; None on ranks other than 0.
    enthalpy
        Where the energy balance of the next step begins, see `problem.energy.Moment`.
    rounding
        Largest `rounding` of the residuals of a step so far, see `problem.kkt.KKT`.
    """

    state: State
    row: Mapping[str, float]
    table: Mapping[str, NDArray[Any]] | None
    enthalpy: float
    rounding: float = 0.0

    def __repr__(self) -> str:
        """Return the main columns; `row` has all."""
        shown = {name: self.row[name] for name in SHOWN if name in self.row}
        return f"<StepRecord: {', '.join(f'{name} = {v:.4g}' for name, v in shown.items())}>"


@dataclass(repr=False)
class Solved:
    """A solved problem.

    Nodal quantities are those of the contact nodes that this rank owns, in the order of
    `problem.nodes`.

    Attributes
    ----------
    state
        A value, which nothing that is done with the problem changes.
    output
        The files that are written besides the summary and the tables.
    steps
        The steps of an evolution, the last of which this is.
    """

    problem: ContactProblem
    state: State
    title: str = field(default="", kw_only=True)
    units: Units = field(default_factory=Units, kw_only=True)
    output: OutputOptions = field(default_factory=OutputOptions, kw_only=True)
    steps: list[StepRecord] = field(default_factory=list, kw_only=True)

    @property
    def nodal(self) -> Array:
        """Displacement (and scaled potential) at the contact nodes, shape (n, block size)."""
        return self.problem.nodal(self.state)

    @property
    def forces(self) -> Multipliers:
        """Multipliers of the unilateral constraint and of friction."""
        return self.state.forces

    @property
    def pressure(self) -> Array:
        """Contact pressure -sigma_nu, shape (n,): multiplier and layer."""
        return self.problem.interface.pressure(self.nodal, self.forces)

    @property
    def friction(self) -> Array:
        """Friction stress -sigma_tau = lambda_f, shape (n, d)."""
        return self.forces.friction

    @property
    def friction_bound(self) -> Array:
        """Friction bound s, shape (n,). Collective."""
        return self.problem.interface.bound(self.nodal, self.forces)

    @property
    def normal_displacement(self) -> Array:
        """u_nu along the contact direction, shape (n,)."""
        return self.problem.nodes.normal_component(self.nodal)

    @property
    def slip(self) -> Array:
        """Tangential displacement u_tau, shape (n, d)."""
        return self.problem.nodes.tangential_component(self.nodal)

    @property
    def status(self) -> Array:
        """The active set by names: "open", "stick" or "slip", shape (n,). Collective.

        A node is in contact where p - c (gap - u_nu) > 0 for the multiplier p, or where the
        layer presses; c = E / size. There it slips if |lambda_f + c u_tau|
        exceeds the friction bound (always where that is 0), and sticks else. Pressures
        below 1e-9 of the largest count as rounding.
        """
        interface, nodal = self.problem.interface, self.nodal
        rounding = 1e-9 * interface.jump.maximum(self.pressure)
        active = interface.active_set(nodal, self.forces, self.friction_bound, rounding=rounding)
        layer = interface.law.layer_pressure(nodal) > rounding
        touches = active.closed | layer
        sticks = active.sticks & (self.friction_bound > 0)
        return np.where(touches, np.where(sticks, "stick", "slip"), "open")

    @property
    def entry(self) -> NDArray[np.intp]:
        """Number of the contact of each node."""
        sizes = [entry.nodes.nodes.size for entry in self.problem.entries]
        return np.repeat(np.arange(len(sizes)), sizes)

    @property
    def part(self) -> NDArray[Any] | None:
        """Part of each node; None for a single contact."""
        names = np.array([entry.on for entry in self.problem.entries])
        return names[self.entry] if names.size > 1 else None

    @property
    def points(self) -> Array:
        """Reference places: mesh generators leave coordinates such as -3e-19."""
        points = self.problem.nodes.points
        return np.where(np.abs(points) < 1e-15 * self.problem.domain.size, 0.0, points)

    def tangential(self, vectors: Array) -> Array:
        """Return the component along `tangent_of` the contact direction; in 3-D the vectors."""
        if self.problem.dim == 3:
            return vectors
        return np.asarray(np.einsum("ni,ni->n", vectors, tangent_of(self.problem.nodes.normal)))

    @property
    def contact_potential(self) -> Array | None:
        """Potential at the nodes of a piezoelectric body."""
        if not self.problem.piezoelectric:
            return None
        return np.asarray(self.problem.equilibrium.phi_scale * self.nodal[:, -1])

    @property
    def contact_charge(self) -> Array | None:
        """Charge D.nu that leaves a piezoelectric body through the foundation."""
        if not self.problem.piezoelectric:
            return None
        return self.problem.interface.law.charge(self.nodal, self.pressure)
