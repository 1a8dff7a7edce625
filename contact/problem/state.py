"""The state of a contact problem, a frozen value; its scales, and the protocols of a problem."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from mpi4py import MPI

from contact.body.equilibrium import ComponentNorms
from contact.history import History, LinearisationPoint
from contact.interface.complementarity import ComplementarityParameters
from contact.interface.interface import Interface
from contact.interface.multipliers import ActiveSet, Multipliers
from contact.linear.operator import Counters, Operator
from contact.typing import Array


@dataclass(frozen=True)
class State:
    """Unknowns and contact forces at a time; its arrays are read-only.

    Attributes
    ----------
    x
        Local unknowns, ghosts behind the owned ones: displacement and scaled potential by node.
    forces
        Contact pressure and friction at the contact nodes.
    time
        Time of loads and prescribed values; 1 of a static problem.
    history
        History at the beginning of the step; empty for the reference configuration.
    active_set
        Active set of the last Newton step; None without one.
    layer_pressure
        Pressure of the linearised layer after that step, shape (n,); None for the law's.
    """

    x: Array
    forces: Multipliers
    time: float = 1.0
    history: History = field(default_factory=History)
    active_set: ActiveSet | None = None
    layer_pressure: Array | None = None

    def __post_init__(self) -> None:
        """Mark the arrays as read-only."""
        for array in (self.x, self.forces.pressure, self.forces.friction):
            array.flags.writeable = False

    def near(self, other: State, rtol: float = 0.0, atol: float = 0.0) -> bool:
        """Tell whether another state has the same values on this rank."""
        pairs = (
            (self.x, other.x),
            (self.forces.pressure, other.forces.pressure),
            (self.forces.friction, other.forces.friction),
        )
        return (
            self.history.near(other.history, rtol, atol)
            and self.time == other.time
            and all(np.allclose(one, two, rtol=rtol, atol=atol) for one, two in pairs)
        )


@dataclass(frozen=True)
class Scales:
    """Lengths and stiffnesses of a body and its mesh, in any units.

    Attributes
    ----------
    young, poisson, bulk, shear
        Elastic constants of small strains (stress, none, stress, stress).
    size
        Largest extent (length).
    height
        H, volume over the area of Gamma_3 (length).
    area
        Area of Gamma_3 (length^(d - 1)); of a body of revolution of the full turn (length^2).
    spacing
        h, spacing of the contact nodes (length).
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

    @property
    def augmentation(self) -> float:
        """r* = 1.39 E'/sqrt(h H), geometric mean of the ends of the Steklov spectrum.

        Displacements of Gamma_3 that vary over H meet the stiffness E'/H, those that vary from node
        to node r*^2 H/E' (stress/length).
        """
        return 1.39 * self.plane_modulus / math.sqrt(self.spacing * self.height)

    def complementarity_parameters(self, gamma: float) -> ComplementarityParameters:
        """Return c = r*, the stiffness r*^2 H/E' of a node, and gamma times the larger one."""
        c = self.augmentation
        nodal = c**2 * self.height / self.plane_modulus
        return ComplementarityParameters(c, nodal, gamma * max(c, nodal))


class Equilibrium(Protocol):
    """Equilibrium of a body: nodal forces at given unknowns, without a state of its own.

    Implemented by the whole body (`contact.body.equilibrium`) and by the body condensed onto its
    contact nodes (`contact.problem.condensed`).
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
        """Norms of forces and charges of each connected component."""

    @property
    def rounding_limit(self) -> float:
        """Largest residual that is accepted as rounding, over all forces of a field."""

    def rest(self) -> Array:
        """Return the local unknowns of the reference configuration: zeros."""

    def prescribe(self, x: Array, time: float = 1.0) -> Array:
        """Return unknowns with the prescribed values of a time. Collective."""

    def owned_part(self, x: Array) -> Array:
        """Return the owned unknowns of local ones, the global ones behind them."""

    def moved(self, x: Array, increment: Array) -> Array:
        """Return unknowns plus an increment of the owned ones. Collective."""

    def internal_forces(self, state: LinearisationPoint, secant_at: Array | None = None) -> Array:
        """Return the owned nodal forces of the stresses at a state. Collective."""

    def external(self, time: float = 1.0) -> Array:
        """Return the owned nodal loads at a time. Collective."""

    def unbalanced(self, forces: Array) -> Array:
        """Return the forces on free unknowns, which vanish in equilibrium. Collective."""

    def reactions(self, forces: Array) -> Array:
        """Return the forces on fixed unknowns: reactions of the supports."""

    def norms(self, values: Array) -> Array:
        """Return norms of owned forces and charges, by connected component. Collective."""

    def load_norms(self, time: float = 1.0) -> Array:
        """Return the `norms` of the loads at a time. Collective."""

    def exchanged(self, state: LinearisationPoint) -> Array:
        """Return the `norms` of the piezoelectric coupling forces and charges. Collective."""

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
        """Time of its loads and prescribed values; 1 for a static problem."""

    def start(self, time: float | None = None) -> State:
        """Return the zero initial guess, with the prescribed values of the problem's time.

        Or of another time.
        """

    def with_laws(self, interface: Interface) -> Problem:
        """Return the problem with another interface on the same contact nodes."""

    def operator(self, *, symmetric: bool, counters: Counters, kind: str) -> Operator:
        """Return the operator of its linear systems: bulk matrix plus blocks at contact nodes."""
