"""Families of random problems of one or two bodies on the package's own meshes.

Each function draws the tables of a case. `PLAIN` are problems like those of the thesis, `HARD`
those that bend, stick, stretch and harden, `CELLS` those on cells of each shape and degree,
`PLASTIC` evolutions of metals, `PAIRS` blocks on each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

Tables = dict[str, Any]
Rng = np.random.Generator
Draw = Callable[..., Tables]
#: Family -> how a problem is drawn, and the numbers of its problems.
Families = dict[str, tuple[Draw, Sequence[int]]]

PZT = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}
SHARP = {"young": 58.7102, "poisson": 0.3912, "piezo": PZT}


def one(rng: Rng, *values: Any) -> Any:
    """Draw one of some values."""
    return values[int(rng.integers(len(values)))]


def grid(size: list[float], cells: list[int], **more: Any) -> Tables:
    """Return the mesh of a rectangle or a box."""
    kind = "rectangle" if len(size) == 2 else "box"
    return {"generator": kind, "size": size, "cells": cells, **more}


def plane(point: list[float], normal: list[float]) -> Tables:
    """Return a rigid plane, its normal towards the body."""
    return {"shape": "plane", "point": point, "normal": normal}


def clamp(*sides: str, dim: int = 2) -> list[Tables]:
    """Return supports of sides in all directions."""
    return [{"on": side, "displacement": [0.0] * dim} for side in sides]


def elastic(young: float = 1.0, poisson: float = 0.3, **more: Any) -> Tables:
    """Return a material."""
    return {"young": young, "poisson": poisson, **more}


def sliding(mu: float) -> Tables:
    """Return a constant coefficient of friction."""
    return {"law": "coulomb", "mu": mu} if mu > 0 else {"law": "none"}


def coulomb(rng: Rng, *coefficients: float) -> Tables:
    """Draw a constant coefficient of friction."""
    return sliding(one(rng, *coefficients))


def case(
    mesh: Tables, material: Any, fixed: list[Tables], contact: Any, friction: Tables,
    *loads: Tables, **more: Any,
) -> Tables:  # fmt: skip
    """Return the tables of a case."""
    found = {"mesh": mesh, "material": material, "fixed": fixed, "load": [*loads]}
    return found | {"contact": contact, "friction": friction} | more


#: Coefficients of friction, and rates at which they fall with the slip.
MU, RATES = (0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0), (0.0, 1e2, 1e4, 1e5, 1e6, 6e7)


def slip_weakening(
    rng: Rng,
    length: float = 1.0,
    radius: float = 0.0,
    mus: tuple[float, ...] = MU,
    rates: tuple[float, ...] = RATES,
) -> Tables:
    """Draw friction that is constant or falls with the slip, in units of a length."""
    mu = one(rng, *mus)
    if mu == 0.0:
        return {"law": "none"}
    rho = one(rng, *rates) / length
    law = {"law": "slip", "a": mu * 5 / 6, "b": mu / 3, "rho": rho}
    return {"law": "coulomb", "mu": law if rho > 0 else mu, "radius": radius}


def bar(rng: Rng) -> Tables:
    """Draw Example 7.2: loads 1 to 10 times the printed ones, P1 and P2, gaps."""
    n = one(rng, 8, 16, 32)
    mesh = grid([4.0, 1.0], [4 * n, n], rotation=one(rng, 0.0, 0.0, 30.0))
    mesh["parts"] = {"loaded": {"side": "top", "from": 2.0, "to": 4.0}}
    load = -0.005 * one(rng, 1.0, 3.0, 10.0)
    direction, angle = one(rng, "body", "foundation"), np.deg2rad(mesh["rotation"])
    gap, normal = one(rng, 0.0, 0.0, 0.002), [float(-np.sin(angle)), float(np.cos(angle))]
    ground = plane([-gap * n for n in normal], normal)
    space, law = {"degree": one(rng, 1, 1, 2)}, one(rng, "log", "log", "linear")
    material = elastic(1.0, one(rng, 0.1, 0.3, 0.45), law=law, yield_strain=0.05)
    friction = slip_weakening(rng, radius=one(rng, 0.0, 0.0, 0.1))
    contact = {"on": "bottom", "foundation": ground, "direction": direction}
    loads = {"on": "loaded", "traction": [load * n for n in normal]}
    return case(mesh, material, clamp("left"), contact, friction, loads, space=space)


def piezo(rng: Rng) -> Tables:
    """Draw Examples 8.1 and 8.2: k_e 0 to 10, phi_F 0 to 32, loads to 15 x."""
    n = one(rng, 8, 16)
    space = {"degree": one(rng, 1, 1, 2)}
    material = {"law": one(rng, "linear", "log"), "yield_strain": 1.8, **SHARP}
    fixed = [{"on": "left", "displacement": [0.0, 0.0], "potential": 0.0}]
    load = {"on": "top", "traction": [0.0, f"{-one(rng, 5.0, 10.0, 15.0)}*x"]}
    mesh, friction = grid([8.0, 4.0], [2 * n, n]), slip_weakening(rng, 1e4)
    k_e, more = one(rng, 0.0, 1e-3, 1e-1, 1.0, 10.0), {}
    if k_e > 0:
        more = {"electric": {"law": "shifted", "k_e": k_e, "phi_f": one(rng, 0.0, 8.0, 32.0)}}
    return case(mesh, material, fixed, {"on": "bottom"}, friction, load, space=space, **more)


def layer(rng: Rng) -> Tables:
    """Draw Examples 8.3 and 8.4: a compliant layer or none, mu = k_e from 0 to 0.6."""
    n = one(rng, 8, 16)
    small = one(rng, 0.0, 1e-6, 1e-4, 1e-2, 0.2, 0.6)
    ends = [{"side": "top"}, {"side": "bottom", "to": 2.0}, {"side": "bottom", "from": 10.0}]
    parts = {"foundation": {"side": "bottom", "from": 2.0, "to": 10.0}, "grounded": ends}
    load = {"on": "grounded", "traction": [0.0, -one(rng, 3.0, 5.0, 8.0)]}
    contact = {
        "on": "foundation", "law": "compliance", "gap": one(rng, 0.3, 0.5),
        "layer": one(rng, 0.0, 0.1), "stiffness": one(rng, 1.0, 10.0, 100.0), "limit": 0.1,
        "potential_factor": one(rng, 1.0, 2.0),
    }  # fmt: skip
    more = {"electric": {"law": "shifted", "k_e": small, "phi_f": 32.0}} if small > 0 else {}
    fixed = [*clamp("left", "right"), {"on": "grounded", "potential": 0.0}]
    material = {"law": "log", "yield_strain": 1.8, **SHARP}
    mesh = grid([12.0, 2.0], [6 * n, n], parts=parts)
    return case(mesh, material, fixed, contact, sliding(small), load, **more)


def hertz(rng: Rng) -> Tables:
    """Draw Example 7.1: both contact directions, loads 160 to 1600, mu 0 to 1."""
    load = {"on": "top", "traction": [0.0, -one(rng, 160.0, 800.0, 1600.0) / 16]}
    mesh = {"generator": "quarter_disc", "radius": 8.0, "contact_size": one(rng, 0.1, 0.2)}
    material = elastic(2000.0, one(rng, 0.1, 0.3, 0.45), law="linear")
    contact = {"on": "contact", "foundation": plane([0.0, 0.0], [0.0, 1.0])}
    contact["direction"] = one(rng, "foundation", "body")
    fixed = [{"on": "symmetry", "displacement": [0.0, "free"]}]
    return case(mesh, material, fixed, contact, slip_weakening(rng), load)


def block(rng: Rng) -> Tables:
    """Draw a block in 3-D, clamped on one side, pressed and pushed aside on top."""
    n = one(rng, 4, 6)
    push, press = 0.005 * one(rng, 0.0, 1.0, 2.0), -0.01 * one(rng, 1.0, 3.0)
    space, law = {"degree": one(rng, 1, 1, 1, 2) if n == 4 else 1}, one(rng, "linear", "log")
    material = elastic(1.0, one(rng, 0.1, 0.3, 0.45), law=law, yield_strain=0.02)
    contact = {"on": "bottom", "gap": one(rng, 0.0, 0.0, 0.005)}
    load = {"on": "top", "traction": [0.0, push, press]}
    mesh, friction = grid([2.0, 1.0, 1.0], [2 * n, n, n]), slip_weakening(rng)
    return case(mesh, material, clamp("left", dim=3), contact, friction, load, space=space)


def _beam(rng: Rng, slender: float, *supports: str) -> Tables:
    """Return a beam of height 1, clamped at some ends, without load and gap."""
    high = one(rng, 1, 2, 4)
    space, material = {"degree": one(rng, 1, 1, 2)}, elastic(1.0, one(rng, 0.0, 0.3, 0.45))
    mesh, friction = grid([slender, 1.0], [int(min(slender * high, 400)), high]), (0.0, 0.3, 0.8)
    contact, mu = {"on": "bottom"}, coulomb(rng, *friction)
    return case(mesh, material, clamp(*supports), contact, mu, space=space)


def cantilever(rng: Rng) -> Tables:
    """Draw a cantilever over a stop: loads that bend its tip to 1.5 to 30 times the gap."""
    slender = one(rng, 10.0, 30.0, 100.0, 300.0, 1000.0)
    drawn = _beam(rng, slender, "left")
    gap = one(rng, 1e-3, 0.1, 0.5, 2.0, 10.0)
    bend = gap * one(rng, 1.5, 5.0, 30.0)
    stiffness = 1.0 / 12.0
    side, traction = {
        "tip": ("right", [0.0, -(3 * stiffness * bend / slender**3)]),
        "uniform": ("top", [0.0, -8 * stiffness * bend / slender**4]),
        "moment": ("right", [f"{12 * (2 * stiffness * bend / slender**2)}*(y-0.5)", 0.0]),
    }[one(rng, "tip", "uniform", "moment")]
    drawn["load"], drawn["contact"]["gap"] = [{"on": side, "traction": traction}], gap
    return drawn


def clamped(rng: Rng) -> Tables:
    """Draw a beam clamped at both ends over a gap, pressed down."""
    slender = one(rng, 10.0, 40.0, 100.0, 300.0)
    drawn = _beam(rng, slender, "left", "right")
    gap = one(rng, 1e-2, 0.3, 1.0)
    load = 384 * (gap * one(rng, 1.2, 5.0, 50.0)) / 12 / slender**4
    drawn["load"], drawn["contact"]["gap"] = [{"on": "top", "traction": [0.0, -load]}], gap
    return drawn


def lifted(rng: Rng) -> Tables:
    """Draw a long beam, unloaded, half loaded, lifted at its end, pushed or sheared."""
    slender = one(rng, 20.0, 100.0, 600.0)
    drawn = _beam(rng, slender, "left")
    side, traction = one(
        rng,
        ("top", [0.0, 0.0]),
        ("top", [0.0, f"-1e-4*where(x > {slender / 2}, 1, 0)"]),
        ("right", [0.0, 1e-4 / slender**2]),
        ("right", [-1e-4, 0.0]),
        ("top", [1e-5, -1e-5]),
    )
    return drawn | {"load": [{"on": side, "traction": traction}]}


def bimorph(rng: Rng) -> Tables:
    """Draw a piezoelectric beam that its voltage bends onto a conductive foundation."""
    slender = one(rng, 10.0, 40.0)
    drawn = _beam(rng, slender, "left") | {"space": {"degree": 1}, "material": SHARP}
    drawn["fixed"].append({"on": "top", "potential": one(rng, 0.1, 0.3)})
    drawn["load"] = [{"on": "right", "traction": [0.0, -58.7 * 0.2 / slender**3]}]
    drawn["contact"]["gap"] = one(rng, 0.01, 0.1)
    drawn["electric"] = {"k_e": one(rng, 1e-9, 1e-3, 1.0, 1e3), "phi_f": 0.0, "delta": 10.0}
    return drawn


def plate(rng: Rng) -> Tables:
    """Draw a plate in 3-D, clamped on one or two sides, over a gap."""
    wide, n, gap = one(rng, 10.0, 30.0), one(rng, 8, 12), one(rng, 0.05, 0.5)
    sides = one(rng, ("left",), ("left", "right"))
    factor = 8.0 if len(sides) == 1 else 384.0
    load = {"on": "top", "traction": [0.0, 0.0, -factor * gap * one(rng, 1.5, 10.0) / 12 / wide**4]}
    contact, friction = {"on": "bottom", "gap": gap}, coulomb(rng, 0.0, 0.3)
    mesh = grid([wide, wide, 1.0], [n, n, 1])
    return case(mesh, elastic(), clamp(*sides, dim=3), contact, friction, load)


def _block(
    rng: Rng, cells: tuple[int, int] = (32, 8), size: tuple[float, float] = (4.0, 1.0)
) -> Tables:
    """Return a block, clamped on the left, pressed and pushed aside on top."""
    load = {"on": "top", "traction": [2e-3, f"-0.01*(1+x/{size[0]})"]}
    mesh, friction = grid([*size], [*cells]), coulomb(rng, 0.0, 0.3, 0.6)
    return case(mesh, elastic(), clamp("left"), {"on": "bottom"}, friction, load)


def stretched(rng: Rng) -> Tables:
    """Draw a block whose cells are stretched along the normal or the tangent."""
    ratio = one(rng, 30.0, 100.0, 300.0, 1000.0)
    if one(rng, True, False):  # narrow cells: many nodes along Gamma_3
        return _block(rng, (200, 4), (4.0, 4.0 * 4 * ratio / 200))
    return _block(rng, (20, 10), (4.0, 4.0 / 20 * 10 / ratio))


def stiff(rng: Rng) -> Tables:
    """Draw a nearly incompressible block."""
    drawn = _block(rng)
    drawn["material"]["poisson"] = one(rng, 0.49, 0.499)
    return drawn | {"space": {"degree": one(rng, 1, 2)}}


def rough(rng: Rng) -> Tables:
    """Draw a block with friction beyond 1."""
    return _block(rng) | {"friction": coulomb(rng, 1.0, 2.0, 5.0, 50.0)}


def few(rng: Rng) -> Tables:
    """Draw a disc that touches at single nodes, or at none."""
    mesh = {"generator": "quarter_disc", "radius": 8.0, "contact_size": 0.8}
    load = {"on": "top", "traction": [0.0, -one(rng, 1e-3, 1e-1, 1.0, 10.0)]}
    contact = {"on": "contact", "foundation": plane([0.0, -0.01], [0.0, 1.0])}
    fixed = [{"on": "symmetry", "displacement": [0.0, "free"]}]
    return case(mesh, elastic(2000.0), fixed, contact, coulomb(rng, 0.0, 0.5), load)


def units(rng: Rng) -> Tables:
    """Draw a block, or a cantilever, in other units of length and stress."""
    stress, length = one(rng, 1e-12, 1.0, 1e12), one(rng, 1e-9, 1.0, 1e6)
    drawn = one(rng, cantilever, rough)(rng)
    drawn["mesh"]["size"] = [length * side for side in drawn["mesh"]["size"]]
    drawn["material"]["young"] = stress
    scaled = []
    for component in drawn["load"][0]["traction"]:
        text = component if isinstance(component, str) else repr(float(component))
        for name in "xy":
            text = text.replace(name, f"({name}/{length!r})")
        scaled.append(f"{stress!r}*({text})")
    drawn["load"][0]["traction"] = scaled
    drawn["contact"]["gap"] = length * drawn["contact"].get("gap", 0.0)
    return drawn


def layers(rng: Rng) -> Tables:
    """Draw a block on a layer much softer to much stiffer than itself."""
    drawn = _block(rng)
    drawn["contact"] |= {
        "law": "compliance", "gap": 0.02, "layer": one(rng, 0.02, 0.03),
        "stiffness": one(rng, 1e-3, 1.0, 1e3, 1e6), "limit": one(rng, 1e-3, 0.1),
        "potential_factor": 1.0,
    }  # fmt: skip
    return drawn


def yielding(rng: Rng) -> Tables:
    """Draw a bar far beyond its yield strain."""
    drawn = _block(rng)
    drawn["material"] |= {"law": "log", "yield_strain": 0.01}
    drawn["load"][0]["traction"] = [0.0, -one(rng, 0.05, 0.1, 0.3)]
    return drawn


def corners(rng: Rng) -> Tables:
    """Draw a block or a beam over a foundation with a step, an edge or a groove."""
    drawn = one(rng, _block(rng, (64, 8)), _block(rng, (160, 4), (40.0, 1.0)))
    long = drawn["mesh"]["size"][0]
    depth = one(rng, 1e-3, 1e-2) * long
    drawn["contact"]["gap"] = one(
        rng,
        f"where(x > {0.6 * long}, {depth}, 0)",
        f"{depth / long}*abs(x-{0.6 * long})",
        f"where(x > {0.3 * long}, where(x < {0.7 * long}, {depth}, 0), 0)",
    )
    if long > 10:
        drawn["load"][0]["traction"] = [0.0, -one(rng, 1e-5, 1e-4)]
    return drawn


def unsupported(rng: Rng) -> Tables:
    """Draw a block that contact alone holds up; its top, or a side, is guided."""
    drawn = _block(rng, (one(rng, 32, 64), 8))
    drawn["fixed"] = [{"on": one(rng, "top", "left"), "displacement": [0.0, "free"]}]
    push = one(rng, 0.0, 1e-3, -1e-3)
    drawn["load"] = [
        {"on": "top", "traction": [0.0, f"-0.01*(1+x/{one(rng, 4.0, 40.0)})"]},
        {"on": "right", "traction": [push, 0.0]},
    ]
    drawn["contact"]["gap"] = one(rng, 0.0, 1e-2)
    return drawn


#: Friction of the problems on cells of all shapes.
_friction = partial(slip_weakening, mus=(0.0, 0.1, 0.3, 0.6, 1.0), rates=(0.0, 1e2, 1e4, 6e7))


def round_body(rng: Rng, dim: int) -> Tables:
    """Draw half a disc or a quarter of half a ball, pressed on a plane or a rigid cylinder."""
    size = one(rng, 0.8, 1.6) if dim == 2 else 3.0
    mesh = {"generator": "quarter_disc" if dim == 2 else "sphere", "radius": 8.0, "size": 3.0}
    mesh |= {"contact_size": size, "order": one(rng, 1, 2)}
    up = [0.0] * (dim - 1)
    ball = {"shape": "sphere", "centre": [*up, -12.0], "radius": 12.0}
    ground = one(rng, plane([*up, 0.0], [*up, 1.0]), ball)
    load, law = -one(rng, 1.0, 10.0, 100.0), one(rng, "linear", "log")
    sides = ["symmetry"] if dim == 2 else ["symmetry_x", "symmetry_y"]
    space, more = {"degree": one(rng, 1, 2)}, {"yield_strain": 0.02} if law == "log" else {}
    material = elastic(2000.0, one(rng, 0.1, 0.3, 0.45), law=law, **more)
    fixed = [
        {"on": side, "displacement": [0.0 if i == k else "free" for i in range(dim)]}
        for k, side in enumerate(sides)
    ]
    contact = {"on": "contact", "foundation": ground, "direction": one(rng, "foundation", "body")}
    loads = {"on": "top", "traction": [*up, load]}
    return case(mesh, material, fixed, contact, _friction(rng), loads, space=space)


def pair(rng: Rng, dim: int) -> Tables:
    """Draw two bodies whose meshes do not match: blocks, or in 2-D a cylinder on a block."""
    degree, push = one(rng, 1, 2), one(rng, 0.0, 0.3, -1.0)
    if dim == 2 and one(rng, True, False):
        mesh = {"generator": "cylinder_on_block", "radius": 8.0, "width": 8.0, "height": 6.0}
        mesh |= {"size": 3.0, "contact_size": 0.8, "order": one(rng, 1, 2)}
        way, sides, bodies = -one(rng, 0.01, 0.1), ("arc", "block_top"), ("cylinder", "block")
        fixed = [
            {"on": "symmetry", "displacement": [0.0, "free"]},
            {"on": "block_bottom", "displacement": ["free", 0.0]},
            {"on": "top", "displacement": ["free", way]},
        ]
    else:
        mesh = {"generator": "two_blocks"}
        if dim == 3:
            mesh = {"generator": "two_boxes", "lower_size": 0.8, "upper_size": 0.6}
        way, sides = -one(rng, 0.001, 0.01), ("upper_bottom", "lower_top")
        bodies = ("lower", "upper")
        aside = [-push * way] + [0.0] * (dim - 2)
        fixed = clamp("lower_bottom", dim=dim)
        fixed.append({"on": "upper_top", "displacement": [*aside, way]})
    on, against = sides[::-1] if one(rng, True, False) else sides
    return {
        "mesh": mesh,
        "space": {"degree": degree},
        "material": [
            {"on": body, "young": one(rng, 0.2, 1.0, 5.0), "poisson": one(rng, 0.0, 0.3, 0.45)}
            for body in bodies
        ],
        "fixed": fixed,
        "contact": [{"on": on, "against": against, "friction": _friction(rng)}],
    }


def _on_cells(rng: Rng, draws: tuple[Draw, ...], cell: str) -> Tables:
    """Draw one of some problems, on cells of a shape and of degree 1 or 2."""
    drawn: Tables = one(rng, *draws)(rng)
    drawn["mesh"]["cell"] = cell
    drawn.setdefault("space", {"degree": one(rng, 1, 2)})
    return drawn


def two_blocks(rng: Rng, _: int) -> Tables:
    """Draw a block pressed on another one and pushed along: moduli, sizes, gaps, mu at random."""
    width = rng.uniform(1.0, 4.0)
    upper = width * rng.uniform(0.3, 1.5)
    heights, sizes = rng.uniform(0.3, 2.0, 2), rng.uniform(0.06, 0.4, 2)
    ratio, press = 10 ** rng.uniform(-3, 3), rng.uniform(0.001, 0.03)
    gap: float | str = rng.choice([0.0, 0.5 * press])
    if rng.random() < 0.3:
        gap = f"{rng.uniform(0, 0.01):.4g}*x**2"
    on, against = ("upper_bottom", "lower_top")[:: 1 if rng.random() < 0.5 else -1]
    mesh = {
        "generator": "two_blocks", "lower_width": width, "upper_width": upper,
        "lower_height": heights[0], "upper_height": heights[1],
        "lower_size": sizes[0], "upper_size": sizes[1],
    }  # fmt: skip
    space = {"degree": int(rng.integers(1, 3))}
    material = [
        {"on": name, **elastic(young, rng.uniform(0.0, 0.45))}
        for name, young in (("upper", ratio), ("lower", 1.0))
    ]
    fixed = clamp("lower_bottom")
    fixed.append({"on": "upper_top", "displacement": [rng.uniform(-1, 1) * press, -press]})
    contact, friction = {"on": on, "against": against, "gap": gap}, sliding(rng.uniform(0.0, 1.0))
    return case(mesh, material, fixed, contact, friction, space=space, solver={"tolerance": 1e-10})


#: Hardening of metals (MPa), by family.
HARDENING: dict[str, Tables] = {
    "none": {},
    "linear": {"hardening": 4e3},
    "kinematic": {"kinematic": 4e3},
    "voce": {"hardening": {"saturation": 150.0, "rate": 100.0}},
    "points": {"hardening": [[0.0, 250.0], [0.01, 320.0], [0.05, 400.0]]},
    "chaboche": {"kinematic": [{"modulus": 40e3, "recovery": 300.0}, {"modulus": 2e3}]},
}


def metal(rng: Rng, number: int, name: str) -> Tables:
    """Draw an evolution of one plastic body or two: press, shear, unload, reverse."""
    two, degree = bool(rng.integers(2)), int(rng.integers(1, 3))
    mu = float(rng.choice([0.0, 0.1, 0.3, 0.6, 1.0]))
    down = rng.uniform(1.0, 4.0) * 1e-3 * np.array([1.0, 1.0, rng.uniform(0.3, 0.9), 1.2])
    aside = rng.uniform(-3e-3, 3e-3, 3)
    elastic = {"young": 200e3, "poisson": 0.3}
    material: Any = {"law": "j2", **elastic, "yield_stress": 250.0, **HARDENING[name]}
    n, top, fixed = 6 if degree == 2 else 10, "top", []
    mesh, contact = grid([2.0, 1.0], [2 * n, n]), {"on": "bottom", "gap": "0.002*(x-1)**2"}
    if two:
        mesh, top, fixed = {"generator": "two_blocks"}, "upper_top", clamp("lower_bottom")
        contact = {"on": "upper_bottom", "against": "lower_top"}
        # The lower one is elastic, or of a softer metal (where a list of points does not say it).
        softer = material | {"yield_stress": 250.0 if name == "points" else 0.7 * 250.0}
        lower = softer if number % 4 < 2 else elastic
        material = [{"on": "upper", **material}, {"on": "lower", **lower}]
    times = [0.0, 1.0, 2.0, 3.0, 4.0]
    moves = {"aside": [0.0, 0.0, *aside.tolist()], "down": [0.0, *(-down).tolist()]}
    return {
        "mesh": mesh,
        "space": {"degree": degree},
        "material": material,
        "fixed": [
            {"on": top, "displacement": [1.0, "free"], "amplitude": "aside"},
            {"on": top, "displacement": ["free", 1.0], "amplitude": "down"},
            *fixed,
        ],
        "contact": contact,
        **({"friction": {"law": "coulomb", "mu": mu}} if mu else {}),
        "evolution": {
            "times": times, "steps": [4, 4, 4, 4],
            "amplitudes": {key: {"time": times, "value": value} for key, value in moves.items()},
        },
    }  # fmt: skip


_FLAT = (bar, piezo, layer, partial(round_body, dim=2), partial(pair, dim=2))
_SOLID = (block, partial(round_body, dim=3), partial(pair, dim=3))

PLAIN: Families = {draw.__name__: (draw, range(count)) for draw, count in (
    (bar, 120), (piezo, 60), (layer, 40), (hertz, 30), (block, 50),
)}  # fmt: skip
HARD: Families = {draw.__name__: (draw, range(count)) for draw, count in (
    (cantilever, 70), (clamped, 30), (lifted, 30), (bimorph, 20), (plate, 20), (stretched, 40),
    (stiff, 15), (rough, 15), (few, 10), (units, 20), (layers, 20), (yielding, 10), (corners, 20),
    (unsupported, 20),
)}  # fmt: skip
CELLS: Families = {
    cell: (partial(_on_cells, draws=draws, cell=cell), range(50))
    for cell, draws in (("triangle", _FLAT), ("quadrilateral", _FLAT),
                        ("tetrahedron", _SOLID), ("hexahedron", _SOLID))
}  # fmt: skip
PLASTIC: Families = {
    name: (partial(metal, name=name), range(first, 60, len(HARDENING)))
    for first, name in enumerate(HARDENING)
}
PAIRS: Families = {"two_blocks": (two_blocks, range(100))}
