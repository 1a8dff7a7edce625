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
from contact.interface.friction import NodalFriction, law_at
from contact.interface.law import InterfaceLaw
from contact.interface.mortar.coupling import Coupling
from contact.interface.mortar.lumping import Mixing
from contact.interface.mortar.operator import CouplingOperator, coupling_operator
from contact.interface.multipliers import SlipHistory
from contact.interface.nodes import ContactNodes
from contact.interface.smoothing import Smoothing
from contact.linear.layout import Inclined, projectors
from contact.model.electric import Conductor
from contact.model.friction import Friction
from contact.model.layer import Layer
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
    """Laws of groups of nodes in place of one, of whatever kind (`forms.laws`).

    Values are those of each law at its own nodes, constants the largest ones. The operator R is
    one too: the pressure on one obstacle does not bound friction on another.

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

    def _at_each(self, name: str, *given: Array) -> Array:
        """Return the values of a method of each law at its own nodes."""
        parts, label = [], self.label
        if label and name != "__call__":
            label = f"{label}: {name}"
        for law, (begin, end) in zip(self.laws, pairwise(self.bounds), strict=True):
            here = [argument[begin:end] for argument in given]
            with naming(label) if label else nullcontext():
                values = getattr(law, name)(*here)
                parts.append(real(values, (end - begin,), "one number for each node"))
        return np.concatenate(parts) if len(parts) > 1 else parts[0]

    def __call__(self, *given: Any) -> Any:
        """Return s(|u_tau|, p), p_nu, h_nu, phi_L, or the smoothed pressure R p."""
        return self._at_each("__call__", *given)

    def derivative(self, s: Any) -> Any:
        """Return the derivative of a law of one argument."""
        return self._at_each("derivative", s)

    def by_slip(self, slip: Any, pressure: Any) -> Any:
        """Return the derivative of a friction law by the slip."""
        return self._at_each("by_slip", slip, pressure)

    def by_pressure(self, slip: Any, pressure: Any) -> Any:
        """Return the derivative of a friction law by the pressure."""
        return self._at_each("by_pressure", slip, pressure)

    def transposed(self, values: Array) -> Array:
        """Return the transpose of R on nodal values."""
        return self._at_each("transposed", values)

    def at(self, s: Any, pressed: Any, loaded: Any) -> Any:
        """Return the conductivity psi."""
        return self._at_each("at", s, pressed, loaded)

    def gap_slope(self, s: Any, pressed: Any) -> Any:
        """Return the derivative of psi by the gap."""
        return self._at_each("gap_slope", s, pressed)

    @property
    def maximum(self) -> float:
        """The largest mu, or phi_L."""
        return max(law.maximum for law in self.laws)

    @property
    def lipschitz(self) -> float:
        """The largest Lipschitz constant of mu by the slip."""
        return max(law.lipschitz for law in self.laws)

    @property
    def radius(self) -> float:
        """The largest radius of R."""
        return max(law.radius for law in self.laws)

    @property
    def k_e(self) -> float:
        """The largest conductivity."""
        return max(law.k_e for law in self.laws)

    @property
    def delta(self) -> float:
        """The steepest ramp of a conductivity."""
        return max(law.delta for law in self.laws)

    @property
    def follows_gap(self) -> bool:
        """Whether a conductivity depends on the gap."""
        return any(law.follows_gap for law in self.laws)


def _grouped(laws: Sequence[Any], bounds: tuple[int, ...], label: str = "") -> Any:
    """Return one law of the kind of given ones, see `Grouped`."""
    return Grouped(tuple(laws), bounds, label)


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
        Nodes of the part that cannot move, but through which current flows; None without.
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
    held: ContactNodes | None = None
    coupling: Coupling | None = None
    mixing: Mixing | None = None


def joined_nodes(
    entries: Sequence[Entry],
    index_map: IndexMap,
    free: NDArray[np.bool_],
    ties: sparse.csr_array,
    inclined: Inclined | None = None,
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
    inclined
        Directions in which supports hold nodes; None for none.

    Raises
    ------
    InputError
        If two entries share nodes, a node is on both sides of pairs of bodies, or one whose jump
        is a sum is on a roller.
    """
    _check_apart(entries)
    nodes = _side_by_side([entry.nodes for entry in entries])
    given = [entry.coupling or entry.mixing for entry in entries]
    rows = [jumps for jumps in given if jumps is not None]
    there = None if inclined is None else inclined.at(nodes.nodes)
    # The unknowns by their jumps: free components, the normal one of which is that of the unknowns,
    # of which the `lift` stands for that of the components that supports hold.
    unknowns, d = projectors(free[nodes.nodes], there), nodes.dim
    held = nodes.normal - np.einsum("nij,nj->ni", unknowns[:, :d, :d], nodes.normal)
    unknowns[:, :d, :d] += nodes.lift[:, :, None] * held[:, None, :]
    coupling = coupling_operator(nodes.comm, index_map, rows, (nodes.nodes, unknowns), free)
    if coupling is not None and inclined is not None:
        _check_rollers(nodes, coupling, inclined, any(entry.coupling for entry in entries))
    return replace(nodes, coupling=coupling, carried=_carried(nodes, coupling, ties, unknowns))


def _check_rollers(
    nodes: ContactNodes, coupling: CouplingOperator, inclined: Inclined, bodies: bool
) -> None:
    """Refuse jumps of several nodes, which have no common direction, on rollers. Collective."""
    shared = bool(np.isin(coupling.local, inclined.nodes).any())
    if not nodes.comm.allreduce(shared, op=MPI.LOR):
        return
    contact = "contact of degree 2 in 3-D"
    if bodies:
        contact = "contact of two bodies"
    elif nodes.revolved:
        contact = "contact of a body of revolution that reaches its axis"
    raise InputError(
        f"fixed.normal: its part shares nodes with a {contact}, where jumps are sums over nodes; "
        "accepted: there a displacement across an axis instead, or parts apart",
        "roller-contact",
    )


def _carried(
    nodes: ContactNodes, coupling: CouplingOperator | None, ties: sparse.csr_array, unknowns: Array
) -> Array | None:
    """Return how nodes move with the global unknowns where no jump changes. Collective."""
    if nodes.motion is None:
        return None
    moved = nodes.motion.copy()
    if coupling is not None:
        for k, column in enumerate(ties.toarray().T):
            moved[coupling.places, :, k] -= coupling.apply(column.reshape(-1, nodes.block_size))
    return np.asarray(unknowns @ moved)


def _check_apart(entries: Sequence[Entry]) -> None:
    first = entries[0].nodes
    every = np.concatenate([entry.nodes.nodes for entry in entries])
    shared = every.size - np.unique(every).size
    if first.comm.allreduce(shared, op=MPI.SUM) > 0:
        names = ", ".join(entry.on for entry in entries)
        raise InputError(
            f"contact: the parts {names} share nodes, which one obstacle alone can hold; "
            "accepted: parts without common nodes, such as pieces of a side with a gap between",
            "contacts-meet",
        )


def _side_by_side(pieces: Sequence[ContactNodes]) -> ContactNodes:
    first = pieces[0]
    together: dict[str, Any] = {
        name: np.concatenate([getattr(nodes, name) for nodes in pieces])
        for name in ("nodes", "points", "weight", "normal", "lift", "tangent", "gap", "deviation")
    }
    if first.motion is not None:
        together["motion"] = np.concatenate([nodes.motion for nodes in pieces])
    return replace(first, cut=max(nodes.cut for nodes in pieces), **together)


def joined_friction(entries: Sequence[Entry], nodes: ContactNodes) -> NodalFriction:
    """Return friction at the nodes of all entries, joined before. Collective."""
    bounds = _bounds(entries)
    smoothing = tuple(Smoothing(entry.nodes, entry.friction.radius) for entry in entries)
    laws = [law_at(entry.friction, entry.nodes) for entry in entries]
    law = None
    if any(laws):
        every = tuple(NO_FRICTION if own is None else own for own in laws)
        own = any(hasattr(entry.friction.mu, "by_slip") for entry in entries)
        law = _grouped(every, bounds, "Friction: law" if own else "Friction: mu")
    return NodalFriction(law, _grouped(smoothing, bounds), SlipHistory.rest(nodes))


def joined_law(
    entries: Sequence[Entry], nodes: ContactNodes, phi_scale: float, contact_scale: float
) -> InterfaceLaw:
    """Return the layers and conductors of all entries as one law.

    Parameters
    ----------
    entries, nodes
        The entries, and their nodes joined before.
    phi_scale, contact_scale
        As in `InterfaceLaw`.

    Raises
    ------
    InputError
        If some are lagged and others not.
    """
    bounds, conductors = _bounds(entries), [entry.conductor for entry in entries]
    return InterfaceLaw(
        nodes,
        _joined_layers([entry.layer for entry in entries], bounds),
        _joined_conductors(conductors, bounds),
        phi_scale,
        contact_scale,
    )


def _joined_layers(given: Sequence[Layer | None], bounds: tuple[int, ...]) -> Layer | None:
    if not any(given):
        return None
    layers = [layer or NO_LAYER for layer in given]
    return Layer(
        np.repeat([layer.thickness for layer in layers], np.diff(bounds)),
        _grouped(tuple(layer.p_nu for layer in layers), bounds, "layer: p_nu"),
        _grouped(tuple(layer.h_nu for layer in layers), bounds, "layer: h_nu"),
        _alike([layer.lagged for layer in given if layer is not None]),
    )


def _joined_conductors(
    given: Sequence[Conductor | None], bounds: tuple[int, ...]
) -> Conductor | None:
    if len(given) == 1 or not any(given):
        return given[0]
    conductors = [conductor or NO_CONDUCTOR for conductor in given]

    def phi_f(time: float) -> Array:
        """Return the potentials of the foundations at a time."""
        values = [float(conductor.at(time).phi_f) for conductor in conductors]
        return np.repeat(values, np.diff(bounds))

    moving = any(conductor.phi_f_at is not None for conductor in conductors)
    return Conductor(
        _grouped(tuple(conductor.psi for conductor in conductors), bounds, "Conductor: psi"),
        np.repeat([conductor.phi_f for conductor in conductors], np.diff(bounds)),
        _grouped(tuple(conductor.phi_l for conductor in conductors), bounds, "Conductor: phi_l"),
        _alike([conductor.lagged for conductor in given if conductor is not None]),
        phi_f if moving else None,
    )


def joined_held(entries: Sequence[Entry], law: InterfaceLaw, begin: int) -> InterfaceLaw | None:
    """Return the law at the held nodes of all entries; None without conductors.

    Parameters
    ----------
    entries, law
        The entries, and their law at contact nodes.
    begin
        Global number of the first node of this rank.
    """
    given = [(entry.held, entry.conductor) for entry in entries if entry.held is not None]
    if not given:
        return None
    nodes = _side_by_side([held for held, _ in given])
    if law.jump.coupling is not None:
        coupling = law.jump.coupling.at(nodes.nodes.astype(np.int64) + begin)
        nodes = replace(nodes, coupling=coupling)
    bounds = Grouped.bounds_of(held.nodes.size for held, _ in given)
    conductor = _joined_conductors([conductor for _, conductor in given], bounds)
    return replace(law, jump=nodes, layer=None, conductor=conductor)


def _bounds(entries: Sequence[Entry]) -> tuple[int, ...]:
    return Grouped.bounds_of(entry.nodes.nodes.size for entry in entries)


def _alike(lagged: Sequence[bool]) -> bool:
    if len(set(lagged)) > 1:
        raise InputError(
            "contact: lagged is true for some and false for others; accepted: one way", "lagged"
        )
    return lagged[0]
