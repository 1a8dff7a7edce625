"""Fields of a solution (displacement, stress, von Mises, |dev eps|, electric), their extremes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, partial
from itertools import accumulate, chain
from typing import Any, NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.typing import NDArray
from ufl.core.expr import Expr

from contact import _compat
from contact.arguments import expect
from contact.body.elements import kinematics_of
from contact.body.equilibrium import BodyEquilibrium
from contact.body.internal_variables import NAME, name_of
from contact.body.materials import form_law, piezo_with_constants
from contact.history import BodyState, LinearisationPoint
from contact.mesh.cells import shape_of
from contact.mesh.domain import disjoint_pieces
from contact.mesh.entities import accumulated
from contact.mesh.geometry import volumes
from contact.model.material import Material
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.results.quantities import of_law, quantities, values_of
from contact.results.quantity import BODY
from contact.typing import Array
from forms.hencky import is_linear, stress
from forms.history import components, to_tensor
from forms.kinematics import deviator_squared, principal_values, strain, von_mises
from forms.ops import maximum, sqrt
from forms.piezo import coupling_stress, electric_displacement
from forms.plane_stress import ACROSS, PlaneStressElastic, PlaneStressHistory, hencky_of

#: Decrease of |dev eps|, over its earlier value, that counts as unloading; and of the secant
#: modulus, over that of small strains, that counts as yielding.
DECREASE, SOFTENED = 1e-6, 1e-9

#: The internal variable that says where a body has yielded.
EQUIVALENT = "equivalent_plastic_strain"


def nodal_function(
    name: str,
    source: fem.FunctionSpace,
    values: Array,
    shape: tuple[int, ...],
    family: str = "Lagrange",
) -> fem.Function:
    """Return a function by its values at the local nodes of a space, shape (nodes, components)."""
    mesh, degree = source.mesh, source.ufl_element().embedded_superdegree
    function = fem.Function(fem.functionspace(mesh, (family, degree, shape)), name=name)
    # Two spaces of one mesh need not number their nodes alike.
    target = function.function_space.dofmap.list
    function.x.array.reshape(-1, values.shape[1])[target] = values[source.dofmap.list]
    function.x.scatter_forward()
    return function


def cell_function(
    name: str, mesh: dmesh.Mesh, degree: int, shape: tuple[int, ...], values: Array
) -> fem.Function:
    """Return a discontinuous function by its values in the owned cells, (cells, nodes, k)."""
    function = fem.Function(fem.functionspace(mesh, ("DG", degree, shape)), name=name)
    dofs = function.function_space.dofmap.list[: len(values)]
    function.x.array.reshape(-1, values.shape[2])[dofs] = values
    function.x.scatter_forward()
    return function


def linear(function: fem.Function) -> fem.Function:
    """Return the Lagrange interpolant of the geometry's degree of a function. Collective."""
    space = function.function_space
    order = _compat.geometry_degree(space.mesh)
    if space.ufl_element().embedded_superdegree == order:
        return function
    shape = space.ufl_element().reference_value_shape
    element = ("Lagrange", order, shape)
    made = fem.Function(fem.functionspace(space.mesh, element), name=function.name)
    made.interpolate(function)
    return made


def nodal_unknowns(body: BodyEquilibrium, x: Array) -> dict[str, Array]:
    """Return the displacement and, for a piezoelectric body, the potential, (nodes, components)."""
    found = {"displacement": body.nodal(x)[:, : body.dim]}
    if body.piezoelectric:
        found["potential"] = body.phi_scale * body.nodal(x)[:, body.dim :]
    return found


def unknowns(body: BodyEquilibrium, x: Array, family: str = "Lagrange") -> dict[str, fem.Function]:
    """Return them as functions. Collective."""
    shapes: dict[str, tuple[int, ...]] = {"displacement": (body.dim,), "potential": ()}
    return {
        name: nodal_function(name, body.space, values, shapes[name], family)
        for name, values in nodal_unknowns(body, x).items()
    }


def check_variables(body: BodyEquilibrium) -> None:
    """Refuse internal variables whose names are those of other fields, on all ranks."""
    taken = [*(each.name for each in quantities(BODY) if each.value is not of_law), ACROSS]
    words = f"{NAME} that is the name of no other field ({', '.join(taken)})"
    for law in (material.law for material in body.description.materials):
        within = law.base if isinstance(law, PlaneStressHistory) else law
        for name in body.laws.variables(within):
            place = f"{name_of(within)}: variables: the name"
            expect(place, name, words, name not in taken, "law-variables")


class Extremes(NamedTuple):
    """The largest values in a material."""

    strain: float  #: |dev eps|
    von_mises: float  #: (stress)
    #: Volume with |dev eps| above first yield or plastic strain; None for a law without.
    yielded: float | None
    volume: float  #: of all of the material
    plastic: float | None  #: equivalent plastic strain; None for a law without


def strain_across(body: BodyEquilibrium, material: Material, eps: Expr, phi: Expr | None) -> Expr:
    """Return eps_zz of plane stress at the last fit of the laws, which no form sees, as tensor."""
    across: Expr | float = 0.0
    if isinstance(material.law, PlaneStressElastic):
        across = material.law.strain_across(eps, ufl.grad(phi) if material.piezo else None)
    elif isinstance(material.law, PlaneStressHistory):
        across = body.laws.fits[ACROSS]
    return across * ufl.as_tensor(np.diag([0.0, 0.0, 1.0]).tolist())


def fields_of(body: BodyEquilibrium, material: Material, at: fem.Function) -> dict[str, Any]:
    """Return the fields of a material at some unknowns in UFL, None for those that it has not."""
    u, phi = body.split(at)
    u = u if body.cuts is None else u + body.cuts.jump
    # The nodes may lie on the axis.
    eps = strain(u, kinematics_of(body.domain, body.element, on_axis=True))
    law = body.laws.fitted_law(form_law(material, body.domain.mesh))
    sigma = stress(law, eps)
    piezo = material.piezo and piezo_with_constants(material.piezo, body.domain.mesh)
    if piezo is not None:
        sigma += coupling_stress(piezo, phi)
    eps = eps + strain_across(body, material, eps, phi)
    electric = field = None if phi is None else ufl.as_vector([0.0] * body.dim)
    if piezo is not None:
        charge, gradient = electric_displacement(piezo, eps, phi), ufl.grad(phi)
        electric = ufl.as_vector([charge[i] for i in range(body.dim)])
        field = ufl.as_vector([-gradient[i] for i in range(body.dim)])
    return {
        "stress": sigma,
        "principal_stress": principal_values(sigma),
        "von_mises": von_mises(sigma),
        "strain": eps,
        # Rounding can make the square slightly negative.
        "dev_strain": sqrt(maximum(deviator_squared(eps), 0.0)),
        "electric_displacement": electric,
        "electric_field": field,
    }


def _usual_points(body: BodyEquilibrium) -> Array:
    """Return the nodes of a cell, of degree 1 its middle."""
    # There strains of simplices are constant, and those of other cells most exact (Barlow, IJNME
    # 10, 1976).
    shape = shape_of(body.domain.mesh)
    return shape.middle if body.degree == 1 else shape.nodes(body.degree)


class DerivedFields:
    """Fields derived from the unknowns of a body at a state, then its internal variables.

    By name their shapes, (3, 3) of the stress, whose third axis is that of theta in a body of
    revolution. Points are `_usual_points`, or others, for `chunks` alone. Methods are collective.
    """

    def __init__(
        self, body: BodyEquilibrium, state: LinearisationPoint, points: Array | None = None
    ) -> None:
        self.body = body
        #: Reference points of a cell at which the fields are evaluated.
        self.points = _usual_points(body) if points is None else points
        self.move_to(state)
        at = fields_of(body, body.description.materials[0], fem.Function(body.space))
        self.shapes: dict[str, tuple[int, ...]] = {
            name: expression.ufl_shape for name, expression in values_of(BODY, at).items()
        }
        self.shapes |= {name: value.ufl_shape for name, value in self._variables.items()}

    @property
    def columns(self) -> Mapping[str, slice]:
        """Where the components of each field are in the rows of values."""
        sizes = [math.prod(shape) for shape in self.shapes.values()]
        ends = accumulate(sizes)
        return {
            name: slice(end - size, end)
            for name, size, end in zip(self.shapes, sizes, ends, strict=True)
        }

    @property
    def _size(self) -> int:
        """The number of all components."""
        return sum(math.prod(shape) for shape in self.shapes.values())

    def _expression(self, material: Material, at: fem.Function) -> Expr:
        """Return all components of a material's fields, one after the other."""
        fields = values_of(BODY, fields_of(self.body, material, at)).values()
        every = [*fields, *self._variables.values()]
        return ufl.as_vector([f[i] for f in every for i in np.ndindex(f.ufl_shape)])

    @property
    def _variables(self) -> dict[str, Expr]:
        """The internal variables by name, tensors of strain or stress as such."""
        fits = self.body.laws.fits
        tensor = (components(self.body.dim),)
        return {
            name: to_tensor(fits[name]) if fits[name].ufl_shape == tensor else fits[name]
            for name in self.body.laws.names
        }

    def of_material(self, material: int) -> Iterator[tuple[NDArray[np.int32], Array]]:
        """Yield owned cells of a material, by its number, and the values as `chunks`."""
        body, cells = self.body, self.body.cells[material]
        expression = partial(self._expression, body.description.materials[material])
        name = "fields", material, self.points.tobytes()
        body.laws.fit(self._state)
        if body.cuts is not None:
            body.cuts.set(body.cuts.jump, self._q)
        yield from body.pointwise.values(name, expression, self.points, self._x, cells)

    def chunks(self) -> Iterator[tuple[NDArray[np.int32], Array]]:
        """Yield owned cells and the values there, shape (cells, points, components)."""
        return chain.from_iterable(map(self.of_material, range(len(self.body.cells))))

    def move_to(self, state: LinearisationPoint) -> None:
        """Look at the fields of another state of the same body from now on."""
        self._state, self._x = state, self.body.nodal(state.x).flatten()
        self._q = self.body.motion(state.x)

    def strains(self) -> list[Array]:
        """Return |dev eps| in the owned cells of each material, shape (cells, points)."""
        column = self.columns["dev_strain"]
        return [
            np.concatenate([values[..., column][..., 0] for _, values in self.of_material(k)])
            for k in range(len(self.body.cells))
        ]

    def extremes(self) -> list[Extremes]:
        """Return the largest values over the cells (their nodes, for degree 2), a material."""
        volume, found = volumes(self.body.domain), []
        strain, mises = self.columns["dev_strain"], self.columns["von_mises"]
        laws, comm = self.body.laws, self.body.comm
        after = laws.commit(self._state)
        for index, material in enumerate(self.body.description.materials):
            limit = getattr(material.law, "first_yield", np.inf)
            flows = EQUIVALENT in laws.variables(material.law)
            largest, sums = np.zeros(3), np.zeros(2)
            for chosen, values in self.of_material(index):
                largest[0] = max(largest[0], values[..., strain].max(initial=0.0))
                largest[1] = max(largest[1], values[..., mises].max(initial=0.0))
                beyond = (values[..., strain] > limit).mean(axis=(1, 2))
                sums += volume[chosen] @ np.column_stack([beyond, np.ones(chosen.size)])
            if flows and after is not None:
                cells = self.body.cells[index]
                plastic = laws.by_cell(after.arrays[EQUIVALENT])[cells]
                largest[2] = plastic.max(initial=0.0)
                sums[0] = laws.by_cell(laws.volumes)[cells][plastic > 0].sum()
            comm.Allreduce(MPI.IN_PLACE, largest, op=MPI.MAX)
            comm.Allreduce(MPI.IN_PLACE, sums, op=MPI.SUM)
            yielded = float(sums[0]) if np.isfinite(limit) or flows else None
            plastic_strain = float(largest[2]) if flows else None
            here = float(largest[0]), float(largest[1]), yielded, float(sums[1]), plastic_strain
            found.append(Extremes(*here))
        return found

    def cells(self) -> dict[str, fem.Function]:
        """Return the fields as they are: discontinuous, of degree 0 for P1 and 1 for P2."""
        mesh, degree = self.body.domain.mesh, self.body.degree - 1
        corners, owned = shape_of(mesh).corners, mesh.topology.index_map(self.body.dim).size_local
        every = np.zeros((owned, 1 if degree == 0 else corners, self._size))
        for chosen, values in self.chunks():
            every[chosen] = values[:, :corners]
        return {
            name: cell_function(name, mesh, degree, self.shapes[name], every[..., columns])
            for name, columns in self.columns.items()
        }

    def cell_means(self) -> Array:
        """Return the fields of the owned cells, at degree 2 means of their corners, (cells, k)."""
        mesh = self.body.domain.mesh
        found = np.zeros((mesh.topology.index_map(mesh.topology.dim).size_local, self._size))
        for chosen, values in self.chunks():
            found[chosen] = values[:, : shape_of(mesh).corners].mean(axis=1)
        return found

    @cached_property
    def groups(self) -> NDArray[np.int32]:
        """Groups of the owned cells, one per set of regions, the same on all ranks. Collective."""
        domain = self.body.domain
        count = domain.mesh.topology.index_map(domain.dim).size_local
        found = disjoint_pieces(domain.comm, count, domain.regions.values())
        groups = np.full(count, len(found), dtype=np.int32)
        for k, (_, cells) in enumerate(found):
            groups[cells] = k
        return groups

    @cached_property
    def group_count(self) -> int:
        """The number of groups. Collective."""
        return 1 + int(self.body.comm.allreduce(int(self.groups.max(initial=0)), op=MPI.MAX))

    def means(self) -> Array:
        """Return means by volume in each group, (groups, local nodes, components), NaN for none."""
        space, volume, groups = self.body.space, volumes(self.body.domain), self.groups
        index_map, links = space.dofmap.index_map, space.dofmap.list
        nodes = index_map.size_local + index_map.num_ghosts
        sums = np.zeros((self.group_count, nodes, self._size + 1))
        for chosen, values in self.chunks():
            dofs = links[chosen]
            weight = np.broadcast_to(volume[chosen, None, None], (*dofs.shape, 1))
            at_nodes = np.broadcast_to(values, (*dofs.shape, self._size)) * weight
            every = np.concatenate([at_nodes, weight], axis=2)
            np.add.at(sums, (groups[chosen, None], dofs), every)
        for group in sums:
            group[:] = accumulated(index_map, group)
        with np.errstate(invalid="ignore"):
            means = np.asarray(sums[..., :-1] / sums[..., -1:])
        known = np.isfinite(means[..., 0])  # principal stresses are those of the averaged stress
        stress, principal = self.columns["stress"], self.columns["principal_stress"]
        tensors = means[known, stress].reshape(-1, 3, 3)
        means[known, principal] = np.linalg.eigvalsh(tensors)[:, ::-1]
        return means

    def nodes(self) -> dict[str, fem.Function]:
        """Return the fields at the nodes: means by volume, of several regions within each."""
        means, space, groups = self.means(), self.body.space, self.groups
        if self.group_count == 1:
            return {
                name: nodal_function(name, space, means[0][:, columns], self.shapes[name])
                for name, columns in self.columns.items()
            }
        links, made = space.dofmap.list[: groups.size], {}
        for name, columns in self.columns.items():
            values, shape = means[groups[:, None], links, columns], self.shapes[name]
            made[name] = cell_function(name, space.mesh, self.body.degree, shape, values)
        return made


class Deformation(NamedTuple):
    """Extremes over the middles of the cells."""

    largest_strain: float  #: |eps|, the Frobenius norm
    least_volume: float  #: det(I + grad u), a deformed volume over the undeformed one
    largest_volume: float  #: the same


def deformation(body: BodyEquilibrium, state: LinearisationPoint) -> Deformation:
    """Return the extremes of strain and volume at a state of a body. Collective."""
    mesh, kinematics = body.domain.mesh, body.domain.kinematics
    nodal, middle = body.nodal(state.x).ravel(), shape_of(mesh).middle
    body.laws.fit(state)
    if body.cuts is not None:
        body.cuts.set(body.cuts.jump, body.motion(state.x))

    def measures(material: Material, at: fem.Function) -> Expr:
        u, phi = body.split(at)
        u = u if body.cuts is None else u + body.cuts.jump
        eps, stretch = strain(u, kinematics), ufl.Identity(3) + kinematics.gradient(u)
        across = strain_across(body, material, eps, phi)
        size = ufl.sqrt(ufl.inner(eps + across, eps + across))
        return ufl.as_vector([size, ufl.det(stretch + across)])

    extremes = np.array([0.0, -np.inf, -np.inf])
    for k, (material, cells) in enumerate(zip(body.description.materials, body.cells, strict=True)):
        name, expression = ("deformation", k), partial(measures, material)
        for _, found in body.pointwise.values(name, expression, middle, nodal, cells):
            size, volume = found[:, 0].T
            here = [size.max(initial=0.0), (-volume).max(initial=-np.inf)]
            extremes = np.maximum(extremes, [*here, volume.max(initial=-np.inf)])
    body.comm.Allreduce(MPI.IN_PLACE, extremes, op=MPI.MAX)
    return Deformation(float(extremes[0]), float(-extremes[1]), float(extremes[2]))


def unloaded(problem: ContactProblem, states: Sequence[State]) -> float:
    """Return the largest share of a body in which |dev eps| decreases in the plastic range."""
    # From one of the states, the ends of all steps, to the next. Hencky's law unloads along its
    # loading path, as no metal does.
    body = problem.body
    laws = [hencky_of(material.law) for material in body.description.materials]
    if not states or all(law is None or is_linear(law) for law in laws):
        return 0.0
    fields = DerivedFields(body, BodyState(body.zero_displacement()))
    of_cells = volumes(body.domain)
    sizes = [of_cells[cells] for cells in body.cells]
    sums, after = np.zeros(len(states) + 1), fields.strains()
    sums[-1] = sum(float(own.sum()) for own in sizes)
    for k, state in enumerate(states):
        fields.move_to(state)
        before, after = after, fields.strains()
        for law, own, old, new in zip(laws, sizes, before, after, strict=True):
            if law is not None:
                modulus = np.asarray(law.secant_modulus(old**2), dtype=float)
                yielded = modulus < (1 - SOFTENED) * float(law.shear)
                sums[k] += own @ (yielded & (new < (1 - DECREASE) * old)).mean(axis=1)
    body.comm.Allreduce(MPI.IN_PLACE, sums, op=MPI.SUM)
    return float(sums[:-1].max() / sums[-1])
