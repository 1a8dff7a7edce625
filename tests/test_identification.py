"""Parameters from synthetic measurements of a block that is pressed, sheared and sheared back."""

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from contact import InputError, identify, parse_case, read_data, solve
from contact.case.file import number_at, to_toml, with_number
from contact.cli.identify import report
from contact.cli.main import main
from contact.derivatives.identification import _least
from scripts.studies.identification import coverage
from tests.problems.taylor import block, evolving

SELF = MPI.COMM_SELF
COLUMNS = ("contact_force_x", "contact_force_y")


def case():
    return parse_case(evolving(block()))


@cache
def solved():
    """Return the run of the case, which no test changes."""
    return solve(case(), comm=SELF)


def measured(noise=0.0, seed=0):
    """Return t and the columns of a run, with noise relative to the largest value of each."""
    rows = [record.row for record in solved().steps]
    rng, data = np.random.default_rng(seed), {"t": np.array([row["t"] for row in rows])}
    for name in COLUMNS:
        values = np.array([row[name] for row in rows])
        data[name] = values + noise * np.abs(values).max() * rng.standard_normal(values.size)
    return data


def test_exact_measurements_give_the_parameters_back():
    wrong = with_number(with_number(case(), "friction.mu", 0.4), "material.young", 1.0)
    right = case()
    found = identify(wrong, measured(), ["friction.mu", "material.young"], comm=SELF)
    assert found.parameters["friction.mu"] == pytest.approx(
        number_at(right, "friction.mu"), rel=1e-6
    )
    assert found.parameters["material.young"] == pytest.approx(
        number_at(right, "material.young"), rel=1e-6
    )
    assert found.misfit < 1e-7


def test_noise_widens_the_intervals():
    keys, data = ["friction.mu", "material.young"], measured(noise=0.01)
    found = identify(case(), data, keys, bounds={"friction.mu": (0, 1)}, level=0.999, comm=SELF)
    right = {key: number_at(case(), key) for key in keys}
    for key in keys:
        least, largest = found.intervals[key]
        assert least < right[key] < largest
        assert 1e-3 < (largest - least) / right[key] < 0.3
    assert found.correlation == pytest.approx(found.correlation.T)
    assert np.diag(found.correlation) == pytest.approx([1, 1])
    assert 0.003 < found.misfit < 0.02


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"contact_force_x": [1.0]}, r"\[data-file\]"),
        ({"t": [1.0, 4.0], "contact_force_x": [1.0, 1.0]}, r"\[value\]"),
        ({"t": [1.0, 2.0], "contact_force_x": [1.0, np.nan]}, r"\[value\]"),
    ],
)
def test_refused(data, message):
    with pytest.raises(InputError, match=message):
        identify(case(), data, ["friction.mu"], comm=SELF)


def test_the_command(tmp_path, capsys):
    data, file = measured(noise=0.005), tmp_path / "loop.csv"
    rows = np.column_stack([*data.values()])
    np.savetxt(file, rows, delimiter=",", header=",".join(data), comments="")
    assert read_data(file).keys() == data.keys()
    path = tmp_path / "block.toml"
    path.write_text(to_toml(case()))
    picture = tmp_path / "fit.png"
    command = ["identify", str(path), str(file), "--for", "friction.mu", "--plot", str(picture)]
    assert main([*command, "--quiet"]) == 0
    text = capsys.readouterr().out
    assert "friction.mu" in text and "95% interval" in text
    assert picture.stat().st_size > 10_000
    assert main(command) == 2
    assert "fit.png: it exists; accepted: a new file" in capsys.readouterr().err
    picture.unlink()
    file.write_text("t,contact_force_x\n1.0,much\n")
    assert main(command) == 2
    assert "accepted: a row of names, then rows of numbers" in capsys.readouterr().err
    assert not picture.exists()


def test_intervals_contain_the_parameters_as_often_as_they_say():
    # of a linear model, in ten thousand repetitions
    shares = coverage(solved(), COLUMNS)
    assert shares == pytest.approx([0.95, 0.95], abs=0.01)


def with_columns(given, columns):
    """Return t and columns of a run of a case, exactly."""
    rows = [record.row for record in solve(given, comm=SELF).steps]
    return {name: np.array([row[name] for row in rows]) for name in ("t", *columns)}


def loaded(mu=0.3):
    """Return the block with a load on its constrained top, and two equal ones on its left side."""
    data = evolving(block())
    data["fixed"][1]["displacement"] = [data["fixed"][1]["displacement"][0], "free"]
    load = {"traction": [0.002, 0.0], "amplitude": "constant"}
    data["load"] = [{"on": on, **load} for on in ("top", "left", "left")]
    data["friction"]["mu"] = mu
    return parse_case(data)


@pytest.mark.parametrize(
    ("keys", "undetermined"),
    [
        pytest.param(
            ["material.young", "load.0.traction.0"], ["load.0.traction.0"], marks=pytest.mark.slow
        ),
        (
            ["load.1.traction.0", "material.young", "load.2.traction.0"],
            ["load.1.traction.0", "load.2.traction.0"],
        ),
    ],
)
def test_parameters_that_measurements_do_not_determine(keys, undetermined, caplog):
    """One without effect, and two that have the same: they were given intervals of nothing."""
    given, rng = loaded(), np.random.default_rng(0)
    data = with_columns(given, COLUMNS)
    for name in COLUMNS:
        data[name] += 0.01 * np.abs(data[name]).max() * rng.standard_normal(data["t"].size)
    with caplog.at_level("WARNING", logger="contact"):
        found = identify(given, data, keys, comm=SELF)
    assert [*found.undetermined] == undetermined
    assert "the measurements do not determine" in caplog.text
    for key in keys:
        ends = np.array(found.intervals[key])
        assert np.isfinite(ends).all() == (key not in undetermined)
    lines = report(found)
    assert sum("none: the measurements do not" in x for x in lines) == len(undetermined)
    index = keys.index("material.young")
    assert np.isfinite(found.covariance[index, index]) and found.covariance[index, index] > 0


def test_a_bound_is_0_where_the_case_accepts_nothing_below():
    assert _least([case()], "friction.mu") == _least([case()], "material.young") == 0
    assert _least([case()], "fixed.1.displacement.0") == -np.inf


@pytest.mark.parametrize("start", [0.6, 0.0])
def test_a_search_stays_with_numbers_that_the_case_accepts(start):
    # Forces of a block without friction: the best coefficient would be below 0 with this noise.
    data = with_columns(with_number(case(), "friction.mu", 0.0), COLUMNS)
    size = np.abs(data["contact_force_y"]).max()
    data["contact_force_x"] = -0.01 * size * np.array([0, 1, 1, 1, 1, 1, -1, -1])[: data["t"].size]
    found = identify(with_number(case(), "friction.mu", start), data, ["friction.mu"], comm=SELF)
    assert 0 <= found.parameters["friction.mu"] < 0.05


def test_columns_of_supports_and_energies_can_be_fitted():
    columns = ["reaction_x_top", "reaction_y_top", "driven_force_x", "energy", "dissipation"]
    data = with_columns(case(), columns)
    wrong = with_number(with_number(case(), "friction.mu", 0.3), "material.young", 1.0)
    found = identify(wrong, data, ["friction.mu", "material.young"], comm=SELF)
    for key, value in found.parameters.items():
        assert value == pytest.approx(number_at(case(), key), rel=1e-5)
