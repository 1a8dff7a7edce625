"""The solution of a case, and its results as a whole."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self, TypeAlias

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact.errors import InputError
from contact.interface.multipliers import Multipliers
from contact.linear.operator import Counters
from contact.methods.report import Outcome, Record
from contact.problem.problem import ContactProblem
from contact.problem.residuals import Balance, balance, dissipated
from contact.problem.state import State
from contact.results.contact_nodes import (
    ContactResult,
    ContactShare,
    contact_result,
    contact_shares,
)
from contact.results.error_estimate import Estimate, Intervals
from contact.results.fields import Deformation, DerivedFields, unknowns
from contact.results.functionals import MaxDisplacement, driven_displacements
from contact.results.options import OutputOptions, Units
from contact.results.quantities import values_of
from contact.results.quantity import STEPS
from contact.results.resultants import (
    ChargeBalance,
    DrivenPart,
    Movements,
    Resultant,
    charge_balance,
    contact_resultant,
    movements,
    supports,
)
from contact.typing import Array

#: Columns of ``steps.csv`` that a look at a step shows.
SHOWN = ("t", "max_pressure", "contact_nodes", "max_displacement", "kkt")

#: A text on a solution: a warning, or a `Note`.
Remark: TypeAlias = str


class Note(str):
    """Informational note, not a warning."""


@dataclass(frozen=True, repr=False)
class StepRecord:
    """The end of a step of an evolution, and its row in the table of steps."""

    state: State
    row: Mapping[str, float]  #: the columns of ``steps.csv``
    enthalpy: float  #: where the energy balance of the next step begins, see `Balance`
    equilibrium_rounding: float = 0.0  #: largest `equilibrium_rounding` of a step so far

    def __repr__(self) -> str:
        """Return the main columns; `row` has all."""
        shown = {name: self.row[name] for name in SHOWN if name in self.row}
        return f"<StepRecord: {', '.join(f'{name} = {v:.4g}' for name, v in shown.items())}>"


class StepRecorder:
    """Makes the records of steps in turn, from the last one of an earlier run. Collective."""

    def __init__(self, problem: ContactProblem, last: StepRecord | None = None) -> None:
        self._problem, self._before = problem, Balance.rest(problem)
        if last is not None:
            here = problem.at(last.state.time, last.state.history)
            self._before = balance(here, last.state, self._before)
            self._before = replace(self._before, enthalpy=last.enthalpy)
        self._equilibrium_rounding = 0.0 if last is None else last.equilibrium_rounding
        self._driven = DrivenPart.of(problem)
        self._ways = driven_displacements(problem).values()

    def record(self, state: State, outcome: Outcome) -> StepRecord:
        """Return the record of a step that follows the last one. Collective."""
        problem = self._problem.at(state.time, state.history)
        self._before = energies = balance(problem, state, self._before)
        solution = Results(problem, state, outcome, [*outcome.records], outcome.counters, "", {})
        solution.energies = energies
        if self._driven is not None:
            way = np.array([mean(problem, state) for mean in self._ways])
            solution.driven = way, self._driven.force(problem, state)
        row = values_of(STEPS, solution)
        self._equilibrium_rounding = max(
            self._equilibrium_rounding, outcome.residuals.equilibrium_rounding
        )
        return StepRecord(state, row, energies.enthalpy, self._equilibrium_rounding)


@dataclass(repr=False)
class Results:
    """The solution of a problem, or the state at which its method has ended.

    Nodal quantities are those of the contact nodes that this rank owns, in the order of
    `problem.nodes`.

    Attributes
    ----------
    problem
        The problem, of a load step that of its time and history.
    state
        Unknowns, multipliers, time and history: a value, which nothing that is done with the
        problem changes.
    outcome
        Whether it has converged, why it ended, and the residuals.
    history, counters
        The outer iterations; factorisations and linear solves.
    method
        Name of the method.
    seconds
        Spent on setup, solve and output.
    notes, warnings
        Informational notes, and warnings, each with its identifier.
    max_dev_strain, max_von_mises
        The largest |dev eps| and von Mises stress over the cells (their nodes, for degree 2).
    plastic_share
        Share of the body's volume in the plastic range, |dev eps| above the material's first
        yield; None where no material has such a limit.
    plastic_volume, equivalent_plastic_strain
        Volume with plastic strain, and the largest equivalent one; None without a law that has it.
    deformation
        How large strains and changes of volume are; None before the solution is reviewed.
    error
        The estimated discretisation error; None before the solution is reviewed.
    adaptation
        The rows of ``adapt.csv``, one a mesh; none without `[mesh.adapt]`.
    intervals
        Intervals of its quantities; None unless there are three nested uniform meshes.
    start
        The initial guess, in words.
    critical_factor
        The factor of mu from which on there may be several solutions, as far as that is known;
        infinity for none, NaN where it is not looked for (`contact.results.uniqueness`).
    jammed
        Whether friction alone keeps bodies in contact: without contact forces there is a solution.
    case
        The case as `contact check` prints it, empty where there is none.
    source
        The case itself, a `Case`; None of a problem that was built in Python, or with objects in
        its places.
    energies, driven
        Of a step: its energies, and displacement and force of the part that is moved or loaded.
    title, units
        Title of the case, and the names of its units.
    output
        The files that are written besides the summary and the tables.
    steps
        The steps of an evolution, the last of which this is.
    """

    problem: ContactProblem
    state: State
    outcome: Outcome
    history: list[Record]
    counters: Counters
    method: str
    seconds: dict[str, float]
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    max_dev_strain: float = np.nan
    max_von_mises: float = np.nan
    plastic_share: float | None = None
    plastic_volume: float | None = None
    equivalent_plastic_strain: float | None = None
    deformation: Deformation | None = None
    error: Estimate | None = None
    adaptation: list[dict[str, float]] = field(default_factory=list)
    intervals: Intervals | None = None
    start: str = "zero slip"
    critical_factor: float = np.inf
    jammed: bool = False
    case: str = ""
    source: Any = None
    energies: Balance | None = None
    driven: tuple[Array, Array] | None = None
    title: str = ""
    units: Units = field(default_factory=Units)
    output: OutputOptions = field(default_factory=OutputOptions)
    steps: list[StepRecord] = field(default_factory=list)

    def __repr__(self) -> str:
        """Return the main results; `summary.json` has all."""
        name = f" {self.title!r}" if self.title else ""
        state = "converged" if self.converged else "not converged"
        return (
            f"<Solution{name}: {state}, {self.outcome.reason}; method {self.method}, "
            f"von Mises stress up to {self.max_von_mises:.4g}; {len(self.warnings)} warning(s)>"
        )

    @property
    def nodal(self) -> Array:
        """Jumps of displacement and scaled potential at the contact nodes, (n, block size)."""
        return self.problem.nodal(self.state)

    @property
    def multipliers(self) -> Multipliers:
        """Multipliers of the unilateral constraint and of friction."""
        return self.state.multipliers

    @property
    def pressure(self) -> Array:
        """Contact pressure -sigma_nu, shape (n,): multiplier and layer."""
        return self.problem.interface.pressure(self.nodal, self.multipliers)

    @property
    def friction(self) -> Array:
        """Friction stress -sigma_tau = lambda_f, shape (n, d)."""
        return self.multipliers.friction

    @property
    def friction_bound(self) -> Array:
        """Friction bound s, shape (n,). Collective."""
        return self.problem.interface.bound(self.nodal, self.multipliers)

    @property
    def normal_displacement(self) -> Array:
        """u_nu along the contact direction, shape (n,)."""
        return self.problem.nodes.normal_component(self.nodal)

    @property
    def slip(self) -> Array:
        """Tangential displacement u_tau, shape (n, d)."""
        return self.problem.nodes.tangential_component(self.nodal)

    @cached_property
    def contact(self) -> ContactResult:
        """The contact nodes of all ranks as arrays, and as functions. Collective."""
        return contact_result(self.problem, self.state, self.status)

    @property
    def status(self) -> NDArray[np.str_]:
        """The active set by names: "open", "stick" or "slip", shape (n,). Collective.

        A node is in contact where p - c (gap - u_nu) > 0 for the multiplier p, or where the
        layer presses; c = E / size. There it slips if |lambda_f + c u_tau|
        exceeds the friction bound (always where that is 0), and sticks else. Pressures
        below 1e-9 of the largest count as rounding, and those that rounding of displacements makes.
        """
        interface, jump = self.problem.interface, self.nodal
        rounding_stress = interface.negligible(jump, self.pressure)
        active = interface.active_set(
            jump, self.multipliers, self.friction_bound, rounding_stress=rounding_stress
        )
        layer = interface.foundation.layer_pressure(jump) > rounding_stress
        touches = active.closed | layer
        sticks = active.sticks & (self.friction_bound > 0)
        return np.where(touches, np.where(sticks, "stick", "slip"), "open")

    @property
    def converged(self) -> bool:
        """Whether all residuals are below the tolerance."""
        return self.outcome.converged

    @property
    def equilibrium_rounding(self) -> float:
        """Forces out of balance that count as rounding; of an evolution the most in a step."""
        own = self.outcome.residuals.equilibrium_rounding
        return max([own, *(step.equilibrium_rounding for step in self.steps[-1:])])

    @property
    def floors(self) -> dict[str, float]:
        """Rounding floors of the residuals."""
        balance, contact, friction = self.outcome.residuals.floors
        balance = max(balance, self.equilibrium_rounding)
        return {"equilibrium": balance, "contact": contact, "friction": friction}

    @cached_property
    def _derived(self) -> dict[str, fem.Function]:
        return DerivedFields(self.problem.body, self.state).cells()

    @property
    def stress(self) -> fem.Function:
        """The stress, 3 x 3, cell by cell: of a degree less than the displacement. Collective."""
        return self._derived["stress"]

    @property
    def von_mises(self) -> fem.Function:
        """The von Mises stress, likewise. Collective."""
        return self._derived["von_mises"]

    @cached_property
    def _unknowns(self) -> dict[str, fem.Function]:
        return unknowns(self.problem.body, self.state.x)

    @property
    def displacement(self) -> fem.Function:
        """The displacement. The first use is collective."""
        return self._unknowns["displacement"]

    @property
    def potential(self) -> fem.Function | None:
        """The electric potential; None for a body without. The first use is collective."""
        return self._unknowns.get("potential")

    @property
    def plastic_dissipation(self) -> float | None:
        """The energy dissipated in the materials, in a step or in all of them. Collective.

        By plastic flow, or as a law of one's own says (`forms.history.Response`), such as damage.
        """
        body = self.problem.body
        if self.energies is not None or body.laws.initial is None:
            return None if self.energies is None else self.energies.plastic
        if not self.steps:
            return body.laws.energies(self.state)[0]
        return self._in_steps("plastic_dissipation")

    def _in_steps(self, column: str) -> float:
        """Return the sum of a column over the steps."""
        return sum(float(step.row[column]) for step in self.steps)

    @property
    def contact_force(self) -> Array:
        """The force that the body exerts on the foundation, shape (d,). Collective."""
        return contact_resultant(self.problem, self.state).force

    @property
    def contact_moment(self) -> Array:
        """The moment of the contact forces about the origin, shape (1,) or (3,). Collective."""
        return contact_resultant(self.problem, self.state).moment

    @cached_property
    def contacts(self) -> Mapping[str, ContactShare]:
        """Force, area, pressures, stick and slip of each contact, by its name. Collective.

        The dissipation is that of friction in all steps of an evolution.
        """
        found = contact_shares(self.problem, self.state, self.status)
        if not self.steps:
            return found
        end = "" if len(found) == 1 else "_{}"
        return {
            name: replace(share, dissipation=self._in_steps("dissipation" + end.format(name)))
            for name, share in found.items()
        }

    @property
    def contact_area(self) -> float:
        """The contact area: the sum of the weights of nodes in contact. Collective."""
        return self.problem.nodes.sum(np.where(self.status == "open", 0.0, 1.0))

    @property
    def max_displacement(self) -> float:
        """The largest Euclidean norm of the displacement over the nodes. Collective."""
        return MaxDisplacement()(self.problem, self.state)

    @cached_property
    def supports(self) -> Mapping[str, Resultant]:
        """Resultant of each part with prescribed displacements on the body. Collective."""
        return supports(self.problem, self.state)

    def reaction(self, part: str) -> Array:
        """Return the force that a support exerts on the body, shape (d,). Collective.

        Parameters
        ----------
        part
            Name of the part with prescribed displacements.

        Returns
        -------
        The force, of a plane body per unit of depth, of one of revolution over the full turn.

        Raises
        ------
        InputError
            If no displacement is prescribed on the part.
        """
        if part not in self.supports:
            raise InputError(
                f"reaction({part!r}): no displacement is prescribed there; accepted: "
                f"{', '.join(self.supports) or 'none, for nothing is constrained'}",
                "no-such-name",
            )
        return self.supports[part].force

    @cached_property
    def movements(self) -> Movements:
        """Rigid bodies, and electrodes of unknown potential, as in summary.json. Collective.

        Its keys are `rigid`, `rigid_parts`, `electrodes` and `bolts`, as far as there are any.
        """
        return movements(self.problem, self.state)

    @cached_property
    def charges(self) -> ChargeBalance | None:
        """The free charges; None for a body without a potential. Collective."""
        if not self.problem.piezoelectric:
            return None
        return charge_balance(self.problem, self.state)

    def at_step(self, state: State) -> Self:
        """Return the solution at the end of a step, without the records of the whole."""
        problem = self.problem.at(state.time, state.history)
        of = self.outcome, self.history, self.counters, self.method
        return type(self)(problem, state, *of, {})

    @property
    def dissipation(self) -> float:
        """The energy that friction has dissipated, in all steps of an evolution. Collective."""
        if self.steps:
            return self._in_steps("dissipation")
        return dissipated(self.problem, self.state)

    @property
    def conduction_ramp(self) -> float | None:
        """How far in front of the closed gap the foundation conducts, 1/delta (length)."""
        conductor = self.problem.interface.foundation.conductor
        return 1 / conductor.psi.delta if conductor and conductor.psi.follows_gap else None

    @cached_property
    def counts(self) -> dict[str, int]:
        """Numbers of contact nodes that are open, stick and slip. Collective."""
        names, status = ("open", "stick", "slip"), self.status
        own = np.array([np.count_nonzero(status == name) for name in names])
        counts = self.problem.comm.allreduce(own, op=MPI.SUM)
        return dict(zip(names, counts.tolist(), strict=True))

    @cached_property
    def potential_range(self) -> tuple[float, float] | None:
        """The least and the largest potential at a node. Collective."""
        if not self.problem.piezoelectric:
            return None
        comm, body = self.problem.comm, self.problem.body
        scaled = self.state.x[: body.owned].reshape(-1, body.block_size)[:, -1]
        phi = body.phi_scale * scaled[body.electric_nodes]
        return (
            comm.allreduce(float(phi.min(initial=math.inf)), op=MPI.MIN),
            comm.allreduce(float(phi.max(initial=-math.inf)), op=MPI.MAX),
        )
