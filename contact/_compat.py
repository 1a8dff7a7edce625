"""Versions: differences of dolfinx 0.9 to 0.11 and their PETSc, faults around them, the BLAS.

The BLAS decides the speed of MUMPS.
"""

from __future__ import annotations

import ctypes
import inspect
import os
import platform
import re
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import dolfinx
import mpi4py
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem, graph
from dolfinx.common import IndexMap
from dolfinx.mesh import Mesh
from mpi4py import MPI
from petsc4py import PETSc

#: Of the messages by which an index map finds out whom it is asked by; dolfinx's own in 0.9.
TAG = 1202

_DOFMAPS: WeakKeyDictionary[Mesh, npt.NDArray[np.int32]] = WeakKeyDictionary()


def geometry_degree(mesh: Mesh) -> int:
    """Polynomial degree of the cells' geometry."""
    geometry = mesh.geometry
    # 0.11 deprecates cmap in favour of a list with one map a cell type.
    cmap = geometry.cmaps[0] if hasattr(geometry, "cmaps") else geometry.cmap
    return cmap.degree


def geometry_dofmap(mesh: Mesh) -> npt.NDArray[np.int32]:
    """Geometry nodes of each cell, shape (cells, nodes a cell)."""
    geometry = mesh.geometry
    if not hasattr(geometry, "dofmaps"):
        return geometry.dofmap
    # 0.11 copies all of it each time that it is asked for.
    if mesh not in _DOFMAPS:
        _DOFMAPS[mesh] = geometry.dofmaps[0]
    return _DOFMAPS[mesh]


def interpolation_points(space: fem.FunctionSpace) -> npt.NDArray[np.float64]:
    """Points of a reference cell at which a function is asked for to be interpolated."""
    points = space.element.interpolation_points
    # A method up to 0.9.
    return np.asarray(points() if callable(points) else points)


def original_cells(mesh: Mesh) -> npt.NDArray[np.int64]:
    """Input index of each local cell, shape (cells,)."""
    original = mesh.topology.original_cell_index
    # One array a cell type since 0.10.
    return np.asarray(original[0] if isinstance(original, list) else original)


def facet_entities(mesh: Mesh, facets: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """Return exterior facets as pairs (cell, facet of the cell), flat, to integrate over.

    The mesh must have the connectivities of facets to cells and back.
    """
    compute = fem.compute_integration_domains
    # The dimension of the entities is an argument up to 0.9 only.
    dim = (mesh.topology.dim - 1,) if "dim" in inspect.signature(compute).parameters else ()
    return np.asarray(compute(fem.IntegralType.exterior_facet, mesh.topology, facets, *dim))


def destinations(ranks: npt.NDArray[np.int32]) -> Any:
    """Return the result of a partitioner: the rank that each cell goes to."""
    made = graph.adjacencylist(ranks, np.arange(len(ranks) + 1, dtype=np.int32))
    # An object of Python since 0.10.
    return getattr(made, "_cpp_object", made)


def ghosted_map(
    comm: MPI.Intracomm,
    count: int,
    ghosts: npt.NDArray[np.int64],
    owners: npt.NDArray[np.int32],
) -> IndexMap:
    """Return the map of `count` own indices and of ghosts with their owners. Collective."""
    # The tag of its messages is an argument without a default in 0.11.
    tag = (TAG,) if "tag: int" in (IndexMap.__init__.__doc__ or "") else ()
    return IndexMap(comm, count, ghosts, owners, *tag)


def collapse(
    subspace: fem.FunctionSpace,
) -> tuple[fem.FunctionSpace, npt.NDArray[np.int32]]:
    """Subspace as a space of its own, and its dofs' numbers in the whole space. Collective."""
    space, dofs = subspace.collapse()
    # One array a cell type since 0.11.
    several = len(dofs) > 0 and np.ndim(dofs[0]) > 0
    return space, np.asarray(dofs[0] if several else dofs, dtype=np.int32)


def vtk_needs_display() -> bool:
    """Whether VTK aborts where it draws without a display, as before 9.4."""
    return bool(import_module("pyvista").vtk_version_info < (9, 4))


def surface(grid: Any) -> Any:
    """Surface of a pyvista grid; of cells of degree 2 four facets of each."""
    extract = grid.extract_surface
    # Without it pyvista warns since 0.47.
    known = "algorithm" in inspect.signature(extract).parameters
    algorithm = {"algorithm": "dataset_surface"} if known else {}
    return extract(nonlinear_subdivision=1, **algorithm)


def keeps_inverted_blocks() -> bool:
    """Whether PETSc keeps the inverted nodal blocks of a matrix whose values have changed.

    Since 3.25 MatInvertBlockDiagonal, and with it the preconditioner pbjacobi, does not renew them.
    """
    return bool(PETSc.Sys.getVersion() >= (3, 25))


# petsc4py to 3.25 has no Schur complements of factorisations: they are PETSc's own, by ctypes.
_petsc = ctypes.CDLL(PETSc.__file__)

#: PETSc's MAT_FACTOR_SCHUR_INVERTED.
INVERTED = 2


def _check(code: int) -> None:
    if code != 0:
        raise PETSc.Error(code)


def set_schur_unknowns(factor: PETSc.Mat, unknowns: PETSc.IS) -> None:
    """Tell a matrix to be factorised the unknowns of its Schur complement. Collective."""
    handles = (factor.handle, unknowns.handle)
    _check(_petsc.MatFactorSetSchurIS(*map(ctypes.c_void_p, handles)))


def take_schur_complement(factor: PETSc.Mat, size: int) -> npt.NDArray[np.float64]:
    """Copy the Schur complement out of a factorisation, as MUMPS stores it: by columns.

    PETSc multiplies reduced right-hand sides by the inverse of its own one: the identity is left.
    """
    handle, values, status = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_int()
    handles = ctypes.c_void_p(factor.handle), ctypes.byref(handle)
    _check(_petsc.MatFactorGetSchurComplement(*handles, ctypes.byref(status)))
    _check(_petsc.MatDenseGetArray(handle, ctypes.byref(values)))
    pointer = ctypes.cast(values, ctypes.POINTER(ctypes.c_double))
    there = np.ctypeslib.as_array(pointer, (size, size))
    matrix = there.copy().T
    there[:] = 0.0
    np.fill_diagonal(there, 1.0)
    _check(_petsc.MatDenseRestoreArray(handle, ctypes.byref(values)))
    _check(_petsc.MatFactorRestoreSchurComplement(*handles, INVERTED))
    return matrix


def lasting(comm: MPI.Intracomm) -> MPI.Intracomm:
    """Return a communicator of the same ranks that lives as long as the program, if there is one.

    mpi4py from 4.0 on keeps a lock with each communicator that it has sent Python objects by. Where
    a mesh's own is freed the lock may remain taken, and the program does not end: Python objects
    are sent by this one.
    """
    same = MPI.IDENT, MPI.CONGRUENT
    whole = (MPI.COMM_WORLD, MPI.COMM_SELF)
    return next((known for known in whole if MPI.Comm.Compare(comm, known) in same), comm)


#: Variables of the environment by which users set glibc's allocator, their numbers for `mallopt`,
#: and values on one rank and on several: the most arrays that are mapped, the size of one (bytes)
#: from which it is, and the room at the end (bytes) from which that is returned. Memory that is
#: returned and taken again is cleared by the system; of several ranks each would keep its own.
ALLOCATOR = (
    ("MALLOC_MMAP_MAX_", -4, (65_536, 65_536)),
    ("MALLOC_MMAP_THRESHOLD_", -3, (32 << 20, 1 << 20)),
    ("MALLOC_TRIM_THRESHOLD_", -1, (256 << 20, 1 << 20)),
)


def destroy_unused(*comms: MPI.Intracomm) -> None:
    """Destroy objects of PETSc that are no longer in use. Collective.

    Where several ranks share one, petsc4py leaves it to this call: each collects its garbage at
    another moment. Those of one rank alone are destroyed at once.
    """
    for comm in comms:
        if comm.size > 1:
            PETSc.garbage_cleanup(comm)


def give_memory_back() -> None:
    """Let the allocator return freed memory to the system, where it is glibc's.

    SuperLU_DIST, which PETSc may load, tells it to map no large arrays and never to return any:
    memory that one phase has freed would lie beside that of the next.
    """
    allocator = getattr(ctypes.CDLL(None), "mallopt", None)
    for name, number, values in ALLOCATOR:
        if allocator is not None and name not in os.environ:
            allocator(number, values[MPI.COMM_WORLD.size > 1])


give_memory_back()

# Threads of PT-Scotch race: a mesh would be distributed otherwise from run to run, and the problems
# beside one, for derivatives by a number of its mesh, would have other nodes on a rank.
os.environ.setdefault("SCOTCH_PTHREAD_NUMBER", "1")


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


def blas_among(paths: Iterable[str]) -> tuple[str, str]:
    """Return name and path of the BLAS among loaded libraries; "unknown" and "" without one."""
    candidates = sorted({path for path in paths if not re.search(_PRIVATE, path)})
    for name, pattern in _LIBRARIES.items():
        for path in candidates:
            if re.search(pattern, path):
                return name, path
    return "unknown", ""


def blas() -> tuple[str, str]:
    """Return name and path of the BLAS that this process has loaded, by PETSc for instance."""
    maps = Path("/proc/self/maps")
    if not maps.exists():
        return "unknown", ""
    lines = (line.split(maxsplit=5) for line in maps.read_text().splitlines())
    return blas_among(fields[5] for fields in lines if len(fields) == 6)


def versions() -> dict[str, str]:
    """Return the versions of Python, of the libraries, and the BLAS."""
    vendor, numbers = MPI.get_vendor()
    return {
        "python": platform.python_version(),
        "dolfinx": dolfinx.__version__,
        "ufl": ufl.__version__,
        "petsc": ".".join(str(part) for part in PETSc.Sys.getVersion()),
        "mpi4py": mpi4py.__version__,
        "mpi": f"{vendor} v{'.'.join(str(part) for part in numbers)}",
        "numpy": np.__version__,
        "blas": blas()[0],
    }


def export_page(plotter: Any, path: Path) -> None:
    """Write the scene of a PyVista plotter as a page; ImportError without its packages."""
    # Later plotters have one of this name too, which warns; `trame` comes with its packages alone.
    moved = import_module("pyvista").version_info >= (0, 49)
    (plotter.trame if moved else plotter).export_html(path)
