"""What the README shows is what there is."""

import re
import tomllib
from pathlib import Path

from scripts.cases import CASES

README = Path(__file__).parents[2] / "README.md"


def blocks(language: str) -> list[str]:
    """Return the README's code in a language."""
    return re.findall(rf"```{language}\n(.*?)```", README.read_text(), re.DOTALL)


def test_the_case_is_that_of_the_file():
    (shown,) = blocks("toml")
    assert tomllib.loads(shown) == tomllib.loads((CASES / "bar.toml").read_text())


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#:]+)\)", README.read_text()):
        assert (README.parent / target).exists(), target


def test_python_runs(monkeypatch):
    """On a coarse mesh, and together: the second block says only what it adds."""
    code = "\n".join(blocks("python"))
    assert "solve(load_case(" in code
    coarse = code.replace('bar.toml")', 'bar.toml", ["mesh.cells=[16, 4]"])')
    monkeypatch.chdir(README.parent)
    names: dict[str, object] = {}
    exec(compile(coarse, str(README), "exec"), names)
    assert names["solution"].converged
