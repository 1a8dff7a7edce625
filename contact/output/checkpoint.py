"""Checkpoints: mesh, parts and solution in one file, readable on any number of ranks."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.errors import InputError
from contact.interface.multipliers import Multipliers
from contact.mesh.make import Domain, from_mesh
from contact.output.fields import nodal_function, unknowns
from contact.output.solution import Solution
from contact.problem.problem import ContactProblem
from contact.problem.state import State

#: Groups of attributes. adios4dolfinx 0.9 strips the letters of the group's name from the start
#: of the attributes' names, so that the former are digits and the latter begin with letters.
PARTS, KIND, PART = "1", "2", "part "


@dataclass(frozen=True)
class Checkpoint:
    """What a checkpoint holds.

    Attributes
    ----------
    domain
        Mesh and parts, to build the problem on: `build_problem(case, domain=checkpoint.domain)`.
    displacement, contact_forces, potential
        The solution; the contact forces lambda_c nu + lambda_f at the contact nodes, 0 elsewhere.
    """

    domain: Domain
    displacement: fem.Function
    contact_forces: fem.Function
    potential: fem.Function | None

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
        if not same or problem.piezoelectric != (self.potential is not None):
            raise InputError(
                "the checkpoint does not fit the problem; accepted: one built on the checkpoint's "
                "domain, with the degree and the kind of material that it was written with"
            )
        body, d = problem.equilibrium, problem.dim
        nodes = body.space.dofmap.list
        x = body.rest().reshape(-1, body.block_size)
        x[nodes, :d] = self.displacement.x.array.reshape(-1, d)[given.dofmap.list]
        if self.potential is not None:
            dofs = self.potential.function_space.dofmap.list
            x[nodes, d] = self.potential.x.array[dofs] / body.phi_scale
        vectors = np.zeros((x.shape[0], d))
        vectors[nodes] = self.contact_forces.x.array.reshape(-1, d)[given.dofmap.list]
        jump = problem.nodes
        local = vectors[jump.nodes]
        forces = Multipliers(jump.normal_component(local), jump.tangential_component(local))
        return State(body.local(x.ravel()[: body.owned]), forces)


def write_checkpoint(solution: Solution, path: str | Path) -> None:
    """Write a checkpoint. Collective.

    Raises
    ------
    InputError
        If adios4dolfinx is missing.
    """
    adios, problem, path = _adios(), solution.problem, Path(path)
    domain, d = problem.domain, problem.dim
    adios.write_mesh(path, domain.mesh)
    adios.write_meshtags(path, domain.mesh, domain.facet_tags, meshtag_name="parts")
    # Attributes are numbers: the tag values of each part, under its name.
    parts = {PART + name: np.array(v, dtype=np.int32) for name, v in domain.parts.items()}
    adios.write_attributes(path, domain.comm, PARTS, parts)
    body, state = problem.equilibrium, solution.state
    vectors = np.zeros((state.x.size // body.block_size, d))
    vectors[problem.nodes.nodes] = state.forces.vectors(problem.nodes)
    forces = nodal_function("contact_forces", body.space, vectors, (d,))
    functions = {**unknowns(body, state.x), "contact_forces": forces}
    kind = {"degree": np.array([body.degree]), "size": np.array([domain.size])}
    kind["piezoelectric"] = np.array([int(problem.piezoelectric)])
    adios.write_attributes(path, domain.comm, KIND, kind)
    for name, function in functions.items():
        function.x.scatter_forward()
        adios.write_function(path, function, name=name)


def read_checkpoint(path: str | Path, comm: MPI.Intracomm = MPI.COMM_WORLD) -> Checkpoint:
    """Read a checkpoint on as many ranks as there are. Collective.

    Raises
    ------
    InputError
        If there is no such checkpoint, or adios4dolfinx is missing.
    """
    adios, path = _adios(), Path(path)
    if not comm.bcast(path.is_dir() if comm.rank == 0 else None):
        raise InputError(f"{path}: there is no checkpoint; accepted: a folder checkpoint.bp")
    mesh = adios.read_mesh(path, comm, ghost_mode=dmesh.GhostMode.none)
    tags = adios.read_meshtags(path, mesh, "parts")
    kind = adios.read_attributes(path, comm, KIND)
    parts = adios.read_attributes(path, comm, PARTS)
    marks = {
        name.removeprefix(PART): tags.indices[np.isin(tags.values, values)]
        for name, values in sorted(parts.items())
    }
    domain = from_mesh(mesh, marks, float(kind["size"][0]))
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
    )


def _adios() -> ModuleType:
    # Debian's adios2 takes its serial library in a run without mpirun, which will not do.
    os.environ.setdefault("ADIOS2_ALWAYS_USE_MPI", "1")
    try:
        import adios4dolfinx
    except ImportError as error:
        raise InputError(f"checkpoints need adios4dolfinx ({error})") from None
    return adios4dolfinx
