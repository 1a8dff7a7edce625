"""Where the materials of a body are: each cell has one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import TypeAlias

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh
from mpi4py import MPI

from contact.arguments import expect
from contact.body.pointwise import CHUNK
from contact.errors import InputError
from contact.mesh.domain import Domain, Indices, Measure
from contact.mesh.entities import cells_at
from contact.mesh.geometry import geometry_nodes
from contact.model.fields import constant, values_at
from contact.model.material import Material
from contact.typing import Array
from forms.elasticity import Anisotropic
from forms.hencky import Graded, Law
from forms.history import HistoryLaw
from forms.piezo import Piezo

#: A material with form constants for its numbers, and the measure of its cells, whose number is 0:
#: the forms of materials of one law are one and the same, each with its own constants.
MaterialMeasure: TypeAlias = tuple[Law | Graded, Piezo | None, Measure]


def cells_of(domain: Domain, materials: Sequence[Material]) -> list[Indices]:
    """Return the owned cells of each material, ascending. Collective.

    Raises
    ------
    InputError
        If a region is missing, belongs to two materials or to none, or cells are in no region.
    """
    if len(materials) == 1 and not materials[0].on:
        return [np.arange(_count(domain), dtype=np.int32)]
    owner = np.full(_count(domain), -1, dtype=np.int32)
    found = []
    for i, material in enumerate(materials):
        if not material.on:
            raise InputError(
                f"material.{i}.on: missing; accepted: with several materials, the regions of "
                f"each ({', '.join(sorted(domain.regions))})",
                "missing",
            )
        cells = np.unique(np.concatenate([domain.cells(name) for name in material.on]))
        both = owner[cells].max(initial=-1)
        other = domain.comm.allreduce(int(both), op=MPI.MAX)
        if other >= 0:
            raise InputError(
                f"material.{i}.on: {', '.join(material.on)} shares cells with the regions of "
                f"material.{other} ({', '.join(materials[other].on)}); accepted: each cell in one",
                "regions",
            )
        owner[cells] = i
        found.append(cells.astype(np.int32))
    _check_all(domain, owner)
    return found


def young_behind(
    domain: Domain, materials: Sequence[Material], cells: Sequence[Indices], on: str
) -> float:
    """Return the largest Young's modulus right behind a part. Collective.

    Parameters
    ----------
    domain, materials
        The mesh, and the materials of the body.
    cells
        The owned cells of each.
    on
        The part.
    """
    behind, _ = cells_at(domain.mesh, domain.facets(on))
    every = zip(materials, cells, strict=True)
    found = [float(material.law.young) for material, own in every if np.isin(behind, own).any()]
    return domain.comm.allreduce(max(found, default=0.0), op=MPI.MAX)


def _check_all(domain: Domain, owner: Indices) -> None:
    """Refuse cells without a material, and name their region."""
    left = domain.comm.allreduce(int(np.count_nonzero(owner < 0)), op=MPI.SUM)
    if left == 0:
        return
    for name, cells in domain.regions.items():
        without = domain.comm.allreduce(int(np.count_nonzero(owner[cells] < 0)), op=MPI.SUM)
        if without > 0:
            raise InputError(
                f"material: the region {name!r} has none; accepted: a [[material]] with "
                f"on = {name!r}, or one without `on` for the whole mesh",
                "regions",
            )
    raise InputError(
        f"material: {left} cells of the mesh are in no region and have none; accepted: a region "
        "(physical group) for each cell, or one material without `on` for the whole mesh",
        "regions",
    )


def _count(domain: Domain) -> int:
    return int(domain.mesh.topology.index_map(domain.dim).size_local)


def in_parts(domain: Domain, cells: Sequence[Indices]) -> list[list[Indices]]:
    """Divide the cells of each material, into as many parts on all ranks. Collective.

    A large body has several: for each function of a form dolfinx packs the values in all of its
    cells, which are more than the unknowns by far.
    """
    most = domain.comm.allreduce(max(own.size for own in cells), op=MPI.MAX)
    parts = [np.array_split(own, most // (4 * CHUNK) + 1) for own in cells]
    return [[*part] for part in zip(*parts, strict=True)]


def material_measures(
    domain: Domain,
    materials: Sequence[Material],
    cells: Sequence[Indices],
    degree: int,
) -> Iterator[MaterialMeasure]:
    """Yield each material with the measure of its cells.

    Parameters
    ----------
    domain, materials, cells
        As in and from `cells_of`.
    degree
        Of the quadrature.
    """
    metadata = {"quadrature_degree": degree}
    for material, own in zip(materials, cells, strict=True):
        law, piezo = form_law(material, domain.mesh), material.piezo
        constants = None if piezo is None else piezo_with_constants(piezo, domain.mesh)
        yield law, constants, domain.dx_over(own)(metadata=metadata)


def form_law(material: Material, mesh: Mesh) -> Law | Graded:
    """Return the law of a material with form constants, and with its factor. Collective."""
    law = _with_constants(material.law, mesh)
    if material.factor is None or isinstance(law, HistoryLaw):
        return law
    return Graded(law, ufl.as_ufl(material.factor.ufl(ufl.SpatialCoordinate(mesh))))


def factor_of(domain: Domain, material: Material, cells: Indices) -> Array:
    """Return the factor of a material in the middle of some cells, shape (cells,). Collective.

    Raises
    ------
    InputError
        If it is not positive.
    """
    if material.factor is None:
        return np.ones(cells.size)
    middles = geometry_nodes(domain, cells).mean(axis=1)
    values = values_at(material.factor, middles, 1.0, "material: factor", domain.comm)
    least = domain.comm.allreduce(float(values.min(initial=np.inf)), op=MPI.MIN)
    expect("material: factor", least, "a function that is positive everywhere", least > 0)
    return values


def _with_constants(law: Law, mesh: Mesh) -> Law:
    """Return a law with form constants for its numbers."""
    if isinstance(law, Anisotropic):
        return Anisotropic(fem.Constant(mesh, np.asarray(law.stiffness, dtype=float)))
    if not is_dataclass(law) or isinstance(law, HistoryLaw) or getattr(law, "g_min", 0.0) > 0:
        return law
    numbers = {
        f.name: constant(mesh, getattr(law, f.name))
        for f in fields(law)
        if f.name != "g_min" and isinstance(getattr(law, f.name), int | float)
    }
    return replace(law, **numbers)


def piezo_with_constants(piezo: Piezo, mesh: Mesh) -> Piezo:
    """Return piezoelectric tensors as form constants."""
    return Piezo(
        fem.Constant(mesh, np.asarray(piezo.e, dtype=float)),
        fem.Constant(mesh, np.asarray(piezo.beta, dtype=float)),
    )
