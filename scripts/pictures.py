"""The pictures of docs/images that runs of the program draw.

`python3 -m scripts.pictures [--out docs/images] [NAME ...]` draws those of some runs, or all, anew.
`scripts.studies.mindlin` draws two-bodies-loop.png; architecture.svg is drawn by hand.
"""

from __future__ import annotations

import argparse
import re
import runpy
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path

from contact.cli.main import main as contact
from scripts.cases import CASES

DOCS = Path(__file__).parents[1] / "docs"

#: A file that a page lets its reader write: its name, its text.
_FILE = re.compile(r"^<!-- file: (\S+) -->\n+^```\w+\n(.*?)^```", re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Drawn:
    """A run whose figures are pictures of the pages."""

    #: Name of a case file, or the page that has the files of the run.
    case: str
    #: Picture -> figure of the run.
    pictures: Mapping[str, str]
    #: Values that replace those of the case.
    changes: tuple[str, ...] = ()
    #: Arguments of `contact plot`, for figures that a run does not draw by itself.
    plot: tuple[str, ...] = ()

    def prepare(self) -> str:
        """Make the case in the working folder and return its path."""
        if not self.case.endswith(".md"):
            return str(CASES / f"{self.case}.toml")
        files = _FILE.findall((DOCS / self.case).read_text())
        for name, text in files:
            Path(name).write_text(text)
            if name.endswith(".py"):
                runpy.run_path(name)
        return next(name for name, _ in files if name.endswith(".toml"))

    def draw(self, out: Path) -> None:
        """Run the case and write the pictures."""
        with tempfile.TemporaryDirectory() as folder, chdir(folder):
            changes = [word for change in self.changes for word in ("--set", change)]
            case = self.prepare()
            assert contact(["solve", case, "--out", "run", "--plot", "--quiet", *changes]) == 0
            assert not self.plot or contact(["plot", "run", *self.plot]) == 0
            for picture, figure in self.pictures.items():
                shutil.copy(Path("run") / figure, out / picture)


RUNS = {
    "cylinder": Drawn(
        "cylinder-on-block", {"cylinder-contact.png": "figure-contact.png"}, ("space.degree=2",)
    ),
    "error": Drawn(
        "bar", {"error-field.png": "figure-error.png"}, ("mesh.cells=[64, 16]",), ("--field=error",)
    ),
    "evolution": Drawn(
        "fretting",
        {
            "evolution-loop.png": "figure-loop.png",
            "evolution-zones.png": "figure-zones.png",
            "evolution-body.png": "figure-deformed.png",
        },
        ("evolution.steps=[16, 8, 16, 16]",),
    ),
    "tutorial": Drawn(
        "tutorial.md",
        {
            "tutorial-contact.png": "figure-contact.png",
            "tutorial-deformed.png": "figure-deformed.png",
        },
    ),
    "blocks": Drawn(
        "two-blocks",
        {
            "two-bodies-blocks.png": "figure-deformed.png",
            "two-bodies-sides.png": "figure-contact.png",
        },
    ),
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the pictures of the runs named, or of all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=DOCS / "images")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(RUNS))
    given = parser.parse_args(arguments)
    out = given.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    for name in given.names or RUNS:
        RUNS[name].draw(out)
        print(*RUNS[name].pictures, flush=True)


if __name__ == "__main__":
    main()
