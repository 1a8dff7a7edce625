"""Checkpoints: the state of a solution, and of each step of an evolution, for any number of ranks.

A file a step: whatever ends a run, the steps before remain. Nodes are found again by where they
are, on other ranks too. A manifest names the files with their checksums: it alone says which of
them belong to a run.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from dolfinx import fem
from dolfinx.la import InsertMode
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contact.errors import InputError
from contact.history import CONTACT_NODES, QUADRATURE_POINTS
from contact.interface.multipliers import Multipliers
from contact.mesh.geometry import geometry_nodes
from contact.output.folder import kind, listed, read_json, settle, write_whole
from contact.output.solution import Solution, StepRecord
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.ranks import on_all_ranks, on_root
from contact.typing import Array

#: Folder of the checkpoints in that of the results, that of a run which has not ended a step yet,
#: and the case in it.
FOLDER, FRESH, CASE = "checkpoints", "checkpoints.new", "case.toml"
#: The files in a folder of checkpoints with their SHA-256, and the digests of their input; the
#: name of a file until it is whole.
MANIFEST, DRAFT = "manifest.json", ".contact-draft"
_NODES = "nodes.npz"
#: Names that a manifest may have: it is data of whoever wrote it.
_LISTED = re.compile(r"\d{5}\.npz|case\.toml|nodes\.npz")
#: Begin of the names of the arrays of a history, and of a table, in a checkpoint.
HISTORY, TABLE = "history ", "table "
#: How near a node has to be to where it was, over the size of the body.
_NEAR = 1e-9

logger = logging.getLogger("contact.steps")


class Checkpoints:
    """The checkpoints that a run writes. Collective.

    Parameters
    ----------
    folder
        The folder of the results.
    problem
        The problem of the evolution.
    case
        The case, as `contact check` prints it.
    kept
        Records of earlier steps. Where those are already in the folder, the next one follows
        them; else they are written there first.
    here
        Whether they are.
    digest
        Digests of the input of the problem, by names; None where nothing is known of them.

    Raises
    ------
    InputError
        If something stands under the name of the folder that no run has left there.
    """

    def __init__(
        self,
        folder: Path,
        problem: ContactProblem,
        case: str,
        kept: Sequence[StepRecord] = (),
        here: bool = False,
        digest: Mapping[str, str] | None = None,
    ) -> None:
        self._folder, self._problem, self._count = folder, problem, 0
        if here:
            self._count, self._where = len(kept), _where(folder, problem)
            on_root(problem.comm, lambda: _cut(folder, self._count))
            return
        points = _places(problem)
        #: Rows of the owned nodes in the files.
        self._where = (problem.comm.exscan(len(points)) or 0) + np.arange(len(points))
        gathered = np.concatenate(problem.comm.gather(points) or [points])

        def begin() -> None:
            _check_own(folder)
            fresh = folder / FRESH
            _remove(fresh)
            fresh.mkdir(parents=True, exist_ok=True)
            _save(fresh, CASE, case.encode(), digest)
            _save(fresh, _NODES, _packed({"points": gathered}))

        on_root(problem.comm, begin)
        for record in kept:
            self.keep(record)

    def keep(self, record: StepRecord) -> None:
        """Write the checkpoint of the next step; the first replaces those of an earlier run."""
        self._count += 1
        arrays = _gathered(self._problem, record.state, self._where)
        said = {"enthalpy": record.enthalpy, "rounding": record.rounding}
        arrays |= {"said": np.array(json.dumps(said)), "row": np.array(json.dumps(record.row))}
        arrays |= {TABLE + name: column for name, column in record.table.items()}
        on_root(self._problem.comm, lambda: self._write(_packed(arrays)))

    def _write(self, data: bytes) -> None:
        place, fresh = self._folder / FOLDER, self._folder / FRESH
        first = self._count == 1
        _save(fresh if first else place, _name(self._count), data)
        if first:
            _replace(self._folder)


def _gathered(problem: ContactProblem, state: State, where: NDArray[np.intp]) -> dict[str, Any]:
    """Return the arrays of a state on rank 0, the owned nodes in given rows. Collective."""
    body, history = problem.equilibrium, state.history or problem.initial
    values = {
        "where": where,
        "x": body.nodal(state.x)[: where.size],
        "contact": where[problem.nodes.nodes],
        "pressure": state.forces.pressure,
        "friction": state.forces.friction,
    }
    values |= {HISTORY + name: array for name, array in history.arrays().items()}
    if QUADRATURE_POINTS in history.places:
        values[QUADRATURE_POINTS] = problem.points(QUADRATURE_POINTS)
    arrays: dict[str, Any] = {"motion": body.motion(state.x), "t": np.array(state.time)}
    for name, own in values.items():
        parts = problem.comm.gather(own)
        arrays[name] = own if parts is None else np.concatenate(parts)
    if problem.comm.rank == 0:
        arrays["x"] = arrays["x"][np.argsort(arrays.pop("where"))]
    return arrays


def write_checkpoint(solution: Solution, path: str | Path) -> None:
    """Write the state of a solution into a file. Collective.

    Raises
    ------
    InputError
        If that is refused.
    """
    problem, points = solution.problem, _places(solution.problem)
    begin = problem.comm.exscan(len(points)) or 0
    arrays = _gathered(problem, solution.state, begin + np.arange(len(points)))
    whole = problem.comm.gather(points)
    if whole is not None:
        arrays["points"] = np.concatenate(whole)
    on_root(problem.comm, lambda: Path(path).write_bytes(_packed(arrays)))


def read_checkpoint(path: str | Path, problem: ContactProblem) -> State:
    """Return the state in a file that `write_checkpoint` wrote, on any number of ranks. Collective.

    Raises
    ------
    InputError
        If there is none, or it is of another problem.
    """

    def load() -> dict[str, NDArray[Any]]:
        settle(Path(path).parent)
        try:
            return _unpacked(Path(path).read_bytes())
        except (ValueError, KeyError, EOFError, BadZipFile) as error:
            raise InputError(f"{path}: no checkpoint ({error}); accepted: one of a run") from None

    arrays = on_root(problem.comm, load)
    fits = arrays.keys() >= {"points", "x", "contact", "pressure", "friction"}
    where = _rows(problem, arrays["points"]) if fits else None
    if where is None or arrays["contact"].size != problem.nodes.size:
        raise InputError(
            f"{path}: the checkpoint does not fit the problem; accepted: that of the same case"
        )
    with _as_written(Path(path), problem.comm):
        return _state(problem, arrays, where)


@contextmanager
def _as_written(path: Path, comm: MPI.Intracomm) -> Iterator[None]:
    """Refuse arrays that are missing, or have other shapes, on all ranks. Collective."""
    with on_all_ranks(comm):
        try:
            yield
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise InputError(
                f"{path}: no checkpoint, or a damaged one ({error}); accepted: as a run has left it"
            ) from None


def read_steps(folder: Path, problem: ContactProblem) -> list[StepRecord]:
    """Return the records of the steps that a run has left in a folder, up to a damaged one.

    Collective.

    Raises
    ------
    InputError
        If there are none, or they belong to another mesh.
    """
    where = _where(folder, problem)
    files: list[Path] = on_root(problem.comm, lambda: _intact(folder))
    return [_read(problem, path, where) for path in files]


def _where(folder: Path, problem: ContactProblem) -> NDArray[np.intp]:
    """Return the rows of the owned nodes in the files of a folder. Collective."""
    path = on_root(problem.comm, lambda: _files(folder)[0].parent / _NODES)
    arrays = on_root(problem.comm, lambda: _load(path))
    with _as_written(path, problem.comm):
        points = arrays["points"]
    where = _rows(problem, points)
    if where is None:
        raise InputError(
            f"--restart {folder}: given checkpoints of another mesh; accepted: those of the same "
            "case"
        )
    return where


def _rows(problem: ContactProblem, points: Array) -> NDArray[np.intp] | None:
    """Return the rows of the owned nodes among those of a file; None if it is another mesh."""
    comm, mine = problem.comm, _places(problem)
    where = np.zeros(len(mine), dtype=np.intp)
    fits = points.shape == (comm.allreduce(len(mine), op=MPI.SUM), mine.shape[1])
    if fits and len(mine):
        distance, where = cKDTree(points).query(mine)
        fits = bool(distance.max() <= _NEAR * problem.domain.size)
    return where if comm.allreduce(fits, op=MPI.LAND) else None


def _read(problem: ContactProblem, path: Path, where: NDArray[np.intp]) -> StepRecord:
    arrays = on_root(problem.comm, lambda: _load(path))
    table = {k.removeprefix(TABLE): v for k, v in arrays.items() if k.startswith(TABLE)}
    with _as_written(path, problem.comm):
        said, row = (dict(json.loads(str(arrays[name]))) for name in ("said", "row"))
        if not row or len({column.shape for column in table.values()}) > 1:
            raise ValueError("columns are missing, or of unequal lengths")
        state = _state(problem, arrays, where)
        numbers = float(said["enthalpy"]), float(said["rounding"])
    return StepRecord(state, row, table, *numbers)


def _state(
    problem: ContactProblem, arrays: Mapping[str, NDArray[Any]], where: NDArray[np.intp]
) -> State:
    """Return this rank's share of a state."""
    order = np.argsort(arrays["contact"])
    own = np.searchsorted(arrays["contact"], where[problem.nodes.nodes], sorter=order)
    here = {CONTACT_NODES: order[own]}
    if QUADRATURE_POINTS in arrays:
        points = problem.points(QUADRATURE_POINTS)
        nearest = cKDTree(arrays[QUADRATURE_POINTS]).query(points)[1] if len(points) else []
        here[QUADRATURE_POINTS] = np.asarray(nearest, dtype=np.intp)
    initial = problem.initial
    asked = {name: place for place in initial.places for name in initial.arrays(place)}
    kept = {name.removeprefix(HISTORY) for name in arrays if name.startswith(HISTORY)}
    if kept != asked.keys():
        raise InputError(
            f"checkpoints: given the history {sorted(kept)}; accepted: {sorted(asked)}, that of "
            "the materials of the problem"
        )
    history = {name: arrays[HISTORY + name][here[place]] for name, place in asked.items()}
    return State(
        problem.equilibrium.local(np.concatenate([arrays["x"][where].ravel(), arrays["motion"]])),
        Multipliers.of(
            problem.nodes, arrays["pressure"][order[own]], arrays["friction"][order[own]]
        ),
        float(arrays["t"]),
        problem.initial.replaced(history),
    )


def case_of(folder: Path) -> Path:
    """Return where the case of an interrupted evolution stands. On one rank.

    Raises
    ------
    InputError
        If there is none.
    """
    return _files(folder)[0].parent / CASE


def kept_case(folder: Path) -> str | None:
    """Return the case of the checkpoints in a folder; None without any. On one rank."""
    with suppress(InputError):
        return case_of(folder).read_text(encoding="utf-8", errors="replace")
    return None


def stored_input(folder: Path) -> tuple[Path, dict[str, str]]:
    """Return the file of the case, as it was written, and the digests of its files. On one rank.

    Raises
    ------
    InputError
        If there are no checkpoints, or the case has changed.
    """
    path = case_of(folder)
    _read_whole(path)
    digests = read_json(path.with_name(MANIFEST)).get("digest")
    return path, digests if isinstance(digests, dict) else {}


def discard(folder: Path) -> None:
    """Remove the checkpoints of a run that has come to its end. On one rank."""
    for place in (folder / FOLDER, folder / FRESH):
        if _manifest(place):
            _remove(place)


def _files(folder: Path) -> list[Path]:
    """Return the checkpoints in a folder, one after the other."""
    for name in (FOLDER, FRESH):
        known, found = _manifest(folder / name), list[Path]()
        while (path := folder / name / _name(len(found) + 1)).is_file() and path.name in known:
            found.append(path)
        if found:
            return found
    raise InputError(
        f"--restart {folder}: no checkpoints there; accepted: the folder of an evolution that was "
        "ended before its last step, of one mesh (none are kept with [mesh.adapt])"
    )


def _intact(folder: Path) -> list[Path]:
    """Return the checkpoints before the first one that is damaged or missing, and say so."""
    files = _files(folder)
    for count, path in enumerate(files):
        try:
            _load(path)
        except InputError as error:
            if count == 0:
                raise
            logger.warning("%s; going on from step %d, the last one intact", error, count)
            return files[:count]
    later = [*files[0].parent.glob("0*.npz")]
    if len(later) > len(files):
        missing = files[0].parent / _name(len(files) + 1)
        logger.warning("%s is missing; going on from step %d", missing, len(files))
    return files


def _name(count: int) -> str:
    return f"{count:05d}.npz"


def _manifest(place: Path) -> dict[str, str]:
    """Return the SHA-256 of the files that a run has left in a folder; nothing without any."""
    return listed(place / MANIFEST, _LISTED) if kind(place) == "a folder" else {}


def _list(place: Path, files: Mapping[str, str], digest: Mapping[str, str] | None = None) -> None:
    """Write a manifest, by default with the digests of the one before."""
    digest = read_json(place / MANIFEST).get("digest") if digest is None else digest
    text = json.dumps({"files": files, "digest": digest}, indent=1)
    write_whole(place / MANIFEST, text.encode(), place / DRAFT)


def _check_own(folder: Path) -> None:
    """Refuse to replace checkpoints that no run has left.

    Raises
    ------
    InputError
        If there are files that no manifest names, or something else than a folder.
    """
    for place in (folder / FOLDER, folder / FRESH):
        given = kind(place)
        if given == "a folder":
            known = _manifest(place)
            own = {DRAFT, MANIFEST, *known} if known else {DRAFT}
            given = next((path.name for path in place.iterdir() if path.name not in own), None)
        if given is not None:
            raise InputError(
                f"{place}: given {given}, which no run has left there; accepted: a folder of "
                "results without it, checkpoints of the evolution go there"
            )


def _remove(place: Path) -> None:
    """Remove the files that a manifest names, the first step first, and an empty folder."""
    for name in (*sorted(_manifest(place)), DRAFT, MANIFEST):
        (place / name).unlink(missing_ok=True)
    with suppress(OSError):  # it is not there, or not empty
        place.rmdir()


def _replace(folder: Path) -> None:
    """Put the checkpoints of a new run in the place of those of an earlier one."""
    _check_own(folder)
    _remove(folder / FOLDER)
    (folder / FRESH).rename(folder / FOLDER)


def _cut(folder: Path, count: int) -> None:
    """Keep the checkpoints up to a step, for those of another course to follow."""
    place = _files(folder)[0].parent
    kept = _manifest(place)
    later = [name for name in kept if name[0].isdigit() and name > _name(count)]
    for name in later:
        (place / name).unlink(missing_ok=True)
    _list(place, {name: kept[name] for name in kept if name not in later})
    if place.name == FRESH:  # where a run was ended between removal and renaming
        _replace(folder)


def _packed(arrays: dict[str, Any]) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def _save(place: Path, name: str, data: bytes, digest: Mapping[str, str] | None = None) -> None:
    """Write a file and its name in the manifest, which comes first: no file is without one."""
    known = _manifest(place)
    if name not in known and kind(place / name) is not None:
        raise InputError(f"{place / name}: no run has left it; accepted: a folder without it")
    _list(place, known | {name: hashlib.sha256(data).hexdigest()}, digest)
    write_whole(place / name, data, place / DRAFT)


def _read_whole(path: Path) -> bytes:
    """Return the contents of a file of the manifest.

    Raises
    ------
    InputError
        If they are not as they were written.
    """
    data = path.read_bytes() if path.is_file() else b""
    if hashlib.sha256(data).hexdigest() != _manifest(path.parent).get(path.name):
        raise InputError(f"{path}: no checkpoint, or a damaged one; accepted: as a run has left it")
    return data


def _load(path: Path) -> dict[str, NDArray[Any]]:
    return _unpacked(_read_whole(path))


def _unpacked(data: bytes) -> dict[str, NDArray[Any]]:
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        return dict(arrays)


def _places(problem: ContactProblem) -> Array:
    """Return keys of the owned nodes: their points, and the means of the cells around.

    Nodes of two bodies that touch may have the same point, but not the same cells. Shape
    (nodes, 2 d). Collective.
    """
    body, d = problem.equilibrium, problem.dim
    mesh, space = body.domain.mesh, body.space
    cells = mesh.topology.index_map(d).size_local
    corners = geometry_nodes(body.domain)
    sums = fem.Function(fem.functionspace(mesh, ("Lagrange", body.degree, (d + 1,))))
    own = np.concatenate([corners.mean(axis=1), np.ones((cells, 1))], axis=1)
    links = sums.function_space.dofmap.list
    np.add.at(sums.x.array.reshape(-1, d + 1), links[:cells], own[:, None, :])
    sums.x.scatter_reverse(InsertMode.add)
    sums.x.scatter_forward()
    at_nodes = np.empty((len(body.nodal(body.rest())), d + 1))
    at_nodes[space.dofmap.list] = sums.x.array.reshape(-1, d + 1)[links]
    owned = body.owned // body.block_size
    means = at_nodes[:owned, :d] / at_nodes[:owned, d:]
    return np.concatenate([body.layout.points, means], axis=1)
