"""Equilibrium of one body: its residual and operators at a state.

Unknowns are in one blocked Lagrange space: d displacement components a node and, for a
piezoelectric body, the potential divided by `phi_scale` = sqrt(mu1/beta). In these units both
blocks of the operator are of one magnitude in any unit system.

The unknowns of a state are a local array: owned nodes, ghosts, then global unknowns, if any
(`contact.body.global_unknowns`). Every query is given its state; the forms hold that of the last
one, to which `border` and the responses of laws with history belong.

Forces and charges have no common unit, and separate bodies no common scale: beside the loads of
another body any error of one may be small. Their norms are by connected component.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import assemble_matrix, create_matrix
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from ufl.core.expr import Expr

from contact._compat import destroy_unused
from contact.body.assembly import Assembly
from contact.body.elements import STANDARD, Pointwise, check_element
from contact.body.global_unknowns import Cuts, GlobalUnknowns, make_global_unknowns
from contact.body.loads import Loads, assembled
from contact.body.materials import cells_of, softest
from contact.body.supports import Rollers, free_components, supports_of, without_field
from contact.history import BodyState, LinearisationPoint
from contact.linear.layout import Layout, congruent, masked, projectors, times
from contact.linear.operator import Counters, SparseOperator
from contact.linear.petsc import Subsystems
from contact.linear.transformation import Transformation, TransformedBulk, TransformedOperator
from contact.mesh.cells import shape_of
from contact.mesh.domain import Domain
from contact.mesh.entities import (
    cells_at,
    component_sums,
    connected_components,
    exterior_facets,
    graph_components,
    with_ghosts,
)
from contact.mesh.geometry import areas, geometry_nodes, volumes
from contact.model.body import Body
from contact.model.rigid import Motion
from contact.ranks import summed
from contact.tolerances import MOST_ROUNDING, POSITIONS, POSITIONS_KNOWN, TOUCHING
from contact.typing import Array


@dataclass(frozen=True)
class ComponentNorms:
    """Norms of the forces, and of the charges, of each of k connected components of the mesh.

    A plate, a foundation or an electrode that is free to move joins components to one; contact does
    not.

    Attributes
    ----------
    comm
        Communicator.
    connected_component, behind
        The component of each owned node, shape (nodes,), and of each global unknown, shape (m,).
    count
        Number k of components.
    block_size, dim
        Unknowns a node, and number of displacements among them.
    global_mechanical
        Mask of motions among the global unknowns, shape (m,).
    """

    comm: MPI.Intracomm
    connected_component: NDArray[np.intp]
    behind: NDArray[np.intp]
    count: int
    block_size: int
    dim: int
    global_mechanical: NDArray[np.bool_]

    @property
    def mechanical(self) -> NDArray[np.bool_]:
        """Mask of displacements, or forces, among owned values with the global ones behind."""
        nodal = np.tile(np.arange(self.block_size) < self.dim, self.connected_component.size)
        return np.concatenate([nodal, self.global_mechanical])

    def at(self, nodes: NDArray[np.int32]) -> ComponentNorms:
        """Return the norms of some owned nodes alone."""
        none = np.zeros(0, dtype=np.intp)
        component = self.connected_component[nodes]
        return ComponentNorms(
            self.comm, component, none, self.count, self.block_size, self.dim, none.astype(bool)
        )

    @property
    def apart(self) -> Subsystems | None:
        """Connected components as uncoupled subsystems; None for one."""
        of = np.repeat(self.connected_component, self.block_size)
        return (of, self.count) if self.count > 1 else None

    def norms(self, values: Array) -> Array:
        """Return the norms of forces, and of charges if any, shape (1 or 2, k). Collective."""
        if self.block_size == self.dim:
            return self._by_component(values)[None]
        chosen = self.mechanical
        return np.stack(
            [self._by_component(np.where(part, values, 0.0)) for part in (chosen, ~chosen)]
        )

    def _by_component(self, values: Array) -> Array:
        owned = values.size - self.behind.size
        nodal, on_global = values[:owned], values[owned:]
        if self.count == 1:
            square = summed(self.comm, np.dot(nodal, nodal)) + np.dot(on_global, on_global)
            return np.array([np.sqrt(square)])
        component = np.repeat(self.connected_component, self.block_size)
        squares = component_sums(self.comm, component, nodal**2, self.count)
        return np.sqrt(squares + np.bincount(self.behind, on_global**2, minlength=self.count))

    def spread(self, norms: Array) -> Array:
        """Return for each owned value the norm of its kind and component."""
        component = np.concatenate(
            [np.repeat(self.connected_component, self.block_size), self.behind]
        )
        return np.where(self.mechanical, norms[0, component], norms[-1, component])


def component_norms_of(
    domain: Domain,
    space: fem.FunctionSpace,
    global_unknowns: GlobalUnknowns,
    components: tuple[NDArray[np.int32], int],
) -> ComponentNorms:
    """Return the norms of a body of given connected components. Collective."""
    (component, count), groups, d = components, global_unknowns.groups, domain.dim
    if count > 1 and groups:
        touched = np.zeros((len(groups), count), dtype=np.intc)
        for group, at in zip(groups, touched, strict=True):
            if group.free.any():
                facets = domain.facets_anywhere(group.part)
                nodes = fem.locate_dofs_topological(space, d - 1, facets)
                at[component[nodes[nodes < component.size]]] = 1
        domain.comm.Allreduce(MPI.IN_PLACE, touched, op=MPI.MAX)
        group_of, piece_of = np.nonzero(touched)
        # A part with a given motion has reactions of its own, and joins nothing.
        count, label = graph_components(group_of, len(groups) + piece_of, len(groups) + count)
        component, of_groups = label[len(groups) + component], label[: len(groups)]
    else:
        of_groups = np.zeros(len(groups), dtype=np.intp)
    behind = np.repeat(of_groups, [group.free.size for group in groups]).astype(np.intp)
    block_size = space.dofmap.index_map_bs
    return ComponentNorms(
        domain.comm,
        component.astype(np.intp),
        behind,
        count,
        block_size,
        d,
        global_unknowns.mechanical,
    )


class BodyEquilibrium:
    """Space, boundary conditions and weak forms of one body.

    The Lagrange elements are of degree 1 or 2, `element` is one of `contact.body.elements`.
    `foundations` are the motions of those that move, by the parts in front of them. Refuses missing
    parts, vectors of the wrong length, and materials, degrees and elements that are none.
    """

    rounding_limit = MOST_ROUNDING

    def __init__(
        self,
        domain: Domain,
        body: Body,
        degree: int = 1,
        element: str = STANDARD,
        foundations: Mapping[str, Motion] = MappingProxyType({}),
    ) -> None:
        body.check(domain.dim)
        check_element(element, degree, shape_of(domain.mesh), domain.order)
        self.domain, self.description, self.degree, self.element = domain, body, degree, element
        self.dim, self.phi_scale = domain.dim, body.phi_scale
        self.block_size = self.dim + (body.piezo is not None)
        self.space = fem.functionspace(domain.mesh, ("Lagrange", degree, (self.block_size,)))
        #: The owned cells of each material.
        self.cells = cells_of(domain, body.materials)
        self.softest = softest(domain, body.materials, self.cells)
        self.pointwise = Pointwise(self.space)
        self.supports = supports_of(domain, self.space, body)
        coupled = [material.piezo is not None for material in body.materials]
        index_map = self.space.dofmap.index_map
        #: Mask of the owned nodes of piezoelectric cells.
        self.electric_nodes = np.full(index_map.size_local, any(coupled))
        if any(coupled) and not all(coupled):
            charged = np.concatenate([self.cells[i] for i in np.flatnonzero(coupled)])
            others = without_field(self.space, charged)
            dofs, owned = others.condition.dof_indices()
            self.electric_nodes[dofs[:owned] // self.block_size] = False
            self.supports.append(others)
        #: Mask of the owned nodal unknowns without support, shape (nodes, block size).
        self.unsupported = free_components(self.space, self.supports)
        self.rollers = Rollers(domain, self.space, body, self.unsupported)
        self.global_unknowns = make_global_unknowns(
            domain, self.space, body, foundations, self.unsupported
        )
        self.connected_components = connected_components(self.space)
        self.component_norms = component_norms_of(
            domain, self.space, self.global_unknowns, self.connected_components
        )
        self.layout = Layout(
            comm=domain.comm,
            index_map=index_map,
            points=self.space.tabulate_dof_coordinates()[: index_map.size_local, : self.dim],
            free=self.unsupported & ~self.global_unknowns.tied,
            size=domain.size,
            stiffness=self.softest.young,
            revolved=domain.revolved,
            inclined=self.rollers.inclined,
        )
        self.rollers.check_apart(self.global_unknowns.tied)
        #: The jumps across cuts of bolts; None without any.
        self.cuts = Cuts.of(domain, self.space, self.global_unknowns, body)
        #: Each query writes the state of the forms anew.
        self.forms = Assembly(
            domain, body, self.space, self.cells, element, self.pointwise, self.cuts
        )
        self._at = self.forms.at
        #: The laws with internal variables: the body's part of a history.
        self.laws = self.forms.laws
        self._loads = self.loads_along(self.space)
        # Values that are no numbers, or contradict each other, are refused first of all.
        self.prescribe(self.zero_displacement())
        if self.cuts is not None:
            owned_nodes = np.arange(len(self.free), dtype=np.int32)
            free = projectors(self.unsupported, self.layout.inclined)[:, : self.dim, : self.dim]
            self.cuts.check(owned_nodes, np.eye(self.dim) - free, "a support holds")

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator of the mesh."""
        return self.domain.comm

    @property
    def free(self) -> NDArray[np.bool_]:
        """Mask of the owned nodal unknowns that are neither fixed nor tied, (nodes, block size)."""
        return self.layout.free

    @cached_property
    def connected_component_of_cells(self) -> NDArray[np.intp]:
        """Connected component of each local cell, shape (cells,). Collective."""
        index_map, (component, _) = self.space.dofmap.index_map, self.connected_components
        of_nodes = np.zeros(index_map.size_local + index_map.num_ghosts, dtype=np.intp)
        of_nodes[: component.size] = component
        return np.asarray(with_ghosts(index_map, of_nodes)[self.space.dofmap.list[:, 0]])

    @cached_property
    def boxes(self) -> tuple[Array, Array]:
        """Lower and upper corners of the connected components, shapes (k, d). Collective."""
        of_cells = geometry_nodes(self.domain)
        of_nodes = np.repeat(self.connected_component_of_cells[: len(of_cells)], of_cells.shape[1])
        low = np.full((self.connected_components[1], self.dim), np.inf)
        high = -low
        np.minimum.at(low, of_nodes, of_cells.reshape(-1, self.dim))
        np.maximum.at(high, of_nodes, of_cells.reshape(-1, self.dim))
        self.comm.Allreduce(MPI.IN_PLACE, low, op=MPI.MIN)
        self.comm.Allreduce(MPI.IN_PLACE, high, op=MPI.MAX)
        return low, high

    @property
    def extents(self) -> Array:
        """Largest extents of the connected components, shape (k,) (length). Collective."""
        if self.connected_components[1] == 1:
            return np.array([self.domain.size])
        low, high = self.boxes
        return np.asarray((high - low).max(axis=1))

    @cached_property
    def thicknesses(self) -> Array:
        """Twice the volume of each component over the area of its boundary, (k,) (length).

        Collective.
        """
        domain, of_cells, count = (
            self.domain,
            self.connected_component_of_cells,
            self.connected_components[1],
        )
        volume, facets = volumes(domain), exterior_facets(domain.mesh)
        behind = of_cells[cells_at(domain.mesh, facets)[0]]
        thickness = 2 * component_sums(self.comm, of_cells[: volume.size], volume, count)
        thickness /= component_sums(self.comm, behind, areas(domain, facets), count)
        return np.asarray(thickness)

    @cached_property
    def position_rounding(self) -> float:
        """Overlap that may be the rounding of positions in files (length). Collective."""
        largest = float(np.abs(self.domain.mesh.geometry.x).max(initial=0.0))
        return POSITIONS * self.comm.allreduce(largest, op=MPI.MAX)

    def accepted_overlaps(self, one: NDArray[np.intp], other: NDArray[np.intp]) -> Array:
        """Return overlaps of components that count as none, shape (n,) (length). Collective."""
        return self.rounded_overlap(np.minimum(self.thicknesses[one], self.thicknesses[other]))

    def rounded_overlap(self, thickness: Array, by_hand: float = 1.0) -> Array:
        """Return overlaps that count as none, by the thickness of the thinner body. Collective.

        Positions that are written by hand are rounded so many times as those in files.
        """
        positions = by_hand * self.position_rounding
        known = np.minimum(positions, POSITIONS_KNOWN * thickness)
        return np.maximum(by_hand * TOUCHING * thickness, known)

    def connected_components_of(self, *parts: str) -> NDArray[np.bool_]:
        """Return which connected components have facets of boundary parts, (k,). Collective."""
        component, count = self.connected_components
        met = np.zeros(count, dtype=bool)
        for part in parts:
            facets = self.domain.facets_anywhere(part)
            nodes = fem.locate_dofs_topological(self.space, self.dim - 1, facets)
            met[component[nodes[nodes < component.size]]] = True
        self.comm.Allreduce(MPI.IN_PLACE, met, op=MPI.LOR)
        return met

    @property
    def owned(self) -> int:
        """Number of owned nodal unknowns."""
        return self.free.size

    @property
    def linear(self) -> bool:
        """True if the operator is the same at all states."""
        return self.description.linear

    @property
    def symmetric(self) -> bool:
        """True if the tangent is a symmetric matrix."""
        return self.description.symmetric

    @property
    def piezoelectric(self) -> bool:
        """True if there is a potential."""
        return self.description.piezo is not None

    def split(self, x: Expr) -> tuple[Expr, Expr | None]:
        """Split a function or argument into displacement and scaled-back potential."""
        return self.forms.split(x)

    def function(self, x: Array, name: str = "x") -> fem.Function:
        """Return local unknowns as a function in `space`."""
        function = fem.Function(self.space, name=name)
        function.x.array[:] = self.nodal(x).ravel()
        return function

    def nodal(self, values: Array) -> Array:
        """Return the nodal part of local or owned values, shape (nodes, block size)."""
        return values[: values.size - self.global_unknowns.size].reshape(-1, self.block_size)

    def motion(self, values: Array) -> Array:
        """Return the values of the global unknowns, shape (m,)."""
        return values[values.size - self.global_unknowns.size :]

    def owned_part(self, x: Array) -> Array:
        """Return the owned part of local unknowns, with the global ones behind."""
        return np.concatenate([x[: self.owned], self.motion(x)])

    def zero_displacement(self) -> Array:
        """Return the unknowns of the reference configuration, without prescribed values."""
        return np.zeros(self._at.x.array.size + self.global_unknowns.size)

    def prescribe(self, x: Array, time: float = 1.0) -> Array:
        """Return unknowns with the prescribed values at a time. Collective."""
        at, q = self._at.x, self.global_unknowns.prescribe(self.motion(x), time)
        at.array[:] = self.nodal(x).ravel()
        if self.global_unknowns.has_tied_nodes:
            owned, tied = at.array[: self.owned], self.global_unknowns.tied.ravel()
            owned[tied] = (self.global_unknowns.tied_motion @ q)[tied]
        for support in self.supports:
            support.set(at.array, time)
        self.rollers.set(at.array[: self.owned].reshape(-1, self.block_size), time)
        at.scatter_forward()
        return np.concatenate([at.array, q])

    def local(self, owned: Array) -> Array:
        """Return owned unknowns with those of the ghosts behind. Collective."""
        at = self._at.x
        at.array[: self.owned] = owned[: self.owned]
        at.scatter_forward()
        return np.concatenate([at.array, self.motion(owned)])

    def updated(self, x: Array, increment: Array) -> Array:
        """Return unknowns plus an increment of the owned ones. Collective."""
        return self.local(self.owned_part(x) + increment)

    def forces_of_laws(self) -> Array:
        """Return the forces of the stresses in the laws with history. Collective."""
        self.forms.at.x.array[:] = 0.0  # no other material has stresses
        return self._forces(self.forms.law_forces)

    def tangent_transposed(self, state: LinearisationPoint, weights: Array) -> Array:
        """Return K^T w, owned values, with the tangent K without supports. Collective."""
        matrix = self.create_matrix()
        self.assemble(matrix, "tangent", state, constrained=False)
        nodal = times(matrix, weights[: self.owned], transposed=True)
        matrix.destroy()
        on_q: Array = np.zeros(self.global_unknowns.size)
        border = self.border("tangent")
        if border is not None:
            columns, corner = border
            nodal = nodal + columns @ weights[self.owned :]
            on_q = summed(self.comm, columns.T @ weights[: self.owned])
            on_q = on_q + corner.T @ weights[self.owned :]
        return np.concatenate([nodal, on_q])

    def forces_without_history(self, state: LinearisationPoint) -> Array:
        """Return the owned nodal forces of all materials without internal variables. Collective."""
        self.laws.silence()
        self.forms.put(self.nodal(state.x), self.motion(state.x))
        return self._forces(self.forms.law_forces)

    def internal_forces(self, state: LinearisationPoint) -> Array:
        """Return the owned internal forces F(x) at a state, by the material law. Collective."""
        destroy_unused(self.comm, self.domain.mesh.comm)
        self.forms.put(self.nodal(state.x), self.motion(state.x))
        self.laws.set(state)
        return self._forces(self.forms.law_forces)

    def secant_forces(self, state: LinearisationPoint) -> Array:
        """Return F(x) with the secant modulus at `state.secant_at`, if given. Collective."""
        at = state.secant_at
        if at is None or self.linear:
            return self.internal_forces(state)
        destroy_unused(self.comm, self.domain.mesh.comm)
        self.forms.put(self.nodal(state.x), self.motion(state.x))
        self.forms.put(self.nodal(at), self.motion(at), secant=True)
        self.laws.set(BodyState(at, state.history), "secant")
        return self._forces(self.forms.secant_forces, secant=True)

    def _forces(self, forms: Sequence[fem.Form], secant: bool = False) -> Array:
        """Return the owned forces of compiled forms, those on the global unknowns behind."""
        forces = sum(assembled(form, self.owned) for form in forms)
        on_q = self.forms.on_global(self.global_unknowns.size, secant)
        return np.concatenate([forces, on_q])

    def elastic_forces(self, x: Array) -> list[Array]:
        """Return the owned nodal forces of each elastic support at local unknowns. Collective."""
        self.forms.put(self.nodal(x), self.motion(x))
        return [assembled(form, self.owned) for form in self.forms.elastic_forces]

    def loads_along(
        self, space: fem.FunctionSpace, on: Sequence[str | None] | None = None
    ) -> Loads:
        """Return the loads on the owned functions of a space, of some parts alone if named."""
        size = space.dofmap.index_map.size_local * self.block_size
        return self.forms.loads(self.forms.split(ufl.TestFunction(space)), size, on)

    @cached_property
    def loads_by_cell(self) -> tuple[fem.FunctionSpace, Loads]:
        """Discontinuous cubics, and the loads on them in owned cells. Collective."""
        space = fem.functionspace(self.domain.mesh, ("DG", 3, (self.block_size,)))
        return space, self.loads_along(space)

    def external(self, time: float = 1.0) -> Array:
        """Return the owned nodal loads at a time. Collective."""
        global_unknowns = self.global_unknowns
        on_q = global_unknowns.forces(time)
        on_q += self.forms.loads_on_global(time, global_unknowns.size)
        return np.concatenate([self._loads.at(time), on_q])

    def unbalanced(self, forces: Array) -> Array:
        """Return the residual on the free unknowns, that on tied nodes gathered. Collective."""
        global_unknowns, nodal = self.global_unknowns, forces[: self.owned]
        q = np.where(
            global_unknowns.free, self.motion(forces) + global_unknowns.gathered(nodal), 0.0
        )
        return np.concatenate([self.layout.mask(nodal), q])

    def reactions(self, forces: Array) -> Array:
        """Return the reactions of supports and of given motions. Collective."""
        global_unknowns, nodal = self.global_unknowns, forces[: self.owned]
        q = np.where(
            global_unknowns.free, 0.0, self.motion(forces) + global_unknowns.gathered(nodal)
        )
        return np.concatenate([nodal - masked(self.unsupported, self.layout.inclined, nodal), q])

    @cached_property
    def _projection(self) -> PETSc.Mat:
        """The projector onto the directions free of rollers. Collective."""
        assert self.layout.inclined is not None
        return self.layout.inclined.projection(self.layout)

    def movable(self, nodes: NDArray[np.int32]) -> Array:
        """Return the projectors onto the free directions of owned nodes, shape (n, d, d)."""
        return projectors(*self.layout.at(nodes))[:, : self.dim, : self.dim]

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix with the pattern of the body. Collective."""
        return create_matrix(self.forms.pattern)

    def assemble(
        self, matrix: PETSc.Mat, kind: str, state: LinearisationPoint, constrained: bool = True
    ) -> None:
        """Assemble Kacanov's "secant", Newton's "tangent" or its "symmetric" part. Collective.

        The secant is that at `state.secant_at`, if given. Rows and columns of supported unknowns
        are those of the identity if these are constrained.
        """
        if kind == "secant" and state.secant_at is not None:
            state = BodyState(state.secant_at, state.history)
        forms, conditions = self.forms, [s.condition for s in self.supports] if constrained else []
        for secant in (False, True):
            forms.put(self.nodal(state.x), self.motion(state.x), secant)
        self.laws.set(state, kind)
        matrix.zeroEntries()
        for form in forms.secant if kind == "secant" else forms.tangent:
            assemble_matrix(matrix, form, bcs=conditions)
            matrix.assemble(PETSc.Mat.AssemblyType.FLUSH)  # keeps entries yet to be filled
        matrix.assemble()
        inclined = self.layout.inclined
        if constrained and inclined is not None:
            # P K P + 1 - P, as of fixed unknowns: P has the pattern of the nodes' blocks.
            product = congruent(matrix, self._projection)
            product.copy(matrix)
            product.destroy()
            inclined.add(matrix, 1.0)

    def border(self, kind: str) -> tuple[Array, Array] | None:
        """Return derivatives by the global unknowns where `assemble` was last. Collective."""
        return self.forms.border(kind, self.owned, self.global_unknowns.size)

    def operator(
        self,
        nodes: NDArray[np.int32],
        transformation: Transformation | None = None,
        *,
        symmetric: bool,
        counters: Counters,
        solver: str,
    ) -> SparseOperator | TransformedOperator:
        """Return the operator of the body with blocks at nodes, as `SparseOperator`.

        The nodes are contact nodes, then others, by local numbers. After the transformation each
        block belongs to a single node; it is None where that is so without one.
        """
        options: dict[str, Any] = {"symmetric": symmetric, "counters": counters, "solver": solver}
        if transformation is None:
            return SparseOperator(self, nodes, subsystems=self.component_norms.apart, **options)
        bulk = TransformedBulk(self, transformation, BodyState(self.zero_displacement()))
        return TransformedOperator(bulk, nodes, **options)

    def norm(self, values: Array) -> float:
        """Return the Euclidean norm of owned values. Collective."""
        return float(np.sqrt(self.product(values, values)))

    def product(self, one: Array, other: Array) -> float:
        """Return the inner product of owned values, global ones behind them. Collective."""
        nodal, n = np.dot(one[: self.owned], other[: self.owned]), self.owned
        return float(summed(self.comm, nodal) + np.dot(one[n:], other[n:]))

    def norms(self, values: Array) -> Array:
        """Return the norms of forces, and of charges, by component. Collective."""
        return self.component_norms.norms(values)

    def load_norms(self, time: float = 1.0) -> Array:
        """Return the `norms` of the nodal loads at a time. Collective."""
        return self.norms(self.external(time))

    def piezo_norms(self, state: LinearisationPoint) -> Array:
        """Return the `norms` of the potential's forces and the strain's charges. Collective."""
        if not self.piezoelectric:
            return np.zeros((1, self.component_norms.count))
        alone = state.x.copy()
        self.nodal(alone)[:, : self.dim] = 0.0
        self.motion(alone)[self.global_unknowns.mechanical] = 0.0
        of_all, of_potential = (
            self.internal_forces(at) for at in (state, BodyState(alone, state.history))
        )
        return self.norms(
            np.where(self.component_norms.mechanical, of_potential, of_all - of_potential)
        )

    def l2_norm(self) -> Callable[[Array], float]:
        """Return the L2(Omega) norm of owned unknowns (displacement and scaled potential)."""
        trial, test = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        mass = assemble_matrix(fem.form(ufl.inner(trial, test) * self.domain.dx))
        mass.assemble()
        vector, image = mass.createVecs()

        def norm(values: Array) -> float:
            vector.array[:] = values[: self.owned]
            mass.mult(vector, image)
            return float(np.sqrt(max(vector.dot(image), 0.0)))

        return norm
