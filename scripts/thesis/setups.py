"""Figures 1.1, 1.2, 7.1, 7.3, 8.1 and 8.8, the set-ups, drawn from the case files; Table 8.1.

`python3 -m scripts.thesis.setups [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mpi4py import MPI

from contact import build_problem, load_case
from contact.plot.setup import draw_setup
from scripts.cases import CASES
from scripts.reporting import Report, append, empty

#: Figure -> case file, changes of its mesh for a drawing, title.
FIGURES: Mapping[str, tuple[str, tuple[str, ...], str]] = {
    "7-1": ("hertz", (), "Example 7.1, also the mechanical framework of Figure 1.1"),
    "7-3": ("bar", ("mesh.cells=[64, 16]",), "Example 7.2, also that of Figure 1.1"),
    "8-1": (
        "piezo-8-1-conductive",
        ("mesh.cells=[32, 16]",),
        "Examples 8.1 and 8.2, also the physical framework of Figure 1.2",
    ),
    "8-8": ("compliance-8-4", ("mesh.cells=[48, 8]",), "Examples 8.3 and 8.4"),
}

#: The permittivity of the vacuum as printed, a misprint of 8.854e-12 (F/m), and volts in a GV.
VACUUM, GIGA = 8.885e-12, 1e9


def constants(report: Report) -> None:
    """Print Table 8.1 beside the values of the case files."""
    case = load_case(CASES / "piezo-8-2.toml")
    (_, material), *_ = case.materials
    piezo = material.coupling
    rows = (
        ("E", "GPa", 58.7102, material.young),
        ("nu", "", 0.3912, material.poisson),
        ("e32 (here e31)", "C/m^2", -5.4, piezo.e31),
        ("e33", "C/m^2", 15.8, piezo.e33),
        ("e24 (here e15)", "C/m^2", 12.3, piezo.e15),
        ("beta22/eps_0 (here beta11)", "C/(GV m) for 1", 916.0, piezo.beta11),
        ("beta33/eps_0", "C/(GV m) for 1", 830.0, piezo.beta33),
    )
    columns = empty("constant", "unit", "thesis", "case file", "case file by the thesis")
    for name, unit, thesis, ours in rows:
        factor = GIGA * VACUUM if name.startswith("beta") else 1.0
        append(columns, name, unit, thesis, float(ours), float(ours) / factor / thesis)
    report.table(
        "table-8-1",
        "Table 8.1: constants of PZT-5A, as printed and as the case files have them",
        columns,
        "The axes x, y of the case files stand for X2, X3. Permittivities in C/(GV m) are the "
        "printed ratios times the printed eps_0 = 8.885e-12 times 1e9. The value 8.885 is a "
        "misprint of 8.854; the printed number is kept.",
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the set-ups and print the constants. Collective."""
    report = Report.of(__doc__, "setups", arguments)
    for number, (name, changes, topic) in FIGURES.items():
        case = load_case(CASES / f"{name}.toml", changes)
        problem = build_problem(case)
        figure, nodes = draw_setup(case, problem), problem.nodes
        x, y, gap = (nodes.gather(part) for part in (*nodes.points.T, problem.interface.gap))
        if figure is not None:
            report.figure(
                f"figure-{number}",
                f"Figure {number.replace('-', '.')}: set-up of {topic}",
                figure,
                {"x": x, "y": y, "gap": gap},
                f"Drawn from the case file `{name}.toml`, on a coarse mesh, by the function "
                "behind `contact check --plot`. The file of numbers has the contact nodes and "
                "their gaps.",
            )
    if MPI.COMM_WORLD.rank == 0:
        constants(report)


if __name__ == "__main__":
    main()
