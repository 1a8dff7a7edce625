"""A material with history, as a user adds one: scalar damage, a law object and no more.

The secant modulus is E (1 - d(kappa)), and kappa the largest strain so far. A block that is pressed
onto a frictionless foundation is in a homogeneous state, known in closed form.
"""

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import InputError, evolve, parse_case, solve, solve_steps
from contact.case.build import build_problem
from contact.history import QUADRATURE_POINTS
from contact.io.checkpoint import Checkpoints, read_steps
from contact.results.fields import DerivedFields
from forms.hencky import Isotropic
from forms.history import Response, isotropic_stiffness
from scripts.examples.own_return_mapping import DruckerPrager
from tests.problems.mechanics import close, same_history

YOUNG, POISSON, LIMIT, MOST, HEIGHT, WIDTH = 10.0, 0.3, 2e-3, 0.5, 1.0, 2.0
TIMES, PRESSED = [0.0, 1.0, 2.0, 3.0], [0.0, 4e-3, 1e-3, 6e-3]


def damage(kappa):
    return MOST * kappa / (kappa + LIMIT)


@dataclass(frozen=True)
class Damage(Isotropic):
    """Stress (1 - d(kappa)) C eps."""

    def variables(self, size) -> Mapping[str, float]:
        return {"kappa": 0.0}

    def respond(self, strain, variables, kind=""):
        kappa = np.maximum(variables["kappa"], np.linalg.norm(strain, axis=1))
        return self.damaged(strain, damage(kappa), {"kappa": kappa}, kind)

    def damaged(self, strain, part, variables, kind):
        elastic = isotropic_stiffness(self.bulk, self.shear, strain.shape[1])
        secant = (1 - part)[:, None, None] * elastic
        stress = np.einsum("nij,nj->ni", secant, strain)
        return Response(stress, variables, secant if kind == "secant" else None)


def case(cells=4, degree=1, stages=3, **more):
    return parse_case(
        {
            "mesh": {
                "generator": "rectangle",
                "size": [WIDTH, HEIGHT],
                "cells": [2 * cells, cells],
            },
            "space": {"degree": degree},
            "material": {"law": "linear", "young": YOUNG, "poisson": POISSON},
            "fixed": [
                {"on": "top", "displacement": ["free", -1.0], "amplitude": "press"},
                {"on": "left", "displacement": [0.0, "free"]},
            ],
            "contact": {"on": "bottom"},
            "evolution": {
                "times": TIMES[: stages + 1],
                "steps": [2] * stages,
                "amplitudes": {"press": {"time": TIMES, "value": PRESSED}},
            },
            **more,
        }
    )


def expected(times):
    """Return the force on the foundation and kappa at the ends of steps."""
    kappa, found = 0.0, []
    for time in times:
        pressed = float(np.interp(time, TIMES, PRESSED)) / HEIGHT
        across = POISSON / (1 - POISSON) * pressed
        kappa = max(kappa, float(np.hypot(pressed, across)))
        modulus = (1 - damage(kappa)) * YOUNG / (1 - POISSON**2)
        found.append((modulus * pressed * WIDTH, kappa))
    return found


def kappa_after(solution):
    """Return the variable at the end of the last step of a solution."""
    return solution.problem.commit(solution.state).arrays()["material.kappa"]


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
def test_unloading_goes_back_along_the_secant(degree):
    solution = solve(case(degree=degree), law=Damage(YOUNG, POISSON))
    assert solution.converged
    known = expected([step.state.time for step in solution.steps])
    for step, (force, _) in zip(solution.steps, known, strict=True):
        assert step.row["contact_force_y"] == pytest.approx(-force, rel=1e-6)
    assert kappa_after(solution) == pytest.approx(known[-1][1], rel=1e-6)
    places = solution.problem.points(QUADRATURE_POINTS)
    assert len(places) == kappa_after(solution).size
    fields = DerivedFields(solution.problem.body, solution.state).cells()
    assert fields["kappa"].x.array == pytest.approx(known[-1][1], rel=1e-6)
    stress = fields["stress"].x.array.reshape(-1, 9)[:, 4]
    assert stress == pytest.approx(-known[-1][0] / WIDTH, rel=1e-6)
    assert not any("Hencky" in warning for warning in solution.warnings)


@pytest.mark.parallel
def test_a_restart_goes_on_with_the_same_history(tmp_path):
    comm, law = MPI.COMM_WORLD, Damage(YOUNG, POISSON)
    tmp_path = comm.bcast(tmp_path)
    # A gradient: the damage differs from cell to cell.
    given = case(
        load=[{"on": "right", "traction": [0.01, 0.0]}], friction={"mu": 0.2, "law": "coulomb"}
    )
    problem = build_problem(given, comm, law=law)
    keep = Checkpoints(tmp_path, problem, given).keep
    whole = solve_steps(problem, given.evolution.ends, given.solver, keep=keep)
    assert np.ptp(comm.allreduce(kappa_after(whole).tolist(), op=MPI.SUM)) > 1e-4
    steps = read_steps(str(tmp_path), build_problem(given, comm, law=law))
    for one, two in zip(whole.steps, steps, strict=True):
        assert close(one.state, two.state, rtol=1e-12, atol=1e-15)
        assert two.state.history.keys() == {"slip", "material"}
    on_one = build_problem(given, MPI.COMM_SELF, law=law)
    alone = read_steps(tmp_path, on_one)[2].state
    *_, last = evolve(on_one, [step.state.time for step in steps[3:]], start=alone)
    total = on_one.commit(last).arrays()["material.kappa"].sum()
    here = comm.allreduce(kappa_after(whole).sum(), op=MPI.SUM)
    assert total == pytest.approx(here, rel=1e-6)


def test_a_state_without_its_history_is_of_another_step():
    problem = build_problem(case(), MPI.COMM_SELF, law=Damage(YOUNG, POISSON))
    first, second = evolve(problem, [1.0, 2.0])
    body = problem.body
    virgin = replace(second, history=problem.initial)
    forces = [np.abs(body.internal_forces(state)).max() for state in (second, virgin)]
    ratio = 1 - damage(expected([1.0])[0][1])
    undamaged = 1 - damage(expected([2.0])[0][1])
    assert forces[0] / forces[1] == pytest.approx(ratio / undamaged, rel=1e-6)
    assert not close(second, virgin)
    assert same_history(problem.commit(first), second.history, rtol=1e-14)


@pytest.mark.core
@pytest.mark.parametrize("size", [4, 6])
def test_drucker_and_prager_s_cone_of_the_example(size):
    """The oedometer in closed form, the apex, and no more than the cone at random strains."""
    law = DruckerPrager(10.0, 0.3, cohesion=0.01)
    k, g, a, c = law.bulk, law.shear, law.friction, law.cohesion
    none = {"plastic_strain": np.zeros((2, size))}
    pressed = -2 * c / g
    strain = np.zeros((2, size))
    strain[0, 1], strain[1, :3] = pressed, 2 * c / k
    found = law.respond(strain, none)
    flow = ((2 * g * np.sqrt(2 / 3) - a * k) * -pressed - c) / (2 * g + k * a**2)
    along = -np.sqrt(2 / 3) * (-2 * g * np.sqrt(2 / 3) * pressed - 2 * g * flow)
    assert flow > 0
    assert found.stress[0, 1] == pytest.approx(along + k * pressed - k * a * flow, rel=1e-12)
    assert found.stress[1] == pytest.approx(c / a * np.eye(3, size).sum(axis=0), rel=1e-12)
    none = {"plastic_strain": np.zeros((200, size))}
    found = law.respond(3 * c / g * np.random.default_rng(0).standard_normal((200, size)), none)
    mean = found.stress[:, :3].mean(axis=1)
    s = found.stress.copy()
    s[:, :3] -= mean[:, None]
    assert (np.linalg.norm(s, axis=1) + a * mean - c).max() < 1e-12 * c
    assert found.dissipation.min() > -1e-12 * found.dissipation.max()


@dataclass(frozen=True)
class Other(Damage):
    """Damage with a variable of another name, and another answer on the last rank, or on all."""

    name: object = "kappa"
    first: object = 0.0
    changed: Callable[[Response], object] = lambda found: found
    everywhere: bool = True

    @property
    def acts(self):
        return self.everywhere or MPI.COMM_WORLD.rank == MPI.COMM_WORLD.size - 1

    def variables(self, size):
        return {self.name if self.acts else "kappa": self.first}

    def respond(self, strain, variables, kind=""):
        before = variables[self.name]
        found = super().respond(strain, {"kappa": before.reshape(len(strain), -1)[:, 0]}, kind)
        after = (found.variables["kappa"] + 0 * before.T).T
        found = replace(found, variables={self.name: after})
        return self.changed(found) if self.acts else found


CHANGED = {
    "a tuple": (lambda r: (r.stress, r.variables), r": the function returns \(.*a Response"),
    "None": (lambda _: None, ": the function returns None; accepted: a Response"),
    "a list": (lambda r: replace(r, stress=r.stress.tolist()), r": stress: .*returns \[\[.*array"),
    "a row": (lambda r: replace(r, stress=r.stress[0]), r": stress: .*shape \(4,\).*\(17, 4\)"),
    "complex": (lambda r: replace(r, stress=r.stress + 0j), ": stress: .*complex128.*real numbers"),
    "NaN": (lambda r: replace(r, stress=np.nan * r.stress), r": stress: not finite at .*\[0\.0,"),
    "energy": (lambda r: replace(r, energy=np.zeros(3)), r": energy: .*\(3,\).*\(17,\)"),
    "another": (
        lambda r: replace(r, variables={**r.variables, "x": r.stress}),
        r": variables: .*\['kappa', 'x'\]; accepted: .*\['kappa'\]",
    ),
    "no variables": (lambda r: replace(r, variables=None), ": variables: .*None; accepted: a map"),
    "error": (lambda r: 1 / 0, ": the function raises ZeroDivisionError: division by zero"),
}


@pytest.mark.parallel(2)
@pytest.mark.parametrize("everywhere", [True, False])
@pytest.mark.parametrize("kind", CHANGED)
def test_a_wrong_response_is_refused_by_all_ranks_before_the_solve(kind, everywhere):
    changed, words = CHANGED[kind]
    law = Other(YOUNG, POISSON, changed=changed, everywhere=everywhere)
    with pytest.raises(InputError, match=f"^case: Other: respond{words}"):
        build_problem(case(cells=2), MPI.COMM_WORLD, law=law)


@pytest.mark.parallel(2)
@pytest.mark.parametrize("other", [{"name": "x"}, {"first": np.zeros(2)}])
def test_variables_are_the_same_on_all_ranks(other):
    comm = MPI.COMM_WORLD
    law = Other(YOUNG, POISSON, **other, everywhere=False)
    if comm.rank < comm.size - 1:
        law = Damage(YOUNG, POISSON)
    words = ": variables: given .*: the same names and shapes on all ranks"
    apart = pytest.raises(InputError, match=words) if comm.size > 1 else nullcontext()
    with apart:
        build_problem(case(cells=2), comm, law=law)


@dataclass(frozen=True)
class Careless(Damage):
    """A law that writes into the variables it is given."""

    def respond(self, strain, variables, kind=""):
        variables["kappa"][:] = 1.0
        return super().respond(strain, variables, kind)


def test_a_law_cannot_change_the_history():
    """Trials of a step would be in it, where one law has all cells."""
    with pytest.raises(InputError, match=r"\[own-function\]"):
        solve(case(cells=2, stages=1), law=Careless(YOUNG, POISSON), comm=MPI.COMM_SELF)


class Softening(Damage):
    """Stress (1 - d) C eps that falls to nothing."""

    def respond(self, strain, variables, kind=""):
        elastic = isotropic_stiffness(self.bulk, self.shear, strain.shape[1])
        force = np.einsum("ni,ij,nj->n", strain, elastic, strain)
        kappa = np.maximum(variables["kappa"], 1 - np.exp(-force / 2e-4))
        return self.damaged(strain, kappa, {"kappa": kappa}, kind)


@pytest.mark.parametrize(
    ("across", "traction", "steps", "cells"), [(0.0, 0.05, 1, 8), ("free", 0.02, 2, 16)]
)
def test_a_material_that_softens_too_far_ends_the_steps(across, traction, steps, cells):
    """Without an error: what has been solved is kept, and no support is missed."""
    given = parse_case(
        {
            "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [cells, cells // 2]},
            "material": {"young": 10.0, "poisson": 0.3},
            "fixed": [
                {"on": "top", "displacement": [across, "-0.005*t"]},
                {"on": "left", "displacement": [0.0, "free"]},
            ],
            "load": [{"on": "right", "traction": [f"{traction}*t", 0.0]}],
            "contact": {"on": "bottom"},
            "evolution": {"times": [0.0, 1.0], "steps": [steps]},
        }
    )
    solution = solve(given, law=Softening(YOUNG, POISSON), comm=MPI.COMM_SELF)
    assert not solution.converged and len(solution.steps) >= 1
    assert "the stiffness is singular at that displacement" in solution.outcome.reason


@pytest.mark.parallel(2)
def test_the_error_of_a_law_on_one_rank_ends_the_others():
    """They waited for it for ever."""
    law = Other(
        YOUNG,
        POISSON,
        changed=lambda r: r if np.abs(r.stress).max() < 1e-3 else 1 / 0,
        everywhere=False,
    )
    problem = build_problem(case(cells=2, stages=1), MPI.COMM_WORLD, law=law)
    with pytest.raises(InputError, match=r"^Other: respond: the function raises ZeroDivisionError"):
        next(evolve(problem, [1.0]))


class Aging(Damage):
    """Stress q C eps whose q falls to 0.9 q in each step, also at a constant strain."""

    def variables(self, size):
        return {"q": 1.0}

    def respond(self, strain, variables, kind=""):
        q = 0.9 * variables["q"]
        found = self.damaged(strain, 1 - q, {"q": q}, kind)
        energy = 0.5 * np.einsum("ni,ni->n", found.stress, strain)
        return replace(found, energy=energy, dissipation=energy / 9)


def test_the_energy_of_a_law_that_ages_at_constant_strain():
    """It had been that of the first step, as if the law aged at the old strain too."""
    tables = {
        "mesh": {"generator": "rectangle", "size": [1.0, 1.0], "cells": [2, 2]},
        "material": {"young": 10.0, "poisson": 0.0},
        "fixed": [
            {"on": "top", "displacement": ["free", -0.01]},
            {"on": "left", "symmetry": "x"},
        ],
        "contact": {"on": "bottom"},
        "evolution": {"times": [0.0, 1.0, 2.0], "steps": [1, 3]},
    }
    found = solve(parse_case(tables), law=Aging(10.0, 0.0), comm=MPI.COMM_SELF)
    assert found.converged
    energies = [step.row["energy"] for step in found.steps]
    assert energies == pytest.approx([5e-4 * 0.9**k for k in (1, 2, 3, 4)], rel=1e-8)
