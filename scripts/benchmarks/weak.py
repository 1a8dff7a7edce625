"""Weak scaling: memory and messages of ranks that each have a slice of one body or of two.

``mpirun -n P python3 -m scripts.benchmarks.weak BODIES N [--solve]``: BODIES, 1 or 2, are bars of
P x 1 x 1 that touch along their length, N the cells of a rank along each edge of its slice: N = 43
makes 250,000 unknowns a rank of one body, N = 34 of two. Without ``--solve`` a problem is made,
its residuals are evaluated; with it, it is solved, and with ``--length L``
the bars are L x 1 x 1 on any number of ranks. Each rank counts the bytes of the arrays of
Python at their peak (`tracemalloc`), those of the coupling, and those that it receives through the
communicator; counts do not depend on the machine, or on how many cores it has.
"""

from __future__ import annotations

import argparse
import json
import time
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import basix.ufl
import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from petsc4py import PETSc

from contact import Body, Contact, Domain, Fixed, Friction, NewtonOptions, solve
from contact._compat import destinations
from contact.interface import pairing
from contact.mesh.domain import from_mesh
from contact.problem.problem import ContactProblem
from contact.problem.residuals import evaluate
from contact.refining import prolong
from contact.results.error_estimate import nodal_means
from forms.hencky import Linear
from scripts.benchmarks.bench_one import rank_memory

#: Gap between the bars, in edges of their section; tolerance of forces that are compared.
GAP, TIGHT = 1e-3, 1e-11


class Counted(MPI.Intracomm):
    """A communicator that counts the bytes that this rank receives."""

    received: ClassVar[int] = 0


def _counting(name: str) -> Any:
    plain = getattr(MPI.Intracomm, name)

    def counted(self: Counted, *given: Any, **more: Any) -> Any:
        found = plain(self, *given, **more)
        here = given[0] if name == "Irecv" else given[1] if name[0].isupper() else found
        if name != "Irecv" or given[1] != self.rank:
            Counted.received += _size(here)
        return found

    return counted


for _lower in ("allgather", "gather", "bcast", "alltoall", "allreduce"):
    for _name in {_lower, _lower.capitalize(), "Irecv"}:
        setattr(Counted, _name, _counting(_name))

# PETSc knows communicators by their names.
Counted.__module__, Counted.__name__ = MPI.Intracomm.__module__, MPI.Intracomm.__name__


def _size(values: Any) -> int:
    """Return the bytes of arrays, numbers and lists of them."""
    if isinstance(values, list | tuple):
        return sum(map(_size, values))
    return int(getattr(values, "nbytes", 0 if values is None else 8))


def _slice(
    edges: Sequence[int], place: int, length: int
) -> Iterator[tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]]:
    """Yield points and cells of a slice of each bar, given their numbers along an edge."""
    last = place == length - 1
    counts = [m * (m + 1) ** 2 for m in edges]
    for k, m in enumerate(edges):
        planes = np.arange(m + last)
        g = np.arange(m + 1) / m
        x, y, z = (v.ravel() for v in np.meshgrid(place + planes / m, g, g, indexing="ij"))
        i = np.arange(m + 1)
        # Planes of the next slice have its numbers.
        begin = np.full(m + 1, place * sum(counts) + sum(counts[:k]))
        begin[:m] += np.arange(m) * (m + 1) ** 2
        begin[m] += m * (m + 1) ** 2
        if last:
            begin += sum((e + 1) ** 2 for e in edges[:k])
        else:
            after = sum((e + 1) ** 2 for e in edges[:k]) if place == length - 2 else 0
            begin[m] = (place + 1) * sum(counts) + sum(counts[:k]) + after
        numbers = begin[:, None, None] + (i[:, None] * (m + 1) + i)[None]
        ends = [slice(None, -1), slice(1, None)]
        around = [numbers[a, b, c].ravel() for c in ends for b in ends for a in ends]
        yield np.column_stack([x, y, z + k * (1 + GAP)]), np.column_stack(around)


def slices(comm: MPI.Intracomm, n: int, bodies: int, length: int = 0) -> Domain:
    """Return bars of hexahedra that are divided in slices, by default one a rank.

    Parts are ``top`` and ``bottom`` of the whole, and between the bars ``upper`` and ``lower``.
    """
    edges, length = [n, n + n // 7 + 1][:bodies], length or comm.size
    first, last = (length * (comm.rank + k) // comm.size for k in (0, 1))
    found = [part for k in range(first, last) for part in _slice(edges, k, length)]
    element = basix.ufl.element("Lagrange", "hexahedron", 1, shape=(3,))
    every = np.concatenate([cells for _, cells in found]).astype(np.int64)
    places = np.concatenate([points for points, _ in found])

    def stay(_comm: Any, _parts: int, *_given: Any) -> Any:
        return destinations(np.full(len(every), comm.rank, dtype=np.int32))

    made = dmesh.create_mesh(comm, every, x=places, e=element, partitioner=stay)
    top = bodies + (bodies - 1) * GAP

    def at(height: float) -> Any:
        return lambda x: np.abs(x[2] - height) < GAP / 4

    parts = {"bottom": at(0.0), "top": at(top)}
    if bodies == 2:
        parts |= {"lower": at(1.0), "upper": at(1 + GAP)}
    domain = from_mesh(made, parts)
    facets = dmesh.locate_entities(made, 2, lambda x: np.abs(x[2] - (n // 2) / n) < GAP / 4)
    owned = facets[facets < made.topology.index_map(2).size_local]
    return replace(domain, inside={"middle": owned})


def problem_of(comm: MPI.Intracomm, n: int, bodies: int, length: int = 0) -> ContactProblem:
    """Return bars that are pressed and pushed, with friction."""
    domain, friction = slices(comm, n, bodies, length), Friction(mu=0.3)
    fixed = [Fixed("top", [0.002, 0.0, -0.005])]
    if bodies == 2:
        fixed.append(Fixed("bottom", [0.0] * 3))
        contact = Contact("upper", against="lower", friction=friction)
    else:
        contact = Contact("bottom", GAP, friction=friction)
    return ContactProblem(domain, Body(Linear(1.0, 0.3), fixed), contact)


def coupling_bytes(problem: ContactProblem) -> int:
    """Return the bytes of the coupling on this rank."""
    found = 0
    for geometry in problem.geometries:
        for value in vars(geometry.jumps).values() if geometry.jumps is not None else ():
            parts = (value.data, value.indices, value.indptr) if hasattr(value, "indptr") else value
            found += _size(parts)
    return found


def outputs(problem: ContactProblem, n: int, bodies: int) -> dict[str, Callable[[], object]]:
    """Return the actions on a problem that are counted one by one, by name. Collective."""
    coarse = problem_of(problem.comm, n // 2, bodies)
    cells = np.arange(problem.domain.mesh.topology.index_map(3).size_local, dtype=np.int32)
    values = np.ones((cells.size, 6))
    return {
        "nested": lambda: prolong(coarse, coarse.start(), problem),
        "separated": lambda: nodal_means(problem.domain, cells, values, ["middle"]),
    }


def costs(comm: MPI.Intracomm, n: int, bodies: int) -> dict[str, Any]:
    """Return the counts: the most of any rank, but for bytes received, the sum. Collective."""
    whole = Domain.comm
    Domain.comm = property(lambda domain: Counted(whole.fget(domain)))
    Counted.received = 0
    tracemalloc.start()
    try:
        problem = problem_of(comm, n, bodies)
        evaluate(problem, problem.start())
        peak, received = tracemalloc.get_traced_memory()[1], Counted.received
        stages = {}
        for name, do in outputs(problem, n, bodies).items():
            before, here = Counted.received, tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            do()
            most = comm.allreduce(tracemalloc.get_traced_memory()[1] - here, op=MPI.MAX)
            gone = comm.allreduce(Counted.received - before, op=MPI.SUM)
            stages |= {name: most, f"{name}, received": gone}
    finally:
        tracemalloc.stop()
        Domain.comm = whole
    return {
        "ranks": comm.size,
        "unknowns": problem.body.layout.unknowns,
        "contact nodes": problem.nodes.size,
        "python": comm.allreduce(peak, op=MPI.MAX),
        "coupling": comm.allreduce(coupling_bytes(problem), op=MPI.MAX),
        "received": comm.allreduce(received, op=MPI.SUM),
        **stages,
    }


def timed(comm: MPI.Intracomm, n: int, bodies: int, length: int) -> dict[str, Any]:
    """Return forces and costs of a solve; seconds are those of the pairing, and of a linear solve.

    Collective.
    """
    spent, plain = [0.0], pairing.couple

    def couple(*given: Any) -> Any:
        begin = time.perf_counter()
        found = plain(*given)
        spent[0] += time.perf_counter() - begin
        return found

    pairing.couple = couple
    PETSc.Log.begin()
    problem = problem_of(comm, n, bodies, length)
    pairing.couple = plain
    solution = solve(problem, NewtonOptions(linear="iterative", tolerance=TIGHT))
    events = [PETSc.Log.Event(name).getPerfInfo() for name in ("KSPSolve", "PCSetUp")]
    seconds = sum(event["time"] for event in events)
    counters = solution.counters
    return {
        "ranks": comm.size,
        "unknowns": problem.body.layout.unknowns,
        "contact nodes": problem.nodes.size,
        "coupling": comm.allreduce(coupling_bytes(problem), op=MPI.MAX),
        "converged": solution.converged,
        "forces": [*map(float, np.ravel(solution.contact_force))],
        "iterations": counters.linear_iterations,
        "solves": counters.linear_solves,
        "pairing": comm.allreduce(spent[0], op=MPI.MAX),
        "a linear solve": comm.allreduce(seconds, op=MPI.MAX) / max(counters.linear_solves, 1),
        "memory": comm.allreduce(rank_memory(), op=MPI.MAX),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the counts."""
    made = argparse.ArgumentParser(description=__doc__)
    made.add_argument("bodies", type=int, choices=(1, 2))
    made.add_argument("n", type=int)
    made.add_argument("--solve", action="store_true")
    made.add_argument("--length", type=int, default=0)
    given = made.parse_args(arguments)
    if given.solve:
        found = timed(MPI.COMM_WORLD, given.n, given.bodies, given.length)
    else:
        found = costs(MPI.COMM_WORLD, given.n, given.bodies)
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
