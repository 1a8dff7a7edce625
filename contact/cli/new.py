"""``contact new``, ``contact mesh``: a case file to begin with, a mesh file for many ranks."""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path
from typing import NamedTuple

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scipy.spatial import cKDTree

from contact.case.file import literal
from contact.cli.main import CONVERGED
from contact.errors import InputError
from contact.interface.pairing import REACH
from contact.mesh.domain import ON_AXIS, Domain
from contact.mesh.entities import Indices, distributed_components
from contact.mesh.geometry import facet_normals, geometry_nodes
from contact.mesh.reader import convert, from_file
from contact.ranks import on_root
from contact.tolerances import NEGLIGIBLE, TOUCHING
from contact.typing import Array

#: Cosine of the angle between two normals up to which facets face each other.
OPPOSED = -0.5

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


def run_mesh(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
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


def run_new(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
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
    """Return a case that presses the highest part, or bodies onto each other, down. Collective."""
    heights, facing, d = _heights(domain), facing_parts(domain), domain.dim
    sides = {side for _, *pair in facing for side in pair}
    order = sorted({*heights} - sides, key=lambda name: (heights[name], name))
    if len(order) < 2:
        raise InputError(
            f"{mesh}: {', '.join(sorted(heights))} as parts: none to hold beside that in contact; "
            "accepted: a mesh that also names the sides that are constrained and pressed",
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
        support = f"on = {literal(lowest)}\ndisplacement = {_along(d, 0.0)}\n"
        contacts = f"\n[[fixed]]\n{support}{contacts}"
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
        middles = _middles(domain, facets)
        sums = [middles[:, -1].sum(), np.abs(middles[:, 0]).sum(), len(middles)]
        total = domain.comm.allreduce(np.array(sums), op=MPI.SUM)
        height, radius = total[:2] / total[2] / domain.size
        if not revolved or radius > ON_AXIS:
            found[name] = round(float(height), 6)
    return found


def _middles(domain: Domain, facets: Indices) -> Array:
    """Return the midpoints of facets of this rank, shape (f, d)."""
    if not facets.size:  # dolfinx divides by their number
        return np.empty((0, domain.dim))
    found = dmesh.compute_midpoints(domain.mesh, domain.dim - 1, facets)
    return np.asarray(found[:, : domain.dim])


class _Side(NamedTuple):
    """The facets of a part, of all ranks: arrays of shape (f, d) and (f,)."""

    middle: Array
    normal: Array
    size: Array  # length of an edge
    height: Array  # of the cell behind it
    body: Array  # number of its connected component


def facing_parts(domain: Domain) -> list[tuple[float, str, str]]:
    """Return gaps and pairs of parts that face each other, the finer side first. Collective."""
    space = fem.functionspace(domain.mesh, ("Lagrange", 1))
    labels, count = distributed_components(space, space.dofmap.list)
    if count == 1:
        return []
    bodies = labels[space.dofmap.list[:, 0]]
    parts = {name: _side(domain, name, bodies) for name in domain.parts}
    own = {name: side for name, side in parts.items() if np.unique(side.body).size == 1}
    # The finer side of a pair is its first, of alike ones the first by name.
    finest = sorted(own, key=lambda name: (float(f"{own[name].size.mean():.9e}"), name))
    found = []
    for one, other in itertools.combinations(finest, 2):
        if own[one].body[0] != own[other].body[0]:
            sides = own[one], own[other]
            gap = _least_gap(*sides, REACH * domain.size)
            if np.isfinite(gap):
                touching = TOUCHING * min(side.height.min() for side in sides)
                found.append((0.0 if abs(gap) <= touching else gap, one, other))
    return sorted(found)


def _least_gap(one: _Side, other: _Side, reach: float) -> float:
    """Return the least gap along the normals of the facets of a side; infinity if none face."""
    nearest = cKDTree(other.middle).query(one.middle)[1]
    way = other.middle[nearest] - one.middle
    gap = np.einsum("fd,fd->f", way, one.normal)
    beside = np.linalg.norm(way - gap[:, None] * one.normal, axis=1)
    facing = np.einsum("fd,fd->f", one.normal, other.normal[nearest]) < OPPOSED
    facing &= beside <= one.size + other.size[nearest]
    # Facets that look away from each other have the cells of both bodies between them.
    facing &= (abs(gap) <= reach) & (gap > -(one.height + other.height[nearest]) / 2)
    return float(gap[facing].min(initial=np.inf))


def _side(domain: Domain, name: str, bodies: Array) -> _Side:
    """Return the facets of a part, given the body of each cell of this rank. Collective."""
    cells, _, areas = facet_normals(domain, name, 1)
    middle = _middles(domain, domain.facets(name))
    area = areas.mean(axis=1)
    size = np.linalg.norm(area, axis=1)
    normal = area / size[:, None]
    behind = middle[:, None] - geometry_nodes(domain, cells.astype(np.int32))
    height = np.einsum("fkd,fd->fk", behind, normal).max(axis=1, initial=0.0)
    own = middle, normal, size ** (1 / (domain.dim - 1)), height, bodies[cells]
    return _Side(*(np.concatenate(domain.comm.allgather(values)) for values in own))
