"""Pages of the benchmarks, from the files of a run that has measured a part."""

from pathlib import Path

import pytest

import contact
from scripts.benchmarks.pages import summary, write_memory
from scripts.benchmarks.phases import PHASES

DOCS = Path(__file__).parents[2] / "docs"
SCALING, MEASURED = DOCS / "scaling.md", DOCS / "benchmarks"


def test_tables_of_pages_are_those_of_the_measured_files(tmp_path):
    assert (MEASURED / "summary.md").read_text() == summary(MEASURED)
    page = tmp_path / "scaling.md"
    page.write_text(SCALING.read_text())
    write_memory(MEASURED, page)
    assert page.read_text() == SCALING.read_text()


@pytest.mark.parametrize(("place", "name"), [where for where in PHASES.values() if where[0] != "~"])
def test_what_a_phase_is_measured_by_is_there(place, name):
    """A function that has moved would be a phase of no seconds."""
    assert f"def {name}(" in (Path(contact.__file__).parent / place).read_text()
