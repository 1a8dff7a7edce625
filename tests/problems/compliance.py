"""A column pressed into a compliant layer: its exact solution, and the problem that has it."""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

from contact import Body, Conductor, Contact, Fixed, Layer, Load
from contact.mesh.grid import box, rectangle
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from forms.laws import (
    Compliance,
    PenetrationLaw,
    PotentialFactor,
    ShiftedConductivity,
    StiffnessLaw,
)
from forms.piezo import hexagonal
from tests.problems.mechanics import constant, flat

YOUNG, POISSON = 58.7102, 0.3912
E33, BETA11, BETA33 = 15.8, 8.1387, 7.3746

LINEAR_TO_LIMIT, CONSTANT = Compliance(0.1), PotentialFactor(60.0)


@dataclass(frozen=True)
class LayerColumn:
    """A column on a layer from 0.1 to 0.3, constrained sideways, its top lowered by `push`."""

    push: float
    piezo: bool = False
    p_nu: PenetrationLaw = LINEAR_TO_LIMIT
    h_nu: StiffnessLaw = CONSTANT
    k_e: float = 0.0
    delta: float = 0.0
    phi_f: float = 5.0
    top: float = 2.0
    touch: float = 0.1
    gap: float = 0.3
    height: float = 4.0
    lagged: bool = False

    def potential(self, u_n: float) -> float:
        """Return the potential of the lower end when it has moved by u_n."""
        if not self.piezo:
            return self.phi_f
        strain = (u_n - self.push) / self.height
        k = float(ShiftedConductivity(self.k_e, self.delta)(min(u_n - self.gap, 0.0)))
        capacity = BETA33 / self.height
        return (capacity * self.top - E33 * strain + k * self.phi_f) / (capacity + k)

    def stress(self, u_n: float) -> float:
        """Return the pressure in the column when its lower end has moved by u_n."""
        law = Linear(YOUNG, POISSON)
        strain = (u_n - self.push) / self.height
        coupling = E33 * (self.top - self.potential(u_n)) / self.height if self.piezo else 0.0
        return -(law.bulk + 4 * law.shear / 3) * strain - coupling

    def layer(self, u_n: float) -> float:
        """Return the layer's pressure."""
        factor = float(self.h_nu(np.float64(self.potential(u_n) - self.phi_f)))
        return factor * float(self.p_nu(np.float64(u_n - self.touch)))

    def solution(self) -> tuple[float, float, float, float, str]:
        """Return u_n, potential, layer's and rigid part's pressure, and the regime."""
        high = min(self.gap, 10.0)
        if self.stress(high) - self.layer(high) > 0:
            u_n, regime = high, "rigid"
        else:
            u_n = float(brentq(lambda s: self.stress(s) - self.layer(s), -5.0, high, xtol=1e-15))
            depth = u_n - self.touch
            saturated = float(self.p_nu.derivative(np.float64(depth))) == 0.0
            regime = "open" if depth <= 0 else "saturated" if saturated else "linear"
        layer = self.layer(u_n)
        rest = self.stress(u_n) - layer if regime == "rigid" else 0.0
        return u_n, self.potential(u_n), layer, rest, regime

    def problem(self, dim: int = 2, degree: int = 1) -> ContactProblem:
        zero, h = constant(0.0, dim), self.height
        if dim == 2:
            domain = rectangle(MPI.COMM_WORLD, [0.0, 0.0], [1.0, h], [1, 5])
            sides = {"left": 0, "right": 0}
        else:
            domain = box(MPI.COMM_WORLD, [0.0] * 3, [1.0, 1.0, h], [1, 1, 5])
            sides = {"left": 0, "right": 0, "front": 1, "back": 1}
        lowered = [None] * (dim - 1) + [constant(-self.push, dim)]
        potential = constant(self.top, dim) if self.piezo else None
        fixed = [Fixed("top", lowered, potential)]
        for side, axis in sides.items():
            constrained = [zero if i == axis else None for i in range(dim)]
            fixed.append(Fixed(side, constrained))
        piezo = hexagonal(-5.4, E33, 12.3, BETA11, BETA33) if self.piezo else None
        if piezo is not None and dim == 2:
            piezo = piezo.in_plane()
        endless = not np.isfinite(self.gap)
        thickness = np.inf if endless else self.gap - self.touch
        foundation = flat(self.touch if endless else self.gap)
        # The walls take it up. Without any force the residuals would have no scale.
        squeeze = Load("left", pressure=constant(1.0, dim))
        return ContactProblem(
            domain,
            Body(Linear(YOUNG, POISSON), fixed, [squeeze], piezo),
            Contact("bottom", foundation, Layer(thickness, self.p_nu, self.h_nu, self.lagged)),
            conductor=self.conductor() if self.piezo else None,
            degree=degree,
        )

    def conductor(self) -> Conductor:
        return Conductor(ShiftedConductivity(self.k_e, self.delta), self.phi_f)


#: One column in each regime, elastic and piezoelectric.
REGIMES = {
    "open": LayerColumn(0.05),
    "linear": LayerColumn(0.3),
    "saturated": LayerColumn(0.45),
    "rigid": LayerColumn(0.8),
}
PIEZO_REGIMES = {
    regime: LayerColumn(push, True, h_nu=PotentialFactor(60.0, 3.0, 8.0), k_e=0.7)
    for regime, push in {"open": -0.3, "linear": 0.3, "saturated": 0.4, "rigid": 0.8}.items()
}
