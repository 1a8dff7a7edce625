"""The values of a solution that golden numbers compare, from its files and its fields."""

from __future__ import annotations

import csv
import hashlib
import json
import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from contact import Solution


class Value(NamedTuple):
    """A value: a number with its scale, or a count or a word, which is compared exactly."""

    value: float | int | str
    scale: float = 0.0


#: Quantity -> value.
Values = Mapping[str, Value]

#: Keys of the summary, or below them, that are compared, and the keys of their scales.
KEYS = {
    "contact_force": "force", "reactions": "force", "force": "force",
    "contact_moment": "moment", "reaction_moments": "moment", "moment": "moment",
    "max_pressure": "own", "max_von_mises": "own", "max_dev_strain": "own", "max_strain": "own",
    "max_displacement": "own", "displacement": "length", "shortening": "length",
    "rotation": "angle", "contact_area": "own", "plastic_share": "one", "plastic_volume": "own",
    "plastic_dissipation": "own", "equivalent_plastic_strain": "own", "volume_ratio": "own",
    "phi_min": "potential", "phi_max": "potential", "potential": "potential",
    "charges": "charge", "charge": "charge",
}  # fmt: skip

#: Keys of the summary that have other ones below them.
GROUPS = ("rigid", "rigid_parts", "electrodes", "bolts")

#: Columns of steps.csv: work of the steps, and the values that are compared in each.
WORK = ("work", "dissipation", "plastic_dissipation")
IN_STEPS = ("max_pressure", "max_displacement")


def measured(solution: Solution) -> dict[str, Value]:
    """Return the values of a solution, from its files and its fields. Collective."""
    from contact import write_outputs

    comm = solution.problem.comm
    with tempfile.TemporaryDirectory() as place:
        folder = comm.bcast(place)
        solution.output = solution.output.model_copy(update={"fields": "none"})
        write_outputs(solution, folder)
        files = comm.bcast(_read(Path(folder)) if comm.rank == 0 else None)
    summary, nodes, steps = files
    values = {"converged": Value(str(summary["converged"]))}
    values |= _on_contact(nodes, summary["max_displacement"])
    values |= _of_summary(summary, _scales(summary, nodes))
    values |= _of_fields(solution)
    return values | _of_steps(steps)


def counted(solution: Solution) -> dict[str, Value]:
    """Return the counts of an algorithm of the thesis."""
    records, counters = solution.history, solution.counters
    return {
        "outer_iterations": Value(sum(record.iteration > 0 for record in records)),
        "inner_iterations": Value(sum(record.inner for record in records)),
        "linear_solves": Value(counters.linear_solves),
        "factorizations": Value(counters.factorizations),
    }


def _read(folder: Path) -> tuple[dict[str, Any], list[dict[str, str]], list[dict[str, str]]]:
    """Return the summary, and the rows of the tables of contact nodes and of steps."""

    def rows(name: str) -> list[dict[str, str]]:
        with (folder / name).open(encoding="utf-8") as stream:
            return list(csv.DictReader(stream))

    steps = rows("steps.csv") if (folder / "steps.csv").exists() else []
    return json.loads((folder / "summary.json").read_text()), rows("contact.csv"), steps


def _columns(rows: Sequence[Mapping[str, str]], *names: str) -> list[list[float]]:
    """Return the rows of some columns, of those that there are."""
    there = [name for name in names if rows and name in rows[0]]
    return [[float(row[name] or "nan") for name in there] for row in rows]


def _norm(nodes: Sequence[Mapping[str, str]], name: str) -> float:
    """Return the L2 norm of a quantity over the contact nodes, of all its components."""
    columns = [name, *(f"{name}{axis}" for axis in ("x", "y", "z", "_x", "_y", "_z"))]
    rows = zip(_columns(nodes, "weight"), _columns(nodes, *columns), strict=True)
    return math.sqrt(math.fsum(w * value**2 for (w,), row in rows for value in row))


def _on_contact(nodes: Sequence[Mapping[str, str]], largest: float) -> dict[str, Value]:
    """Return norms over the contact nodes, and their active set; `largest` displacement."""
    statuses = [row["status"] for row in nodes]
    values = {f"{name} nodes": Value(statuses.count(name)) for name in ("open", "stick", "slip")}
    values["active set"] = Value(digest(_columns(nodes, "x", "y", "z"), statuses))
    pressure = _norm(nodes, "pressure")
    length = max(math.hypot(_norm(nodes, "u_n"), _norm(nodes, "u_t")), largest)
    for name, scale in {
        "pressure": pressure, "tau": pressure, "u_n": length, "u_t": length, "phi": 0, "d_n": 0,
    }.items():  # fmt: skip
        size = _norm(nodes, name)
        if scale or size:
            values[f"{name} in L2"] = Value(size, scale or size)
    return values


def digest(points: Sequence[Sequence[float]], statuses: Sequence[str]) -> str:
    """Return a digest of the places of nodes and their status, in whatever order they come.

    Places are whole numbers of millionths of the largest coordinate, counted from a number that no
    mesh has, so that rounding does not move a node from one to the next.
    """
    size = max((abs(x) for point in points for x in point), default=0.0) or 1.0
    lines = sorted(
        " ".join([*(str(math.floor(1e6 * x / size + 0.3819660)) for x in point), status])
        for point, status in zip(points, statuses, strict=True)
    )
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:12]


def _leaves(name: str, value: Any) -> Iterator[tuple[str, float]]:
    """Return the numbers below a key, with their names."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(f"{name} {key}", item)
    elif isinstance(value, list):
        for k, item in enumerate(value):
            yield from _leaves(f"{name} {k}", item)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield name, float(value)


def _scales(summary: Mapping[str, Any], nodes: Sequence[Mapping[str, str]]) -> dict[str, float]:
    """Return the scales of forces, moments, lengths, angles, potentials and charges."""
    load = _columns(nodes, "weight", "pressure")
    forces = [math.fsum(weight * abs(pressure) for weight, pressure in load)]
    # Where a body is unloaded its forces are rounding of its stresses.
    area = math.fsum(weight for weight, _ in load)
    forces += [1e-6 * area * summary["max_von_mises"]]
    forces += [abs(x) for _, x in _leaves("", summary["reactions"])]
    for key in GROUPS[:2]:
        forces += [abs(x) for name, x in _leaves("", summary.get(key)) if " force" in name]
    size = max(abs(x) for row in _columns(nodes, "x", "y", "z") for x in row)
    length = summary["max_displacement"]
    potential = max(abs(summary.get(key) or 0.0) for key in ("phi_min", "phi_max"))
    charge = (summary.get("charges") or {}).get("magnitude", 0.0)
    if potential:  # of an open circuit the charges are rounding
        charge = max(charge, 1e-3 * max(forces) * length / potential)
    return {
        "force": max(forces),
        "moment": max(forces) * size,
        "length": length,
        "angle": math.degrees(length / size),
        "potential": potential,
        "charge": charge,
        "one": 1.0,
    }


def _of_summary(summary: Mapping[str, Any], scales: Mapping[str, float]) -> dict[str, Value]:
    """Return the values of the summary."""
    values = {}
    for key in (*KEYS, *GROUPS):
        for name, value in _leaves(key, summary.get(key)):
            words = [word for word in reversed(name.split()) if word in KEYS]
            if words:
                values[name] = Value(value, max(scales.get(KEYS[words[0]], 0.0), abs(value)))
    square = summary["error"]["energy"] ** 2
    # Where there is none its square is rounding.
    return values | {"error, square": Value(square, max(square, 1e-6))}


def _of_fields(solution: Solution) -> dict[str, Value]:
    """Return energy, norms of displacement and stress, a displacement at a point. Collective."""
    import numpy as np

    from contact.problem.residuals import stored

    comm, u, stress = solution.problem.comm, solution.displacement, solution.stress
    space = u.function_space
    owned = space.dofmap.index_map.size_local
    points = space.tabulate_dof_coordinates()[:owned]
    rows = u.x.array[: owned * space.dofmap.index_map_bs].reshape(owned, -1)
    cells = stress.function_space.dofmap
    tensors = stress.x.array[: cells.index_map.size_local * cells.index_map_bs]
    found = comm.allgather((points, rows, float(tensors @ tensors)))
    points, rows = (np.concatenate(parts) for parts in list(zip(*found, strict=True))[:2])
    low, high = points.min(axis=0), points.max(axis=0)
    # A point that no symmetry maps to itself, so that one node is the nearest.
    place = low + np.array([0.3717, 0.6113, 0.4391]) * (high - low)
    nearest = rows[np.argmin(np.linalg.norm(points - place, axis=1))]
    size, largest = np.linalg.norm(rows), np.linalg.norm(rows, axis=1).max()
    total = math.sqrt(sum(squares for *_, squares in found))
    energy = stored(solution.problem, solution.state)
    # Laws with history need not state one.
    known = {} if math.isnan(energy) else {"stored energy": Value(energy, abs(energy))}
    return known | {
        "mesh": Value(digest(points.tolist(), [""] * len(points))),
        "displacement, norm": Value(float(size), float(size)),
        "stress, norm": Value(total, total),
        **{f"displacement {axis} at a point": Value(float(value), float(largest))
           for axis, value in zip("xyz", nearest, strict=False)},
    }  # fmt: skip


def _of_steps(steps: Sequence[Mapping[str, str]]) -> dict[str, Value]:
    """Return sums over all steps, and the energy after the last."""
    if not steps:
        return {}
    there = [name for name in WORK if name in steps[0]]
    parts = dict(zip(there, zip(*_columns(steps, *there), strict=True), strict=True))
    energies = [row[0] for row in _columns(steps, "energy")]
    scale = max(map(abs, (*energies, *(part for column in parts.values() for part in column))))
    values = {"steps": Value(len(steps)), "energy": Value(energies[-1], scale)}
    values |= {f"{name}, all steps": Value(math.fsum(parts[name]), scale) for name in there}
    for name in IN_STEPS:
        total = math.fsum(row[0] for row in _columns(steps, name))
        values[f"{name}, all steps"] = Value(total, total)
    for name in ("stick_nodes", "slip_nodes"):
        values[f"{name}, all steps"] = Value(sum(int(row[name]) for row in steps))
    return values
