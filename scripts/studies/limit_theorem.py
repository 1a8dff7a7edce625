"""Chapter 6's theorems in numbers: the proven and the observed orders.

Theorem 6.3: the solution x(mu, k_e) of Problem (PV2) tends to that of (PV1) like mu + k_e.
Theorems 6.4 and 6.5: the fixed points (6.29) and (6.30), Algorithms 8 and 6, converge.
Section 1.3.2: the normal compliance law (1.27) tends to Signorini's as it gets stiff.
Section 1.3.3: with the rigid part far enough away, (1.29) is (1.27).

`python3 -m scripts.studies.limit_theorem [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from contact import Case, Contact, GapFunction, Layer, NotConvergedError, build_problem
from contact.problem.problem import ContactProblem
from contact.typing import Array
from forms.laws import Compliance, PotentialFactor
from scripts.cases import TABLE_8_4, on_grid
from scripts.reporting import (
    TWO_COLUMNS,
    Report,
    iterates,
    observed_orders,
    solved,
    subplots,
)
from scripts.studies.error_norms import ProductNorm

#: mu = k_e of the limit: those of the table and some between them.
SMALLEST = TABLE_8_4[-1]
VALUES = tuple(sorted({*TABLE_8_4, 2e-2, 1.5e-3, 2e-4, 6e-5, 4e-6}, reverse=True))

#: The norms, and the theorem's assumptions.
NORMS = (
    "V: |eps(u)|, W: |grad(phi)| in L2(Omega), of the differences; orders are those of the norm "
    "of both, in X."
)
OF_6_3 = (
    "The bound of the proof contains the limit L of phi_L. Here phi_L is the identity, as it is "
    "for any L of at least 32, the largest |phi - phi_F|."
)

#: Where the layer of the pure compliance law is touched, and its stiffnesses and thicknesses.
TOUCH = 0.5
STIFFNESS = tuple(10.0 ** np.arange(2, 8))
THICKNESS = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6)


@dataclass(frozen=True)
class Errors:
    """Distances to a limit over a parameter."""

    #: The varied parameter.
    name: str
    #: Its values, shape (k,).
    parameter: Array
    #: Distances in V (and W), shape (k, 1 or 2).
    norms: Array

    @property
    def total(self) -> Array:
        """Distances in X, shape (k,)."""
        return np.linalg.norm(self.norms, axis=1)

    def order(self, low: float, high: float) -> float:
        """Return the least-squares order over a range of the parameter."""
        inside = (self.parameter >= low) & (self.parameter <= high)
        x, y = np.log(self.parameter[inside]), np.log(self.total[inside])
        return float(np.polyfit(x, y, 1)[0])


def case_of(name: str, cells: Sequence[int], changes: Sequence[str] = ()) -> Case:
    """Return a case file of Examples 8.3 and 8.4 on another mesh, solved to 1e-11."""
    exact = ("solver.tolerance=1e-11", "solver.inner_tolerance=2e-12")
    return on_grid(name, cells, *exact, *changes)


def theorem_6_3(
    layer: bool, cells: Sequence[int] = (96, 16), values: Sequence[float] = VALUES
) -> Errors:
    """Return |x(mu, k_e) - x(0, 0)| for mu = k_e, by Algorithms 6 and 8. Collective."""
    suffix = "-layer" if layer else ""
    limit_case = case_of(f"compliance-8-3{suffix}", cells)
    problem = build_problem(limit_case)
    domain, norm = problem.domain, ProductNorm(problem)
    limit, distances = solved(limit_case, problem).state.x, []
    for value in values:
        changes = [f"friction.mu={value}", f"electric.k_e={value}"]
        case = case_of(f"compliance-8-4{suffix}", cells, changes)
        found = solved(case, build_problem(case, domain=domain))
        distances.append(norm(found.state.x - limit))
    return Errors("mu = k_e", np.array(values), np.array(distances))


def fixed_point_errors(
    name: str, cells: Sequence[int] = (96, 16), changes: Sequence[str] = ()
) -> Array:
    """Return |x_n - x| in X over the outer iterations of a lagged fixed point. Collective."""
    lagged = ["contact.lagged=true", "solver.material_step=secant", *changes]
    case = case_of(name, cells, lagged)
    problem = build_problem(case)
    found, _, outcome = iterates(problem, case.solver, first=0)
    if not outcome.converged:
        raise NotConvergedError(f"{case.title}: {outcome.reason}")
    norm, exact = ProductNorm(problem), found[-1].x
    return np.array([np.linalg.norm(norm(state.x - exact)) for state in found[:-1]])


def with_layer(problem: ContactProblem, c: float, thickness: float = np.inf) -> ContactProblem:
    """Return the problem without friction and charge, on a layer that is touched at TOUCH."""
    gap = TOUCH + (thickness if np.isfinite(thickness) else 0.0)
    foundation = GapFunction(lambda points: np.full(len(points), gap))
    layer = Layer(thickness, Compliance(np.inf), PotentialFactor(c))
    contact = Contact(problem.contacts[0].on, foundation, layer)
    return ContactProblem(problem.domain, problem.description, contact)


def stiffness_limit(
    cells: Sequence[int] = (96, 16), stiffness: Sequence[float] = STIFFNESS
) -> Errors:
    """Return the distance between (1.27) with p = c [r]^+ and Signorini's law over 1/c.

    Rounding in u, multiplied by c, bounds the residuals that can be reached.
    """
    inner = "solver.inner_tolerance=1e-10"
    case = case_of("compliance-8-3", cells, ["solver.tolerance=1e-9", inner])
    problem = build_problem(case)
    norm, limit, distances = ProductNorm(problem), solved(case, problem).state.x, []
    for c in stiffness:
        soft = solved(case, with_layer(problem, c))
        distances.append(norm(soft.state.x - limit))
    return Errors("1/c", 1 / np.array(stiffness), np.array(distances))


def distance_limit(
    cells: Sequence[int] = (96, 16), thickness: Sequence[float] = THICKNESS, c: float = 10.0
) -> tuple[Errors, float]:
    """Return the distance between (1.29) and (1.27) over rho - rho_0, and the penetration.

    The penetration is that of (1.27). A rigid part behind it is never reached.
    """
    case = case_of("compliance-8-3", cells)
    problem = with_layer(build_problem(case), c)
    norm, limit, distances = ProductNorm(problem), solved(case, problem), []
    depth = problem.nodes.maximum(limit.normal_displacement) - TOUCH
    for value in thickness:
        rigid = solved(case, with_layer(problem, c, value))
        distances.append(norm(rigid.state.x - limit.state.x))
    return Errors("rho - rho_0", np.array(thickness), np.array(distances)), depth


def write_table(report: Report, name: str, caption: str, errors: Errors, note: str = "") -> None:
    """Write a table of distances, with the observed orders between neighbours."""
    orders = observed_orders(errors.parameter, errors.total)
    columns = {errors.name: errors.parameter, "in V": errors.norms[:, 0]}
    columns |= {"in W": errors.norms[:, 1], "order": orders}
    report.table(name, caption, columns, note)


#: Lagged fixed points whose errors are shown: label -> case file and overrides.
FIXED_POINTS = {
    "Theorem 6.4, Algorithm 8": ("compliance-8-3-layer", ()),
    "Theorem 6.4, yield strain 0.1": ("compliance-8-3-layer", ("material.yield_strain=0.1",)),
    "Theorem 6.5, mu = k_e = 0.02": (
        "compliance-8-4-layer",
        ("friction.mu=0.02", "electric.k_e=0.02", "electric.lagged=true"),
    ),
    "Theorem 6.5, yield strain 0.1": (
        "compliance-8-4-layer",
        (
            "friction.mu=0.02",
            "electric.k_e=0.02",
            "electric.lagged=true",
            "material.yield_strain=0.1",
        ),
    ),
}


def draw_iterations(curves: Mapping[str, Array]) -> Figure:
    """Draw errors over the iterations of the fixed point."""
    figure, axes = subplots(size=(TWO_COLUMNS, 3.8))
    for label, errors in curves.items():
        axes.semilogy(
            np.arange(1, errors.size + 1),
            errors,
            "o-",
            label=label.replace("mu = k_e = 0.02", r"$\mu = k_e = 0.02$"),
            ms=4,
        )
    axes.set(xlabel=r"iteration $n$", ylabel=r"$|x_n - x|$ in $X$")
    axes.legend()
    return figure


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute, print and draw all. Collective."""
    report = Report.of(__doc__, "limit_theorem", arguments)
    cells = (24, 4) if report.coarse else (96, 16)
    # From the end, which the orders are of.
    some = slice(None, None, -4 if report.coarse else -1)
    values, stiffness, thickness = (every[some][::-1] for every in (VALUES, STIFFNESS, THICKNESS))
    limits = {
        "layer of thickness 0.1": theorem_6_3(True, cells, values),
        "as printed": theorem_6_3(False, cells, values),
    }
    for name, (label, errors) in zip(("layer", "printed"), limits.items(), strict=True):
        caption = f"Theorem 6.3: distance of x(mu, k_e) to x(0, 0), Example 8.4, {label}"
        order = errors.order(SMALLEST, 1e-2)
        write_table(
            report,
            f"theorem-6-3-{name}",
            caption,
            errors,
            f"{NORMS} Order below 0.01: {order:.4f}. {OF_6_3}",
        )

    iterations = {
        label: fixed_point_errors(name, cells, changes)
        for label, (name, changes) in FIXED_POINTS.items()
    }
    caption = "Theorems 6.4 and 6.5: errors of Algorithms 8 and 6, layer and charge lagged"
    report.figure("figure-theorems-6-4-6-5", caption, draw_iterations(iterations), iterations)

    stiff = stiffness_limit(cells, stiffness)
    caption = "The normal compliance law (1.28) tends to Signorini's as c grows"
    write_table(report, "compliance-stiffness", caption, stiff, NORMS)

    far, depth = distance_limit(cells, thickness)
    caption = "Law (1.29) tends to (1.27), c = 10, as the rigid part moves away"
    report.table(
        "compliance-distance",
        caption,
        {far.name: far.parameter, "in V": far.norms[:, 0], "in W": far.norms[:, 1]},
        f"Without a rigid part the layer is pressed in by {depth:.4f}; a rigid part farther away "
        "than that is not touched.",
    )


if __name__ == "__main__":
    main()
