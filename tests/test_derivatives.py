"""Derivatives through contact and friction: published values, differences, adjoint, errors."""

from dataclasses import replace
from functools import cache, partial
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from contact import (
    Body,
    Contact,
    Fixed,
    Friction,
    InputError,
    Linear,
    Log,
    Material,
    NewtonOptions,
    Parameter,
    Problem,
    field_gradient,
    gap_gradient,
    load_case,
    parse_case,
    sensitivity,
    solve,
    solve_steps,
)
from contact.case.build import build_problem
from contact.case.file import number_at, with_number
from contact.derivatives.by_parameters import LoadPath, logger
from contact.linear import multigrid
from contact.linear.operator import SparseOperator
from contact.mesh.domain import from_mesh
from contact.mesh.grid import rectangle
from contact.problem.solution_jacobian import Equations
from contact.results.quantities import named_functionals
from tests.problems.rigid import indented
from tests.problems.taylor import (
    PROBLEMS,
    block,
    by_both,
    plastic,
    series,
    slipping,
    space,
    two_bodies,
    values,
)

SELF = MPI.COMM_SELF


@cache
def solution(name):
    """Return the solution of a problem, which no test changes."""
    return solve(parse_case(PROBLEMS[name].tables()), comm=SELF)


@pytest.mark.core
def test_bar_by_its_friction_coefficient():
    # computed independently, by central differences
    given = ["mesh.cells=[64,16]", "material.law=linear", "friction.mu=0.3"]
    bar = load_case("scripts/cases/bar.toml", [*given, "solver.tolerance=1e-12"])
    names = ["contact_force_x", "contact_force_y", "max_pressure"]
    found = sensitivity(solve(bar, comm=SELF), names, ["friction.mu", "material.young"])
    by_mu = [found[name]["friction.mu"] for name in names]
    assert by_mu == pytest.approx([-6.2189744e-4, 1.4790623e-4, 1.25772757e-2], rel=5e-8)
    # forces under a given load do not depend on the modulus of a linear body
    assert [found[name]["material.young"] for name in names] == pytest.approx([0, 0, 0], abs=1e-11)


@pytest.mark.core("smoothed", "revolved", "3-D")
@pytest.mark.parametrize("name", PROBLEMS)
def test_taylor_series_and_adjoint(name):
    found = series(name, SELF)
    assert found.weak == 0
    assert found.order == pytest.approx(2, abs=0.02)
    assert found.apart < 1e-6
    assert found.adjoint < 1e-10


@pytest.mark.parametrize("kinematic", [0.3, [{"modulus": 0.3, "recovery": 20.0}]])
def test_a_law_without_a_differential_of_its_own(kinematic):
    # Differences of the stress update, whose transpose is made of the same numbers.
    data = plastic()
    data["material"]["kinematic"] = kinematic
    # A reaction depends on the history of the last step by itself.
    case, names = parse_case(data), ["contact_force_x", "max_pressure", "reaction_x_top"]
    law = case.material.in_body(2).law
    plain = SimpleNamespace(
        **{name: getattr(law, name) for name in ("young", "poisson", "bulk", "shear", "symmetric")},
        variables=law.variables,
        respond=law.respond,
    )
    found = []
    for given in (law, plain):

        def build(key, value, given=given):
            return build_problem(with_number(case, key, value), SELF, law=given)

        keys = ["friction.mu", "fixed.0.displacement.1"]
        parameters = {k: Parameter(number_at(case, k), partial(build, k)) for k in keys}
        run = solve(case, comm=SELF, law=given)
        ways = by_both(run, names, parameters)
        found.append(np.array([[[of[n][k] for k in keys] for n in names] for of in ways]))
    for tangent, adjoint in found:
        assert tangent == pytest.approx(adjoint, rel=1e-10)
    assert found[1] == pytest.approx(found[0], rel=1e-6)


@pytest.mark.core
@pytest.mark.parallel(alone=False)
@pytest.mark.parametrize(
    ("name", "result", "keys"),
    [
        ("two bodies", "contact_force_x", ["material.0.young", "friction.mu"]),
        ("ball", "contact_force_x", ["material.young", "friction.mu"]),
        ("slipping", "contact_force_x", ["material.young", "friction.mu.a"]),
        ("plate", "max_displacement", ["rigid.0.centre.0", "mesh.size.1"]),
    ],
)
def test_ranks(name, result, keys):
    names, tables = [result, "max_pressure"], PROBLEMS[name].tables
    runs = [solve(parse_case(tables()), comm=comm) for comm in (MPI.COMM_WORLD, SELF)]
    found = [by_both(run, names, keys) for run in runs]
    run = runs[1]
    alone = found[1][0]
    for one in (*found[0], found[1][1]):
        for name in names:
            for key in keys:
                size = abs(values(run, [name])[0] / number_at(run.source, key))
                close = max(1e-11, 1e-9 * size)
                assert one[name][key] == pytest.approx(alone[name][key], rel=1e-7, abs=close)


@pytest.mark.core
def test_steps_and_their_adjoint():
    run = solution("slipping")
    keys = ["friction.mu.a", "material.young", "fixed.1.displacement.0"]
    found = sensitivity(run, ["contact_force_x"], keys, "tangent")
    adjoint = sensitivity(run, ["contact_force_x"], keys)
    assert adjoint.method == "adjoint"
    for key in keys:
        steps = found.steps["contact_force_x"][key]
        assert steps.shape == (6,)
        assert adjoint["contact_force_x"][key] == pytest.approx(steps[-1], rel=1e-9)
    # each step by itself is the end of a shorter run
    data = slipping()
    data["evolution"] |= {"times": [0.0, 1.0, 2.0], "steps": [2, 2]}
    shorter = sensitivity(solve(parse_case(data), comm=SELF), ["contact_force_x"], keys)
    for key in keys:
        assert shorter["contact_force_x"][key] == pytest.approx(
            found.steps["contact_force_x"][key][3], rel=1e-8
        )


def test_a_problem_in_python_and_a_function():
    case = indented(force=[0.0, -0.01], displacement=[0.0, "free"])
    base = build_problem(case, SELF)
    run = solve(base)

    def at(value):
        return build_problem(with_number(case, "material.young", value), SELF)

    parameter = {"E": Parameter(1.0, at)}
    work = {"compliance": lambda problem, state: -0.01 * float(problem.body.motion(state.x)[1])}
    found = sensitivity(run, work, parameter)
    named = sensitivity(run, ["rigid_y"], parameter, "adjoint")
    assert found.method == "tangent"
    assert found["compliance"]["E"] == pytest.approx(-0.01 * named["rigid_y"]["E"], rel=1e-7)
    with pytest.raises(InputError, match=r"\[value\]"):
        sensitivity(run, work, parameter, "adjoint")
    with pytest.raises(InputError, match=r"\[value\]"):
        sensitivity(run, ["rigid_y"], ["material.young"])
    # The problem at the value of a parameter is that of the solution.
    for value in (1.001, 2.0):
        with pytest.raises(InputError, match=r"E: the problem at .*\[value\]"):
            sensitivity(run, work, {"E": Parameter(value, at)})


@pytest.mark.core
def test_hertz_exponents():
    # P = (4/3) E* R^(1/2) d^(3/2): of a half space, which the block is not, E alone is exact
    case = indented(displacement=[0.0, -0.02])
    run = solve(case, comm=SELF)
    keys = ["material.young"]
    found = sensitivity(run, ["contact_force_y", "max_pressure"], keys)
    for name in found:
        value = named_functionals(run.problem)[name](run.problem, run.state)
        assert found[name]["material.young"] == pytest.approx(value, rel=1e-9)


@pytest.mark.core
@pytest.mark.parametrize("make", [block, slipping, two_bodies, space])
def test_gradient_by_the_gap(make):
    data = make()
    data["contact"].setdefault("gap", 0.0)
    base = build_problem(parse_case(data), SELF)
    times = [1.0] if make != slipping else [1 / 3, 2 / 3, 1.0, 4 / 3, 5 / 3, 2.0, 2.5, 3.0]
    tight = NewtonOptions(tolerance=1e-13)
    name = "max_pressure" if make == two_bodies else "contact_force_y"
    gradient = gap_gradient(solve_steps(base, times, tight), name)
    change = np.cos(3 * base.nodes.points[:, 0])

    def force(way):
        (geometry,) = base.geometries
        nodes = replace(geometry.nodes, gap=geometry.nodes.gap + way * change)
        there = base.with_geometry([replace(geometry, nodes=nodes)])
        run = solve_steps(there, times, tight)
        return named_functionals(there)[name](run.problem, run.state)

    way = 1e-7
    assert gradient @ change == pytest.approx((force(way) - force(-way)) / (2 * way), rel=1e-6)


def pushed(mu, press=-0.01):
    """Return a small block that rests on a plane, and is pressed and pushed on its top."""
    return {
        "mesh": {"generator": "rectangle", "size": [1.0, 1.0], "cells": [4, 4]},
        "material": {"young": 1.0, "poisson": 0.0},
        "fixed": [{"on": "top", "displacement": [0.001, press]}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": mu},
        "solver": {"tolerance": 1e-12},
    }


@pytest.mark.core
def test_nodes_that_touch_without_pressure_are_named(monkeypatch):
    data = pushed(0.3) | {"contact": {"on": "bottom", "gap": 0.01}}
    data["fixed"] = [{"on": "top", "displacement": [0.0, -0.01]}]
    run, said = solve(parse_case(data), comm=SELF), []
    monkeypatch.setattr(logger, "warning", lambda text, *_: said.append(text))
    found = sensitivity(run, ["max_pressure"], ["fixed.0.displacement.1"])
    assert len(found.weakly_active) == 5
    assert found.weakly_active[:, 1] == pytest.approx(np.zeros(5), abs=1e-12)
    assert "between two states" in said[0]


@pytest.mark.core
def test_a_node_at_its_bound_is_named_and_the_derivative_is_one_sided():
    # all stick at mu = 3; with mu the largest ratio of friction to pressure one node is at its
    # bound, and the solution is the same
    multipliers = solve(parse_case(pushed(3.0)), comm=SELF).state.multipliers
    ratio = np.linalg.norm(multipliers.friction, axis=1) / multipliers.contact
    case, name = parse_case(pushed(float(ratio.max()))), "contact_force_x"
    run = solve(case, comm=SELF)
    found = sensitivity(run, [name], ["friction.mu"])
    at = run.problem.nodes.points[np.isclose(ratio, ratio.max(), rtol=1e-9)]
    assert len(at) < 5  # the others are away from it
    order = np.lexsort(at.T)
    assert found.weakly_active == pytest.approx(at[order])
    # above, all stick and nothing changes; below, it slips: the derivative is one of these
    step = 1e-4 * ratio.max()
    here, above, below = (
        values(solve(with_number(case, "friction.mu", ratio.max() + by), comm=SELF), [name])[0]
        for by in (0.0, step, -step)
    )
    sides = (above - here) / step, (here - below) / step
    assert abs(sides[0]) < 1e-8 < 1e-5 < abs(sides[1])
    one = found[name]["friction.mu"]
    assert min(abs(one - side) for side in sides) < 1e-3 * abs(sides[1])


@pytest.mark.parallel(2)
@pytest.mark.parametrize("name", ["plastic", "slipping", "two bodies", "charged"])
def test_gradient_by_a_field_adds_up(name):
    key = "material.0.young" if name == "two bodies" else "material.young"
    names = ["contact_force_y", "max_pressure"]
    names += ["charge_foundation"] if name == "charged" else ["max_displacement"]
    run = solve(parse_case(PROBLEMS[name].tables()), comm=MPI.COMM_WORLD)
    found = sensitivity(run, names, [key])
    for name, degree in zip(names, (0, 1, 0), strict=True):
        gradient = field_gradient(run, name, key, degree)
        owned = gradient.function_space.dofmap.index_map.size_local
        total = MPI.COMM_WORLD.allreduce(float(gradient.x.array[:owned].sum()))
        assert total == pytest.approx(found[name][key], rel=1e-7, abs=1e-10)


def test_gradient_by_a_field_cell_by_cell():
    # three cells are regions of their own, whose moduli can be changed
    plain = rectangle(SELF, (0.0, 0.0), (2.0, 1.0), (8, 4))
    cells = plain.mesh.topology.index_map(2).size_local
    alone = np.array([5, 20, 40], dtype=np.int32)
    rest = np.setdiff1d(np.arange(cells, dtype=np.int32), alone)
    regions = {"rest": rest} | {f"cell {k}": alone[k : k + 1] for k in range(3)}
    domain = from_mesh(plain.mesh, plain.parts, regions=regions)

    def build(*changes):
        moduli = {"rest": 1.0} | {f"cell {k}": 1.0 + change for k, change in enumerate(changes)}
        body = Body(
            [Material(Linear(young, 0.3), on=name) for name, young in moduli.items()],
            [Fixed("top", [0.005, -0.02])],
        )
        contact = Contact("bottom", lambda x: 0.01 * (x[0] - 0.9) ** 2)
        return Problem(domain, body, contact, Friction(mu=0.3))

    def solved(*changes):
        run = solve(build(*changes), NewtonOptions(tolerance=1e-13))
        return run, values(run, ["contact_force_x"])[0]

    step, run = 1e-4, solved(0.0, 0.0, 0.0)[0]
    for k, cell in enumerate(alone):

        def one(value, k=k):
            return build(*np.where(np.arange(3) == k, value - 1, 0.0))

        gradient = field_gradient(run, "contact_force_x", Parameter(1.0, one)).x.array
        up, down = (solved(*np.where(np.arange(3) == k, by, 0.0))[1] for by in (step, -step))
        assert gradient[cell] == pytest.approx((up - down) / (2 * step), rel=1e-6)
        assert np.count_nonzero(gradient) == 1
    # one adjoint gives all cells the same values
    every = Parameter(1.0, lambda value: build(*[value - 1] * 3))
    gradient = field_gradient(run, "contact_force_x", every).x.array
    assert np.array_equal(np.flatnonzero(gradient), alone)


@pytest.mark.parallel
@pytest.mark.parametrize(("law", "degree"), [("linear", 0), ("linear", 1), ("log", 1)])
def test_a_modulus_that_is_a_field_and_its_gradient(law, degree):
    comm, kind = MPI.COMM_WORLD, ("DG" if degree == 0 else "Lagrange", degree)
    domain = rectangle(comm, (0.0, 0.0), (2.0, 1.0), (8, 4))
    space = fem.functionspace(domain.mesh, kind)
    laws = {"linear": Linear(1.0, 0.3), "log": Log(1.0, 0.3, yield_strain=0.01)}
    change = fem.Function(space)
    change.interpolate(lambda x: np.cos(3 * x[0]) * x[1])

    def build(step=0.0, more=0.0):
        """Return a block whose modulus is a field, moved along the change, and by a constant."""
        factor = fem.Function(space)
        factor.interpolate(lambda x: 1 + more + 0.3 * x[0] - 0.2 * x[1])
        factor.x.array[:] += step * change.x.array
        body = Body(Material(laws[law], factor=factor), [Fixed("top", [0.005, -0.02])])
        contact = Contact("bottom", lambda x: 0.01 * (x[0] - 0.9) ** 2)
        return Problem(domain, body, contact, Friction(mu=0.3), degree=1 + degree)

    def force(step):
        run = solve(build(step), NewtonOptions(tolerance=1e-13))
        assert run.converged
        return run, values(run, ["contact_force_x"])[0]

    run, up, down = force(0.0)[0], force(1e-4)[1], force(-1e-4)[1]
    added = Parameter(0.0, lambda more: build(more=more))
    gradient = field_gradient(run, "contact_force_x", added, degree)
    owned = gradient.function_space.dofmap.index_map.size_local
    along = float(gradient.x.array[:owned] @ change.x.array[:owned])
    assert comm.allreduce(along) == pytest.approx((up - down) / 2e-4, rel=1e-6)


def test_gradients_cost_no_more_than_one_parameter(monkeypatch):
    run, taken = solution("3-D"), []
    transposed = SparseOperator.solve_transposed

    def counted(self, rhs, *more):
        taken.append(rhs.size)
        return transposed(self, rhs, *more)

    monkeypatch.setattr(SparseOperator, "solve_transposed", counted)
    counts = []
    for made in (
        lambda: sensitivity(run, ["contact_force_x"], ["friction.mu"], "adjoint"),
        lambda: gap_gradient(run, "contact_force_x"),
        lambda: field_gradient(run, "contact_force_x"),
    ):
        taken.clear()
        made()
        counts.append(len(taken))
    assert counts[0] == counts[1] == counts[2] > 0


def products(solution):
    """Return the relative difference of <J^-1 a, b> and <a, J^-T b>, for random a and b."""
    jacobian = LoadPath(solution).jacobian(-1)
    body, rng = solution.problem.body, np.random.default_rng(0)
    shapes = body.owned_part(solution.state.x).shape, solution.problem.nodes.normal.shape
    mask = np.concatenate([body.free.ravel(), np.ones(body.global_unknowns.size)])
    a, b = ([rng.standard_normal(shape) for shape in shapes] for _ in range(2))
    nodes = solution.problem.nodes
    for pair in (a, b):
        pair[0] *= mask
        normal = nodes.normal_component(pair[1])[:, None] * nodes.normal
        pair[1] = normal + nodes.tangential_component(pair[1])
    x, f = jacobian.solve(Equations(-a[0], -a[1]))
    y, c = jacobian.solve_transposed(*b)
    one = float(np.sum(x * b[0]) + np.sum(f * b[1]))
    other = float(np.sum(a[0] * y) + np.sum(a[1] * c))
    size = np.linalg.norm(x) * np.linalg.norm(b[0]) + np.linalg.norm(f) * np.linalg.norm(b[1])
    return abs(one - other) / size


@pytest.mark.core
@pytest.mark.parametrize("name", ["smoothed", "charged", "ball"])
def test_transposed_solves(name):
    assert products(solution(name)) < 1e-12


@pytest.mark.core
@pytest.mark.parametrize("name", ["smoothed", "charged", "ball"])
def test_transposed_solves_by_multigrid(name):
    """As of large bodies: q was eliminated twice."""
    with patch.object(multigrid, "LARGE", dict.fromkeys(multigrid.LARGE, 0)):
        assert products(solution(name)) < 1e-9


def test_an_unsymmetric_stiffness_beside_a_free_foundation_is_refused():
    data = PROBLEMS["ball"].tables()
    kinematic = [{"modulus": 0.3, "recovery": 5.0}]
    data["material"] = {"law": "j2", "young": 1.0, "poisson": 0.3, "yield_stress": 1.0}
    data["material"]["kinematic"] = kinematic
    with pytest.raises(InputError, match=r"\[no-derivative\]"):
        sensitivity(solve(parse_case(data), comm=SELF), ["rigid_y"], ["friction.mu"])


@pytest.mark.parametrize(
    ("quantity", "parameter", "message"),
    [
        ("pressure", "friction.mu", r"\[value\]"),
        ("max_pressure", "friction.nu", r"friction.nu.*\[no-number\]"),
        ("max_pressure", "friction.law", r"friction.law.*\[no-number\]"),
        ("max_pressure", "mesh.cells.0", r"mesh.cells.0.*\[value\]"),
        ("max_pressure", "solver.tolerance", r"\[value\]"),
    ],
)
def test_refused(quantity, parameter, message):
    run = solution("3-D")
    with pytest.raises(InputError, match=message):
        sensitivity(run, [quantity], [parameter])


def test_a_friction_coefficient_of_0_is_refused():
    data = parse_case(block(friction={"law": "coulomb", "mu": 0.0}))
    with pytest.raises(InputError, match=r"\[value\]"):
        sensitivity(solve(data, comm=SELF), ["max_pressure"], ["friction.mu"])


def test_an_end_that_has_not_converged_is_refused():
    law = {"law": "log", "young": 1.0, "poisson": 0.3, "yield_strain": 0.01}
    run = solve(parse_case(block(material=law, solver={"max_outer": 1})), comm=SELF)
    assert not run.converged
    with pytest.raises(InputError, match=r"\[no-derivative\]"):
        sensitivity(run, ["max_pressure"], ["friction.mu"])
