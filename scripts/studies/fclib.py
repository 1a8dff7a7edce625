"""Exchange contact problems with other solvers by files of FCLIB.

`python3 -m scripts.studies.fclib CASE.toml FILE.hdf5` condenses a case onto its contact nodes,
solves it and writes problem and solution; `python3 -m scripts.studies.fclib FILE.hdf5` reads a
problem, of whomever, and solves it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from contact import InputError, build_problem, load_case
from contact.linear.operator import Counters
from contact.methods.convex.fclib import read_fclib, write_fclib
from contact.methods.convex.local import LocalProblem, LocalSolution
from contact.methods.exchange import local_problem
from contact.problem.condensing import condensation


def condensed(path: Path) -> LocalProblem:
    """Return the contacts of a case file, its material as it is at rest."""
    problem = build_problem(load_case(path))
    condenses = condensation(problem, Counters(), "lu")
    small = condenses and condenses.linearise("secant", problem.start())
    if not small:
        raise InputError(f"{path}: cannot be condensed; accepted: some thousand contact nodes")
    return local_problem(small)


def told(problem: LocalProblem) -> LocalSolution:
    """Solve a problem and say how that ended."""
    solution = problem.solve()
    residual = problem.residual(solution.jump, solution.force)
    print(
        f"{problem.coefficient.size} contacts in {problem.dim} dimensions: {solution.message}; "
        f"residual {residual:.1e}; {(solution.force[:, 0] > 0).sum()} closed, force "
        + " ".join(f"{component:.8g}" for component in solution.force.sum(axis=0))
    )
    return solution


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or read a file."""
    command = argparse.ArgumentParser(description=__doc__)
    command.add_argument("source", type=Path, help="a case file, or a file of FCLIB")
    command.add_argument("target", type=Path, nargs="?", help="where to write")
    given = command.parse_args(arguments)
    try:
        if given.target is None:
            told(read_fclib(given.source))
        else:
            problem = condensed(given.source)
            write_fclib(given.target, problem, str(given.source.stem), told(problem))
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
