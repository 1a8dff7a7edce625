"""The set-up of any case in one figure: `contact check --plot`."""

import io

import matplotlib
import pytest
from matplotlib.collections import LineCollection

from contact import build_problem, load_case
from contact.cli.main import main
from contact.cli.setup import draw_setup
from scripts.cases import CASES

SMALL = {
    "hertz": ("mesh.contact_size=0.5",),
    "hertz-sphere": (),
    "piezo-column": ("mesh.cells=[2, 2, 2]",),
    "bar": ("mesh.cells=[16, 4]",),
    "compliance-8-4": ("mesh.cells=[24, 4]",),
}


@pytest.mark.parametrize("name", SMALL)
def test_every_case_has_a_picture(name):
    """All that is given stands in the legend, and the dimensions of a plane body beside it."""
    case = load_case(CASES / f"{name}.toml", SMALL[name])
    figure = draw_setup(case, build_problem(case))
    figure.savefig(io.BytesIO(), dpi=30)
    (legend,) = figure.legends
    words = [text.get_text() for text in legend.get_texts()]
    for fixed in case.fixed:
        assert any(word.startswith(f"fixed {fixed.on}: ") for word in words)
    assert "foundation" in words
    if name == "bar":
        assert figure.axes[0].get_title() == r"4 $\times$ 1 mm"
        parts = [c for c in figure.axes[0].collections if isinstance(c, LineCollection)]
        loaded = next(c for c in parts if c.get_label() == "load loaded: traction = [0.0, -0.005]")
        ends = [point[0] for segment in loaded.get_segments() for point in segment]
        assert (min(ends), max(ends)) == (2.0, 4.0)


def test_check_writes_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    before = dict(matplotlib.rcParams)
    assert main(["check", str(CASES / "bar.toml"), "--plot", "--set", "mesh.cells=[8, 2]"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"bar-setup.png", "bar-setup.pdf"}
    assert "# set-up: bar-setup.png" in capsys.readouterr().out
    assert matplotlib.rcParams["font.size"] == before["font.size"]
