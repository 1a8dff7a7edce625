"""What a solve gives back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from contact.errors import InputError
from contact.interface.jump import Multipliers
from contact.linear.operator import Counters
from contact.methods.report import History, Outcome
from contact.output.balances import ChargeBalance, charge_balance
from contact.output.contact_result import ContactResult, contact_result
from contact.output.deformation import Deformation
from contact.output.fields import DerivedFields, unknowns
from contact.output.motions import movements
from contact.output.options import OutputOptions
from contact.output.record import StepRecord
from contact.output.supports import Support, moment, supports
from contact.output.units import Units
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array

if TYPE_CHECKING:
    from contact.output.figures.figures import Gallery


#: A text on a solution, empty for none, and whether it is a note rather than a warning.
Remark: TypeAlias = tuple[str, bool]


@dataclass(repr=False)
class Solution:
    """A solved problem, or what was reached.

    Nodal quantities are those of the contact nodes that this rank owns, in the order of
    `problem.nodes`.

    Attributes
    ----------
    problem
        The problem.
    state
        Where it is: a value, which nothing that is done with the problem changes.
    outcome
        Whether it has converged, why it ended, and the residuals.
    history
        The outer iterations.
    counters
        Factorisations and linear solves.
    method
        Name of the method.
    seconds
        Spent on setup, solve and output.
    notes, warnings
        What there is to say about the solution.
    max_dev_strain, max_von_mises
        The largest |dev eps| and von Mises stress over the cells (their nodes, for degree 2).
    share_beyond_yield
        Share of the body's volume in which |dev eps| is beyond the material's first yield; None
        where no material has such a limit.
    deformation
        How large strains and changes of volume are; None before the solution is reviewed.
    start
        From where the iteration started, in words.
    title, case
        Of the case; and the case itself as `contact check` prints it, empty where there is none.
    output
        What is written besides the summary and the tables.
    units
        Names of the units of the case, for labels.
    steps
        What is kept of each step of an evolution, the last of which this is.
    """

    problem: ContactProblem
    state: State
    outcome: Outcome
    history: History
    counters: Counters
    method: str
    seconds: dict[str, float]
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    max_dev_strain: float = np.nan
    max_von_mises: float = np.nan
    share_beyond_yield: float | None = None
    deformation: Deformation | None = None
    start: str = "zero slip"
    title: str = ""
    case: str = ""
    output: OutputOptions = field(default_factory=OutputOptions)
    units: Units = field(default_factory=Units)
    steps: list[StepRecord] = field(default_factory=list)

    def __repr__(self) -> str:
        """Return what a look at it should show; `summary.json` has all."""
        name = f" {self.title!r}" if self.title else ""
        state = "converged" if self.converged else "not converged"
        return (
            f"<Solution{name}: {state}, {self.outcome.reason}; method {self.method}, "
            f"von Mises stress up to {self.max_von_mises:.4g}; {len(self.warnings)} warning(s)>"
        )

    @property
    def begun(self) -> bool:
        """Whether there is more than the start: an iteration, or a step of an earlier run."""
        return bool(self.history.records or self.steps)

    @property
    def converged(self) -> bool:
        """Whether all residuals are below the tolerance."""
        return self.outcome.converged

    @property
    def rounding(self) -> float:
        """Forces out of balance that count as rounding; of an evolution the most in a step."""
        return max([self.outcome.kkt.rounding, *(step.rounding for step in self.steps[-1:])])

    @cached_property
    def contact(self) -> ContactResult:
        """The contact nodes of all ranks as arrays, and as functions. Collective."""
        return contact_result(self)

    @cached_property
    def _derived(self) -> dict[str, fem.Function]:
        return DerivedFields(self.problem.equilibrium, self.state).cells()

    @property
    def stress(self) -> fem.Function:
        """The stress, 3 x 3, cell by cell: of a degree less than the displacement. Collective."""
        return self._derived["stress"]

    @property
    def von_mises(self) -> fem.Function:
        """The von Mises stress, likewise. Collective."""
        return self._derived["von_mises"]

    def plot(self, *fields: str, width: float | None = None) -> Gallery | None:
        """Return the figures on rank 0, which a notebook shows; None elsewhere. Collective.

        Parameters
        ----------
        fields
            Fields to colour the body by, as ``contact plot --field`` takes them. By default
            contact part, von Mises stress and potential are drawn.
        width
            Of the figures (inches).
        """
        from contact.output.figures.figures import collect  # matplotlib takes a while to load

        drawing = collect(self, fields)
        return None if drawing is None else drawing.figures(width, contact=not fields)

    @cached_property
    def _unknowns(self) -> dict[str, fem.Function]:
        return unknowns(self.problem.equilibrium, self.state.x)

    @property
    def displacement(self) -> fem.Function:
        """The displacement. The first use is collective."""
        return self._unknowns["displacement"]

    @property
    def potential(self) -> fem.Function | None:
        """The electric potential; None for a body without. The first use is collective."""
        return self._unknowns.get("potential")

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
    def contact_force(self) -> Array:
        """The force that the body exerts on the foundation, shape (d,). Collective.

        Of a body of revolution it is that of the full turn, along the axis.
        """
        nodes = self.problem.nodes
        stress = self.problem.interface.stress(self.nodal, self.forces)
        total = np.asarray(nodes.comm.allreduce(nodes.weight @ stress, op=MPI.SUM))
        return self.problem.domain.resultant(total)

    @property
    def contact_moment(self) -> Array:
        """The moment of `contact_force` about the origin of coordinates. Collective.

        Shape (1,) in the plane, about z, and (3,) in space.
        """
        nodes = self.problem.nodes
        stress = self.problem.interface.stress(self.nodal, self.forces)
        revolved = self.problem.domain.revolved
        local = moment(nodes.points, nodes.weight[:, None] * stress, revolved)
        return np.asarray(nodes.comm.allreduce(local, op=MPI.SUM))

    @property
    def contact_area(self) -> float:
        """The area of what touches: the sum of the weights of its nodes. Collective."""
        return self.problem.nodes.sum(np.where(self.status == "open", 0.0, 1.0))

    @property
    def max_displacement(self) -> float:
        """The largest Euclidean norm of the displacement over the nodes. Collective."""
        body, comm = self.problem.equilibrium, self.problem.comm
        u = self.state.x[: body.owned].reshape(-1, body.block_size)[:, : self.problem.dim]
        return float(comm.allreduce(np.linalg.norm(u, axis=1).max(initial=0.0), op=MPI.MAX))

    @cached_property
    def supports(self) -> Mapping[str, Support]:
        """What each part with prescribed displacements exerts on the body. Collective."""
        return supports(self.problem, self.state)

    def reaction(self, part: str) -> Array:
        """Return the force that a support exerts on the body, shape (d,). Collective.

        Raises
        ------
        InputError
            If no displacement is prescribed on the part.
        """
        if part not in self.supports:
            raise InputError(
                f"reaction({part!r}): no displacement is prescribed there; accepted: "
                f"{', '.join(self.supports) or 'none, for nothing is held'}"
            )
        return self.supports[part].force

    @property
    def movements(self) -> Mapping[str, Any]:
        """What is rigid, and electrodes of unknown potential, as in summary.json. Collective.

        Its keys are `rigid`, `rigid_parts` and `electrodes`, as far as there are any.
        """
        return movements(self.problem, self.state)

    @property
    def charges(self) -> ChargeBalance | None:
        """The free charges; None for a body without a potential. Collective."""
        if not self.problem.piezoelectric:
            return None
        return charge_balance(self.problem, self.state)

    @property
    def status(self) -> Array:
        """What each contact node does: "open", "stick" or "slip", shape (n,). Collective.

        A node is in contact where p - c (gap - u_nu) > 0 for the multiplier p, or where the
        layer presses; c = E / size. There it slips if |lambda_f + c u_tau|
        exceeds the friction bound (always where that is 0), and sticks else. What is below
        1e-9 of the largest pressure counts as rounding.
        """
        interface, nodal = self.problem.interface, self.nodal
        rounding = 1e-9 * interface.jump.maximum(self.pressure)
        active = interface.active_set(nodal, self.forces, self.friction_bound, rounding=rounding)
        layer = interface.law.layer_pressure(nodal) > rounding
        touches = active.closed | layer
        sticks = active.sticks & (self.friction_bound > 0)
        return np.where(touches, np.where(sticks, "stick", "slip"), "open")
