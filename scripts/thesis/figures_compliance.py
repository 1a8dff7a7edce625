"""Figures 1.3 to 1.7 and 8.9 to 8.12: the contact laws, and Examples 8.3 and 8.4.

`python3 -m scripts.thesis.figures_compliance [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from mpi4py import MPI

from contact import Solution, build_problem
from contact.interface.complementarity import project_disc, project_half_line
from contact.interface.foundation import NormalGraph
from contact.plot.body import Picture, draw_plane, picture
from contact.plot.contact import draw_line
from contact.results.contact_nodes import Table, contact_table, tangent_of
from contact.typing import Array
from forms.laws import Compliance, PotentialFactor, RampConductivity, ShiftedConductivity
from scripts.cases import on_grid
from scripts.reporting import (
    ONE_COLUMN,
    TWO_COLUMNS,
    Report,
    run_of,
    solved,
    subplots,
)

#: Labels of axes and colours.
POTENTIAL = r"potential $\varphi$ (GV)"
ALONG = r"$x$ along $\Gamma_3$ (m)"

#: mu = k_e of Figures 8.11 and 8.12, and how it is written.
VALUES = {
    6e-1: "0.6", 2e-1: "0.2", 6.8e-2: "0.068", 5.1e-3: "0.0051", 8.5e-7: r"8.5\times 10^{-7}",
}  # fmt: skip

#: Arrows shorter than this part of the longest would be dots.
SHORTEST_ARROW = 0.02


def normal_graph(p_nu: Compliance, touch: float, gap: float, stiffness: float) -> tuple[Array, ...]:
    """Return u_nu and -sigma_nu as the Uzawa block relaxation projects onto the law (r = 1)."""
    z = np.linspace(-1.0, 2.0, 601)
    law = NormalGraph(
        p_nu, np.full_like(z, stiffness), np.full_like(z, touch), np.full_like(z, gap)
    )
    pressure = law.pressure(z, 1.0)
    return z - pressure, pressure


def signorini_graph(gap: float) -> tuple[Array, ...]:
    """Return u_nu and -sigma_nu of Signorini's law as (3.43) projects onto it (r = 1)."""
    z = np.linspace(-1.0, 2.0, 601)
    pressure = project_half_line(z - gap)
    return z - pressure, pressure


def coulomb_graph(bound: float) -> tuple[Array, ...]:
    """Return u_tau and -sigma_tau as Step 2 of Algorithm 2 projects onto the law (r = 1)."""
    z = np.linspace(-2.0, 2.0, 801)
    friction = project_disc(z[:, None], np.full_like(z, bound))[:, 0]
    return z - friction, friction


def laws(report: Report) -> None:
    """Draw Figures 1.3 to 1.7 and the laws of (1.34) and section 8.1.2."""
    graphs = {
        "1-3": ("Signorini's law (1.25)", signorini_graph(0.0)),
        "1-4": ("Signorini's law with a gap of 0.5, (1.26)", signorini_graph(0.5)),
        "1-5": (
            "normal compliance (1.28), c = 1.5, no rigid part",
            normal_graph(Compliance(np.inf), 0.0, np.inf, 1.5),
        ),
        "1-6": (
            "compliance and unilateral constraint (1.29): rho_0 = 0, n_nu = 0.25, rho = 0.5",
            normal_graph(Compliance(0.25), 0.0, 0.5, 1.5),
        ),
        "1-7": ("Coulomb's law, bound 1", coulomb_graph(1.0)),
    }
    for number, (topic, (u, force)) in graphs.items():
        figure, axes = subplots(size=(ONE_COLUMN, 2.4))
        axes.axhline(0.0, color="0.7", lw=0.6)
        axes.axvline(0.0, color="0.7", lw=0.6)
        axes.plot(u, force, "k", lw=1.6)
        part = r"\tau" if number == "1-7" else r"\nu"
        axes.locator_params(axis="x", nbins=5)
        axes.set(xlabel=rf"$u_{part}$ (arb. units)", ylabel=rf"$-\sigma_{part}$ (arb. units)")
        caption = f"Figure {number.replace('-', '.')}: {topic}"
        note = (
            "Drawn from the projection that the Uzawa block relaxation applies at a contact node."
        )
        report.figure(f"figure-{number}", caption, figure, {"u": u, "-sigma": force}, note)

    figure, (left, middle, right) = subplots(1, 3, size=(TWO_COLUMNS, 2.4))
    s = np.linspace(-1.5, 1.5, 301)
    data = {"u_nu - rho": s}
    for name, psi in (
        ("shifted", ShiftedConductivity(1.0, 1.0)),
        ("ramp (1.34)", RampConductivity(1.0, 1.0)),
    ):
        data[f"psi, {name}"] = psi(s)
        left.plot(s, psi(s), label=name)
    left.set(xlabel=r"$\delta\,(u_\nu - \varrho)$", ylabel=r"$\psi / k_e$")
    left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    depth, difference = np.linspace(-0.1, 0.3, 201), np.linspace(-200.0, 200.0, 201)
    data |= {"depth": depth, "p_nu": Compliance(0.1)(depth)}
    data |= {"phi - phi_F": difference, "h_nu": PotentialFactor(10.0, 2.0)(difference)}
    middle.plot(depth, data["p_nu"])
    middle.set(xlabel=r"$u_\nu - \varrho_0$", ylabel=r"$p_\nu$")
    right.plot(difference, data["h_nu"])
    right.set(xlabel=r"$\varphi - \varphi_F$", ylabel=r"$h_\nu$")
    caption = "Electric contact (1.34) with the shifted ramp, and p_nu, h_nu of section 8.1.2"
    report.figure("laws-8-1-2", caption, figure, data)


def example(
    report: Report,
    number: str,
    name: str,
    topic: str,
    cells: tuple[int, int],
    variant: str = "",
    changes: Sequence[str] = (),
    note: str = "",
) -> None:
    """Draw both parts of Figure 8.9 or 8.10, or of a variant of it. Collective."""
    solution = solution_of(name, cells, *changes)
    run, table, share = run_of(solution), contact_table(solution.contact), solution.plastic_share
    if run is None:
        return
    deformed = picture(run, "potential")
    dotted, values = number.replace("-", "."), deformed.skin["values"]
    of, ending = (" of the variant", f"-{variant}") if variant else ("", "")
    stress = "normal and tangential stress"
    if not solution.problem.frictional:
        stress = "normal stress (the tangential one is zero)"
    report.figure(
        f"figure-{number}a{ending}",
        f"Figure {dotted} (a){of}: {stress} on Gamma_3, {topic}",
        draw_line(run),
        table,
        f"{remark(solution, table)}{yielding(solution.max_dev_strain, share)} {note}".rstrip(),
    )
    report.figure(
        f"figure-{number}b{ending}",
        f"Figure {dotted} (b){of}: deformed bar, potential and contact forces on it (arrows), "
        f"{topic}",
        with_forces(deformed),
        {"smallest potential": [float(values.min())], "largest potential": [float(values.max())]},
    )


def with_forces(deformed: Picture) -> Figure:
    """Draw a plane body, and the forces of the foundation on it as arrows at the contact nodes."""
    figure, table = draw_plane(deformed), deformed.run.table
    normal = np.column_stack([table["nu_x"], table["nu_y"]])
    tangent = tangent_of(normal)
    place = np.column_stack([table["x"], table["y"]])
    place += deformed.scale * (table["u_n"][:, None] * normal + table["u_t"][:, None] * tangent)
    force = -(table["pressure"][:, None] * normal + table["tau"][:, None] * tangent)
    length = np.linalg.norm(force, axis=1)
    longest = float(length.max(initial=0.0)) or 1.0
    shown = length > SHORTEST_ARROW * longest
    reach = 0.08 * float(np.ptp(table["x"]))  # the longest arrow
    arrows = {"angles": "xy", "scale_units": "xy", "scale": longest / reach, "width": 0.002}
    figure.axes[0].quiver(*place[shown].T, *force[shown].T, color="white", **arrows)
    return figure


def solution_of(
    name: str, cells: tuple[int, int], *changes: str, **replacements: object
) -> Solution:
    """Solve a case file on a mesh. Collective."""
    case = on_grid(name, cells, *changes)
    return solved(case, build_problem(case, **replacements))


def remark(solution: Solution, table: Table) -> str:
    """Return how many nodes stick, slide and are open, and the residual."""
    counts = {kind: np.count_nonzero(table["status"] == kind) for kind in ("stick", "slip", "open")}
    stick = "1 node sticks" if counts["stick"] == 1 else f"{counts['stick']} nodes stick"
    touching = f"{stick}, {counts['slip']} slide"
    if not solution.problem.frictional:
        touching = f"{counts['slip']} nodes are in contact"
    residual = solution.outcome.residuals.largest
    return f"{touching}, {counts['open']} are open; largest residual {residual:.1e}."


def yielding(strain: float, share: float | None) -> str:
    """Return a sentence on the largest strain, and where the law has one, on the yielded share."""
    words = f" Largest |dev eps| {strain:.3g}"
    return (
        f"{words}, yielded: {100 * share:.2g} % of the body." if share is not None else f"{words}."
    )


def series(report: Report, cells: tuple[int, int], values: Mapping[float, str] = VALUES) -> None:
    """Draw Figures 8.11 and 8.12: stresses and potential for mu = k_e -> 0. Collective."""
    limit = solution_of("compliance-8-3", cells)
    domain = limit.problem.domain
    tables = {}
    for value in values:
        changes = f"friction.mu={value}", f"electric.k_e={value}"
        solution = solution_of("compliance-8-4", cells, *changes, domain=domain)
        tables[f"mu = k_e = {value:g}"] = contact_table(solution.contact)
    # Last, to lie on top of the curves that tend to it.
    tables["Problem (PV1)"] = contact_table(limit.contact)
    names = [*(rf"$\mu = k_e = {words}$" for words in values.values()), "Problem (PV1)"]
    if MPI.COMM_WORLD.rank > 0:
        return
    for number, key, topic, ylabel in (
        ("8-11a", "pressure", "normal stress", r"$-\sigma_\nu$ (GPa)"),
        ("8-11b", "tau", "tangential stress", r"$-\sigma_\tau\cdot t$ (GPa)"),
        ("8-12", "phi", "potential", POTENTIAL),
    ):
        figure, axes = subplots(size=(TWO_COLUMNS, 3.2))
        data: dict[str, Sequence[float]] = {}
        for (label, table), name in zip(tables.items(), names, strict=True):
            data.setdefault("x", table["x"])
            data[label] = table[key]
            style = "k--" if label.startswith("P") else "-"  # dashes: the limit of the others
            axes.plot(table["x"], table[key], style, lw=1.0, label=name)
        axes.set(xlabel=ALONG, ylabel=ylabel)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        caption = (
            f"Figure {number.replace('-', '.')}: {topic} on Gamma_3, phi_F = 32, for mu = k_e -> 0"
        )
        report.figure(f"figure-{number}", caption, figure, data)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the figures. Collective."""
    report = Report.of(__doc__, "figures_compliance", arguments)
    cells = (24, 4) if report.coarse else (96, 16)
    if MPI.COMM_WORLD.rank == 0:
        laws(report)
    data = "Example 8.4, mu = 0.6, k_e = 1"
    crossed = ["mesh.diagonal=crossed"]
    symmetric = (
        "The mesh is symmetric, and so are bar, loads and this solution. The bump in the middle "
        "is where slips to either side meet: friction changes its sign there over some nodes. "
        "On finer meshes the peak is 11.4 ([Chapter 8 on finer "
        "meshes](thesis-studies.md#chapter-8-on-finer-meshes)). The thesis shows clear zones of "
        "sticking and sliding; here a zone of the width 0.06 in the middle sticks, and no other."
    )
    leaning = (
        "All triangles lean to one side here. With the default ramp of psi the solution differs "
        "little from that of the symmetric mesh, and less on finer meshes."
    )
    steep = (
        "A steep ramp of psi, delta = 1000 over the largest extent. Its width is far below the "
        "spacing of the nodes, so that the mesh decides where the bar touches."
    )
    ramp, layer = [*crossed, "electric.delta=83.3333"], "layer of thickness 0.1"
    examples: list[tuple[Any, ...]] = [
        ("8-9", "8-3", "Example 8.3"),
        ("8-10", "8-4", f"{data}, crossed diagonals", "", crossed, symmetric),
        ("8-10", "8-4", data, "leaning", (), leaning),
        ("8-10", "8-4", f"{data}, delta = 83.3", "steep", ramp, steep),
        ("8-9", "8-3-layer", f"Example 8.3, {layer}", "layer"),
        ("8-10", "8-4-layer", f"Example 8.4, {layer}", "layer"),
    ]
    for number, name, topic, *more in examples[:: 5 if report.coarse else 1]:
        example(report, number, f"compliance-{name}", topic, cells, *more)
    series(report, cells, dict(list(VALUES.items())[-2:]) if report.coarse else VALUES)


if __name__ == "__main__":
    main()
