"""The corner on which the bar stands: its singular exponent, by theory and from pressures.

`python3 -m scripts.studies.corner [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from scripts.cases import bar
from scripts.reporting import Report, empty, observed_orders, solved

#: Poisson's ratio and decay of (7.16) of Example 7.2.
POISSON, RHO = 0.3, 1e4


def exponent(poisson: float, angle: float = np.pi / 2) -> float:
    """Return lambda of u ~ r^lambda in a corner of a constrained and a free side, plane strain.

    The least root of sin(lambda omega)^2 = ((kappa + 1)^2 - 4 lambda^2 sin(omega)^2) / (4 kappa),
    kappa = 3 - 4 nu (Williams, J. Appl. Mech. 19 (1952) 526).
    """
    kappa = 3 - 4 * poisson

    def defect(power: float) -> float:
        given = ((kappa + 1) ** 2 - 4 * power**2 * np.sin(angle) ** 2) / (4 * kappa)
        return float(np.sin(power * angle) ** 2 - given)

    return float(brentq(defect, 0.3, 0.99))


def main(arguments: Sequence[str] | None = None) -> list[float]:
    """Make the table; return the fitted exponents. Collective."""
    report = Report.of(__doc__, "corner", arguments)
    columns = empty(
        "1/h", "status", "pressure at (4, 0)", "lambda, fitted", "lambda, theory", "residual",
    )  # fmt: skip
    cells, pressures = (8, 16, 32) if report.coarse else (16, 32, 64, 128), []
    for n in cells:
        solution = solved(bar(n, -0.005, RHO))
        nodes = solution.problem.nodes
        last = nodes.gather(nodes.points[:, 0]).argmax()
        pressures.append(float(nodes.gather(solution.pressure)[last]))
        sticks = nodes.gather((solution.status == "stick").astype(float))[last] > 0
        columns["status"].append("sticks" if sticks else "slides")
        columns["residual"].append(solution.outcome.residuals.largest)
    # p ~ h^(lambda - 1)
    fitted = [order + 1 for order in observed_orders(1 / np.array(cells), pressures)]
    theory = exponent(POISSON)
    columns["1/h"] = list(cells)
    columns["pressure at (4, 0)"] = list(pressures)
    columns["lambda, fitted"] = list(fitted)
    columns["lambda, theory"] = [theory] * len(cells)
    report.table(
        "corner",
        "Exponent of the singular corner (4, 0) of Example 7.2, f2 = -0.005, rho = 1e4",
        columns,
        "The last node sticks: the corner is one of 90 degrees with one side held and one free, "
        "like those at the clamped end, and u ~ r^lambda there. The largest pressure therefore "
        f"grows like h^(lambda - 1). P1 and P2 have order {theory:.3f} in H1 on uniform meshes, "
        "which Figure 7.6 approaches from above. This holds as long as the material does not "
        "yield at the corner: under f2 = -0.005 on all of these meshes. Under -0.05 it yields, "
        "the theory does not apply, and orders may be lower. On a mesh graded like r^(1 - 1/q) "
        f"these corners allow P1 the order 1 if q > 1/lambda = {1 / theory:.2f}, and P2 the order "
        f"2 if q > 2/lambda = {2 / theory:.2f}.",
    )
    return fitted[1:]


if __name__ == "__main__":
    main()
