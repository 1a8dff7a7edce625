"""Rigid motions as a near-nullspace of multigrid."""

from __future__ import annotations

from mpi4py import MPI
from petsc4py import PETSc

from contact.linear.layout import Layout


def rigid_motions(layout: Layout) -> PETSc.NullSpace:
    """Return the rigid motions of the displacement, orthonormalised, fixed or not. Collective."""
    d, index_map = layout.dim, layout.index_map
    if layout.revolved:
        return _along_axis(layout)
    size = (index_map.size_local * d, index_map.size_global * d)
    coordinates = PETSc.Vec().createMPI(size, d, layout.comm)
    # Rotations about the middle, in units of the size: far from the origin they would be lost.
    total = layout.comm.allreduce(layout.points.sum(axis=0), op=MPI.SUM)
    middle = total / index_map.size_global
    coordinates.array[:] = ((layout.points - middle) / layout.size).ravel()
    return PETSc.NullSpace().createRigidBody(coordinates)


def _along_axis(layout: Layout) -> PETSc.NullSpace:
    """Return the only rigid motion of a body of revolution."""
    size = (layout.index_map.size_local * 2, layout.index_map.size_global * 2)
    motion = PETSc.Vec().createMPI(size, 2, layout.comm)
    motion.array[1::2] = 1.0
    motion.normalize()
    return PETSc.NullSpace().create(vectors=[motion], comm=layout.comm)


def held_motions(layout: Layout) -> PETSc.NullSpace:
    """Return the rigid motions, 0 where the displacement is fixed, orthonormalised. Collective."""
    free = layout.free[:, : layout.dim].ravel()
    vectors: list[PETSc.Vec] = []
    for motion in rigid_motions(layout).getVecs():
        vector = motion.copy()  # PETSc locks those of a null space
        vector.array[:] *= free
        for other in vectors:
            vector.axpy(-vector.dot(other), other)
        vector.normalize()
        vectors.append(vector)
    return PETSc.NullSpace().create(vectors=vectors, comm=layout.comm)
