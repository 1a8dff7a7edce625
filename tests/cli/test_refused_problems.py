"""Cases that are right, and whose problems have no solution, or none that is found."""

from pathlib import Path

import pytest
from mpi4py import MPI

from contact.cli.main import CONVERGED, NOT_CONVERGED
from tests.cli.running import BAR, PIEZO, refuse, run, write


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
