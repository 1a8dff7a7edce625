"""A material of your own: Hencky's law with a secant modulus that is given as a function.

`make own_material`, or `python3 -m scripts.examples.own_material`, also under mpirun.
"""

from pathlib import Path

from mpi4py import MPI

from contact import Solution, load_case, solve
from forms.hencky import UserLaw
from forms.monotonicity import check_monotonicity
from forms.ops import Value, exp

BAR = Path(__file__).parents[1] / "cases" / "bar.toml"

YOUNG, POISSON = 1.0, 0.3
SHEAR = YOUNG / (2 * (1 + POISSON))


def modulus(t: Value) -> Value:
    """Return g(t) at t = |dev eps|: half of the shear modulus is lost as the strain grows.

    Functions of `forms.ops` take UFL expressions and NumPy arrays: one formula serves the forms,
    which differentiate it, and the checks.
    """
    return SHEAR * (0.5 + 0.5 * exp(-20.0 * t))


def main(cells: tuple[int, int] = (64, 16)) -> dict[str, Solution]:
    """Compare the bar of linear material with the one that softens."""
    case = load_case(
        BAR,
        [
            f"mesh.cells={list(cells)}",
            "load.0.traction=[0.0, -0.05]",
            "material.law=linear",
            "solver.method=newton",
        ],
    )
    softening = UserLaw(YOUNG, POISSON, modulus=modulus)
    solutions = {"linear": solve(case), "softening": solve(case, law=softening)}
    # Assumption (h1), on the strains that occur: the stress has to grow with the strain.
    report = check_monotonicity(softening, solutions["softening"].max_dev_strain)
    if MPI.COMM_WORLD.rank == 0:
        print(f"stress grows at a rate of at least {report.alpha:.3f}: {report.holds}")
        for name, solution in solutions.items():
            solves = solution.counters.linear_solves
            print(
                f"{name:>10}: converged {solution.converged} with {solves} linear solves, "
                f"largest |dev eps| {solution.max_dev_strain:.4f}"
            )
    return solutions


if __name__ == "__main__":
    main()
