"""Wrong command lines, and PETSc's options."""

from pathlib import Path

import pytest
from petsc4py import PETSc

from contact.cli.main import BAD_INPUT
from tests.cli.running import BAR, check_identifier, refuse, run, write


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--set", "material.young=-1"], ["material.young", "-1"]),
        (["--set", "load.3.on=top"], ["load", "3"]),
        (["--out", ""], ["--out", "no folder"]),
    ],
)
def test_wrong_command_line(
    options: list[str],
    words: list[str],
    shared_tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Options and overrides are checked as the file is."""
    status, lines = run(write(shared_tmp_path, BAR), *options, capfd=capfd)
    assert status == BAD_INPUT
    assert len(lines) == 1
    assert all(word in lines[0] for word in words), lines
    check_identifier(lines[0])


@pytest.mark.parametrize(
    ("option", "value", "method"),
    [
        ("contact_ksp_type", "foo", "newton"),
        ("contact_pc_factor_mat_solver_type", "foo", "uzawa"),
        ("penalty_snes_type", "foo", "penalty"),
    ],
)
def test_wrong_petsc_options(
    option: str, value: str, method: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """What PETSc does not know is bad input, and nothing is left in its options."""
    options = PETSc.Options()
    options[option] = value
    before = set(options.getAll())
    try:
        case = write(shared_tmp_path, BAR + f"[solver]\nmethod = '{method}'\n")
        refuse(case, ["PETSc", value, option.split("_")[0]], capfd)
        assert set(options.getAll()) == before
    finally:
        options.delValue(option)
