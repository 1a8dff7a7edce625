"""The environment of a run: versions, and the BLAS that decides the speed of MUMPS."""

from __future__ import annotations

import platform
import re
from collections.abc import Iterable
from pathlib import Path

#: Name of the slow implementation.
REFERENCE = "reference"

#: Name -> pattern of the path of its library, in the order of preference where several are loaded.
#: Debian's alternatives put optimised libraries under the plain name too, in folders that tell;
#: any other is the reference.
_LIBRARIES = {
    "OpenBLAS": r"openblas",
    "MKL": r"libmkl_",
    "BLIS": r"libblis",
    "FlexiBLAS": r"flexiblas",
    "ATLAS": r"atlas",
    REFERENCE: r"/lib[ck]?blas\.so",
}
#: NumPy's wheels bring an OpenBLAS of their own, which PETSc does not use.
_PRIVATE = r"numpy\.libs|scipy\.libs|libscipy_openblas"

ADVICE = (
    "warning: the reference BLAS is in use; direct solves are about six times faster with "
    "OpenBLAS (Debian, Ubuntu: apt install libopenblas0-pthread)"
)


def identify(paths: Iterable[str]) -> tuple[str, str]:
    """Return the name of the BLAS among the paths of loaded libraries, and its path.

    The name is for instance "OpenBLAS", `REFERENCE` or "unknown"; the path of that is empty.
    """
    candidates = sorted({path for path in paths if not re.search(_PRIVATE, path)})
    for name, pattern in _LIBRARIES.items():
        for path in candidates:
            if re.search(pattern, path):
                return name, path
    return "unknown", ""


def blas() -> tuple[str, str]:
    """Return name and path of the BLAS that this process has loaded, after loading PETSc."""
    from petsc4py import PETSc  # noqa: F401  loads the library

    maps = Path("/proc/self/maps")
    if not maps.exists():
        return "unknown", ""
    lines = (line.split(maxsplit=5) for line in maps.read_text().splitlines())
    return identify(fields[5] for fields in lines if len(fields) == 6)


def versions() -> dict[str, str]:
    """Return the versions of Python, of the libraries, and the BLAS."""
    import dolfinx
    import mpi4py
    import numpy
    import ufl
    from mpi4py import MPI
    from petsc4py import PETSc

    return {
        "python": platform.python_version(),
        "dolfinx": dolfinx.__version__,
        "ufl": ufl.__version__,
        "petsc": ".".join(str(part) for part in PETSc.Sys.getVersion()),
        "mpi4py": mpi4py.__version__,
        "mpi": MPI.Get_library_version().splitlines()[0].split(",")[0].rstrip("\0"),
        "numpy": numpy.__version__,
        "blas": blas()[0],
    }
