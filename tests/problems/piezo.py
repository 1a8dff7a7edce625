"""Piezoelectric problems that several tests solve."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact import Body, Conductor, Contact, Fixed, Friction, Load
from contact.linear.operator import SparseOperator
from contact.mesh.grid import box, rectangle
from contact.problem.problem import ContactProblem
from contact.problem.residuals import residual_forces
from contact.problem.state import State
from contact.thesis.uzawa import augmentation
from contact.typing import Array
from forms.hencky import Hencky, Linear, Log
from forms.laws import (
    ConstantCoefficient,
    PerfectConductivity,
    ShiftedConductivity,
    SlipCoefficient,
    Truncation,
)
from forms.piezo import Piezo, hexagonal
from tests.problems.mechanics import Affine, affine_vector, constant, flat, turn

YOUNG, POISSON = 58.7102, 0.3912
COUPLING = {"e31": -5.4, "e33": 15.8, "e15": 12.3}
PERMITTIVITY = {"beta11": 8.885e-3 * 916, "beta33": 8.885e-3 * 830}


@dataclass(frozen=True)
class Units:
    """How many units of stress and of potential GPa and GV are; lengths and charges are SI."""

    stress: float = 1.0
    potential: float = 1.0

    def law(self) -> Linear:
        """Return the linear material of Table 8.1."""
        return Linear(YOUNG * self.stress, POISSON)

    def crystal(self, scale: float = 1.0) -> Piezo:
        """Return PZT-5A with the coupling multiplied by `scale`."""
        coupling = {key: scale * value for key, value in COUPLING.items()}
        permittivity = {key: value / self.potential for key, value in PERMITTIVITY.items()}
        return hexagonal(**coupling, **permittivity)


SCALED, SI = Units(), Units(1e9, 1e9)


def pzt(dim: int, units: Units = SCALED, scale: float = 1.0) -> Piezo:
    """Return PZT-5A poled along y in the plane and along z in space."""
    crystal = units.crystal(scale)
    return crystal.in_plane() if dim == 2 else crystal


@dataclass(frozen=True)
class Column:
    """A column pressed by p, at the potential V0 on top, on a conductive foundation."""

    pressure: float = 80.0
    k_e: float = 0.0
    phi_f: float = 0.0
    top: float = 0.0
    height: float = 4.0
    coupling: float = 1.0

    def solution(self) -> tuple[float, float]:
        """Return the strain s and the potential phi_b of the lower end, in GPa, m, GV."""
        law, h = SCALED.law(), self.height
        c = law.bulk + 4 * law.shear / 3
        e, b = self.coupling * COUPLING["e33"], PERMITTIVITY["beta33"]
        matrix = np.array([[c, -e / h], [-e, -b / h - self.k_e]])
        load = np.array([-self.pressure - e * self.top / h])
        load = np.append(load, -b * self.top / h - self.k_e * self.phi_f)
        s, phi = np.linalg.solve(matrix, load)
        return float(s), float(phi)

    def problem(
        self,
        comm: MPI.Comm,
        dim: int,
        units: Units = SCALED,
        *,
        degree: int = 1,
        degrees: float = 0.0,
        lagged: bool = False,
        perfect: bool = False,
        mu: float = 0.0,
        cells: Sequence[int] | None = None,
    ) -> ContactProblem:
        """Return the column, turned together with its foundation and poling axis."""
        size = [2.0, self.height] if dim == 2 else [2.0, 1.0, self.height]
        cells = cells or ([3, 5] if dim == 2 else [2, 2, 4])
        make = rectangle if dim == 2 else box
        domain = make(comm, [0.0] * dim, size, cells, rotation=degrees)
        sides = ("left", "right", "front", "back")[: 2 * (dim - 1)]
        q = turn(dim, degrees)
        exact, _ = self.solution()
        gradient = np.zeros((dim, dim))
        gradient[-1, -1] = exact
        imposed = affine_vector(q @ gradient @ q.T, np.zeros(dim))
        if degrees == 0:  # constrained sideways only, as the column is meant
            fixed = []
            for i, side in enumerate(sides):
                free: list[Affine | None] = [None] * dim
                free[i // 2] = constant(0.0, dim)
                fixed.append(Fixed(side, free))
        else:
            fixed = [Fixed(side, imposed) for side in sides]
        fixed.append(Fixed("top", potential=constant(self.top * units.potential, dim)))
        down = -self.pressure * units.stress * q[:, -1]
        load = Load("top", [constant(f, dim) for f in down])
        q3 = np.eye(3)
        q3[:dim, :dim] = q
        piezo = pzt(dim, units, self.coupling).rotated(q3)
        k_e = self.k_e / units.potential
        psi = PerfectConductivity(k_e) if perfect else ShiftedConductivity(k_e, 250.0)
        conductor = Conductor(psi, self.phi_f * units.potential, lagged=lagged)
        return ContactProblem(
            domain,
            Body(units.law(), fixed, [load], piezo),
            Contact("bottom", flat()),
            Friction(ConstantCoefficient(mu)) if mu else Friction(),
            conductor if self.k_e else None,
            degree=degree,
        )


def example(
    comm: MPI.Comm,
    cells: Sequence[int] = (32, 16),
    load: float = -15.0,
    *,
    law: Hencky | None = None,
    friction: Friction | None = None,
    k_e: float = 1.0,
    phi_f: float = 32.0,
    lagged: bool = False,
    limit: float = np.inf,
    delta: float = 125.0,
    degree: int = 1,
    units: Units = SCALED,
    grounded: bool = True,
) -> ContactProblem:
    """Return Example 8.1 under load * x on top, 8.2 with its law, or a block in space."""
    dim = len(cells)
    zero = constant(0.0, dim)
    traction = [zero] * (dim - 1) + [Affine((load * units.stress, *[0.0] * (dim - 1)))]
    body = Body(
        law or units.law(),
        [Fixed("left", [zero] * dim, zero if grounded else None)],
        [Load("top", traction)],
        pzt(dim, units),
    )
    psi = ShiftedConductivity(k_e / units.potential, delta)
    conductor = Conductor(
        psi, phi_f * units.potential, Truncation(limit * units.potential), lagged=lagged
    )
    if friction is None:
        friction = Friction(SlipCoefficient(0.5, 0.2, 1e5))
    if dim == 2:
        domain = rectangle(comm, [0.0, 0.0], [8.0, 4.0], cells)
    else:
        domain = box(comm, [0.0] * 3, [8.0, 2.0, 4.0], cells)
    return ContactProblem(
        domain, body, Contact("bottom", flat()), friction, conductor if k_e else None, degree
    )


def hencky(xi_0: float = 1.8) -> Log:
    """Return the material of Example 8.2."""
    return Log(YOUNG, POISSON, yield_strain=xi_0)


def potential(problem: ContactProblem, state: State) -> Array:
    """Return the potential at the owned contact nodes."""
    nodal = problem.nodal(state)
    return problem.body.phi_scale * nodal[:, -1]


def first_solve(problem, symmetric=True, compare=True):
    """Return the iterations of a first linear solve, and its difference to the direct one."""
    interface, state = problem.interface, problem.start()
    nodal = problem.nodal(state)
    blocks = augmentation(problem.nodes, problem.scales.c, problem.frictional)
    blocks = blocks + interface.foundation.charge_block(nodal, np.ones(nodal.shape[0]))
    blocks = interface.weighted(blocks, state.x)
    found = []
    for kind in ("lu", "iterative") if compare else ("iterative",):
        operator = SparseOperator(
            problem.body, interface.operator_nodes, symmetric=symmetric, solver=kind
        )
        operator.update("secant", state, blocks)
        increment = operator.solve(-residual_forces(problem, state))
        found.append((increment, operator.counters.linear_iterations))
    comm = problem.comm
    size = comm.allreduce(np.abs(found[0][0]).max(initial=0), MPI.MAX)
    wrong = comm.allreduce(np.abs(found[0][0] - found[-1][0]).max(initial=0), MPI.MAX)
    return found[-1][1], wrong / size
