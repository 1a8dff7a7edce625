"""The summary of the reproduction: one row a table, figure or theorem of the thesis.

Counts are read from the files of the results, so that they have one address.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Row:
    """A row of the summary."""

    #: Table, figure or theorem of the thesis.
    item: str
    #: Its content.
    content: str
    #: The script whose section has the counterpart.
    script: str
    #: The comparison in words.
    remark: str
    #: CSV file of that script with both columns; none for figures, which have no printed numbers.
    file: str = ""
    #: Our column, and the thesis's, if any.
    ours: str = ""
    theirs: str = "thesis"

    def cells(self, results: Path, link: str) -> list[str]:
        """Return the cells of the row."""
        numbers = ["—", "—"]
        if self.file and (results / self.script / self.file).is_file():
            with (results / self.script / self.file).open() as stream:
                rows = list(csv.DictReader(stream))
            numbers = [
                _ends([row[key] for row in rows]) if key else "—"
                for key in (self.theirs, self.ours)
            ]
        return [f"[{self.item}]({link})", self.content, *numbers, self.remark]


def _ends(values: Sequence[str]) -> str:
    """Return the range of some numbers; values that are none count not."""
    numbers = [float(value) for value in values if value not in ("", "nan")]
    ends = dict.fromkeys(f"{value:.4g}" for value in (min(numbers), max(numbers)))
    return " to ".join(ends)


ROWS = (
    Row("Figures 1.3–1.7", "laws of contact and friction", "figures_compliance",
        "drawn from the projections of the code"),
    Row("Figures 1.1, 1.2, 7.1, 7.3, 8.1, 8.8", "set-ups", "setups", "drawn from the case files"),
    Row("Figure 7.2", "Hertz's cylinder: largest pressure over Hertz's", "hertz",
        "within 0.5 % at small loads without friction; not Hertz's where b/R = 0.34",
        "hertz-cylinder.csv", "p_0/p_H", theirs=""),
    Row("Table 7.1", "iterations of Algorithm 1", "table_7_1",
        "differ; rise with ρ only under the thesis's stopping rules", "table-7-1.csv", "to 1e-8"),
    Row("Figures 7.4, 7.5", "stresses and deformation, multipliers", "figures_mechanics",
        "same zones; the thesis prints no ρ"),
    Row("Table 7.2", "iterations of Algorithm 3", "table_7_2",
        "ours grow faster with 1/ε; the thesis does not print its treatment of the pressure",
        "table-7-2.csv", "(4.38)"),
    Row("Figures 7.7, 7.8", "stresses and deformation, penalty", "figures_mechanics",
        "differ visibly from 7.4, 7.5 where sticking meets sliding"),
    Row("Theorems 4.2, 4.4", "penalty error against ε: order in the energy", "table_7_2",
        "order 1 without friction, and for small ε with friction", "theorem-4-2-table.csv", "order",
        theirs=""),
    Row("Theorems 3.2, 4.5", "fixed points per iteration", "convergence_mechanics",
        "linear; rate below Kačanov's bound unless friction converges last"),
    Row("Theorem 4.3", "penalised solution as h → 0", "convergence_mechanics",
        "converges; corners limit the order"),
    Row("Figure 7.6", "error against a reference", "convergence_mechanics",
        "the thesis's reference is its finest mesh; ours is three levels finer"),
    Row("Table 8.1", "constants of PZT-5A", "setups", "as printed; GPa, m, C, GV are consistent"),
    Row("Table 8.2", "iterations of Algorithm 4, Example 8.1", "tables_piezo",
        "slow with lagged charge; counts with an implicit charge are near the thesis's",
        "table-8-2.csv", "Alg. 4, (3.46)"),
    Row("Table 8.3", "iterations of Algorithm 4, Example 8.2", "tables_piezo",
        "as in Table 8.2; the thesis's counts are 4 above its Table 8.2, not explained",
        "table-8-3.csv", "Alg. 4, (3.46)"),
    Row("Figures 8.2–8.6", "deformation, potential, stresses", "figures_piezo",
        "drawn; the thesis prints no ρ"),
    Row("Theorem 5.2", "Algorithm 4 per iteration", "figures_piezo",
        "with lagged charge converges for small conductivity, and from some value on fails"),
    Row("Figure 8.7", "errors of u and φ against a reference", "figures_piezo",
        "measured with a finer reference"),
    Row("Table 8.4", "iterations of Algorithm 6, Example 8.4", "tables_compliance",
        "equal in six of eight rows, elsewhere 1 or 2 apart", "table-8-4.csv", "Alg. 6, (3.46)"),
    Row("Example 8.3", "iterations of Algorithm 8, as printed and with a layer", "stopping_8_3",
        "2 as in the thesis if inner loops are solved", "stopping-8-3.csv", "(6.40), phi scaled"),
    Row("Figures 8.9–8.12", "stresses, deformation, potential", "figures_compliance",
        "as printed, and with a layer of thickness 0.1"),
    Row("Theorem 6.3", "limit of small friction and conductivity", "limit_theorem", "order 1"),
    Row("Theorems 6.4, 6.5", "Algorithms 8 and 6 per iteration", "limit_theorem",
        "drawn, with layer and charge lagged"),
)  # fmt: skip


def table(results: Path, links: dict[str, str]) -> str:
    """Return the table of the summary."""
    lines = ["| thesis | content | thesis's numbers | ours | comparison |", "|---|---|---|---|---|"]
    for row in ROWS:
        lines.append("| " + " | ".join(row.cells(results, links[row.script])) + " |")
    return "\n".join(lines) + "\n"
