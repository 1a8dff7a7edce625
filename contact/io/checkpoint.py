"""Checkpoints: the state of a solution, and of each step of an evolution, for any number of ranks.

A checkpoint is one file of NumPy, which rank 0 writes. Places stand beside the values: nodes are
found again by where they are. The file of a step has the case and the digests of its files, too.
A new run removes the files of an earlier one from the last to the first: whenever it is killed,
the files from the first on are those of one run.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeAlias
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contact.case.digest import check_files, check_same, digest
from contact.case.file import Case, to_toml
from contact.errors import InputError
from contact.history import CONTACT_NODES, QUADRATURE_POINTS
from contact.interface.multipliers import Multipliers
from contact.io.folder import write_whole
from contact.mesh.entities import sums_at
from contact.mesh.geometry import geometry_nodes
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.ranks import on_root
from contact.results.solution import Results, StepRecord
from contact.typing import Array

Arrays: TypeAlias = dict[str, NDArray[Any]]

#: Folder of the checkpoints of an evolution, in that of its results, and their names.
FOLDER, STEPS = "checkpoints", "[0-9]" * 5 + ".npz"
#: Places of the nodes of the body, beside those of a history.
NODES = "nodes"
#: Begin of the names of the arrays of a history.
HISTORY = "history "
#: Keys of the file of a step: the case, the digests of its files, and the record.
CASE, FILES, RECORD = "case", "files", "record"
#: How near a node has to be to where it was, over the size of the body.
_NEAR = 1e-9


class Checkpoints:
    """The checkpoints that a run writes after its steps into the folder of its results. Collective.

    A restart is held against the case. Records of earlier steps, `kept`, are written first, unless
    they stand `here`. Files of these names that no run has left are refused.
    """

    def __init__(
        self,
        folder: Path,
        problem: ContactProblem,
        case: Case,
        kept: Sequence[StepRecord] = (),
        here: bool = False,
    ) -> None:
        self._folder, self._problem = folder / FOLDER, problem
        self._about: Arrays = {}  # on rank 0

        def begin() -> None:
            for path in () if here else self._folder.glob(STEPS):
                if _case_of(path) is None:
                    raise InputError(
                        f"{path}: no run has left it; accepted: a folder of results without it, "
                        "checkpoints of the evolution go there",
                        "not-ours",
                    )
            about = {CASE: to_toml(case, anchored=True), FILES: json.dumps(digest(case))}
            self._about.update({key: np.array(text) for key, text in about.items()})

        on_root(problem.comm, begin)
        self._count = len(kept) if here else 0
        for record in () if here else kept:
            self.keep(record)

    def keep(self, record: StepRecord) -> None:
        """Write the checkpoint of the next step; those behind it, of an earlier run, go first."""
        self._count += 1
        said = {
            "row": record.row,
            "enthalpy": record.enthalpy,
            "rounding": record.equilibrium_rounding,
        }
        arrays = _gathered(self._problem, record.state)
        arrays |= self._about | {RECORD: np.array(json.dumps(said))}

        def write() -> None:
            self._folder.mkdir(parents=True, exist_ok=True)
            for path in sorted(self._folder.glob(STEPS))[self._count - 1 :][::-1]:
                path.unlink()
            _write(self._folder / f"{self._count:05d}.npz", arrays)

        on_root(self._problem.comm, write)


def files_of(folder: Path) -> list[Path]:
    """Return the checkpoints in a folder, one after the other; refuse none. On one rank."""
    numbered = (folder / FOLDER / f"{number:05d}.npz" for number in itertools.count(1))
    found = [*itertools.takewhile(lambda path: _case_of(path) is not None, numbered)]
    if not found:
        raise InputError(
            f"--restart {folder}: no checkpoints there; accepted: the folder of an evolution that "
            "was ended before its last step, of one mesh (none are kept with [mesh.adapt])",
            "no-checkpoint",
        )
    return found


def kept_case(folder: Path) -> str | None:
    """Return the case of the checkpoints in a folder; None without any. On one rank."""
    return _case_of(folder / FOLDER / "00001.npz")


def check_restart(folder: Path, case: Case) -> None:
    """Refuse, by an InputError, to continue checkpoints that other input made. On one rank."""
    stored, where = _read(files_of(folder)[0]), f"--restart {folder}"
    accepted = "the same case; [solver] and [output] alone may differ"
    now = to_toml(case, anchored=True)
    check_same(where, "checkpoints", str(stored[CASE]), now, accepted)
    before = json.loads(str(stored[FILES]))
    check_files(where, "the checkpoints were written", before, digest(case))


def discard(folder: Path) -> None:
    """Remove the checkpoints of a run that has come to its end. On one rank."""
    with suppress(InputError):
        files_of(folder)  # else they are of somebody else
        for pattern in (STEPS, f".{STEPS}.part"):  # of `write_whole` in a run that was killed
            for path in sorted((folder / FOLDER).glob(pattern)):
                path.unlink()
    with suppress(OSError):  # it is not there, or not empty
        (folder / FOLDER).rmdir()


def read_steps(folder: str | Path, problem: ContactProblem) -> list[StepRecord]:
    """Return the records of the steps that a run of a problem has left in a folder. Collective."""
    files: list[Path] = on_root(problem.comm, lambda: files_of(Path(folder)))
    reader, found = _Reader(problem), list[StepRecord]()
    for path in files:
        state, record = reader.read(path)
        said = json.loads(record)
        found.append(StepRecord(state, said["row"], said["enthalpy"], said["rounding"]))
    return found


def write_checkpoint(solution: Results, path: str | Path) -> None:
    """Write the state of a solution into a file. Collective."""
    arrays = _gathered(solution.problem, solution.state)
    on_root(solution.problem.comm, lambda: _write(Path(path), arrays))


def read_checkpoint(path: str | Path, problem: ContactProblem) -> State:
    """Return the state in a file of `write_checkpoint`, on any number of ranks. Collective."""
    return _Reader(problem).read(Path(path))[0]


def _write(path: Path, arrays: Mapping[str, Any]) -> None:
    def write(draft: Path) -> None:
        with draft.open("wb") as file:  # savez would change the name
            np.savez(file, **arrays)

    write_whole(path, write)


@contextmanager
def _as_written(path: Path) -> Iterator[None]:
    """Refuse files that are missing or damaged."""
    try:
        yield
    except InputError:
        raise
    except (OSError, EOFError, BadZipFile, LookupError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: no checkpoint, or a damaged one ({error}); accepted: as a run has left it",
            "no-checkpoint",
        ) from None


def _read(path: Path) -> Arrays:
    with _as_written(path), np.load(path) as arrays:
        return dict(arrays)


def _case_of(path: Path) -> str | None:
    """Return the case of the checkpoint of a step; None of another file."""
    with suppress(InputError), _as_written(path), np.load(path) as arrays:
        return str(arrays[CASE])
    return None


def _gathered(problem: ContactProblem, state: State) -> Arrays:
    """Return a state and its places on rank 0; nothing elsewhere. Collective."""
    comm, found = problem.comm, Arrays()
    for name, values in (_places(problem) | _values(problem, state)).items():
        shares = comm.gather(values)
        if shares is not None:
            found[name] = np.concatenate(shares)
    once = {"motion": problem.body.motion(state.x), "t": np.array(state.time)}
    once["phi_scale"] = np.array(problem.body.phi_scale)
    return found | once if comm.rank == 0 else {}


def _values(problem: ContactProblem, state: State) -> Arrays:
    """Return the arrays of a state on this rank."""
    body, history = problem.body, state.history or problem.initial
    return {
        "x": body.nodal(state.x)[: body.owned // body.block_size],
        "pressure": state.multipliers.contact,
        "friction": state.multipliers.friction,
        **{HISTORY + name: array for name, array in history.arrays().items()},
    }


def _places(problem: ContactProblem) -> Arrays:
    """Return the places of the arrays of `_values` that this rank owns. Collective."""
    nodes = _nodes(problem)
    found = {NODES: nodes, CONTACT_NODES: nodes[problem.nodes.nodes]}
    if QUADRATURE_POINTS in problem.initial.places:
        found[QUADRATURE_POINTS] = problem.points(QUADRATURE_POINTS)
    return found


class _Reader:
    """Reads states of a problem; rank 0 finds the places of all ranks in a file. Collective."""

    def __init__(self, problem: ContactProblem) -> None:
        self._problem, self._initial = problem, problem.start()
        self._asked = {k: problem.comm.gather(own) for k, own in _places(problem).items()}
        self._shapes = {k: v.shape[1:] for k, v in _values(problem, self._initial).items()}
        #: The places in the last file, and their rows for each rank.
        self._found: dict[str, tuple[Array, list[NDArray[np.intp]]]] = {}

    def read(self, path: Path) -> tuple[State, str]:
        """Return the state in a file, and the record beside it."""
        problem, body, stored = self._problem, self._problem.body, Arrays()

        def begin() -> tuple[Array, float, str]:
            stored.update(_read(path))
            with _as_written(path):
                self._check(path, stored)
                for place in self._asked:
                    self._find(path, place, stored[place])
                if body.piezoelectric:  # potentials are in units of the problem that wrote them
                    scale = float(stored.get("phi_scale", body.phi_scale)) / body.phi_scale
                    stored["x"][:, -1] *= scale
                    stored["motion"][~body.global_unknowns.mechanical] *= scale
                return stored["motion"], float(stored["t"]), str(stored.get(RECORD, ""))

        motion, time, record = on_root(problem.comm, begin)
        initial = problem.initial
        place_of = {"x": NODES, "pressure": CONTACT_NODES, "friction": CONTACT_NODES}
        for place in initial.places:
            place_of |= {HISTORY + name: place for name in initial.arrays(place)}
        own: Arrays = {}
        for name, place in place_of.items():
            rows = self._found[place][1] if stored else ()
            own[name] = problem.comm.scatter([stored[name][row] for row in rows] or None)
        state = State(
            problem.body.local(np.concatenate([own["x"].ravel(), motion])),
            Multipliers.of(problem.nodes, own["pressure"], own["friction"]),
            time,
            initial.replaced({name: own[HISTORY + name] for name in initial.arrays()}),
        )
        return state, record

    def _check(self, path: Path, stored: Arrays) -> None:
        """Refuse arrays of other names, or with rows of other shapes."""
        motion = self._problem.body.motion(self._initial.x)
        given = {k: v.shape[1:] for k, v in stored.items() if k in self._shapes or HISTORY in k}
        for name in {**given, **self._shapes}:
            if given.get(name) != self._shapes.get(name) or stored["motion"].shape != motion.shape:
                raise _other(path, name)

    def _find(self, path: Path, place: str, stored: Array) -> None:
        """Find the rows of the places of all ranks, unless they are those of the last file."""
        if place in self._found and np.array_equal(self._found[place][0], stored):
            return
        shares = self._asked[place]
        asked = np.concatenate(shares)
        if stored.shape != asked.shape:
            raise _other(path, place)
        distance, rows = cKDTree(stored).query(asked)
        if distance.max(initial=0.0) > _NEAR * self._problem.domain.size:
            raise _other(path, place)
        self._found[place] = stored, np.split(rows, np.cumsum([len(own) for own in shares])[:-1])


def _other(path: Path, name: str) -> InputError:
    return InputError(
        f"{path}: the checkpoint does not fit the problem ({name}); accepted: that of the same "
        "case, mesh and materials",
        "other-checkpoint",
    )


def _nodes(problem: ContactProblem) -> Array:
    """Return the points of the owned nodes, and the means of the cells around them. Collective.

    Nodes of two bodies that touch have one point, but not the same cells. Shape (nodes, 2 d).
    """
    body, d = problem.body, problem.dim
    mesh, space = body.domain.mesh, body.space
    cells = mesh.topology.index_map(d).size_local
    own = np.concatenate([geometry_nodes(body.domain).mean(axis=1), np.ones((cells, 1))], axis=1)
    links = space.dofmap.list[:cells]
    each = np.broadcast_to(own[:, None], (*links.shape, d + 1))
    sums = sums_at(space.dofmap.index_map, links, each)[: body.owned // body.block_size]
    return np.concatenate([body.layout.points, sums[:, :d] / sums[:, d:]], axis=1)
