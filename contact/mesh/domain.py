"""A mesh and its boundary parts, by name.

Parts may overlap (the side ``top`` and a piece ``loaded`` of it), while a facet tag holds
one number. The tag of a facet is therefore a bit mask of the parts that it belongs to, and
a part is the set of masks that contain its bit.
"""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.errors import InputError

#: Facet tags are 32-bit signed integers, one bit a part.
MAX_PARTS = 31


@dataclass(frozen=True)
class Domain:
    """A mesh with named boundary parts, made by the functions of `contact.mesh`.

    Attributes
    ----------
    mesh
        Mesh of triangles or tetrahedra with straight edges.
    facet_tags
        The exterior facets that this rank owns, each with the bit mask of its parts (0: in none).
    parts
        Name of a part -> the tag values, present on any rank, that contain the part. The same
        on all ranks.
    size
        Largest extent of the bounding box of the whole mesh (of a generated one: before its
        rotation, so that lengths derived from it do not depend on the rotation).
    levels
        How often the mesh has been refined: 2**levels of its edges make up one straight edge of
        the mesh that met a curved boundary.
    """

    mesh: dmesh.Mesh
    facet_tags: dmesh.MeshTags
    parts: Mapping[str, tuple[int, ...]]
    size: float
    levels: int = 0

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator of the mesh."""
        return self.mesh.comm

    @property
    def dim(self) -> int:
        """Space dimension, 2 or 3."""
        return self.mesh.geometry.dim

    @property
    def dx(self) -> ufl.Measure:
        """Measure over the cells."""
        return ufl.Measure("dx", domain=self.mesh)

    def tag_values(self, name: str) -> tuple[int, ...]:
        """Return the tag values that make up the part ``name``.

        Raises
        ------
        InputError
            If there is no such part; the message names the nearest one and lists all.
        """
        if name not in self.parts:
            near = difflib.get_close_matches(str(name), self.parts, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise InputError(
                f"the mesh has no part {name!r}{hint} (its parts: {', '.join(sorted(self.parts))})"
            )
        return self.parts[name]

    def facets(self, name: str) -> npt.NDArray[np.int32]:
        """Local indices of the facets of part ``name`` that this rank owns, ascending."""
        chosen = np.isin(self.facet_tags.values, self.tag_values(name))
        return self.facet_tags.indices[chosen]

    def ds(self, name: str) -> ufl.Measure:
        """Measure over the facets of part ``name``."""
        return ufl.Measure(
            "ds",
            domain=self.mesh,
            subdomain_data=self.facet_tags,
            subdomain_id=self.tag_values(name),
        )


def tagged(
    mesh: dmesh.Mesh,
    facets: npt.NDArray[np.int32],
    marks: Mapping[str, npt.NDArray[np.bool_]],
    size: float | None = None,
) -> Domain:
    """Make a domain of a mesh and one mask over its exterior facets a part. Collective.

    Parameters
    ----------
    facets
        Exterior facets that this rank owns, shape (n,), ascending.
    marks
        Part -> mask of shape (n,); the same names in the same order on all ranks.
    size
        Largest extent of the body; computed if not given.

    Raises
    ------
    InputError
        If a part has no facet on any rank, or there are too many parts.
    """
    names = list(marks)
    if len(names) > MAX_PARTS:
        raise InputError(f"the mesh has {len(names)} boundary parts; at most {MAX_PARTS} can be")
    values = np.zeros(facets.size, dtype=np.int32)
    for bit, name in enumerate(names):
        values[marks[name]] |= 1 << bit
    present = mesh.comm.allgather(np.unique(values))
    masks = np.unique(np.concatenate(present)).tolist()
    parts = {name: tuple(m for m in masks if m >> bit & 1) for bit, name in enumerate(names)}
    empty = [name for name, tag_values in parts.items() if not tag_values]
    if empty:
        raise InputError(f"the part {empty[0]!r} contains no facet of the mesh's boundary")
    tags = dmesh.meshtags(mesh, mesh.topology.dim - 1, facets, values)
    tags.name = "parts"
    return Domain(mesh, tags, parts, _extent(mesh) if size is None else size)


def _extent(mesh: dmesh.Mesh) -> float:
    """Largest extent of the bounding box over all ranks; a rank may hold no node."""
    x = mesh.geometry.x
    low = x.min(axis=0, initial=np.inf)
    high = x.max(axis=0, initial=-np.inf)
    mesh.comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    mesh.comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    return float((high - low).max())


def exterior_facets(mesh: dmesh.Mesh) -> npt.NDArray[np.int32]:
    """Exterior facets that this rank owns, ascending. Collective."""
    tdim = mesh.topology.dim
    mesh.topology.create_entities(tdim - 1)
    mesh.topology.create_connectivity(tdim - 1, tdim)
    mesh.topology.create_connectivity(tdim - 1, 0)
    return np.sort(dmesh.exterior_facet_indices(mesh.topology))


def rotate(mesh: dmesh.Mesh, degrees: float, axis: Sequence[float] = (0.0, 1.0, 0.0)) -> None:
    """Turn a mesh in place about an axis through the origin (Rodrigues' formula)."""
    if degrees == 0.0:
        return
    a, b, c = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    cross = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    angle = np.deg2rad(degrees)
    turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    mesh.geometry.x[:] = mesh.geometry.x @ turn.T
