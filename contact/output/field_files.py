"""The files of fields."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from dolfinx import fem, has_adios2, io

from contact.output.disk import OVERHEAD, claim_room, closing, library_errors
from contact.output.fields import DerivedFields, linear, unknowns
from contact.output.solution import Solution


def write_fields(solution: Solution, folder: Path) -> None:
    """Write ``fields.bp`` and ``cells.bp``, or ``fields.xdmf``. Collective.

    ``fields.bp`` holds all fields at the nodes, the derived ones averaged there; ``cells.bp``
    the derived ones as they are, cell by cell: one VTX file has one kind of elements only.
    Without ADIOS2, or on demand, both go to ``fields.xdmf``, of degree 1 at most.

    Raises
    ------
    InputError
        If there is no room for them.
    OSError
        On a rank where the library fails all the same; others may wait for it.
    """
    problem, x = solution.problem, solution.state.x
    derived = DerivedFields(problem.equilibrium, x)
    comm = problem.comm
    at_nodes = [*unknowns(problem.equilibrium, x).values(), *derived.nodes().values()]
    if has_adios2 and solution.output.fields == "vtx":
        in_cells = list(derived.cells().values())
        claim_room(comm, folder, _bytes(at_nodes) + _bytes(in_cells))
        for name, functions in (("fields.bp", at_nodes), ("cells.bp", in_cells)):
            path = folder / name
            with library_errors(path), closing(_vtx(path, functions)) as file:
                file.write(0.0)
        return
    at_corners = [linear(function) for function in at_nodes]
    claim_room(comm, folder, _bytes(at_corners))
    path = folder / "fields.xdmf"
    with library_errors(path), closing(lambda: io.XDMFFile(comm, path, "w")) as file:
        file.write_mesh(problem.domain.mesh)
        for function in at_corners:
            file.write_function(function)


def _vtx(path: Path, functions: Sequence[fem.Function]) -> Callable[[], Any]:
    comm = functions[0].function_space.mesh.comm
    return lambda: io.VTXWriter(comm, path, functions, engine="BP4")


def _bytes(functions: Sequence[fem.Function]) -> int:
    """Bound what this rank adds to a file of functions of one degree, with their mesh."""
    total = OVERHEAD
    for function in functions:
        space = function.function_space
        index_map, components = space.dofmap.index_map, space.dofmap.index_map_bs
        nodes = index_map.size_local + index_map.num_ghosts
        # Vectors and tensors are filled up to 3 and 9 components.
        total += 8 * nodes * next(filled for filled in (1, 3, 9) if components <= filled)
    topology, links = space.mesh.topology, space.dofmap.list
    # Coordinates, numbers, marks of ghosts; and the corners of the cells.
    corners = max(links.shape[1], topology.dim + 1)
    points = max(nodes, corners * len(links) if links.shape[1] == 1 else nodes)
    return total + points * (24 + 8 + 1) + len(links) * (corners + 1) * 8
