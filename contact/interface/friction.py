"""Friction on Gamma_3: its bound at the contact nodes, (1.36)-(1.38), and the non-local operator R.

R is a mollifier as in section 1.4.3 of the thesis, in a normalised variant: there the integral of
the kernel over the line is 1, here the sum over the contact nodes in the radius of each node.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.spatial import cKDTree

from contact.arguments import (
    PRESSURES,
    SAMPLES,
    check_finite,
    check_slope,
    expect,
    naming,
    real,
    sampled,
)
from contact.errors import InputError
from contact.interface.grouping import Grouped, GroupedFriction
from contact.interface.multipliers import SlipHistory
from contact.interface.nodes import ContactNodes, Geometry
from contact.linear.layout import times
from contact.model.fields import Field, Moving, values_at
from contact.model.formula import Expression
from contact.model.friction import Friction
from contact.ranks import neighbours, on_all_ranks
from contact.typing import Array
from forms.laws import (
    ConstantCoefficient,
    Coulomb,
    FrictionLaw,
    Tresca,
)

#: Angles at which omega is taken on a ring; it is smooth.
ANGLES = 32


class Smoothing:
    """(R p)(x) = sum_j omega_r(|x - x_j|) w_j p_j / sum_j omega_r(|x - x_j|) w_j.

    omega_r(s) = exp(r^2/(s^2 - r^2)) for s < r, and x_j are the contact nodes of all ranks; the
    radius r = 0 (length) gives the identity. The division makes R reproduce a constant pressure
    exactly, at the ends of Gamma_3 too. On a body of revolution omega is averaged over the rings of
    the nodes x_j.
    """

    def __init__(self, nodes: ContactNodes, radius: float) -> None:
        self.radius = radius
        self._matrix = _mollifier(nodes, radius) if radius > 0 else None

    def __call__(self, values: Array) -> Array:
        """Return R applied to nodal values, shape (n,). Collective."""
        return times(self._matrix, values)

    def transposed(self, values: Array) -> Array:
        """Return R^T applied to nodal values, shape (n,). Collective."""
        return times(self._matrix, values, transposed=True)


class GroupedSmoothing(Grouped[Smoothing]):
    """R of several contacts: the pressure on one obstacle does not bound friction on another."""

    def __call__(self, values: Array) -> Array:
        """Return R applied to nodal values, shape (n,). Collective."""
        return self.at_nodes(lambda smoothing, nodal: smoothing(nodal), values)

    def transposed(self, values: Array) -> Array:
        """Return R^T applied to nodal values, shape (n,). Collective."""
        return self.at_nodes(lambda smoothing, nodal: smoothing.transposed(nodal), values)

    @property
    def radius(self) -> float:
        """The largest radius."""
        return max(smoothing.radius for smoothing in self.laws)


def _mollifier(nodes: ContactNodes, radius: float) -> PETSc.Mat:
    """Return R, its rows and columns divided among the ranks as the nodes are. Collective."""
    count, reach = nodes.nodes.size, radius * (1 - 1e-9)
    first = nodes.comm.scan(count) - count
    numbers = np.arange(first, first + count, dtype=float)
    values = np.column_stack([nodes.points, nodes.weight, numbers])
    near = neighbours(nodes.comm, nodes.points, values, radius)
    points, weight, column = near[:, : nodes.dim], near[:, -2], near[:, -1].astype(PETSc.IntType)
    if count == 0:
        pairs = sparse.coo_array((count, len(near)))
    else:
        pairs = cKDTree(nodes.points).sparse_distance_matrix(
            cKDTree(points), reach, output_type="coo_matrix"
        )
    row, col = pairs.row, pairs.col
    if nodes.revolved:
        omega = _ring_mean(nodes.points[row], points[col], radius)
    else:
        omega = _omega(pairs.data**2, radius)
    total = nodes.comm.allreduce(count)
    part = sparse.csr_array((omega * weight[col], (row, column[col])), (count, total))
    part = sparse.csr_array(sparse.diags_array(1 / part.sum(axis=1)) @ part)
    part.sort_indices()
    csr = (part.indptr.astype(PETSc.IntType), part.indices.astype(PETSc.IntType), part.data)
    mollifier = PETSc.Mat().createAIJ(((count, total), (count, total)), csr=csr, comm=nodes.comm)
    mollifier.assemble()
    return mollifier


def _omega(square: Array, radius: float) -> Array:
    """Return omega at squared distances, up to a constant; 0 from the radius on."""
    share = (np.sqrt(square) / radius) ** 2
    inside = share < (1 - 1e-9) ** 2
    return np.where(inside, np.exp(1 + 1 / np.where(inside, share - 1, -1)), 0.0)


def _ring_mean(points: Array, others: Array, radius: float) -> Array:
    """Return the means of omega over the rings through other points (r, z), shape (n,)."""
    # At the angle theta |x - x_j|^2 grows by 2 r r_j (1 - cos theta); Gauss's rule where omega > 0.
    square = np.sum((points - others) ** 2, axis=1)
    product = 2 * points[:, 0] * others[:, 0]
    reach = (np.square(radius) - square) / np.where(product > 0, product, np.inf)
    widest = np.where(product > 0, np.arccos(np.clip(1 - reach, -1, 1)), np.pi)
    mean = np.zeros_like(square)
    for node, share in zip(*np.polynomial.legendre.leggauss(ANGLES), strict=True):
        theta = widest * (node + 1) / 2
        mean += share / 2 * _omega(square + product * (1 - np.cos(theta)), radius)
    return mean * widest / np.pi


def law_at(friction: Friction, nodes: ContactNodes) -> FrictionLaw | None:
    """Return the law at contact nodes; None without friction. Collective.

    Refuses bounds and coefficients that are negative or no number at a node, or without slip, and
    wrong derivatives, maxima and Lipschitz constants.
    """
    mu: Any = friction.mu
    if friction.law == "none":
        return None
    if friction.law == "tresca":
        assert friction.bound is not None  # required
        bound = _at("friction.bound", friction.bound, nodes)
        return Tresca(bound) if nodes.maximum(bound) > 0 else None
    if hasattr(mu, "by_slip"):
        with on_all_ranks(nodes.comm):
            _check_law(mu)
        return cast(FrictionLaw, mu)
    if isinstance(mu, Expression) and mu.is_constant:
        return Coulomb(ConstantCoefficient(mu.value)) if mu.value > 0 else None
    if not hasattr(mu, "derivative"):
        nodal_mu = _at("friction.mu", mu, nodes)
        return Coulomb(ConstantCoefficient(nodal_mu)) if nodes.maximum(nodal_mu) > 0 else None
    # Ranks without nodes evaluate the law too: all of them raise its errors.
    zero = np.zeros(3)
    with on_all_ranks(nodes.comm), naming("Friction: mu"):
        resists = real(mu(zero), zero.shape, EACH)
    with on_all_ranks(nodes.comm), naming("Friction: mu: derivative"):
        slope = real(mu.derivative(zero), zero.shape, EACH)
        check_finite(slope, lambda _: "without slip")
    with on_all_ranks(nodes.comm):
        check_slope("Friction: mu: derivative", mu, mu.derivative, SAMPLES)
        _check_constants("Friction: mu", Coulomb(mu))
    _check("Friction: coefficient without slip", resists, nodes)
    most = nodes.comm.allreduce(mu.maximum, op=MPI.MAX)
    return Coulomb(mu) if most > 0 else None


def _check_law(law: FrictionLaw) -> None:
    """Refuse a law with wrong derivatives or constants."""
    slip, pressure = np.tile(SAMPLES, PRESSURES.size), np.repeat(PRESSURES, SAMPLES.size)
    for name, bound, slope, at in (
        ("by_slip", lambda s: law(s, pressure), lambda s: law.by_slip(s, pressure), slip),
        ("by_pressure", lambda p: law(slip, p), lambda p: law.by_pressure(slip, p), pressure),
    ):
        check_slope(f"Friction: law: {name}", bound, slope, at)
    zero = np.zeros(3)
    for name, value in (("s", law), ("by_slip", law.by_slip), ("by_pressure", law.by_pressure)):
        with naming(f"Friction: law: {name}"), np.errstate(all="ignore"):
            check_finite(real(value(zero, zero), zero.shape, EACH), lambda _: "without pressure")
    _check_constants("Friction: law", law)


def _check_constants(name: str, law: FrictionLaw) -> None:
    """Refuse constants that are no numbers >= 0, and a maximum that s/p exceeds at samples."""
    for key in ("maximum", "lipschitz"):
        constant = getattr(law, key)
        fits = isinstance(constant, int | float | np.number) and constant >= 0
        expect(f"{name}: {key}", constant, "a number >= 0, or infinity", fits)
    slip, pressure = np.tile(SAMPLES, PRESSURES.size), np.repeat(PRESSURES, SAMPLES.size)
    bounds = sampled(name, slip.shape, lambda: law(slip, pressure))
    if bounds is not None:
        ratio = bounds[0] / pressure
        least = float(np.nanmin(ratio, initial=0.0))
        if least < 0:
            words = f"{name}: s/p, the coefficient, is {least:.4g} at a sample"
            raise InputError(f"{words}; accepted: values >= 0", "negative")
        largest = float(np.nanmax(ratio, initial=0.0))
        fits = largest <= law.maximum * (1 + 1e-9)
        words = f"an upper bound of s/p, which is {largest:.4g} at a sample"
        expect(f"{name}: maximum", law.maximum, words, fits)


def _at(name: str, field: Field | Moving, nodes: ContactNodes) -> Array:
    """Return a bound or coefficient at contact nodes. Collective."""
    values = values_at(field, nodes.points, 1.0, name, nodes.comm)
    _check(name, values, nodes)
    return values


def _check(name: str, values: Array, nodes: ContactNodes) -> None:
    """Refuse negative values and NaN, on all ranks together. Collective."""
    bad = values[~((values >= 0) & np.isfinite(values))]
    worst = np.concatenate(nodes.comm.allgather(bad[:1]))
    if worst.size > 0:
        raise InputError(
            f"{name} is {worst[0]:g} at a node; accepted: finite values >= 0", "negative"
        )


#: Values of a user's law, in messages.
EACH = "one number for each slip"


@dataclass(frozen=True)
class NodalFriction:
    """Friction at the owned contact nodes, in a step of an evolution.

    Its methods take slips of the step; the law depends on the accumulated slip.
    """

    law: FrictionLaw | None  #: the friction bound, for all nodes at once; None without friction
    smoothing: GroupedSmoothing  #: the operator R (`Smoothing`) of each contact
    history: SlipHistory  #: the slip before the step

    @property
    def acts(self) -> bool:
        """Whether a tangential force can act."""
        return self.law is not None

    @property
    def local(self) -> bool:
        """Whether the bound at a node depends on the values there alone: R = identity."""
        return self.smoothing.radius == 0

    def _accumulated(self, slip: Array) -> Array:
        """Return the accumulated slip at the end of a step with this slip, shape (n,)."""
        return self.history.accumulated + slip

    def bound(self, slip: Array, pressure: Array) -> Array:
        """Return s of (3.7), by Coulomb's law mu max(R p, 0), shape (n,). Collective."""
        if self.law is None:
            return np.zeros_like(slip)
        return np.asarray(self.law(self._accumulated(slip), self.smooth(pressure)), dtype=float)

    def by_slip(self, slip: Array, pressure: Array) -> Array:
        """Return the derivative of the bound by the slip, shape (n,). Collective."""
        if self.law is None:
            return np.zeros_like(slip)
        return np.asarray(
            self.law.by_slip(self._accumulated(slip), self.smooth(pressure)), dtype=float
        )

    def by_pressure(self, slip: Array, pressure: Array) -> Array:
        """Return the derivative of the bound by the pressure at the node, shape (n,).

        0 where p < 0, for s is a function of max(p, 0); and 0 for a smoothed pressure: it would
        couple all nodes within the radius, and is left out.
        """
        if self.law is None or not self.local:
            return np.zeros_like(slip)
        rate = self.law.by_pressure(self._accumulated(slip), self.smooth(pressure))
        return np.where(pressure >= 0, np.asarray(rate, dtype=float), 0.0)

    def largest_bound(self, pressure: Array, nodes: ContactNodes) -> Array:
        """Return an upper bound of s for pressures up to given ones, shape (n,). Collective.

        Infinite without one: `maximum` times the pressure, of all nodes where it is smoothed.
        """
        if self.law is None:
            return np.zeros_like(pressure)
        reached = pressure if self.local else np.full_like(pressure, nodes.maximum(pressure))
        assert isinstance(self.law, GroupedFriction)
        return self.law.largest(reached)

    def smooth(self, pressure: Array) -> Array:
        """Return max(R p, 0), shape (n,): of an iterate R p may be negative. Collective."""
        return np.maximum(self.smoothing(pressure), 0.0)


#: Law of an obstacle without friction.
NO_FRICTION = Coulomb(ConstantCoefficient(0.0))


def joined_friction(
    frictions: Sequence[Friction], geometries: Sequence[Geometry], nodes: ContactNodes
) -> NodalFriction:
    """Return friction at the nodes of all contacts, joined before. Collective."""
    groups = [geometry.nodes for geometry in geometries]
    pairs = list(zip(frictions, groups, strict=True))
    smoothing = GroupedSmoothing.of(
        (Smoothing(group, friction.radius) for friction, group in pairs), groups
    )
    laws, law = [law_at(friction, group) for friction, group in pairs], None
    if any(laws):
        filled = [NO_FRICTION if law is None else law for law in laws]
        law = GroupedFriction.of(filled, groups)
    return NodalFriction(law, smoothing, SlipHistory.rest(nodes))
