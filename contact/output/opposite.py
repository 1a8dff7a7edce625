"""The other side of contacts between bodies: the master side, as a surface.

Multipliers live on one side. On the other one act the forces int N_l lambda, which belong to its
own nodes; divided by the areas of these they are stresses again. A constant pressure is the same
constant there, and forces are the same on both sides.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from contact.interface.entries import Entry
from contact.interface.mortar.coupling import Coupling
from contact.interface.mortar.lumping import Lumping
from contact.interface.mortar.surface import surface_of
from contact.mesh.entities import owned_among
from contact.output.quantities import AGAINST as AGAINST_TABLE
from contact.output.quantities import values_of
from contact.output.solved import Solved
from contact.output.table import Table
from contact.output.vtu import VTU, Grid
from contact.problem.problem import ContactProblem
from contact.typing import Array

#: Name of its files.
AGAINST = "contact-against"

#: Nodes with less than this share of the mean area have none but by rounding.
LEAST_AREA = 1e-9


def opposite_surface(solution: Solved) -> VTU | None:
    """Return the parts `against` with the stresses there, the same on all ranks. Collective.

    Returns
    -------
    The surface, with the displacement, `pressure` and `traction` at its nodes, their normals out
    of the body, their areas, and the number of the contact (`entry`). None where all obstacles are
    rigid.
    """
    problem, d = solution.problem, solution.problem.dim
    body = problem.equilibrium
    places = body.space.tabulate_dof_coordinates()[: body.layout.free.shape[0], :d]
    moved = body.nodal(solution.state.x)[: len(places), :d]
    stresses = np.column_stack([solution.pressure, solution.forces.vectors(problem.nodes)])
    ends = np.cumsum([entry.nodes.nodes.size for entry in problem.entries])[:-1]
    sides, cells, count = [], [], 0
    for i, own in enumerate(np.split(stresses, ends)):
        against, entry = problem.contacts[i].against, problem.entries[i]
        if against is None or entry.coupling is None:
            continue
        surface = surface_of(problem.domain, body.space, against).gathered(problem.comm)
        lumped = Lumping.of(surface)
        acting = _acting(problem, entry, entry.coupling, lumped, own)
        known = _everywhere(problem, lumped.nodes, np.column_stack([places, moved]))
        sides.append(
            {
                "points": known[:, :d],
                "displacement": known[:, d:],
                "pressure": acting[:, 0],
                "traction": acting[:, 1:],
                "normal": lumped.normal / np.linalg.norm(lumped.normal, axis=1)[:, None],
                "weight": lumped.weight,
                "entry": np.full(lumped.nodes.size, i, dtype=np.int32),
            }
        )
        cells.append(count + np.searchsorted(lumped.nodes, surface.nodes))
        count += lumped.nodes.size
    if not sides:
        return None
    fields = {name: np.concatenate([side[name] for side in sides]) for name in sides[0]}
    return VTU(Grid(fields.pop("points"), np.concatenate(cells), d - 1), fields, {})


def _acting(
    problem: ContactProblem, entry: Entry, coupling: Coupling, lumped: Lumping, own: Array
) -> Array:
    """Return the stresses of this rank's contact nodes on the other side, shape (m, k)."""
    names = problem.equilibrium.layout.index_map.local_to_global(entry.nodes.nodes)
    forces = np.zeros((coupling.nodes.size, own.shape[1]))
    forces[np.searchsorted(coupling.nodes, names)] = entry.nodes.weight[:, None] * own
    problem.comm.Allreduce(MPI.IN_PLACE, forces, op=MPI.SUM)
    on_nodes = np.zeros((lumped.nodes.size, own.shape[1]))
    on_nodes[np.searchsorted(lumped.nodes, coupling.masters)] = coupling.other.T @ forces
    if lumped.mixing is not None:
        # Forces on coefficients S u, given those on u.
        on_nodes = splu(lumped.mixing.own.T.tocsc()).solve(on_nodes)
    some = lumped.weight > LEAST_AREA * lumped.weight.mean()
    return np.where(some[:, None], on_nodes / np.where(some, lumped.weight, 1.0)[:, None], np.nan)


def _everywhere(problem: ContactProblem, nodes: NDArray[np.int64], values: Array) -> Array:
    """Return the values of owned nodes at nodes of all ranks, given by global numbers."""
    here, local = owned_among(problem.equilibrium.layout.index_map, nodes)
    found = np.zeros((nodes.size, values.shape[1]))
    found[here] = values[local]
    problem.comm.Allreduce(MPI.IN_PLACE, found, op=MPI.SUM)
    return found


def opposite_table(problem: ContactProblem, surface: VTU) -> Table:
    """Return the rows of ``contact-against.csv``: nodes with an area, contact by contact."""
    fields, size = surface.at_points, problem.domain.size
    # Mesh generators leave coordinates such as -3e-19.
    points = np.where(np.abs(surface.grid.points) < 1e-15 * size, 0.0, surface.grid.points)
    names = np.array([contact.against or "" for contact in problem.contacts])
    columns = values_of(AGAINST_TABLE, {"on": names[fields["entry"]], "x": points, **fields})
    rounded = np.round(points / (1e-9 * size))
    order = np.lexsort((*rounded.T[::-1], fields["entry"]))
    order = order[np.isfinite(columns["pressure"][order])]
    return {name: values[order] for name, values in columns.items()}
