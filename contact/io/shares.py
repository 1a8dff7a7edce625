"""Arrays over the nodes of all ranks in files of NumPy, one a rank, for any number of ranks.

The first rank's file has the name of the whole, says how many pieces there are, and has the arrays
that are no rank's alone; the others have their number in their names. Ranks read pieces in turn,
and values go to the rank that has a node now, which is known by where the node is.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias
from zipfile import BadZipFile

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contact.errors import InputError
from contact.io.formats import piece
from contact.ranks import exchanged, near_boxes, on_all_ranks, on_root
from contact.typing import Array

Arrays: TypeAlias = dict[str, NDArray[Any]]

#: Array of the first piece with the number of all; without it there is one.
PIECES = "pieces"


def piece_of(path: Path, rank: int) -> Path:
    """Return the name of the piece of a rank: ``00001.npz``, ``00001.0001.npz``."""
    return path if rank == 0 else piece(path, rank)


def packed(comm: MPI.Intracomm, own: Mapping[str, Any], once: Mapping[str, Any]) -> bytes:
    """Return the contents of this rank's piece.

    Parameters
    ----------
    comm
        The ranks that each have one.
    own
        The arrays of this rank.
    once
        Those that no rank has a share of.
    """
    file, further = io.BytesIO(), {**once, PIECES: np.array(comm.size)}
    np.savez(file, **own, **(further if comm.rank == 0 else {}))
    return file.getvalue()


@contextmanager
def as_written(path: Path) -> Iterator[None]:
    """Refuse files and arrays that are missing, or have other shapes."""
    try:
        yield
    except InputError:
        raise
    except (OSError, EOFError, BadZipFile, LookupError, TypeError, ValueError) as error:
        raise InputError(
            f"{path}: no checkpoint, or a damaged one ({error}); accepted: as a run has left it",
            "no-checkpoint",
        ) from None


def read_share(
    comm: MPI.Intracomm, path: Path, read: Callable[[Path], bytes], once: Collection[str]
) -> tuple[Arrays, Arrays]:
    """Return the arrays that no rank has a share of, and this rank's share of the others.

    A share is that of some pieces, one behind the other. Collective.

    Parameters
    ----------
    comm, path
        The ranks that read, and the name of the whole.
    read
        Returns the contents of a file.
    once
        Names of the arrays that only the first piece has.

    Raises
    ------
    InputError
        If a piece is missing or damaged.
    """

    def contents(piece: Path) -> Arrays:
        with as_written(piece), np.load(io.BytesIO(read(piece)), allow_pickle=False) as arrays:
            found = dict(arrays)
            if other := [name for name, array in found.items() if array.dtype.kind not in "biufU"]:
                raise ValueError(f"{other[0]!r} holds neither real numbers nor words")
            return found

    def begin() -> tuple[Arrays, Arrays]:
        arrays = contents(path)
        said = {name: arrays.pop(name) for name in {*once, PIECES} & arrays.keys()}
        # A rank without a piece has to know the kinds of the arrays.
        return said, {name: array[:0] for name, array in arrays.items() if array.ndim}

    said, none = on_root(comm, begin)
    with on_all_ranks(comm), as_written(path):
        count = int(said.get(PIECES, 1))
        first, last = (count * (comm.rank + k) // comm.size for k in (0, 1))
        parts = [contents(piece_of(path, k)) for k in range(first, last)]
        found = {
            name: np.concatenate([kind, *(part[name] for part in parts)])
            for name, kind in none.items()
        }
    return said, found


@dataclass(frozen=True)
class Matching:
    """Values at the places that this rank asks for, from the ranks that read them.

    Attributes
    ----------
    comm
        Communicator.
    ranks, rows
        Where rows that this rank has read go, and which these are, shape (k,).
    place
        Of each place asked for, among those that come, shape (n,).
    """

    comm: MPI.Intracomm
    ranks: NDArray[np.intp]
    rows: NDArray[np.intp]
    place: NDArray[np.intp]

    def __call__(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values, shape (n, ...), given those read, shape (m, ...). Collective."""
        return exchanged(self.comm, self.ranks, values[self.rows])[1][self.place]


def matching(comm: MPI.Intracomm, read: Array, asked: Array, near: float) -> Matching | None:
    """Return where the places of all ranks are in files; None where they are others. Collective.

    Parameters
    ----------
    comm
        Communicator.
    read, asked
        The places that this rank has read, and those that it has, shapes (m, d) and (n, d).
    near
        How far a place may be from where it was (length).
    """
    more = comm.allreduce(len(read) - len(asked), op=MPI.SUM)
    if more != 0 or not comm.allreduce(read.shape[1:] == asked.shape[1:], op=MPI.LAND):
        return None
    ranks, rows = near_boxes(comm, read, asked, near)
    there = exchanged(comm, ranks, read[rows])[1]
    # Without any the distance is infinite.
    distance, place = cKDTree(there).query(asked) if len(asked) else (np.zeros(0),) * 2
    fits = bool(distance.max(initial=0.0) <= near)
    if not comm.allreduce(fits, op=MPI.LAND):
        return None
    return Matching(comm, ranks, rows, np.asarray(place, dtype=np.intp))
