"""contact sweep: one row a value, resumable, warm-started, over several keys."""

import csv
import shutil
import signal
from pathlib import Path

import pytest
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg

from contact.cli.main import main
from contact.errors import InputError
from contact.methods.signals import Interrupted
from contact.plot.series import DRAWN
from contact.plot.series import _figure as sweep_figure
from contact.plot.series import _read as read_sweep
from contact.plot.style import Look
from contact.sweeping import Axis
from tests.cli.running import MESH
from tests.problems.bar import BAR

ROOT = Path(__file__).parents[2]

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
        rows = list(csv.DictReader(table.open())) if table.exists() else []
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


def test_rows_of_other_values_remain(sweep):
    _, rows = sweep("--over", "friction.mu=0.2,0.4")
    status, more = sweep("--over", "friction.mu=0.3")
    assert status == 0
    assert [row["friction.mu"] for row in more] == ["0.3", "0.2", "0.4"]
    assert more[1:] == rows


def test_numbers_are_those_of_their_values():
    assert Axis.of("friction.mu=0.20,4e-1").values == ("0.2", "0.4")
    assert Axis.of("mesh.cells=[8, 4],[8,2]").values == ("[8, 4]", "[8, 2]")


def test_rows_that_come_later_remain_where_the_sweep_is_ended(sweep, monkeypatch):
    _, rows = sweep("--over", "friction.mu=0.2,0.4")

    def stopped(*_):
        raise Interrupted(signal.SIGTERM)

    monkeypatch.setattr("contact.sweeping._Runner.solve", stopped)
    status, more = sweep("--over", "friction.mu=0.2,0.3,0.4")
    assert status == 128 + signal.SIGTERM
    assert more == rows


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


@pytest.fixture
def swept_mesh(sweep, tmp_path):
    """Return a sweep's options and its mesh file, which has been swept over two values."""
    mesh = tmp_path / "bar.msh"
    shutil.copy(ROOT / "meshes" / "fixtures" / "bar.msh", mesh)
    (tmp_path / "bar.toml").write_text(
        MESH.format(file=mesh) + '[friction]\nlaw = "coulomb"\nmu = 0.1\n'
    )
    status, rows = sweep("--over", "friction.mu=0.1,0.2")
    assert status == 0 and len(rows) == 2
    return mesh


def test_rows_of_another_mesh_are_not_continued(sweep, swept_mesh, tmp_path, capfd):
    """Rows of both would stand side by side."""
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    text = swept_mesh.read_text()
    swept_mesh.write_text(text.replace("$EndNodes", "$EndNodes ", 1))
    for over in ("friction.mu=0.1,0.2,0.3", "friction.mu=0.3"):
        assert sweep("--over", over)[0] == 2
        message = capfd.readouterr().err
        assert "the file mesh.file has changed since the row friction.mu=0.1 was" in message
        assert {path: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
    swept_mesh.write_text(text)
    assert sweep("--over", "friction.mu=0.1,0.2,0.3")[0] == 0


DAMAGED = {
    "cut": ("sweep.csv", lambda data: data[:-60]),
    "empty": ("sweep.csv", lambda data: b""),
    "binary": ("sweep.csv", lambda data: bytes(range(256))),
    "another table": ("sweep.csv", lambda data: b"a,b\n1,2\n"),
    "case cut": ("sweep.toml", lambda data: data[: len(data) // 2]),
}


@pytest.mark.parametrize("kind", DAMAGED)
def test_damaged_files_are_refused_and_kept(sweep, tmp_path, capfd, kind):
    sweep("--over", "friction.mu=0.2,0.4")
    name, damage = DAMAGED[kind]
    path = tmp_path / "out" / name
    path.write_bytes(damage(path.read_bytes()))
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    capfd.readouterr()
    assert main(["sweep", str(tmp_path / "bar.toml"), "--out", str(tmp_path / "out"),
                 "--over", "friction.mu=0.2,0.3", "--quiet"]) == 2  # fmt: skip
    message = capfd.readouterr().err
    assert message.startswith("contact: ") and message.count("\n") == 1
    assert {path: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before


def test_rows_with_other_columns_are_kept(sweep, tmp_path, capfd):
    """Rows that are there would lack a column that is asked for, and a new one have more."""
    sweep("--over", "friction.mu=0.2,0.4")
    table = tmp_path / "out" / "sweep.csv"
    before = table.read_bytes()
    more = ("--columns", "error.energy")
    for values in ("0.2,0.4,0.6", "0.2,0.4"):
        assert sweep("--over", f"friction.mu={values}", *more)[0] == 2
        assert "--columns error.energy: the rows of" in capfd.readouterr().err
        assert table.read_bytes() == before


def test_ranges():
    assert Axis.of("friction.mu=0.1:0.3:3").values == ("0.1", "0.2", "0.3")
    assert Axis.of("mesh.refine=0:2:3").values == ("0", "1", "2")
    assert Axis.of("x=-2:-6:3").values == ("-2", "-4", "-6")
    assert Axis.of("x=0:1:3").values == ("0.0", "0.5", "1.0")
    assert Axis.of("x=0.0:2.0:3").values == ("0.0", "1.0", "2.0")
    assert Axis.of("friction.mu=0,0.1:0.2:2").values == ("0", "0.1", "0.2")
    for wrong in ("0.1:0.2", "a:b:3", "0:1:1", "0:1:2.5", "0:inf:3", "0:1:100000"):
        with pytest.raises(InputError, match=r"--over friction\.mu=.*: given .*; accepted: a:b:n"):
            Axis.of(f"friction.mu={wrong}")


def test_columns_of_the_summary(sweep):
    """A number, a vector, a table of vectors, an entry of one."""
    names = "contact_moment,reactions,reaction_moments.left,volume_ratio,error.energy"
    status, rows = sweep("--over", "friction.mu=0.2,0.4", "--columns", names)
    assert status == 0
    for row in rows:
        assert float(row["max_von_mises"]) > 0 and float(row["dissipation"]) > 0
        balance = float(row["reactions.left_y"]) - float(row["contact_force_y"])
        assert balance == pytest.approx(0.01, rel=1e-6)  # with the load
        found = {"contact_moment", "reaction_moments.left", "volume_ratio_least"}
        assert found | {"error.energy"} <= {*row}
        assert not any("moment" in name and name[-2:] in ("_x", "_0") for name in row)
        assert float(row["volume_ratio_least"]) <= float(row["volume_ratio_largest"])
    _, again = sweep("--over", "friction.mu=0.2,0.4", "--columns", names)
    assert again == rows


def test_columns_that_are_there_stay_as_they_are(sweep):
    over = ("--over", "friction.mu=0.2,0.4", "--columns", "stick_nodes,converged")
    status, rows = sweep(*over)
    assert status == 0
    assert all(row["stick_nodes"].isdigit() and row["converged"] == "True" for row in rows)
    assert sweep(*over) == (0, rows)


def test_a_row_that_is_refused_is_named(sweep, capsys):
    """The rows before it are kept."""
    held = ("--set", "fixed.0.displacement=[0.0, 'free']", "--set", "friction.mu=0.0")
    over = ("--over", "load.0.traction=[0.0, -0.01],[0.0, 0.01]")
    status, rows = sweep(*held, *over)
    assert (status, len(rows)) == (2, 1)
    said = capsys.readouterr().err
    assert said.startswith("contact: load.0.traction=[0.0, 0.01]: ")
    assert "[pulled-off]" in said


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("max_presure", "did you mean max_pressure"),
        ("inner_iterations", "inner_iterations: no number, vector or table of these"),
        ("reason", "reason: no number, vector or table of these in this case's summary.json"),
        ("error.nothing", "(did you mean error.energy?); accepted: error.energy"),
        ("rigid.force", "rigid.force: no number, vector or table of these"),
        ("reactions.lft", "(did you mean reactions.left?)"),
    ],
)
def test_other_columns_are_refused(sweep, tmp_path, capsys, name, words):
    """Nothing is left behind."""
    before = sorted(tmp_path.iterdir())
    assert sweep("--over", "friction.mu=0.2", "--columns", name)[0] == 2
    assert words in capsys.readouterr().err
    assert sorted(tmp_path.iterdir()) == before


def test_tables_in_tables_are_columns(tmp_path, capsys):
    """Of a rigid part its motion and force, a column a component."""
    case = tmp_path / "bar.toml"
    held = '[[fixed]]\non = "left"\ndisplacement = [0.0, 0.0]'
    pushed = '[[rigid]]\non = "left"\ndisplacement = [0.0, 0.0]\nrotation = 0.0'
    assert held in BAR
    case.write_text(BAR.replace(held, pushed))
    over = ["--over", "friction.mu=0.2,0.4", "--columns", "rigid_parts,rigid_parts.left.force"]
    assert main(["sweep", str(case), "--out", str(tmp_path / "out"), *over, "--quiet"]) == 0
    (row, _) = csv.DictReader((tmp_path / "out" / "sweep.csv").open())
    balance = float(row["rigid_parts.left.force_y"]) - float(row["contact_force_y"])
    assert balance == pytest.approx(0.01, rel=1e-6)
    assert "rigid_parts.left.displacement_x" in row and "rigid_parts.left.moment" in row


def test_the_figure_of_a_sweep(sweep, tmp_path, capsys):
    sweep("--over", "load.0.traction.1=-0.002:-0.006:3", "--over", "friction.mu=0.1,0.3")
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
    assert main(["plot", out, "--xlim", "-0.5,1"]) == 2
    assert "--xlim: the figure of a sweep shows no places" in capsys.readouterr().err
    (tmp_path / "out" / "sweep.csv").write_text("nothing")
    assert main(["plot", out]) == 2
    assert "damaged" in capsys.readouterr().err


def test_columns_that_were_asked_for_are_drawn(sweep, tmp_path, capsys):
    """With a dot too; a vector or a table stands for all in it that varies."""
    over = ("--over", "load.0.traction.1=-0.002:-0.006:3", "--set", "material.law=linear")
    assert sweep(*over, "--columns", "reactions.left,error.energy,max_dev_strain")[0] == 0
    swept = read_sweep(tmp_path / "out")
    own = ["reactions.left_x", "reactions.left_y", "max_dev_strain"]
    assert {*own} <= {*swept.default} and not {"kkt", "stick_nodes", "seconds"} & {*swept.default}
    assert [name for name in DRAWN if swept.varies(name)] == swept.default[: -len(own) - 1]
    assert swept.chosen("reactions.left") == swept.chosen("reactions") == own[:2]
    assert swept.chosen("reactions.left_y") == ["reactions.left_y"]
    labels = [ax.get_ylabel() for ax in sweep_figure(swept, own[:2]).axes]
    assert labels == ["reactions: left, $x$", "reactions: left, $y$"]
    fields = [text for name in ("reactions.left", "error.energy") for text in ("--field", name)]
    assert main(["plot", str(tmp_path / "out"), *fields]) == 0
    assert "figure-sweep-reactions.left.png" in capsys.readouterr().out
    assert (tmp_path / "out" / "figure-sweep-error.energy.png").stat().st_size > 10_000
    assert main(["plot", str(tmp_path / "out"), "--field", "reactions.lft"]) == 2
    assert "(did you mean reactions.left_" in capsys.readouterr().err


def test_the_forces_of_several_parts_together_are_a_column(sweep):
    """An elastic support on a list of parts has one name, without the comma between columns."""
    elastic = ("--set", "elastic=[{ on = ['left', 'right'], stiffness = [0.0, 0.01] }]")
    given = ("--over", "load.0.traction=[0.0, -0.005]", *elastic, "--set", "contact.gap=1.0")
    columns = ("--columns", "reactions.left+right,contact_area")
    status, rows = sweep(*given, "--set", "fixed.0.displacement=[0.0, 'free']", *columns)
    assert status == 0
    assert float(rows[0]["reactions.left+right_y"]) == pytest.approx(0.01, rel=1e-6)


def test_labels_of_a_sweep_have_words_and_units(tmp_path):
    """A vector of which a component varies is drawn over it; rounding is no panel."""
    keys, columns = "friction.mu,load.0.traction", "contact_force_x,contact_force_y,max_pressure"
    rows = '0.1,"[0.0, -1.0]",True,{},-2.0,3.0\n0.1,"[0.0, -4.0]",True,{},-8.0,9.0\n'
    case = '[case.units]\nlength = "mm"\nstress = "MPa"\n[space]\nkinematics = "{}"\n'
    (tmp_path / "sweep.csv").write_text(
        f"{keys},converged,{columns}\n" + rows.format("1e-15", "-3e-15")
    )
    for kinematics, unit in (("plane_strain", "N/mm"), ("axisymmetric", "N")):
        (tmp_path / "sweep.toml").write_text('title = "Bars"\n' + case.format(kinematics))
        swept = read_sweep(tmp_path)
        assert [name for name in DRAWN if swept.varies(name)] == ["contact_force_y", "max_pressure"]
        figure = sweep_figure(swept, ["contact_force_y", "max_pressure"])
        force, pressure = figure.axes
        assert force.get_ylabel() == f"contact force, $y$ ({unit})"
        assert pressure.get_ylabel() == "largest pressure (MPa)"
        assert force.get_xlabel() == "load 0: traction, $y$ (MPa)"
        assert list(force.lines[0].get_xdata()) == [-4.0, -1.0]
        assert force.lines[0].get_label() == r"friction: $\mu$ = 0.1"
        assert figure.get_suptitle() == "Bars"
    with pytest.raises(InputError, match=r"--field input: no such column of sweep\.csv; accepted"):
        swept.chosen("input")
    (tmp_path / "sweep.toml").unlink()
    with pytest.raises(InputError, match=r"sweep\.toml: missing or damaged"):
        read_sweep(tmp_path)


@pytest.mark.parametrize("inches", [85 / 25.4, 6.3])
def test_the_legend_of_a_sweep_is_within_its_figure(tmp_path, inches):
    """A line for each of the other keys, in words with units."""
    rows = [f"[0.0, {-k}.0],0.{m},True,{k * m}.0,3.0" for k in (1, 2, 3) for m in (1, 2)]
    lines = ["load.0.traction,friction.mu,converged,max_pressure,contact_area", *rows]
    table = "\n".join(line.replace("[", '"[').replace("]", ']"') for line in lines)
    (tmp_path / "sweep.csv").write_text(f"{table}\n")
    (tmp_path / "sweep.toml").write_text(
        '[case.units]\nlength = "mm"\nstress = "daN/mm²"\n[space]\nkinematics = "plane_strain"\n'
    )
    with rc_context(Look(inches).style):
        figure = sweep_figure(read_sweep(tmp_path), ["max_pressure", "contact_area"])
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        box = figure.get_tightbbox(canvas.get_renderer())
    width, height = figure.get_size_inches()
    assert min(box.x0, box.y0) > -0.02 and box.x1 < width + 0.02 and box.y1 < height + 0.02
