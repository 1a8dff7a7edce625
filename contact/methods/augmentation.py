"""The augmentation r of (3.34): a value that fits a body, what it adds and what it acts on."""

from __future__ import annotations

import math

import numpy as np

from contact.interface.interface import Interface
from contact.interface.jump import Jump
from contact.problem.scales import Scales
from contact.typing import Array


def automatic_r(scales: Scales) -> float:
    """Return r* = 1.39 E'/sqrt(h H), the geometric mean of the Steklov spectrum's ends.

    E' = E/(1 - nu^2); h is the spacing of the contact nodes and H the volume of the body over
    the area of Gamma_3. Good to a factor of a few, which acceleration makes up for.
    """
    return 1.39 * scales.plane_modulus / math.sqrt(scales.spacing * scales.height)


def augmentation(jump: Jump, r: float, friction: bool) -> Array:
    """Return the nodal blocks of r u_nu v_nu [+ r u_tau v_tau], without weights, (n, bs, bs)."""
    n, d = jump.normal.shape
    blocks = np.zeros((n, jump.block_size, jump.block_size))
    blocks[:, :d, :d] = jump.normal[:, :, None] * jump.normal[:, None, :]
    if friction:
        blocks[:, :d, :d] += jump.tangent
    return r * blocks


def split(interface: Interface, nodal: Array, friction: bool) -> Array:
    """Return normal displacements and what slips side by side, shape (n, 1 + d).

    Without friction the slips are no unknowns of the relaxation, and 0 here.
    """
    parts = components(interface.jump, nodal, friction)
    parts[:, 1:] -= friction * interface.friction.history.jump
    return parts


def components(jump: Jump, nodal: Array, friction: bool) -> Array:
    """Return normal and tangential displacements side by side, shape (n, 1 + d); as `split`."""
    tangential = friction * jump.tangential_component(nodal)
    return np.column_stack([jump.normal_component(nodal), tangential])
