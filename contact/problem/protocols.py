"""Protocols that methods are written against, and the scales of a problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from mpi4py import MPI

from contact.body.component_norms import ComponentNorms
from contact.history import Evaluated
from contact.interface.interface import Interface
from contact.linear.operator import Counters, Operator
from contact.problem.state import State
from contact.typing import Array


@dataclass(frozen=True)
class Scales:
    """Sizes that fit a body in any units.

    Attributes
    ----------
    young, poisson, bulk, shear
        Elastic constants of small strains (stress, none, stress, stress).
    size
        Largest extent (length).
    height
        Volume over the area of Gamma_3 (length).
    area
        Of Gamma_3 (length^(d - 1)); of a body of revolution over the full turn (length^2).
    spacing
        Of the contact nodes (length).
    """

    young: float
    poisson: float
    bulk: float
    shear: float
    size: float
    height: float
    area: float
    spacing: float

    @property
    def plane_modulus(self) -> float:
        """E' = E/(1 - nu^2) (stress)."""
        return self.young / (1 - self.poisson**2)


class Equilibrium(Protocol):
    """A body as its contact nodes feel it: forces at given unknowns.

    The whole body (`contact.body.equilibrium`) and the one condensed onto its contact nodes
    (`contact.problem.condensed`) are two implementations. Neither keeps a state.
    """

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator."""

    @property
    def dim(self) -> int:
        """Number of displacement components of a node."""

    @property
    def block_size(self) -> int:
        """Number of unknowns of a node."""

    @property
    def owned(self) -> int:
        """Number of unknowns that this rank owns."""

    @property
    def linear(self) -> bool:
        """Whether the operator is the same at all unknowns."""

    @property
    def symmetric(self) -> bool:
        """Whether its tangent is a symmetric matrix."""

    @property
    def component_norms(self) -> ComponentNorms:
        """Which forces are compared with each other."""

    @property
    def most_rounding(self) -> float:
        """Most that counts as rounding, over all forces of a field."""

    def rest(self) -> Array:
        """Return the local unknowns of the undeformed body."""

    def prescribe(self, x: Array, time: float = 1.0) -> Array:
        """Return unknowns with the prescribed values at a time. Collective."""

    def owned_part(self, x: Array) -> Array:
        """Return the owned ones of local unknowns, and the global ones behind them."""

    def moved(self, x: Array, increment: Array) -> Array:
        """Return unknowns plus an increment of the owned ones. Collective."""

    def internal_forces(self, state: Evaluated, secant_at: Array | None = None) -> Array:
        """Return the owned nodal forces of the stresses at a state. Collective."""

    def external(self, time: float = 1.0) -> Array:
        """Return the owned nodal loads at a time. Collective."""

    def unbalanced(self, forces: Array) -> Array:
        """Return the part of forces that has to vanish in equilibrium. Collective."""

    def reactions(self, forces: Array) -> Array:
        """Return the part of forces that the supports bear."""

    def norms(self, values: Array) -> Array:
        """Return the norms of owned forces, and of charges, of each component apart. Collective."""

    def load_norms(self, time: float = 1.0) -> Array:
        """Return the `norms` of the loads at a time. Collective."""

    def exchanged(self, state: Evaluated) -> Array:
        """Return the `norms` of the forces of each field on the other. Collective."""

    def norm(self, values: Array) -> float:
        """Return the Euclidean norm of owned values. Collective."""


class Problem(Protocol):
    """A body and its interface."""

    @property
    def equilibrium(self) -> Equilibrium:
        """The body."""

    @property
    def interface(self) -> Interface:
        """Gamma_3 with its laws."""

    @property
    def scales(self) -> Scales:
        """Sizes of the body and its stiffness."""

    @property
    def time(self) -> float:
        """When its loads and prescribed values act; 1 for a static problem."""

    def start(self, time: float | None = None) -> State:
        """Return the state to start from: zero, but for the prescribed values.

        Those of another time than the problem's, where one is given.
        """

    def with_interface(self, interface: Interface) -> Problem:
        """Return the problem with other laws, or gaps, at the same contact nodes."""

    def operator(self, *, symmetric: bool, counters: Counters, kind: str) -> Operator:
        """Return the operator of its linear systems, with blocks where the interface has some."""
