"""Local contact problems in files of FCLIB, to be exchanged with other solvers.

The layout is that of ``fclib_write_local``: `/fclib_local/spacedim`, `/fclib_local/W` with
`m, n, nzmax, nz, p, i, x`, `/fclib_local/vectors/q` and `mu`, `/fclib_local/info`; a solution in
`/solution/u` and `/solution/r`. Matrices are triplets (nz >= 0), compressed columns (-1) or
compressed rows (-2).

References
----------
https://github.com/FrictionalContactLibrary/fclib
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array

from contact.errors import InputError
from contact.methods.convex.cones import Array
from contact.methods.convex.local import LocalProblem, LocalSolution

GROUP = "fclib_local"


def write_fclib(
    path: Path, problem: LocalProblem, title: str, solution: LocalSolution | None = None
) -> None:
    """Write a problem, and its solution if there is one."""
    size = problem.free.size
    with _h5py().File(path, "w") as file:
        group = file.create_group(GROUP)
        _integers(group, spacedim=problem.dim)
        matrix = group.create_group("W")
        _integers(matrix, nzmax=size**2, m=size, n=size, nz=-1)
        matrix["p"] = np.arange(size + 1, dtype=np.int32) * size
        matrix["i"] = np.tile(np.arange(size, dtype=np.int32), size)
        matrix["x"] = problem.flexibility.T.ravel()
        vectors = group.create_group("vectors")
        vectors["q"], vectors["mu"] = problem.free, problem.coefficient
        info = group.create_group("info")
        info["title"] = np.bytes_(title)
        info["description"] = np.bytes_("an elastic body condensed onto its contact nodes")
        info["math_info"] = np.bytes_("W symmetric, positive definite, dense")
        if solution is not None:
            known = file.create_group("solution")
            known["u"], known["r"] = solution.jump.ravel(), solution.force.ravel()


def read_fclib(path: Path) -> LocalProblem:
    """Read a problem.

    Raises
    ------
    InputError
        If the file is none of FCLIB, its problem is not local, or has equations besides.
    """
    h5py = _h5py()
    try:
        with h5py.File(path, "r") as file:
            if GROUP not in file:
                raise InputError(f"{path}: no group /{GROUP}; accepted: a local problem of FCLIB")
            group = file[GROUP]
            if "V" in group or "R" in group:
                raise InputError(f"{path}: has equations V, R besides; accepted: W, q, mu alone")
            matrix = _matrix({name: group["W"][name][()] for name in group["W"]})
            q, mu = (np.asarray(group["vectors"][name][()], float) for name in ("q", "mu"))
            spacedim = int(group["spacedim"][()].ravel()[0])
    except (OSError, KeyError) as error:
        raise InputError(f"{path}: {error}; accepted: a file of FCLIB") from error
    if matrix.shape != (q.size, q.size) or q.size != spacedim * mu.size or not mu.size:
        raise InputError(
            f"{path}: W of {matrix.shape}, q of {q.size}, mu of {mu.size} in {spacedim} "
            "dimensions; accepted: sizes that fit each other"
        )
    return LocalProblem((matrix + matrix.T) / 2, q, mu)


def _integers(group: Any, **values: int) -> None:
    for name, value in values.items():
        group[name] = np.array([value], dtype=np.int32)


def _matrix(of: dict[str, Any]) -> Array:
    """Return a matrix of any of the three storages, dense."""
    m, n, nz = (int(of[name].ravel()[0]) for name in ("m", "n", "nz"))
    x, i, p = of["x"], of["i"], of["p"]
    if nz >= 0:
        stored = coo_array((x[:nz], (p[:nz], i[:nz])), shape=(m, n))
    else:
        stored = (csc_array if nz == -1 else csr_array)((x, i, p), shape=(m, n))
    return np.asarray(stored.toarray(), dtype=float)


def _h5py() -> Any:
    try:
        return import_module("h5py")
    except ImportError as error:
        raise InputError(
            "files of FCLIB need h5py, which is not installed; accepted: Debian's python3-h5py, "
            "or pip install h5py"
        ) from error
