"""Hertz's problems: cylinder (Example 7.1) and sphere on a rigid plane, and their closed forms.

`python3 -m scripts.thesis.hertz [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact import Case, Solution, build_problem, load_case
from contact.mesh.geometry import area
from contact.plot.body import draw_plane, picture
from contact.results.contact_nodes import contact_table
from contact.typing import Array
from scripts.cases import CASES
from scripts.reporting import TWO_COLUMNS, Report, run_of, solved, subplots
from scripts.studies.hertz_exact import line_contact


@dataclass(frozen=True)
class Cylinder:
    """Hertz's line contact of an elastic cylinder with a rigid plane."""

    #: Line load of the whole cylinder (force/length).
    load: float
    young: float = 2000.0
    poisson: float = 0.3
    radius: float = 8.0

    @property
    def half_width(self) -> float:
        """Return b."""
        return line_contact(self.load, self.young / (1 - self.poisson**2), self.radius)[0]

    @property
    def peak(self) -> float:
        """Return p_0."""
        return line_contact(self.load, self.young / (1 - self.poisson**2), self.radius)[1]

    def pressure(self, x: Array) -> Array:
        """Return p_0 sqrt(1 - x^2/b^2)."""
        return self.peak * np.sqrt(np.maximum(1 - (x / self.half_width) ** 2, 0.0))


@dataclass(frozen=True)
class Sphere:
    """Hertz's point contact of an elastic sphere with a rigid plane."""

    force: float = 100.0
    young: float = 1000.0
    poisson: float = 0.3
    radius: float = 10.0

    @property
    def contact_radius(self) -> float:
        """Return a = (3 F R / (4 E*))^(1/3)."""
        modulus = self.young / (1 - self.poisson**2)
        return float(np.cbrt(3 * self.force * self.radius / (4 * modulus)))

    @property
    def peak(self) -> float:
        """Return p_0 = 3 F / (2 pi a^2)."""
        return 3 * self.force / (2 * np.pi * self.contact_radius**2)

    @property
    def approach(self) -> float:
        """Return delta = a^2/R, the approach of infinitely distant points."""
        return self.contact_radius**2 / self.radius

    def axial(self, depth: float) -> float:
        """Return Hertz's approach of the point of the axis at a depth: delta - u_z(depth).

        u_z is the integral of the axial strain from there to infinity.
        """
        zeta = np.geomspace(depth / self.contact_radius, 1e5, 20001)
        axial = -1 / (1 + zeta**2)
        radial = -(1 + self.poisson) * (1 - zeta * np.arctan(1 / zeta)) - axial / 2
        strain = self.peak * (axial - 2 * self.poisson * radial) / self.young
        # Beyond, the strain falls like 1/zeta^2.
        integral = np.trapezoid(strain, zeta) + strain[-1] * zeta[-1]
        return self.approach + self.contact_radius * float(integral)


def cylinder(
    load: float,
    *,
    mu: str = "0.0",
    direction: str = "foundation",
    shape: str = "quarter_disc",
    fineness: float = 20.0,
    degree: int = 1,
) -> Case:
    """Return Example 7.1 with another load, friction, contact direction and shape."""
    hertz = Cylinder(load)
    b = hertz.half_width
    changes = [
        f"title=Hertz: {shape}, load {load:g}, mu = {mu}, direction {direction}",
        f"mesh.contact_size={b / fineness}",
        f"mesh.contact_width={1.25 * b}",
        f"mesh.size={min(0.8, 9.6 / fineness)}",
        f"contact.direction={direction}",
        f"space.degree={degree}",
    ]
    if mu != "(7.16)":
        changes.append(f"friction.mu={mu}")
    width = 2 * hertz.radius
    if shape != "quarter_disc":
        changes += [f"mesh.generator={shape}", "fixed.0.on=top"]
    if shape == "disc":
        # The platen touches the arc within 30 degrees of the top.
        changes.append("mesh.top_angle=30.0")
        width = 2 * hertz.radius * np.sin(np.deg2rad(30.0))
    changes.append(f"load.0.traction=[0.0, {-load / width}]")
    return load_case(CASES / "hertz.toml", changes)


def sphere(fineness: float, degree: int = 1) -> Case:
    """Return the sphere with a number of elements on Hertz's contact radius."""
    a = Sphere().contact_radius
    return load_case(
        CASES / "hertz-sphere.toml",
        [
            f"mesh.contact_size={a / fineness}",
            f"mesh.contact_width={1.15 * a}",
            f"mesh.size={min(2.0, 12.0 / fineness)}",
            f"space.degree={degree}",
        ],
    )


@dataclass(frozen=True)
class Found:
    """Hertz's quantities of a contact solution."""

    #: Radius where a line through p^2 over r^2, of the outer half of the nodes in contact,
    #: vanishes.
    edge: float
    #: Radius of Hertz's pressure with the same second moment.
    moment: float
    #: The largest nodal pressure.
    peak: float
    #: Pressure at r = 0 of a line through p^2 over r^2 of the inner half of the nodes, free of the
    #: noise of the nodal values on irregular meshes.
    centre: float
    #: |contact force - load|/load, vertical.
    force_error: float
    #: Spacing of the contact nodes.
    h: float


def contact_of(solution: Solution, load: float) -> Found:
    """Measure contact radius, peak pressure and force; the axis is x = 0. Collective."""
    nodes = solution.problem.nodes
    d = nodes.dim
    pressure, points = nodes.gather(solution.pressure), nodes.gather(nodes.points)
    weight = nodes.gather(nodes.weight)
    r = np.linalg.norm(points[:, : d - 1], axis=1)
    touching = pressure > 1e-6 * pressure.max()
    radius = r[touching].max()
    outer = touching & (r > radius / 2)
    slope, offset = np.polyfit(r[outer] ** 2, pressure[outer] ** 2, 1)
    inner = r <= radius / 2
    centre = np.polyfit(r[inner] ** 2, pressure[inner] ** 2, 1)[1]
    # Hertz's pressure has <r^2> = b^2/4 in the plane and 2 a^2/5 in 3-D.
    factor = 4.0 if d == 2 else 2.5
    moment = np.sqrt(factor * (weight @ (pressure * r**2)) / (weight @ pressure))
    force = -solution.contact_force[-1]
    h = weight[touching].sum() / np.count_nonzero(touching)
    return Found(
        float(np.sqrt(-offset / slope)),
        float(moment),
        float(pressure.max()),
        float(np.sqrt(centre)),
        abs(force - load) / load,
        float(h if d == 2 else np.sqrt(h)),
    )


def solved_and_measured(case: Case, load: float) -> tuple[Solution, Found]:
    """Solve a case with the traction scaled to the load on the polygonal body. Collective."""
    domain = case.mesh.build(MPI.COMM_WORLD)
    first = case.load[0]
    scaled = [0.0] * (domain.dim - 1) + [-load / area(domain, "top")]
    traction = tuple(type(first.traction[0])(value) for value in scaled)
    loads = (first.model_copy(update={"traction": traction}), *case.load[1:])
    case = case.model_copy(update={"load": loads})
    solution = solved(case, build_problem(case, domain=domain))
    return solution, contact_of(solution, load)


#: Load, mu, direction and shape of the rows of the table of cylinders.
CYLINDERS = (
    (16.0, "0.0", "foundation", "quarter_disc"),
    (160.0, "0.0", "foundation", "quarter_disc"),
    (160.0, "0.0", "foundation", "half_disc"),
    (160.0, "0.0", "foundation", "disc"),
    (160.0, "0.5", "foundation", "quarter_disc"),
    (1600.0, "0.0", "foundation", "quarter_disc"),
    (1600.0, "0.0", "body", "quarter_disc"),
    (1600.0, "0.5", "foundation", "quarter_disc"),
    (1600.0, "0.5", "body", "quarter_disc"),
    (1600.0, "(7.16)", "foundation", "quarter_disc"),
    (1600.0, "(7.16)", "body", "quarter_disc"),
)


def cylinders(report: Report, fineness: float) -> Mapping[tuple[object, ...], Solution]:
    """Make the table of cylinders; return its solutions by row. Collective."""
    rows, solutions = [], {}
    for load, mu, direction, shape in CYLINDERS:
        hertz = Cylinder(load)
        case = cylinder(load, mu=mu, direction=direction, shape=shape, fineness=fineness)
        part = load / 2 if shape == "quarter_disc" else load
        solution, found = solved_and_measured(case, part)
        solutions[load, mu, direction, shape] = solution
        rows.append(
            {
                "shape": shape,
                "load": load,
                "mu": mu,
                "direction": direction,
                "b/h": hertz.half_width / found.h,
                "b/b_H (edge)": found.edge / hertz.half_width,
                "b/b_H (moment)": found.moment / hertz.half_width,
                "p_0/p_H": found.peak / hertz.peak,
                "force error": found.force_error,
                "residual": solution.outcome.residuals.largest,
            }
        )
    report.table(
        "hertz-cylinder",
        "Cylinder on a plane (Example 7.1): half-width and peak pressure over Hertz's",
        rows,
        "Example 7.1 is the load 1600. There b/R is 0.34, and the solution of linear elasticity "
        "is no longer Hertz's; with the small loads it is. (edge) is where p^2, extrapolated in "
        "x^2, vanishes. (moment) is the half-width of the elliptic pressure with the same second "
        "moment. Both agree for Hertz's pressure. Friction of a cylinder that is pressed once on "
        "a rigid plane narrows the contact; Hertz's theory has no friction.",
    )
    return solutions


def figure_7_2(report: Report, solutions: Mapping[tuple[object, ...], Solution]) -> None:
    """Draw the counterpart of Figure 7.2 from solutions of `cylinders`. Collective."""
    hertz = Cylinder(1600.0)
    shown = {
        "no friction": (1600.0, "0.0", "foundation", "quarter_disc"),
        "no friction, body's normal": (1600.0, "0.0", "body", "quarter_disc"),
        "(7.16), rho = 1e4": (1600.0, "(7.16)", "foundation", "quarter_disc"),
        "(7.16), body's normal": (1600.0, "(7.16)", "body", "quarter_disc"),
    }
    tables = {label: contact_table(solutions[key].contact) for label, key in shown.items()}
    run = run_of(solutions[shown["(7.16), rho = 1e4"]])
    if run is None:
        return
    deformed = picture(run, "von_mises")
    width, peak = hertz.half_width, hertz.peak
    x = np.linspace(0, 1.25 * width, 400)
    data: dict[str, Sequence[float]] = {"x": x, "Hertz": hertz.pressure(x)}
    figure, axes = subplots(2, 1, size=(TWO_COLUMNS, 5.2), sharex=True)
    axes[0].plot(x / width, hertz.pressure(x) / peak, "k--", lw=1.0, label="Hertz")
    for label, table in tables.items():
        near = table["x"] <= x[-1]
        where = table["x"][near]
        (line,) = axes[0].plot(where / width, table["pressure"][near] / peak, label=label)
        data |= {f"x, {label}": where, f"pressure, {label}": table["pressure"][near]}
        if np.any(table["bound"] > 0):
            colour = line.get_color()
            axes[1].plot(where / width, table["tau"][near] / peak, color=colour, label=label)
            bound = f"{label}: bound $-s$"
            limit = -table["bound"][near] / peak
            axes[1].plot(where / width, limit, ":", color=colour, label=bound)
            data |= {f"tau, {label}": table["tau"][near], f"bound, {label}": table["bound"][near]}
    axes[0].set_ylabel(r"$-\sigma_\nu/p_H$")
    axes[1].set_xlabel(r"$x/b_H$ along $\Gamma_3$")
    axes[1].set_ylabel(r"$-\sigma_\tau\cdot t/p_H$")
    for ax in axes:
        ax.legend()
    report.figure(
        "figure-7-2a",
        "Figure 7.2 (a): pressure and tangential stress on Gamma_3, Hertz's solution beside",
        figure,
        data,
        "Example 7.1. Hertz's solution holds for small contact widths and without friction; "
        "friction narrows the contact and raises the pressure. Axes are in units of Hertz's half "
        "width b_H and largest pressure p_H; the numbers are in the units of the case.",
    )
    report.figure(
        "figure-7-2b",
        "Figure 7.2 (b): deformed quarter cylinder, von Mises stress",
        draw_plane(deformed),
        {"von Mises": [float(deformed.skin["values"].max())]},
        "Coulomb friction (7.16) with rho = 1e4; the contact direction is the normal of the "
        "foundation. The file of numbers has the largest von Mises stress.",
    )


def approach(solution: Solution) -> float:
    """Return how far the middle of the cut, at the depth R, has come down. Collective."""
    body, hertz = solution.problem.body, Sphere()
    points = body.space.tabulate_dof_coordinates()[: len(body.free)]
    u = solution.state.x[: body.owned].reshape(-1, body.block_size)
    middle = np.linalg.norm(points - [0.0, 0.0, hertz.radius], axis=1) < 1e-6 * hertz.radius
    return float(body.comm.allreduce(-u[middle, 2].sum(), op=MPI.SUM))


def spheres(report: Report, levels: Sequence[tuple[float, int]]) -> None:
    """Make the table of spheres over (fineness, degree). Collective."""
    hertz = Sphere()
    rows = []
    for fineness, degree in levels:
        solution, found = solved_and_measured(sphere(fineness, degree), hertz.force / 4)
        dofmap = solution.problem.body.space.dofmap
        rows.append(
            {
                "a/h wanted": fineness,
                "degree": degree,
                "dofs": dofmap.index_map.size_global * dofmap.index_map_bs,
                "a/a_H (moment)": found.moment / hertz.contact_radius,
                "p_0/p_H (fit)": found.centre / hertz.peak,
                "approach/Hertz's at depth R": approach(solution) / hertz.axial(hertz.radius),
                "force error": found.force_error,
                "p_0/p_H (node)": found.peak / hertz.peak,
                "Newton steps": len(solution.history),
                "residual": solution.outcome.residuals.largest,
            }
        )
    report.table(
        "hertz-sphere",
        "Sphere on a plane over Hertz's solution",
        rows,
        "The radius a is that of the second moment of the pressure. The largest pressure p_0 is "
        "given twice: by p^2 as a linear function of r^2 near the axis (fit), and as the largest "
        "nodal value (node). The body is a half ball, and its approach is that of the middle of "
        "its cut, at the depth R. It is compared with the displacement of Hertz's half space at "
        f"that depth, {hertz.axial(hertz.radius):.5f}; that of infinitely distant points is "
        f"{hertz.approach:.5f}. The load is scaled to the area of the polyhedral cut, so that the "
        "forces can balance. At degree 2 all nodes carry pressures. With constraints at "
        "mid-edges alone the last two rows have a/a_H = 1 and 1.001, and p_0/p_H = 1.006 and "
        "0.9972 by fit, 1.037 and 1.008 at a node. These ratios do not show how deep vertices "
        "then penetrate.",
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables and the figure."""
    report = Report.of(__doc__, "hertz", arguments)
    figure_7_2(report, cylinders(report, 12 if report.coarse else 30))
    coarse = ((4, 1), (6, 1))
    spheres(report, coarse if report.coarse else ((4, 1), (8, 1), (12, 1), (4, 2), (6, 2)))


if __name__ == "__main__":
    main()
