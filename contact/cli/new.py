"""``contact new``, ``contact mesh``: a case file to begin with, a mesh file for many ranks."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.case.file import literal
from contact.cli.main import CONVERGED
from contact.errors import InputError
from contact.interface.pairing import facing_parts
from contact.mesh.domain import ON_AXIS, Domain
from contact.mesh.reader import convert, from_file
from contact.ranks import on_root
from contact.tolerances import NEGLIGIBLE

CASE = """\
# A case to begin with; every key is described in docs/case-file.md.
# Units are yours, but all the same: with mm and N, stresses are in MPa.
title = {title}

[case]
# units = "N-mm-MPa"          # labels of figures, and constants of materials by name

[mesh]
file = {file}
# Parts of its boundary, to be named below:
{parts}# Regions: {regions}.

{space}{materials}
[[fixed]]                     # the part that lies highest; "free": no support in this direction
on = {highest}
displacement = {pressed}
{held}
# [[load]]                    # a resultant on any part but those of contacts
# on = {highest}
# force = {load}

{contacts}
[friction]
law = "coulomb"
mu = 0.2

[solver]
method = "newton"
tolerance = 1e-8
"""

MATERIAL = """\
young = 210e3                 # Young's modulus (stress); or by name: name = "steel"
poisson = 0.3
"""

HENCKY = """\
# law = "log"                 # Hencky's law, plastic beyond this strain:
# yield_strain = 0.002
"""

PAIRS = """\
# Bodies of this mesh that can touch each other. Friction and current can be given for each; `on`
# is the finer side here, or take the softer body. A rigid foundation instead of a body:
# on = ..., foundation = { shape = "plane", point = [...], normal = [...] }
"""


def run(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Write the file that is asked for."""
    return {"new": _new, "mesh": _convert}[options.command](options, comm)


def _convert(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Write a mesh file as one that many ranks read in shares."""
    to = Path(options.to)

    def converted() -> str:
        domain = convert(Path(options.file), to)
        count = domain.mesh.topology.index_map(domain.dim).size_global
        parts = ", ".join([*domain.parts, *domain.inside])
        names = f"parts {parts}; regions {', '.join(domain.regions)}"
        return f"{to}, {to.with_suffix('.h5')}: {count} cells\n{names}"

    words = on_root(comm, converted)
    if comm.rank == 0:
        print(words)
    return CONVERGED


def _new(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Write the case file."""
    mesh = Path(options.mesh)
    path = Path(options.case) if options.case else mesh.with_suffix(".toml")
    if not on_root(comm, mesh.is_file):
        raise InputError(
            f"{mesh}: no such file; accepted: a mesh file (.msh, .inp, .vtu, ...)", "file-name"
        )
    text = case_text(from_file(comm, mesh), mesh, path)

    def write() -> None:
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError:
            raise InputError(
                f"{path}: it is there already; accepted: another name, by --case FILE", "file-name"
            ) from None

    on_root(comm, write)
    if comm.rank == 0:
        print(f"{path}: edit it, then run contact check {path}")
    return CONVERGED


def case_text(domain: Domain, mesh: Path, path: Path) -> str:
    """Return a case that presses the highest part down onto the lowest one. Collective.

    Of several bodies that face each other onto each other, the lowest part held.
    """
    heights, facing, d = _heights(domain), facing_parts(domain), domain.dim
    sides = {side for _, *pair in facing for side in pair}
    order = sorted({*heights} - sides, key=lambda name: (heights[name], name))
    if len(order) < 2:
        raise InputError(
            f"{mesh}: {', '.join(sorted(heights))} as parts: none to hold beside those in contact; "
            "accepted: a mesh that also names the sides that are held and pressed",
            "new-parts",
        )
    lowest, highest = order[0], order[-1]
    step = float(f"{1e-3 * domain.size:.0e}")
    closed = np.ceil(max(facing[0][0], 0.0) / step - NEGLIGIBLE) if facing else 0.0
    try:
        name = str(mesh.resolve().relative_to(path.resolve().parent))
    except ValueError:
        name = str(mesh.resolve())
    parts = "".join(f"#   {part}\n" for part in sorted(domain.parts))
    if domain.inside:
        parts += "# Parts inside of it, for supports, electrodes and bolts:\n"
        parts += "".join(f"#   {part}\n" for part in sorted(domain.inside))
    space = "".join(f"{key} = {literal(value)}\n" for key, value in domain.space.items())
    held = f"\n[[fixed]]                     # the part that lies lowest\non = {literal(lowest)}\n"
    return CASE.format(
        title=literal(mesh.stem),
        file=literal(name),
        parts=parts,
        regions=", ".join(sorted(domain.regions)),
        space=f"[space]                       # as the elements of the file\n{space}\n"
        * bool(space),
        materials=_materials(domain),
        highest=literal(highest),
        pressed=_along(d, -float(f"{(1 + closed) * step:.6g}")),
        held=f"{held}displacement = {_along(d, 0.0)}\n" * bool(facing),
        load=_along(d, -1.0),
        contacts=_pairs(facing) if facing else _foundation(domain, lowest),
    )


def _materials(domain: Domain) -> str:
    """Return a material for each region, where each cell has one; else one for all. Collective."""
    counts = [domain.comm.allreduce(cells.size, op=MPI.SUM) for cells in domain.regions.values()]
    apart = sum(counts) == domain.mesh.topology.index_map(domain.dim).size_global
    if not apart or len(counts) == 1:
        return f"[material]\n{MATERIAL}{HENCKY}"
    first, *others = [
        f"[[material]]\non = {literal(k)}\n{MATERIAL}" for k in sorted(domain.regions)
    ]
    return "\n".join([first + HENCKY, *others])


def _foundation(domain: Domain, lowest: str) -> str:
    """Return the contact of one body with a plane. Collective."""
    d = domain.dim
    least = domain.mesh.geometry.x[:, d - 1].min(initial=np.inf)
    ground = _along(d, domain.comm.allreduce(float(least), op=MPI.MIN) + 0.0)
    return f"""\
[contact]                     # the part that lies lowest
on = {literal(lowest)}
foundation = {{ shape = "plane", point = {ground}, normal = {_along(d, 1.0)} }}
# gap = 0.0                   # instead: to a foundation along the part's normal; a formula, too
"""


def _pairs(facing: list[tuple[float, str, str]]) -> str:
    """Return the contacts between bodies, given their gaps, the least first, and sides."""
    sides: dict[str, list[str]] = {}  # contacts share no nodes: one for each `on`
    for _, on, against in facing:
        sides.setdefault(on, []).append(against)
    text, overlap = PAIRS, -facing[0][0]
    if overlap > 0:
        text += f"""
# The meshes overlap, by up to {overlap:.3g}, which is refused: move a body, or, where that is an
# interference, add overlap = "press".
"""
    for side, others in sides.items():
        opposite = literal(others if len(others) > 1 else others[0])
        text += f"\n[[contact]]\non = {literal(side)}\nagainst = {opposite}\n"
    return text


def _along(dim: int, value: float) -> str:
    """Return a vector along the last axis, as TOML."""
    return literal([0.0] * (dim - 1) + [value])


def _heights(domain: Domain) -> dict[str, float]:
    """Return the mean last coordinate of the facets of each part. Collective."""
    # Of a body of revolution those on its axis are no parts of its boundary.
    revolved, found = domain.space.get("kinematics") == "axisymmetric", {}
    for name, facets in domain.parts.items():
        middles = np.empty((0, 3))
        if facets.size > 0:  # dolfinx divides by their number
            middles = dmesh.compute_midpoints(domain.mesh, domain.dim - 1, facets)
        sums = [middles[:, domain.dim - 1].sum(), np.abs(middles[:, 0]).sum(), len(middles)]
        total = domain.comm.allreduce(np.array(sums), op=MPI.SUM)
        height, radius = total[:2] / total[2] / domain.size
        if not revolved or radius > ON_AXIS:
            found[name] = round(float(height), 6)
    return found
