"""Two elastic bodies against closed forms: Hertz's contacts, and the partial slip of two cylinders.

python3 -m scripts.studies.two_bodies [--out DIR] [--coarse]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from contact import load_case
from contact.output.table import Table, contact_table
from contact.typing import Array
from scripts.cases import CASES
from scripts.reporting import Report, options, solved, subplots

#: E/(1 - nu^2) of steel and aluminium of the cylinder on a block, radius there.
STEEL, ALUMINIUM, RADIUS = 210e3 / 0.91, 70e3 / 0.91, 50.0

#: Half cylinders: E* and relative radius, and Coulomb's coefficient.
MODULUS, RELATIVE, MU = 1000.0 / (2 * 0.91), 5.0, 0.3


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables and the figure."""
    given = options(__doc__, "two_bodies", arguments)
    report = Report(given.out)
    coarse = (1.2, 0.6) if given.coarse else (1.2, 0.6, 0.3, 0.15)
    hertz(report, coarse)
    partial_slip(report, 0.05 if given.coarse else 0.01)


def table_of(name: str, *changes: str) -> Table:
    """Solve a case file, and return its contact table."""
    table = contact_table(solved(load_case(CASES / f"{name}.toml", changes)))
    assert table is not None  # on one rank
    return table


def hertz(report: Report, sizes: Sequence[float]) -> None:
    """Write half width and largest pressure of the cylinder on a block, for some meshes."""
    rows: dict[str, list[Any]] = {"mu": [], "h/a": [], "nodes": [], "a": [], "p_0": []}
    modulus = 1 / (1 / STEEL + 1 / ALUMINIUM)
    a, p_0 = half_width(35e3, modulus, RADIUS)
    for mu in (0.0, 0.1):
        for size in sizes:
            changes = (f"mesh.contact_size={size}", f"friction.mu={mu}")
            table = table_of("cylinder-on-block", *changes)
            share = table["weight"] * table["pressure"]
            found = 2 * np.sqrt(np.sum(share * table["x"] ** 2) / np.sum(share))
            rows["mu"].append(mu)
            rows["h/a"].append(size / a)
            rows["nodes"].append(int(np.sum(table["pressure"] > 0)))
            rows["a"].append(found)
            rows["p_0"].append(float(table["pressure"].max()))
    report.table(
        "two-bodies-hertz",
        f"Cylinder on a block (NAFEMS R0094-1): Hertz has a = {a:.4g}, p_0 = {p_0:.5g}",
        rows,
        "a by the second moment of the pressure. With friction the contact of unlike materials is "
        "a little narrower; Hertz has none.",
    )


def half_width(force: float, modulus: float, radius: float) -> tuple[float, float]:
    """Return Hertz's half width and largest pressure of a line contact."""
    a = float(np.sqrt(4 * force * radius / (np.pi * modulus)))
    return a, 2 * force / (np.pi * a)


def cattaneo(x: Array, force: float, share: float) -> tuple[float, float, Array]:
    """Return a, c and the tangential stress at x for Q = share mu P."""
    a, p_0 = half_width(force, MODULUS, RELATIVE)
    c = a * np.sqrt(1 - share)
    full, inner = (np.sqrt(np.maximum(1 - (x / r) ** 2, 0)) for r in (a, c))
    return a, c, MU * p_0 * (full - c / a * inner)


def partial_slip(report: Report, size: float) -> None:
    """Draw the tangential stress of two half cylinders over Cattaneo's and Mindlin's."""
    table = table_of("two-half-cylinders", f"mesh.contact_size={size}")
    x, tau, bound, weight = (table[key] for key in ("x", "tau", "bound", "weight"))
    force = float(np.sum(weight * table["pressure"]))
    share = float(np.sum(weight * tau)) / (MU * force)
    a, c, _ = cattaneo(x, force, share)
    sticks = np.abs(x[table["status"] == "stick"]).max()
    spacing = float(np.mean(np.diff(x[np.abs(x) < a])))
    near = np.abs(x) < 1.3 * a
    fine = np.linspace(-1.3 * a, 1.3 * a, 1001)
    figure, ax = subplots(size=(4.5, 2.8))
    ax.plot(fine / a, cattaneo(fine, force, share)[2], "k-", lw=0.8, label="Cattaneo, Mindlin")
    ax.plot(x[near] / a, tau[near], "o", ms=3, label="computed")
    ax.plot(x[near] / a, bound[near], "--", lw=0.8, label=r"$\mu p$, computed")
    ax.set_xlabel("$x/a$")
    ax.set_ylabel(r"tangential stress")
    ax.legend()
    report.figure(
        "two-bodies-slip",
        "Two half cylinders pressed together, then pushed along: tangential stress",
        figure,
        {"x": x[near], "tau": tau[near], "exact": cattaneo(x[near], force, share)[2]},
        f"Q = {share:.3f} mu P. c/a = {(sticks + spacing / 2) / a:.3f} is found with nodes "
        f"{spacing / a:.3f} a apart, exact is sqrt(1 - Q/(mu P)) = {c / a:.3f}.",
    )


if __name__ == "__main__":
    main()
