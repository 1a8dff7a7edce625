"""The set-up of a case in one figure: mesh, supports, electrodes, loads, foundation, dimensions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from dolfinx import mesh as dmesh
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from contact import _compat
from contact.case.file import Case
from contact.mesh.cells import facet_of, shape_of
from contact.mesh.domain import Domain, Indices
from contact.mesh.entities import exterior_facets, paths
from contact.mesh.geometry import facet_normals
from contact.model.fields import Field, Moving, at_time
from contact.plot.space import Camera, rendered
from contact.plot.style import BLUE, GREEN, ORANGE, PURPLE, SKY, STYLE, YELLOW, heading
from contact.problem.problem import ContactProblem
from contact.results.options import Units
from contact.typing import Array

#: Colours of supports, loads, contact parts and foundations.
HELD, LOADED, TOUCHED, FOUNDATION = "#000000", ORANGE, BLUE, SKY

#: Colours of electrodes, one after the other.
ELECTRODES = (GREEN, PURPLE, YELLOW)

#: Lines of rollers, elastic supports, and bolts and electrodes of unknown potential.
ROLLERS, ELASTIC, UNKNOWN = "-.", ":", "--"

#: Cells up to which the mesh is drawn, and most arrows of a load on one part.
MOST_CELLS, ARROWS = 20_000, 32


@dataclass(frozen=True)
class Role:
    """A part of the boundary and its data.

    Attributes
    ----------
    facets
        Its facets by their corners, shape (n, d, d).
    colour, words
        How it is drawn, and its entry in the legend.
    force
        Given force on each facet, shape (n, d); None for none.
    dashes
        Style of its line in 2-D, by which roles of one colour differ.
    """

    facets: Array
    colour: str
    words: str
    force: Array | None = None
    dashes: str = "-"

    @property
    def outlined(self) -> bool:
        """Whether its facets are drawn by their edges in 3-D, so that others on them are seen."""
        return self.colour in (HELD, *ELECTRODES)

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
    stem = Path(case.source).stem
    paths = [folder / f"{stem}-setup.{ending}" for ending in ("png", "pdf")]
    for path in paths:
        figure.savefig(path, dpi=300)
    return paths


def draw_setup(case: Case, problem: ContactProblem) -> Figure | None:
    """Draw a case and the problem that was built of it on rank 0; None elsewhere. Collective."""
    domain = problem.domain
    for other in (0, domain.dim):
        domain.mesh.topology.create_connectivity(domain.dim - 1, other)
    roles = list(_roles(case, problem))
    boundary = _gathered(domain, _corners(domain, exterior_facets(domain.mesh)))
    owned = slice(domain.mesh.topology.index_map(domain.dim).size_local)
    places = _compat.geometry_dofmap(domain.mesh)[owned, : shape_of(domain.mesh).corners]
    cells = _gathered(domain, domain.mesh.geometry.x[places][..., : domain.dim])
    surface = _foundation(problem)
    if boundary is None or cells is None:
        return None
    given = [role for role in roles if role is not None]
    with matplotlib.rc_context(STYLE):
        draw = _draw_plane if domain.dim == 2 else _draw_space
        axes = "rz" if domain.revolved else "xy"
        figure = draw(boundary, cells, given, surface, case.case.units, axes)
        figure.suptitle(heading(case.title), fontsize="medium")
        figure.legend(loc="outside lower center", ncols=2, fontsize=7, handlelength=4)
    return figure


def _foundation(problem: ContactProblem) -> Array:
    """Return where the contact nodes would meet rigid foundations, shape (m, d). Collective."""
    found: list[Array] = [np.zeros((0, problem.dim))]
    for nodes in (entry.nodes for entry in problem.entries if entry.coupling is None):
        near = np.isfinite(nodes.gap)
        found.append(nodes.gather((nodes.points + nodes.gap[:, None] * nodes.normal)[near]))
    return np.concatenate(found)


def _roles(case: Case, problem: ContactProblem) -> Iterable[Role | None]:
    """Yield the conditions on each part, None on ranks other than 0. Collective."""
    domain, colours = problem.domain, cycle(ELECTRODES)
    for key, section in case.contacts:
        yield _role(domain, section.on, TOUCHED, _contact_words(case, key, section))
        if section.against is not None:
            yield _role(domain, section.against, FOUNDATION, f"opposite: {section.against}")
    for fixed in case.fixed:
        if fixed.symmetry is not None:
            words = f"symmetry across ${fixed.symmetry}$ on {fixed.on}"
            yield _role(domain, fixed.on, HELD, words, dashes=ROLLERS)
        if fixed.displacement is not None:
            words = f"$u$ = ({_said(*fixed.displacement)}) on {fixed.on}"
            yield _role(domain, fixed.on, HELD, words)
        if fixed.normal is not None:
            words = rf"$u_\nu$ = {_said(fixed.normal)} on {fixed.on}"
            yield _role(domain, fixed.on, HELD, words, dashes=ROLLERS)
        if fixed.potential is not None:
            words = rf"$\varphi$ = {_said(fixed.potential)} on {fixed.on}"
            yield _role(domain, fixed.on, next(colours), words)
    for support in case.elastic:
        yield _role(domain, support.on, HELD, f"elastic support: {support.on}", dashes=ELASTIC)
    for bolt in case.bolt:
        key = "shortening" if bolt.force is None else "force"
        words = f"bolt, {key} {_said(getattr(bolt, key))}: {bolt.on}"
        yield _role(domain, bolt.on, LOADED, words, dashes=UNKNOWN)
    for electrode in case.electrode:
        words = f"electrode of charge {_said(electrode.charge)}: {electrode.on}"
        yield _role(domain, electrode.on, next(colours), words, dashes=UNKNOWN)
    for part in case.rigid:
        yield _role(domain, part.on, HELD, f"rigid part: {part.on}")
    for given, load in zip(case.load, problem.body.loads, strict=True):
        said = []
        if given.traction is not None:
            said.append(f"traction ({_said(*given.traction)})")
        if given.force is not None:
            said.append(f"force ({_said(*given.force)})")
        if given.pressure is not None:
            said.append(f"pressure {_said(given.pressure)}")
        if given.charge is not None and _said(given.charge) != "0":
            said.append(f"charge {_said(given.charge)}")
        if given.on is not None and said:
            words = f"{', '.join(said)} on {given.on}"
            yield _role(domain, given.on, LOADED, words, load.density or load.force, load.pressure)


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


def _said(*values: Any) -> str:
    """Return numbers or formulas of the case file as they stand there."""
    sources = [getattr(value, "source", value) for value in values]
    return ", ".join(f"{s:g}" if isinstance(s, float) else s.replace("$", "") for s in sources)


def _role(
    domain: Domain,
    part: str,
    colour: str,
    words: str,
    given: Sequence[Field | Moving] | None = None,
    pressure: Field | Moving | None = None,
    dashes: str = "-",
) -> Role | None:
    """Return a part on rank 0, None elsewhere; given are its traction and pressure. Collective."""
    corners, force = _corners(domain, domain.facets_anywhere(part)), None
    middle = corners.mean(axis=1)

    def values(field: Field | Moving) -> Array:
        """Return those of a field; of one that moves at the end of an evolution."""
        return np.asarray(at_time(field, 1.0).numpy(middle))

    if given is not None:
        force = np.column_stack([values(field) for field in given])
    if pressure is not None:
        normal = facet_normals(domain, part, 1)[2].mean(axis=1)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        push = -values(pressure)[:, None] * normal
        force = push if force is None else force + push
    facets, force = _gathered(domain, corners), None if force is None else _gathered(domain, force)
    return None if facets is None else Role(facets, colour, words, force, dashes)


def _corners(domain: Domain, facets: Indices) -> Array:
    """Return the corners of facets of this rank, around a quadrilateral, shape (n, c, d)."""
    shape = shape_of(domain.mesh).facet
    if not facets.size:  # which `entities_to_geometry` divides by
        return np.empty((0, shape.corners, domain.dim))
    places = dmesh.entities_to_geometry(domain.mesh, domain.dim - 1, facets)
    return np.asarray(domain.mesh.geometry.x[places[:, shape.around]][..., : domain.dim])


def _gathered(domain: Domain, values: Array) -> Array | None:
    parts = domain.comm.gather(values)
    return None if parts is None else np.concatenate(parts)


def chains(edges: Array) -> list[Array]:
    """Return edges, shape (n, 2, 2), as lines from end to end, each of shape (m, 2).

    Lines that branch are left as edges.
    """
    if not len(edges):
        return []
    points = edges.reshape(-1, 2)
    size = max(float(np.ptp(points, axis=0).max()), np.finfo(float).tiny)
    _, first, number = np.unique(
        np.round(points / (1e-9 * size)), axis=0, return_index=True, return_inverse=True
    )
    ends, places, found = number.reshape(-1, 2), points[first], list[Array]()
    degree = np.bincount(ends.ravel())
    if degree.max() > 2:
        return list(edges)
    for line in paths(ends, len(places)):
        closed = degree[line[0]] > 1
        found.append(places[np.append(line, line[0]) if closed else line])
    return found


def _draw_plane(
    boundary: Array, cells: Array, roles: Sequence[Role], surface: Array, units: Units, axes: str
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
        wide, above = 1.5 if role.colour == LOADED and role.dashes == "-" else 3.0, 2.0
        if role.colour in ELECTRODES:  # on both sides of other lines
            wide, above = 7.0, 1.5
        # Whole lines, for dashes begin anew at each facet.
        lines = LineCollection(chains(role.facets), colors=role.colour, lw=wide, ls=role.dashes)
        lines.set(label=role.words, capstyle="butt", zorder=above)
        ax.add_collection(lines)
        start, step = role.arrows(middle, 0.12 * float(extent.max()))
        if start.size:
            arrows = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.0025}
            ax.quiver(*start.T, *step.T, color=LOADED, **arrows)
            ax.update_datalim(np.concatenate([start, start + step]))
    if surface.size:
        order = np.lexsort(surface.T[::-1])
        ax.plot(*surface[order].T, ".", ms=4, color=FOUNDATION, label="foundation")
    sides = [f"{side:.4g} {units.length or ''}".rstrip() for side in extent]
    ax.text(0.5, 1.01, sides[0], transform=ax.transAxes, ha="center", va="bottom", fontsize=8)
    upright = {"ha": "left", "va": "center", "rotation": 90.0}
    ax.text(1.01, 0.5, sides[1], transform=ax.transAxes, fontsize=8, **upright)  # type: ignore[arg-type]
    ax.set_aspect("equal")
    ax.margins(0.03)
    ax.autoscale_view()
    ax.set_xlabel(units.label(f"${axes[0]}$", "length"))
    ax.set_ylabel(units.label(f"${axes[1]}$", "length"))
    return figure


def _draw_space(
    boundary: Array, cells: Array, roles: Sequence[Role], surface: Array, units: Units, axes: str
) -> Figure:
    """Draw a body in 3-D by the facets of its boundary, shape (m, c, 3); see `_draw_plane`."""
    points = boundary.reshape(-1, 3)
    extent = np.ptp(points, axis=0)
    arrows = [role.arrows(points.mean(axis=0), 0.2 * float(extent.max())) for role in roles]

    def add(plotter: Any) -> None:
        import pyvista

        def facets(given: Array) -> Any:
            corners = np.arange(given[..., 0].size).reshape(len(given), -1)
            return pyvista.PolyData.from_regular_faces(given.reshape(-1, 3), corners)

        edges = {"show_edges": len(boundary) <= MOST_CELLS, "edge_opacity": 0.4, "line_width": 0.5}
        plotter.add_mesh(facets(boundary), color="#EEEEEE", opacity=0.3, **edges)
        for role, (start, step) in zip(roles, arrows, strict=True):
            if role.outlined:
                wide = 2.5 if role.colour == HELD else 6.0
                outline = {"style": "wireframe", "line_width": wide}
                plotter.add_mesh(facets(role.facets), color=role.colour, **outline)
            else:
                lit = {"opacity": 0.7, "ambient": 0.6, "diffuse": 0.4}
                plotter.add_mesh(facets(role.facets), color=role.colour, **lit)
            if start.size:
                plotter.add_arrows(start, step, color=LOADED)
        if surface.size:
            plotter.add_points(surface, color=FOUNDATION, point_size=5.0)

    seen = np.concatenate([points, surface.reshape(-1, 3), *(start for start, _ in arrows)])
    camera = Camera.of(np.array([1.0, -1.6, 0.5]), seen)
    images = rendered(add, [camera])
    figure = Figure(figsize=(6.9, 6.0))
    ax = figure.subplots()
    ax.axis("off")
    for image in images:
        ax.imshow(image)
    sides = r" $\times$ ".join(f"{side:.4g}" for side in extent)
    ax.set_title(f"{sides} {units.length or ''}".rstrip(), y=-0.02, fontsize=8)
    for role in roles:
        edge, face = (role.colour, "none") if role.outlined else ("0.6", role.colour)
        ax.plot([], [], "s", color=edge, markerfacecolor=face, label=role.words)
    if surface.size:
        ax.plot([], [], "o", ms=3, color=FOUNDATION, label="foundation")
    return figure
