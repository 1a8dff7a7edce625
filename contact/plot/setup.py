"""The set-up of a case in one figure: its parts in colours, loads as arrows, the foundation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

import matplotlib
import numpy as np
from dolfinx import mesh as dmesh
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_hex, to_rgba
from matplotlib.figure import Figure
from scipy.spatial import KDTree

from contact.case.file import Case
from contact.mesh.cells import facet_of, shape_of
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices, exterior_facets
from contact.mesh.geometry import area, geometry_nodes, normals_at
from contact.model.fields import at_time, knows_time
from contact.plot.foundation import BEYOND, HATCHED, add_foundation, facing
from contact.plot.run import polygons
from contact.plot.space import Camera, drawable, render
from contact.plot.style import BLUE, SKY, STYLE, heading
from contact.problem.problem import ContactProblem
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array

#: A part: its name in the legend, its facets by their corners, (n, c, d), and the places and the
#: vectors of a load or displacement, and the unit normals out of the body there, all (m, d).
Part: TypeAlias = tuple[str, Array, Array, Array, Array]

#: About the most arrows of a load, the length of the longest over the extent of the body, and that
#: of others over it at least.
ARROWS, REACH, SHORTEST = 32, 0.15, 0.25


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
    domain, comm = problem.domain, problem.comm
    for other in (0, domain.dim):
        domain.mesh.topology.create_connectivity(domain.dim - 1, other)

    def gathered(values: Array) -> Any:
        shares = comm.gather(values)
        return None if shares is None else np.concatenate(shares)

    boundary = gathered(_corners(domain, exterior_facets(domain.mesh)))
    around = facet_of(shape_of(domain.mesh).corners).around if domain.dim == 2 else []
    cells = gathered(geometry_nodes(domain)[:, around])
    parts: list[Part] = [
        (words, *map(gathered, arrays)) for words, *arrays in _parts(case, problem)
    ]
    surface = _foundation(problem)
    if comm.rank > 0:
        return None
    arrows = _arrows(parts, boundary)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.9, 5.0))
        if domain.dim == 2:
            _draw_plane(figure, cells, boundary, parts, arrows, surface)
        else:
            _draw_space(figure, boundary, parts, arrows, surface)
        figure.suptitle(heading(case.title), fontsize="medium")
        figure.legend(loc="outside lower center", ncols=3, fontsize=7)
        if domain.dim == 2:
            axes = "rz" if domain.revolved else "xy"
            labels = [case.case.units.label(f"${axis}$", "length") for axis in axes]
            figure.axes[0].set(xlabel=labels[0], ylabel=labels[1])
    return figure


def _parts(case: Case, problem: ContactProblem) -> Iterator[Part]:
    """Yield the parts, with facets and load at the end of the first stage here. Collective."""
    domain = problem.domain
    time = 1.0 if case.evolution is None else case.evolution.times[1]

    def facets(part: str) -> Array:
        return _corners(domain, domain.facets_anywhere(part))

    def normals(part: str) -> Array:
        found = normals_at(domain, domain.facets_anywhere(part), 1)[2].mean(axis=1)
        return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])

    def with_time(section: Any, words: str, fields: Iterable[Any]) -> str:
        amplitude = f", amplitude {section.amplitude}" if section.amplitude else ""
        formula = f", t = {time:g}" if case.evolution and knows_time([*fields]) else ""
        return words + amplitude + formula

    def components(fields: Iterable[tuple[int, Any]], places: Array) -> Array:
        found = np.zeros_like(places)
        for k, field in fields:
            found[:, k] = at_time(field, time).numpy(places)
        return found

    none = np.empty((0, domain.dim))
    for contact in problem.contacts:
        yield f"contact {contact.on}", facets(contact.on), none, none, none
        if contact.against is not None:
            yield f"against {contact.against}", facets(contact.against), none, none, none
    for fixed in case.fixed:
        corners = facets(fixed.on)
        places = corners.mean(axis=1)
        moved = components(fixed.components.items(), places)
        words = with_time(fixed, f"fixed {fixed.on}", fixed.given.values())
        yield words, corners, places, moved, normals(fixed.on)
    for key in ("elastic", "bolt", "electrode", "rigid"):
        for section in getattr(case, key):
            yield f"{key} {section.on}", facets(section.on), none, none, none
    for load in case.load:
        if load.on is None:
            corners = none[:, None].repeat(domain.dim, axis=1)
            places = geometry_nodes(domain).mean(axis=1)
            outward = np.zeros_like(places)
        else:
            corners, outward = facets(load.on), normals(load.on)
            places = corners.mean(axis=1)
        force = components(enumerate(load.density or ()), places)
        if load.force is not None:
            assert load.on is not None
            force += components(enumerate(load.force), places) / area(domain, load.on)
        if load.pressure is not None:
            force -= np.reshape(at_time(load.pressure, time).numpy(places), (-1, 1)) * outward
        words = with_time(load, f"load {load.on or 'in the whole body'}", load.given.values())
        yield words, corners, places, force, outward


def _corners(domain: Domain, facets: Indices) -> Array:
    """Return the corners of facets of this rank, around a quadrilateral, shape (n, c, d)."""
    shape = shape_of(domain.mesh).facet
    if not facets.size:  # which `entities_to_geometry` divides by
        return np.empty((0, shape.corners, domain.dim))
    places = dmesh.entities_to_geometry(domain.mesh, domain.dim - 1, facets)
    return np.asarray(domain.mesh.geometry.x[places[:, shape.around]][..., : domain.dim])


def _foundation(problem: ContactProblem) -> Array:
    """Return contact nodes, their places on foundations, and normals, (m, 3, d). Collective."""
    found: list[Array] = [np.zeros((0, 3, problem.dim))]
    for contact, geometry in zip(problem.contacts, problem.geometries, strict=True):
        nodes = geometry.nodes
        if contact.against is None:
            near = np.isfinite(nodes.gap)
            places = nodes.points + np.where(near, nodes.gap, 0.0)[:, None] * nodes.normal
            both = np.stack([nodes.points, places, nodes.normal], axis=1)
            found.append(nodes.gather(both[near]))
    return np.concatenate(found)


def _in_front(boundary: Array, surface: Array) -> tuple[Array, Array]:
    """Return places on a foundation of the corners of facets, NaN for none, and the normals."""
    if not surface.size:
        return np.full_like(boundary, np.nan), np.zeros_like(boundary)
    apart, nodes = KDTree(surface[:, 0]).query(boundary)
    there = (apart <= 1e-9 * np.ptp(boundary, axis=(0, 1)).max())[..., None]
    return np.where(there, surface[nodes, 1], np.nan), surface[nodes, 2]


def _arrows(parts: list[Part], boundary: Array) -> list[tuple[Array, Array]]:
    """Return starts and steps of the arrows of each part, one scale for each kind of vector."""
    reach = REACH * np.ptp(boundary, axis=(0, 1)).max()
    largest: dict[tuple[str, int], float] = {}
    kinds = [(words.partition(" ")[0], min(len(facets), 1)) for words, facets, *_ in parts]
    for kind, (*_, vectors, _) in zip(kinds, parts, strict=True):
        most = np.linalg.norm(vectors, axis=1).max(initial=0.0)
        largest[kind] = max(most, largest.get(kind, 0.0))
    found = []
    for kind, (_, _, places, vectors, outward) in zip(kinds, parts, strict=True):
        sizes = np.linalg.norm(vectors, axis=1)
        most, on_part = sizes.max(initial=0.0), kind[1]
        chosen, centres = _spread(places, round(ARROWS ** (1 / (places.shape[1] - on_part))))
        drawn = sizes[chosen] > 0.02 * most
        chosen, centres = chosen[drawn], centres[drawn]
        scale = reach * max(1 / largest[kind], SHORTEST / most) if most else 0.0
        if on_part:
            start, step = places[chosen], scale * vectors[chosen]
            pulls = np.einsum("ni,ni->n", step, outward[chosen]) > NEGLIGIBLE * reach
            found.append((start - ~pulls[:, None] * step, step))
        else:
            step = 0.5 * scale * vectors[chosen]
            found.append((centres - 0.5 * step, step))
    return found


def _spread(places: Array, count: int) -> tuple[Indices, Array]:
    """Return places spread over a grid of `count` cells along its longest side, and the cells."""
    if not len(places):
        return np.empty(0, dtype=np.int32), places
    low, extent = places.min(axis=0), np.ptp(places, axis=0)
    counts = np.maximum(1, np.round(count * extent / (extent.max() or 1.0)))
    size = extent / counts
    cells = np.floor((places - low) / np.where(size > 0, size, 1.0))
    centres = low + (np.unique(np.clip(cells, 0, counts - 1), axis=0) + 0.5) * size
    return KDTree(places).query(centres)[1], centres


def _draw_plane(
    figure: Figure,
    cells: Array,
    boundary: Array,
    parts: list[Part],
    arrows: list[tuple[Array, Array]],
    surface: Array,
) -> None:
    """Draw a plane body by its cells, shape (n, c, 2), and boundary edges, (m, 2, 2)."""
    ax = figure.subplots()
    fine = 0.3 * min(1.0, 50 / np.sqrt(len(cells)))
    ax.add_collection(PolyCollection(list(cells), facecolors="0.96", edgecolors="0.75", lw=fine))
    ax.add_collection(LineCollection(list(boundary), colors="0.4", lw=0.6))
    for k, (part, (start, step)) in enumerate(zip(parts, arrows, strict=True)):
        wide = 1.5 + 2.5 * (1 - k / len(parts))  # parts in one place are seen beside each other
        lines = LineCollection(list(part[1]), colors=f"C{k}", lw=wide, label=part[0])
        lines.set_capstyle("round")
        ax.add_collection(lines)
        if start.size:
            exact: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0}
            # Of narrow axes a share of the width would be a hair.
            exact |= {"units": "inches", "width": 0.018}
            ax.quiver(*start.T, *step.T, color=f"C{k}", **exact)
            ax.update_datalim(np.concatenate([start, start + step]))
    places, normal = _in_front(boundary, surface)
    size = np.ptp(boundary, axis=(0, 1)).max()
    gap = np.linalg.norm(places - boundary, axis=2).max(axis=1)
    near = gap <= BEYOND * size + np.nanmin(gap, initial=np.inf)
    if near.any():
        far = places[near] + HATCHED * size * normal[near]
        bands = np.concatenate([places[near], far[:, ::-1]], axis=1)
        ax.add_collection(LineCollection(list(places[near]), colors=BLUE, lw=0.6, zorder=4))
        hatch: dict[str, Any] = {"hatch": "//////", "edgecolors": BLUE, "lw": 0}
        ax.add_collection(PolyCollection(list(bands), facecolors="none", **hatch))
        ax.update_datalim(bands.reshape(-1, 2))
        ax.fill([], [], facecolor="none", edgecolor=BLUE, hatch="//////", lw=0, label="foundation")
    ax.set_aspect("equal")
    ax.autoscale_view()
    figure.set_figheight(np.clip(1.4 + 5.9 * ax.dataLim.height / ax.dataLim.width, 2.4, 5.0))


def _draw_space(
    figure: Figure,
    boundary: Array,
    parts: list[Part],
    arrows: list[tuple[Array, Array]],
    surface: Array,
) -> None:
    """Draw a body in 3-D by the facets of its boundary, shape (m, c, 3)."""
    places = _in_front(boundary, surface)[0]
    gap = np.linalg.norm(places - boundary, axis=2)
    shape = facing(places, gap, float(np.ptp(boundary, axis=(0, 1)).max()))

    def add(plotter: Any) -> None:
        edges = {"show_edges": True, "edge_opacity": 0.4, "line_width": 0.5}
        plotter.add_mesh(polygons(boundary), color="#EEEEEE", opacity=0.3, **edges)
        for k, (part, (start, step)) in enumerate(zip(parts, arrows, strict=True)):
            colour = to_hex(f"C{k}")
            if len(part[1]):
                plotter.add_mesh(polygons(part[1]), color=colour, opacity=0.5, lighting=False)
            if start.size:
                plotter.add_arrows(start, step, color=colour)
        if shape.n_cells:
            add_foundation(plotter, shape)

    ends = [np.concatenate([start, start + step]) for start, step in arrows]
    seen = np.concatenate([boundary.reshape(-1, 3), shape.points, *ends])
    ax = figure.subplots()
    ax.axis("off")
    if drawable():
        render(ax, Camera.of(np.array([1.0, -1.6, 0.5]), seen), add)
    for k, part in enumerate(parts):
        ax.plot([], [], "s", color=f"C{k}", label=part[0])
    if shape.n_cells:
        ax.plot([], [], "s", color=BLUE, markerfacecolor=to_rgba(SKY, 0.3), label="foundation")
