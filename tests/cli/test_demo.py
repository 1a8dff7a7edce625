"""The example and the schema that come with the package."""

import json
from pathlib import Path

import pytest

from contact.cli.main import main
from contact.cli.solve import DEMO
from scripts.cases import CASES


def test_the_example_is_solved_with_its_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert DEMO.resolve() == (CASES / "bar.toml").resolve()
    monkeypatch.chdir(tmp_path)
    coarse = ["demo", "--quiet", "--set"]
    assert main([*coarse, "mesh.cells=[8, 2]"]) == 0
    assert json.loads((tmp_path / "contact-demo/summary.json").read_text())["converged"]
    assert (tmp_path / "contact-demo/figure-contact.png").exists()
    assert main([*coarse, "mesh.cells=[16, 4]"]) == 2
    assert "accepted: --overwrite" in capsys.readouterr().err
    assert main([*coarse, "mesh.cells=[16, 4]", "--overwrite"]) == 0


def test_the_schema_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert set(json.loads(capsys.readouterr().out)["required"]) == {"mesh", "material", "contact"}
