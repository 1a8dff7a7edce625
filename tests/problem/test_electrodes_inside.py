"""Electrodes inside of the body: bimorphs and stacks against closed forms, refused uses."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Linear, Problem, parse_case, solve
from contact.case.build import build_problem
from contact.errors import InputError
from contact.mesh.domain import from_mesh
from contact.mesh.grid import rectangle
from contact.mesh.reader import convert, from_file
from contact.mesh.transfer import refined
from tests.mesh.test_input_files import FIXTURES

COMM = MPI.COMM_WORLD

#: A ceramic like PZT-5H, in units of its own.
C11, C13, C33, C44 = 12.6, 8.41, 11.7, 2.3
E31, E33, E15, BETA11, BETA33 = -6.5e-1, 23.3e-1, 17.0e-1, 1.7e-1, 1.46e-1
CERAMIC = {
    "law": "anisotropic",
    "c11": C11,
    "c12": 7.95,
    "c13": C13,
    "c33": C33,
    "c44": C44,
    "piezo": {"e31": E31, "e33": E33, "e15": E15, "beta11": BETA11, "beta33": BETA33},
}


def beam(field, half):
    """Return the curvature of a beam of two layers of thickness `half` under mean fields +-field.

    In plane strain without stress across; D3 is constant in each layer, so that the field is not.
    """
    stiffness, piezo = C11 - C13**2 / C33, E31 - C13 * E33 / C33
    permittivity = BETA33 + E33**2 / C33
    bending = 2 / 3 * stiffness * half**3 + piezo**2 / permittivity * half**3 / 6
    return piezo * field * half**2 / bending


def bimorph(kind, voltage, length=24.0, half=0.5, rotation=0.0, degree=2):
    """Return a cantilever of two layers, the electrodes outside and in the middle or outside."""
    up, down = 90.0 + rotation, -90.0 + rotation
    materials = [
        {"on": "lower", "poling": up, **CERAMIC},
        {"on": "upper", "poling": up if kind == "parallel" else down, **CERAMIC},
    ]
    outside = 0.0 if kind == "parallel" else voltage
    fixed = [
        {"on": "left", "displacement": [0.0, 0.0]},
        {"on": "bottom", "potential": 0.0},
        {"on": "top", "potential": outside},
    ]
    if kind == "parallel":
        fixed.append({"on": "middle", "potential": voltage})
    return parse_case(
        {
            "mesh": {
                "generator": "rectangle",
                "size": [length, 2 * half],
                "cells": [48, 4],
                "rotation": rotation,
                "regions": {"lower": f"y < {half}", "upper": f"y > {half}"},
                "inside": {"middle": f"abs(y - {half}) < 1e-6"},
            },
            "space": {"degree": degree},
            "material": materials,
            "fixed": fixed,
            "contact": {"on": "right", "gap": 10.0},
            "solver": {"tolerance": 1e-10},
        }
    )


def tip(solution, length=24.0, rotation=0.0):
    """Return the mean deflection of the tip across the beam. Collective."""
    body = solution.problem.body
    u = body.nodal(solution.state.x)[: body.owned // body.block_size, :2]
    c, s = np.cos(np.deg2rad(rotation)), np.sin(np.deg2rad(rotation))
    end = np.isclose(body.layout.points @ [c, s], length)
    found = np.concatenate(COMM.allgather(u[end] @ [-s, c]))
    return found.mean()


@pytest.mark.core
@pytest.mark.parallel
def test_a_parallel_bimorph_bends_twice_as_far_as_one_in_series():
    """Kappa L^2/2 of the beam, and the same voltage over half the thickness."""
    voltage, length, half = 1e-4, 24.0, 0.5
    parallel, series = (solve(bimorph(kind, voltage), comm=COMM) for kind in ("parallel", "series"))
    assert parallel.converged and series.converged
    known = abs(beam(voltage / half, half)) * length**2 / 2
    assert abs(tip(parallel)) == pytest.approx(known, rel=0.01)
    assert abs(tip(series)) == pytest.approx(known / 2, rel=0.01)
    assert abs(tip(parallel) / tip(series)) == pytest.approx(2.0, rel=2e-3)


LAYERS, THICKNESS = 10, 0.1


def stack(dim, hot, layers=LAYERS):
    """Return a stack of layers poled up and down in turn, its electrodes grounded and hot in turn.

    `hot` are entries of the case for the hot ones, which have the name "hot".
    """
    up = "xyz"[dim - 1]
    at, size = f"pi*{up}/{THICKNESS}", [*[0.3, 0.4][: dim - 1], layers * THICKNESS]
    axis = (90.0, -90.0) if dim == 2 else ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0])
    sides = ["left", "front"][: dim - 1]
    holds = [
        {"on": side, "symmetry": axis}
        for side, axis in zip(["bottom", *sides], up + "xy", strict=False)
    ]
    grounded = {"on": ["bottom", "top", "cold"], "potential": 0.0}
    return parse_case(
        {
            "mesh": {
                "generator": "rectangle" if dim == 2 else "box",
                "size": size,
                "cells": [2] * (dim - 1) + [layers],
                "regions": {"first": f"sin({at}) > 0", "second": f"sin({at}) < 0"},
                "inside": {
                    "hot": f"cos({at}) < -0.99999",
                    "cold": f"cos({at}) > 0.99999",
                },
            },
            "material": [
                {"on": region, "poling": poling, **CERAMIC}
                for region, poling in zip(("first", "second"), axis, strict=True)
            ],
            "fixed": [*holds, grounded, *hot.pop("fixed", [])],
            "contact": {"on": "right", "gap": 10.0},
            "solver": {"tolerance": 1e-12},
        }
        | hot
    )


def constants(dim):
    """Return d33 and the permittivity of the layers without stress."""
    c = np.array([[C11, 7.95, C13], [7.95, C11, C13], [C13, C13, C33]])[3 - dim :, 3 - dim :]
    e = np.array([E31, E31, E33])[3 - dim :]
    strain = np.linalg.solve(c, e)
    return strain[-1], BETA33 + e @ strain


def rise(solution):
    """Return the displacement of the top. Collective."""
    body, d = solution.problem.body, solution.problem.dim
    u = body.nodal(solution.state.x)[: body.owned // body.block_size, d - 1]
    top = np.isclose(body.layout.points[:, d - 1], LAYERS * THICKNESS)
    return np.concatenate(COMM.allgather(u[top]))


@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
def test_a_stack_of_ten_layers_grows_by_ten_times_d33_V(dim):
    voltage = 1e-3
    hot = {"fixed": [{"on": "hot", "potential": voltage}]}
    solution = solve(stack(dim, hot), comm=COMM)
    assert solution.converged
    d33, permittivity = constants(dim)
    assert rise(solution) == pytest.approx(-LAYERS * d33 * voltage, rel=1e-9)
    area = 0.3 if dim == 2 else 0.12
    charge = -LAYERS * permittivity * voltage / THICKNESS * area  # D points away from it
    assert solution.charges.electrodes["hot"] == pytest.approx(charge, rel=1e-9)
    assert solution.charges.imbalance < 1e-9


@pytest.mark.core
@pytest.mark.parallel
def test_a_stack_driven_by_a_charge():
    """The hot electrodes are one unknown potential: the charge gives the voltage."""
    voltage = 1e-3
    d33, permittivity = constants(2)
    charge = -LAYERS * permittivity * voltage / THICKNESS * 0.3
    solution = solve(stack(2, {"electrode": [{"on": "hot", "charge": charge}]}), comm=COMM)
    assert rise(solution) == pytest.approx(-LAYERS * d33 * voltage, rel=1e-9)
    member = solution.problem.body.motion(solution.state.x)
    assert member * solution.problem.description.phi_scale == pytest.approx(voltage, rel=1e-9)


def test_the_error_estimate_knows_that_charges_of_electrodes_are_jumps():
    solution = solve(stack(2, {"fixed": [{"on": "hot", "potential": 1e-3}]}))
    assert solution.error is not None and solution.error.relative < 1e-6


WRONG = {
    "a load": {"load": [{"on": "hot", "pressure": 1.0}]},
    "an elastic support": {"elastic": [{"on": "hot", "normal": 1.0}]},
    "rollers": {"fixed": [{"on": "hot", "normal": 0.0}]},
    "contact": {"contact": {"on": "hot", "gap": 0.0}},
}


@pytest.mark.parametrize("name", WRONG)
def test_nothing_acts_inside(name):
    with pytest.raises(InputError, match=r"\[part-facets\]") as error:
        build_problem(stack(2, dict(WRONG[name])))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        ({"inside": {"middle": "abs(y - 0.3) < 1e-6"}}, r"\[part-facets\]"),
        ({"regions": {"far": "y > 7"}}, r"\[part-facets\]"),
        ({"inside": {"left": "y < 1"}}, r"mesh\.inside\.left.*\[part-facets\]"),
        ({"inside": {"middle": "z > 1"}}, r"\[formula-variable\]"),
    ],
)
def test_names_that_are_refused(mesh, words):
    grid = {"generator": "rectangle", "size": [1.0, 1.0], "cells": [4, 4]}
    with pytest.raises(InputError, match=words):
        build_problem(
            parse_case(
                {
                    "mesh": grid | mesh,
                    "material": {"young": 1.0, "poisson": 0.3},
                    "fixed": [{"on": "bottom", "displacement": [0.0, 0.0]}],
                    "contact": {"on": "top", "gap": 1.0},
                }
            )
        )


@pytest.mark.parallel
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_parts_inside_are_refined_with_the_mesh(cell):
    grid = rectangle(COMM, (0.0, 0.0), (1.0, 1.0), (4, 4), cell=cell)
    domain = from_mesh(
        grid.mesh, grid.parts, inside={"middle": lambda x: np.isclose(x[1], 0.5) & (x[0] < 0.76)}
    )
    for count in (3, 6, 12):
        found = COMM.allreduce(domain.facets_anywhere("middle").size)
        assert found == count
        domain = refined(domain)


@pytest.mark.parallel
def test_a_plane_inside_may_be_a_rigid_part():
    """A block, constrained at its foot and moved in the middle: nothing above is strained."""
    case = {
        "mesh": {
            "generator": "rectangle",
            "size": [1.0, 1.0],
            "cells": [4, 4],
            "inside": {"middle": "abs(y - 0.5) < 1e-6"},
        },
        "material": {"young": 1.0, "poisson": 0.0},
        "fixed": [{"on": "bottom", "displacement": [0.0, 0.0]}],
        "rigid": [{"on": "middle", "displacement": [0.0, "free"], "force": [0.0, -0.01]}],
        "contact": {"on": "top", "gap": 1.0},
    }
    solution = solve(parse_case(case), comm=COMM)
    body = solution.problem.body
    u = body.nodal(solution.state.x)[: body.owned // 2, 1]
    above = body.layout.points[:, 1] > 0.49
    assert np.allclose(u[above], -0.005, rtol=0, atol=1e-12)


@pytest.mark.parallel
@pytest.mark.parametrize("shared", [False, True])
def test_groups_of_a_file_that_lie_inside_may_be_fixed(shared, tmp_path):
    """In the file itself, and in that of which each rank reads its share."""
    file = FIXTURES / "interior.msh"
    if shared:
        folder = Path(COMM.bcast(str(tmp_path)))
        if COMM.rank == 0:
            convert(file, folder / "body.xdmf")
        COMM.barrier()
        file = folder / "body.xdmf"
    domain = from_file(COMM, file)
    assert list(domain.inside) == ["top"]
    assert COMM.allreduce(domain.facets_anywhere("top").size) == 1
    body = Body(Linear(1.0, 0.3), Fixed("top", [0.0, 0.0]))
    problem = Problem(domain, body, Contact("bottom", 1.0))
    with pytest.raises(InputError, match=r"\[part-facets\]"):
        problem.domain.ds("top")
