"""A refinement study: distances to the solution on the finest mesh, their orders, a figure.

`make refinement`, or `python3 -m scripts.examples.refinement`, also under mpirun.
"""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import ufl

# before dolfinx: that of the wheels takes the library of MPI
from mpi4py import MPI  # isort: skip
from dolfinx import fem

from contact import load_case, solve

BAR = Path(__file__).parents[1] / "cases" / "bar.toml"


def displacement(n: int) -> fem.Function:
    """Return the displacement of the bar with n cells a unit length."""
    case = load_case(BAR, [f"mesh.cells=[{4 * n}, {n}]", "solver.method=newton"])
    solution = solve(case)
    if not solution.converged:
        raise SystemExit(f"n = {n}: {solution.outcome.reason}")
    return solution.displacement


def carried(coarse: fem.Function, fine: fem.FunctionSpace) -> fem.Function:
    """Return a function on a finer mesh. Where that is nested in the coarse one, exactly so."""
    mesh, made = fine.mesh, fem.Function(fine)
    cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)
    data = fem.create_interpolation_data(fine, coarse.function_space, cells, padding=1e-9)
    made.interpolate_nonmatching(coarse, cells, interpolation_data=data)
    made.x.scatter_forward()
    return made


def norm(field: ufl.core.expr.Expr) -> float:
    """Return the norm in L2 over the body, of all ranks together."""
    square = fem.assemble_scalar(fem.form(ufl.inner(field, field) * ufl.dx))
    return float(np.sqrt(MPI.COMM_WORLD.allreduce(square)))


def main(
    out: Path = Path("results/refinement"), levels: Sequence[int] = (4, 8, 16, 64)
) -> dict[str, list[float]]:
    """Measure all levels against the last, and draw the distances."""
    *coarse, finest = levels
    best = displacement(finest)
    errors: dict[str, list[float]] = {"u": [], "grad u": []}
    for n in coarse:
        error = best - carried(displacement(n), best.function_space)
        errors["u"].append(norm(error) / norm(best))
        errors["grad u"].append(norm(ufl.grad(error)) / norm(ufl.grad(best)))
    if MPI.COMM_WORLD.rank == 0:
        out.mkdir(parents=True, exist_ok=True)
        figure, ax = plt.subplots(figsize=(4.4, 3.2), layout="constrained")
        for name, found in errors.items():
            orders = -np.diff(np.log(found)) / np.diff(np.log(coarse))
            print(f"{name:>6}: errors {np.round(found, 5)}, orders {np.round(orders, 2)}")
            ax.loglog(1 / np.array(coarse), found, "o-", ms=3, label=name)
        ax.set(xlabel="size of the cells", ylabel="relative error in L2")
        ax.legend()
        figure.savefig(out / "errors.png", dpi=130)
        plt.close(figure)
    return errors


if __name__ == "__main__":
    main()
