"""Several contacts of one body: each with its own laws."""

import numpy as np
import pytest

from contact import InputError, build_problem, parse_case, solve
from contact.interface.grouping import GroupedConductivity
from contact.results.contact_nodes import contact_table
from contact.results.quantities import named_functionals, values_of
from contact.results.quantity import SWEEP
from forms.laws import PerfectConductivity, ShiftedConductivity
from tests.problems.everywhere import displacements

PIECES = {"one": {"side": "bottom", "to": 1.5}, "two": {"side": "bottom", "from": 2.5}}


def case(contact, cells=(32, 8), **more):
    """Return a block on two feet that is pressed on top, more at its right end."""
    return parse_case(
        {
            "mesh": {
                "generator": "rectangle",
                "size": [4.0, 1.0],
                "cells": list(cells),
                "parts": more.pop("parts", PIECES),
            },
            "material": {"young": 1.0, "poisson": 0.3, **more.pop("material", {})},
            "fixed": [
                {"on": "left", "displacement": [0.02, "free"]},
                *more.pop("fixed", []),
            ],
            "load": [{"on": "top", "traction": [0.0, "-0.005*(1+x)"]}],
            "contact": contact,
            "solver": {"tolerance": 1e-12},
            **more,
        }
    )


OF_CONTACT = (
    "contact_force_x",
    "contact_force_y",
    "contact_moment",
    "contact_area",
    "max_pressure",
    "mean_pressure",
    "stick",
    "slip",
    "dissipation",
)


def coulomb(mu):
    return {"law": "coulomb", "mu": mu}


def test_the_ramp_of_several_contacts_is_the_steepest_of_those_that_have_one():
    """Beside a contact without charge it had been a jump: 1/delta = 0."""
    laws = ShiftedConductivity(1.0, 20.0), PerfectConductivity(0.0)
    assert GroupedConductivity(laws, (0, 1, 2)).delta == 20.0


LAYER = {"law": "compliance", "layer": 0.01, "stiffness": 5.0, "potential_factor": 1.0}


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("common", [{}, LAYER], ids=["rigid", "layer"])
def test_one_law_for_two_feet_is_the_law_of_their_union(common) -> None:
    """The two pieces as two contacts, and as one part that consists of both."""
    friction = {"law": "coulomb", "mu": {"law": "slip", "a": 0.2, "b": 0.1, "rho": 10.0}}
    apart = [{"on": name, "gap": 0.001, "friction": friction, **common} for name in PIECES]
    both = {"feet": [{"side": "bottom", "to": 1.5}, {"side": "bottom", "from": 2.5}]}
    one = solve(case({"on": "feet", "gap": 0.001, **common}, parts=both, friction=friction))
    two = solve(case(apart))
    assert one.converged and two.converged
    np.testing.assert_allclose(displacements(two), displacements(one), rtol=0, atol=1e-11)
    tables = [contact_table(solution.contact) for solution in (one, two)]
    if tables[0] is None or tables[1] is None:
        return
    assert next(iter(tables[1])) == "on" and "on" not in tables[0]
    assert list(tables[1]["on"]) == ["one"] * 13 + ["two"] * 13
    np.testing.assert_allclose(tables[1]["x"], tables[0]["x"], atol=1e-12)
    np.testing.assert_allclose(tables[1]["pressure"], tables[0]["pressure"], atol=1e-10)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_each_foot_has_its_own_law(method: str) -> None:
    """Frictionless, rubbing with Coulomb's law, on a layer: residuals and laws at each node."""
    contact = [
        {"on": "one", "friction": coulomb(0.25), "gap": 0.002},
        {"on": "two", "gap": 0.01, **LAYER, "friction": {"law": "none"}},
    ]
    solution = solve(case(contact, solver={"method": method, "tolerance": 1e-9}))
    assert solution.converged
    table = contact_table(solution.contact)
    if table is None:
        return
    first, second = table["on"] == "one", table["on"] == "two"
    np.testing.assert_allclose(table["tau"][second], 0.0, atol=1e-10)
    slides = table["status"][first] == "slip"
    assert slides.any()
    tau, pressure = np.abs(table["tau"][first]), table["pressure"][first]
    np.testing.assert_allclose(tau[slides], 0.25 * pressure[slides], rtol=1e-5, atol=1e-9)
    depth = table["u_n"][second]
    soft = (depth > 0) & (depth < 0.0099)
    assert soft.any()
    np.testing.assert_allclose(table["pressure"][second][soft], 5.0 * depth[soft], rtol=1e-6)


def test_one_contact_with_a_name_has_its_columns() -> None:
    """As each of several; one without a name has those of the sum alone."""
    named, unnamed = solve(case([{"on": "one", "name": "lo"}])), solve(case([{"on": "one"}]))
    row, plain = values_of(SWEEP, named), values_of(SWEEP, unnamed)
    share = named.contacts["lo"]
    assert row["mean_pressure_lo"] == share.mean_pressure > 0
    assert row["contact_force_y_lo"] == row["contact_force_y"] == plain["contact_force_y"]
    assert {name for name in row if name not in plain} == {f"{name}_lo" for name in OF_CONTACT}
    found = {*named_functionals(named.problem)} - {*named_functionals(unnamed.problem)}
    assert found == {f"{name}_lo" for name in OF_CONTACT} - {
        f"{name}_lo" for name in ("contact_area", "stick", "slip")
    }


def test_the_smoothed_pressure_stays_on_its_foot() -> None:
    """With a radius beyond the distance of the feet R averages within each of them."""
    friction = {**coulomb(0.3), "radius": 5.0}
    contact = [{"on": name, "friction": friction} for name in PIECES]
    problem = build_problem(case(contact))
    sizes = [geometry.nodes.nodes.size for geometry in problem.geometries]
    pressure = np.repeat([1.0, 3.0], sizes)
    bound = problem.interface.friction.bound(np.zeros(sum(sizes)), pressure)
    np.testing.assert_allclose(bound, 0.3 * pressure, rtol=1e-12)


def test_two_electrodes_under_one_body() -> None:
    """Two conducting feet at different potentials: the current of one leaves through the other."""
    piezo = {"e31": 0.0, "e33": 0.0, "e15": 0.0, "beta11": 1.0, "beta33": 1.0}
    electric = [{"law": "perfect", "k_e": 1e3, "phi_f": phi} for phi in (1.0, -2.0)]
    pairs = zip(PIECES, electric, strict=True)
    contact = [{"on": name, "electric": law} for name, law in pairs]
    solution = solve(case(contact, material={"piezo": piezo}, solver={}))
    assert solution.converged
    table = contact_table(solution.contact)
    assert table is not None
    charge = [np.sum((table["weight"] * table["d_n"])[table["on"] == name]) for name in PIECES]
    assert charge[0] < 0 and charge[0] == pytest.approx(-charge[1], rel=1e-9)
    middle = [table["phi"][table["on"] == name].mean() for name in PIECES]
    np.testing.assert_allclose(middle, [1.0, -2.0], atol=0.05)


@pytest.mark.parametrize(
    ("contact", "more", "message"),
    [
        ([{"on": "one"}, {"on": "one"}], {}, r"\[contact-name\]"),
        ([{"on": "one"}, {"on": "two", "name": "nodes"}], {}, r"stick_nodes .*\[contact-name\]"),
        ([{"on": "one", "name": "nodes"}], {}, r"stick_nodes .*\[contact-name\]"),
        ([{"on": "one"}, {"on": "bottom"}], {}, r"\[contacts-meet\]"),
        (
            [{"on": "one", "friction": {"mu": 1}}, {"on": "two"}],
            {},
            r"contact\.0\.friction\.mu.*\[value\]",
        ),
        (
            [
                {"on": "one"},
                {"on": "two", "foundation": {"shape": "plane", "point": [0, 1], "normal": [0, 1]}},
            ],
            {},
            r"contact\.1\.foundation.*\[overlap\]",
        ),
        (
            [{"on": "one", **LAYER, "lagged": True}, {"on": "two", **LAYER}],
            {"solver": {"method": "uzawa"}},
            r"\[lagged\]",
        ),
    ],
)
def test_what_is_refused(contact, more, message: str) -> None:
    with pytest.raises(InputError, match=message):
        build_problem(case(contact, **more))
