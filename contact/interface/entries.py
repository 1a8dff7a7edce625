"""Several obstacles in front of one body: their nodes as one array, their laws as one law.

All laws of Gamma_3 act node by node. The nodes of one obstacle follow each other in the array, and
each law of a group acts on its own nodes. The interface (`contact.interface.interface`), which is
built on it, knows no number of obstacles.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from dolfinx.common import IndexMap
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from contact.arguments import naming, real
from contact.errors import InputError
from contact.interface.current import Conductor, HeldCurrent
from contact.interface.friction import Friction, NodalFriction
from contact.interface.jump import SlipHistory
from contact.interface.layer import Layer
from contact.interface.mortar.coupling import Coupling
from contact.interface.mortar.lumping import Mixing
from contact.interface.mortar.operator import CouplingOperator, coupling_operator
from contact.interface.nodes import ContactNodes
from contact.interface.smoothing import Smoothing
from contact.typing import Array
from forms.laws import (
    Compliance,
    ConstantCoefficient,
    Coulomb,
    PerfectConductivity,
    PotentialFactor,
    Truncation,
)


@dataclass(frozen=True)
class Grouped:
    """Several laws in place of one.

    Attributes
    ----------
    laws
        The law of each group.
    bounds
        Where the groups begin on this rank, and the number of all nodes.
    label
        Name in messages of a law that may be the user's own, and fail or return no numbers.
    """

    laws: tuple[Any, ...]
    bounds: tuple[int, ...]
    label: str = ""

    @staticmethod
    def bounds_of(sizes: Iterable[int]) -> tuple[int, ...]:
        """Return the bounds of groups of given sizes."""
        return tuple(int(bound) for bound in np.cumsum([0, *sizes]))

    def _each(self, name: str, *arguments: Array) -> Array:
        """Return a method of each law at its own nodes."""
        parts, label = [], self.label
        if label and name != "__call__":
            label = f"{label}: {name}"
        for law, (begin, end) in zip(self.laws, pairwise(self.bounds), strict=True):
            here = [argument[begin:end] for argument in arguments]
            with naming(label) if label else nullcontext():
                values = getattr(law, name)(*here)
                parts.append(real(values, (end - begin,), "one number for each node"))
        return np.concatenate(parts) if len(parts) > 1 else parts[0]


@dataclass(frozen=True)
class GroupedPointwise(Grouped):
    """p_nu, h_nu or phi_L."""

    def __call__(self, s: Array) -> Array:
        """Return the law at all nodes."""
        return self._each("__call__", s)

    def derivative(self, s: Array) -> Array:
        """Return the derivative at all nodes."""
        return self._each("derivative", s)


@dataclass(frozen=True)
class GroupedFriction(Grouped):
    """Friction bounds, see `forms.laws.FrictionLaw`."""

    @property
    def maximum(self) -> float:
        """Upper bound of s/p."""
        return max(law.maximum for law in self.laws)

    @property
    def lipschitz(self) -> float:
        """Lipschitz constant of s/p in the slip (1/length)."""
        return max(law.lipschitz for law in self.laws)

    def __call__(self, slip: Array, pressure: Array) -> Array:
        """Return the bound at all nodes."""
        return self._each("__call__", slip, pressure)

    def by_slip(self, slip: Array, pressure: Array) -> Array:
        """Return ds/d|u_tau|."""
        return self._each("by_slip", slip, pressure)

    def by_pressure(self, slip: Array, pressure: Array) -> Array:
        """Return ds/dp."""
        return self._each("by_pressure", slip, pressure)


@dataclass(frozen=True)
class GroupedConductivity(Grouped):
    """Conductivities, see `forms.laws.Conductivity`."""

    @property
    def k_e(self) -> float:
        """The largest conductivity."""
        return max(law.k_e for law in self.laws)

    @property
    def delta(self) -> float:
        """The largest slope of psi over k_e (1/length)."""
        return max(law.delta for law in self.laws)

    @property
    def follows_gap(self) -> bool:
        """Whether one of them does."""
        return any(law.follows_gap for law in self.laws)

    def at(self, s: Array, pressed: Array, loaded: Array) -> Array:
        """Return the conductivity at all nodes."""
        return self._each("at", s, pressed, loaded)

    def gap_slope(self, s: Array, pressed: Array) -> Array:
        """Return the derivative by s."""
        return self._each("gap_slope", s, pressed)


@dataclass(frozen=True)
class GroupedSmoothing(Grouped):
    """R within each group: the pressure on one obstacle does not bound friction on another."""

    laws: tuple[Smoothing, ...]

    @property
    def radius(self) -> float:
        """The largest radius."""
        return max(law.radius for law in self.laws)

    def __call__(self, values: Array) -> Array:
        """Return R applied to nodal values, shape (n,). Collective."""
        return self._each("__call__", values)


#: Laws of an obstacle without friction, layer or current.
NO_FRICTION = Coulomb(ConstantCoefficient(0.0))
NO_LAYER = Layer(0.0, Compliance(np.inf), PotentialFactor(0.0))
NO_CONDUCTOR = Conductor(PerfectConductivity(0.0), 0.0, Truncation(np.inf))


@dataclass(frozen=True)
class Entry:
    """One obstacle in front of the body.

    Attributes
    ----------
    on
        The part that may touch it.
    nodes
        Its contact nodes.
    friction, layer, conductor
        The laws there.
    held
        The current through nodes of the part that cannot move; None without.
    coupling
        The other side of the nodes, where that is another body; None for a rigid foundation.
    mixing
        The jumps in front of a rigid foundation, where these are no nodal values; else None.
    """

    on: str
    nodes: ContactNodes
    friction: Friction
    layer: Layer | None = None
    conductor: Conductor | None = None
    held: HeldCurrent | None = None
    coupling: Coupling | None = None
    mixing: Mixing | None = None


def joined_nodes(
    entries: Sequence[Entry],
    index_map: IndexMap,
    free: NDArray[np.bool_],
    ties: sparse.csr_array,
) -> ContactNodes:
    """Return the nodes of all entries, one entry after the other. Collective.

    Parameters
    ----------
    entries
        The entries.
    index_map, free
        Nodes of the mesh, and which of their unknowns are not fixed.
    ties
        How those that follow move with the global unknowns (`contact.body.global_unknowns`).

    Raises
    ------
    InputError
        If two entries share nodes, or a node is on both sides of pairs of bodies.
    """
    _check_apart(entries)
    nodes = _side_by_side([entry.nodes for entry in entries])
    given = [entry.coupling or entry.mixing for entry in entries]
    rows = [jumps for jumps in given if jumps is not None]
    coupling = coupling_operator(nodes.comm, index_map, rows, nodes.nodes, free)
    return replace(nodes, coupling=coupling, carried=_carried(nodes, coupling, ties, free))


def _carried(
    nodes: ContactNodes,
    coupling: CouplingOperator | None,
    ties: sparse.csr_array,
    free: NDArray[np.bool_],
) -> Array | None:
    """Return how nodes move with the global unknowns where no jump changes. Collective."""
    if nodes.motion is None or coupling is None:
        return nodes.motion
    carried = nodes.motion.copy()
    for k, column in enumerate(ties.toarray().T):
        beside = coupling.apply(column.reshape(free.shape))
        carried[coupling.places, :, k] -= beside * free[nodes.nodes[coupling.places]]
    return carried


def _check_apart(entries: Sequence[Entry]) -> None:
    first = entries[0].nodes
    every = np.concatenate([entry.nodes.nodes for entry in entries])
    shared = every.size - np.unique(every).size
    if first.comm.allreduce(shared, op=MPI.SUM) > 0:
        names = ", ".join(entry.on for entry in entries)
        raise InputError(
            f"contact: the parts {names} share nodes, which one obstacle alone can hold; "
            "accepted: parts without common nodes, such as pieces of a side with a gap between"
        )


def _side_by_side(pieces: Sequence[ContactNodes]) -> ContactNodes:
    first = pieces[0]
    if len(pieces) == 1:
        return first
    together: dict[str, Any] = {
        name: np.concatenate([getattr(nodes, name) for nodes in pieces])
        for name in ("nodes", "points", "weight", "normal", "tangent", "gap")
    }
    if first.motion is not None:
        together["motion"] = np.concatenate([nodes.motion for nodes in pieces])
    held = [np.zeros_like(n.normal) if n.held is None else n.held for n in pieces]
    together["held"] = np.concatenate(held)
    for name in ("cut", "deviation"):
        together[name] = max(getattr(nodes, name) for nodes in pieces)
    return replace(first, **together)


def joined_friction(entries: Sequence[Entry], nodes: ContactNodes) -> NodalFriction:
    """Return friction at the nodes of all entries, joined before. Collective."""
    bounds = _bounds(entries)
    smoothing = tuple(Smoothing(entry.nodes, entry.friction.radius) for entry in entries)
    laws = [entry.friction.law_at(entry.nodes) for entry in entries]
    law = None
    if any(laws):
        every = tuple(NO_FRICTION if own is None else own for own in laws)
        own = any(entry.friction.law is not None for entry in entries)
        law = GroupedFriction(every, bounds, "Friction: law" if own else "Friction: mu")
    return NodalFriction(law, GroupedSmoothing(smoothing, bounds), SlipHistory.rest(nodes))


def joined_layer(entries: Sequence[Entry]) -> Layer | None:
    """Return the layers of all entries as one.

    Raises
    ------
    InputError
        If some are lagged and others not.
    """
    given = [entry.layer for entry in entries]
    if not any(given):
        return None
    layers, bounds = [layer or NO_LAYER for layer in given], _bounds(entries)
    return Layer(
        np.repeat([layer.thickness for layer in layers], np.diff(bounds)),
        GroupedPointwise(tuple(layer.p_nu for layer in layers), bounds, "layer: p_nu"),
        GroupedPointwise(tuple(layer.h_nu for layer in layers), bounds, "layer: h_nu"),
        _alike([layer.lagged for layer in given if layer is not None]),
    )


def joined_conductor(entries: Sequence[Entry]) -> Conductor | None:
    """Return the conductors of all entries as one; raises as `joined_layer`."""
    given = [entry.conductor for entry in entries]
    return _joined_conductors(given, _bounds(entries))


def _joined_conductors(
    given: Sequence[Conductor | None], bounds: tuple[int, ...]
) -> Conductor | None:
    if len(given) == 1 or not any(given):
        return given[0]
    conductors = [conductor or NO_CONDUCTOR for conductor in given]

    def phi_f(time: float) -> Array:
        """Return the potentials of the foundations at a time."""
        values = [conductor.at(time).phi_f for conductor in conductors]
        return np.repeat(values, np.diff(bounds))

    moving = any(conductor.phi_f_at is not None for conductor in conductors)
    return Conductor(
        GroupedConductivity(
            tuple(conductor.psi for conductor in conductors), bounds, "Conductor: psi"
        ),
        np.repeat([conductor.phi_f for conductor in conductors], np.diff(bounds)),
        GroupedPointwise(
            tuple(conductor.phi_l for conductor in conductors), bounds, "Conductor: phi_l"
        ),
        _alike([conductor.lagged for conductor in given if conductor is not None]),
        phi_f if moving else None,
    )


def joined_held(
    entries: Sequence[Entry], begin: int, coupling: CouplingOperator | None
) -> HeldCurrent | None:
    """Return the current through the held nodes of all entries.

    Parameters
    ----------
    entries
        The entries.
    begin
        Global number of the first node of this rank.
    coupling
        The mortar coupling operator.
    """
    given = [entry.held for entry in entries if entry.held is not None]
    if not given:
        return None
    nodes = _side_by_side([held.jump for held in given])
    if coupling is not None:
        nodes = replace(nodes, coupling=coupling.at(nodes.nodes.astype(np.int64) + begin))
    bounds = Grouped.bounds_of(held.jump.nodes.size for held in given)
    conductor = _joined_conductors([held.conductor for held in given], bounds)
    assert conductor is not None
    return replace(given[0], jump=nodes, conductor=conductor)


def _bounds(entries: Sequence[Entry]) -> tuple[int, ...]:
    return Grouped.bounds_of(entry.nodes.nodes.size for entry in entries)


def _alike(lagged: Sequence[bool]) -> bool:
    if len(set(lagged)) > 1:
        raise InputError("contact: lagged is true for some and false for others; accepted: one way")
    return lagged[0]
