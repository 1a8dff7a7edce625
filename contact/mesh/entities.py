"""Facets, groups of indices, and the extent of a mesh."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from mpi4py import MPI

Indices: TypeAlias = npt.NDArray[np.int32]


def combinations(
    count: int, groups: Iterable[npt.NDArray[np.integer[Any]]]
) -> tuple[Indices, tuple[tuple[int, ...], ...]]:
    """Write groups of indices that may overlap as one number an index.

    Returns
    -------
    For each of the indices 0, ..., count - 1 a number, and for each number the groups, by their
    positions, that the index is in.
    """
    numbers = np.zeros(count, dtype=np.int32)
    combined: list[tuple[int, ...]] = [()]
    for position, group in enumerate(groups):
        members = np.unique(group)
        # What a number stood for so far divides into those within the group and those without.
        met, within = np.unique(numbers[members], return_inverse=True)
        numbers[members] = len(combined) + within
        combined += [(*combined[old], position) for old in met]
    return numbers, tuple(combined)


def extent(mesh: dmesh.Mesh) -> float:
    """Largest extent of the bounding box over all ranks; a rank may hold no node."""
    x = mesh.geometry.x
    low = x.min(axis=0, initial=np.inf)
    high = x.max(axis=0, initial=-np.inf)
    mesh.comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    mesh.comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    return float((high - low).max())


def exterior_facets(mesh: dmesh.Mesh) -> Indices:
    """Exterior facets that this rank owns, ascending. Collective."""
    tdim = mesh.topology.dim
    mesh.topology.create_entities(tdim - 1)
    mesh.topology.create_connectivity(tdim - 1, tdim)
    mesh.topology.create_connectivity(tdim, tdim - 1)
    mesh.topology.create_connectivity(tdim - 1, 0)
    return np.sort(dmesh.exterior_facet_indices(mesh.topology))
