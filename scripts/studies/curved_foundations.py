"""Pressures of round bodies on curved rigid foundations, as meshes are refined.

A body under hydrostatic pressure p shrinks by alpha = p (1 - 2 nu)/E towards a point. Where it
conforms to a shape it therefore fits, under p, the shape that is as much smaller: a solution for
any shape, which meshes of degree 1 hold exactly, so that errors are those of gaps and normals.
With it the rings and shells of Lame, and Hertz's cylinder.

`python3 -m scripts.studies.curved_foundations [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from mpi4py import MPI

from contact import (
    Body,
    Cone,
    Contact,
    Cylinder,
    Domain,
    Fixed,
    Level,
    Linear,
    Load,
    NotConvergedError,
    Problem,
    Punch,
    Shape,
    Solution,
    Sphere,
    Triangles,
    from_msh,
    load_case,
    solve,
)
from contact.mesh.domain import revolved
from contact.methods.options import NewtonOptions
from contact.typing import Array
from scripts.cases import CASES
from scripts.reporting import Report, append, empty, solved
from scripts.studies.hertz_exact import line_contact

YOUNG, POISSON = 1000.0, 0.3

#: Shrinking of the hydrostatic bodies, and their pressure.
ALPHA = 1e-3
PRESSURE = ALPHA * YOUNG / (1 - 2 * POISSON)

#: Point (r, z) towards which they shrink; not the tip of the cone, which then would not move.
CENTRE = (0.0, -0.5)

#: Mesh sizes in the plane, also that of bodies of revolution, and in 3-D.
PLANE, SPACE = (0.1, 0.05, 0.025), (0.1, 0.05)


#: Displacements and geometry: their degrees.
ELEMENTS = (1, 1), (2, 1), (2, 2)

#: Mesh sizes of Hertz's cylinder, a = 0.861, and its modulus.
HERTZ, YOUNG_HERTZ = (0.2, 0.1, 0.05), 2000.0

CAPTION = "Contact pressure over the exact one of round bodies on curved foundations"
NOTE = (
    "Rings: Lame's solutions, an interference of 0.001 radii, and an inner pressure of 1. Hertz's "
    "cylinder: nodes within 0.7 a. All others: the body shrinks by 0.001 under hydrostatic "
    "pressure. Pressures have the errors of the gaps times E/h. At degree 2 gaps in the middle of "
    "edges are those of curves fitted to the vertices, or to the gaps there. The "
    "triangles of the rows *triangles* are chords of the sphere; their deviation of 5e-7 causes "
    "the errors of these rows. With triangles twice and four times as large, the least and largest "
    "ratios at degree 1 and h = 0.1 are 0.966, 1.030 and 0.886, 1.106. Geometry: the degree of "
    "the cells' edges, straight or of second order. Off: the share of the "
    "area, in per cent, whose nodes are off by more than 10 %."
)

#: Ratios and weights of the nodes, given a mesh size, a degree, and that of the geometry.
Measured: TypeAlias = Callable[..., Array]


@dataclass(frozen=True)
class Profile:
    """The meridian of a body around a shape, or a plane body."""

    #: Corners (r, z) in order, shape (n, 2).
    points: Sequence[tuple[float, float]]
    #: Number of a side, which begins at the corner of this number -> centre of the arc that it is,
    #: and its half axes.
    arcs: Mapping[int, tuple[tuple[float, float], tuple[float, float]]]
    #: Numbers of the sides that touch.
    contact: Sequence[int]
    #: Those that are displaced; the others have no traction along them, nor a normal motion that is
    #: not the given one.
    constrained: Sequence[int]
    #: Returns the shape that conforms to them, in a dimension of space, as large as given.
    shape: Callable[[int, float], Shape]


def scaled(point: tuple[float, float], factor: float, dim: int) -> tuple[float, ...]:
    """Return where a point (r, z) of the axis goes, in 2-D or in 3-D."""
    z = CENTRE[1] + factor * (point[1] - CENTRE[1])
    return (0.0, z) if dim == 2 else (0.0, 0.0, z)


def upwards(dim: int) -> tuple[float, ...]:
    """Return the axis."""
    return (0.0, 1.0) if dim == 2 else (0.0, 0.0, 1.0)


def ellipsoid(dim: int, factor: float) -> Level:
    """Return the ellipsoid of the half axes 1 and 0.7 by a formula that is no distance."""
    middle, axes = np.array(scaled((0.0, 0.0), factor, dim)), np.ones(dim)
    axes[-1] = 0.7
    return Level(lambda x: np.sum(((x - middle) / (factor * axes)) ** 2, axis=1) - 1)


def triangulated(_dim: int, factor: float, cells: int = 800) -> Triangles:
    """Return an octant of the unit sphere, and a little more, as triangles."""
    a, b = np.meshgrid(*[np.linspace(-0.1, np.pi / 2 + 0.1, cells + 1)] * 2, indexing="ij")
    a, b = np.clip(a, -0.1, np.pi / 2 + 0.1), np.clip(b, -0.1, np.pi / 2)
    x = np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=-1)
    x = np.asarray(scaled((0.0, 0.0), factor, 3)) + factor * x
    low, right, up, far = x[:-1, :-1], x[1:, :-1], x[:-1, 1:], x[1:, 1:]
    first = np.stack([low, right, far], axis=2).reshape(-1, 3, 3)
    second = np.stack([low, far, up], axis=2).reshape(-1, 3, 3)[:]
    corners = np.concatenate([first, second])
    edges = corners[:, 1:] - corners[:, :1]
    size = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    return Triangles(corners[size > 1e-12])


def shell(
    outer: float, shape: Callable[[int, float], Shape], height: float = 1.0, inner: float = 1.0
) -> Profile:
    """Return a quarter of a shell around an ellipse of the half axes `inner`, `height inner`."""
    low = height * inner
    points = [(inner, 0.0), (outer, 0.0), (0.0, outer), (0.0, low)]
    arcs = {1: ((0.0, 0.0), (outer, outer)), 3: ((0.0, 0.0), (inner, low))}
    return Profile(points, arcs, [3], [1], shape)


def ball(dim: int, factor: float) -> Sphere:
    """Return the unit ball, or disc."""
    return Sphere(centre=scaled((0.0, 0.0), factor, dim), radius=factor)


RING = shell(2.0, ball)

PROFILES = {
    "sphere": shell(1.4, ball),
    "formula": shell(1.4, ellipsoid, 0.7),
    "triangles": shell(1.4, triangulated),
    "cylinder": Profile(
        [(1.0, 0.0), (1.4, 0.0), (1.4, 0.5), (1.0, 0.5)],
        {},
        [3],
        [1],
        lambda dim, factor: Cylinder(
            point=scaled((0.0, 0.0), factor, dim), axis=upwards(dim), radius=factor
        ),
    ),
    "cone": Profile(
        [(1.0, 1.0), (1.3, 0.7), (1.7, 1.1), (1.4, 1.4)],
        {},
        [3],
        [0, 1, 2],
        lambda dim, factor: Cone(
            apex=scaled((0.0, 0.0), factor, dim), axis=upwards(dim), half_angle=45.0
        ),
    ),
    "punch edge": Profile(
        [(0.0, -1.4), (1.9, -1.4), (1.9, 0.0), (1.5, 0.0), (0.5, -1.0), (0.0, -1.0)],
        {3: ((0.5, 0.0), (1.0, 1.0))},
        [3, 4],
        [0, 1],
        lambda dim, factor: Punch(
            centre=scaled((0.0, -1.0), factor, dim),
            axis=upwards(dim),
            radius=1.5 * factor,
            edge_radius=factor,
        ),
    ),
}


def mesh(
    profile: Profile, h: float, dim: int, other: Profile | None = None, order: int = 1
) -> Domain:
    """Return a Gmsh mesh; in 3-D a quarter of the turn. Collective.

    In 2-D there may be another body, whose parts have names with a 1 behind them. The edges are
    straight or of second order.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = MPI.COMM_WORLD.bcast(str(Path(folder) / "body.msh"))
        if MPI.COMM_WORLD.rank == 0:
            _write([profile, *([] if other is None else [other])], h, dim, path, order)
        MPI.COMM_WORLD.barrier()
        domain = from_msh(MPI.COMM_WORLD, path)
        MPI.COMM_WORLD.barrier()
    return domain


def _write(profiles: Sequence[Profile], h: float, dim: int, path: str, order: int) -> None:
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        model = gmsh.model.occ
        body: list[int] = []
        parts: dict[str, list[int]] = {}
        for behind, profile in zip(("", "1"), profiles, strict=False):
            sides, face = _outline(model, profile, dim)
            if dim == 3:
                (_, end), (_, solid), *swept = model.revolve([(2, face)], *[0] * 5, 1, np.pi / 2)
                parts = {"x": [end], "y": [face]}
                # A surface is swept from each side, in their order; from the axis none.
                surfaces = iter(tag for _, tag in swept)
                radii = np.array(profile.points)[:, 0]
                on_axis = (radii == 0) & (np.roll(radii, -1) == 0)
                tags = [[] if on else [next(surfaces)] for on in on_axis]
            else:
                solid, tags = face, [[side] for side in sides]
            model.synchronize()
            body.append(solid)
            groups = {"contact": profile.contact, "constrained": profile.constrained}
            groups |= {f"side{k}": [k] for k in range(len(sides))}
            for name, of in groups.items():
                parts[name + behind] = [tag for k in of for tag in tags[k]]
            if behind:
                # The two sides of a pair do not match.
                length = model.getMass(1, sides[profile.contact[0]])
                count = round(1.4 * length / h)
                gmsh.model.mesh.setTransfiniteCurve(sides[profile.contact[0]], count)
        for name, tags in parts.items():
            if tags:
                gmsh.model.addPhysicalGroup(dim - 1, tags, name=name)
        gmsh.model.addPhysicalGroup(dim, body, name="body")
        gmsh.option.setNumber("Mesh.MeshSizeMax", h if dim == 2 else 2.5 * h)
        gmsh.option.setNumber("Mesh.MeshSizeMin", h)
        field = gmsh.model.mesh.field
        near = field.add("Distance")
        field.setNumbers(near, "CurvesList" if dim == 2 else "SurfacesList", parts["contact"])
        field.setNumber(near, "Sampling", 400)
        size = field.add("MathEval")
        field.setString(size, "F", f"{h} + 0.4*F{near}")
        field.setAsBackgroundMesh(size)
        for name in ("ExtendFromBoundary", "FromPoints", "FromCurvature"):
            gmsh.option.setNumber(f"Mesh.MeshSize{name}", 0)
        gmsh.model.mesh.generate(dim)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(path)
    finally:
        gmsh.finalize()


def _outline(model: Any, profile: Profile, dim: int) -> tuple[list[int], int]:
    """Return the curves of a profile, and the face within."""
    points = [
        model.addPoint(r, 0, z) if dim == 3 else model.addPoint(r, z, 0) for r, z in profile.points
    ]
    sides = []
    for k, first in enumerate(points):
        last = points[(k + 1) % len(points)]
        if k not in profile.arcs:
            sides.append(model.addLine(first, last))
            continue
        (r, z), (a, b) = profile.arcs[k]
        ends = [profile.points[k], profile.points[(k + 1) % len(points)]]
        angles = np.unwrap([np.arctan2((y - z) / b, (x - r) / a) for x, y in ends])
        turns = np.linspace(*angles, 41)[1:-1]
        way = [(r + a * np.cos(t), z + b * np.sin(t)) for t in turns]
        if a == b:
            middle = way[len(way) // 2]
            through = model.addPoint(*((middle[0], 0, middle[1]) if dim == 3 else (*middle, 0)))
            sides.append(model.addCircleArc(first, through, last, center=False))
            continue
        inner = [model.addPoint(*((x, 0, y) if dim == 3 else (x, y, 0))) for x, y in way]
        sides.append(model.addSpline([first, *inner, last]))
    return sides, model.addPlaneSurface([model.addCurveLoop(sides)])


def hydrostatic(name: str, h: float, degree: int, kind: str, order: int = 1) -> Array:
    """Return the pressures over the exact one, and the weights of the nodes. Collective."""
    dim, profile = 3 if kind == "3-D" else 2, PROFILES[name]
    domain = mesh(profile, h, dim, order=order)
    given: list[Any] = [
        lambda x, i=i: -ALPHA * (x[i] - (CENTRE[1] if i == dim - 1 else 0.0)) for i in range(dim)
    ]
    fixed = [Fixed("constrained", given)]
    corners = np.array(profile.points)
    for k in range(len(corners)):
        a, b = corners[k], corners[(k + 1) % len(corners)]
        rest = k not in (*profile.contact, *profile.constrained)
        if rest and a[1] == b[1]:
            fixed.append(Fixed(f"side{k}", [*[None] * (dim - 1), given[-1]]))
        if rest and dim == 2 and a[0] == b[0] == 0:
            fixed.append(Fixed(f"side{k}", [0.0, None]))
    if dim == 3:
        fixed += [Fixed("x", [0.0, None, None]), Fixed("y", [None, 0.0, None])]
    if kind == "revolution":
        domain = revolved(domain)
    shape = profile.shape(dim, 1 - ALPHA)
    body = Body(Linear(YOUNG, POISSON), fixed)
    problem = Problem(domain, body, Contact("contact", shape, press=True), degree=degree)
    exact = PRESSURE / (1 + POISSON if kind == "2-D" else 1)
    return ratios(solve(problem, NewtonOptions(tolerance=1e-10)), exact)


def rings(name: str, h: float, degree: int, order: int = 1) -> Array:
    """Return the like for a ring on a shaft or in a bore."""
    problem, exact = ring(name, h, degree, order)
    return ratios(solve(problem, NewtonOptions(tolerance=1e-10)), exact)


def ring(
    name: str, h: float, degree: int, order: int = 1, interference: float = 0.001
) -> tuple[Problem, float]:
    """Return a ring, 1 <= r <= 2, on a larger shaft or in its bore, and the exact pressure.

    In a bore of its own radius a pressure of 1 acts from within. Lame's solutions, plane strain.
    """
    shaft, outer = name == "ring on a shaft", 2.0
    # A radial displacement A r + B/r has the stress E/(1 + nu) (A/(1 - 2 nu) - B/r^2).
    factor = np.array([1 / (1 - 2 * POISSON), -1.0]) * YOUNG / (1 + POISSON)
    inside, outside = factor, factor * [1.0, 1 / outer**2]
    if shaft:
        a, b = np.linalg.solve([[1.0, 1.0], outside], [interference, 0.0])
        exact, shape = -inside @ [a, b], Sphere(centre=(0.0, 0.0), radius=1 + interference)
        on, loads = "contact", []
    else:
        a, b = np.linalg.solve([[outer, 1 / outer], inside], [0.0, -1.0])
        exact, shape = -outside @ [a, b], Sphere(centre=(0.0, 0.0), radius=outer, inside=True)
        on, loads = "constrained", [Load("contact", pressure=1.0)]
    sides = [Fixed("side0", [None, 0.0]), Fixed("side2", [0.0, None])]
    body = Body(Linear(YOUNG, POISSON), sides, loads)
    contact = Contact(on, shape, press=True)
    domain = mesh(RING, h, 2, order=order)
    return Problem(domain, body, contact, degree=degree), float(exact)


def two_rings(h: float, degree: int, overlap: float = 0.001) -> tuple[Solution, float]:
    """Return a ring, 1 <= r <= 1.5, in another one, r <= 2, and the exact pressure. Collective.

    The rings overlap, by a part of 1.5 that degree 1, whose gaps are those of facets, sees.
    """
    middle, outer = 1.5, 2.0
    domain = mesh(shell(middle, ball), h, 2, shell(outer, ball, inner=middle - overlap))
    sides = [Fixed(f"side0{k}", [None, 0.0]) for k in ("", "1")]
    sides += [Fixed(f"side2{k}", [0.0, None]) for k in ("", "1")]
    body = Body(Linear(YOUNG, POISSON), sides)
    pair = Contact("constrained", against="contact1", press=True)
    solution = solve(Problem(domain, body, pair, degree=degree))
    # Compliances of both sides: u_r of a pressure of 1 there.
    factor = np.array([1 / (1 - 2 * POISSON), -1.0]) * YOUNG / (1 + POISSON)
    total = 0.0
    for radius, free, sign in ((middle, 1.0, -1.0), (middle, outer, 1.0)):
        stress = [factor * [1.0, 1 / r**2] for r in (radius, free)]
        total += sign * float(np.linalg.solve(stress, [-1.0, 0.0]) @ [radius, 1 / radius])
    return solution, overlap / total


def hertz(h: float, degree: int) -> Array:
    """Return the like for Hertz's cylinder on a plane where |x| < 0.7 a."""
    sizes = f"mesh.contact_size={h}", f"space.degree={degree}", "mesh.size=0.4"
    solution = solved(load_case(CASES / "hertz-small.toml", sizes))
    values, nodes = ratios(solution, 1.0), solution.problem.nodes
    a, peak = line_contact(160.0, YOUNG_HERTZ / (1 - POISSON**2), 8.0)
    x = nodes.gather(nodes.points[:, 0])
    inner = np.abs(x) < 0.7 * a
    values[0] /= peak * np.sqrt(np.maximum(1 - (x / a) ** 2, 1e-9))
    return values[:, inner]


def ratios(solution: Solution, exact: float) -> Array:
    """Return pressures over the exact one, with their weights, shape (2, n). Collective."""
    if not solution.converged:
        raise NotConvergedError(solution.outcome.reason)
    nodes = solution.problem.nodes
    return np.stack([nodes.gather(solution.pressure) / exact, nodes.gather(nodes.weight)])


def series(coarse: bool) -> Iterator[tuple[str, str, tuple[float, ...], Measured]]:
    """Return problems with their kind and sizes, and that which solves one of a size and degree."""
    for name in ("ring on a shaft", "ring in a bore"):
        yield name, "2-D", PLANE, partial(rings, name)
    yield "Hertz's cylinder on a plane", "2-D", HERTZ, hertz
    for kind in ("2-D", "revolution", "3-D"):
        for name in PROFILES:
            # Without a curve: strips and wedges, and meridians of cylinders and cones.
            flat = kind != "3-D" and name in ("cylinder", "cone")
            if not flat and (kind == "3-D" or name != "triangles"):
                sizes = SPACE[:1] if kind == "3-D" and coarse else SPACE
                yield (
                    name,
                    kind,
                    sizes if kind == "3-D" else PLANE,
                    partial(hydrostatic, name, kind=kind),
                )


def main(arguments: Sequence[str] | None = None) -> dict[tuple[str, str, float, int, int], Array]:
    """Make the table; return mean, least and largest ratio of each problem. Collective."""
    report = Report.of(__doc__, "curved_foundations", arguments)
    columns = empty(
        "problem", "kind", "h", "degree", "geometry", "nodes", "mean", "least", "largest", "off"
    )
    found = {}
    for name, kind, sizes, measured in series(report.coarse):
        for degree, order in ELEMENTS:
            if order > 1 and measured is hertz:
                continue
            for h in sizes[:2] if report.coarse else sizes:
                p, w = measured(h, degree) if order == 1 else measured(h, degree, order=order)
                values = np.array([p @ w / w.sum(), p.min(), p.max()])
                found[name, kind, h, degree, order] = values
                off = round(100 * float(w[np.abs(p - 1) > 0.1].sum() / w.sum()), 2)
                shown = values.round(4).tolist()
                append(columns, name, kind, h, degree, order, p.size, *shown, off)
    report.table("curved-foundations-table", CAPTION, columns, NOTE)
    return found


if __name__ == "__main__":
    main()
