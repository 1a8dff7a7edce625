"""Bodies of revolution: the mesh is their half plane, x the radius and y the axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.typing import Array

#: Nodes nearer to the axis than this, in units of the size of the body, are on it.
ON_AXIS = 1e-9


def on_axis(domain: Domain, points: Array) -> NDArray[np.bool_]:
    """Return which points, shape (n, 2), lie on the axis of a body of revolution."""
    return np.asarray(np.abs(points[:, 0]) <= ON_AXIS * domain.size)


def revolved(domain: Domain) -> Domain:
    """Return the body of revolution whose half plane a domain is. Collective.

    Nodes that lie on the axis up to rounding are moved onto it.

    Raises
    ------
    InputError
        If the mesh is not plane, or lies on the other side of the axis.
    """
    if domain.dim != 2:
        raise InputError(
            'space.kinematics: "axisymmetric" with a mesh in space; accepted: a mesh in the plane, '
            "x the radius and y the axis"
        )
    radius = domain.mesh.geometry.x[:, 0]
    least = domain.comm.allreduce(float(radius.min(initial=np.inf)), op=MPI.MIN)
    if least < -ON_AXIS * domain.size:
        raise InputError(
            f'space.kinematics: "axisymmetric", and the mesh goes to x = {least:.4g}; accepted: '
            "a mesh with x >= 0, the half plane of the body"
        )
    radius[on_axis(domain, domain.mesh.geometry.x)] = 0.0
    return replace(domain, revolved=True)
