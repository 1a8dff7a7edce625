"""The files of a run, as its figures see them."""

from __future__ import annotations

import csv
import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
import pyvista
from numpy.typing import NDArray
from scipy.spatial import KDTree

from contact import _compat
from contact.errors import InputError
from contact.model.contact import Contact
from contact.model.obstacle import Shape
from contact.plot.style import heading
from contact.ranks import refused
from contact.results.contact_nodes import Table
from contact.results.options import Units
from contact.results.quantity import OPPOSITE
from contact.results.resultants import rigid_columns
from contact.typing import Array


@dataclass(frozen=True)
class Run:
    """The results of a run, or those at the end of one of its steps."""

    title: str  #: one line, to be shown as it is
    units: Units
    axes: str  #: names of the coordinates: xy, rz of a body of revolution, xyz
    #: Columns of ``contact.csv``, with contact direction (``nu_x``...), number of the contact
    #: (``entry``), and whether and how far along it its foundation is rigid and has moved
    #: (``rigid``, ``moved``).
    table: Table
    body: Any  #: a grid of pyvista
    surface: Any  #: the contact part, likewise
    opposite: Any = None  #: the other sides of contacts between bodies, likewise
    names: Sequence[str] = ()  #: of the contacts, by their numbers
    regions: Sequence[str] = ()  #: names by the numbers in the field ``region``
    shapes: Mapping[int, Shape] = field(default_factory=dict)  #: those of the case, by contact
    #: Of shapes that move in 3-D the end of the names of their columns, and the centre of rotation.
    moving: Mapping[int, tuple[str, Array]] = field(default_factory=dict)
    #: Their displacement, and rotation in radians about the origin, shape (6,).
    motions: Mapping[int, Array] = field(default_factory=dict)
    step: int | None = None  #: its number, from 1; None for the last results
    steps: Table = field(default_factory=dict)  #: columns of ``steps.csv``
    tables: Sequence[Table] = ()  #: the contact nodes of each step

    @property
    def plane(self) -> bool:
        """Whether the body is drawn in 2-D."""
        return len(self.axes) == 2

    @property
    def points(self) -> Array:
        """Places of the contact nodes in the reference configuration, shape (n, d)."""
        return np.column_stack([self.table[axis] for axis in "xyz" if axis in self.table])

    @property
    def contacts(self) -> list[Table]:
        """The rows of `table` of each contact."""
        owner = self.table["entry"]
        return [{k: v[owner == i] for k, v in self.table.items()} for i in np.unique(owner)]

    @property
    def constrained(self) -> Array:
        """Nodes of the contact part that are no contact nodes, shape (n, d)."""
        return np.asarray(self.surface.points[self.surface["row"] < 0, : len(self.axes)])

    @property
    def diameter(self) -> float:
        """Largest extent of the body."""
        return float(np.ptp(self.body.points, axis=0).max())


@contextmanager
def _as_written(folder: Path) -> Iterator[None]:
    """Refuse results that are missing or damaged."""
    try:
        yield
    except FileNotFoundError as error:
        hint = ', written with output.fields = "vtu"' if "fields" in str(error.filename) else ""
        raise InputError(
            f"{error.filename}: no such file; accepted: a run's results{hint}", "no-results"
        ) from None
    except OSError as error:
        raise refused(error) from None
    except (KeyError, ValueError, IndexError, TypeError, SyntaxError) as error:
        raise InputError(
            f"{folder}: not as a run has left it ({error}); accepted: the files of a run",
            "no-results",
        ) from None


def read_run(folder: Path, summary: Mapping[str, Any] | None = None) -> Run:
    """Read the files of a run; of its summary the contents if that is not written yet. One rank."""
    with _as_written(folder):
        about = summary or json.loads((folder / "summary.json").read_bytes())
        surface, body = (read_grid(folder / name) for name in ("contact.vtu", "fields.vtu"))
        columns = _columns(folder / "contact.csv")
        files = about.get("files", [path.name for path in folder.iterdir()])
        flat = "rz" if about["kinematics"] == "axisymmetric" else "xy"
        row = surface["row"]
        nodes = np.argsort(row)[np.count_nonzero(row < 0) :]
        along = {f"nu_{axis}": surface["normal"][nodes, i] for i, axis in enumerate("xyz")}
        rigid = surface["rigid"][nodes] > 0
        shapes, moving = _foundations(about.get("case") or "") if "z" in columns else ({}, {})
        return Run(
            heading(str(about["title"])),
            Units(**about.get("units", {})),
            "xyz" if "z" in columns else flat,
            _moved({**columns, **along, "entry": surface["entry"][nodes], "rigid": rigid}, body),
            body,
            surface,
            opposite=read_grid(folder / OPPOSITE) if OPPOSITE in files else None,
            names=list(about["contacts"]),
            regions=about.get("regions", ()),
            shapes=shapes,
            moving=moving,
            motions=_motions(moving, rigid_columns(dict(about), "displacement", "rotation")),
            steps=_columns(folder / "steps.csv") if "steps.csv" in files else {},
            tables=_tables(folder / "contact-steps.csv") if "steps.csv" in files else (),
        )


def _foundations(case: str) -> tuple[dict[int, Shape], dict[int, tuple[str, Array]]]:
    """Return `Run.shapes`, but those in files, and `Run.moving`; none of a case that is refused."""
    try:
        tables = tomllib.loads(case).get("contact", [])
        given = tables if isinstance(tables, list) else [tables]
        contacts = dict(enumerate(map(Contact.model_validate, given)))
    except (InputError, ValueError):
        return {}, {}
    found = {k: each.foundation for k, each in contacts.items()}
    known = {k: shape for k, shape in found.items() if isinstance(shape, Shape)}
    shapes = {k: shape for k, shape in known.items() if getattr(shape, "file", None) is None}
    movers = {k: each.rigid for k, each in contacts.items() if each.rigid is not None}
    moving = {
        k: (f"_{contacts[k].on}" if len(movers) > 1 else "", np.array(rigid.centre or (0, 0, 0)))
        for k, rigid in movers.items()
    }
    return shapes, moving


def _motions(
    moving: Mapping[int, tuple[str, Array]], columns: Mapping[str, float]
) -> dict[int, Array]:
    """Return `Run.motions` from the columns of motions, of those that have these."""
    found = {}
    for contact, (end, centre) in moving.items():
        names = [f"{key}_{axis}{end}" for key in ("rigid", "rigid_rotation") for axis in "xyz"]
        if not columns.keys() >= {*names}:
            continue
        shift, turn = np.reshape([float(columns[name]) for name in names], (2, 3))
        turn = np.radians(turn)
        found[contact] = np.concatenate([shift - np.cross(turn, centre), turn])
    return found


def read_step(folder: Path, number: int) -> Run:
    """Read the results at the end of a step, numbered from 1; refuse one without fields."""
    if not (folder / "fields.pvd").is_file():
        raise InputError(
            f"{folder}: no steps there; accepted: the results of an evolution, with "
            'output.fields = "vtu"',
            "figure-of-steps",
        )
    run = read_run(folder)
    with _as_written(folder):
        fields, contact = (
            pyvista.PVDReader(folder / f"{kind}.pvd").datasets for kind in ("fields", "contact")
        )
    times = run.steps["t"]
    known = {1 + int(np.argmin(abs(times - frame.time))): k for k, frame in enumerate(fields)}
    if number not in known:
        accepted = ", ".join(map(str, known))
        raise InputError(
            f"--step {number}: no fields of such a step; accepted: {accepted}", "figure-of-steps"
        )
    with _as_written(folder):
        frames = [of_all[known[number]] for of_all in (fields, contact)]
        body, surface = (read_grid(folder / Path(frame.path).name) for frame in frames)
    columns = {name: column[number - 1] for name, column in run.steps.items()}
    return replace(
        run,
        title=f"{run.title}, t = {frames[0].time:.3g}".lstrip(", "),
        table=_moved({**run.table, **run.tables[number - 1]}, body),
        body=body,
        surface=surface,
        opposite=None,
        motions=_motions(run.moving, columns),
        step=number,
        steps={},
        tables=(),
    )


def read_grid(path: Path) -> Any:
    """Read a grid of pyvista with its fields; a file of another kind is a ValueError."""
    path.open("rb").close()
    errors = pyvista.VtkErrorCatcher(send_to_logging=False)
    with errors, catch_warnings():  # VTK and pyvista would print them
        simplefilter("ignore")
        grid = pyvista.read(path)
    if errors.events or not grid.n_cells:
        raise ValueError(f"{path.name}: it has no grid")
    return grid


def linear(grid: Any) -> Any:
    """Return the surface of a grid in triangles: of cells of degree 2 four of each."""
    return _compat.surface(grid).triangulate()


def polygons(corners: Array) -> Any:
    """Return polygons by their corners, shape (n, k, 3)."""
    numbers = np.arange(corners[..., 0].size).reshape(corners.shape[:2])
    return pyvista.PolyData.from_regular_faces(corners.reshape(-1, 3), numbers)


def _columns(path: Path) -> dict[str, NDArray[Any]]:
    """Read a table: the columns by name."""
    with path.open(newline="", encoding="utf-8-sig") as file:
        header, *rows = csv.reader(file)
    columns = {name: np.array(texts) for name, *texts in zip(header, *rows, strict=True)}
    return {k: v if k in ("status", "on") else v.astype(float) for k, v in columns.items()}


def _tables(path: Path) -> list[Table]:
    """Read ``contact-steps.csv``: a table a step."""
    columns = _columns(path)
    starts = np.flatnonzero(np.diff(columns["t"])) + 1
    parts = {name: np.split(values, starts) for name, values in columns.items()}
    return [{name: values[k] for name, values in parts.items()} for k in range(len(starts) + 1)]


def _moved(table: Table, body: Any) -> Table:
    """Return contact nodes with how far the foundation has moved."""
    normal = np.column_stack([table[f"nu_{axis}"] for axis in "xyz"])
    places = np.column_stack([table.get(axis, np.zeros(len(normal))) for axis in "xyz"])
    nodes = KDTree(body.points).query(places)[1]
    along = np.einsum("ni,ni->n", body.point_data["displacement"][nodes], normal)
    return {**table, "moved": along - table["u_n"]}
