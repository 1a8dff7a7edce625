"""The stress update of flow theory at single points."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from forms.history import HistoryLaw, Response, differential, isotropic_stiffness
from forms.j2 import J2, Tabulated, Voce

ROOT = np.sqrt(2 / 3)
GIVEN = {
    "none": {},
    "H": {"hardening": 0.05},
    "K": {"kinematic": 0.05},
    "voce": {"hardening": Voce(saturation=0.004, rate=60.0)},
    "table": {"hardening": Tabulated((0.0, 0.01, 0.02, 0.05), (0.004, 0.006, 0.0065, 0.009))},
    "chaboche": {
        "hardening": Voce(saturation=0.002, rate=50.0),
        "kinematic": [(0.5, 200.0), (0.1, 30.0), (0.02, 0.0)],
    },
}
LAWS = {name: J2(1.0, 0.3, yield_stress=0.004, **given) for name, given in GIVEN.items()}


def rest(law, count, size):
    values = law.variables(size).items()
    return {k: np.tile(np.asarray(v, float), (count, *[1] * np.ndim(v))) for k, v in values}


def deviator(tensors):
    found = tensors.copy()
    found[:, :3] -= tensors[:, :3].mean(axis=1)[:, None]
    return found


def steps(law, size, count=200, number=5):
    """Give strains, variables before and the response of a random path at many points."""
    random, variables = np.random.default_rng(3), rest(law, count, size)
    strain = np.zeros((count, size))
    for _ in range(number):
        strain = strain + 0.01 * random.standard_normal((count, size))
        response = law.respond(strain, variables, "tangent")
        yield strain, variables, response
        variables = response.variables


@pytest.mark.core
@pytest.mark.parametrize("size", [4, 6])
@pytest.mark.parametrize("name", list(LAWS))
def test_a_step_meets_all_equations_of_the_law(name, size):
    law = LAWS[name]
    for strain, before, response in steps(law, size):
        after = response.variables
        flow = after["plastic_strain"] - before["plastic_strain"]
        da = after["equivalent_plastic_strain"] - before["equivalent_plastic_strain"]
        assert np.abs(flow[:, :3].sum(axis=1)).max() < 1e-15
        assert np.linalg.norm(flow, axis=1) * ROOT == pytest.approx(da, abs=1e-15)
        elastic = isotropic_stiffness(law.bulk, law.shear, size)
        assert response.stress == pytest.approx((strain - after["plastic_strain"]) @ elastic)
        names = [key for key in after if key.startswith("back")]
        xi = deviator(response.stress) - sum(after[key] for key in names)
        limit = ROOT * law.strength(after["equivalent_plastic_strain"])
        left = np.linalg.norm(xi, axis=1) - limit
        assert left.max() < 1e-14 and np.abs(left[da > 0]).max() < 1e-14
        along = np.linalg.norm(xi, axis=1) * np.linalg.norm(flow, axis=1)
        assert np.einsum("ni,ni->n", xi, flow) == pytest.approx(along, rel=1e-12)
        for key, (c, recovery) in zip(names, law.kinematic, strict=True):
            change = 2 / 3 * c * flow - recovery * da[:, None] * after[key]
            assert after[key] - before[key] == pytest.approx(change, abs=1e-15)
        assert (da > 0).mean() > 0.5
        assert response.dissipation.min() >= 0


@pytest.mark.core
@pytest.mark.parametrize("size", [4, 6])
@pytest.mark.parametrize("name", list(LAWS))
def test_the_tangent_is_the_derivative_of_the_step(name, size):
    law, h = LAWS[name], 1e-7
    for strain, before, response in steps(law, size):
        for k in range(size):
            step = h * np.eye(size)[k]
            ends = [law.respond(strain + s * step, before).stress for s in (1, -1)]
            error = np.abs(response.stiffness[:, :, k] - (ends[0] - ends[1]) / (2 * h))
            # But for a point or two that have just begun to yield, or meet a corner of the table.
            assert np.sort(error.max(axis=1))[-3] < 1e-8
    asymmetric = np.abs(response.stiffness - response.stiffness.transpose(0, 2, 1)).max()
    assert (asymmetric < 1e-14) == law.symmetric == (name != "chaboche")


@pytest.mark.core
@pytest.mark.parametrize("size", [4, 6])
@pytest.mark.parametrize("name", list(LAWS))
def test_the_differential_is_the_derivative_of_the_step(name, size):
    law, random, h = LAWS[name], np.random.default_rng(1), 1e-7
    for strain, before, response in steps(law, size):
        moved = random.standard_normal(strain.shape)
        changed = {k: random.standard_normal(v.shape) for k, v in before.items()}
        found = law.differential(strain, before, moved, changed)
        ends = [
            law.respond(strain + s * moved, {k: v + s * changed[k] for k, v in before.items()})
            for s in (h, -h)
        ]
        parts = {k: (v, *(end.variables[k] for end in ends)) for k, v in found.variables.items()}
        parts["stress"] = found.stress, ends[0].stress, ends[1].stress
        for one, up, down in parts.values():
            error = np.abs(one - (up - down) / (2 * h)).reshape(len(strain), -1).max(axis=1)
            # But for a few points that have just begun to yield, or meet a corner of the table.
            assert np.sort(error)[-4] < 2e-7
        # By the strain alone it is the tangent.
        still = {k: np.zeros_like(v) for k, v in before.items()}
        along = law.differential(strain, before, moved, still).stress
        tangent = np.einsum("nij,nj->ni", response.stiffness, moved)
        assert along == pytest.approx(tangent, abs=1e-13)


@pytest.mark.parametrize("name", ["H", "chaboche"])
def test_the_differential_of_a_law_that_has_none_is_that_of_differences(name):
    law = LAWS[name]
    plain = SimpleNamespace(respond=law.respond)
    random = np.random.default_rng(2)
    for strain, before, _ in steps(law, 4):
        moved = random.standard_normal(strain.shape)
        changed = {k: random.standard_normal(v.shape) for k, v in before.items()}
        exact, found = (differential(one, strain, before, moved, changed) for one in (law, plain))
        errors = [np.abs(found.stress - exact.stress).max(axis=1)]
        assert np.sort(errors[0])[-4] < 1e-5
        for key, value in exact.variables.items():
            error = np.abs(found.variables[key] - value).reshape(len(strain), -1).max(axis=1)
            assert np.sort(error)[-4] < 1e-5


@pytest.mark.core
def test_the_secant_is_hencky_s_about_a_moved_origin():
    law = J2(1.0, 0.3, yield_stress=0.004, hardening=0.03, kinematic=0.02)
    for strain, before, _ in steps(law, 6):
        found = law.respond(strain, before, "secant")
        back = before["back_stress_1"]
        origin = before["plastic_strain"] + back / (2 * law.shear)
        e = deviator(strain) - origin
        r = ROOT * law.strength(before["equivalent_plastic_strain"])
        t = 2 * law.shear * np.linalg.norm(e, axis=1)
        h = 2 / 3 * 0.05
        over = np.maximum(t - r, 0.0) / t
        g = law.shear * (1 - over * 2 * law.shear / (2 * law.shear + h))
        assert found.stiffness == pytest.approx(isotropic_stiffness(law.bulk, g, 6), abs=1e-14)
        s = back + 2 * g[:, None] * e
        assert deviator(found.stress) == pytest.approx(s, abs=1e-15)


def test_stored_energy_and_dissipation_make_the_work_of_many_small_steps():
    law = J2(1.0, 0.3, yield_stress=0.004, hardening=0.03, kinematic=0.02)
    turns = np.array([[0.0] * 4, [0.02, -0.01, 0, 0.01], [-0.02, 0, 0, 0.02], [0.01, 0.01, 0, 0]])
    number, work, lost = 1000, 0.0, 0.0
    ways = [np.linspace(a, b, number + 1)[1:] for a, b in pairwise(turns)]
    variables, stress, last = rest(law, 1, 4), np.zeros(4), np.zeros(4)
    for strain in np.concatenate(ways):
        found = law.respond(strain[None], variables)
        work += float((stress + found.stress[0]) / 2 @ (strain - last))
        lost += float(found.dissipation[0])
        variables, stress, last = found.variables, found.stress[0], strain
    elastic = last - variables["plastic_strain"][0]
    a, back = variables["equivalent_plastic_strain"][0], variables["back_stress_1"][0]
    stored = stress @ elastic / 2 + 0.03 * a**2 / 2 + back @ back / (4 / 3 * 0.02)
    assert work - stored == pytest.approx(lost, rel=1e-4)


def test_numbers_that_are_none_of_a_material_are_refused():
    for given in (
        {"yield_stress": 0.0},
        {"yield_stress": np.nan},
        {"yield_stress": 1.0, "hardening": -1.0},
        {"yield_stress": 1.0, "kinematic": [(1.0, -1.0)]},
    ):
        with pytest.raises(ValueError, match="accepted"):
            J2(1.0, 0.3, **given)
    for points in (((0.1, 0.2), (1.0, 2.0)), ((0.0, 0.2), (2.0, 1.0)), ((0.0,), (1.0,))):
        with pytest.raises(ValueError, match="accepted"):
            Tabulated(*points)


@pytest.mark.core
def test_laws_follow_the_protocol():
    assert all(isinstance(law, HistoryLaw) for law in LAWS.values())
    nothing = LAWS["chaboche"].respond(np.zeros((0, 4)), rest(LAWS["chaboche"], 0, 4), "tangent")
    assert isinstance(nothing, Response) and nothing.stiffness.shape == (0, 4, 4)
