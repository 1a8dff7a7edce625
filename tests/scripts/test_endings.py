"""The scripts that look for false or disorderly ends: a few of their cases, and that they look."""

import subprocess
import sys

import pytest

from scripts.studies import mutations, random_ends, units
from tests.problems.processes import CLONE, environment


def test_damaged_cases_end_in_order(tmp_path):
    """In a process of its own: threads that other tests have left may hold locks in its forks."""
    command = [sys.executable, "-m", "scripts.studies.mutations", "--count", "8"]
    done = subprocess.run(
        [*command, "--out", str(tmp_path)],
        cwd=CLONE,
        env=environment(),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "endings:" in done.stdout


@pytest.mark.parametrize(
    ("status", "said", "found"),
    [
        (0, "", ""),
        (1, "contact: not converged", ""),
        (2, "contact: mesh.size: given 0", ""),
        (2, "contact: one\ncontact: two", "2 messages"),
        (2, "", "0 messages"),
        (2, f"contact: {'k' * 3000}", "a message too long"),
        (1, "Traceback (most recent call last)", "a traceback"),
        (70, "contact: this is a fault", "status 70"),
        ("too long", "", "status too long"),
        (-11, "", "status -11"),
    ],
)
def test_disorderly_ends_are_seen(status, said, found):
    assert mutations.fault(status, said).startswith(found)
    assert bool(mutations.fault(status, said)) == bool(found)


def test_random_ends_hold(tmp_path, capsys):
    assert random_ends.main(["--count", "2", "--out", str(tmp_path)]) == 0
    assert "endings:" in capsys.readouterr().out


def test_units_agree(tmp_path):
    assert units.main(["--coarse", "--methods", "newton", "--out", str(tmp_path)]) == 0
