"""A piezoelectric bar as a sensor: the charge of its electrode over the load.

`make electrode_charge`, or `python3 -m scripts.examples.electrode_charge`, also under mpirun.
"""

from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI

from contact import load_case, solve
from contact.results.resultants import sensor

SENSOR = Path(__file__).parents[1] / "cases" / "piezo-sensor.toml"


def main(
    cells: tuple[int, int] = (32, 16), loads: Sequence[float] = (2.5, 5.0, 10.0, 20.0)
) -> list[float]:
    """Press the bar harder and harder, and read the electrode each time."""
    charges = []
    for load in loads:
        # The load is a formula: a traction that grows with x.
        case = load_case(
            SENSOR, [f"mesh.cells={list(cells)}", f"load.0.traction=[0.0, '-{load}*x']"]
        )
        solution = solve(case)
        if not solution.converged:
            raise SystemExit(f"load {load}: {solution.outcome.reason}")
        # The electrode is short-circuited, that is, held at the potential 0: its charge is the
        # reaction to that, as a clamp's force is.
        charge = sensor(solution.problem, solution.state, "electrode").charge
        assert charge is not None  # None: the part is no electrode, its potential is free
        charges.append(charge)
        if MPI.COMM_WORLD.rank == 0:
            print(f"load {load:5.1f} x   charge {charge:+.5f}   per load {charge / load:+.6f}")
    return charges


if __name__ == "__main__":
    main()
