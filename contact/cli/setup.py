"""The set-up of a case in one figure: mesh, supports, electrodes, loads, foundation, dimensions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from dolfinx import mesh as dmesh
from matplotlib.figure import Figure

from contact import _compat
from contact.case.file import Case
from contact.mesh.domain import Domain, Indices
from contact.mesh.entities import exterior_facets
from contact.output.figures.setup import (
    ELECTRODE,
    FOUNDATION,
    HELD,
    LOADED,
    TOUCHED,
    Role,
    draw_plane,
    draw_space,
)
from contact.output.figures.style import STYLE, axes_of, heading
from contact.problem.problem import ContactProblem
from contact.typing import Array


def draw_setup(case: Case, problem: ContactProblem) -> Figure | None:
    """Draw a set-up on rank 0; None elsewhere. Collective.

    Parameters
    ----------
    case, problem
        The case, and the problem that was built of it.
    """
    domain = problem.domain
    for other in (0, domain.dim):
        domain.mesh.topology.create_connectivity(domain.dim - 1, other)
    roles = list(_roles(case, problem))
    boundary = _corners(domain, domain.dim - 1, exterior_facets(domain.mesh))
    cells, surface = _corners(domain, domain.dim, _owned(domain)), _foundation(problem)
    if boundary is None or cells is None:
        return None
    given = [role for role in roles if role is not None]
    with matplotlib.rc_context(STYLE):
        draw = draw_plane if domain.dim == 2 else draw_space
        figure = draw(boundary, cells, given, surface, case.case.units, axes_of(domain.revolved))
        figure.suptitle(heading(case.title), fontsize="medium")
    return figure


def _foundation(problem: ContactProblem) -> Array:
    """Return where the contact nodes would meet rigid foundations, shape (m, d). Collective."""
    found: list[Array] = [np.zeros((0, problem.dim))]
    for nodes in (entry.nodes for entry in problem.entries if entry.coupling is None):
        near = np.isfinite(nodes.gap)
        found.append(nodes.gather((nodes.points + nodes.gap[:, None] * nodes.normal)[near]))
    return np.concatenate(found)


def save_setup(case: Case, problem: ContactProblem, folder: Path) -> list[Path]:
    """Draw a set-up into ``CASE-setup.png`` and ``.pdf``; return the files. Collective."""
    figure = draw_setup(case, problem)
    if figure is None:
        return []
    stem = Path(case.source).stem
    paths = [folder / f"{stem}-setup.{ending}" for ending in ("png", "pdf")]
    for path in paths:
        figure.savefig(path, dpi=300)
    return paths


def _roles(case: Case, problem: ContactProblem) -> Iterable[Role | None]:
    """Yield the conditions on each part, None on ranks other than 0. Collective."""
    domain = problem.domain
    for key, section in case.contacts:
        yield _role(domain, section.on, TOUCHED, _contact_words(case, key, section))
        if section.against is not None:
            yield _role(domain, section.against, FOUNDATION, f"opposite: {section.against}")
    for fixed in case.fixed:
        if fixed.displacement is not None:
            words = f"$u$ = ({_listed(fixed.displacement)}) on {fixed.on}"
            yield _role(domain, fixed.on, HELD, words, hatched=True)
        if fixed.potential is not None:
            words = rf"$\varphi$ = {_said(fixed.potential)} on {fixed.on}"
            yield _role(domain, fixed.on, ELECTRODE, words)
    for given, load in zip(case.load, problem.body.loads, strict=True):
        if given.on is None:
            continue
        words = _load_words(given)
        if words:
            yield _role(domain, given.on, LOADED, f"{words} on {given.on}", load=load)


def _contact_words(case: Case, key: str, section: Any) -> str:
    """Return the contact parts, with friction and current, in words."""
    words = [f"contact: {section.on}"]
    if section.against is not None:
        words[0] += f" against {section.against}"
    if section.gap is not None and _said(section.gap) != "0":
        words.append(f"gap {_said(section.gap)}")
    friction, electric = case.friction_of(key, section)[1], case.electric_of(key, section)[1]
    if friction.law != "none":
        words.append(f"{friction.law.capitalize()} friction")
    if electric is not None:
        words.append(rf"$k_e$ = {electric.k_e:g}, $\varphi_F$ = {_said(electric.phi_f)}")
    return ", ".join(words)


def _listed(values: Sequence[Any]) -> str:
    return ", ".join(map(_said, values))


def _said(value: Any) -> str:
    """Return a number or a formula of the case file as it stands there."""
    source = getattr(value, "source", value)
    return f"{source:g}" if isinstance(source, float) else str(source).replace("$", "")


def _load_words(given: Any) -> str:
    """Return the components of a load that are not zero."""
    said = []
    if given.traction is not None:
        said.append(f"traction ({_listed(given.traction)})")
    if given.pressure is not None:
        said.append(f"pressure {_said(given.pressure)}")
    if given.charge is not None and _said(given.charge) != "0":
        said.append(f"charge {_said(given.charge)}")
    return ", ".join(said)


def _role(
    domain: Domain, part: str, colour: str, words: str, hatched: bool = False, load: Any = None
) -> Role | None:
    indices = domain.facets(part)
    corners = _corners(domain, domain.dim - 1, indices)
    force = None
    if load is not None and load.force is not None:
        middles = _local(domain, domain.dim - 1, indices).mean(axis=1)
        columns = [_values(field, middles) for field in load.force]
        force = _gathered(domain, np.column_stack(columns))
    return None if corners is None else Role(corners, colour, words, hatched, force)


def _values(field: Any, points: Array) -> Array:
    """Return a field at points, at the end of an evolution where it moves. Collective."""
    here = field.at(1.0) if hasattr(field, "at") else field
    return np.broadcast_to(here.numpy(points), (len(points),)).astype(float)


def _owned(domain: Domain) -> Indices:
    count = domain.mesh.topology.index_map(domain.dim).size_local
    return np.arange(count, dtype=np.int32)


def _local(domain: Domain, dim: int, entities: Indices) -> Array:
    """Return the corners of entities of this rank, shape (n, corners, d)."""
    mesh = domain.mesh
    if not entities.size:  # which `entities_to_geometry` divides by
        return np.empty((0, dim + 1, domain.dim))
    if dim == domain.dim:
        places = _compat.geometry_dofmap(mesh)[entities][:, : dim + 1]
    else:
        places = dmesh.entities_to_geometry(mesh, dim, entities)
    return np.asarray(mesh.geometry.x[places][..., : domain.dim])


def _corners(domain: Domain, dim: int, entities: Indices) -> Array | None:
    return _gathered(domain, _local(domain, dim, entities))


def _gathered(domain: Domain, values: Array) -> Array | None:
    parts = domain.comm.gather(values)
    return None if parts is None else np.concatenate(parts)
