"""The cells of each material, and the materials in UFL for the weak form."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh
from mpi4py import MPI

from contact.arguments import expect
from contact.body.elements import CHUNK, Rule
from contact.body.internal_variables import QuadratureLaws
from contact.body.weak_form import Solid
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices, cells_at
from contact.mesh.geometry import geometry_nodes
from contact.model.fields import constant, values_at
from contact.model.material import Material
from contact.typing import Array
from forms.elasticity import Anisotropic
from forms.hencky import Graded, Law
from forms.history import HistoryLaw
from forms.piezo import Piezo


def cells_of(domain: Domain, materials: Sequence[Material]) -> list[Indices]:
    """Return the owned cells of each material, ascending. Collective.

    Refuses regions that are missing, or belong to two materials or to none, and cells in no region.
    """
    if len(materials) == 1 and not materials[0].on:
        return [np.arange(_count(domain), dtype=np.int32)]
    owner = np.full(_count(domain), -1, dtype=np.int32)
    by_material = []
    for i, material in enumerate(materials):
        if not material.on:
            raise InputError(
                f"material.{i}.on: missing; accepted: with several materials, the regions of "
                f"each ({', '.join(sorted(domain.regions))})",
                "missing",
            )
        cells = np.unique(np.concatenate([domain.cells(name) for name in material.on]))
        previous = owner[cells].max(initial=-1)
        other = domain.comm.allreduce(int(previous), op=MPI.MAX)
        if other >= 0:
            raise InputError(
                f"material.{i}.on: {', '.join(material.on)} shares cells with the regions of "
                f"material.{other} ({', '.join(materials[other].on)}); accepted: each cell in one",
                "regions",
            )
        owner[cells] = i
        by_material.append(cells.astype(np.int32))
    _check_all(domain, owner)
    return by_material


def young_behind(
    domain: Domain, materials: Sequence[Material], cells: Sequence[Indices], on: str
) -> float:
    """Return the largest Young's modulus in the cells at a part. Collective."""
    behind, _ = cells_at(domain.mesh, domain.facets(on))
    at_part = [np.intersect1d(behind, indices) for indices in cells]
    largest = [young.max(initial=0.0) for young in _young(domain, materials, at_part)]
    return domain.comm.allreduce(float(max(largest, default=0.0)), op=MPI.MAX)


class Softest(NamedTuple):
    """Elastic constants of small strains where Young's modulus is the least."""

    young: float  #: (stress)
    poisson: float
    bulk: float  #: (stress)
    shear: float  #: (stress)


def softest(domain: Domain, materials: Sequence[Material], cells: Sequence[Indices]) -> Softest:
    """Return the constants of the softest material in cells, with its factor. Collective."""
    least = [young.min(initial=np.inf) for young in _young(domain, materials, cells)]
    youngs = np.array(least)
    domain.comm.Allreduce(MPI.IN_PLACE, youngs, op=MPI.MIN)
    index = int(np.argmin(youngs))
    law, young = materials[index].law, float(youngs[index])
    factor = young / float(law.young)
    return Softest(young, float(law.poisson), factor * float(law.bulk), factor * float(law.shear))


def _young(
    domain: Domain, materials: Sequence[Material], cells: Sequence[Indices]
) -> Iterator[Array]:
    """Yield Young's moduli of each material in cells, with its factor. Collective."""
    for material, indices in zip(materials, cells, strict=True):
        yield float(material.law.young) * factor_of(domain, material, indices)


def _check_all(domain: Domain, owner: Indices) -> None:
    """Refuse cells without a material, by the name of their region."""
    unassigned = domain.comm.allreduce(int(np.count_nonzero(owner < 0)), op=MPI.SUM)
    if unassigned == 0:
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
        f"material: {unassigned} cells of the mesh are in no region and have none; accepted: a "
        "region (physical group) for each cell, or one material without `on` for the whole mesh",
        "regions",
    )


def _count(domain: Domain) -> int:
    return int(domain.mesh.topology.index_map(domain.dim).size_local)


def solids_of(
    domain: Domain,
    materials: Sequence[Material],
    cells: Sequence[Indices],
    rules: Sequence[Rule],
    laws: QuadratureLaws,
) -> list[Solid]:
    """Return the materials for the weak form, by quadrature rule and part of the body. Collective.

    Numbers are form constants and the subdomain of each measure is 0: materials of one law share
    the compiled form. Large bodies are divided, for dolfinx packs the values of each function in
    all cells of a form, far more values than unknowns.
    """
    most = domain.comm.allreduce(max(indices.size for indices in cells), op=MPI.MAX)
    parts = [np.array_split(indices, most // (4 * CHUNK) + 1) for indices in cells]
    solids = []
    for number, (degree, strains) in enumerate(rules):
        for part in zip(*parts, strict=True):
            for material, indices in zip(materials, part, strict=True):
                piezo, seen = material.piezo, strains
                if isinstance(material.law, HistoryLaw):
                    seen = ((1, laws.kinematics),)  # stresses at points are those of all strains
                    if number > 0:
                        continue
                law = laws.law(form_law(material, domain.mesh))
                constants = None if piezo is None else piezo_with_constants(piezo, domain.mesh)
                dx = domain.dx_over(indices)(metadata={"quadrature_degree": degree})
                solids.append(Solid(law, constants, seen, dx))
    return solids


def form_law(material: Material, mesh: Mesh) -> Law | Graded:
    """Return the law of a material with form constants, and with its factor. Collective."""
    law = _with_constants(material.law, mesh)
    if material.factor is None or isinstance(law, HistoryLaw):
        return law
    return Graded(law, ufl.as_ufl(material.factor.ufl(ufl.SpatialCoordinate(mesh))))


def factor_of(domain: Domain, material: Material, cells: Indices) -> Array:
    """Return the factor of a material > 0 in the middle of cells, shape (cells,). Collective."""
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
