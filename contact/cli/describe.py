"""The text that ``check`` prints: resolved case, mesh, unknowns, environment."""

from __future__ import annotations

from collections.abc import Mapping

from mpi4py import MPI

from contact.case.file import Case
from contact.case.text import to_toml
from contact.cli.expected import expectations
from contact.mesh.domain import Indices
from contact.output import environment
from contact.problem.problem import ContactProblem


def describe(case: Case, problem: ContactProblem) -> str:
    """Return the text. Collective; the same on all ranks."""
    domain, comm = problem.domain, problem.comm
    cells = domain.mesh.topology.index_map(domain.dim).size_global
    layout = problem.equilibrium.layout
    library = environment.blas()
    lines = [
        to_toml(case, domain.dim),
        f"# mesh: {cells} cells in {domain.dim}-D on {comm.size} rank(s), largest extent "
        f"{domain.size:g}",
        "# parts of its boundary, with their facets:",
        *_sizes(domain.parts, comm),
        "# regions, with their cells:",
        *_sizes(domain.regions, comm),
        *(f"# note: {note}" for note in domain.notes),
        f"# unknowns: {layout.unknowns} ({layout.block_size} a node), contact nodes: "
        f"{problem.nodes.size}",
        *expectations(problem),
        f"# blas: {library.name} {library.path}".rstrip(),
        "# versions: " + ", ".join(f"{k} {v}" for k, v in environment.versions().items()),
    ]
    if library.is_reference:
        lines.append(f"# {environment.ADVICE}")
    return "\n".join(lines)


def _sizes(sets: Mapping[str, Indices], comm: MPI.Intracomm) -> list[str]:
    """Return a line for each set of indices, with its number over all ranks. Collective."""
    width = max(map(len, sets))
    return [f"#   {name:{width}}  {comm.allreduce(sets[name].size)}" for name in sorted(sets)]
