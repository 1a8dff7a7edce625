"""Beside plain dolfinx: Newton's method with a penalty for contact, as its tutorials have it.

python3 -m scripts.benchmarks.peer_plain [--out DIR] [--coarse]

Example 7.2 with Hencky's law and a constant coefficient of friction, on one mesh for both. Contact
is kappa <-u_nu>_+, friction Coulomb's law with u_tau/|u_tau| made smooth, the load is applied in
steps where Newton's method does not converge otherwise; the forms are derived by
UFL, and MUMPS solves. The effect of the penalty is measured against the solution of this code on
the same mesh, whose contact conditions hold to its tolerance.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import assemble_matrix, create_matrix
from petsc4py import PETSc

from contact import Solution, build_problem, solve
from contact.problem.problem import ContactProblem
from forms.hencky import Log, stress
from forms.kinematics import embed, strain
from scripts.cases import bar
from scripts.reporting import Report

MU, LOAD = 0.5, -0.05

#: Slip at which friction has 70 % of its bound, a 25th of the largest one (length).
SMOOTH = 1e-4

#: The smallest part of the load that is applied in a step.
SMALLEST = 2.0**-8

#: Newton's steps after which a load step has failed.
MOST_STEPS = 60

#: Of each step of Newton's method: whole ones fail with loads of a hundredth too.
DAMPING = 0.5

#: Residual that is enough, over the first increment as dolfinx 0.9 has it, and in any case.
TOLERANCE, SMALL = 1e-8, 1e-14

#: Penalties, in Young's modulus over the height of the bar.
PENALTIES = 1e1, 1e2, 1e3, 1e4


class Plain:
    """The bar with a penalty, as a user of dolfinx writes it.

    Parameters
    ----------
    problem
        Our problem: its mesh, parts and function space are taken, so that values can be compared.
    kappa
        Contact pressure over penetration (stress/length).
    """

    def __init__(self, problem: ContactProblem, kappa: float) -> None:
        domain, space = problem.domain, problem.body.space
        self.u = u = fem.Function(space)
        v = ufl.TestFunction(space)
        self.load = fem.Constant(domain.mesh, 0.0)
        pressure = kappa * ufl.max_value(-u[1], 0.0)
        friction = MU * pressure * u[0] / ufl.sqrt(u[0] ** 2 + SMOOTH**2)
        form = ufl.inner(stress(Log(1.0, 0.3, yield_strain=0.05), strain(u)), embed(strain(v)))
        # The stress is constant in each cell.
        residual = form * ufl.dx(metadata={"quadrature_degree": 1})
        residual -= self.load * v[1] * domain.ds("loaded")
        residual += (friction * v[0] - pressure * v[1]) * domain.ds("bottom")
        dofs = fem.locate_dofs_geometrical(space, lambda x: x[0] < 1e-9)
        self._constrained = np.add.outer(2 * dofs, [0, 1]).ravel()
        self._conditions = [fem.dirichletbc(np.zeros(2), dofs, space)]
        self._residual, self._left = fem.form(residual), fem.Function(space)
        self._tangent = fem.form(ufl.derivative(residual, u))

    def solve(self) -> tuple[int, int]:
        """Solve; return load steps and Newton's steps, with those of steps that failed."""
        reached, part, load_steps, taken = 0.0, 1.0, 0, 0
        while reached < 1.0:
            before = self.u.x.array.copy()
            self.load.value = LOAD * (reached + part)
            load_steps += 1
            found = self._newton()
            taken += MOST_STEPS if found is None else found
            if found is not None:
                reached += part
                continue
            self.u.x.array[:], part = before, part / 2
            if part < SMALLEST:
                raise RuntimeError("Newton's method does not converge")
        return load_steps, taken

    def _newton(self) -> int | None:
        """Return the steps of a solve with this load; None if it fails."""
        x, forces = self.u.x, self._left.x.petsc_vec
        matrix = create_matrix(self._tangent)
        # MUMPS does not go on once it has met numbers that are none.
        solver = PETSc.KSP().create(matrix.comm)
        solver.setOperators(matrix)
        solver.setType("preonly")
        solver.getPC().setType("lu")
        solver.getPC().setFactorSolverType("mumps")
        increment = matrix.createVecRight()
        size, enough = self._size(), SMALL
        for step in range(MOST_STEPS):
            if size <= enough:
                return step
            matrix.zeroEntries()
            assemble_matrix(matrix, self._tangent, bcs=self._conditions)
            matrix.assemble()
            solver.solve(forces, increment)
            x.array[:] -= DAMPING * increment.array
            size = self._size()
            if step == 0:  # looser than the first residual would be
                enough = max(TOLERANCE * increment.norm(), SMALL)
            if not np.isfinite(size):
                return None
        return MOST_STEPS if size <= enough else None

    def _size(self) -> float:
        """Assemble the residual of equilibrium, and return its norm."""
        left = self._left.x.array
        left[:] = 0.0
        fem.assemble_vector(left, self._residual)
        left[self._constrained] = 0.0
        return float(np.linalg.norm(left))


def compare(ours: Solution, seconds: float, kappa: float) -> dict[str, Any]:
    """Solve with a penalty; return its costs, and how far it is from our solution."""
    problem = ours.problem
    plain = Plain(problem, kappa)
    begin = time.process_time()
    try:
        load_steps, steps = plain.solve()
    except RuntimeError:
        plain.u.x.array[:], load_steps, steps = np.nan, 0, 0
    taken = time.process_time() - begin
    nodal = problem.nodes.jump(plain.u.x.array)
    depth = np.maximum(-nodal[:, 1], 0.0)
    weight = problem.nodes.weight

    def norm(values: np.ndarray) -> float:
        return float(np.sqrt(np.sum(weight * values**2)))

    largest = np.abs(ours.state.x).max()
    moved = np.abs(plain.u.x.array - ours.state.x).max()
    force = np.sum(weight * kappa * depth)
    return {
        "kappa H/E": kappa,
        "load steps": load_steps,
        "Newton's steps": steps,
        "seconds": taken,
        "ours": seconds,
        "ratio": taken / seconds,
        "penetration / max |u|": depth.max() / largest,
        "displacement": moved / largest,
        "contact force": abs(force / np.sum(weight * ours.pressure) - 1),
        "pressure": norm(kappa * depth - ours.pressure) / norm(ours.pressure),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the table."""
    report = Report.of(__doc__, "peer_plain", arguments)
    rows = []
    for n in (8,) if report.coarse else (32, 64):
        case = bar(n, LOAD, 1.0, f"friction.mu={MU}")
        problem = build_problem(case)
        solve(problem, case.solver)  # its forms are compiled
        Plain(problem, 1.0)
        begin = time.process_time()
        ours = solve(problem, case.solver)
        seconds = time.process_time() - begin
        for kappa in PENALTIES[1:3] if report.coarse else PENALTIES:
            rows.append({"cells a unit": n, **compare(ours, seconds, kappa)})
    report.table(
        "peer-plain",
        "Plain dolfinx with a penalty beside this code, on the same meshes",
        rows,
        "Seconds of the processor for the nonlinear solve, forms compiled, one thread. "
        "Penetration and displacement are over the largest displacement. The contact force is "
        "relative, and so is the pressure, in L2 of the contact boundary. This code meets "
        "equilibrium, contact and friction to 1e-8. In plain dolfinx Newton's steps are halved, "
        "for whole steps diverge even with small parts of the load. Those of load steps that fail "
        "are counted, 60 each.",
    )


if __name__ == "__main__":
    main()
