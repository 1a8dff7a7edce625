"""The set-up of a case in one figure: mesh, conditions on its parts, foundation, dimensions."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from dolfinx import mesh as dmesh
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from scipy.spatial import KDTree

from contact import _compat
from contact.case.file import Case, literal
from contact.mesh.cells import facet_of, shape_of
from contact.mesh.domain import Domain, Indices
from contact.mesh.entities import exterior_facets
from contact.mesh.geometry import facet_normals
from contact.model.fields import Field, Moving, at_time
from contact.plot.foundation import add_foundation, facing
from contact.plot.space import Camera, rendered
from contact.plot.style import BLUE, SKY, STYLE, heading
from contact.problem.problem import ContactProblem
from contact.results.options import Units
from contact.typing import Array

#: Colours of conditions, one after the other, and of foundations.
COLOURS, FOUNDATION = matplotlib.colormaps["tab10"].colors, "#666666"

#: Cells up to which the mesh is drawn, and most arrows of a load on one part.
MOST_CELLS, ARROWS = 20_000, 32

#: Keys of a section that its entry in the legend leaves out, and the length of the entry.
UNSAID, LONGEST = {"on", "against", "name", "amplitude"}, 68


@dataclass(frozen=True)
class Role:
    """A condition on a part: its facets by their corners, and a given force on each.

    Attributes
    ----------
    facets, force
        Shape (n, c, d), and (n, d) or None.
    words, colour
        Its entry in the legend.
    electric
        Whether it is one of a potential, drawn below and beside those of displacements.
    """

    facets: Array
    words: str
    colour: Any
    force: Array | None = None
    electric: bool = False

    def arrows(self, middle: Array, reach: float) -> tuple[Array, Array]:
        """Return starts and steps of a load's arrows, the longest of a length, outside the body."""
        if self.force is None or not np.any(self.force):
            return self.facets[:0, 0], self.facets[:0, 0]
        centre = self.facets.mean(axis=1)
        places = np.linspace(0, len(centre) - 1, min(ARROWS, len(centre))).round().astype(int)
        chosen = np.lexsort(centre.T)[places]
        lengths = np.linalg.norm(self.force, axis=1)
        chosen = chosen[lengths[chosen] > 0.02 * lengths.max()]
        step, centre = reach * self.force[chosen] / lengths.max(), centre[chosen]
        pulls = np.einsum("ni,ni->n", step, centre - middle) > 0
        return centre - np.where(pulls[:, None], 0.0, step), step


def save_setup(case: Case, problem: ContactProblem, folder: Path) -> list[Path]:
    """Draw a set-up into ``CASE-setup.png`` and ``.pdf``; return the files. Collective."""
    figure = draw_setup(case, problem)
    if figure is None:
        return []
    paths = [folder / f"{Path(case.source).stem}-setup.{ending}" for ending in ("png", "pdf")]
    for path in paths:
        figure.savefig(path, dpi=300)
    return paths


def draw_setup(case: Case, problem: ContactProblem) -> Figure | None:
    """Draw a case and the problem that was built of it on rank 0; None elsewhere. Collective."""
    domain, colours = problem.domain, cycle(COLOURS)
    for other in (0, domain.dim):
        domain.mesh.topology.create_connectivity(domain.dim - 1, other)
    given = [(words, *_gathered(domain, *rest)) for words, *rest in _conditions(case, problem)]
    (boundary,) = _gathered(domain, _corners(domain, exterior_facets(domain.mesh)))
    owned = slice(domain.mesh.topology.index_map(domain.dim).size_local)
    places = _compat.geometry_dofmap(domain.mesh)[owned, : shape_of(domain.mesh).corners]
    (cells,) = _gathered(domain, domain.mesh.geometry.x[places][..., : domain.dim])
    surface = _foundation(problem)
    if domain.comm.rank > 0:
        return None
    roles = [
        Role(facets, words, next(colours), force, "potential" in words or "electrode" in words)
        for words, facets, force in given
    ]
    with matplotlib.rc_context(STYLE):
        draw = _draw_plane if domain.dim == 2 else _draw_space
        figure = draw(boundary, cells, roles, surface, case.case.units, "xr"[domain.revolved])
        figure.suptitle(heading(case.title), fontsize="medium")
        figure.legend(loc="outside lower center", ncols=2, fontsize=7, handlelength=4)
    return figure


def _foundation(problem: ContactProblem) -> Array:
    """Return contact nodes, and where they would meet rigid foundations, (m, 2, d). Collective."""
    found: list[Array] = [np.zeros((0, 2, problem.dim))]
    for contact, geometry in zip(problem.contacts, problem.geometries, strict=True):
        nodes = geometry.nodes
        if contact.against is not None:
            continue
        near = np.isfinite(nodes.gap)
        places = nodes.points + np.where(near, nodes.gap, 0.0)[:, None] * nodes.normal
        found.append(nodes.gather(np.stack([nodes.points, places], axis=1)[near]))
    return np.concatenate(found)


def _shape(facets: Array, surface: Array, diameter: float) -> Any:
    """Return the rigid shapes in front of the facets of contact nodes, shape (n, c, 3)."""
    if not surface.size:
        return facing(facets[:0], facets[:0, :, 0], diameter)
    apart, nodes = KDTree(surface[:, 0]).query(facets)
    places = np.where((apart > 1e-9 * diameter)[..., None], np.nan, surface[nodes, 1])
    return facing(places, np.linalg.norm(places - facets, axis=2), diameter)


def _conditions(case: Case, problem: ContactProblem) -> Iterator[tuple[str, Array, Array | None]]:
    """Yield conditions: words, facets of this rank, and the force on each."""
    domain = problem.domain
    for key, section in case.contacts:
        friction, electric = case.friction_of(key, section)[1], case.electric_of(key, section)[1]
        laws = "" if friction.law == "none" else f"{friction.law.capitalize()} friction"
        laws += "" if electric is None else f", k_e = {electric.k_e:g}"
        yield _words("contact", section, laws.removeprefix(", ")), _facets(domain, section.on), None
        if section.against is not None:
            yield f"opposite: {section.against}", _facets(domain, section.against), None
    for key in ("fixed", "elastic", "bolt", "electrode", "rigid"):
        for section in getattr(case, key):
            yield _words(key, section), _facets(domain, section.on), None
    for given, load in zip(case.load, problem.body.loads, strict=True):
        if given.on is None:
            continue
        corners = _facets(domain, given.on)
        middle = corners.mean(axis=1)
        force = np.zeros_like(middle)
        if (density := load.density or load.force) is not None:
            force += np.column_stack([_values(field, middle) for field in density])
        if load.pressure is not None:
            normal = facet_normals(domain, given.on, 1)[2].mean(axis=1)
            normal /= np.linalg.norm(normal, axis=1)[:, None]
            force -= _values(load.pressure, middle)[:, None] * normal
        yield _words("load", given), corners, force


def _values(field: Field | Moving, points: Array) -> Array:
    """Return values of a field at points; of one that moves at the end of an evolution."""
    return np.asarray(at_time(field, 1.0).numpy(points))


def _words(key: str, section: Any, more: str = "") -> str:
    """Return the entry of a section in the legend: its keys as in the case file."""
    table = section.model_dump(by_alias=True, exclude_none=True, exclude_unset=True)
    said = [more] * bool(more)
    said += [f"{k} = {literal(v)}" for k, v in table.items() if k not in UNSAID]
    against = f" against {section.against}" if getattr(section, "against", None) else ""
    words = f"{key} {section.on}{against}{': ' * bool(said)}{', '.join(said)}"
    return textwrap.shorten(words.replace("$", ""), LONGEST, placeholder=" ...")


def _facets(domain: Domain, part: str) -> Array:
    """Return the facets of a part on this rank by their corners."""
    return _corners(domain, domain.facets_anywhere(part))


def _corners(domain: Domain, facets: Indices) -> Array:
    """Return the corners of facets of this rank, around a quadrilateral, shape (n, c, d)."""
    shape = shape_of(domain.mesh).facet
    if not facets.size:  # which `entities_to_geometry` divides by
        return np.empty((0, shape.corners, domain.dim))
    places = dmesh.entities_to_geometry(domain.mesh, domain.dim - 1, facets)
    return np.asarray(domain.mesh.geometry.x[places[:, shape.around]][..., : domain.dim])


def _gathered(domain: Domain, *values: Array | None) -> list[Any]:
    """Return values of all ranks on rank 0, None elsewhere, and for None. Collective."""
    every = [None if own is None else domain.comm.gather(own) for own in values]
    return [None if parts is None else np.concatenate(parts) for parts in every]


def _draw_plane(
    boundary: Array, cells: Array, roles: Sequence[Role], surface: Array, units: Units, axis: str
) -> Figure:
    """Draw a plane body by its boundary edges, shape (m, 2, 2), and cells, shape (n, c, 2)."""
    extent = np.ptp(boundary, axis=(0, 1))
    figure = Figure(figsize=(6.9, float(np.clip(6.0 * extent[1] / extent[0], 1.6, 6.0)) + 1.6))
    ax = figure.subplots()
    ax.add_collection(LineCollection(list(boundary), colors="0.4", lw=0.6))
    if len(cells) <= MOST_CELLS:
        around = facet_of(cells.shape[1]).around
        thin = {"edgecolor": "0.75", "lw": 0.3, "rasterized": len(cells) > 2000}
        ax.add_collection(PolyCollection(list(cells[:, around]), facecolor="none", **thin))
    middle = cells.reshape(-1, 2).mean(axis=0)
    for role in roles:
        wide, above = (7.0, 1.5) if role.electric else (3.0 if role.force is None else 1.5, 2.0)
        lines = LineCollection(list(role.facets), colors=[role.colour], lw=wide)
        lines.set(label=role.words, capstyle="butt", zorder=above)
        ax.add_collection(lines)
        start, step = role.arrows(middle, 0.12 * float(extent.max()))
        if start.size:
            arrows = {
                "angles": "xy",
                "scale_units": "xy",
                "scale": 1.0,
                "width": 0.0025,
                "zorder": 3,
            }
            ax.quiver(*start.T, *step.T, color=role.colour, **arrows)
            ax.update_datalim(np.concatenate([start, start + step]))
    if surface.size:
        ax.plot(*surface[:, 1].T, ".", ms=4, color=FOUNDATION, label="foundation")
    ax.set_title(_sizes(extent, units), fontsize=8)
    ax.set_aspect("equal")
    ax.margins(0.03)
    ax.autoscale_view()
    ax.set_xlabel(units.label(f"${axis}$", "length"))
    ax.set_ylabel(units.label("$z$" if axis == "r" else "$y$", "length"))
    return figure


def _draw_space(
    boundary: Array, cells: Array, roles: Sequence[Role], surface: Array, units: Units, axis: str
) -> Figure:
    """Draw a body in 3-D by the facets of its boundary, shape (m, c, 3); see `_draw_plane`."""
    points = boundary.reshape(-1, 3)
    extent = np.ptp(points, axis=0)
    arrows = [role.arrows(points.mean(axis=0), 0.2 * float(extent.max())) for role in roles]
    shape = _shape(boundary, surface, float(extent.max()))

    def add(plotter: Any) -> None:
        import pyvista

        def facets(given: Array) -> Any:
            corners = np.arange(given[..., 0].size).reshape(len(given), -1)
            return pyvista.PolyData.from_regular_faces(given.reshape(-1, 3), corners)

        edges = {"show_edges": len(boundary) <= MOST_CELLS, "edge_opacity": 0.4, "line_width": 0.5}
        plotter.add_mesh(facets(boundary), color="#EEEEEE", opacity=0.3, **edges)
        for role, (start, step) in zip(roles, arrows, strict=True):
            look = {"style": "wireframe", "line_width": 6.0} if role.electric else {"opacity": 0.5}
            plotter.add_mesh(facets(role.facets), color=role.colour, lighting=False, **look)
            if start.size:
                plotter.add_arrows(start, step, color=role.colour)
        if shape.n_cells:
            add_foundation(plotter, shape)

    seen = np.concatenate([points, shape.points, *(start for start, _ in arrows)])
    figure = Figure(figsize=(6.9, 6.0))
    ax = figure.subplots()
    ax.axis("off")
    for image in rendered(add, [Camera.of(np.array([1.0, -1.6, 0.5]), seen)]):
        ax.imshow(image)
    ax.set_title(_sizes(extent, units), y=-0.02, fontsize=8)
    for role in roles:
        ax.plot([], [], "s", color=role.colour, label=role.words)
    if shape.n_cells:
        ax.plot([], [], "s", color=BLUE, markerfacecolor=to_rgba(SKY, 0.3), label="foundation")
    return figure


def _sizes(extent: Array, units: Units) -> str:
    """Return the dimensions of a body in words."""
    sides = r" $\times$ ".join(f"{side:.4g}" for side in extent)
    return f"{sides} {units.length or ''}".rstrip()
