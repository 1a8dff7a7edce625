"""Families of bodies that friction alone holds: belts, leaves, strips, clips, rings, jaws.

Belts around 60 to 300 degrees of a drum are pulled with up to 5 % less than exp(mu theta) allows,
arched leaves, one or two on each other, are pressed between two plates, strips that lie on a plane
are pulled with up to 99 % of their friction, clips embrace a bar, rings a shaft (bodies of
revolution), and blocks hang between two jaws (3-D).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from contact.mesh.domain import Domain, from_mesh
from contact.mesh.grid import rectangle
from contact.typing import Array
from scripts.studies.robustness.one_body import (
    Families,
    Rng,
    Tables,
    case,
    elastic,
    grid,
    plane,
    sliding,
)
from tests.problems.meshes import assembled

#: Tables, and the mesh in place of theirs.
Drawn = tuple[Tables, Domain | None]

PLANE_STRESS = {"degree": 2, "kinematics": "plane_stress"}


def _on(*parts: str) -> Tables:
    """Return the mesh of a case on a domain of its own, which has these parts beside the sides."""
    return grid([1.0, 1.0], [1, 1], parts={name: {"side": "top"} for name in parts})


def _round(radius: float) -> Tables:
    """Return the contact of the lower side with a cylinder about the origin."""
    cylinder = {"shape": "sphere", "centre": [0.0, 0.0], "radius": radius}
    return {"on": "bottom", "overlap": "press", "foundation": cylinder}


def bent(length: float, thick: float, cells: tuple[int, int], place: Any) -> Domain:
    """Return a rectangle whose points are moved by a function of both coordinates."""
    domain = rectangle(MPI.COMM_SELF, [0.0, 0.0], [length, thick], cells)
    x = domain.mesh.geometry.x
    x[:, 0], x[:, 1] = place(x[:, 0].copy(), x[:, 1].copy())
    return domain


def belt(rng: Rng) -> Drawn:
    """Draw a belt around a drum of radius 1, whose tension acts in the middle of its thickness."""
    angle, mu = np.deg2rad(rng.uniform(60, 300)), float(rng.uniform(0.1, 0.5))
    thick, cells = float(rng.uniform(0.01, 0.05)), int(rng.integers(12, 50))
    degree, share = int(rng.choice([1, 1, 2])), float(rng.choice([0.5, 0.8, 0.9, 0.95]))
    ratio = 1 + share * (np.exp(mu * angle) * (1 - thick) - 1)
    layers, tension = int(rng.integers(1, 3)), thick * float(10 ** rng.uniform(-6, -4))
    pull = ratio * tension * np.array([np.sin(angle), np.cos(angle)])
    loads = {"on": "left", "force": [0.0, -tension]}, {"on": "right", "force": pull.tolist()}
    space, material = PLANE_STRESS | {"degree": degree}, elastic(1.0, 0.0)
    domain = bent(
        angle, thick, (cells, layers), lambda a, r: (-(1 + r) * np.cos(a), (1 + r) * np.sin(a))
    )
    return case(_on(), material, [], _round(1.0), sliding(mu), *loads, space=space), domain


def _arch(long: float, rise: float) -> tuple[float, Any]:
    """Return the radius of an arc, and half its angle."""
    radius = (long**2 / 4 + rise**2) / (2 * rise)
    return radius, np.arcsin(long / 2 / radius)


def _between_plates(mu: float, poisson: float, low: float, high: float, force: float) -> Tables:
    """Return an arched leaf, or two, between a plane and a rigid lid that a force presses down."""
    lid = {"displacement": [0.0, "free"], "force": [0.0, -force]}
    contacts = [
        {"on": "bottom", "foundation": plane([0.0, low], [0.0, 1.0])},
        {"on": "top", "foundation": plane([0.0, high], [0.0, -1.0]), "rigid": lid},
    ]
    material = elastic(200e3, poisson)
    mesh = _on("inner", "outer")
    return case(mesh, material, [], contacts, sliding(mu), space=PLANE_STRESS)


def leaf(rng: Rng) -> Drawn:
    """Draw an arched leaf between two plates, the upper of which is pressed down."""
    long, rise, thick = 100.0, float(rng.uniform(2, 10)), float(rng.uniform(0.5, 2))
    cells, mu = int(rng.integers(16, 60)), float(rng.choice([0.05, 0.1, 0.3, 0.6]))
    radius, half = _arch(long, rise)

    def place(a: Array, r: Array) -> tuple[Array, Array]:
        a = a - half
        return (radius + r) * np.sin(a), rise - radius + (radius + r) * np.cos(a)

    domain = bent(2 * half, thick, (cells, 2), place)
    low = float(domain.mesh.geometry.x[:, 1].min())
    # Share of the force that would press a beam of the same length flat.
    force = 48 * 200e3 * thick**3 / 12 / long**3 * rise * float(rng.choice([0.1, 0.3, 0.6, 0.9]))
    return _between_plates(mu, 0.0, low, rise + thick, force), domain


def strip(rng: Rng) -> Drawn:
    """Draw a strip on a plane, pressed, and pulled at one end."""
    mu, cells = float(rng.uniform(0.1, 0.6)), int(rng.integers(20, 80))
    share = float(rng.choice([0.6, 0.9, 0.97, 0.99]))
    press, solid = float(10 ** rng.uniform(-7, -4)), rng.random() < 1 / 3
    long = float(cells // 5) if solid else cells / 2
    aside, side = ([0.0], [1.0]) if solid else ([], [])
    mesh = grid([long, *side, 1.0], [cells // 5, 1, 1] if solid else [cells, 2])
    pressed = {"on": "top", "traction": [0.0, *aside, -press]}
    pulled = {"on": "right", "traction": [share * mu * long * press, *aside, 0.0]}
    return case(mesh, elastic(), [], {"on": "bottom"}, sliding(mu), pressed, pulled), None


def stack(rng: Rng) -> Drawn:
    """Draw two arched leaves on each other, between two plates, the upper of which is pressed."""
    long, rise = 100.0, float(rng.uniform(3, 8))
    thick = rng.uniform(0.5, 1.5, 2)
    cells, mu = int(rng.integers(16, 40)), float(rng.choice([0.1, 0.3, 0.6]))
    radius, half = _arch(long, rise)
    apart = 10.0  # of the leaves before they are bent, so that markers tell them apart
    rows = [np.array([0.0, 0.5, 1.0]) * t + k * apart for k, t in enumerate(thick)]
    across = np.linspace(-half, half, cells + 1)
    points = np.array([[a, r] for row in rows for r in row for a in across])
    corner = np.array([i + j * (cells + 1) for j in (0, 1, 3, 4) for i in range(cells)])
    corners = np.array([0, 1, cells + 1, cells + 2])
    mesh = assembled(MPI.COMM_SELF, points, corner[:, None] + corners, "quadrilateral")
    places = {"bottom": 0.0, "inner": thick[0], "outer": apart, "top": apart + thick[1]}
    parts = {name: lambda x, r=r: np.isclose(x[1], r) for name, r in places.items()}
    regions = {"lower": lambda x: x[1] < apart / 2, "upper": lambda x: x[1] > apart / 2}
    domain = from_mesh(mesh, parts, regions=regions)
    x = mesh.geometry.x
    r = x[:, 1] - np.where(x[:, 1] > apart / 2, apart - thick[0], 0.0)
    angle = x[:, 0].copy()
    x[:, 0] = (radius + r) * np.sin(angle)
    x[:, 1] = rise - radius + (radius + r) * np.cos(angle)
    stiffness = 48 * 200e3 * np.sum(thick**3) / 12 / long**3
    force = stiffness * rise * float(rng.choice([0.1, 0.3, 0.6]))
    tables = _between_plates(mu, 0.3, float(x[:, 1].min()), rise + float(thick.sum()), force)
    tables["contact"].insert(1, {"on": "outer", "against": "inner"})
    return tables, domain


def clip(rng: Rng) -> Drawn:
    """Draw a C-shaped clip on a round bar that is too thick for it, pulled around at one end."""
    angle, thick = np.deg2rad(rng.uniform(200, 330)), float(rng.uniform(0.05, 0.3))
    mu, spread = float(rng.uniform(0.1, 0.6)), float(10 ** rng.uniform(-5, -3))
    cells, degree = int(rng.integers(20, 60)), int(rng.choice([1, 2]))
    layers = int(rng.integers(1, 4))
    domain = bent(
        angle, thick, (cells, layers), lambda a, r: ((1 + r) * np.cos(a), (1 + r) * np.sin(a))
    )
    # The clip bends open: forces of the bar are of the order 3 E I spread.
    pull = float(rng.choice([0.0, 0.1, 0.3])) * mu * thick**3 / 4 * spread
    force = (pull * np.array([-np.sin(angle), np.cos(angle)])).tolist()
    loads = [{"on": "right", "force": force}] if pull else []
    space = {"degree": degree}
    contact = _round(1.0 + spread)
    return case(_on(), elastic(), [], contact, sliding(mu), *loads, space=space), domain


def ring(rng: Rng) -> Drawn:
    """Draw a ring on a shaft that is too thick for it, pulled along, as a body of revolution."""
    inner, wide = 1.0, float(rng.uniform(0.2, 1.5))
    tall, fit = float(rng.uniform(0.3, 3.0)), float(10 ** rng.uniform(-5, -3))
    mu, share = float(rng.uniform(0.05, 0.5)), float(rng.choice([0.5, 0.8, 0.9, 0.95]))
    cells = [int(rng.integers(4, 12)), int(rng.integers(4, 20))]
    outer = inner + wide
    pressure = fit / inner * (outer**2 - inner**2) / (outer**2 + inner**2)  # Lame, nu = 0
    pull = share * mu * pressure * 2 * inner * tall / (outer**2 - inner**2)
    space = {"degree": int(rng.choice([1, 2])), "kinematics": "axisymmetric"}
    load = {"on": str(rng.choice(["top", "bottom"])), "traction": [0.0, pull]}
    shaft = plane([inner + fit, 0.0], [1.0, 0.0])
    contact = {"on": "left", "overlap": "press", "foundation": shaft}
    mesh, material = grid([wide, tall], cells, origin=[inner, 0.0]), elastic(1.0, 0.0)
    return case(mesh, material, [], contact, sliding(mu), load, space=space), None


def jaws(rng: Rng) -> Drawn:
    """Draw a block that hangs between two jaws, the right one of which is pressed."""
    mu, share = float(rng.uniform(0.1, 0.6)), float(rng.choice([0.3, 0.6, 0.8, 0.9]))
    size = rng.uniform(0.5, 1.5, 3)
    cells, force = [int(n) for n in rng.integers(2, 6, 3)], float(10 ** rng.uniform(-5, -3))
    weight = {
        "everywhere": True,
        "body_force": [0.0, 0.0, -share * 2 * mu * force / float(np.prod(size))],
    }
    jaw = {"displacement": ["free", 0.0, 0.0], "force": [-force, 0.0, 0.0]}
    contacts = [
        {"on": "left", "foundation": plane([0.0, 0.0, 0.0], [1.0, 0.0, 0.0])},
        {
            "on": "right",
            "foundation": plane([float(size[0]), 0.0, 0.0], [-1.0, 0.0, 0.0]),
            "rigid": jaw,
        },
    ]
    material = elastic(1.0, float(rng.choice([0.0, 0.3])))
    mesh = grid(size.tolist(), cells)
    return case(mesh, material, [], contacts, sliding(mu), weight), None


FAMILIES = belt, belt, leaf, strip, stack, clip, ring, jaws

#: Family -> how a problem is drawn, and its numbers: of each eight in a row two are belts.
HELD: Families = {
    draw.__name__: (draw, [k for k in range(400) if FAMILIES[k % len(FAMILIES)] is draw])
    for draw in FAMILIES
}
