"""The text that ``check`` prints: resolved case, mesh, unknowns, environment."""

from __future__ import annotations

from contact.case.file import Case
from contact.case.text import to_toml
from contact.output import environment
from contact.problem.problem import ContactProblem


def describe(case: Case, problem: ContactProblem) -> str:
    """Return the text. Collective; the same on all ranks."""
    domain, comm = problem.domain, problem.comm
    cells = domain.mesh.topology.index_map(domain.dim).size_global
    layout = problem.equilibrium.layout
    counts = {name: comm.allreduce(domain.facets(name).size) for name in sorted(domain.parts)}
    width = max(len(name) for name in counts)
    library = environment.blas()
    lines = [
        to_toml(case),
        f"# mesh: {cells} cells in {domain.dim}-D on {comm.size} rank(s), largest extent "
        f"{domain.size:g}",
        "# parts of its boundary, with their facets:",
        *(f"#   {name:{width}}  {count}" for name, count in counts.items()),
        f"# unknowns: {layout.unknowns} ({layout.block_size} a node), contact nodes: "
        f"{problem.nodes.size}",
        f"# blas: {library.name} {library.path}".rstrip(),
        "# versions: " + ", ".join(f"{k} {v}" for k, v in environment.versions().items()),
    ]
    if library.is_reference:
        lines.append(f"# {environment.ADVICE}")
    return "\n".join(lines)
