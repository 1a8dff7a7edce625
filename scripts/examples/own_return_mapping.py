"""A return mapping of your own: rock by Drucker and Prager, pressed by a ball.

`make own_return_mapping`, or `python3 -m scripts.examples.own_return_mapping`, also under mpirun.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from contact import Solution, load_case, solve
from contact.typing import Array
from forms.hencky import Isotropic
from forms.history import Response, isotropic_stiffness


@dataclass(frozen=True)
class DruckerPrager(Isotropic):
    """|s| + friction p <= cohesion, with associated flow; p is the mean stress, tension > 0."""

    friction: float = 0.3
    cohesion: float = 200.0

    def variables(self, size: int) -> Mapping[str, Array]:
        """Return the plastic strain in the reference configuration."""
        return {"plastic_strain": np.zeros(size)}

    def respond(self, strain: Array, variables: Mapping[str, Array], kind: str = "") -> Response:
        """Return stress and plastic strain at the end of a step; the tangent is by differences."""
        size = strain.shape[1]
        elastic, one = isotropic_stiffness(self.bulk, self.shear, size), np.eye(3, size).sum(axis=0)
        trial = (strain - variables["plastic_strain"]) @ elastic
        mean = trial @ one / 3
        s = trial - np.outer(mean, one)
        norm = np.maximum(np.linalg.norm(s, axis=1), 1e-300)
        over = np.maximum(norm + self.friction * mean - self.cohesion, 0.0)
        flow = over / (2 * self.shear + self.bulk * self.friction**2)
        left, end = 1 - 2 * self.shear * flow / norm, mean - self.bulk * self.friction * flow
        # At the cone's apex nothing but the mean stress is left.
        end = np.where(left < 0, self.cohesion / self.friction, end)
        left = np.maximum(left, 0.0)[:, None]
        stress = left * s + np.outer(end, one)
        change = (1 - left) * s / (2 * self.shear) + np.outer((mean - end) / (3 * self.bulk), one)
        new = {"plastic_strain": variables["plastic_strain"] + change}
        return Response(stress, new, dissipation=np.einsum("ni,ni->n", stress, change))


def main(size: float = 0.01) -> Solution:
    """Press a ball into rock, and lift it: the case of steel with another law."""
    steel = Path(__file__).parents[1] / "cases" / "ball-in-steel.toml"
    changes = [f"mesh.contact_size={size}", f"mesh.edge_size={size}"]
    changes.append("evolution={times=[0.0, 1.0, 2.0], steps=[5, 5]}")
    amplitude = "evolution.amplitudes.press={time=[0.0, 1.0, 2.0], value=[0.0, 1.0, 0.0]}"
    case = load_case(steel, [*changes, amplitude])
    solution = solve(case, law=DruckerPrager(200e3, 0.3))
    if MPI.COMM_WORLD.rank == 0:
        for step in solution.steps:
            force, lost = (step.row[name] for name in ("contact_force_y", "plastic_dissipation"))
            print(f"t = {step.state.time:.1f}: force {force:9.3f} N, lost to flow {lost:.2e} N mm")
    return solution


if __name__ == "__main__":
    main()
