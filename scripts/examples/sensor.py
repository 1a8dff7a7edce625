"""How a piezoelectric body is used as a sensor: charge or potential of an electrode over the load.

A short-circuited electrode is read by its charge, an open one by its potential. The case's loads
are multiplied by a factor; the electrode is any part of its mesh.

`python3 -m scripts.examples.sensor [CASE] [--electrode PART] [--factors F ...] [--out DIR]
[--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from contact import Case, build_problem, load_case
from contact.model.evolution import Evolution
from contact.results.resultants import Reading, sensor
from scripts.cases import CASES
from scripts.reporting import Report, parser, solved, subplots

#: Multiples of the case's load.
FACTORS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0)


def opened(case: Case, electrode: str) -> Case:
    """Return the case with the electrode left open: its potential is not prescribed."""
    kept = []
    for fixed in case.fixed:
        if fixed.on != electrode:
            kept.append(fixed)
        elif fixed.displacement is not None:
            kept.append(fixed.model_copy(update={"potential": None}))
    return case.model_copy(update={"fixed": tuple(kept)})


def readings(case: Case, electrode: str, factors: Sequence[float]) -> list[Reading]:
    """Return the electrode's potentials at multiples of the load. Collective."""
    most = max(factors)
    growing = {"time": [0.0, most], "value": [0.0, most]}
    stages = {"times": [0.0, most], "steps": [1], "amplitudes": {"load": growing}}
    loads = tuple(load.model_copy(update={"amplitude": "load"}) for load in case.load)
    update = {"load": loads, "evolution": Evolution.model_validate(stages)}
    base, found = build_problem(case.model_copy(update=update)), []
    for factor in factors:
        solution = solved(case, base.at(factor))
        found.append(sensor(solution.problem, solution.state, electrode))
    return found


def curve(report: Report, case: Case, electrode: str, factors: Sequence[float]) -> None:
    """Tabulate and draw charge (short circuit) and potential (open) over the load."""
    shorted = [reading.charge for reading in readings(case, electrode, factors)]
    left_open = [r.potential for r in readings(opened(case, electrode), electrode, factors)]
    figure, axes = subplots(1, 2, size=(7.2, 3.0))
    charges = [np.nan if q is None else q for q in shorted]
    labels = {
        case.case.units.label("charge, short circuit", "charge"): charges,
        case.case.units.label("mean potential, open", "potential"): left_open,
    }
    for ax, (label, found) in zip(axes, labels.items(), strict=True):
        ax.plot([0.0, *factors], [0.0, *found], "o-", ms=3)
        slope = found[0] / factors[0]
        ax.plot([0.0, factors[-1]], [0.0, slope * factors[-1]], "k:", lw=0.8)
        ax.set(xlabel="load / load of the case", ylabel=label)
    columns = {
        "load factor": factors,
        "charge": charges,
        "potential": left_open,
        "charge per load": [q / f for q, f in zip(charges, factors, strict=True)],
        "potential per load": [v / f for v, f in zip(left_open, factors, strict=True)],
    }
    note = (
        "Dotted: in proportion to the smallest load. With full contact and Coulomb friction a "
        "linear body's reading is proportional to the load; yielding bends the curves. Charge: "
        "integral of D.nu over the electrode, from the reactions of the discrete equations."
    )
    caption = f"Sensor: charge or potential of the part {electrode!r} over the load"
    report.table("sensor-table", caption, columns, note)
    report.figure("sensor", caption, figure, columns, note)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the curve. Collective."""
    made = parser(__doc__, "sensor")
    made.add_argument("case", nargs="?", type=Path, default=CASES / "piezo-sensor.toml")
    made.add_argument("--electrode", default="electrode")
    made.add_argument("--factors", nargs="+", type=float, default=list(FACTORS))
    chosen = made.parse_args(arguments)
    factors = chosen.factors[1::3] if chosen.coarse else chosen.factors
    changes = ["mesh.cells=[16, 8]"] if chosen.coarse else []
    curve(Report(chosen.out), load_case(chosen.case, changes), chosen.electrode, factors)


if __name__ == "__main__":
    main()
