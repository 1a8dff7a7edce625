"""A piezoelectric sensor under a cyclic load: its charge over the load has a loop.

`python3 -m scripts.examples.cyclic_sensor`, also under mpirun.
"""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

from contact import load_case, solve

CASE = Path(__file__).parents[1] / "cases" / "piezo-sensor-cyclic.toml"


def main(
    out: Path = Path("results/cyclic_sensor"), cells: Sequence[int] = (32, 16)
) -> tuple[np.ndarray, np.ndarray]:
    """Return the load factor and the electrode's charge after each step, and draw them."""
    case = load_case(CASE, [f"mesh.cells={list(cells)}"])
    assert case.evolution is not None
    solution = solve(case)
    if not solution.converged:
        raise SystemExit(f"not converged: {solution.outcome.reason}")
    factor = case.evolution.amplitudes["cycle"]
    load = np.array([factor(step.row["t"]) for step in solution.steps])
    charge = np.array([step.row["charge_electrode"] for step in solution.steps])
    if MPI.COMM_WORLD.rank == 0:
        out.mkdir(parents=True, exist_ok=True)
        figure, ax = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
        ax.plot(load, charge, "-o", markersize=3)
        ax.set(xlabel="load factor", ylabel="charge of the electrode (C a metre)")
        ax.grid(alpha=0.25)
        figure.savefig(out / "charge.png", dpi=150)
        plt.close(figure)
        loads = f"{load.min():.2f} to {load.max():.2f}"
        print(f"load {loads}: charge {charge.min():.4f} to {charge.max():.4f}; see {out}")
    return load, charge


if __name__ == "__main__":
    main()
