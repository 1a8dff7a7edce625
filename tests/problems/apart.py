"""Blocks beside each other, connected by nothing: each has its own loads and its own solution."""

from collections.abc import Sequence

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact import Body, Contact, Domain, Fixed, Friction, Load
from contact._compat import geometry_dofmap
from contact.mesh.domain import from_mesh
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.mechanics import flat
from tests.problems.meshes import assembled


def blocks(comm: MPI.Intracomm, heights: Sequence[float] = (1.0, 3.0), n: int = 4) -> Domain:
    """Return blocks of width 1 at x = 0, 2, ...: `bottom`, `held` (left), `top0`, `top1`, ..."""
    points, cells = np.zeros((0, 2)), np.zeros((0, 3), dtype=np.int64)
    for k, height in enumerate(heights):
        corners = [[2.0 * k, 0.0], [2.0 * k + 1, height]]
        block = dmesh.create_rectangle(MPI.COMM_SELF, corners, [n, round(n * height)])
        cells = np.concatenate([cells, geometry_dofmap(block) + len(points)])
        points = np.concatenate([points, block.geometry.x[:, :2]])
    mesh = assembled(comm, points, cells)

    def top(k, height):
        return lambda x: (np.abs(x[1] - height) < 1e-9) & (np.abs(x[0] - 2 * k - 0.5) < 0.6)

    parts = {
        "bottom": lambda x: np.abs(x[1]) < 1e-9,
        "held": lambda x: np.abs(x[0] / 2 - np.round(x[0] / 2)) < 1e-9,
        **{f"top{k}": top(k, height) for k, height in enumerate(heights)},
    }
    return from_mesh(mesh, parts, 2)


def pressed(
    domain: Domain, *tractions: float, mu: float = 0.3, gap: float = 0.0, rigid=None, **of_body
):
    """Return the problem of blocks on a foundation, pressed by a traction each."""
    loads = [Load(f"top{k}", traction=[0.0, -size]) for k, size in enumerate(tractions)]
    body = Body(Linear(1.0, 0.3), loads=loads, **{"fixed": Fixed("held", [0.0, 0.0]), **of_body})
    friction = Friction(ConstantCoefficient(mu)) if mu > 0 else Friction()
    return ContactProblem(domain, body, Contact("bottom", flat(gap), rigid=rigid), friction)
