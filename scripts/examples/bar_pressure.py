"""A bar pressed onto a rigid foundation: solve a case file, write the results, draw the pressure.

`make bar_pressure`, or `python3 -m scripts.examples.bar_pressure`, also under mpirun.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

from contact import Solution, load_case, solve, write_outputs

BAR = Path(__file__).parents[1] / "cases" / "bar.toml"


def main(out: Path = Path("results/bar_pressure"), cells: tuple[int, int] = (128, 32)) -> Solution:
    """Solve Example 7.2 and draw the pressure on the foundation."""
    # Any key of the file can be given another value, as by --set on the command line.
    case = load_case(BAR, [f"mesh.cells={list(cells)}", "solver.method=newton"])
    solution = solve(case)
    if not solution.converged:
        raise SystemExit(f"not converged: {solution.outcome.reason}")
    force = solution.contact_force  # collective: all ranks ask
    write_outputs(solution, out)

    if MPI.COMM_WORLD.rank == 0:
        print(
            f"{solution.outcome.reason}; largest residual {solution.outcome.residuals.largest:.1e}"
        )
        print(f"force on the foundation: {force[0]:.5f}, {force[1]:.5f}")
        draw(out)
    return solution


def draw(out: Path) -> None:
    """Draw pressure, friction and friction bound from contact.csv, one row a contact node."""
    table = np.genfromtxt(out / "contact.csv", delimiter=",", names=True, dtype=None, encoding=None)
    figure, ax = plt.subplots(figsize=(6.6, 3.0), layout="constrained")
    ax.plot(table["x"], table["pressure"], label="pressure")
    ax.plot(table["x"], table["tau"], label="friction")
    ax.plot(table["x"], table["bound"], "k:", lw=0.8, label="friction bound")
    ax.set(xlabel="x", ylabel="stress")
    ax.legend()
    figure.savefig(out / "pressure.png", dpi=130)
    plt.close(figure)
    for status in ("stick", "slip", "open"):
        print(f"{np.count_nonzero(table['status'] == status)} nodes: {status}")


if __name__ == "__main__":
    main()
