"""The conductive foundation, and the current through nodes that cannot move.

The foundation draws the charge psi(u_nu - rho) phi_L(phi - phi_F), (1.30). A node of Gamma_3
whose displacement is prescribed carries no contact force, but where its potential is free it
lets the current through like any other. Leaving it out would take its share of Gamma_3 from the
electric contact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact.interface.nodes import ContactNodes
from contact.interface.obstacle import Obstacle
from contact.interface.placing import Candidates
from contact.typing import Array
from forms.laws import Conductivity, PotentialLaw, Truncation
from forms.ops import Value


@dataclass(frozen=True)
class Conductor:
    """A conductive foundation at the potential phi_f.

    Attributes
    ----------
    psi
        Conductivity law.
    phi_f
        Potential of the foundation; several conductors as one have one value a node.
    phi_l
        Truncation of the potential difference.
    lagged
        Whether the charge is taken from the previous outer iterate, as Algorithm 4 of the
        thesis does: it then converges for small k_e only (Theorem 5.2). Else phi is implicit,
        as a Robin term in Algorithm 5, and only psi is lagged.
    phi_f_at
        phi_f as a function of time; None where it is always the same.
    """

    psi: Conductivity
    phi_f: Value
    phi_l: PotentialLaw = field(default_factory=lambda: Truncation(np.inf))
    lagged: bool = False
    phi_f_at: Callable[[float], Value] | None = None

    def at(self, time: float) -> Conductor:
        """Return the foundation at a time."""
        return self if self.phi_f_at is None else replace(self, phi_f=self.phi_f_at(time))

    def part(self, part: float) -> Conductor:
        """Return the foundation with a part of its conductivity."""
        return replace(self, phi_l=Part(self.phi_l, part))


@dataclass(frozen=True)
class Part:
    """A share of a law of the potential.

    Attributes
    ----------
    law
        The law.
    part
        From 0 to 1.
    """

    law: PotentialLaw
    part: float

    def __call__(self, s: Value) -> Value:
        """Return the part at potential differences."""
        return self.part * self.law(s)

    def derivative(self, s: Value) -> Value:
        """Return its derivative."""
        return self.part * self.law.derivative(s)


@dataclass(frozen=True)
class HeldCurrent:
    """Owned nodes of Gamma_3 with prescribed displacement and free potential.

    Attributes
    ----------
    jump
        The nodes, as contact nodes. No tangential directions.
    conductor
        The conductive foundation.
    phi_scale
        Unit of the potential in the unknowns, the last of a node.
    """

    jump: ContactNodes
    conductor: Conductor
    phi_scale: float

    def at(self, time: float) -> HeldCurrent:
        """Return the same nodes in front of the foundation at a time."""
        return replace(self, conductor=self.conductor.at(time))

    def _at_nodes(self, x: Array) -> tuple[Array, Array]:
        """Return psi and phi - phi_F for a local dof array. Collective."""
        jump = self.jump
        nodal = jump.apply(x)
        opening = jump.gap - jump.normal_component(nodal)
        # Closed up to the rounding of the prescribed displacement.
        reach = np.abs(jump.gap) + np.linalg.norm(nodal[:, :-1], axis=1)
        closed = opening <= 1e-12 * reach
        # Its displacement is prescribed, not found up to a tolerance: nothing is taken for closed.
        conductivity = self.conductor.psi.at(-opening, np.zeros_like(closed), closed)
        return conductivity, self.phi_scale * nodal[:, -1] - self.conductor.phi_f

    def add_charge(self, into: Array, x: Array, factor: float = 1.0) -> None:
        """Add the charges psi phi_L(phi - phi_F) of nodes, times a factor. Collective.

        Parameters
        ----------
        into
            A local dof array.
        x
            Local unknowns.
        factor
            The factor.
        """
        psi, difference = self._at_nodes(x)
        nodal = np.zeros((difference.size, self.jump.block_size))
        nodal[:, -1] = factor * self.jump.weight * psi * self.conductor.phi_l(difference)
        self.jump.transpose(nodal, into)

    def add_force(self, residual: Array, x: Array) -> None:
        """Add the nodal residuals of the current to a dof array. Collective."""
        self.add_charge(residual, x, -self.phi_scale)

    def slope(self, x: Array) -> Array:
        """Return the derivative of D.nu by the potential at the nodes, psi frozen. Collective."""
        psi, difference = self._at_nodes(x)
        return np.asarray(psi * self.conductor.phi_l.derivative(difference))

    def block(self, x: Array) -> Array:
        """Return the weighted linearisation, (n, block size, block size); 0 if lagged."""
        size = self.jump.block_size
        total = np.zeros((self.jump.nodes.size, size, size))
        if not self.conductor.lagged:
            total[:, -1, -1] = -(self.phi_scale**2) * self.jump.weight * self.slope(x)
        return total


def held_current(
    candidates: Candidates,
    obstacle: Obstacle,
    free: NDArray[np.bool_],
    jump: ContactNodes,
    conductor: Conductor,
    phi_scale: float,
) -> HeldCurrent:
    """Find the nodes of Gamma_3 that are no contact nodes and whose potential is free.

    Parameters
    ----------
    candidates
        All owned nodes of Gamma_3.
    obstacle
        Gives their contact direction and gap.
    free
        Which components of the owned nodes are not fixed, shape (nodes, block size).
    jump, conductor, phi_scale
        The contact nodes, the conductive foundation and the unit of the potential.
    """
    direction, gap = candidates.measure(obstacle)
    gap = candidates.gaps(direction, gap)
    keep = ~np.isin(candidates.nodes, jump.nodes) & free[candidates.nodes, -1] & np.isfinite(gap)
    keep &= candidates.weight > 0
    held = replace(
        jump,
        nodes=candidates.nodes[keep],
        points=candidates.points[keep],
        weight=candidates.weight[keep],
        normal=direction[keep],
        tangent=np.zeros((np.count_nonzero(keep), jump.dim, jump.dim)),
        gap=gap[keep],
        motion=None,
        held=None,
    )
    return HeldCurrent(held, conductor, phi_scale)
