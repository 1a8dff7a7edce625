"""Ten problems with the parameters that they are differentiated by, and Taylor's series of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from mpi4py import MPI

from contact import parse_case, solve
from contact.case.file import number_at, with_number
from contact.derivatives.by_parameters import (
    ADJOINT,
    TANGENT,
    Parameter,
    Sensitivities,
    parameters_of,
    sensitivity,
)
from contact.results.quantities import named_functionals
from contact.solution import Solution
from contact.typing import Array
from tests.problems.rigid import PIEZO

Tables = dict[str, Any]

#: Largest step in Taylor's series, in sizes of the parameters; the other one is half of it.
STEP = 2e-5

#: Of results, in every problem.
RESULTS = "contact_force_y", "max_pressure", "max_displacement"

SLIP = {"law": "slip", "a": 0.33, "b": 0.12, "rho": 20.0}


def block(**more: Any) -> Tables:
    """Return a block on a plane, pressed and pushed on its top; tables given replace its own."""
    return {
        "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [12, 6]},
        "material": {"young": 1.96, "poisson": 0.12},
        "fixed": [{"on": "top", "displacement": [0.0177, -0.0202]}],
        "contact": {"on": "bottom", "gap": "0.0129*(x - 0.9)**2"},
        "friction": {"law": "coulomb", "mu": 0.33},
        "solver": {"tolerance": 1e-13},
        **more,
    }


def evolving(data: Tables, steps: int = 2) -> Tables:
    """Return a block that is pressed, sheared and sheared back."""
    (top,) = data["fixed"]
    push, press = top["displacement"]
    return data | {
        "fixed": [
            {"on": "top", "displacement": ["free", press], "amplitude": "press"},
            {"on": "top", "displacement": [push, "free"], "amplitude": "shear"},
        ],
        "evolution": {
            "times": [0.0, 1.0, 2.0, 3.0],
            "steps": [steps] * 3,
            "amplitudes": {
                "press": {"time": [0.0, 1.0, 3.0], "value": [0.0, 1.0, 0.7]},
                "shear": {"time": [0.0, 1.0, 2.0, 3.0], "value": [0.0, 0.1, 1.0, -0.4]},
            },
        },
    }


def smoothed() -> Tables:
    """Return the block with mu(slip), and pressures that are smoothed in the bound."""
    return block(friction={"law": "coulomb", "mu": SLIP, "radius": 0.2})


def revolved() -> Tables:
    """Return a body of revolution by Hencky's law."""
    return block(
        space={"kinematics": "axisymmetric", "degree": 2},
        material={"law": "log", "young": 1.31, "poisson": 0.27, "yield_strain": 0.01},
        fixed=[{"on": "top", "displacement": [0.0, -0.0103]}],
        contact={"on": "bottom", "gap": "0.01*x**2"},
    )


def layer() -> Tables:
    """Return the block on a compliant layer."""
    contact = {"on": "bottom", "gap": "0.01*(x - 0.9)**2 + 0.055"}
    return block(
        contact=contact | {"law": "compliance", "layer": 0.05, "stiffness": 5.0, "limit": 0.1}
    )


def slipping() -> Tables:
    """Return the evolution with mu(slip)."""
    return evolving(block(friction={"law": "coulomb", "mu": SLIP}))


def plastic() -> Tables:
    """Return the evolution of a metal."""
    law = {"law": "j2", "yield_stress": 0.0131, "hardening": 0.2}
    return evolving(block(material={"young": 1.31, "poisson": 0.27, **law}))


def charged() -> Tables:
    """Return the evolution of a piezoelectric block whose electrode has a charge."""
    return evolving(
        block(
            material={"young": 100.0, "poisson": 0.3, "piezo": PIEZO},
            electric={"law": "perfect", "k_e": 1.3, "phi_f": 0.05},
            electrode=[{"on": "top", "charge": 0.07, "amplitude": "constant"}],
        )
    )


def two_bodies() -> Tables:
    """Return a block under a load that lies on another one."""
    return block(
        mesh={"generator": "two_blocks", "lower_size": 0.3, "upper_size": 0.23},
        material=[
            {"on": "upper", "young": 1.31, "poisson": 0.27},
            {"on": "lower", "young": 2.3, "poisson": 0.25},
        ],
        fixed=[{"on": "lower_bottom", "displacement": [0.0, 0.0]}],
        load=[{"on": "upper_top", "traction": [0.0017, -0.0143]}],
        contact={"on": "upper_bottom", "against": "lower_top"},
        friction={"law": "coulomb", "mu": 0.43},
    )


def ball_under_force() -> Tables:
    """Return a block that a rigid ball is pressed on by a force."""
    ball = {"shape": "sphere", "centre": [1.0, 2.0], "radius": 1.0}
    rigid = {"displacement": ["free", "free"], "force": [1.1e-4, -2.7e-3], "centre": [1.0, 2.0]}
    return block(
        fixed=[{"on": "bottom", "displacement": [0.0, 0.0]}],
        contact={"on": "top", "foundation": ball, "rigid": rigid},
    )


def space() -> Tables:
    """Return the block in 3-D."""
    return block(
        mesh={"generator": "box", "size": [2.0, 1.0, 1.0], "cells": [4, 3, 3]},
        fixed=[{"on": "top", "displacement": [0.0071, 0.0023, -0.0193]}],
        contact={"on": "bottom", "gap": "0.01*((x - 0.9)**2 + (y - 0.4)**2)"},
    )


def turning_plate() -> Tables:
    """Return the block under a plate that a force and a moment move and turn."""
    plate = {"on": "top", "displacement": ["free", "free"], "force": [0.0013, -0.0147]}
    plate |= {"rotation": "free", "moment": 4.1e-4, "centre": [0.87, 0.1]}
    return block(fixed=[], rigid=[plate], friction={"law": "coulomb", "mu": 0.53})


@dataclass(frozen=True)
class Problem:
    """A problem with its parameters."""

    #: Makes the tables of the case.
    tables: Callable[[], Tables]
    #: Keys of the parameters, numbers that are not 0.
    parameters: Sequence[str]
    #: Results beside those of all.
    results: Sequence[str] = ("contact_force_x",)


BODY = "material.young", "material.poisson"
LAW = "friction.mu.a", "friction.mu.b", "friction.mu.rho"
TOP = "fixed.0.displacement.0", "fixed.0.displacement.1"
#: Of an evolution.
WAYS = "fixed.0.displacement.1", "fixed.1.displacement.0"

PROBLEMS = {
    "smoothed": Problem(smoothed, (*BODY, *LAW, *TOP)),
    "revolved": Problem(revolved, (*BODY, "friction.mu", TOP[1]), ()),
    "layer": Problem(
        layer, (*BODY, "friction.mu", *TOP, "contact.stiffness", "contact.limit")
    ),
    "slipping": Problem(slipping, (*BODY, *LAW, *WAYS)),
    "plastic": Problem(
        plastic, (*BODY, "material.yield_stress", "material.hardening", "friction.mu", *WAYS)
    ),
    "charged": Problem(
        charged,
        (
            *BODY, *(f"material.piezo.{name}" for name in PIEZO), "friction.mu", *WAYS,
            "electric.k_e", "electric.phi_f", "electrode.0.charge",
        ),
        ("contact_force_x", "charge_foundation", "potential_top", "reaction_x_top"),
    ),
    "two bodies": Problem(
        two_bodies,
        (
            "material.0.young", "material.0.poisson", "material.1.young", "material.1.poisson",
            "friction.mu", "load.0.traction.0", "load.0.traction.1",
        ),
    ),
    "ball": Problem(
        ball_under_force,
        (*BODY, "friction.mu", "contact.rigid.force.0", "contact.rigid.force.1"),
        ("contact_force_x", "rigid_x", "rigid_y"),
    ),
    "3-D": Problem(space, (*BODY, "friction.mu", *TOP, "fixed.0.displacement.2")),
    "plate": Problem(
        turning_plate,
        (
            *BODY, "friction.mu", "mesh.size.0", "mesh.size.1", "rigid.0.force.0",
            "rigid.0.force.1", "rigid.0.moment", "rigid.0.centre.0", "rigid.0.centre.1",
        ),
        ("contact_force_x", "rigid_x", "rigid_y", "rigid_rotation"),
    ),
}  # fmt: skip


def values(solution: Solution, names: Sequence[str]) -> Array:
    """Return results of the end of a solution. Collective."""
    known, state = named_functionals(solution.problem), solution.state
    problem = solution.problem.at(state.time, state.history)
    return np.array([known[name](problem, state) for name in names])


def by_both(
    solution: Solution, names: Sequence[str], parameters: Sequence[str] | Mapping[str, Parameter]
) -> tuple[Sensitivities, Sensitivities]:
    """Return the derivatives by the tangent and by the adjoint. Collective.

    The problems beside the parameters, which take most of the time to set up, are the same.
    """
    shared = {
        name: replace(one, problem=cache(one.problem))
        for name, one in parameters_of(solution, parameters)
    }
    tangent, adjoint = (sensitivity(solution, names, shared, way) for way in (TANGENT, ADJOINT))
    return tangent, adjoint


@dataclass(frozen=True)
class Taylor:
    """Taylor's series of results along a way of parameters, by the tangent; all is relative."""

    #: Largest difference of the adjoint, over derivative and result.
    adjoint: float
    #: Largest difference of one-sided differences of second order, over derivative and a hundredth
    #: of the result.
    apart: float
    #: Order of the largest remainder of first order.
    order: float
    #: Number of weakly active nodes.
    weak: int


def taylor(
    solution: Solution, names: Sequence[str], sizes: Mapping[str, float], way: Array
) -> Taylor:
    """Compare tangent, adjoint and two more solutions along a way. Collective."""
    case, comm = solution.source, solution.problem.comm
    both = by_both(solution, names, [*sizes])
    # By relative changes of the parameters: in the units of the results.
    scale = np.array([*sizes.values()])
    tangent, adjoint = (
        np.array([[of[name][key] for key in sizes] for name in names]) * scale for of in both
    )
    here = values(solution, names)
    natural = np.maximum(np.abs(here), 1e-300)
    least = np.maximum(np.abs(tangent), natural[:, None])

    def moved(by: float) -> Array:
        """Return the change of the results."""
        end = case
        for key, change in zip(sizes, by * way * scale, strict=True):
            end = with_number(end, key, number_at(case, key) + change)
        return values(solve(end, comm=comm), names) - here

    far, near = moved(STEP), moved(STEP / 2)
    along, apart = tangent @ way, (4 * near - far) / STEP
    first, second = (
        float((np.abs(end - by * along) / natural).max())
        for end, by in ((far, STEP), (near, STEP / 2))
    )
    return Taylor(
        float((np.abs(tangent - adjoint) / least).max()),
        float((np.abs(along - apart) / np.maximum(np.abs(apart), 1e-2 * natural)).max()),
        float(np.log2(first / second)) if second else np.nan,
        len(both[0].weakly_active),
    )


def series(name: str, comm: MPI.Intracomm) -> Taylor:
    """Compare along a random way of all parameters of a problem. Collective."""
    problem = PROBLEMS[name]
    solution = solve(parse_case(problem.tables()), comm=comm)
    sizes = {key: abs(number_at(solution.source, key)) for key in problem.parameters}
    way = np.random.default_rng(0).uniform(-1, 1, len(sizes))
    return taylor(solution, (*RESULTS, *problem.results), sizes, way)
