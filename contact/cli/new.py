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

[mesh]
file = {file}
# Parts of its boundary: {parts}.
# Parts inside of it, for supports, electrodes and bolts: {inside}.
# Regions: {regions}.

{space}[material]                    # of several regions a list: [[material]], on = "REGION"
young = 210e3                 # Young's modulus (stress); or by name: name = "steel"
poisson = 0.3

[[fixed]]                     # the part that lies highest; "free": no support in this direction
on = {highest}
displacement = {pressed}
{contacts}
[friction]
law = "coulomb"
mu = 0.2
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
            f"{mesh}: {', '.join(sorted(heights))} as parts: none to hold beside that in contact; "
            "accepted: a mesh that also names the sides that are held and pressed",
            "new-parts",
        )
    lowest, highest = order[0], order[-1]
    step, closed, contacts = float(f"{1e-3 * domain.size:.0e}"), 0.0, ""
    opposite: dict[str, tuple[float, list[str]]] = {}  # contacts share no nodes: one each `on`
    for gap, on, against in facing:
        opposite.setdefault(on, (gap, []))[1].append(against)
    for on, (gap, others) in opposite.items():
        against = literal(others if len(others) > 1 else others[0])
        contacts += f"\n[[contact]]\non = {literal(on)}\nagainst = {against}\n"
        contacts += 'overlap = "press"             # the meshes overlap\n' if gap < 0 else ""
    if facing:
        closed = float(np.ceil(max(facing[0][0], 0.0) / step - NEGLIGIBLE))
        held = f"on = {literal(lowest)}\ndisplacement = {_along(d, 0.0)}\n"
        contacts = f"\n[[fixed]]\n{held}{contacts}"
    else:
        least = domain.mesh.geometry.x[:, d - 1].min(initial=np.inf)
        ground = _along(d, domain.comm.allreduce(float(least), op=MPI.MIN) + 0.0)
        contacts = f'\n[contact]\non = {literal(lowest)}\nfoundation = {{ shape = "plane", '
        contacts += f"point = {ground}, normal = {_along(d, 1.0)} }}\n"
    try:
        name = str(mesh.resolve().relative_to(path.resolve().parent))
    except ValueError:
        name = str(mesh.resolve())
    space = "".join(f"{key} = {literal(value)}\n" for key, value in domain.space.items())
    parts, inside, regions = (
        ", ".join(sorted(group)) for group in (domain.parts, domain.inside, domain.regions)
    )
    return CASE.format(
        title=literal(mesh.stem),
        file=literal(name),
        parts=parts,
        inside=inside or "none",
        regions=regions,
        space=f"[space]                       # as the elements of the file\n{space}\n"
        * bool(space),
        highest=literal(highest),
        pressed=_along(d, -float(f"{(1 + closed) * step:.6g}")),
        contacts=contacts,
    )


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
