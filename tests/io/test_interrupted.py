"""What a solve that is interrupted leaves."""

import signal
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

from contact.linear.operator import SparseOperator
from contact.methods.report import Record
from contact.solving import SolveInterrupted, solve
from tests.problems.written import block, written

ROOT = Path(__file__).parents[2]


@pytest.mark.parallel
def test_interrupted_solve_keeps_its_results(shared_tmp_path: Path) -> None:
    """A signal on one rank ends the solve on all of them, and what was computed is written."""
    handler = signal.getsignal(signal.SIGINT)

    def press(record: Record) -> None:
        if record.iteration == 1 and MPI.COMM_WORLD.rank == 0:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(SolveInterrupted, match=r"interrupted \(SIGINT\)") as interrupt:
        solve(block(2, solver={"method": "uzawa"}), monitor=press)
    solution = interrupt.value.solution
    assert solution.title == "Block"
    assert not solution.converged
    assert solution.history[-1].iteration == 1
    summary, rows = written(solution, shared_tmp_path)
    assert summary["reason"] == "interrupted (SIGINT)"
    assert len(rows) == 9
    assert signal.getsignal(signal.SIGINT) is handler


@pytest.mark.parallel
@pytest.mark.parametrize(("method", "solves"), [("uzawa", 5), ("penalty", 8)])
def test_a_solve_stops_between_inner_iterations(
    method: str, solves: int, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A signal in a long inner loop is not left waiting for its end."""
    solve_once = SparseOperator.solve

    def press(operator: SparseOperator, *args: Any, **options: Any) -> Any:
        if operator.counters.linear_solves == solves and MPI.COMM_WORLD.rank == 0:
            signal.raise_signal(signal.SIGTERM)
        return solve_once(operator, *args, **options)

    monkeypatch.setattr(SparseOperator, "solve", press)
    with pytest.raises(SolveInterrupted) as interrupt:
        solve(block(2, solver={"method": method}))
    solution = interrupt.value.solution
    assert solution.counters.linear_solves == solves + 1
    assert solution.outcome.signal == signal.SIGTERM
    summary, _ = written(solution, shared_tmp_path)
    assert summary["reason"] == "interrupted (SIGTERM)"
    assert summary["outer_iterations"] == len(solution.history)
