"""How large the deformation is, beside what linear kinematics is made for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from ufl.core.expr import Expr

from contact.body.equilibrium import BodyEquilibrium
from contact.typing import Array
from forms.kinematics import strain


@dataclass(frozen=True)
class Deformation:
    """Extremes over the middles of the cells.

    Attributes
    ----------
    largest_strain
        |eps|, the Frobenius norm.
    least_volume, largest_volume
        det(I + grad u), a deformed volume over the one at rest.
    """

    largest_strain: float
    least_volume: float
    largest_volume: float


def deformation(body: BodyEquilibrium, x: Array) -> Deformation:
    """Return how large the deformation is. Collective.

    Parameters
    ----------
    body, x
        The body, and its local unknowns.
    """
    mesh, kinematics = body.domain.mesh, body.domain.kinematics
    nodal, middle = body.nodal(x).ravel(), np.full((1, body.dim), 1 / (body.dim + 1))

    def measures(at: fem.Function) -> Expr:
        u, _ = body.split(at)
        eps, stretch = strain(u, kinematics), ufl.Identity(3) + kinematics.gradient(u)
        return ufl.as_vector([ufl.sqrt(ufl.inner(eps, eps)), ufl.det(stretch)])

    cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)
    extremes = np.array([0.0, -np.inf, -np.inf])
    for _, found in body.pointwise.values("deformation", measures, middle, nodal, cells):
        size, volume = found[:, 0].T
        here = [size.max(initial=0.0), (-volume).max(initial=-np.inf), volume.max(initial=-np.inf)]
        extremes = np.maximum(extremes, here)
    body.comm.Allreduce(MPI.IN_PLACE, extremes, op=MPI.MAX)
    return Deformation(float(extremes[0]), float(-extremes[1]), float(extremes[2]))
