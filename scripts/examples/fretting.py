"""Load steps in Python: a block is pressed, then moved back and forth; the history of friction.

`python3 -m scripts.examples.fretting`, also under mpirun.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from contact import build_problem, evolve, load_case

CASE = Path(__file__).parents[1] / "cases" / "fretting.toml"


def main(cells: Sequence[int] = (64, 32), steps: int = 8) -> np.ndarray:
    """Return time, tangential contact force and share of sliding nodes, a row a step."""
    case = load_case(CASE, [f"mesh.cells={list(cells)}"])
    problem = build_problem(case)
    times = [stage + (k + 1) / steps for stage in range(6) for k in range(steps)]
    rows = []
    for state in evolve(problem, times, case.solver):
        # The state is a value: the problem at its time, with the history of friction, reads it.
        step = problem.at(state.time, state.history)
        interface, nodal = step.interface, step.nodal(state)
        force = [step.nodes.sum(component) for component in state.forces.friction.T]
        slipped = interface.slip_length(nodal) > 1e-9
        touching = state.forces.pressure > 0
        share = step.nodes.sum(slipped & touching) / step.nodes.sum(touching)
        rows.append((state.time, force[0], share))
        if step.comm.rank == 0:
            print(f"t = {state.time:.3f}: force {force[0]:+.5f}, {share:4.0%} of the contact slips")
    return np.array(rows)


if __name__ == "__main__":
    main()
