"""A large mesh of which each rank reads its share: time, and the peak memory of all ranks.

``python3 -m scripts.benchmarks.reading make FILE.xdmf N`` writes a cube of 6 N^3 tetrahedra (20 M
of N = 150), with the parts ``bottom`` and ``top``; then
``mpirun -n P python3 -m scripts.benchmarks.reading read FILE.xdmf`` reads and checks it.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from itertools import permutations
from pathlib import Path

import numpy as np
from mpi4py import MPI

from contact.mesh.cells import TETRAHEDRON
from contact.mesh.contents import Cells, Groups
from contact.mesh.geometry import area, volume
from contact.mesh.reader import from_file
from contact.mesh.xdmf import write_distributed
from scripts.benchmarks.bench_one import memory


def cube(n: int) -> Cells:
    """Return a unit cube, each of its n^3 cubes cut into six tetrahedra (Kuhn)."""
    g = np.arange(n + 1) / n
    points = np.stack(np.meshgrid(g, g, g, indexing="ij"), axis=-1).reshape(-1, 3)
    numbers = np.arange(len(points)).reshape(n + 1, n + 1, n + 1)
    first, steps = numbers[:-1, :-1, :-1].ravel(), ((n + 1) ** 2, n + 1, 1)
    ways = [np.cumsum([0, *(steps[axis] for axis in way)]) for way in permutations(range(3))]
    cells = np.concatenate([first[:, None] + way for way in ways])
    flat = [np.cumsum([0, *(steps[axis] for axis in way)]) for way in permutations(range(2))]
    sides = [numbers[:-1, :-1, k].ravel()[:, None] + way for k in (0, n) for way in flat]
    labels = np.repeat(np.array([0, 1], dtype=np.int32), 2 * n * n)
    of_all = np.zeros(len(cells), dtype=np.int32)
    return Cells(
        TETRAHEDRON,
        points,
        Groups(("body",), cells, of_all, ((0,),)),
        Groups(("bottom", "top"), np.concatenate(sides), labels, ((0,), (1,))),
        {},
        (),
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Write a mesh, or read one and print the costs."""
    made = argparse.ArgumentParser(description=__doc__)
    made.add_argument("action", choices=("make", "read"))
    made.add_argument("file", type=Path)
    made.add_argument("n", type=int, nargs="?", default=20)
    given, comm = made.parse_args(arguments), MPI.COMM_WORLD
    if given.action == "make":
        write_distributed(cube(given.n), given.file)
        return
    before, begin = memory(), time.perf_counter()
    domain = from_file(comm, given.file)
    seconds = time.perf_counter() - begin
    # Its volume and areas are 1.
    found = {
        "ranks": comm.size,
        "cells": domain.mesh.topology.index_map(3).size_global,
        "seconds": seconds,
        "memory": memory(),
        "before": before,
        "volume": volume(domain),
        "areas": [area(domain, part) for part in ("bottom", "top")],
    }
    if comm.rank == 0:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
