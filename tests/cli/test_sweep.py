"""contact sweep: one row a value, resumable, warm-started, over several keys."""

import csv
import signal

import pytest

from contact.cli.main import main
from contact.errors import InputError
from contact.methods.interrupt import Interrupted
from contact.sweeping import Axis
from tests.problems.bar import BAR

RUNS = ("converged", "kkt", "seconds", "linear_solves", "factorizations", "outer_iterations")


@pytest.fixture
def sweep(tmp_path):
    """Return a function that sweeps the bar and returns its status and rows."""
    case, out = tmp_path / "bar.toml", tmp_path / "out"
    case.write_text(BAR)

    def run(*arguments, quiet=True):
        told = ["sweep", case, "--out", out, *arguments, *(["--quiet"] if quiet else [])]
        status = main([str(argument) for argument in told])
        table = out / "sweep.csv"
        rows = list(csv.DictReader(table.open())) if table.exists() else []
        return status, rows

    return run


def physics(row):
    return {key: value for key, value in row.items() if key not in RUNS}


def test_two_keys_and_rows_that_are_there(sweep):
    over = ("--over", "load.0.traction=[0.0, -0.005],[0.0, -0.01]", "--over", "friction.mu=0.2,0.4")
    linear = ("--set", "material.law=linear")
    status, rows = sweep(*over, *linear)
    assert status == 0
    assert [row["friction.mu"] for row in rows] == ["0.2", "0.4", "0.2", "0.4"]
    force = [float(row["contact_force_y"]) for row in rows]
    assert force[2] < force[0] < 0
    assert [row["factorizations"] for row in rows] == ["1", "0", "0", "0"]
    longer = (*over[:3], "friction.mu=0.2,0.4,0.6")
    _, more = sweep(*longer, *linear)
    assert len(more) == 6
    assert [row for row in more if row["friction.mu"] != "0.6"] == rows  # seconds too


def test_rows_of_other_values_remain(sweep):
    _, rows = sweep("--over", "friction.mu=0.2,0.4")
    status, more = sweep("--over", "friction.mu=0.3")
    assert status == 0
    assert [row["friction.mu"] for row in more] == ["0.3", "0.2", "0.4"]
    assert more[1:] == rows


def test_numbers_are_those_of_their_values():
    assert Axis.of("friction.mu=0.20,4e-1").values == ("0.2", "0.4")
    assert Axis.of("mesh.cells=[8, 4],[8,2]").values == ("[8, 4]", "[8,2]")


def test_rows_that_come_later_remain_where_the_sweep_is_ended(sweep, monkeypatch):
    _, rows = sweep("--over", "friction.mu=0.2,0.4")

    def stopped(*_):
        raise Interrupted(signal.SIGTERM)

    monkeypatch.setattr("contact.sweeping._Runner.solve", stopped)
    status, more = sweep("--over", "friction.mu=0.2,0.3,0.4")
    assert status == 128 + signal.SIGTERM
    assert more == rows


@pytest.mark.parametrize("law", ["linear", "log"])
def test_warm_and_cold_agree(sweep, tmp_path, law):
    over = ("--over", "load.0.traction.1=-0.005,-0.01,-0.02", "--set", f"material.law={law}")
    _, warm = sweep(*over)
    (tmp_path / "out" / "sweep.csv").unlink()
    _, cold = sweep(*over, "--cold")
    for one, two in zip(warm, cold, strict=True):
        for name, value in physics(one).items():
            assert float(value) == pytest.approx(float(two[name]), rel=1e-6)
    work = [sum(int(row["factorizations"]) for row in rows) for rows in (warm, cold)]
    assert work == [1, 3] or law == "log"


def test_an_evolution_is_swept(sweep, tmp_path):
    steps = ["evolution.times=[0.0, 1.0]", "evolution.steps=[2]"]
    over = ("--over", "friction.mu=0.2,0.4", *(text for s in steps for text in ("--set", s)))
    status, rows = sweep(*over)
    assert status == 0
    assert len(rows) == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "--over: missing"),
        (("--over", "friction.mu"), "--over friction.mu: accepted: path.to.key=value,value"),
        (("--over", "friction.mu=0.1,0.1"), "a value stands there twice"),
        (("--over", "friction.mu=0.1,0.10"), "a value stands there twice"),
        (("--over", "friction.nu=0.1"), "friction.nu: unknown key"),
        (("--over", "friction.mu=0.1,-1.0"), "friction.mu"),
    ],
)
def test_bad_input(sweep, capfd, arguments, message):
    status, rows = sweep(*arguments)
    assert status == 2
    assert rows == []
    assert message in capfd.readouterr().err


def test_another_sweep_is_not_overwritten(sweep, capfd):
    sweep("--over", "friction.mu=0.2")
    assert sweep("--over", "friction.mu=0.3", "--set", "material.young=2.0")[0] == 2
    assert "a sweep of another case: there material.young is 1.0, here 2.0" in (
        capfd.readouterr().err
    )
    assert sweep("--over", "load.0.traction.1=-0.1")[0] == 2
    words = "given a sweep over other keys; accepted: one over friction.mu, or another folder"
    assert words in capfd.readouterr().err


def test_commas_within_lists_and_texts():
    axis = Axis.of('a.b=[0, 1],[2, 3],"x,y",{ a = 1, b = 2 }')
    assert axis.values == ("[0, 1]", "[2, 3]", '"x,y"', "{ a = 1, b = 2 }")
    with pytest.raises(InputError):
        Axis.of("a=1,,2")
