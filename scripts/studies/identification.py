"""Parameters from noisy loops of fretting: how often their intervals contain the right ones.

`python3 -m scripts.studies.identification [--out DIR] [--coarse]`. A block is pressed,
sheared and sheared back; its forces with normal noise of 1 % of the largest ones are the
measurements. Modulus and coefficient of friction are sought from a wrong start.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from contact import identify, load_case, sensitivity
from contact.case.file import Case, number_at, with_number
from contact.cli.identify import draw
from contact.solution import Solution
from contact.typing import Array
from scripts.cases import CASES
from scripts.reporting import Report, append, empty, solved

#: Parameters, measured columns, noise over the largest value, and probability of the intervals.
KEYS, MEASURED = ("friction.mu", "material.young"), ("contact_force_x", "contact_force_y")
NOISE, LEVEL = 0.01, 0.95

#: Linearised repetitions, in which the intervals are counted too.
LINEARISED = 10_000


def fretting() -> Case:
    """Return the loop on a coarse mesh, in fourteen steps."""
    return load_case(
        CASES / "fretting.toml",
        ["mesh.cells=[16,8]", "evolution.steps=[2,2,4,6]", "evolution.times=[0.0,1.0,2.0,4.0,6.0]"],
    )


def measurement(solution: Solution, seed: int, noise: float = NOISE) -> dict[str, Array]:
    """Return t and the measured columns of a run with noise."""
    rows, rng = [record.row for record in solution.steps], np.random.default_rng(seed)
    data = {"t": np.array([row["t"] for row in rows])}
    for name in MEASURED:
        exact = np.array([row[name] for row in rows])
        data[name] = exact + noise * np.abs(exact).max() * rng.standard_normal(exact.size)
    return data


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the table and the figure."""
    report, case = Report.of(__doc__, "derivatives", arguments), fretting()
    right, wrong = solved(case), case
    for key, factor in zip(KEYS, (1.5, 0.7), strict=True):
        wrong = with_number(wrong, key, factor * number_at(case, key))
    columns = empty("repetition", "mu", "from", "to", "E", "E from", "E to", "both in", "runs")
    inside = np.zeros(len(KEYS), dtype=int)
    for seed in range(1 if report.coarse else 20):
        data = measurement(right, seed)
        found = identify(wrong, data, KEYS, {"friction.mu": (0.0, 1.0)}, LEVEL)
        ends = [found.intervals[key] for key in KEYS]
        within = [a <= number_at(case, key) <= b for key, (a, b) in zip(KEYS, ends, strict=True)]
        inside += within
        values = [x for key, pair in zip(KEYS, ends, strict=True)
                  for x in (found.parameters[key], *pair)]  # fmt: skip
        append(columns, seed, *values, all(within), found.evaluations)
        if seed == 0:
            report.out.mkdir(parents=True, exist_ok=True)
            draw(found, data, report.out / "identified.png")
    counted = coverage(right)
    report.table(
        "identified",
        "Parameters from loops with 1 % noise: 95 % intervals of twenty repetitions",
        columns,
        f"mu = {number_at(case, KEYS[0]):g} and E = {number_at(case, KEYS[1]):g} are right; "
        f"{inside[0]} and {inside[1]} of {len(columns['mu'])} intervals contain them. Of "
        f"{LINEARISED} linearised repetitions {counted[0]:.1%} and {counted[1]:.1%} do.",
    )


def coverage(right: Solution, measured: Sequence[str] = MEASURED) -> Array:
    """Return the shares of linearised repetitions whose intervals contain the parameters."""
    slopes = sensitivity(right, measured, KEYS, "tangent").steps
    rows = [record.row for record in right.steps]
    jacobian = np.concatenate(
        [
            np.column_stack([slopes[name][key] for key in KEYS])
            / max(abs(row[name]) for row in rows)
            for name in measured
        ]
    )
    freedom = len(jacobian) - len(KEYS)
    noise = NOISE * np.random.default_rng(0).standard_normal((LINEARISED, len(jacobian)))
    wrong = noise @ np.linalg.pinv(jacobian).T
    left = noise - wrong @ jacobian.T
    scatter = np.sqrt(np.sum(left**2, axis=1) / freedom)
    deviation = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    half = student.ppf((1 + LEVEL) / 2, freedom) * scatter[:, None] * deviation
    return np.asarray(np.mean(np.abs(wrong) <= half, axis=0))


if __name__ == "__main__":
    main()
