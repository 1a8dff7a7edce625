"""A hollow sphere that yields under an inner pressure, beside Hill's closed form.

`python3 -m scripts.studies.hollow_sphere [--out DIR] [--coarse]`: unloading with and without
reversed yield, shakedown, the limit pressure; the page is docs/plasticity.md.

References
----------
Hill, The Mathematical Theory of Plasticity, Clarendon Press (1950), chapter V.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx.mesh import DiagonalType, create_rectangle, locate_entities_boundary
from mpi4py import MPI
from scipy.optimize import brentq

from contact import J2, Body, Contact, Fixed, Load, Problem, Solution, solve_steps
from contact.mesh.domain import from_mesh, revolved
from contact.results.fields import DerivedFields
from contact.typing import Array
from scripts.reporting import Report, append, empty

INNER, OUTER, POISSON = 1.0, 2.0, 0.3

#: Young's modulus and yield stress of the tables (N/mm^2).
YOUNG, YIELD = 200e3, 250.0

#: Outer radii of the plastic zone, and pressures over that of shakedown, in the tables.
FRONTS = (1.25, 1.4151862, 1.5, 1.75)
CYCLED = (0.98, 0.99, 1.01, 1.02, 1.05)

#: Gap of a foundation that the sphere never touches.
FAR = 100.0


@dataclass(frozen=True)
class Hill:
    """The sphere without hardening, under an inner pressure that grows from zero."""

    #: Young's modulus, and the yield stress Y.
    young: float
    limit: float

    @property
    def first(self) -> float:
        """The pressure of first yield; twice that is the limit of shakedown."""
        return 2 / 3 * self.limit * (1 - INNER**3 / OUTER**3)

    @property
    def most(self) -> float:
        """The limit pressure."""
        return float(2 * self.limit * np.log(OUTER / INNER))

    @property
    def reversed(self) -> Hill:
        """The sphere of twice the yield stress: changes on the way back, in Y on both sides."""
        return Hill(self.young, 2 * self.limit)

    def pressure(self, front: float) -> float:
        """Return the pressure at which the plastic zone reaches a radius."""
        inside = 2 * self.limit * np.log(front / INNER)
        return float(inside + 2 / 3 * self.limit * (1 - front**3 / OUTER**3))

    def front(self, pressure: float) -> float:
        """Return the outer radius of the plastic zone; below first yield one less than the inner.

        The elastic field outside of the zone is that of this radius in both cases.
        """
        if pressure <= self.first:
            return float(INNER * (pressure / self.first) ** (1 / 3))
        return float(brentq(lambda c: self.pressure(c) - pressure, INNER, OUTER, xtol=1e-15))

    def displacement(self, r: float, pressure: float) -> float:
        """Return the radial displacement at a radius."""
        c, strain = self.front(pressure), self.limit / self.young
        if r < c:
            inside = r * (1 + 3 * np.log(c / r) - c**3 / OUTER**3)
            return float(
                strain * ((1 - POISSON) * c**3 / r**2 - 2 / 3 * (1 - 2 * POISSON) * inside)
            )
        outside = (1 - 2 * POISSON) * r + (1 + POISSON) * OUTER**3 / (2 * r**2)
        return float(2 / 3 * strain * c**3 / OUTER**3 * outside)

    def hoop(self, r: float, pressure: float) -> float:
        """Return the hoop stress at a radius."""
        c, y = self.front(pressure), self.limit
        if r < c:
            return float(y - 2 * y * np.log(c / r) - 2 / 3 * y * (1 - c**3 / OUTER**3))
        return float(2 / 3 * y * c**3 / OUTER**3 * (OUTER**3 / (2 * r**3) + 1))

    def row(self, pressure: float, unloaded: bool) -> list[float]:
        """Return u(1), u(2) and the hoop stresses there, under a pressure or once it is gone.

        A fall of the pressure is the problem of its rise with 2 Y for Y, as long as the zone of
        reversed flow stays in that of the first.
        """
        values = (self.displacement, self.hoop)
        found = [value(r, pressure) for value in values for r in (INNER, OUTER)]
        if not unloaded:
            return found
        back = self.reversed.row(pressure, unloaded=False)
        return [one - other for one, other in zip(found, back, strict=True)]

    def plastic(self, r: float, pressure: float, unloaded: bool) -> float:
        """Return the equivalent plastic strain at a radius."""
        strain = 2 * (1 - POISSON) * self.limit / self.young
        strain *= max((self.front(pressure) / r) ** 3 - 1, 0.0)
        return strain + (self.reversed.plastic(r, pressure, unloaded=False) if unloaded else 0.0)

    def dissipated(self, pressure: float) -> float:
        """Return the plastic dissipation of half a sphere until a pressure."""
        c, y = max(self.front(pressure), INNER), self.limit
        volume = c**3 * np.log(c / INNER) - (c**3 - INNER**3) / 3
        return float(4 * np.pi * (1 - POISSON) * y**2 / self.young * volume)


def sphere(
    cells: int,
    young: float,
    limit: float,
    *,
    pressure: Callable[[float], float] | None = None,
    displacement: Callable[[float], float] | None = None,
    degree: int = 2,
    element: str = "standard",
) -> Problem:
    """Return the sphere under a pressure, or with a radial displacement of its inside."""
    ends = [[INNER, 0.0], [OUTER, np.pi / 2]]
    grid = create_rectangle(MPI.COMM_SELF, ends, [cells] * 2, diagonal=DiagonalType.crossed)
    where = {"inner": (0, INNER), "outer": (0, OUTER), "base": (1, 0.0)}
    parts = {
        name: locate_entities_boundary(grid, 1, lambda x, i=i, at=at: np.isclose(x[i], at))
        for name, (i, at) in where.items()
    }
    radius, angle = grid.geometry.x[:, :2].T.copy()
    grid.geometry.x[:, :2] = (radius * [np.cos(angle), np.sin(angle)]).T
    supports, loads = [Fixed("base", [None, 0.0])], []
    if pressure is not None:
        loads.append(Load("inner", pressure=1.0, amplitude=pressure))
    if displacement is not None:
        radial = [lambda x, i=i: x[i] / np.hypot(x[0], x[1]) for i in range(2)]
        supports.append(Fixed("inner", radial, amplitude=displacement))
    body = Body(J2(young, POISSON, yield_stress=limit), supports, loads)
    domain = revolved(from_mesh(grid, parts))
    return Problem(domain, body, Contact("outer", FAR), degree=degree, element=element)


def at_the_equator(solution: Solution, step: int) -> list[float]:
    """Return u(1), u(2) and the hoop stresses there, nodal means, at the end of a step."""
    body, state = solution.problem.body, solution.steps[step].state
    stress = DerivedFields(body, state).nodes()["stress"]
    found = []
    for values, space, column in (
        (body.nodal(state.x), body.space, 0),
        (stress.x.array.reshape(-1, 9), stress.function_space, 8),
    ):
        places = space.tabulate_dof_coordinates()
        equator = np.flatnonzero(np.abs(places[:, 1]) < 1e-9)
        order = equator[np.argsort(places[equator, 0])]
        found += [float(values[order[0], column]), float(values[order[-1], column])]
    return found


def most_strained(solution: Solution, step: int) -> tuple[float, float]:
    """Return radius and strain of the point of most equivalent plastic strain after a step."""
    state = solution.steps[step].state
    strain = solution.problem.at(state.time, state.history).commit(state).arrays()
    strain = strain["material.equivalent_plastic_strain"]
    at = int(np.argmax(strain))
    place = solution.problem.body.laws.places[at]
    return float(np.linalg.norm(place)), float(strain[at])


def course(values: Sequence[float], steps: int) -> tuple[Callable[[float], float], list[float]]:
    """Return a function of the time with given values at 1, 2, ..., and the ends of the steps."""
    times = np.arange(len(values) + 1.0)
    ends = np.linspace(0.0, times[-1], steps * len(values) + 1)[1:]
    return lambda t: float(np.interp(t, times, [0.0, *values])), ends.tolist()


def pressed(cells: int, young: float, limit: float, pressure: float, steps: int = 10) -> Solution:
    """Return the sphere that a pressure is put on in so many steps, and taken off in one."""
    amplitude, times = course([pressure], steps)
    problem = sphere(
        cells, young, limit, pressure=lambda t: amplitude(t) if t <= 1 else pressure * (2 - t)
    )
    return converged(problem, [*times, 2.0])


def converged(problem: Problem, times: Sequence[float]) -> Solution:
    """Solve all steps, or stop."""
    solution = solve_steps(problem, list(times))
    if not solution.converged or len(solution.steps) != len(times):
        raise ValueError(f"hollow sphere: {solution.outcome.reason}")
    return solution


def cycled(cells: int, pressure: float, cycles: int) -> Array:
    """Return the plastic dissipation in each half of so many cycles of a pressure and none."""
    amplitude, times = course([pressure, 0.0] * cycles, 1)
    solution = converged(sphere(cells, YOUNG, YIELD, pressure=amplitude), times)
    return np.array([float(step.row["plastic_dissipation"]) for step in solution.steps])


def limit_pressure(cells: int, element: str = "standard") -> float:
    """Return the pressure on the inside once it has moved far enough for the whole to flow."""
    amplitude, times = course([3 * Hill(YOUNG, YIELD).displacement(INNER, 0.999 * LIMIT)], 8)
    problem = sphere(cells, YOUNG, YIELD, displacement=amplitude, element=element)
    solution = converged(problem, times)
    # Of half a sphere, along the axis.
    return abs(float(solution.reaction("inner")[1])) / (np.pi * INNER**2)


LIMIT = Hill(YOUNG, YIELD).most


def unloading(report: Report, cells: int) -> None:
    """Tabulate displacements and residual stresses."""
    exact = Hill(YOUNG, YIELD)
    columns = empty(
        "plastic to", "state", "u(1)", "u(2)", "hoop(1)", "hoop(2)", "u apart", "hoop apart",
        "strain apart", "in reverse", "known",
    )  # fmt: skip
    for front in FRONTS:
        pressure = exact.pressure(front)
        solution = pressed(cells, YOUNG, YIELD, pressure)
        turned = float(solution.steps[-1].row["plastic_dissipation"]) > 0
        for step, state in ((-2, "under pressure"), (-1, "unloaded")):
            found = np.array(at_the_equator(solution, step))
            known = np.array(exact.row(pressure, unloaded=step == -1))
            moved, stressed = np.abs(found[:2] / known[:2] - 1), np.abs(found - known)[2:] / YIELD
            at, strain = most_strained(solution, step)
            strained = abs(strain / exact.plastic(at, pressure, unloaded=step == -1) - 1)
            row = [front, state, *known, moved.max(), stressed.max(), strained]
            append(columns, *row, turned, bool(pressure > 2 * exact.first))
    report.table(
        "sphere",
        "Hollow sphere, radii 1 and 2, under an inner pressure and unloaded: the closed form",
        columns,
        f"E = 200 GPa, nu = 0.3, Y = 250 MPa, no hardening. Apart: largest differences with "
        f"{cells} cells of degree 2 along the radius, of stresses over Y, of the plastic strain at "
        "the quadrature point where it is largest. In reverse: whether the unloading yields, as "
        "computed, and as it does beyond twice the pressure of first yield.",
    )


def shakedown(report: Report, cells: int) -> None:
    """Tabulate the plastic dissipation in cycles beside the limit of shakedown."""
    exact = Hill(YOUNG, YIELD)
    columns = empty(
        "p/p_s", "on", "closed form", "off", "on, 2", "off, 2", "on, 3", "off, 3", "closed form ",
    )  # fmt: skip
    for share in CYCLED:
        pressure = share * 2 * exact.first
        on, *later = cycled(cells, pressure, 3)
        # Strains of a half cycle are those of twice the yield stress, and flow at Y.
        half = exact.reversed.dissipated(pressure) / 2
        append(columns, share, on, exact.dissipated(pressure), *later, half)
    report.table(
        "shakedown",
        "Half a hollow sphere in cycles of a pressure: plastic dissipation (N mm) of half cycles",
        columns,
        f"p_s = {2 * exact.first:.6g} MPa, the limit of shakedown, twice the pressure of first "
        f"yield; {cells} cells along the radius. The second closed form is that of each half cycle "
        "after the first. Near the limit the zone that flows is thinner than a cell.",
    )


def limits(report: Report, sizes: Sequence[int]) -> None:
    """Tabulate limit pressures."""
    columns = empty("element", "cells", "p", "over the limit")
    for name, element in (("P2", "standard"), ("P2, mean", "mean_dilatation")):
        for cells in sizes:
            pressure = limit_pressure(cells, element)
            append(columns, name, cells, pressure, pressure / LIMIT - 1)
    report.table(
        "sphere-limit",
        f"Limit pressure of the hollow sphere beside 2 Y ln(b/a) = {LIMIT:.6g} MPa",
        columns,
        "The inner surface is moved until the whole sphere flows; p is its reaction divided by "
        "the area.",
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables."""
    report = Report.of(__doc__, "plasticity", arguments)
    cells = 4 if report.coarse else 32
    unloading(report, cells)
    shakedown(report, cells)
    limits(report, (4,) if report.coarse else (8, 16, 32))


if __name__ == "__main__":
    main()
