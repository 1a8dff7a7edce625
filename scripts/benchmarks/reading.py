"""A large mesh of which each rank reads its share: the peak memory of all ranks.

``python3 -m scripts.benchmarks.reading make FILE.xdmf N`` writes a cube of 6 N^3 tetrahedra (20 M
of N = 150), with the parts ``bottom`` and ``top``; then
``mpirun -n P python3 -m scripts.benchmarks.reading read FILE.xdmf`` reads and checks it.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from mpi4py import MPI

from contact.mesh.geometry import area, volume
from contact.mesh.grid import box
from contact.mesh.reader import from_file, write
from scripts.benchmarks.bench_one import memory


def main(arguments: Sequence[str] | None = None) -> None:
    """Write a mesh, or read one and print the costs."""
    made = argparse.ArgumentParser(description=__doc__)
    made.add_argument("action", choices=("make", "read"))
    made.add_argument("file", type=Path)
    made.add_argument("n", type=int, nargs="?", default=20)
    given, comm = made.parse_args(arguments), MPI.COMM_WORLD
    if given.action == "make":
        write(box(MPI.COMM_SELF, [0.0] * 3, [1.0] * 3, [given.n] * 3), given.file)
        return
    domain = from_file(comm, given.file)
    cells = domain.mesh.topology.index_map(3).size_global
    found = {"ranks": comm.size, "cells": cells, "memory": memory()}
    sizes = volume(domain), area(domain, "bottom"), area(domain, "top")
    assert np.allclose(sizes, 1.0)
    if comm.rank == 0:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
