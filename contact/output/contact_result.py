"""The contact nodes of a solution as arrays, and as functions on the contact surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from numpy.typing import NDArray
from scipy.spatial import KDTree

from contact.errors import InputError
from contact.output.solved import Solved
from contact.output.surface import slip_and_friction
from contact.output.table import contact_table
from contact.problem.problem import ContactProblem
from contact.typing import Array


@dataclass(frozen=True, eq=False, repr=False)
class ContactResult:
    """The contact nodes of all ranks, on each of them, in the order of ``contact.csv``.

    Attributes
    ----------
    points
        Places at rest, shape (n, d) (length).
    weight
        Area that each node stands for, shape (n,).
    normal
        Contact direction, out of the body, shape (n, d).
    gap, opening
        Distance to the foundation along it at rest, and now, shape (n,) (length).
    pressure
        Contact pressure -sigma_nu, shape (n,) (stress).
    traction
        What the body exerts on the foundation, shape (n, d) (stress).
    friction_bound
        Shape (n,) (stress).
    slip
        Tangential displacement, shape (n, d) (length).
    status
        "open", "stick" or "slip", shape (n,).
    potential, charge
        Of a piezoelectric body: potential, and charge that leaves through the foundation, shape
        (n,); else None.
    """

    points: Array
    weight: Array
    normal: Array
    gap: Array
    opening: Array
    pressure: Array
    traction: Array
    friction_bound: Array
    slip: Array
    status: NDArray[Any]
    potential: Array | None
    charge: Array | None
    _problem: ContactProblem

    def __repr__(self) -> str:
        """Return how many nodes there are, and how many of them touch."""
        closed = np.count_nonzero(self.status != "open")
        largest = self.pressure.max(initial=0.0)
        return (
            f"<ContactResult: {self.status.size} nodes, {closed} in contact, pressure up to "
            f"{largest:.4g}>"
        )

    def function(self, name: str) -> fem.Function:
        """Return one of the arrays as a function on a mesh of the contact surface. Collective.

        It is NaN at nodes that are held, and hence no contact nodes.

        Parameters
        ----------
        name
            For instance "pressure" or "traction".

        Raises
        ------
        InputError
            If there is no such array of numbers.
        """
        arrays = {k: v for k, v in vars(self).items() if isinstance(v, np.ndarray)}
        known = {k: v for k, v in arrays.items() if v.dtype.kind == "f"}
        if name not in known:
            raise InputError(f"contact.function({name!r}): accepted: {', '.join(known)}")
        values = known[name]
        domain, degree = self._problem.domain, self._problem.equilibrium.degree
        parts = [domain.facets(contact.on) for contact in self._problem.contacts]
        surface = dmesh.create_submesh(
            domain.mesh, domain.dim - 1, np.unique(np.concatenate(parts))
        )[0]
        space = fem.functionspace(surface, ("Lagrange", degree, values.shape[1:]))
        made = fem.Function(space, name=name)
        places = space.tabulate_dof_coordinates()[:, : domain.dim]
        distance, nearest = KDTree(self.points).query(places)
        found = np.where(distance < 1e-9 * domain.size, nearest, -1)
        rows = np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])[found]
        made.x.array[:] = rows.ravel()
        return made


def contact_result(solution: Solved) -> ContactResult:
    """Return the contact nodes of all ranks. Collective."""
    problem = solution.problem
    table: Mapping[str, NDArray[Any]] = problem.comm.bcast(contact_table(solution))
    axes = "xyz"[: problem.dim]
    normal = np.column_stack([table[f"nu_{axis}"] for axis in axes])
    slip, friction = slip_and_friction(table, normal)
    return ContactResult(
        points=np.column_stack([table[axis] for axis in axes]),
        weight=table["weight"],
        normal=normal,
        gap=table["gap"],
        opening=table["gap"] - table["u_n"],
        pressure=table["pressure"],
        traction=table["pressure"][:, None] * normal + friction,
        friction_bound=table["bound"],
        slip=slip,
        status=table["status"],
        potential=table.get("phi"),
        charge=table.get("d_n"),
        _problem=problem,
    )
