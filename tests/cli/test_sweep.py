"""contact sweep: one row a value, resumable, warm-started, over several keys."""

import pytest

from contact import load_case, solve
from contact.case.file import to_toml
from contact.cli.main import main
from contact.plot.series import read_sweep, sweep_figure
from contact.sweeping import Axis
from contact.sweeping import sweep as sweep_of
from tests.methods.test_belt import MU, PRESS, wall
from tests.problems.bar import BAR
from tests.problems.written import rows_of

RUNS = (
    "converged",
    "kkt",
    "seconds",
    "input",
    "linear_solves",
    "factorizations",
    "outer_iterations",
)


@pytest.fixture
def sweep(tmp_path):
    """Return a function that sweeps the bar and returns its status and rows."""
    case, out = tmp_path / "bar.toml", tmp_path / "out"
    case.write_text(BAR)

    def run(*arguments, quiet=True):
        told = ["sweep", case, "--out", out, *arguments, *(["--quiet"] if quiet else [])]
        status = main([str(argument) for argument in told])
        table = out / "sweep.csv"
        rows = rows_of(table) if table.exists() else []
        return status, rows

    return run


def physics(row):
    return {key: value for key, value in row.items() if key not in RUNS}


@pytest.mark.core
def test_two_keys_and_rows_that_are_there(sweep):
    over = ("--over", "load.0.traction=[0.0, -0.005],[0.0, -0.01]", "--over", "friction.mu=0.2,0.4")
    linear = ("--set", "material.law=linear")
    status, rows = sweep(*over, *linear)
    assert status == 0
    assert [row["friction.mu"] for row in rows] == ["0.2", "0.4", "0.2", "0.4"]
    force = [float(row["contact_force_y"]) for row in rows]
    assert force[2] < force[0] < 0
    assert [row["factorizations"] for row in rows] == ["1", "0", "0", "0"]  # the body is kept
    longer = (*over[:3], "friction.mu=0.2,0.4,0.6")
    _, more = sweep(*longer, *linear)
    assert len(more) == 6
    assert [row for row in more if row["friction.mu"] != "0.6"] == rows  # seconds too


@pytest.mark.core
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
        (
            ("--over", "friction.mu=0.1", "--over", "friction.mu=0.2"),
            "friction.mu: stands there twice",
        ),
        (("--over", "friction.mu=0.1", "--columns", "dissipation"), "a column of each sweep"),
        (("--over", "friction.nu=0.1"), "friction.nu: unknown key"),
        (("--over", "friction.mu=0.1,-1.0"), "friction.mu"),
    ],
)
def test_bad_input(sweep, capfd, arguments, message):
    status, rows = sweep(*arguments)
    assert status == 2
    assert rows == []
    assert message in capfd.readouterr().err


DAMAGED = {
    "cut": ("sweep.csv", lambda data: data[:-60]),
    "empty": ("sweep.csv", lambda data: b""),
    "binary": ("sweep.csv", lambda data: bytes(range(256))),
    "another table": ("sweep.csv", lambda data: b"a,b\n1,2\n"),
    "case cut": ("sweep.toml", lambda data: data[: len(data) // 2]),
}


def test_damaged_files_are_refused_and_kept(sweep, tmp_path, capfd):
    sweep("--over", "friction.mu=0.2,0.4")
    whole = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    for kind, (name, damage) in DAMAGED.items():
        path = tmp_path / "out" / name
        path.write_bytes(damage(whole[path]))
        before = whole | {path: path.read_bytes()}
        capfd.readouterr()
        assert main(["sweep", str(tmp_path / "bar.toml"), "--out", str(tmp_path / "out"),
                     "--over", "friction.mu=0.2,0.3", "--quiet"]) == 2, kind  # fmt: skip
        message = capfd.readouterr().err
        assert message.startswith("contact: ") and message.count("\n") == 1
        assert {path: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
        path.write_bytes(whole[path])


def test_columns_of_the_summary(sweep):
    """A number, a vector, a table of vectors, an entry of one."""
    names = "contact_moment,reactions,reaction_moments.left,volume_ratio,error.energy,contacts"
    status, rows = sweep("--over", "friction.mu=0.2,0.4", "--columns", names)
    assert status == 0
    for row in rows:
        assert float(row["max_von_mises"]) > 0 and float(row["dissipation"]) > 0
        balance = float(row["reactions.left_y"]) - float(row["contact_force_y"])
        assert balance == pytest.approx(0.01, rel=1e-6)  # with the load
        found = {"contact_moment", "reaction_moments.left", "volume_ratio_least"}
        assert found | {"error.energy"} <= {*row}
        assert not any("moment" in name and name[-2:] in ("_x", "_0") for name in row)
        assert row["contacts.bottom.force_y"] == row["contact_force_y"]
        assert row["contacts.bottom.moment"] == row["contact_moment"]
        assert float(row["volume_ratio_least"]) <= float(row["volume_ratio_largest"])
    _, again = sweep("--over", "friction.mu=0.2,0.4", "--columns", names)
    assert again == rows


def test_a_row_that_is_refused_is_named(sweep, capsys):
    """The rows before it are kept."""
    supports = ("--set", "fixed.0.displacement=[0.0, 'free']", "--set", "friction.mu=0.0")
    over = ("--over", "load.0.traction=[0.0, -0.01],[0.0, 0.01]")
    status, rows = sweep(*supports, *over)
    assert (status, len(rows)) == (2, 1)
    said = capsys.readouterr().err
    assert said.startswith("contact: load.0.traction=[0.0, 0.01]: ")
    assert "[pulled-off]" in said


def test_the_figure_of_a_sweep(sweep, tmp_path, capsys):
    sweep("--over", "load.0.traction.1=-0.002,-0.004,-0.006", "--over", "friction.mu=0.1,0.3")
    out = str(tmp_path / "out")
    assert main(["plot", out, "--format", "png,pdf"]) == 0
    assert (tmp_path / "out" / "figure-sweep.png").stat().st_size > 10_000
    assert (tmp_path / "out" / "figure-sweep.pdf").exists()
    whole = (tmp_path / "out" / "figure-sweep.png").read_bytes()
    assert main(["plot", out, "--field", "contact_area", "--field", "max_pressure"]) == 0
    assert (tmp_path / "out" / "figure-sweep.png").read_bytes() == whole
    drawn = {path.name for path in (tmp_path / "out").glob("figure-sweep-*")}
    assert drawn == {"figure-sweep-contact_area.png", "figure-sweep-max_pressure.png"}
    assert main(["plot", out, "--field", "contact_are"]) == 2
    told = "no such column of sweep.csv (did you mean contact_area?); accepted: converged"
    assert told in capsys.readouterr().err
    assert main(["plot", out, "--view", "0,0,1"]) == 2
    assert "--view: the figure of a sweep shows no places" in capsys.readouterr().err
    (tmp_path / "out" / "sweep.csv").write_text("nothing")
    assert main(["plot", out]) == 2
    assert "damaged" in capsys.readouterr().err


def test_panels_of_a_sweep(tmp_path):
    """Columns that vary by more than rounding, over the component of a vector that varies."""
    columns = "contact_force_x,contact_force_y,max_pressure,contact_area"
    (tmp_path / "sweep.csv").write_text(
        f"friction.mu,load.0.traction,converged,{columns}\n"
        '0.1,"[0.0, -1.0]",True,1e-15,-2.0,3.0,1.0\n0.1,"[0.0, -4.0]",True,-3e-15,-8.0,9.0,1.0\n'
    )
    (tmp_path / "sweep.toml").write_text(
        'title = "Bars"\n[case.units]\nlength = "mm"\nstress = "MPa"\n'
        '[space]\nkinematics = "plane_strain"\n'
    )
    swept = read_sweep(tmp_path)
    assert swept.default == ["contact_force_y", "max_pressure"]
    force, pressure = sweep_figure(swept, swept.default).axes
    assert (force.get_xlabel(), force.get_ylabel()) == ("load.0.traction", "contact force y (N/mm)")
    assert pressure.get_ylabel() == "max pressure (MPa)"
    assert list(force.lines[0].get_xdata()) == [-4.0, -1.0]
    assert force.lines[0].get_label() == "friction.mu = 0.1"


#: A block between a foundation and a wall, or of revolution.
BLOCK = """\
[mesh]
generator = "rectangle"
size = [2.0, 1.0]
cells = [4, 2]
[space]
degree = 2
[material]
young = 1.0
poisson = 0.3
[[fixed]]
on = "left"
displacement = [0.0, "free"]
[[load]]
on = "top"
traction = [0.001, -0.01]
[contact]
on = "bottom"
[friction]
law = "coulomb"
mu = 0.4
"""


def check_rows(path, axis, folder):
    """Compare each row of a sweep with the solution of its case alone."""
    swept = Axis.of(axis)
    for row, value in zip(sweep_of(path, [swept], folder), swept.values, strict=True):
        alone = solve(load_case(path, [f"{swept.key}={value}"]))
        assert row["converged"] == alone.converged
        assert row["contact_force_y"] == pytest.approx(alone.contact_force[1], rel=1e-6)
        assert row["max_pressure"] == pytest.approx(alone.pressure.max(), rel=1e-5)
        assert row["max_displacement"] == pytest.approx(alone.max_displacement, rel=1e-5)


@pytest.mark.parametrize(
    "axis",
    [
        "friction.mu=0.0,0.4",  # the first operator is symmetric
        "fixed.0.displacement=[0.0,'free'],[0.0,0.0]",
        "space.kinematics='axisymmetric','plane_strain'",  # another mesh
        "mesh.adapt.error=0.05,0.02",  # other meshes, each of several solves
        "contact.gap=0.0,0.001",
    ],
)
def test_a_row_is_the_solution_of_its_case(tmp_path, axis):
    """Whatever a sweep keeps of the row before: a mesh, a matrix."""
    (tmp_path / "case.toml").write_text(BLOCK)
    check_rows(tmp_path / "case.toml", axis, tmp_path)


def test_an_overload_is_that_of_its_row(tmp_path):
    """Friction holds the second load alone: limit analysis of the first one's would refuse it."""
    (tmp_path / "case.toml").write_text(to_toml(wall(2, 1.0)))
    most = MU * PRESS
    loads = ",".join(f"[0.0,{-share * most}]" for share in (1.2, 0.99))
    check_rows(tmp_path / "case.toml", f"load.0.body_force={loads}", tmp_path)
