"""The set-up of a case in one figure: mesh, supports, electrodes, loads, foundation, dimensions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from dolfinx import mesh as dmesh
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from contact import _compat
from contact.case.file import Case
from contact.mesh.domain import Domain, Indices
from contact.mesh.entities import exterior_facets
from contact.output.figures.body import rendered
from contact.output.figures.style import BLUE, GREEN, ORANGE, SKY, STYLE, axes_of, heading
from contact.output.options import Units
from contact.problem.problem import ContactProblem
from contact.typing import Array

#: Colours of supports, electrodes, loads, contact parts and foundations.
HELD, ELECTRODE, LOADED, TOUCHED, FOUNDATION = "#000000", GREEN, ORANGE, BLUE, SKY

#: Cells up to which the mesh is drawn.
MOST_CELLS = 20_000

#: Arrows of a load on one part, and strokes along a support.
ARROWS, STROKES = 12, 30


@dataclass(frozen=True)
class Role:
    """A part of the boundary and its data.

    Attributes
    ----------
    facets
        Its facets by their corners, shape (n, d, d).
    colour, words
        How it is drawn, and its entry in the legend.
    hatched
        Whether it is held.
    force
        Given force on each facet, shape (n, d); None for none.
    """

    facets: Array
    colour: str
    words: str
    hatched: bool = False
    force: Array | None = None


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
        draw = _draw_plane if domain.dim == 2 else _draw_space
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


def _draw_plane(
    boundary: Array, cells: Array, roles: Sequence[Role], surface: Array, units: Units, axes: str
) -> Figure:
    """Draw a plane body: mesh, data of its parts, foundation and dimensions.

    Parameters
    ----------
    boundary, cells
        Corners of the edges on the boundary and of the cells, shapes (m, 2, 2) and (n, 3, 2).
    roles
        The parts with their data.
    surface
        Points of rigid foundations, shape (m, 2).
    units, axes
        Names of the units and of the coordinates.
    """
    low, high = boundary.min(axis=(0, 1)), boundary.max(axis=(0, 1))
    extent = high - low
    diameter = float(extent.max())
    figure = Figure(figsize=(6.9, float(np.clip(6.0 * extent[1] / extent[0], 1.6, 6.0)) + 1.6))
    ax = figure.subplots()
    ax.add_collection(LineCollection(list(boundary), colors="0.4", lw=0.6))
    if len(cells) <= MOST_CELLS:
        corners = np.arange(3 * len(cells)).reshape(-1, 3)
        thin = {"color": "0.75", "lw": 0.3, "rasterized": len(cells) > 2000}
        ax.triplot(*cells.reshape(-1, 2).T, corners, **thin)
    middle = cells.reshape(-1, 2).mean(axis=0)
    for role in roles:
        wide = 3.0 if role.colour in (TOUCHED, ELECTRODE) else 1.5
        lines = LineCollection(list(role.facets), colors=role.colour, lw=wide, label=role.words)
        lines.set_alpha(0.6 if role.colour == ELECTRODE else 1.0)
        ax.add_collection(lines)
        if role.hatched:
            _hatch(ax, role, middle, 0.02 * diameter)
        if role.force is not None:
            _arrows(ax, role, middle, 0.12 * diameter)
    if surface.size:
        order = np.lexsort(surface.T[::-1])
        ax.plot(*surface[order].T, ".", ms=2, color=FOUNDATION, label="foundation")
    _dimensions(ax, low, high, units)
    ax.set_aspect("equal")
    ax.margins(0.03)
    ax.autoscale_view()
    ax.set_xlabel(units.label(f"${axes[0]}$", "length"))
    ax.set_ylabel(units.label(f"${axes[1]}$", "length"))
    figure.legend(loc="outside lower center", ncols=2, fontsize=7)
    return figure


def _outwards(facets: Array, middle: Array) -> Array:
    """Return unit normals of edges that point away from the middle of the body, shape (n, 2)."""
    along = facets[:, 1] - facets[:, 0]
    out = np.column_stack([along[:, 1], -along[:, 0]])
    out /= np.linalg.norm(out, axis=1)[:, None]
    side = np.einsum("ni,ni->n", out, facets.mean(axis=1) - middle)
    return np.asarray(out * np.sign(side)[:, None])


def _hatch(ax: Axes, role: Role, middle: Array, length: float) -> None:
    """Draw short strokes outwards from a support."""
    facets = role.facets[_spread(role.facets, STROKES)]
    out, centre = _outwards(facets, middle), facets.mean(axis=1)
    skew = out + 0.6 * np.column_stack([-out[:, 1], out[:, 0]])
    ax.add_collection(
        LineCollection(
            list(np.stack([centre, centre + length * skew], axis=1)), colors=HELD, lw=0.6
        )
    )


def _arrows(ax: Axes, role: Role, middle: Array, reach: float) -> None:
    """Draw a load's arrows outside the body, the longest of a given length."""
    assert role.force is not None
    centre = role.facets.mean(axis=1)
    chosen = _spread(role.facets, ARROWS)
    force = role.force[chosen]
    largest = float(np.linalg.norm(role.force, axis=1).max(initial=0.0))
    if largest == 0:
        return
    step = reach * force / largest
    seen = np.linalg.norm(step, axis=1) > 0.02 * reach
    pulls = np.einsum("ni,ni->n", step, _outwards(role.facets[chosen], middle)) > 0
    start = centre[chosen] - np.where(pulls[:, None], 0.0, step)
    arrows = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.0025}
    ax.quiver(*start[seen].T, *step[seen].T, color=LOADED, **arrows)
    for ends in (start, start + step):  # for the limits of the axes
        ax.plot(*ends[seen].T, ls="", marker="")


def _spread(facets: Array, count: int) -> NDArray[np.intp]:
    """Return about so many edges of a part, each in turn the farthest from those before."""
    centre = facets.mean(axis=1)
    apart = np.linalg.norm(facets[:, 1] - facets[:, 0], axis=1).sum() / count
    chosen, distance = [np.lexsort(centre.T)[0]], np.full(len(centre), np.inf)
    while True:
        last = np.linalg.norm(centre - centre[chosen[-1]], axis=1)
        distance = np.minimum(distance, last)
        if distance.max() < (1 - 1e-9) * apart:
            return np.asarray(chosen, dtype=np.intp)
        chosen.append(np.argmax(distance))


def _dimensions(ax: Axes, low: Array, high: Array, units: Units) -> None:
    """Write width and height along the box of the body."""
    unit = f" {units.length}" if units.length else ""
    size = float((high - low).max())
    for axis in range(2):
        other = 1 - axis
        ends = np.array([low, low])
        ends[1, axis] = high[axis]
        ends[:, other] = low[other] - 0.09 * size if axis == 0 else high[other] + 0.05 * size
        ax.annotate("", ends[1], ends[0], arrowprops={"arrowstyle": "<->", "lw": 0.6})
        ax.plot(*ends.T, ls="", marker="")
        text = f"{high[axis] - low[axis]:g}{unit}"
        place = {"ha": "center", "va": "center", "rotation": 90.0 * axis, "fontsize": 8}
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
        ax.text(*ends.mean(axis=0), text, bbox=box, **place)  # type: ignore[arg-type]


def _draw_space(
    boundary: Array, cells: Array, roles: Sequence[Role], surface: Array, units: Units, axes: str
) -> Figure:
    """Draw a body in 3-D by the facets of its boundary, shape (m, 3, 3); see `_draw_plane`."""
    corners = [boundary.reshape(-1, 3), surface.reshape(-1, 3)]
    reach = 0.2 * float(np.ptp(corners[0], axis=0).max())
    arrows = []
    for role in roles:
        if role.force is not None and np.any(role.force):
            step = reach * role.force / np.linalg.norm(role.force, axis=1).max()
            chosen = np.linspace(0, len(step) - 1, min(ARROWS, len(step))).astype(int)
            arrows.append(((role.facets.mean(axis=1) - step)[chosen], step[chosen]))
            corners.append(arrows[-1][0])

    def add(plotter: Any) -> None:
        import pyvista

        def facets(given: Array) -> Any:
            corners = np.arange(3 * len(given)).reshape(-1, 3)
            return pyvista.PolyData.from_regular_faces(given.reshape(-1, 3), corners)

        edges = {"show_edges": len(boundary) <= MOST_CELLS, "edge_opacity": 0.4, "line_width": 0.5}
        plotter.add_mesh(facets(boundary), color="#EEEEEE", opacity=0.3, **edges)
        for role in roles:
            if not role.hatched:
                lit = {"opacity": 0.7, "ambient": 0.6, "diffuse": 0.4}
                plotter.add_mesh(facets(role.facets), color=role.colour, **lit)
        for start, step in arrows:
            plotter.add_arrows(start, step, color=LOADED)
        if surface.size:
            plotter.add_points(surface, color=FOUNDATION, point_size=5.0)

    seen = np.concatenate(corners)
    image = rendered(add, (1.0, -1.6, 0.5), np.array([seen.min(axis=0), seen.max(axis=0)]))
    figure = Figure(figsize=(6.9, 6.0))
    ax = figure.subplots()
    ax.axis("off")
    if image is not None:
        ax.imshow(image)
    sides = r" $\times$ ".join(f"{side:.4g}" for side in np.ptp(corners[0], axis=0))
    ax.set_title(f"{sides}{f' {units.length}' if units.length else ''}", y=-0.02, fontsize=8)
    for role in roles:
        face = "none" if role.hatched else role.colour
        ax.plot([], [], "s", color="0.6", markerfacecolor=face, label=role.words)
    if surface.size:
        ax.plot([], [], "o", ms=3, color=FOUNDATION, label="foundation")
    figure.legend(loc="outside lower center", ncols=2, fontsize=7)
    return figure
