"""``contact check CASE``: the resolved case, its mesh and unknowns, and the expected sizes."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from mpi4py import MPI

from contact.body.elements import CHUNK, unlocked
from contact.case.build import build_problem
from contact.case.checks import growing
from contact.case.file import Case, load_case, to_toml
from contact.cli.acting import acting
from contact.cli.geometry import parts, regions
from contact.cli.main import CONVERGED
from contact.errors import counted
from contact.mesh.cells import Shape, shape_of
from contact.mesh.geometry import determinant, geometry_nodes, jacobians
from contact.methods.options import NewtonOptions
from contact.nesting import coarser_cases
from contact.problem.checks import meeting_supports
from contact.problem.problem import ContactProblem
from contact.ranks import on_root
from contact.results import environment
from contact.results.bodies import apart
from contact.results.discretisation import own_shape, without_heights
from contact.typing import Array
from forms.elasticity import Anisotropic

#: Mean ratio below which a cell is called thin.
THIN = 0.1
#: Poisson's ratio from which on elements of degree 1 lock: the bulk modulus is 19.7 times mu.
INCOMPRESSIBLE = 0.475
#: Stiffness of a crystal's strain over that of another one, from which on check warns, too.
STIFFER = 100.0
#: Most steps of an evolution whose loads are looked at.
LOOKS = 20


def run(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Validate a case, print it, and draw its set-up where that is asked for."""
    case = on_root(comm, lambda: load_case(options.case, options.set))
    if isinstance(case.solver, NewtonOptions) and case.solver.nested:
        coarser_cases(case, case.solver.nested_levels)
    problem = build_problem(case, comm)
    text = describe(case, problem)
    if comm.rank == 0:
        print(text)
    if options.plot:
        from contact.cli.setup import save_setup  # matplotlib takes a while to load

        for path in save_setup(case, problem, Path.cwd()):
            print(f"# set-up: {path.name}")
    return CONVERGED


def describe(case: Case, problem: ContactProblem) -> str:
    """Return the text. Collective; the same on all ranks."""
    domain, comm = problem.domain, problem.comm
    cells = domain.mesh.topology.index_map(domain.dim).size_global
    layout = problem.equilibrium.layout
    library, path = environment.blas()
    lines = [
        to_toml(case, domain.dim),
        f"# mesh: {counted(cells, 'cell')} in {domain.dim}-D on {counted(comm.size, 'rank')}, "
        f"largest extent {domain.size:g}",
        *parts(domain),
        *regions(domain),
        *(f"# note: {note}" for note in (*domain.notes, *amplitude_notes(case))),
        f"# unknowns: {layout.unknowns} ({layout.block_size} a node), contact nodes: "
        f"{problem.nodes.size}",
        *expectations(problem, _times(case)),
        f"# blas: {library} {path}".rstrip(),
        "# versions: " + ", ".join(f"{k} {v}" for k, v in environment.versions().items()),
    ]
    if library == environment.REFERENCE:
        lines.append(f"# {environment.ADVICE}")
    return "\n".join(lines)


def amplitude_notes(case: Case) -> list[str]:
    """Say which loads and values have no amplitude in an evolution, and which peaks are lost."""
    found = growing(case)
    if case.evolution is None:
        return []
    lost = case.evolution.lost_peaks
    if not found:
        return lost
    begin, end = case.evolution.times[:2]
    return [
        *lost,
        f"{', '.join(found)} without an amplitude: from 0 at t = {begin:g} to all at t = {end:g}, "
        'and then constant; amplitude = "constant": all the time',
    ]


def _times(case: Case) -> list[float]:
    """Return times at which loads are looked at: ends of stages and steps, of some of many."""
    if case.evolution is None:
        return [1.0]
    ends, stages = case.evolution.ends, case.evolution.times[1:]
    some = [times[:: 1 + len(times) // LOOKS] for times in (ends, stages)]
    return sorted({*some[0], *some[1], ends[-1]})


def expectations(problem: ContactProblem, times: Sequence[float] = (1.0,)) -> list[str]:
    """Return lines on the mesh, and on loads and prescribed values at some times. Collective."""
    warnings = [
        f"# warning: {text} [{identifier}]"
        for identifier, remarks in {
            "own-shape": own_shape(problem),
            "part-end": without_heights(problem),
            "meeting-supports": meeting_supports(problem, times),
            "two-bodies": apart(problem),
        }.items()
        for text in remarks
    ]
    return [*_quality(problem), *acting(problem, times), *_locking(problem), *warnings]


def _locking(problem: ContactProblem) -> list[str]:
    """Say which materials resist some strains so much that elements of degree 1 lock."""
    body = problem.equilibrium
    remedy = unlocked(body.element, body.degree, shape_of(body.domain.mesh))
    if remedy is None:
        return []
    # In plane stress volumes are free to change.
    laws = [m.law for m in problem.body.materials if not m.in_plane_stress]
    ratios = [float(law.poisson) for law in laws]
    crystals = [law.eigenvalues for law in laws if isinstance(law, Anisotropic)]
    stiffer = [values[-1] / values[0] for values in crystals]
    found = [
        *(f"Poisson's ratio {ratio:g}" for ratio in ratios if ratio >= INCOMPRESSIBLE),
        *(f"a strain {more:.3g} times as stiff as another" for more in stiffer if more >= STIFFER),
    ]
    return [
        f"# warning: {text}: elements of degree 1 can be much too stiff, they lock; {remedy} "
        "[locking]"
        for text in dict.fromkeys(found)
    ]


def quality(shape: Shape, corners: Array) -> Array:
    """Return the mean ratio of cells, the least at their corners: 1 if regular, 0 if flat.

    It is d det(A)^(2/d) / |A|^2, A the map from the regular cell of the shape (Knupp, SIAM J. Sci.
    Comput. 23, 2001).
    """
    d, jacobian = shape.dim, jacobians(shape, corners[:, : shape.corners], shape.nodes(1))
    if shape.simplex:  # its edges from one corner: W^T W = (1 + I) / 2
        regular = np.linalg.cholesky((1 + np.eye(d)) / 2).T
        jacobian = jacobian @ np.linalg.inv(regular)
    size = np.abs(determinant(jacobian)) ** (2 / d)
    return np.asarray((d * size / np.sum(jacobian**2, axis=(2, 3))).min(axis=1))


def _quality(problem: ContactProblem) -> list[str]:
    comm = problem.comm
    shape, nodes = shape_of(problem.domain.mesh), geometry_nodes(problem.domain)
    chunks = np.array_split(nodes, len(nodes) // CHUNK + 1)
    ratio = np.concatenate([quality(shape, some) for some in chunks])
    least = comm.allreduce(float(ratio.min(initial=1.0)), op=MPI.MIN)
    thin = comm.allreduce(int(np.count_nonzero(ratio < THIN)), op=MPI.SUM)
    lines = [f"# mesh quality: the worst cell has the mean ratio {least:.2g} (1: regular)"]
    if thin:
        lines.append(
            f"# warning: {thin} cells are thinner than {THIN:g}: stresses there are poor, and "
            "iterative solvers slow"
        )
    return lines
