"""The laws of several contacts as one law, each acting on its own nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Generic, Self, TypeVar

import numpy as np

from contact.errors import InputError
from contact.interface.foundation import FoundationLaw
from contact.interface.nodes import ContactNodes, Geometry, side_by_side
from contact.model.foundation import Conductor, Layer
from contact.typing import Array
from forms.laws import (
    Compliance,
    Conductivity,
    FrictionLaw,
    PenetrationLaw,
    PerfectConductivity,
    PotentialFactor,
    PotentialLaw,
    StiffnessLaw,
    Tresca,
    Truncation,
)
from forms.ops import Value

LawType = TypeVar("LawType")


@dataclass(frozen=True)
class Grouped(Generic[LawType]):
    """Laws of groups of nodes; values are those of each law at its own nodes."""

    laws: tuple[LawType, ...]  #: the law of each group
    offsets: tuple[int, ...]  #: where the groups begin on this rank, and the number of all nodes

    @classmethod
    def of(cls, laws: Iterable[LawType], nodes: Sequence[ContactNodes]) -> Self:
        """Return the laws of the nodes of each contact as one."""
        ends = np.cumsum([0, *(group.nodes.size for group in nodes)])
        return cls(tuple(laws), tuple(int(end) for end in ends))

    def at_nodes(self, value: Callable[..., Value], *arguments: Array) -> Array:
        """Return the values of each law at its own nodes: `value` of the law and its arguments."""
        parts = []
        for law, (begin, end) in zip(self.laws, pairwise(self.offsets), strict=True):
            values = value(law, *(argument[begin:end] for argument in arguments))
            parts.append(np.broadcast_to(np.asarray(values, dtype=float), (end - begin,)))
        return np.concatenate(parts)


class GroupedLaw(Grouped[PenetrationLaw | StiffnessLaw | PotentialLaw]):
    """p_nu, h_nu or phi_L of several contacts."""

    def __call__(self, s: Any) -> Array:
        """Return the values."""
        return self.at_nodes(lambda law, s: law(s), s)

    def derivative(self, s: Any) -> Array:
        """Return the derivatives."""
        return self.at_nodes(lambda law, s: law.derivative(s), s)


class GroupedConductivity(Grouped[Conductivity]):
    """psi of the charge of several contacts."""

    def at(self, s: Any, pressed: Any, loaded: Any) -> Array:
        """Return psi."""
        return self.at_nodes(lambda psi, *arguments: psi.at(*arguments), s, pressed, loaded)

    def gap_slope(self, s: Any, pressed: Any) -> Array:
        """Return the derivative of psi by the gap."""
        return self.at_nodes(lambda psi, *arguments: psi.gap_slope(*arguments), s, pressed)

    @property
    def k_e(self) -> float:
        """The largest value of psi."""
        return max(psi.k_e for psi in self.laws)

    @property
    def delta(self) -> float:
        """Slope of the steepest ramp over k_e (1/length), of those that follow the gap."""
        ramps = [psi.delta for psi in self.laws if psi.follows_gap]
        return max(ramps, default=np.inf)

    @property
    def follows_gap(self) -> bool:
        """Whether one depends on the gap."""
        return any(psi.follows_gap for psi in self.laws)


class GroupedFriction(Grouped[FrictionLaw]):
    """The friction bound s(|u_tau|, p) of several contacts."""

    def __call__(self, slip: Any, pressure: Any) -> Array:
        """Return s."""
        return self.at_nodes(lambda law, slip, p: law(slip, p), slip, pressure)

    def by_slip(self, slip: Any, pressure: Any) -> Array:
        """Return the derivative by the slip."""
        return self.at_nodes(lambda law, slip, p: law.by_slip(slip, p), slip, pressure)

    def by_pressure(self, slip: Any, pressure: Any) -> Array:
        """Return the derivative by the pressure."""
        return self.at_nodes(lambda law, slip, p: law.by_pressure(slip, p), slip, pressure)

    def largest(self, pressure: Array) -> Array:
        """Return upper bounds of s for pressures up to given ones; infinite without one."""

        def most(law: FrictionLaw, nodal_pressure: Array) -> Value:
            if isinstance(law, Tresca):
                return law.bound
            resists = (nodal_pressure > 0) & (law.maximum > 0)
            return np.multiply(
                law.maximum, nodal_pressure, out=np.zeros_like(nodal_pressure), where=resists
            )

        return self.at_nodes(most, pressure)

    @property
    def maximum(self) -> float:
        """The largest upper bound of s/p."""
        return max(law.maximum for law in self.laws)

    @property
    def lipschitz(self) -> float:
        """The largest Lipschitz constant of s/p by the slip."""
        return max(law.lipschitz for law in self.laws)


#: Laws of an obstacle without layer or charge.
NO_LAYER = Layer(0.0, Compliance(np.inf), PotentialFactor(0.0))
NO_CONDUCTOR = Conductor(PerfectConductivity(0.0), 0.0, Truncation(np.inf))


def joined_layers(layers: Sequence[Layer | None], geometries: Sequence[Geometry]) -> Layer | None:
    """Return the layers of all contacts as one; None without layers."""
    if not any(layers):
        return None
    groups = [geometry.nodes for geometry in geometries]
    filled = [layer or NO_LAYER for layer in layers]
    return Layer(
        np.repeat([layer.thickness for layer in filled], [group.nodes.size for group in groups]),
        GroupedLaw.of((layer.p_nu for layer in filled), groups),
        GroupedLaw.of((layer.h_nu for layer in filled), groups),
        _alike([layer.lagged for layer in layers if layer is not None]),
    )


def joined_conductors(
    conductors: Sequence[Conductor | None], groups: Sequence[ContactNodes]
) -> Conductor | None:
    """Return the conductors of all contacts as one, on their nodes; None without conductors."""
    if len(conductors) == 1 or not any(conductors):
        return conductors[0]
    filled = [conductor or NO_CONDUCTOR for conductor in conductors]
    sizes = [group.nodes.size for group in groups]

    def phi_f(time: float) -> Array:
        """Return the potentials of the foundations at a time."""
        return np.repeat([float(conductor.at(time).phi_f) for conductor in filled], sizes)

    moving = any(conductor.phi_f_at is not None for conductor in filled)
    return Conductor(
        GroupedConductivity.of((conductor.psi for conductor in filled), groups),
        np.repeat([conductor.phi_f for conductor in filled], sizes),
        GroupedLaw.of((conductor.phi_l for conductor in filled), groups),
        _alike([conductor.lagged for conductor in conductors if conductor is not None]),
        phi_f if moving else None,
    )


def joined_fixed_conducting(
    conductors: Sequence[Conductor | None],
    geometries: Sequence[Geometry],
    law: FoundationLaw,
    begin: int,
) -> FoundationLaw | None:
    """Return the law at the fixed conducting nodes of all contacts; None without conductors.

    `law` is that at the contact nodes, `begin` the global number of the first node of this rank.
    """
    conducting = [
        (geometry.fixed_conducting, conductor)
        for geometry, conductor in zip(geometries, conductors, strict=True)
        if geometry.fixed_conducting is not None
    ]
    if not conducting:
        return None
    groups = [group for group, _ in conducting]
    nodes = side_by_side(groups)
    if law.nodes.coupling is not None:
        coupling = law.nodes.coupling.at(nodes.nodes.astype(np.int64) + begin)
        nodes = replace(nodes, coupling=coupling)
    conductor = joined_conductors([conductor for _, conductor in conducting], groups)
    return replace(law, nodes=nodes, layer=None, conductor=conductor)


def _alike(lagged: Sequence[bool]) -> bool:
    """Return the value of all; refuse different ones."""
    if len(set(lagged)) > 1:
        raise InputError(
            "contact: lagged is true for some and false for others; accepted: one way", "lagged"
        )
    return lagged[0]
