"""Checkpoints: the state of a solution, and of each step of an evolution, for any number of ranks.

Files a step, one of each rank: whatever ends a run, the steps before remain. Nodes are found again
by where they are, on other ranks too. A manifest names the files with their checksums: it alone
says which of them belong to a run.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from dolfinx import fem
from dolfinx.la import InsertMode

from contact.errors import InputError
from contact.history import CONTACT_NODES, QUADRATURE_POINTS
from contact.interface.multipliers import Multipliers
from contact.io.folder import settle
from contact.io.shares import (
    Arrays,
    Matching,
    as_written,
    matching,
    packed,
    piece_of,
    read_share,
)
from contact.io.step_files import (
    CASE,
    FOLDER,
    FRESH,
    check_own,
    cut,
    files_of,
    load,
    name_of,
    remove,
    replace_earlier,
    save,
)
from contact.mesh.geometry import geometry_nodes
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.ranks import on_all_ranks, on_each, on_root
from contact.results.solution import Solution, StepRecord
from contact.typing import Array

#: The places of the nodes in the files of the first steps; a run that has gone on, perhaps on other
#: ranks, has them in a file with the number of the last step before.
_NODES = "nodes.npz"
#: Begin of the names of the arrays of a history in a checkpoint, and the arrays that are of no rank
#: alone: file of the nodes, further numbers of the step, and those of the state.
HISTORY, ONCE = "history ", ("nodes", "said", "row", "motion", "t")
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
        self._folder, self._problem, comm = folder, problem, problem.comm
        self._count = len(kept) if here else 0
        self._nodes = f"nodes-{self._count:05d}.npz" if here else _NODES
        points = _places(problem)
        self._begin = comm.exscan(len(points)) or 0
        place = folder / (FOLDER if here else FRESH)

        def begin() -> None:
            if here:
                cut(folder, self._count)
                return
            check_own(folder)
            remove(place)
            place.mkdir(parents=True, exist_ok=True)

        on_root(comm, begin)
        if not here:
            save(comm, place, CASE, case.encode() if comm.rank == 0 else None, digest)
        save(comm, place, self._nodes, packed(comm, {"points": points}, {}))
        for record in () if here else kept:
            self.keep(record)

    def keep(self, record: StepRecord) -> None:
        """Write the checkpoint of the next step; the first replaces those of an earlier run."""
        self._count += 1
        comm, first = self._problem.comm, self._count == 1
        own, once = _arrays(self._problem, record.state, self._begin)
        said = {"enthalpy": record.enthalpy, "rounding": record.rounding}
        once |= {"said": np.array(json.dumps(said)), "row": np.array(json.dumps(record.row))}
        once["nodes"] = np.array(self._nodes)
        place = self._folder / (FRESH if first else FOLDER)
        save(comm, place, name_of(self._count), packed(comm, own, once))
        if first:
            on_root(comm, lambda: replace_earlier(self._folder))


def _arrays(problem: ContactProblem, state: State, begin: int) -> tuple[Arrays, Arrays]:
    """Return the arrays of a state on this rank, and those that no rank has a share of.

    Collective. The owned nodes are numbered from `begin`.
    """
    body, history = problem.equilibrium, state.history or problem.initial
    values = {
        "x": body.nodal(state.x)[: body.owned // body.block_size],
        "contact": begin + problem.nodes.nodes.astype(np.int64),
        "pressure": state.forces.pressure,
        "friction": state.forces.friction,
    }
    values |= {HISTORY + name: array for name, array in history.arrays().items()}
    if QUADRATURE_POINTS in history.places:
        values[QUADRATURE_POINTS] = problem.points(QUADRATURE_POINTS)
    return values, {"motion": body.motion(state.x), "t": np.array(state.time)}


def write_checkpoint(solution: Solution, path: str | Path) -> None:
    """Write the state of a solution into a file, of several ranks one of each. Collective.

    Raises
    ------
    InputError
        If that is refused.
    """
    problem, points = solution.problem, _places(solution.problem)
    comm = problem.comm
    own, once = _arrays(problem, solution.state, comm.exscan(len(points)) or 0)
    data = packed(comm, own | {"points": points}, once)
    on_each(comm, lambda: piece_of(Path(path), comm.rank).write_bytes(data))


def read_checkpoint(path: str | Path, problem: ContactProblem) -> State:
    """Return the state in a file that `write_checkpoint` wrote, on any number of ranks. Collective.

    Raises
    ------
    InputError
        If there is none, or it is of another problem.
    """
    path, comm = Path(path), problem.comm
    on_root(comm, lambda: settle(path.parent))
    said, own = read_share(comm, path, Path.read_bytes, ONCE)
    found = _Nodes.of(problem, own["points"]) if "points" in own else None
    if found is None:
        raise InputError(_other(path), "other-checkpoint")
    return _state(problem, path, (said, own), found)


def _other(path: Path) -> str:
    return f"{path}: the checkpoint does not fit the problem; accepted: that of the same case"


def read_steps(folder: str | Path, problem: ContactProblem) -> list[StepRecord]:
    """Return the records of the steps that a run has left in a folder, up to a damaged one.

    Collective.

    Raises
    ------
    InputError
        If there are none, or they belong to another mesh.
    """
    comm, found = problem.comm, list[StepRecord]()
    files: list[Path] = on_root(comm, lambda: files_of(Path(folder)))
    nodes: dict[str, _Nodes] = {}
    for path in files:
        try:
            found.append(_read(problem, path, nodes))
        except InputError as error:
            if not found:
                raise
            if comm.rank == 0:
                words = "%s; going on from step %d, the last one intact"
                logger.warning(words, error.words, len(found))
            return found
    if comm.rank == 0 and len([*files[0].parent.glob("0????.npz")]) > len(files):
        missing = files[0].parent / name_of(len(files) + 1)
        logger.warning("%s is missing; going on from step %d", missing, len(files))
    return found


@dataclass(frozen=True)
class _Nodes:
    """The nodes of files: the keys that this rank has read, its own, and where these are."""

    read: Array
    own: Array
    matching: Matching

    @staticmethod
    def of(problem: ContactProblem, read: Array) -> _Nodes | None:
        """Return those of a problem; None if they are of another mesh. Collective."""
        own = _places(problem)
        found = matching(problem.comm, read, own, _NEAR * problem.domain.size)
        return None if found is None else _Nodes(read, own, found)


def _read(problem: ContactProblem, path: Path, nodes: dict[str, _Nodes]) -> StepRecord:
    """Return the record of a step, given the nodes of the files so far by name. Collective."""
    said, own = load(problem.comm, path, ONCE)
    with as_written(path):
        about, row = (dict(json.loads(str(said[name]))) for name in ("said", "row"))
        if not row:
            raise ValueError("the row of the step is missing")
        numbers = float(about["enthalpy"]), float(about["rounding"])
        place = path.with_name(str(said.get("nodes", _NODES)))
    if place.name not in nodes:
        keys = load(problem.comm, place, ONCE)[1]
        found = _Nodes.of(problem, keys["points"]) if "points" in keys else None
        if found is None:
            raise InputError(
                f"--restart {path.parent.parent}: given checkpoints of another mesh; accepted: "
                "those of the same case",
                "other-checkpoint",
            )
        nodes[place.name] = found
    return StepRecord(_state(problem, path, (said, own), nodes[place.name]), row, *numbers)


def _state(
    problem: ContactProblem, path: Path, arrays: tuple[Arrays, Arrays], nodes: _Nodes
) -> State:
    """Return this rank's share of a state, given the arrays as read. Collective."""
    (said, own), comm, initial, body = arrays, problem.comm, problem.initial, problem.equilibrium
    asked = {name: place for place in initial.places for name in initial.arrays(place)}
    kept = {name.removeprefix(HISTORY) for name in own if name.startswith(HISTORY)}
    if kept != asked.keys():
        raise InputError(
            f"checkpoints: given the history {sorted(kept)}; accepted: {sorted(asked)}, that of "
            "the materials of the problem",
            "other-checkpoint",
        )
    here = {CONTACT_NODES: nodes.own[problem.nodes.nodes]}
    if QUADRATURE_POINTS in initial.places:
        here[QUADRATURE_POINTS] = problem.points(QUADRATURE_POINTS)
    # Places and shapes of the rows of each array.
    rows = {"pressure": (CONTACT_NODES, ()), "friction": (CONTACT_NODES, (problem.dim,))}
    rows |= {HISTORY + k: (asked[k], array.shape[1:]) for k, array in initial.arrays().items()}
    begin, rest = comm.exscan(len(nodes.read)) or 0, body.motion(body.rest())
    with on_all_ranks(comm), as_written(path):
        read = {CONTACT_NODES: nodes.read[own["contact"] - begin]}
        if QUADRATURE_POINTS in here:
            read[QUADRATURE_POINTS] = own[QUADRATURE_POINTS]
        shapes = {name: (len(read[place]), *shape) for name, (place, shape) in rows.items()}
        shapes["x"] = (len(nodes.read), body.block_size)
        motion, time = said["motion"], float(said["t"])
        for name, shape in shapes.items():
            if len(own[name]) != shape[0]:
                raise ValueError(f"{len(own[name])} rows of {name}")
        if motion.shape != rest.shape or any(own[k].shape != shape for k, shape in shapes.items()):
            raise InputError(_other(path), "other-checkpoint")
    near, found = _NEAR * problem.domain.size, dict[str, Matching]()
    for place, points in here.items():
        matched = matching(comm, read[place], points, near)
        if matched is None:
            raise InputError(_other(path), "other-checkpoint")
        found[place] = matched
    values = {name: found[place](own[name]) for name, (place, _) in rows.items()}
    return State(
        body.local(np.concatenate([nodes.matching(own["x"]).ravel(), motion])),
        Multipliers.of(problem.nodes, values["pressure"], values["friction"]),
        time,
        initial.replaced({name: values[HISTORY + name] for name in asked}),
    )


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
