"""``contact new MESH.msh``: a case file to begin with, for a mesh of one's own."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.case.text import literal
from contact.cli.main import CONVERGED
from contact.errors import InputError
from contact.interface.pairing import facing_parts
from contact.mesh.domain import Domain
from contact.mesh.reader import from_msh
from contact.ranks import on_root


def run(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Write the case file."""
    mesh = Path(options.mesh)
    path = Path(options.case) if options.case else mesh.with_suffix(".toml")
    if not on_root(comm, mesh.is_file):
        raise InputError(f"{mesh}: no such file; accepted: a Gmsh file (.msh)")
    text = case_text(from_msh(comm, mesh), mesh, path)

    def write() -> None:
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError:
            raise InputError(
                f"{path}: it is there already; accepted: another name, by --case FILE"
            ) from None

    on_root(comm, write)
    if comm.rank == 0:
        print(f"{path}: edit it, then run contact check {path}")
    return CONVERGED


def case_text(domain: Domain, mesh: Path, path: Path) -> str:
    """Return a case that presses the highest part down onto the lowest one. Collective."""
    heights = _heights(domain)
    order = sorted(heights, key=lambda name: (heights[name], name))
    lowest, highest = order[0], order[-1]
    d = domain.dim
    pressed = _along(d, -float(f"{1e-3 * domain.size:.0e}"))
    ground = _along(d, _lowest(domain))
    try:
        name = str(mesh.resolve().relative_to(path.resolve().parent))
    except ValueError:
        name = str(mesh.resolve())
    parts = "".join(f"#   {part}\n" for part in sorted(domain.parts))
    regions = ", ".join(sorted(domain.regions))
    return f"""\
# A case to begin with; every key is described in docs/case-file.md.
# Units are yours, but all the same: with mm and N, stresses are in MPa.
title = {literal(mesh.stem)}

[case]
# units = {{ length = "mm", stress = "MPa" }}    # for labels of figures

[mesh]
file = {literal(name)}
# Parts of its boundary, to be named below:
{parts}# Regions: {regions}.

[material]
young = 210e3                 # Young's modulus (stress)
poisson = 0.3
# law = "log"                 # beyond this strain the material gives way:
# yield_strain = 0.002

[[fixed]]                     # the part that lies highest; "free" for a component that is not held
{f"on = {literal(highest)}":<30}# or a list of parts
displacement = {pressed}

# [[load]]                    # force per area, on any part but those of [contact]
# on = {literal(highest)}
# traction = {_along(d, -1.0)}

[contact]                     # the part that lies lowest
on = {literal(lowest)}
foundation = {{ shape = "plane", point = {ground}, normal = {_along(d, 1.0)} }}
# gap = 0.0                   # instead: to a foundation along the part's normal; a formula, too
{_pairs(domain)}
[friction]
law = "coulomb"
mu = 0.2

[solver]
method = "newton"
tolerance = 1e-8
"""


def _pairs(domain: Domain) -> str:
    """Return contacts between bodies to choose from, as comments. Collective."""
    pairs = facing_parts(domain)
    if not pairs:
        return ""
    text = "".join(
        f"""#
# [[contact]]
# on = {literal(on)}
# against = {literal(against)}
"""
        for on, against in pairs
    )
    return f"""
# Bodies of this mesh that can touch each other: these instead, and hold the lowest part, too.
# Friction and current can be given for each; `on` is the finer side here, or take the softer body.
{text}"""


def _along(dim: int, value: float) -> str:
    """Return a vector along the last axis, as TOML."""
    return literal([0.0] * (dim - 1) + [value])


def _lowest(domain: Domain) -> float:
    """Return the least last coordinate of the mesh. Collective."""
    x = domain.mesh.geometry.x[:, domain.dim - 1]
    return domain.comm.allreduce(float(x.min(initial=np.inf)), op=MPI.MIN) + 0.0


def _heights(domain: Domain) -> dict[str, float]:
    """Return the mean last coordinate of the facets of each part. Collective."""
    mesh, d = domain.mesh, domain.dim
    found = {}
    for name, facets in domain.parts.items():
        middles = np.empty((0, 3))
        if facets.size > 0:  # dolfinx divides by their number
            middles = dmesh.compute_midpoints(mesh, d - 1, facets)
        sums = np.array([middles[:, d - 1].sum(), len(middles)])
        total = domain.comm.allreduce(sums, op=MPI.SUM)
        found[name] = round(float(total[0] / total[1]) / domain.size, 6)
    return found
