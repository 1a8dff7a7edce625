"""The dual mortar operator of two surfaces: jump, weights, normals and gaps at the slave nodes.

The multiplier is sum_j lambda_j Phi_j with functions Phi_j that are dual to the slave's,
int Phi_j N~_k = delta_jk w_k, w_k = int N~_k over the part of the slave that faces the master. The
rows of the jumps T = [D, -M] are divided by these areas (`JumpRows`),

    [u]_j = sum_k D_jk u_k - sum_l M_jl u_l,   D_jk = w_j^-1 int Phi_j N_k,
                                               M_jl = w_j^-1 int Phi_j (N_l o Pi),

where Popp and others have D and M without w_j^-1. D is the identity; A^-T on quadratic triangles,
where N~ = A N (`dual_basis_transformation`). Slave nodes without multiplier, as at crosspoints,
leave their functions to other nodes (`ModifiedDualBasis`): the rows of D of these contain them too.

`integrate` has these integrals over the facets of one rank, `couple` their sums at the rank of each
node.

References
----------
Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989 (dual basis); Popp, Gitterle, Gee and Wall, Int. J.
Numer. Methods Engrg. 83 (2010) 1428 (segments in 3-D); Cichosz and Bischoff, Comput. Methods
Appl. Mech. Engrg. 200 (2011) 1317 (partly covered facets).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import block_diag

from contact.interface.mortar.lumping import JumpRows, integrals
from contact.interface.mortar.search import Opposite, nearest_named
from contact.interface.mortar.segments import Points, common_points
from contact.interface.mortar.surface import Surface, dual_basis_transformation
from contact.mesh.owners import Owners, sparse_rows
from contact.tolerances import NEGLIGIBLE, ROUNDING
from contact.typing import Array

#: Rows, columns and values of a sparse matrix.
Entries = tuple[NDArray[np.int64], NDArray[np.int64], Array]

#: No nodes.
NOTHING: NDArray[np.int64] = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class ModifiedDualBasis:
    """The dual basis Phi'_j = Phi_j + sum_k m_jk Phi_k, without functions of some nodes k.

    These are crosspoints, whose displacement along the normal is prescribed, and others without a
    multiplier. With sum_j m_jk = 1 multipliers contain the constants.
    """

    nodes: NDArray[np.int64]  #: global numbers of the nodes j of each facet's functions, (f, k)
    functions: Array  #: the functions by the facet's own, shape (f, k, k)

    @staticmethod
    def of(
        slave: Surface, no_multiplier: NDArray[np.int64], barely: NDArray[np.int64] = NOTHING
    ) -> ModifiedDualBasis:
        """Return the basis without functions of some nodes, given by global numbers. Collective.

        m_jk is the same for the other nodes j of a facet; on one without any it is 1 for the
        nearest corner of another facet, of any rank. If some of its nodes `barely` face the master,
        its functions, which are small, are left out.
        """
        without = np.isin(slave.nodes, no_multiplier)
        gone = without | np.isin(slave.nodes, barely)
        kept = ~gone
        among = kept / np.maximum(kept.sum(axis=1, keepdims=True), 1)
        functions = among[:, :, None] * gone[:, None, :] + kept[:, :, None] * np.eye(gone.shape[1])
        nodes, corners = slave.nodes.copy(), kept[:, : slave.corners.shape[1]]
        alone = np.flatnonzero(without.all(axis=1))
        names, places = slave.nodes[:, : corners.shape[1]][corners], slave.corners[corners]
        beside = nearest_named(slave.owners.comm, slave.centres[alone], places, names)
        alone, beside = alone[beside >= 0], beside[beside >= 0]
        nodes[alone, 0] = beside
        functions[alone, 0] = 1.0
        return ModifiedDualBasis(nodes, functions)


@dataclass(frozen=True)
class Parts:
    """Contributions of the facets of a rank, by facet and function.

    Attributes
    ----------
    nodes
        Global numbers of the facets' nodes, shape (f, k).
    dual_nodes
        Those of the nodes whose functions Phi' these are, shape (f, k).
    facet_mass
        int Phi_i N~_j over the part that faces the master, shape (f, k, k).
    normal
        int N~_i times the direction where the facets face the master, shape (f, k, d).
    open_nodes, whole, open_normal
        Before functions that barely face the master are handed over: as `dual_nodes`; int Phi_i
        over all of the facet, shape (f, k), and that times the slave's normal, shape (f, k, d).
    gap
        int Phi_i times the vector across, everywhere, where the sides do not cut each other, and
        between curved surfaces, shape (f, k, 3, d).
    rows, columns, values
        int Phi_i (N_l o Pi): numbers of the node of Phi' and of the master's node, shape (e,).
    depths
        As of `Coupling`.
    """

    nodes: NDArray[np.int64]
    dual_nodes: NDArray[np.int64]
    facet_mass: Array
    normal: Array
    open_nodes: NDArray[np.int64]
    whole: Array
    open_normal: Array
    gap: Array
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    values: Array
    depths: Array


def integrate(
    slave: Surface,
    master: Surface,
    facing: tuple[Array, list[Points]],
    basis: ModifiedDualBasis,
    open_basis: ModifiedDualBasis,
) -> Parts:
    """Integrate the dual functions of slave facets, alone and with the facets opposite.

    `facing` has directions and points (`_facing`).
    """
    direction, quadrature = facing
    change = dual_basis_transformation(slave.shape, slave.degree)
    dual, weight = _dual(slave, quadrature, change)
    dual, facet_mass = basis.functions @ dual, basis.functions * weight[:, None, :]
    whole = np.einsum("fij,fj->fi", open_basis.functions, integrals(slave))
    gap, normal = np.zeros((*weight.shape, 3)), np.zeros((*weight.shape, direction.shape[1]))
    entries: list[Entries] = [(NOTHING, NOTHING, np.zeros(0))]
    for points in quadrature:
        shares = points.weight[:, None] * _functions(points, slave, change)
        phi = np.einsum("pij,pj->pi", dual[points.slave], shares)
        across = np.column_stack([points.gap, np.maximum(points.gap, 0.0), points.curved_gap])
        _add(gap, points.slave, phi[:, :, None] * across[:, None, :])
        normals = _normals(points, slave, master, direction)
        _add(normal, points.slave, shares[:, :, None] * normals[:, None, :])
        entries.append(_master_entries(points, phi, basis.nodes, master))
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    return Parts(
        nodes=slave.nodes,
        dual_nodes=basis.nodes,
        facet_mass=facet_mass,
        normal=basis.functions @ normal,
        open_nodes=open_basis.nodes,
        whole=whole,
        open_normal=whole[:, :, None] * slave.normal[:, None, :],
        gap=gap[:, :, :, None] * direction[:, None, None, :],
        rows=rows,
        columns=columns,
        values=values,
        depths=np.max([np.full(slave.count, -np.inf), *(p.depth for p in quadrature)], axis=0),
    )


def _facing(slave: Surface, opposite: Opposite) -> tuple[Array, list[Points]]:
    """Return the directions along which facets look, (f, d), and the points where they meet."""

    def points(direction: Array) -> list[Points]:
        pairs = opposite.pairs(slave, direction)
        return [common_points(slave, opposite.master, pair, direction) for pair in pairs]

    quadrature = points(slave.normal)
    middle = _middle(slave, opposite.master, quadrature)
    if np.abs(middle - slave.normal).max(initial=0.0) <= ROUNDING:
        return slave.normal, quadrature
    return middle, points(middle)  # along them other facets are opposite


def _functions(points: Points, slave: Surface, change: Array) -> Array:
    """Return the functions N~ of the slave facets at points, shape (p, k)."""
    return slave.shape.lagrange(slave.degree, points.on_slave) @ change.T


def _normals(points: Points, slave: Surface, master: Surface, direction: Array) -> Array:
    """Return unit vectors at points between the normals of both sides, shape (p, d)."""
    # Straight facets keep their directions, since their normals jump at edges.
    if slave.order == 1:
        return direction[points.slave]
    i, j = points.slave, points.master
    normals = slave.normals(i, slave.slopes(i, points.on_slave))
    normals -= master.normals(j, master.slopes(j, points.on_master))
    return np.asarray(normals / np.linalg.norm(normals, axis=1)[:, None])


#: Share of a facet of degree 2 that faces the master, up to which it counts as facing nothing.
SLIVER = 1e-3


def _dual(slave: Surface, quadrature: Sequence[Points], change: Array) -> tuple[Array, Array]:
    """Return C of the dual functions Phi = C N~, (f, k, k), and int N~ where they face, (f, k)."""
    k = change.shape[0]
    mass, weight = np.zeros((slave.count, k, k)), np.zeros((slave.count, k))
    for points in quadrature:
        n = _functions(points, slave, change)
        _add(mass, points.slave, points.weight[:, None, None] * n[:, :, None] * n[:, None, :])
        _add(weight, points.slave, points.weight[:, None] * n)
    # The mass of quadratic functions on a sliver is singular to rounding.
    least = NEGLIGIBLE if slave.degree == 1 else SLIVER
    faces = weight.sum(axis=1) > least * integrals(slave).sum(axis=1)
    dual = np.zeros_like(mass)
    dual[faces] = weight[faces, :, None] * np.linalg.inv(mass[faces])
    return dual, np.where(faces[:, None], weight, 0.0)


def _middle(slave: Surface, master: Surface, quadrature: Sequence[Points]) -> Array:
    """Return directions between the normals of slave facets and of those opposite, shape (f, d)."""
    # Along them both curved sides have the same gaps; the normals of one side alone would turn some
    # of the closing of the gap into slip.
    total = np.zeros_like(slave.normal)
    for points in quadrature:
        _add(total, points.slave, points.weight[:, None] * master.normal[points.master])
    length = np.linalg.norm(total, axis=1)
    mean = total / np.where(length > 0, length, 1.0)[:, None]
    direction = slave.normal - mean
    return np.asarray(direction / np.linalg.norm(direction, axis=1)[:, None])


def _add(total: Array, index: NDArray[np.intp], values: Array) -> None:
    """Add values to rows of an array; several values may go to one row."""
    count, columns = total.shape[0], int(np.prod(total.shape[1:]))
    matrix = sparse.csr_array(
        (np.ones(index.size), (index, np.arange(index.size))), shape=(count, index.size)
    )
    total += (matrix @ values.reshape(index.size, columns)).reshape(total.shape)


def _master_entries(
    points: Points, phi: Array, dual_nodes: NDArray[np.int64], master: Surface
) -> Entries:
    """Return int Phi_j N_l as global row, global column, value."""
    n = master.shape.lagrange(master.degree, points.on_master)
    new = np.ones(points.slave.size, dtype=bool)
    new[1:] = (np.diff(points.slave) != 0) | (np.diff(points.master) != 0)
    first = np.flatnonzero(new)
    if first.size == 0:
        return NOTHING, NOTHING, np.zeros(0)
    values = np.add.reduceat(phi[:, :, None] * n[:, None, :], first, axis=0)
    rows = dual_nodes[points.slave[first]][:, :, None]
    columns = master.nodes[points.master[first]][:, None, :]
    rows, columns = np.broadcast_arrays(rows, columns)
    return rows.ravel(), columns.ravel(), values.ravel()


#: Share of a node's function that faces the master, up to which the node has no multiplier: at
#: degree 2 it may be negative on partly covered facets.
LEAST_COVERED = 1e-3

#: Least share of an overlap in the gaps at nodes, where facets are short enough to resolve it.
RESOLVED = 0.5


@dataclass(frozen=True)
class Coupling(JumpRows):
    """The jump of two surfaces at the slave nodes of this rank that carry a multiplier.

    Attributes
    ----------
    weight
        int Phi_j over the part that faces the master, int N~_j, shape (n,) (length^(d - 1)); over
        all of the facets where nothing faces the master.
    normal
        Unit vectors from the slave to the master, between their normals, shape (n, d).
    gap
        Weighted gap int Phi_j g / w_j of the distance g along them, shape (n,) (length); infinite
        where nothing faces the master.
    gap_positive_part
        int Phi_j max(g, 0) / int N~_j of the distance g at a point, whose mean is `gap`, shape
        (n,); below 0 by negative functions Phi_j alone.
    curved_gap
        Mean distance of the curved surfaces that facets approximate, shape (n,) (length); `gap` at
        degree 2.
    covered
        Share of int N~_j that faces the master, shape (n,).
    depth
        Of the deepest overlap, of facets and of the surfaces that they approximate (length), on
        all ranks.
    dual_nodes
        Global numbers of the nodes of the functions Phi' on the facets of this rank, shape (f, k).
    depths
        Of the deepest overlap on each of these; below 0 the least distance, shape (f,) (length).
    faces
        Share of each of these that faces the master, shape (f,).
    barely
        Global numbers of the nodes of this rank whose functions face the master, but by less than
        a multiplier takes.
    """

    weight: Array
    normal: Array
    gap: Array
    gap_positive_part: Array
    curved_gap: Array
    covered: Array
    depth: float
    dual_nodes: NDArray[np.int64]
    depths: Array
    faces: Array
    barely: NDArray[np.int64]

    def interference(self, owners: Owners, added: Array) -> tuple[float, bool]:
        """Return the largest depth of the overlap less an added gap at nodes (length). Collective.

        Also whether nodes have gaps below half of that, negative, wherever the overlap is half as
        deep.
        """
        comm = owners.comm
        least = comm.allreduce(float(added.min(initial=np.inf)), op=MPI.MIN)

        def at(numbers: NDArray[np.int64]) -> Array:
            """Return the gaps added at nodes of this rank, the least where there are none."""
            gaps = np.full(numbers.size, least)
            with_gap = np.isin(numbers, self.nodes)
            gaps[with_gap] = added[np.searchsorted(self.nodes, numbers[with_gap])]
            return gaps

        on_facets = owners.values(self.dual_nodes.ravel(), at).reshape(self.dual_nodes.shape)
        depths = self.depths - on_facets.max(axis=1)
        depth = comm.allreduce(float(depths.max(initial=0.0)), op=MPI.MAX)
        # A corner that cuts a long facet between its nodes leaves their mean gaps above 0. The gap
        # of a node beyond the corner, on a partly covered facet, is extrapolated.
        gap = self.curved_gap + added
        within = (gap < -RESOLVED * depth) & (gap > -2 * depth)
        pressed = owners.among(self.nodes[within], self.dual_nodes.ravel())
        missed = (depths > depth / 2) & ~np.isin(self.dual_nodes, pressed).any(axis=1)
        return depth, not comm.allreduce(bool(missed.any()), op=MPI.LOR)


def couple(
    slave: Surface,
    master: Surface,
    reach: float,
    no_multiplier: NDArray[np.int64] = NOTHING,
    nodes: NDArray[np.int64] | None = None,
) -> Coupling:
    """Integrate the dual mortar operator on the facets that this rank owns. Collective.

    Facets face each other up to the distance `reach` (length). `no_multiplier` has the global
    numbers of slave nodes without multiplier, at least those of this rank and of its facets
    (`ModifiedDualBasis`). `nodes` has those of this rank's nodes with a multiplier, whether they
    face the master or not; by default they are those that do. Functions that barely face the master
    are handed over to the other nodes of their facets, but on triangles of degree 2, where rows of
    D have other nodes, which would follow each other.
    """
    opposite, owners = Opposite.of(slave, master, reach), slave.owners
    facing = _facing(slave, opposite)
    change = dual_basis_transformation(slave.shape, slave.degree)
    back, diagonal = (
        np.asarray(np.linalg.inv(change.T)),
        bool(np.all(change == np.eye(len(change)))),
    )
    basis = open_basis = ModifiedDualBasis.of(slave, no_multiplier)
    barely = NOTHING
    while True:
        parts = integrate(slave, opposite.master, facing, basis, open_basis)
        without = np.union1d(no_multiplier, barely)
        coupling = _assembled(parts, owners, back, without, nodes)
        found = owners.among(coupling.barely, slave.nodes.ravel()) if diagonal else NOTHING
        new = np.setdiff1d(found, without)
        if owners.comm.allreduce(new.size, op=MPI.SUM) == 0:
            return coupling
        barely = np.union1d(barely, new)
        basis = ModifiedDualBasis.of(slave, no_multiplier, barely)


def _assembled(
    parts: Parts,
    owners: Owners,
    back: Array,
    no_multiplier: NDArray[np.int64],
    nodes: NDArray[np.int64] | None,
) -> Coupling:
    """Return the sums at the nodes of this rank, given those of its facets and A^-T."""
    f, k, _, d = parts.gap.shape
    # The integral of a quadratic function on the axis of revolution is rounding.
    around = np.broadcast_to(parts.whole.sum(axis=1, keepdims=True), parts.whole.shape)
    facing = parts.facet_mass.sum(axis=2)[..., None], parts.normal, parts.gap.reshape(f, k, 3 * d)
    alone = parts.whole[..., None], around[..., None], parts.open_normal
    rows = block_diag(
        np.concatenate(facing, axis=2).reshape(f * k, 1 + 4 * d),
        np.concatenate(alone, axis=2).reshape(f * k, 2 + d),
    )
    numbers, total = owners.sums(np.append(parts.dual_nodes, parts.open_nodes), rows)
    weight, *vectors, whole, around, outward = np.split(
        total, np.cumsum([1, d, d, d, d, 1, 1]), axis=1
    )
    weight, whole, around = weight[:, 0], whole[:, 0], around[:, 0]
    has_area = whole > NEGLIGIBLE * around
    covered = np.where(has_area, weight / np.where(has_area, whole, 1.0), 0.0)
    barely = numbers[(np.abs(weight) > NEGLIGIBLE * around) & (covered <= LEAST_COVERED)]
    if nodes is None:
        nodes = numbers[(covered > LEAST_COVERED) & ~np.isin(numbers, no_multiplier)]
    kept = np.searchsorted(numbers, nodes)
    faces = covered[kept] > LEAST_COVERED
    weight = np.where(faces, weight[kept], whole[kept])
    normal, *gaps = (vector[kept] for vector in vectors)
    normal = np.where(faces[:, None], normal, outward[kept])
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    gap, positive_part, curved_gap = (
        np.where(faces, np.einsum("nd,nd->n", vector, normal) / weight, np.inf) for vector in gaps
    )
    # Each facet with a node has all of the node's row of D. The jump of an open node is its
    # displacement.
    opened = nodes[~faces]

    def of_facing(entries: Entries) -> Entries:
        facing = ~np.isin(entries[0], opened)
        return entries[0][facing], entries[1][facing], entries[2][facing]

    rows, columns = np.broadcast_arrays(parts.dual_nodes[:, :, None], parts.nodes[:, None, :])
    values = (parts.facet_mass @ back).ravel()
    row, column, value = of_facing(owners.entries(rows.ravel(), columns.ravel(), values))
    slave_entries = (
        np.append(row, opened),
        np.append(column, opened),
        np.append(value, weight[~faces]),
    )
    slaves, D = sparse_rows(nodes, slave_entries)
    master_entries = of_facing(owners.entries(parts.rows, parts.columns, parts.values))
    masters, M = sparse_rows(nodes, master_entries)
    divide = sparse.diags_array(1 / weight)
    jumps = nodes, slaves, sparse.csr_array(divide @ D), masters, sparse.csr_array(divide @ M)
    depth = owners.comm.allreduce(float(parts.depths.max(initial=0.0)), op=MPI.MAX)
    state = weight, normal, gap, positive_part, curved_gap, covered[kept]
    whole_facets = parts.whole.sum(axis=1)
    faces_master = parts.facet_mass.sum(axis=(1, 2)) / np.where(whole_facets > 0, whole_facets, 1.0)
    return Coupling(*jumps, *state, depth, parts.dual_nodes, parts.depths, faces_master, barely)
