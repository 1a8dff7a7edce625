"""Current between two piezoelectric bodies, against columns in series."""

import numpy as np
import pytest
from mpi4py import MPI

from contact.methods.options import FixedPointOptions, NewtonOptions
from contact.model.body import Body, Electrode, Fixed
from contact.model.contact import Contact
from contact.model.foundation import Conductor
from contact.model.material import Material
from contact.problem.problem import ContactProblem
from contact.problem.residuals import evaluate
from contact.results.resultants import charge_balance, movements
from forms.hencky import Linear
from forms.laws import PerfectConductivity, ShiftedConductivity, Truncation
from forms.piezo import from_voigt
from tests.problems.blocks import Blocks
from tests.problems.mechanics import constant, flat, solved_by

SELF = MPI.COMM_SELF
VOLTS, CONDUCTANCE, UPPER, LOWER = 3.0, 2.0, 0.5, 4.0


def columns(
    electrode: float | None = None,
    conductance: float = CONDUCTANCE,
    degree: int = 1,
    pair: tuple[str, str] = ("under", "over"),
) -> ContactProblem:
    """Return two blocks of height and width 1 without coupling, pressed onto each other.

    Parameters
    ----------
    electrode
        Charge of the upper electrode; None where that is prescribed as `VOLTS`.
    conductance
        Of what is between them.
    degree
        Of displacements and potential.
    pair
        Sides of the upper and the lower block, the slave side first.
    """
    still = [constant(0.0, 2), constant(0.0, 2)]
    down = [constant(0.0, 2), constant(-0.01, 2)]
    volts = None if electrode is not None else constant(VOLTS, 2)
    fixed = [Fixed("bottom", still, constant(0.0, 2)), Fixed("top", down, volts)]
    materials = [
        Material(Linear(1.0, 0.3), from_voigt(np.zeros((3, 6)), beta * np.eye(3)), (name,))
        for name, beta in (("upper", UPPER), ("lower", LOWER))
    ]
    electrodes = () if electrode is None else Electrode("top", electrode)
    body = Body(materials, fixed, electrodes=electrodes)
    # Without a fixed potential what touches has to conduct before it is pressed.
    law = PerfectConductivity(conductance)
    conducts = law if electrode is None else ShiftedConductivity(conductance, 1e3)
    conductor = Conductor(conducts, 0.0, Truncation(np.inf))
    contact = Contact(pair[0], flat(), conductor=conductor, against=pair[1])
    return ContactProblem(Blocks(jitter=0.1).domain(SELF), body, contact, degree=degree)


def solved(problem, options):
    state = solved_by(problem, options).state
    return state, charge_balance(problem, state)


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("pair", [("under", "over"), ("over", "under")])
@pytest.mark.parametrize("how", ["condensed", "whole", "uzawa"])
def test_columns_in_series(how, pair, degree):
    """I = V/(H_1/beta_1 + 1/k + H_2/beta_2), and what leaves one body enters the other."""
    problem = columns(degree=degree, pair=pair)
    options = NewtonOptions(tolerance=1e-11, condense=how == "condensed")
    if how == "uzawa":
        options = FixedPointOptions(tolerance=1e-11)
    state, charges = solved(problem, options)
    current = VOLTS / (1 / UPPER + 1 / CONDUCTANCE + 1 / LOWER)
    assert abs(charges.electrodes["top"]) == pytest.approx(current, rel=1e-10)
    lost = charges.electrodes["top"] + charges.electrodes["bottom"]
    assert abs(lost) < 1e-12 * current
    assert abs(charges.foundation) < 1e-12 * current and charges.imbalance < 1e-12
    points, phi = problem.body.layout.points, problem.body.nodal(state.x)[:, 2]
    volts = problem.body.phi_scale * phi
    upper = points[:, 1] > 1.5
    slope = np.polyfit(points[upper, 1], volts[upper], 1)[0]
    assert slope == pytest.approx(current / UPPER, rel=1e-9)


@pytest.mark.core
@pytest.mark.parametrize("condense", [True, False])
def test_an_electrode_of_given_charge_on_a_column_in_series(condense):
    problem = columns(0.25)
    state, charges = solved(problem, NewtonOptions(tolerance=1e-11, condense=condense))
    potential = movements(problem, state)["electrodes"]["top"]["potential"]
    resistance = 1 / UPPER + 1 / CONDUCTANCE + 1 / LOWER
    assert abs(potential) == pytest.approx(0.25 * resistance, rel=1e-10)
    assert charges.electrodes["top"] == pytest.approx(0.25, rel=1e-10)
    assert charges.electrodes["bottom"] == pytest.approx(-0.25, rel=1e-10)


@pytest.mark.parametrize("options", [NewtonOptions, FixedPointOptions])
@pytest.mark.parametrize("conductance", [1e-9, 1e3, 1e9, 1e12])
def test_what_hardly_conducts_and_what_bonds_the_bodies(conductance, options):
    """What potentials owe to rounding, times the conductance, is no charge out of balance."""
    problem = columns(conductance=conductance)
    state, charges = solved(problem, options())
    current = VOLTS / (1 / UPPER + 1 / conductance + 1 / LOWER)
    assert abs(charges.electrodes["top"]) == pytest.approx(current, rel=1e-7)
    assert evaluate(problem, state).equilibrium_rounding < 1e-5
