"""Residuals of the contact and the friction law."""

from __future__ import annotations

import numpy as np

from contact.interface.interface import Interface
from contact.interface.multipliers import Multipliers
from contact.interface.projections import project_disc, project_half_line
from contact.tolerances import EPS
from contact.typing import Array


def interface_residuals(
    interface: Interface,
    nodal: Array,
    forces: Multipliers,
    bound: Array,
    rounding: Array | float = 0.0,
) -> tuple[float, float]:
    """Return the relative contact and friction residuals at nodal unknowns. Collective.

    Each piece of the body has its own, relative to what presses it; the largest are returned.

    Parameters
    ----------
    interface, nodal, forces, bound
        The laws, unknowns and contact forces at the nodes, and the friction bound, shape (n,).
    rounding
        Norm of pressures in L2(Gamma_3) that nothing can tell from zero, of each piece: both are
        less it.
    """
    # What a gap between neighbouring nodes costs is E/h: where a body is that long only because its
    # cells are stretched, E/size hides errors of the pressure far above the tolerance.
    c = interface.elongation * interface.stiffness
    opening = interface.opening(nodal)
    contact = forces.pressure - project_half_line(forces.pressure + c * opening)
    # What friction has along the normal is against the law wherever a node sticks or slips.
    trial = interface.jump.tangential_component(forces.friction) + c * interface.slip(nodal)
    friction = forces.friction - project_disc(trial, bound)
    friction[np.isnan(bound)] = np.nan  # nothing is beyond what is no number
    # Where next to nothing presses, rounding is compared with the stress that closing would take,
    # but not of gaps far wider than nodes move: these say nothing of the loads.
    before = np.linalg.norm(interface.friction.history.jump, axis=1)
    way = np.maximum(np.linalg.norm(nodal[:, : interface.dim], axis=1), before)
    closing = interface.stiffness * interface.norms(
        np.minimum(np.minimum(np.abs(opening), way), interface.size)
    )
    scale = np.maximum(interface.norms(interface.pressure(nodal, forces)), 1e-4 * closing)
    scale = np.maximum(scale, EPS * scale.max())
    norms = np.array([interface.norms(contact), interface.norms(friction)])
    left = (norms - np.minimum(norms, rounding)) / np.where(scale > 0, scale, 1.0)
    contact_left, friction_left = left.max(axis=1)
    return float(contact_left), float(friction_left)
