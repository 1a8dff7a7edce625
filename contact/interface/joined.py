"""Several contacts of one problem: their nodes as one array, their laws as one law.

All laws of Gamma_3 act node by node. The nodes of one contact follow each other in the array, and
each law of a group acts on its own nodes. The interface (`contact.interface.interface`), which is
built on it, knows no number of contacts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy import sparse

from contact.arguments import naming, real
from contact.body.equilibrium import BodyEquilibrium
from contact.errors import InputError
from contact.interface.friction import NodalFriction, law_at
from contact.interface.law import InterfaceLaw
from contact.interface.mortar.operator import CouplingOperator, coupling_operator
from contact.interface.multipliers import SlipHistory
from contact.interface.nodes import ContactNodes, Geometry
from contact.interface.smoothing import Smoothing
from contact.linear.layout import Inclined, projectors
from contact.model.foundation import Conductor, Layer
from contact.model.friction import Friction
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
    def of(laws: Iterable[Any], nodes: Sequence[ContactNodes], label: str = "") -> Any:
        """Return one law of the kind of given ones, those of the nodes of each contact."""
        ends = np.cumsum([0, *(piece.nodes.size for piece in nodes)])
        return Grouped(tuple(laws), tuple(int(end) for end in ends), label)

    def _at_nodes(self, value: Callable[..., Any], *given: Array, method: str = "") -> Array:
        """Return the values of each law at its own nodes: `value` of the law and its arguments."""
        parts, label = [], f"{self.label}: {method}" if self.label and method else self.label
        for law, (begin, end) in zip(self.laws, pairwise(self.bounds), strict=True):
            with naming(label) if label else nullcontext():
                values = value(law, *(argument[begin:end] for argument in given))
                parts.append(real(values, (end - begin,), "one number for each node"))
        return np.concatenate(parts) if len(parts) > 1 else parts[0]

    def __call__(self, *given: Any) -> Any:
        """Return s(|u_tau|, p), p_nu, h_nu, phi_L, or the smoothed pressure R p."""
        return self._at_nodes(lambda law, *own: law(*own), *given)

    def derivative(self, s: Any) -> Any:
        """Return the derivative of a law of one argument."""
        return self._at_nodes(lambda law, s: law.derivative(s), s, method="derivative")

    def by_slip(self, slip: Any, pressure: Any) -> Any:
        """Return the derivative of a friction law by the slip."""
        return self._at_nodes(
            lambda law, slip, p: law.by_slip(slip, p), slip, pressure, method="by_slip"
        )

    def by_pressure(self, slip: Any, pressure: Any) -> Any:
        """Return the derivative of a friction law by the pressure."""
        return self._at_nodes(
            lambda law, slip, p: law.by_pressure(slip, p), slip, pressure, method="by_pressure"
        )

    def transposed(self, values: Array) -> Array:
        """Return the transpose of R on nodal values."""
        return self._at_nodes(lambda smoothing, own: smoothing.transposed(own), values)

    def at(self, s: Any, pressed: Any, loaded: Any) -> Any:
        """Return the conductivity psi."""
        return self._at_nodes(lambda psi, *own: psi.at(*own), s, pressed, loaded, method="at")

    def gap_slope(self, s: Any, pressed: Any) -> Any:
        """Return the derivative of psi by the gap."""
        return self._at_nodes(lambda psi, *own: psi.gap_slope(*own), s, pressed, method="gap_slope")

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


#: Laws of an obstacle without friction, layer or current.
NO_FRICTION = Coulomb(ConstantCoefficient(0.0))
NO_LAYER = Layer(0.0, Compliance(np.inf), PotentialFactor(0.0))
NO_CONDUCTOR = Conductor(PerfectConductivity(0.0), 0.0, Truncation(np.inf))


def joined_nodes(
    geometries: Sequence[Geometry], parts: Sequence[str], body: BodyEquilibrium
) -> ContactNodes:
    """Return the nodes of all contacts, one contact after the other. Collective.

    Parameters
    ----------
    geometries, parts
        Of each contact, and the names of the parts that the nodes are of.
    body
        The bodies.

    Raises
    ------
    InputError
        If two contacts share nodes, a node is on both sides of pairs of bodies, or one whose jump
        is a sum is on a roller.
    """
    _refuse_shared(geometries, parts)
    nodes = _side_by_side([geometry.nodes for geometry in geometries])
    inclined = body.layout.inclined
    jumps = [geometry.jumps for geometry in geometries if geometry.jumps is not None]
    there = None if inclined is None else inclined.at(nodes.nodes)
    # The unknowns by their jumps: free components, the normal one of which is that of the unknowns,
    # of which the `admissible_normal` stands for that of the components that supports hold.
    unknowns, d = projectors(body.free[nodes.nodes], there), nodes.dim
    fixed = nodes.normal - np.einsum("nij,nj->ni", unknowns[:, :d, :d], nodes.normal)
    unknowns[:, :d, :d] += nodes.admissible_normal[:, :, None] * fixed[:, None, :]
    at_nodes = nodes.nodes, unknowns
    coupling = coupling_operator(nodes.comm, body.layout.index_map, jumps, at_nodes, body.free)
    if coupling is not None and inclined is not None:
        _refuse_rollers(nodes, coupling, inclined)
    carried = _carried(nodes, coupling, body.global_unknowns.ties, unknowns)
    return replace(nodes, coupling=coupling, carried=carried)


def _refuse_rollers(nodes: ContactNodes, coupling: CouplingOperator, inclined: Inclined) -> None:
    """Refuse jumps of several nodes, which have no common direction, on rollers. Collective."""
    shared = bool(np.isin(coupling.local, inclined.nodes).any())
    if not nodes.comm.allreduce(shared, op=MPI.LOR):
        return
    contact = "contact of degree 2 in 3-D"
    if coupling.between:
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


def _refuse_shared(geometries: Sequence[Geometry], parts: Sequence[str]) -> None:
    """Refuse contacts that share nodes. Collective."""
    every = np.concatenate([geometry.nodes.nodes for geometry in geometries])
    shared = every.size - np.unique(every).size
    if geometries[0].nodes.comm.allreduce(shared, op=MPI.SUM) > 0:
        raise InputError(
            f"contact: the parts {', '.join(parts)} share nodes, which one obstacle alone can "
            "hold; accepted: parts without common nodes, such as pieces of a side with a gap "
            "between",
            "contacts-meet",
        )


def _side_by_side(pieces: Sequence[ContactNodes]) -> ContactNodes:
    """Return the nodes of several contacts as one array."""

    def every(values: Callable[[ContactNodes], Any]) -> Any:
        return np.concatenate([values(nodes) for nodes in pieces])

    first = pieces[0]
    return replace(
        first,
        nodes=every(lambda nodes: nodes.nodes),
        points=every(lambda nodes: nodes.points),
        weight=every(lambda nodes: nodes.weight),
        normal=every(lambda nodes: nodes.normal),
        admissible_normal=every(lambda nodes: nodes.admissible_normal),
        tangent=every(lambda nodes: nodes.tangent),
        gap=every(lambda nodes: nodes.gap),
        deviation=every(lambda nodes: nodes.deviation),
        motion=None if first.motion is None else every(lambda nodes: nodes.motion),
        cut=max(nodes.cut for nodes in pieces),
    )


def joined_friction(
    frictions: Sequence[Friction], geometries: Sequence[Geometry], nodes: ContactNodes
) -> NodalFriction:
    """Return friction at the nodes of all contacts, joined before. Collective."""
    pieces = [geometry.nodes for geometry in geometries]
    pairs = list(zip(frictions, pieces, strict=True))
    smoothing = Grouped.of((Smoothing(own, given.radius) for given, own in pairs), pieces)
    laws, law = [law_at(given, own) for given, own in pairs], None
    if any(laws):
        every = [NO_FRICTION if own is None else own for own in laws]
        user = any(hasattr(given.mu, "by_slip") for given in frictions)
        law = Grouped.of(every, pieces, "Friction: law" if user else "Friction: mu")
    return NodalFriction(law, smoothing, SlipHistory.rest(nodes))


def joined_layers(given: Sequence[Layer | None], geometries: Sequence[Geometry]) -> Layer | None:
    """Return the layers of all contacts as one; None where there is none."""
    if not any(given):
        return None
    pieces, layers = [geometry.nodes for geometry in geometries], [own or NO_LAYER for own in given]
    return Layer(
        np.repeat([own.thickness for own in layers], [piece.nodes.size for piece in pieces]),
        Grouped.of((own.p_nu for own in layers), pieces, "layer: p_nu"),
        Grouped.of((own.h_nu for own in layers), pieces, "layer: h_nu"),
        _alike([own.lagged for own in given if own is not None]),
    )


def joined_conductors(
    given: Sequence[Conductor | None], pieces: Sequence[ContactNodes]
) -> Conductor | None:
    """Return the conductors of all contacts as one, given their nodes; None where there is none."""
    if len(given) == 1 or not any(given):
        return given[0]
    conductors = [own or NO_CONDUCTOR for own in given]
    sizes = [piece.nodes.size for piece in pieces]

    def phi_f(time: float) -> Array:
        """Return the potentials of the foundations at a time."""
        return np.repeat([float(own.at(time).phi_f) for own in conductors], sizes)

    moving = any(own.phi_f_at is not None for own in conductors)
    return Conductor(
        Grouped.of((own.psi for own in conductors), pieces, "Conductor: psi"),
        np.repeat([own.phi_f for own in conductors], sizes),
        Grouped.of((own.phi_l for own in conductors), pieces, "Conductor: phi_l"),
        _alike([own.lagged for own in given if own is not None]),
        phi_f if moving else None,
    )


def joined_constrained(
    given: Sequence[Conductor | None], geometries: Sequence[Geometry], law: InterfaceLaw, begin: int
) -> InterfaceLaw | None:
    """Return the law at the constrained nodes of all contacts; None without conductors.

    Parameters
    ----------
    given, geometries, law
        The conductors, the geometries, and the law at contact nodes.
    begin
        Global number of the first node of this rank.
    """
    there = [
        (geometry.constrained, own)
        for geometry, own in zip(geometries, given, strict=True)
        if geometry.constrained is not None
    ]
    if not there:
        return None
    pieces = [own for own, _ in there]
    nodes = _side_by_side(pieces)
    if law.nodes.coupling is not None:
        coupling = law.nodes.coupling.at(nodes.nodes.astype(np.int64) + begin)
        nodes = replace(nodes, coupling=coupling)
    conductor = joined_conductors([own for _, own in there], pieces)
    return replace(law, nodes=nodes, compliance=None, conductor=conductor)


def _alike(lagged: Sequence[bool]) -> bool:
    """Return the value of all; refuse different ones."""
    if len(set(lagged)) > 1:
        raise InputError(
            "contact: lagged is true for some and false for others; accepted: one way", "lagged"
        )
    return lagged[0]
