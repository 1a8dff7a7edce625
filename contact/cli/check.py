"""``contact check CASE``: the resolved case, its mesh and unknowns, and the expected sizes."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from mpi4py import MPI

from contact import _compat
from contact.case.build import build_problem
from contact.case.file import Case, load_case
from contact.case.text import to_toml
from contact.cli.main import CONVERGED
from contact.mesh.domain import Indices
from contact.methods.options import NewtonOptions
from contact.nesting import coarser_cases
from contact.output import environment
from contact.output.bodies import passing
from contact.output.remarks import fitting
from contact.problem.checks import expected_displacements
from contact.problem.problem import ContactProblem
from contact.ranks import on_root
from contact.typing import Array

#: Mean ratio below which a cell is called thin.
THIN = 0.1
#: Poisson's ratio from which on elements of degree 1 lock: the bulk modulus is 19.7 times mu.
INCOMPRESSIBLE = 0.475
#: Displacements above this share of the body are not small.
LARGE = 0.05


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
        f"# mesh: {cells} cells in {domain.dim}-D on {comm.size} rank(s), largest extent "
        f"{domain.size:g}",
        "# parts of its boundary, with their facets:",
        *_counts(domain.parts, comm),
        "# regions, with their cells:",
        *_counts(domain.regions, comm),
        *(f"# note: {note}" for note in domain.notes),
        f"# unknowns: {layout.unknowns} ({layout.block_size} a node), contact nodes: "
        f"{problem.nodes.size}",
        *expectations(problem),
        f"# blas: {library} {path}".rstrip(),
        "# versions: " + ", ".join(f"{k} {v}" for k, v in environment.versions().items()),
    ]
    if library == environment.REFERENCE:
        lines.append(f"# {environment.ADVICE}")
    return "\n".join(lines)


def _counts(sets: Mapping[str, Indices], comm: MPI.Intracomm) -> list[str]:
    """Return a line for each set of indices, with its number over all ranks. Collective."""
    width = max(map(len, sets))
    return [f"#   {name:{width}}  {comm.allreduce(sets[name].size)}" for name in sorted(sets)]


def expectations(problem: ContactProblem) -> list[str]:
    """Return lines on the mesh and on the expected effect of the loads. Collective."""
    warnings = [f"# warning: {text}" for text in (*fitting(problem), *passing(problem))]
    return [*_quality(problem), *_sizes(problem), *_locking(problem), *warnings]


def _locking(problem: ContactProblem) -> list[str]:
    """Say which materials change their volume so little that elements of degree 1 lock."""
    if problem.equilibrium.degree > 1:
        return []
    ratios = [float(m.law.poisson) for m in problem.body.materials]
    return [
        f"# warning: Poisson's ratio {ratio:g}, and from {INCOMPRESSIBLE:g} on elements of degree "
        "1 are much too stiff, they lock: space.degree = 2 does not, least of all with "
        'element = "mean_dilatation"'
        for ratio in dict.fromkeys(ratios)
        if ratio >= INCOMPRESSIBLE
    ]


def mean_ratio(corners: Array) -> Array:
    """Return the shape of simplices, corners (n, d + 1, d): 1 for regular ones, 0 for flat ones."""
    d = corners.shape[2]
    edges = corners[:, 1:] - corners[:, :1]
    volume = np.abs(np.linalg.det(edges)) / (2 if d == 2 else 6)
    first, second = np.triu_indices(d + 1, 1)
    squares = ((corners[:, first] - corners[:, second]) ** 2).sum(axis=(1, 2))
    if d == 2:
        return np.asarray(4 * np.sqrt(3) * volume / squares)
    return np.asarray(12 * (3 * volume) ** (2 / 3) / squares)


def _quality(problem: ContactProblem) -> list[str]:
    mesh, comm, d = problem.domain.mesh, problem.comm, problem.dim
    cells = _compat.geometry_dofmap(mesh)[: mesh.topology.index_map(d).size_local, : d + 1]
    ratio = mean_ratio(mesh.geometry.x[cells][:, :, :d])
    least = comm.allreduce(float(ratio.min(initial=1.0)), op=MPI.MIN)
    thin = comm.allreduce(int(np.count_nonzero(ratio < THIN)), op=MPI.SUM)
    lines = [f"# mesh quality: the worst cell has the mean ratio {least:.2g} (1: regular)"]
    if thin:
        lines.append(
            f"# warning: {thin} cells are thinner than {THIN:g}: stresses there are poor, and "
            "iterative solvers slow"
        )
    return lines


def _sizes(problem: ContactProblem) -> list[str]:
    """Say how far loads and prescribed values move the body, about, and how far it may go."""
    comm, scales, loads = problem.comm, problem.scales, problem.equilibrium.external(problem.time)
    pressed, moved = expected_displacements(problem, loads, problem.start().x)
    # Beyond a small contact part, as deep as it is wide, forces spread over all of the body.
    wide = scales.area if problem.dim == 2 and not problem.domain.revolved else scales.area**0.5
    pressed *= min(1.0, wide / scales.size + scales.size / scales.height)
    expected = max(pressed, moved)
    gap = problem.nodes.gap
    gap = np.where(np.abs(gap) < 1e-12 * scales.size, 0.0, gap)  # rounding is no gap
    least = comm.allreduce(float(gap.min(initial=np.inf)), op=MPI.MIN)
    largest = comm.allreduce(float(gap.max(initial=-np.inf)), op=MPI.MAX)
    if expected == 0:
        return ["# warning: nothing is loaded or moved: all results will be 0"]
    lines = [
        f"# expected: displacements of some {expected:.2g} (prescribed {moved:.2g}; the loads on a "
        f"block of the body's size {pressed:.2g}); gap {least:.3g} to {largest:.3g}"
    ]
    if expected > LARGE * scales.size:
        lines.append(
            f"# warning: that is {expected / scales.size:.0%} of the body, and strains are taken "
            "as small; are loads and Young's modulus in the same units?"
        )
    if least > 10 * expected:
        lines.append("# warning: the gap is far larger: the body may not touch at all")
    return lines
