"""A friction coefficient and an obstacle of your own: classes with a few methods each.

`make own_contact`, or `python3 -m scripts.examples.own_contact`, also under mpirun.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from contact import Solution, load_case, solve
from forms.ops import Value, exp

BAR = Path(__file__).parents[1] / "cases" / "bar.toml"


@dataclass(frozen=True)
class Weakening:
    """mu(s) = kinetic + (static - kinetic) exp(-s / length): see `FrictionCoefficient`."""

    static: float
    kinetic: float
    length: float

    @property
    def maximum(self) -> float:
        """Upper bound mu*."""
        return self.static

    @property
    def lipschitz(self) -> float:
        """Lipschitz constant, reached at zero slip."""
        return (self.static - self.kinetic) / self.length

    def __call__(self, slip: Value) -> Value:
        """Return mu at the slip |u_tau|."""
        return self.kinetic + (self.static - self.kinetic) * exp(-slip / self.length)

    def derivative(self, slip: Value) -> Value:
        """Return d mu / d|u_tau|."""
        return -self.lipschitz * exp(-slip / self.length)


@dataclass(frozen=True)
class Waves:
    """The foundation y = -depth (1 - cos(2 pi x / length)): see `Obstacle`."""

    depth: float
    length: float

    #: The contact direction is that of the foundation, and the gaps are those of a shape.
    direction = "foundation"
    is_shape = True

    def measure(self, points: np.ndarray, body_normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return directions into the foundation, shape (n, d), and the gaps along them."""
        top = -self.depth * (1 - np.cos(2 * np.pi * points[:, 0] / self.length))
        down = np.broadcast_to([0.0, -1.0], points.shape).copy()
        return down, points[:, 1] - top


def main(cells: tuple[int, int] = (64, 16)) -> Solution:
    """Press the bar onto the crests of the waves."""
    case = load_case(BAR, [f"mesh.cells={list(cells)}", "solver.method=newton"])
    solution = solve(case, coefficient=Weakening(0.5, 0.3, 1e-3), foundation=Waves(2e-3, 1.0))
    # Nodal quantities are those of the nodes of this rank; sums are over all.
    local = np.array([np.count_nonzero(solution.status != "open"), solution.status.size])
    touching, nodes = MPI.COMM_WORLD.allreduce(local)
    if MPI.COMM_WORLD.rank == 0:
        print(f"converged: {solution.converged}, {solution.outcome.reason}")
        print(f"{touching} of {nodes} nodes touch")
    return solution


if __name__ == "__main__":
    main()
