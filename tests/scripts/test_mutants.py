"""The mutants that the core tests have to find fit the sources as they are."""

from pathlib import Path

import pytest

from contact.errors import InputError
from scripts.studies.mutants import MUTANTS, ROOT, Mutant


def test_each_changes_one_line_of_the_sources():
    assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS)
    for mutant in MUTANTS:
        assert (ROOT / mutant.file).read_text().count(mutant.old) == 1, mutant.name
        assert all((ROOT / file).exists() for file in mutant.near), mutant.name


@pytest.mark.parametrize("text", ["", "a = 1\nb = a = 1\n"])
def test_a_text_that_does_not_stand_there_once_is_refused(tmp_path: Path, text: str):
    (tmp_path / "one.py").write_text(text)
    mutant = Mutant("sign", "a sign", "one.py", "a = 1", "a = -1", ())
    with pytest.raises(InputError, match=r"\[value\]"):
        mutant.apply(tmp_path)
    (tmp_path / "one.py").write_text("a = 1\n")
    mutant.apply(tmp_path)
    assert (tmp_path / "one.py").read_text() == "a = -1\n"
