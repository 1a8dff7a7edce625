"""``contact materials``, ``contact schema``: materials by name, the JSON schema of a case file."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.case.schema import schema
from contact.cli.main import CONVERGED
from contact.library.materials import PACKAGED, Entry, find, library
from contact.ranks import on_root


def run(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Print the list of materials, one of them, or the schema."""

    def text() -> str:
        if options.command == "schema":
            return json.dumps(schema(), indent=1, ensure_ascii=False)
        path = PACKAGED if options.file is None else Path(options.file)
        return listing(path) if options.name is None else description(find(options.name, path))

    found = on_root(comm, text)
    if comm.rank == 0:
        print(found)
    return CONVERGED


def listing(path: Path = PACKAGED) -> str:
    """Return the names of a library, each with its class and source."""
    known = library(path).values()
    width = max((len(entry.name) for entry in known), default=0)
    return "\n".join(f"{e.name:{width}}  {e.symmetry:9}  {e.source}" for e in known)


def description(entry: Entry) -> str:
    """Return the constants of a material and those that follow from them."""
    s = entry.compliance
    lines = [
        f"{entry.name}, {entry.symmetry}",
        f"source: {entry.source}",
        f"checked against: {entry.checked or 'nothing'}",
        f"temperature: {entry.temperature}; {entry.condition}",
        "order of indices: 11, 22, 33, 23, 13, 12",
        "",
        *_matrix("stiffness c (GPa)", entry.stiffness / 1e9),
        *_matrix("compliance s (1/TPa)", s * 1e12),
        "Young's modulus along 1, 2, 3 (GPa): " + _numbers(1e-9 / np.diag(s)[:3]),
        "Poisson's ratios nu12, nu13, nu23: "
        + _numbers(-s[[0, 0, 1], [1, 2, 2]] / np.diag(s)[[0, 0, 1]]),
    ]
    if entry.coupling is None or entry.permittivity is None:
        return "\n".join(lines)
    free = entry.free_permittivity
    lines += [
        "",
        *_matrix("coupling e (C/m2)", entry.coupling),
        *_matrix("d = e s (pC/N)", entry.charge_constants * 1e12),
        *_matrix("g (mV m/N)", entry.voltage_constants * 1e3),
        "permittivity at constant strain 11, 22, 33 (nF/m): "
        + _numbers(1e9 * np.diag(entry.permittivity)),
        f"permittivity at constant stress 11, 22, 33 (nF/m): {_numbers(1e9 * np.diag(free))}",
        "coupling of bars: "
        + ", ".join(
            f"k{i + 1}{j + 1} = {entry.bar_coupling(i, j):.4g}"
            for i, j in ((2, 2), (2, 0), (0, 4), (0, 0))
            if entry.bar_coupling(i, j) > 1e-9
        ),
    ]
    return "\n".join(lines)


def _matrix(title: str, rows: NDArray[np.floating]) -> list[str]:
    return [title, *("  " + "".join(f"{x:10.4g}" for x in row + 0.0) for row in rows), ""]


def _numbers(values: NDArray[np.floating]) -> str:
    return ", ".join(f"{x:.4g}" for x in values)
