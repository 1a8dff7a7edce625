"""Checkpoints: mesh, parts and solution in one file, readable on any number of ranks."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.errors import InputError
from contact.interface.multipliers import Multipliers
from contact.mesh.domain import Domain, from_mesh
from contact.mesh.entities import Indices, combinations, exterior_facets
from contact.mesh.revolution import revolved
from contact.output.disk import OVERHEAD, claim_room, library_errors
from contact.output.fields import nodal_function, unknowns
from contact.output.folder import settle
from contact.output.solution import Solution
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array

#: Groups of attributes. adios4dolfinx 0.9 strips the letters of the group's name from the start
#: of the attributes' names, so that the former are digits and the latter begin with letters.
PARTS, KIND, REGIONS, NAME = "1", "2", "3", "name "


@dataclass(frozen=True)
class Checkpoint:
    """What a checkpoint holds.

    Attributes
    ----------
    domain
        Mesh and parts, to build the problem on: `build_problem(case, domain=checkpoint.domain)`.
    displacement, contact_forces, potential
        The solution; the contact forces lambda_c nu + lambda_f at the contact nodes, 0 elsewhere.
    motion
        The global unknowns, see `contact.body.masters`.
    """

    domain: Domain
    displacement: fem.Function
    contact_forces: fem.Function
    potential: fem.Function | None
    motion: Array

    def restore(self, problem: ContactProblem) -> State:
        """Return the state of a problem on the checkpoint's domain.

        Raises
        ------
        InputError
            If the problem lives on another mesh, or has another degree or kind of unknowns.
        """
        given = self.displacement.function_space
        same = given.ufl_element().embedded_superdegree == problem.equilibrium.degree
        same &= problem.domain.mesh is self.domain.mesh
        same &= problem.equilibrium.masters.size == self.motion.size
        if not same or problem.piezoelectric != (self.potential is not None):
            raise InputError(
                "the checkpoint does not fit the problem; accepted: one built on the checkpoint's "
                "domain, with the degree, the kind of material and the rigid parts that it was "
                "written with"
            )
        body, d = problem.equilibrium, problem.dim
        nodes = body.space.dofmap.list
        x = body.nodal(body.rest())
        x[nodes, :d] = self.displacement.x.array.reshape(-1, d)[given.dofmap.list]
        if self.potential is not None:
            dofs = self.potential.function_space.dofmap.list
            x[nodes, d] = self.potential.x.array[dofs] / body.phi_scale
        vectors = np.zeros((x.shape[0], d))
        vectors[nodes] = self.contact_forces.x.array.reshape(-1, d)[given.dofmap.list]
        jump = problem.nodes
        local = vectors[jump.nodes]
        forces = Multipliers.of(jump, jump.normal_component(local), local)
        owned = np.concatenate([x.ravel()[: body.owned], self.motion])
        return State(body.local(owned), forces)


def write_checkpoint(solution: Solution, path: str | Path) -> None:
    """Write a checkpoint. Collective.

    Raises
    ------
    InputError
        If adios4dolfinx is missing, or there is no room for it.
    OSError
        On a rank where the library fails all the same; others may wait for it.
    """
    adios, problem, path = _adios(), solution.problem, Path(path)
    domain, d = problem.domain, problem.dim
    sets = {PARTS: _combined(domain, PARTS, domain.parts)}
    sets[REGIONS] = _combined(domain, REGIONS, domain.regions)
    body, state = problem.equilibrium, solution.state
    vectors = np.zeros((body.nodal(state.x).shape[0], d))
    vectors[problem.nodes.nodes] = state.forces.vectors(problem.nodes)
    forces = nodal_function("contact_forces", body.space, vectors, (d,))
    functions = {**unknowns(body, state.x), "contact_forces": forces}
    kind = {"degree": np.array([body.degree]), "size": np.array([domain.size])}
    kind["piezoelectric"] = np.array([int(problem.piezoelectric)])
    kind["revolved"] = np.array([int(domain.revolved)])
    # An empty attribute cannot be written.
    kind["motion"] = np.append(body.motion(state.x), 0.0)
    for function in functions.values():
        function.x.scatter_forward()
    written = [*functions.values(), *(numbers for numbers, _ in sets.values())]
    claim_room(domain.comm, path.parent, _bytes(domain, written))
    with library_errors(path):
        adios.write_mesh(path, domain.mesh)
        for group, (numbers, names) in sets.items():
            _write_sets(path, group, numbers, names)
        adios.write_attributes(path, domain.comm, KIND, kind)
        for name, function in functions.items():
            adios.write_function(path, function, name=name)


def _bytes(domain: Domain, functions: Sequence[fem.Function]) -> int:
    """Bound what this rank adds to a checkpoint."""
    mesh = domain.mesh
    cells = mesh.topology.index_map(mesh.topology.dim).size_local
    numbers = mesh.geometry.x.size + cells * (mesh.topology.dim + 2)
    for function in functions:
        links = function.function_space.dofmap
        size = links.list.shape[1] * links.index_map_bs
        numbers += function.x.array.size + cells * (size + 2)
    # A function is written by itself, with names and offsets of its own.
    return 8 * numbers + (len(functions) + 2) * OVERHEAD


def read_checkpoint(path: str | Path, comm: MPI.Intracomm = MPI.COMM_WORLD) -> Checkpoint:
    """Read a checkpoint on as many ranks as there are. Collective.

    Raises
    ------
    InputError
        If there is no such checkpoint, or adios4dolfinx is missing.
    """
    adios, path = _adios(), Path(path)
    if comm.rank == 0:
        settle(path.parent)
    if not comm.bcast(path.is_dir() if comm.rank == 0 else None):
        raise InputError(f"{path}: there is no checkpoint; accepted: a folder checkpoint.bp")
    mesh = adios.read_mesh(path, comm, ghost_mode=dmesh.GhostMode.none)
    kind = adios.read_attributes(path, comm, KIND)
    parts, regions = (_read_sets(path, mesh, group) for group in (PARTS, REGIONS))
    domain = from_mesh(mesh, parts, float(kind["size"][0]), regions)
    if kind.get("revolved", [0])[0]:
        domain = revolved(domain)
    degree = int(kind["degree"][0])

    def function(name: str, shape: tuple[int, ...]) -> fem.Function:
        made = fem.Function(fem.functionspace(mesh, ("Lagrange", degree, shape)), name=name)
        adios.read_function(path, made, name=name)
        return made

    return Checkpoint(
        domain,
        function("displacement", (domain.dim,)),
        function("contact_forces", (domain.dim,)),
        function("potential", ()) if kind["piezoelectric"][0] else None,
        np.asarray(kind["motion"], dtype=float)[:-1],
    )


def _combined(
    domain: Domain, group: str, sets: Mapping[str, Indices]
) -> tuple[fem.Function, dict[str, Indices]]:
    """Return which of named sets of facets or cells meet, a number each entity. Collective.

    Returns
    -------
    The numbers, and those that belong to each name. A function carries the former: adios4dolfinx
    0.9 divides by zero where it writes tags and a rank has none.
    """
    numbers, dofs = _numbers(domain.mesh, group)
    labels, here = combinations(dofs.size, sets.values())
    there = sorted(set().union(*domain.comm.allgather(here)))
    numbers.x.array[dofs] = np.array([there.index(combined) for combined in here])[labels]
    numbers.x.scatter_forward()
    return numbers, {
        NAME + name: np.array(
            [k for k, combined in enumerate(there) if i in combined], dtype=np.int32
        )
        for i, name in enumerate(sets)
    }


def _write_sets(
    path: Path, group: str, numbers: fem.Function, names: Mapping[str, Indices]
) -> None:
    """Write what `_combined` returned. Collective."""
    adios = _adios()
    adios.write_function(path, numbers, name=group)
    adios.write_attributes(path, numbers.function_space.mesh.comm, group, names)


def _read_sets(path: Path, mesh: dmesh.Mesh, group: str) -> dict[str, Indices]:
    """Read what `_write_sets` wrote. Collective."""
    numbers, dofs = _numbers(mesh, group)
    adios = _adios()
    adios.read_function(path, numbers, name=group)
    labels = np.rint(numbers.x.array[dofs])
    names = adios.read_attributes(path, mesh.comm, group)
    return {
        name.removeprefix(NAME): np.flatnonzero(np.isin(labels, names[name])).astype(np.int32)
        for name in sorted(names)
    }


def _numbers(mesh: dmesh.Mesh, group: str) -> tuple[fem.Function, Indices]:
    """Return a function with one value a facet or cell, and where that of each owned one is."""
    tdim = mesh.topology.dim
    dim, element = (tdim - 1, ("CR", 1)) if group == PARTS else (tdim, ("DG", 0))
    exterior_facets(mesh)
    mesh.topology.create_connectivity(tdim, dim)
    space = fem.functionspace(mesh, element)
    entities = mesh.topology.connectivity(tdim, dim).array
    index_map = mesh.topology.index_map(dim)
    dofs = np.empty(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    dofs[entities] = space.dofmap.list.ravel()
    return fem.Function(space), dofs[: index_map.size_local]


def _adios() -> ModuleType:
    # Debian's adios2 takes its serial library in a run without mpirun, which will not do.
    os.environ.setdefault("ADIOS2_ALWAYS_USE_MPI", "1")
    try:
        import adios4dolfinx
    except ImportError as error:
        raise InputError(f"checkpoints need adios4dolfinx ({error})") from None
    return adios4dolfinx
