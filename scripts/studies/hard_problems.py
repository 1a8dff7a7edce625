"""Problems that bend, stick, stretch and harden: the second half of the robustness sweep.

`python3 -m scripts.studies.sweep --hard` solves them. Each family is drawn with a seed of its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Case = dict[str, Any]
Rng = np.random.Generator


def _one(rng: Rng, *values: Any) -> Any:
    """Draw one of some values, as Python's own."""
    value = values[int(rng.integers(len(values)))]
    return value


def _friction(rng: Rng, *coefficients: float) -> Case:
    mu = _one(rng, *coefficients)
    return {"law": "coulomb", "mu": mu} if mu > 0 else {"law": "none"}


def _beam(rng: Rng, slender: float, supports: tuple[str, ...]) -> Case:
    """Return a beam of height 1, clamped at some ends, without load and gap."""
    high = _one(rng, 1, 2, 4)
    long = int(min(slender * high, 400))
    return {
        "mesh": {"generator": "rectangle", "size": [slender, 1.0], "cells": [long, high]},
        "space": {"degree": _one(rng, 1, 1, 2)},
        "material": {"young": 1.0, "poisson": _one(rng, 0.0, 0.3, 0.45)},
        "fixed": [{"on": side, "displacement": [0.0, 0.0]} for side in supports],
        "contact": {"on": "bottom"},
        "friction": _friction(rng, 0.0, 0.3, 0.8),
    }


def cantilever(rng: Rng) -> Case:
    """Draw a cantilever over a stop: loads that bend its tip to 1.5 to 30 times the gap."""
    slender = _one(rng, 10.0, 30.0, 100.0, 300.0, 1000.0)
    case = _beam(rng, slender, ("left",))
    gap = _one(rng, 1e-3, 0.1, 0.5, 2.0, 10.0)
    bend = gap * _one(rng, 1.5, 5.0, 30.0)
    kind = _one(rng, "tip", "uniform", "moment")
    stiffness = 1.0 / 12.0
    if kind == "tip":
        force = 3 * stiffness * bend / slender**3
        load = {"on": "right", "traction": [0.0, -force]}
    elif kind == "uniform":
        load = {"on": "top", "traction": [0.0, -8 * stiffness * bend / slender**4]}
    else:
        moment = 2 * stiffness * bend / slender**2
        load = {"on": "right", "traction": [f"{12 * moment}*(y-0.5)", 0.0]}
    case["load"], case["contact"]["gap"] = [load], gap
    return case


def clamped(rng: Rng) -> Case:
    """Draw a beam clamped at both ends over a gap, pressed down."""
    slender = _one(rng, 10.0, 40.0, 100.0, 300.0)
    case = _beam(rng, slender, ("left", "right"))
    gap = _one(rng, 1e-2, 0.3, 1.0)
    bend = gap * _one(rng, 1.2, 5.0, 50.0)
    load = 384 * bend / 12 / slender**4
    case["load"], case["contact"]["gap"] = [{"on": "top", "traction": [0.0, -load]}], gap
    return case


def lifted(rng: Rng) -> Case:
    """Draw a long beam, unloaded, half loaded, lifted at its end, pushed or sheared."""
    slender = _one(rng, 20.0, 100.0, 600.0)
    case = _beam(rng, slender, ("left",))
    side, traction = _one(
        rng,
        ("top", [0.0, 0.0]),
        ("top", [0.0, f"-1e-4*where(x > {slender / 2}, 1, 0)"]),
        ("right", [0.0, 1e-4 / slender**2]),
        ("right", [-1e-4, 0.0]),
        ("top", [1e-5, -1e-5]),
    )
    case["load"] = [{"on": side, "traction": traction}]
    return case


def bimorph(rng: Rng) -> Case:
    """Draw a piezoelectric beam that its voltage bends onto a conductive foundation."""
    slender = _one(rng, 10.0, 40.0)
    case = _beam(rng, slender, ("left",))
    case["space"] = {"degree": 1}
    case["material"] = {"young": 58.7102, "poisson": 0.3912, "piezo": _pzt()}
    case["fixed"].append({"on": "top", "potential": _one(rng, 0.1, 0.3)})
    case["load"] = [{"on": "right", "traction": [0.0, -58.7 * 0.2 / slender**3]}]
    case["contact"]["gap"] = _one(rng, 0.01, 0.1)
    case["electric"] = {"k_e": _one(rng, 1e-9, 1e-3, 1.0, 1e3), "phi_f": 0.0, "delta": 10.0}
    return case


def plate(rng: Rng) -> Case:
    """Draw a plate in 3-D, clamped on one or two sides, over a gap."""
    wide = _one(rng, 10.0, 30.0)
    n = _one(rng, 8, 12)
    gap = _one(rng, 0.05, 0.5)
    sides = _one(rng, ("left",), ("left", "right"))
    factor = 8.0 if len(sides) == 1 else 384.0
    load = factor * gap * _one(rng, 1.5, 10.0) / 12 / wide**4
    return {
        "mesh": {"generator": "box", "size": [wide, wide, 1.0], "cells": [n, n, 1]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": side, "displacement": [0.0, 0.0, 0.0]} for side in sides],
        "load": [{"on": "top", "traction": [0.0, 0.0, -load]}],
        "contact": {"on": "bottom", "gap": gap},
        "friction": _friction(rng, 0.0, 0.3),
    }


def _block(rng: Rng, cells: list[int], size: list[float]) -> Case:
    return {
        "mesh": {"generator": "rectangle", "size": size, "cells": cells},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0]}],
        "load": [{"on": "top", "traction": [2e-3, f"-0.01*(1+x/{size[0]})"]}],
        "contact": {"on": "bottom"},
        "friction": _friction(rng, 0.0, 0.3, 0.6),
    }


def stretched(rng: Rng) -> Case:
    """Draw a block whose cells are stretched along the normal or the tangent."""
    ratio = _one(rng, 30.0, 100.0, 300.0, 1000.0)
    if _one(rng, True, False):  # narrow cells: many nodes along Gamma_3
        return _block(rng, [200, 4], [4.0, 4.0 * 4 * ratio / 200])
    return _block(rng, [20, 10], [4.0, 4.0 / 20 * 10 / ratio])


def stiff(rng: Rng) -> Case:
    """Draw a nearly incompressible block."""
    case = _block(rng, [32, 8], [4.0, 1.0])
    case["material"]["poisson"] = _one(rng, 0.49, 0.499)
    case["space"] = {"degree": _one(rng, 1, 2)}
    return case


def rough(rng: Rng) -> Case:
    """Draw a block with friction beyond 1."""
    case = _block(rng, [32, 8], [4.0, 1.0])
    case["friction"] = {"law": "coulomb", "mu": _one(rng, 1.0, 2.0, 5.0, 50.0)}
    return case


def few(rng: Rng) -> Case:
    """Draw a disc that touches at single nodes, or at none."""
    return {
        "mesh": {"generator": "quarter_disc", "radius": 8.0, "contact_size": 0.8},
        "material": {"young": 2000.0, "poisson": 0.3},
        "fixed": [{"on": "symmetry", "displacement": [0.0, "free"]}],
        "load": [{"on": "top", "traction": [0.0, -_one(rng, 1e-3, 1e-1, 1.0, 10.0)]}],
        "contact": {
            "on": "contact",
            "foundation": {"shape": "plane", "point": [0.0, -0.01], "normal": [0.0, 1.0]},
        },
        "friction": _friction(rng, 0.0, 0.5),
    }


def units(rng: Rng) -> Case:
    """Draw a block, or a cantilever, in other units of length and stress."""
    stress, length = _one(rng, 1e-12, 1.0, 1e12), _one(rng, 1e-9, 1.0, 1e6)
    case = _one(rng, cantilever, rough)(rng)
    case["mesh"]["size"] = [length * side for side in case["mesh"]["size"]]
    case["material"]["young"] = stress
    scaled = []
    for component in case["load"][0]["traction"]:
        text = component if isinstance(component, str) else repr(float(component))
        for name in "xy":
            text = text.replace(name, f"({name}/{length!r})")
        scaled.append(f"{stress!r}*({text})")
    case["load"][0]["traction"] = scaled
    case["contact"]["gap"] = length * case["contact"].get("gap", 0.0)
    return case


def layers(rng: Rng) -> Case:
    """Draw a block on a layer much softer to much stiffer than itself."""
    case = _block(rng, [32, 8], [4.0, 1.0])
    case["contact"] |= {
        "law": "compliance",
        "gap": 0.02,
        "layer": _one(rng, 0.02, 0.03),
        "stiffness": _one(rng, 1e-3, 1.0, 1e3, 1e6),
        "limit": _one(rng, 1e-3, 0.1),
        "potential_factor": 1.0,
    }
    return case


def yielding(rng: Rng) -> Case:
    """Draw a bar far beyond its yield strain."""
    case = _block(rng, [32, 8], [4.0, 1.0])
    case["material"] = {"law": "log", "young": 1.0, "poisson": 0.3, "yield_strain": 0.01}
    case["load"][0]["traction"] = [0.0, -_one(rng, 0.05, 0.1, 0.3)]
    return case


def corners(rng: Rng) -> Case:
    """Draw a block or a beam over a foundation with a step, an edge or a groove."""
    case = _one(rng, _block(rng, [64, 8], [4.0, 1.0]), _block(rng, [160, 4], [40.0, 1.0]))
    long = case["mesh"]["size"][0]
    depth = _one(rng, 1e-3, 1e-2) * long
    case["contact"]["gap"] = _one(
        rng,
        f"where(x > {0.6 * long}, {depth}, 0)",
        f"{depth / long}*abs(x-{0.6 * long})",
        f"where(x > {0.3 * long}, where(x < {0.7 * long}, {depth}, 0), 0)",
    )
    if long > 10:
        case["load"][0]["traction"] = [0.0, -_one(rng, 1e-5, 1e-4)]
    return case


def unsupported(rng: Rng) -> Case:
    """Draw a block that contact alone holds up; its top, or a side, is guided."""
    case = _block(rng, [_one(rng, 32, 64), 8], [4.0, 1.0])
    side = _one(rng, "top", "left")
    case["fixed"] = [{"on": side, "displacement": [0.0, "free"]}]
    push = _one(rng, 0.0, 1e-3, -1e-3)
    case["load"] = [
        {"on": "top", "traction": [0.0, f"-0.01*(1+x/{_one(rng, 4.0, 40.0)})"]},
        {"on": "right", "traction": [push, 0.0]},
    ]
    case["contact"]["gap"] = _one(rng, 0.0, 1e-2)
    return case


def _pzt() -> dict[str, float]:
    return {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}


#: Family -> how it is drawn.
FAMILIES = {
    draw.__name__: draw
    for draw in (
        cantilever,
        clamped,
        lifted,
        bimorph,
        plate,
        stretched,
        stiff,
        rough,
        few,
        units,
        layers,
        yielding,
        corners,
        unsupported,
    )
}

#: How many problems of each family.
COUNTS = {
    "cantilever": 70,
    "clamped": 30,
    "lifted": 30,
    "bimorph": 20,
    "plate": 20,
    "stretched": 40,
    "stiff": 15,
    "rough": 15,
    "few": 10,
    "units": 20,
    "layers": 20,
    "yielding": 10,
    "corners": 20,
    "unsupported": 20,
}
