"""Several obstacles in front of one body: their nodes as one array, their laws as one law.

What is built on it (`contact.interface.interface`) knows no number of obstacles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dolfinx.common import IndexMap
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from contact.errors import InputError
from contact.interface.current import Conductor, HeldCurrent
from contact.interface.friction import Friction, NodalFriction
from contact.interface.history import SlipHistory
from contact.interface.layer import Layer
from contact.interface.links import Links, make_links
from contact.interface.mortar.coupling import Coupling
from contact.interface.mortar.lumping import Mixing
from contact.interface.nodes import ContactNodes
from contact.interface.piecewise import (
    ConductivityPieces,
    FrictionPieces,
    Pieces,
    PointwisePieces,
    SmoothingPieces,
)
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

#: What an obstacle has that has none of these.
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
        What acts there.
    held
        The current through nodes of the part that cannot move; None without.
    coupling
        What is opposite of the nodes, where that is another body; None for a rigid foundation.
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
        How those that follow move with the global unknowns (`contact.body.masters`).

    Raises
    ------
    InputError
        If two entries share nodes, or a node is on both sides of pairs of bodies.
    """
    _check_apart(entries)
    nodes = _side_by_side([entry.nodes for entry in entries])
    given = [entry.coupling or entry.mixing for entry in entries]
    rows = [jumps for jumps in given if jumps is not None]
    links = make_links(nodes.comm, index_map, rows, nodes.nodes, free)
    return replace(nodes, links=links, carried=_carried(nodes, links, ties, free))


def _carried(
    nodes: ContactNodes, links: Links | None, ties: sparse.csr_array, free: NDArray[np.bool_]
) -> Array | None:
    """Return how nodes move with the global unknowns where no jump changes. Collective."""
    if nodes.motion is None or links is None:
        return nodes.motion
    carried = nodes.motion.copy()
    for k, column in enumerate(ties.toarray().T):
        beside = links.apply(column.reshape(free.shape))
        carried[links.places, :, k] -= beside * free[nodes.nodes[links.places]]
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
        law = FrictionPieces(every, bounds, "Friction: law" if own else "Friction: mu")
    return NodalFriction(law, SmoothingPieces(smoothing, bounds), SlipHistory.rest(nodes))


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
        PointwisePieces(tuple(layer.p_nu for layer in layers), bounds, "layer: p_nu"),
        PointwisePieces(tuple(layer.h_nu for layer in layers), bounds, "layer: h_nu"),
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
        ConductivityPieces(
            tuple(conductor.psi for conductor in conductors), bounds, "Conductor: psi"
        ),
        np.repeat([conductor.phi_f for conductor in conductors], np.diff(bounds)),
        PointwisePieces(
            tuple(conductor.phi_l for conductor in conductors), bounds, "Conductor: phi_l"
        ),
        _alike([conductor.lagged for conductor in given if conductor is not None]),
        phi_f if moving else None,
    )


def joined_held(entries: Sequence[Entry], begin: int, links: Links | None) -> HeldCurrent | None:
    """Return the current through the held nodes of all entries.

    Parameters
    ----------
    entries
        The entries.
    begin
        Global number of the first node of this rank.
    links
        Jumps that are no nodal values.
    """
    given = [entry.held for entry in entries if entry.held is not None]
    if not given:
        return None
    nodes = _side_by_side([held.jump for held in given])
    if links is not None:
        nodes = replace(nodes, links=links.at(nodes.nodes.astype(np.int64) + begin))
    bounds = Pieces.bounds_of(held.jump.nodes.size for held in given)
    conductor = _joined_conductors([held.conductor for held in given], bounds)
    assert conductor is not None
    return replace(given[0], jump=nodes, conductor=conductor)


def _bounds(entries: Sequence[Entry]) -> tuple[int, ...]:
    return Pieces.bounds_of(entry.nodes.nodes.size for entry in entries)


def _alike(lagged: Sequence[bool]) -> bool:
    if len(set(lagged)) > 1:
        raise InputError("contact: lagged is true for some and false for others; accepted: one way")
    return lagged[0]
