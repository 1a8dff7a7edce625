"""The set-up of a case in one figure: its parts in colours, loads as arrows, the foundation."""

from __future__ import annotations

from collections.abc import Iterator
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
from contact.mesh.domain import Domain, Indices
from contact.mesh.entities import exterior_facets
from contact.mesh.geometry import facet_normals, geometry_nodes
from contact.model.fields import at_time
from contact.plot.foundation import add_foundation, facing
from contact.plot.run import polygons
from contact.plot.space import Camera, drawable, render
from contact.plot.style import BLUE, SKY, STYLE, heading
from contact.problem.problem import ContactProblem
from contact.typing import Array

#: A part: its name in the legend, its facets by their corners, (n, c, d), and forces on these.
Part: TypeAlias = tuple[str, Array, Array | None]

#: Most arrows of a load, and the length of the longest over the extent of the body.
ARROWS, REACH = 32, 0.15


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

    def gathered(values: Array | None) -> Any:
        shares = None if values is None else comm.gather(values)
        return None if shares is None else np.concatenate(shares)

    boundary = gathered(_corners(domain, exterior_facets(domain.mesh)))
    around = facet_of(shape_of(domain.mesh).corners).around if domain.dim == 2 else []
    cells = gathered(geometry_nodes(domain)[:, around])
    parts = [(words, *map(gathered, rest)) for words, *rest in _parts(case, problem)]
    surface = _foundation(problem)
    if comm.rank > 0:
        return None
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.9, 5.0))
        if domain.dim == 2:
            _draw_plane(figure, cells, boundary, parts, surface)
        else:
            _draw_space(figure, boundary, parts, surface)
        figure.suptitle(heading(case.title), fontsize="medium")
        figure.legend(loc="outside lower center", ncols=3, fontsize=7)
        if domain.dim == 2:
            axes = "rz" if domain.revolved else "xy"
            labels = [case.case.units.label(f"${axis}$", "length") for axis in axes]
            figure.axes[0].set(xlabel=labels[0], ylabel=labels[1])
    return figure


def _parts(case: Case, problem: ContactProblem) -> Iterator[Part]:
    """Yield the parts on this rank."""
    domain = problem.domain

    def facets(part: str) -> Array:
        return _corners(domain, domain.facets_anywhere(part))

    for contact in problem.contacts:
        yield f"contact {contact.on}", facets(contact.on), None
        if contact.against is not None:
            yield f"against {contact.against}", facets(contact.against), None
    for key in ("fixed", "elastic", "bolt", "electrode", "rigid"):
        for section in getattr(case, key):
            yield f"{key} {section.on}", facets(section.on), None
    for load in problem.description.loads:
        if load.on is None:
            continue
        corners = facets(load.on)
        middle = corners.mean(axis=1)
        force = np.zeros_like(middle)
        for k, field in enumerate(load.density or load.force or ()):
            force[:, k] += at_time(field, 1.0).numpy(middle)
        if load.pressure is not None:
            normal = facet_normals(domain, load.on, 1)[2].mean(axis=1)
            normal /= np.linalg.norm(normal, axis=1)[:, None]
            force -= np.reshape(at_time(load.pressure, 1.0).numpy(middle), (-1, 1)) * normal
        yield f"load {load.on}", corners, force


def _corners(domain: Domain, facets: Indices) -> Array:
    """Return the corners of facets of this rank, around a quadrilateral, shape (n, c, d)."""
    shape = shape_of(domain.mesh).facet
    if not facets.size:  # which `entities_to_geometry` divides by
        return np.empty((0, shape.corners, domain.dim))
    places = dmesh.entities_to_geometry(domain.mesh, domain.dim - 1, facets)
    return np.asarray(domain.mesh.geometry.x[places[:, shape.around]][..., : domain.dim])


def _foundation(problem: ContactProblem) -> Array:
    """Return contact nodes, and where they would meet rigid foundations, (m, 2, d). Collective."""
    found: list[Array] = [np.zeros((0, 2, problem.dim))]
    for contact, geometry in zip(problem.contacts, problem.geometries, strict=True):
        nodes = geometry.nodes
        if contact.against is None:
            near = np.isfinite(nodes.gap)
            places = nodes.points + np.where(near, nodes.gap, 0.0)[:, None] * nodes.normal
            found.append(nodes.gather(np.stack([nodes.points, places], axis=1)[near]))
    return np.concatenate(found)


def _arrows(part: Part, boundary: Array) -> tuple[Array, Array]:
    """Return starts and steps of the arrows of a load, outside the body."""
    _, facets, force = part
    if force is None or not np.any(force):
        return facets[:0, 0], facets[:0, 0]
    centre, lengths = facets.mean(axis=1), np.linalg.norm(force, axis=1)
    some = np.linspace(0, len(centre) - 1, min(ARROWS, len(centre))).round().astype(int)
    chosen = np.lexsort(centre.T)[some]
    chosen = chosen[lengths[chosen] > 0.02 * lengths.max()]
    reach = REACH * np.ptp(boundary, axis=(0, 1)).max()
    step, start = reach * force[chosen] / lengths.max(), centre[chosen]
    pulls = np.einsum("ni,ni->n", step, start - boundary.mean(axis=(0, 1))) > 0
    return start - np.where(pulls[:, None], 0.0, step), step


def _draw_plane(
    figure: Figure, cells: Array, boundary: Array, parts: list[Part], surface: Array
) -> None:
    """Draw a plane body by its cells, shape (n, c, 2), and boundary edges, (m, 2, 2)."""
    ax = figure.subplots()
    fine = 0.3 * min(1.0, 50 / np.sqrt(len(cells)))
    ax.add_collection(PolyCollection(list(cells), facecolors="0.96", edgecolors="0.75", lw=fine))
    ax.add_collection(LineCollection(list(boundary), colors="0.4", lw=0.6))
    for k, part in enumerate(parts):
        wide = 1.5 + 2.5 * (1 - k / len(parts))  # parts in one place are seen beside each other
        lines = LineCollection(list(part[1]), colors=f"C{k}", lw=wide, label=part[0])
        lines.set_capstyle("round")
        ax.add_collection(lines)
        start, step = _arrows(part, boundary)
        if start.size:
            exact: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0}
            ax.quiver(*start.T, *step.T, color=f"C{k}", width=0.003, **exact)
            ax.update_datalim(np.concatenate([start, start + step]))
    if surface.size:
        ax.plot(*surface[:, 1].T, ".", ms=3, color="0.4", label="foundation")
    ax.set_aspect("equal")
    ax.autoscale_view()


def _draw_space(figure: Figure, boundary: Array, parts: list[Part], surface: Array) -> None:
    """Draw a body in 3-D by the facets of its boundary, shape (m, c, 3)."""
    arrows = [_arrows(part, boundary) for part in parts]
    size = float(np.ptp(boundary, axis=(0, 1)).max())
    places, gap = np.full_like(boundary, np.nan), np.zeros(boundary.shape[:2])
    if surface.size:
        apart, nodes = KDTree(surface[:, 0]).query(boundary)
        places = np.where((apart > 1e-9 * size)[..., None], np.nan, surface[nodes, 1])
        gap = np.linalg.norm(places - boundary, axis=2)
    shape = facing(places, gap, size)

    def add(plotter: Any) -> None:
        edges = {"show_edges": True, "edge_opacity": 0.4, "line_width": 0.5}
        plotter.add_mesh(polygons(boundary), color="#EEEEEE", opacity=0.3, **edges)
        for k, (part, (start, step)) in enumerate(zip(parts, arrows, strict=True)):
            colour = to_hex(f"C{k}")
            plotter.add_mesh(polygons(part[1]), color=colour, opacity=0.5, lighting=False)
            if start.size:
                plotter.add_arrows(start, step, color=colour)
        if shape.n_cells:
            add_foundation(plotter, shape)

    seen = np.concatenate([boundary.reshape(-1, 3), shape.points, *(start for start, _ in arrows)])
    ax = figure.subplots()
    ax.axis("off")
    if drawable():
        render(ax, Camera.of(np.array([1.0, -1.6, 0.5]), seen), add)
    for k, part in enumerate(parts):
        ax.plot([], [], "s", color=f"C{k}", label=part[0])
    if shape.n_cells:
        ax.plot([], [], "s", color=BLUE, markerfacecolor=to_rgba(SKY, 0.3), label="foundation")
