"""Flow theory in homogeneous states: every number of the specification, with the same steps."""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from scipy.integrate import quad
from scipy.optimize import brentq

from contact import NewtonOptions, solve, solve_steps
from contact.results.fields import DerivedFields
from forms.j2 import J2, Tabulated, Voce
from scripts.studies.hollow_sphere import (
    Hill,
    at_the_equator,
    cycled,
    limit_pressure,
    most_strained,
    pressed,
    sphere,
)
from scripts.studies.plasticity import (
    STEEL,
    hencky,
    hertz_first_yield,
    jackson_green,
    kogut_etsion,
)
from tests.problems.plasticity import homogeneous, homogeneous_values, integrated, path

YOUNG, YIELD = 1.0, 0.004
#: Hardening -> the keys of the case; then the function and the terms for the integration.
VOCE = {"saturation": 0.004, "rate": 60.0}
POINTS = [[0.0, 0.004], [0.004, 0.005], [0.01, 0.0055], [0.1, 0.01]]
LAWS = {
    "none": ({}, Voce(), []),
    "H": ({"hardening": 0.05}, Voce(0.05), []),
    "K": ({"kinematic": 0.05}, Voce(), [(0.05, 0.0)]),
    "voce": ({"hardening": VOCE}, Voce(0.0, 0.004, 60.0), []),
    "table": ({"hardening": POINTS}, Tabulated(*map(tuple, zip(*POINTS, strict=True))), []),
    "chaboche": (
        {
            "hardening": VOCE,
            "kinematic": [{"modulus": 0.5, "recovery": 200.0}, {"modulus": 0.05}],
        },
        Voce(0.0, 0.004, 60.0),
        [(0.5, 200.0), (0.05, 0.0)],
    ),
}
#: At -.02: stress along, out of plane, a; at -.014 both stresses; at +.004 both, a. The strain
#: across at -.02; and the first two with 400 steps to it.
EXPECTED = {
    "none": (-0.00461878, -0.00229633, 0.018080521, 0.00197463, -0.00031831,
             0.00461869, 0.00228163, 0.035869274),
    "H": (-0.00560090, -0.00272418, 0.017022397, 0.00099251, -0.00074616,
          0.00645133, 0.00302151, 0.031814819),
    "K": (-0.00559853, -0.00269161, 0.017030837, 0.00099488, -0.00071359,
          0.00459519, 0.00218571, 0.033803274),
    "voce": (-0.00736973, -0.00346046, 0.015129630, -0.00077633, -0.00148244,
             0.00824324, 0.00346328, 0.026193295),
}  # fmt: skip
ACROSS = {"none": 0.017233958, "H": 0.016669968, "K": 0.016683946, "voce": 0.015667921}
FINE = -0.00560102, -0.00272757
ENDS = (-0.02, -0.014, 0.004)


def material(law, young=YOUNG, limit=YIELD):
    return {"young": young, "yield_stress": limit, **LAWS[law][0]}


def run(kind, given, values, **more):
    case = homogeneous(kind, given, [float(i + 1) for i in range(len(values))], values, **more)
    solution = solve(case)
    assert solution.converged and len(solution.steps) == len(values)
    return solution


def found(solution, step=-1):
    """Return stress and equivalent plastic strain of a step, which are the same in all cells."""
    stress, a, spread = homogeneous_values(solution, step)
    assert spread < 1e-7
    return stress, a


@pytest.mark.parametrize(
    "law", [pytest.param(law, marks=pytest.mark.slow if law in "HK" else ()) for law in EXPECTED]
)
def test_plane_strain_between_plates(law):
    solution = run("plane", material(law), path(*ENDS, steps=50))
    known = np.split(np.array(EXPECTED[law]), [3, 5])
    for step, expected in zip((49, 99, 149), known, strict=True):
        stress, a = found(solution, step)
        assert stress[1, 1] == pytest.approx(expected[0], abs=1e-8)
        assert stress[2, 2] == pytest.approx(expected[1], abs=1e-8)
        assert a == pytest.approx(expected[-1], abs=2e-9) or len(expected) == 2
        assert abs(stress[0, 0]) < 1e-9
    body, state = solution.problem.body, solution.steps[49].state
    assert body.nodal(state.x)[:, 0].max() == pytest.approx(ACROSS[law], abs=1e-9)
    # Work is stored, or lost to plastic flow; the trapezoidal rule meets the corners of a curve.
    rows = [step.row for step in solution.steps]
    work, lost = (sum(row[name] for row in rows) for name in ("work", "plastic_dissipation"))
    assert all(row["plastic_dissipation"] >= 0 and row["dissipation"] == 0 for row in rows)
    assert work - rows[-1]["energy"] == pytest.approx(lost, rel=2e-3)
    assert lost == pytest.approx(YIELD * known[2][-1], rel=1e-6)


def uniaxial_energy(steps, end, hardening, terms):
    """Return the stored energy of a uniaxial pull by backward Euler steps, and the lost one."""
    a, back, lost = 0.0, np.zeros(len(terms)), 0.0
    moduli, recoveries = (np.array([term[k] for term in terms]) for k in (0, 1))

    def at(da):
        after = (back + moduli * da) / (1 + recoveries * da)
        return after, YIELD + hardening(a + da) + after.sum()

    for strain in np.linspace(0.0, end, steps + 1)[1:]:

        def misfit(da, flown=a, strain=strain):
            return at(da)[1] / YOUNG + flown + da - strain

        da = brentq(misfit, 0.0, end, xtol=1e-16) if misfit(0.0) < 0 else 0.0
        back, _ = at(da)
        a += da
        lost += da * (YIELD + (recoveries / moduli * back**2).sum())
    stress = YIELD + hardening(a) + back.sum()
    isotropic = quad(hardening, 0.0, a, epsabs=1e-15)[0]
    return stress**2 / (2 * YOUNG) + isotropic + (back**2 / (2 * moduli)).sum(), lost


@pytest.mark.core
@pytest.mark.parametrize("law", ["table", "voce", "K", "chaboche"])
@pytest.mark.parametrize("steps", [1, 4])
@pytest.mark.parametrize(("kind", "volume"), [("uniaxial", 1.0), ("revolved", np.pi)])
def test_stored_energy_is_that_of_the_state(kind, volume, law, steps):
    """However long the steps are: elastic, of isotropic hardening, and of the back stresses."""
    _, hardening, terms = LAWS[law]
    solution = run(kind, material(law), path(0.02, steps=steps), cells=1)
    rows = [step.row for step in solution.steps]
    stored, lost = (volume * part for part in uniaxial_energy(steps, 0.02, hardening, terms))
    assert rows[-1]["energy"] == pytest.approx(stored, rel=1e-8)
    assert sum(row["plastic_dissipation"] for row in rows) == pytest.approx(lost, rel=1e-8)


def test_the_balance_sees_a_wrong_dissipation(monkeypatch):
    def left():
        solution = run("uniaxial", material("chaboche"), path(0.02, steps=20), cells=1)
        rows = [step.row for step in solution.steps]
        work, lost = (sum(row[name] for row in rows) for name in ("work", "plastic_dissipation"))
        return abs(work - rows[-1]["energy"] - lost) / work

    assert left() < 0.02
    respond = J2.respond

    def wrong(law, *given):
        found = respond(law, *given)
        return replace(found, dissipation=2 * found.dissipation)

    monkeypatch.setattr(J2, "respond", wrong)
    assert left() > 0.1


@pytest.mark.slow
def test_plane_strain_in_eight_times_as_many_steps():
    stress, _ = found(run("plane", material("H"), path(-0.02, steps=400), cells=1))
    assert (stress[1, 1], stress[2, 2]) == pytest.approx(FINE, abs=1e-8)


@pytest.mark.core
@pytest.mark.parametrize(
    ("kind", "degree", "law"),
    [
        # The law that has all of the terms; in uniaxial stress its energy is tested above.
        pytest.param(
            kind,
            degree,
            law,
            marks=() if law == "chaboche" and kind != "uniaxial" else pytest.mark.slow,
        )
        for kind, degree in (("plane", 2), ("space", 1), ("uniaxial", 2), ("revolved", 1))
        for law in LAWS
        # Uniaxial stress without hardening is a limit load: strains are not unique.
        if law != "none" or kind in ("plane", "space")
    ],
)
def test_against_an_integration_of_its_own(kind, degree, law):
    values = path(*ENDS, steps=4)
    # The first direction is the driven one, the last one is constrained in plane strain.
    free = [1] if kind in ("plane", "space") else [1, 2]
    known = integrated(YOUNG, 0.3, YIELD, *LAWS[law][1:], free, values)
    solution = run(kind, material(law), values, degree=degree)
    up = 2 if kind in ("space", "uniaxial") else 1
    for step, expected in enumerate(known):
        stress, a = found(solution, step)
        assert stress[up, up] == pytest.approx(expected[0], abs=1e-10)
        assert a == pytest.approx(expected[3], abs=1e-10)
        constrained = {"plane": (2, 2), "space": (1, 1)}.get(kind)
        assert constrained is None or stress[constrained] == pytest.approx(expected[2], abs=1e-10)


@pytest.mark.core
@pytest.mark.parametrize("kind", ["oedometer", "oedometer-space", "oedometer-revolved"])
def test_oedometer(kind):
    """Exact in one step, and on the way back to where it yields again."""
    solution = run(kind, material("none"), [-0.02, -0.01])
    up = 2 if kind == "oedometer-space" else 1
    for step, (across, along) in enumerate([(-0.01533333, -0.01933333), (-0.0095641, -0.00587179)]):
        stress, a = found(solution, step)
        assert stress[up, up] == pytest.approx(along, abs=1e-8)
        assert np.diag(stress)[np.arange(3) != up] == pytest.approx(across, abs=1e-8)
        assert step == 1 or a == pytest.approx(0.00986667, abs=1e-8)


@pytest.mark.core
@pytest.mark.parametrize(
    ("keys", "known"),
    [
        ({"hardening": 20e3}, (318.181818, -442.148760, 543.576258)),
        ({"kinematic": 20e3}, (318.181818, -318.181818, 318.181818)),
        ({"hardening": 10e3, "kinematic": 10e3}, (318.181818, -380.165289, 436.513899)),
    ],
)
@pytest.mark.parametrize("kind", ["uniaxial", "revolved"])
def test_uniaxial_cycle(kind, keys, known):
    given = {"young": 200e3, "yield_stress": 250.0, **keys}
    solution = run(kind, given, [0.005, -0.005, 0.005])
    up = 2 if kind == "uniaxial" else 1
    for step, expected in enumerate(known):
        assert found(solution, step)[0][up, up] == pytest.approx(expected, abs=1e-6)


@pytest.mark.core
def test_hill_s_closed_form_of_the_hollow_sphere():
    """Numbers that were computed by themselves: under pressure and unloaded."""
    found = Hill(1.0, 0.004)
    assert found.front(0.0045) == pytest.approx(1.4151862, rel=1e-7)
    assert found.row(0.0045, False)[:2] == pytest.approx([0.0061359479, 0.0019839870], rel=1e-7)
    unloaded = [0.0025359479, 0.0006339870, -0.0037142857, 0.00045284784]
    assert found.row(0.0045, True) == pytest.approx(unloaded, rel=1e-7)
    steel = Hill(200e3, 250.0)
    assert 2 * steel.first == pytest.approx(291.667, rel=1e-5)
    pressure = steel.pressure(1.25)
    assert pressure == pytest.approx(237.548338, rel=1e-8)
    assert steel.row(pressure, False)[:2] == pytest.approx([1.2338877e-3, 4.2724609e-4], rel=1e-7)
    inside, _, hoop, _ = steel.row(pressure, True)
    assert (inside, hoop) == pytest.approx((2.8369435e-4, -157.225723), rel=1e-7)


@pytest.mark.parametrize(
    ("young", "limit", "front"),
    [pytest.param(1.0, 0.004, 1.4151862, marks=pytest.mark.slow), (200e3, 250.0, 1.25)],
)
def test_hollow_sphere_under_pressure_and_unloaded(young, limit, front):
    """Within .2 %, of second order: straight edges follow the sphere no better."""
    exact = Hill(young, limit)
    pressure, errors = exact.pressure(front), []
    for cells in (16, 32):
        run = pressed(cells, young, limit, pressure)
        assert float(run.steps[-1].row["plastic_dissipation"]) == 0
        pairs = [(at_the_equator(run, step), exact.row(pressure, step == -1)) for step in (-2, -1)]
        moved = [np.abs(np.array(found[:2]) / known[:2] - 1) for found, known in pairs]
        stressed = [np.abs(np.subtract(found, known))[2:] / limit for found, known in pairs]
        assert cells == 16 or np.max(stressed) < 2e-3
        errors.append(np.max(moved, axis=1))
    assert errors[1].max() < 2e-3
    assert (errors[0] / errors[1]).min() > 3.3


@pytest.mark.parametrize("front", [1.5, 1.75])
def test_hollow_sphere_that_yields_in_reverse(front):
    """Unloading is the problem of twice the yield stress, in closed form too."""
    exact = Hill(200e3, 250.0)
    pressure = exact.pressure(front)
    assert pressure > 2 * exact.first > exact.pressure(1.4151862)
    run = pressed(16, 200e3, 250.0, pressure, steps=6)
    assert float(run.steps[-1].row["plastic_dissipation"]) > 0
    for step in (-2, -1):
        found, known = at_the_equator(run, step), exact.row(pressure, unloaded=step == -1)
        assert found[:2] == pytest.approx(known[:2], rel=4e-3)
        at, strain = most_strained(run, step)
        assert strain == pytest.approx(exact.plastic(at, pressure, step == -1), rel=0.04)


def test_hollow_sphere_shakes_down_below_twice_its_first_yield():
    exact = Hill(200e3, 250.0)
    for share in (0.98, 1.1):
        pressure = share * 2 * exact.first
        first, *later = cycled(16, pressure, 3)
        assert first == pytest.approx(exact.dissipated(pressure), rel=0.02)
        # In each half cycle after the first: strains of twice the yield stress, which flow at Y.
        half = exact.reversed.dissipated(pressure) / 2
        assert later == pytest.approx([half] * 5, rel=0.05, abs=1e-9)
        assert (half > 0) == (share > 1)


def test_hollow_sphere_at_its_limit():
    assert Hill(200e3, 250.0).most == pytest.approx(2 * 250 * np.log(2), rel=1e-12)
    errors = [limit_pressure(cells) / Hill(200e3, 250.0).most - 1 for cells in (8, 16)]
    assert abs(errors[1]) < 2e-3 and abs(errors[0]) > 3.5 * abs(errors[1])


@pytest.mark.parametrize("kind", ["uniaxial", "revolved"])
def test_j2_is_hencky_s_law_in_proportional_loading(kind):
    """Uniaxial stress, digit for digit; they part where the strain turns."""
    values = [0.001, 0.002, 0.005, 0.02, 0.019]
    given, hardening = {key: STEEL[key] for key in ("young", "yield_stress")}, 20e3
    times = [float(k + 1) for k in range(len(values))]
    law = {**given, "hardening": hardening}
    case = homogeneous(kind, law, times, values, cells=1, solver={"tolerance": 1e-13})
    up, found = 2 if kind == "uniaxial" else 1, []
    for solution in (solve(case), solve(case, law=hencky(hardening))):
        assert solution.converged and len(solution.steps) == len(values)
        stresses = []
        for step in solution.steps:
            cells = DerivedFields(solution.problem.body, step.state).cells()
            stresses.append(cells["stress"].x.array.reshape(-1, 3, 3)[:, up, up].mean())
        found.append(np.array(stresses))
    flow, theory = found
    assert flow[2] > 1.05 * STEEL["yield_stress"]
    assert theory[:4] == pytest.approx(flow[:4], rel=1e-12)
    drop = STEEL["young"] * 0.001
    assert flow[3] - flow[4] == pytest.approx(drop, rel=1e-10)
    assert theory[3] - theory[4] < 0.1 * drop


def test_first_yield_under_hertz_and_the_fits_of_a_ball():
    """The numbers that the tables of the study stand beside."""
    known = {0.25: (1.55435, 0.4643), 0.3: (1.61280, 0.4809), 0.35: (1.67411, 0.4975)}
    for poisson, values in (known | {0.4: (1.73848, 0.5142)}).items():
        assert hertz_first_yield("ball", poisson) == pytest.approx(values, rel=1e-4)
    assert hertz_first_yield("cylinder") == pytest.approx((1.79367, 0.7043), rel=1e-4)
    depths = (1.9, 3.0, 5.0, 7.5, 10.0)
    fits = {kogut_etsion: (2.571, 4.929, 10.21, 17.84, 25.66)}
    fits[jackson_green] = (2.631, 4.998, 10.13, 17.60, 25.88)
    for fit, values in fits.items():
        assert [fit(w) for w in depths] == pytest.approx(values, rel=6e-4)


@pytest.mark.slow
def test_the_mean_dilatation_is_p2_p0_with_the_return_map_at_the_points():
    """The body's solution balances the mixed form, with a pressure of each cell of its own."""
    young, limit, pressure, nu = YOUNG, YIELD, 0.0045, 0.3
    problem = sphere(4, young, limit, pressure=lambda t: pressure * t, element="mean_dilatation")
    solution = solve_steps(problem, [1.0], NewtonOptions(tolerance=1e-11))
    assert solution.converged and len(solution.steps) == 1
    body = problem.body
    u, mesh = body.function(solution.state.x), body.domain.mesh
    dx = ufl.dx(mesh, metadata={"quadrature_degree": 3})
    r, n = ufl.SpatialCoordinate(mesh)[0], ufl.FacetNormal(mesh)
    v = ufl.TestFunction(body.space)

    def strain(w):
        g = ufl.sym(ufl.grad(w))
        return ufl.as_tensor([[g[0, 0], g[0, 1], 0], [g[1, 0], g[1, 1], 0], [0, 0, w[0] / r]])

    flat = fem.functionspace(mesh, ("DG", 0))
    p, q = fem.Function(flat), ufl.TestFunction(flat)
    volume, dilated = (
        fem.assemble_vector(fem.form(value * q * r * dx)).array
        for value in (1.0, ufl.tr(strain(u)))
    )
    p.x.array[:] = young / (3 - 6 * nu) * dilated / volume
    e, shear = ufl.dev(strain(u)), young / (2 + 2 * nu)
    t, most = ufl.sqrt(ufl.inner(e, e)), np.sqrt(2 / 3) * limit / (2 * shear)
    s = 2 * shear * e * ufl.conditional(ufl.lt(t, most), 1.0, most / t)
    ds = body.domain.ds("inner")  # of the whole turn
    inner = (ufl.inner(s, strain(v)) + p * ufl.tr(strain(v))) * r * dx
    forces, loads = (
        fem.assemble_vector(fem.form(form)).array
        for form in (inner, -pressure / (2 * np.pi) * ufl.dot(n, v) * ds)
    )
    left = (forces - loads)[body.free.ravel()]
    assert np.linalg.norm(left) < 1e-9 * np.linalg.norm(loads)
    points = body.space.tabulate_dof_coordinates()
    at = np.argmin(np.abs(points[:, 0] - 1) + np.abs(points[:, 1]))
    assert body.nodal(solution.state.x)[at, 0] / 0.0061359479 - 1 == pytest.approx(0.1558, abs=1e-3)
