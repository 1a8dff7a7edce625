"""Cases that are right, and whose problems have no solution, or none that is found.

Input that is absurd rather than wrong: one line, exit status 2, at once.
"""

import time
from pathlib import Path

import pytest
from mpi4py import MPI

from contact.cli.main import CONVERGED, NOT_CONVERGED, main
from contact.model.messages import LIST
from tests.cli.running import BAR, PIEZO, check_identifier, refuse, run, write
from tests.problems import bar


@pytest.mark.core
@pytest.mark.parametrize("name", ["pulled off", "potential of an open contact", "overflow"])
@pytest.mark.parametrize("method", ["uzawa", "newton"])
def test_problem_without_solution(
    name: str, method: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Loads that nothing balances and undetermined potentials are bad input too."""
    if name == "pulled off":
        text = BAR.replace("[0.0, 0.0]", '[0.0, "free"]').replace("-0.001", "0.001")
        words = ["pull the body off"]
    elif name == "overflow":
        text = BAR.replace("-0.001", "-1e149").replace("young = 1.0", "young = 1e-149")
        words = ["numbers overflow"]
    else:
        text = BAR.replace("[[load]]", PIEZO + "[[load]]").replace("gap = 0.0", "gap = 0.5")
        text += "\n[electric]\nlaw = 'perfect'\nk_e = 1.0\n"
        words = ["potential is not determined"]
    text += f"\n[solver]\nmethod = '{method}'\n"
    refuse(write(shared_tmp_path, text), words, capfd)


@pytest.mark.core
@pytest.mark.parallel(2)
@pytest.mark.parametrize("method", ["uzawa", "newton"])
def test_held_nodes_that_conduct_determine_the_potential(
    method: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Where the body rests on supports and is open elsewhere, the current flows through those."""
    text = BAR.replace("[[load]]", PIEZO + "[[load]]").replace("gap = 0.0", 'gap = "0.5*(x>1)"')
    text = text.replace("[[load]]", '[[fixed]]\non = "half"\ndisplacement = [0.0, 0.0]\n[[load]]')
    text += f"\n[electric]\nk_e = 1.0\nphi_f = 2.0\n[solver]\nmethod = '{method}'\n"
    status, lines = run(write(shared_tmp_path, text), capfd=capfd)
    assert status == CONVERGED, lines


PIEZO_PAIR = """
[mesh]
generator = "two_blocks"
lower_size = 0.5
upper_size = 0.4
[material]
young = 1.0
poisson = 0.3
piezo = { e31 = -0.3, e33 = 0.8, e15 = 0.6, beta11 = 1.0, beta33 = 0.9 }
[[fixed]]
on = "lower_bottom"
displacement = [0.0, 0.0]
[[fixed]]
on = "lower_left"
potential = 0.0
[[fixed]]
on = "upper_top"
displacement = [0.0, -0.01]
[contact]
on = "upper_bottom"
against = "lower_top"
"""
CONDUCTS = '[electric]\nlaw = "perfect"\nk_e = 1.0\n'


@pytest.mark.parallel(2)
@pytest.mark.parametrize("name", ["insulated", "apart", "electrode", "conducting"])
def test_each_body_of_a_pair_needs_a_potential(
    name: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A body that touches a grounded one and gives no charge to it may have any potential."""
    text = PIEZO_PAIR
    if name == "apart":
        text = text.replace("-0.01", "0.01") + CONDUCTS
    elif name == "electrode":
        text += '[[electrode]]\non = "upper_top"\n'
    elif name == "conducting":
        text += CONDUCTS
    case = write(shared_tmp_path, text)
    if name == "conducting":
        status, lines = run(case, capfd=capfd)
        assert status == CONVERGED, lines
    else:
        refuse(
            case, ["potential of the component of the mesh about", "0.5) is not determined"], capfd
        )


@pytest.mark.core
@pytest.mark.parallel(2)
def test_not_converged_writes_outputs(
    shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """One outer iteration is too few: exit status 1, and the outputs say so."""
    case = write(shared_tmp_path, BAR.replace("mu = 0.3", 'mu = { law = "slip", rho = 1e4 }'))
    options = ("--set", "solver.method=uzawa", "--set", "solver.max_outer=1")
    status, lines = run(case, *options, capfd=capfd)
    assert status == NOT_CONVERGED
    if MPI.COMM_WORLD.rank == 0:  # --quiet is about progress alone
        assert "contact: stopped: not converged in 1 outer iterations: the " in lines[-1]
    summary = (shared_tmp_path / "out" / "summary.json").read_text()
    assert '"converged": false' in summary
    assert "not converged in 1 outer iterations" in summary


D400, D5000 = "1" + "0" * 400, "9" * 5000
LONG = "k" * 5000

#: Name -> replacements of text in the bar.
FILES = {
    "400 digits as traction": ("-0.005", D400),
    "5000 digits": ("young = 1.0", f"young = {D5000}"),
    "an edge of 1e-20": ("[4.0, 1.0]", "[1e-20, 1e-20]"),
    "ten refinements": ("cells = [8, 2]", "cells = [800, 200]\nrefine = 10"),
    "a line break in a key": ("young", '"a\\nb" = 1\nyoung'),
    "a long key": ("young", f"{LONG} = 1\nyoung"),
    "a long list": ("[0.0, -0.005]", f"[{'0.0, ' * 20000}]"),
    "many parts": (
        "[mesh.parts.loaded]",
        "".join(f'[mesh.parts.p{i}]\nside = "top"\n' for i in range(5000)) + "[mesh.parts.loaded]",
        'on = "bottom"',
        'on = "bottm"',
    ),
    "a region that is not finite": (
        "[mesh.parts.loaded]",
        '[mesh.regions]\nrest = "log(x-1)"\n[mesh.parts.loaded]',
    ),
}

OVERRIDES = {
    "deep": "a" + ".a" * 20000 + "=1",
    "long index": f"load.{D5000}.on=1",
    "line break": "a\nb=1",
}


def case(*changes):
    """Return the text of the bar in which texts are replaced by others: old, new, old, new."""
    text = bar.BAR
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        assert old in text
        text = text.replace(old, new, 1)
    return text


def refused(path, capsys, *arguments):
    """Return the message of a refusal."""
    begin = time.process_time()
    assert main(["check", str(path), *arguments]) == 2
    message = capsys.readouterr().err
    assert time.process_time() - begin < 20
    assert message.startswith("contact: ") and message.count("\n") == 1
    check_identifier(message.rstrip("\n"))
    assert len(message) < 300 + LIST
    return message.rstrip("\n").replace(str(path.parent), "")


@pytest.mark.wording
def test_messages_of_absurd_input(snapshot, tmp_path, capsys):
    path, said = tmp_path / "case.toml", {}
    for name, changes in FILES.items():
        path.write_text(case(*changes))
        said[name] = refused(path, capsys)
    path.write_text(case())
    for name, override in OVERRIDES.items():
        said[f"override: {name}"] = refused(path, capsys, "--set", override)
    snapshot("absurd-input", said)
