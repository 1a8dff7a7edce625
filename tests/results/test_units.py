"""Names of units label figures and stand in the summary; nothing is assumed without them."""

import json

from contact import load_case, solve
from contact.cli.main import main
from contact.plot.body import picture
from contact.plot.run import read_run
from contact.results.options import Units
from contact.writing import written
from scripts.cases import CASES

SMALL = ("mesh.cells=[8, 4]", "solver.method=newton")


def test_labels_name_units_where_they_are_given():
    units = Units(length="mm", stress="MPa")
    assert units.label("x", "length") == "x (mm)"
    assert units.label("p", "stress") == "p (MPa)"
    assert units.label("phi", "potential") == "phi"
    assert Units().label("x", "length") == "x"


def test_units_reach_figures_and_summary(tmp_path):
    """Also the figures that are drawn later, from the files."""
    sets = [word for setting in SMALL for word in ("--set", setting)]
    folder = tmp_path / "out"
    arguments = ["solve", str(CASES / "piezo-8-1.toml"), "--out", str(folder), "--quiet"]
    assert main([*arguments, *sets]) == 0
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["units"] == {"length": "m", "stress": "GPa", "potential": "GV", "charge": "C"}
    again = read_run(folder)
    assert picture(again, "potential").label == r"potential $\varphi$ (GV)"
    assert written(solve(load_case(CASES / "piezo-8-1.toml", SMALL))).units == again.units
