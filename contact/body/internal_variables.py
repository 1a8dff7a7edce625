"""Laws with internal variables at quadrature points: their stresses, and the history of a body.

A `forms.history.HistoryLaw` maps strains at the end of a step and variables at its beginning to
stresses and stiffness, functions at the quadrature points that forms contain. Names and shapes of
its responses are checked once, at small strains.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import ArrayLike
from ufl.core.expr import Expr

from contact.arguments import SAMPLES, Returned, check_finite, expect, naming, real, shorten
from contact.body.elements import Pointwise
from contact.errors import InputError
from contact.history import QUADRATURE_POINTS, InternalVariables, LinearisationPoint
from contact.mesh.cells import shape_of
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices
from contact.mesh.geometry import geometry_nodes, integration_weights
from contact.model.material import Material
from contact.ranks import collective, on_all_ranks
from contact.typing import Array
from forms.hencky import FormLaw, Graded, Law
from forms.history import (
    HistoryLaw,
    QuadratureLaw,
    Response,
    components,
    differential,
    to_vector,
    with_stiffness,
)
from forms.kinematics import Strained, strain
from forms.plane_stress import PlaneStressHistory, base_of

#: Names of variables, which are those of fields and of arrays in files.
NAME = "an identifier of ASCII letters, digits and underscores"

#: Optional parts of a response.
ENERGIES = "dissipation", "energy"
OPTIONAL = "stiffness", *ENERGIES

#: Name of the part of the history.
VARIABLES = "material"

#: Name of strain and stress among the variables of a point.
OF_STRAIN = ""


def name_of(law: Law) -> str:
    """Return a law's class for messages, in plane stress that of its base."""
    return type(base_of(law)).__name__


def first_values(law: HistoryLaw, size: int) -> dict[str, Array]:
    """Return the variables in the reference configuration, with s = `size` components, checked."""
    place = f"{name_of(law)}: variables"
    with naming(place):
        variables = law.variables(size)
        _returned(
            variables, "a mapping of names to numbers, {} for none", isinstance(variables, Mapping)
        )
    arrays = {}
    for name, value in variables.items():
        fits = isinstance(name, str) and name.isascii() and name.isidentifier()
        expect(f"{place}: the name", name, NAME, fits, "law-variables")
        with naming(f"{place}: {name!r}"):
            arrays[name] = real(value, np.shape(value), "a real number, or an array of them")
    return arrays


def respond(
    law: HistoryLaw,
    strain: Array,
    variables: Mapping[str, Array],
    kind: str = "",
    check: bool = False,
) -> Response:
    """Return `HistoryLaw.respond` of a law at n points, with the stiffness of `kind`."""
    with naming(f"{name_of(law)}: respond"):
        response = law.respond(strain, variables, kind)
        if check:
            _check_response(response, strain, variables)
        return with_stiffness(law, strain, variables, kind, response)


def _returned(returned: object, accepted: str, fits: bool, part: str = "") -> None:
    """Refuse a returned value unless it fits, inside `naming`."""
    if not fits:
        raise Returned(
            f"{part}the function returns {shorten(repr(returned))}; accepted: {accepted}"
        )


def _check_response(response: object, strain: Array, variables: Mapping[str, Array]) -> None:
    """Refuse all but a response with the same variables, and real arrays of n rows."""
    n, size = strain.shape
    _returned(response, "a Response(stress, variables, ...)", isinstance(response, Response))
    assert isinstance(response, Response)
    names = [*response.variables] if isinstance(response.variables, Mapping) else response.variables
    fits = isinstance(names, list) and {*names} == variables.keys()
    _returned(names, f"a mapping with the names {[*variables]}", fits, "variables: ")
    shapes = {"stress": (n, size), "stiffness": (n, size, size)} | dict.fromkeys(ENERGIES, (n,))
    parts = [(name, getattr(response, name), shape) for name, shape in shapes.items()]
    parts += [(repr(name), response.variables[name], had.shape) for name, had in variables.items()]
    for name, value, shape in parts:
        if value is None and name in OPTIONAL:
            continue
        shown, fits = value, False
        if isinstance(value, np.ndarray):
            shown = f"values of shape {value.shape} ({value.dtype})"
            fits = value.dtype.kind in "biuf" and value.shape == shape
        accepted = f"an array of real numbers of shape {shape}, a row per point"
        _returned(shown, accepted, fits, f"{name}: ")


def check_law(law: HistoryLaw, size: int, comm: MPI.Intracomm) -> None:
    """Refuse, on all ranks, a law that fails at zero or small strains of `size` components."""
    law = law.base if isinstance(law, PlaneStressHistory) else law
    with on_all_ranks(comm):
        first = first_values(law, size)
    by_rank = comm.allgather([(name, value.shape) for name, value in first.items()])
    words = "the same names and shapes on all ranks"
    fits = all(each == by_rank[0] for each in by_rank)
    expect(f"{name_of(law)}: variables", by_rank, words, fits, "law-variables")
    small = [way * SAMPLES[k] * np.eye(size) for way in (1, -1) for k in (0, 12)]
    strain = np.concatenate([np.zeros((1, size)), *small])
    variables = {
        name: np.broadcast_to(value, (len(strain), *value.shape)) for name, value in first.items()
    }
    with on_all_ranks(comm), np.errstate(all="ignore"):
        for kind in ("", "tangent", "secant"):
            response = respond(law, strain, variables, kind, check=True)
            for name in ("stress", *OPTIONAL):
                if (values := getattr(response, name)) is not None:
                    with naming(f"{name_of(law)}: respond: {name}"):
                        rows = values.reshape(len(strain), -1).sum(axis=1)
                        check_finite(rows, lambda i: f"at the strain {strain[i].tolist()}")


class QuadratureLaws:
    """The laws with internal variables among the materials of a body, which share names.

    `cells` are the owned cells of each material, `degree` is that of the quadrature, `fitted` that
    of the polynomials between the points of a cell. `initial` are the variables in the reference
    configuration; None without any.
    """

    def __init__(
        self,
        domain: Domain,
        materials: Sequence[Material],
        cells: Sequence[Indices],
        degree: int,
        kinematics: Strained,
        pointwise: Pointwise,
        fitted: int,
    ) -> None:
        self.comm = domain.comm
        self._domain, self._degree, self._pointwise = domain, degree, pointwise
        self.kinematics = kinematics
        self._size, self._fitted = components(domain.dim), fitted
        pairs = zip((material.law for material in materials), cells, strict=True)
        self._laws = [(law, law_cells) for law, law_cells in pairs if isinstance(law, HistoryLaw)]
        mesh = domain.mesh
        self._owned = mesh.topology.index_map(mesh.topology.dim).size_local
        for law, _ in self._laws:
            check_law(law, self._size, self.comm)
        #: Variables, kind and unknowns of the last stresses.
        self._seen: tuple[InternalVariables | None, str, Array] | None = None
        self.initial: InternalVariables | None = None
        if self._laws:
            self.initial = InternalVariables(QUADRATURE_POINTS, self._first_values())

    def _first_values(self) -> dict[str, Array]:
        """Return the variables in the reference configuration, by cell and point."""
        values: dict[str, Array] = {}
        for law, cells in self._laws:
            for name, value in law.variables(self._size).items():
                first = np.asarray(value, dtype=float)
                if name not in values:
                    values[name] = np.zeros((self._owned, self.points.shape[0], *first.shape))
                elif values[name].shape[2:] != first.shape:
                    raise InputError(
                        f"material: the variable {name!r} has the shapes {values[name].shape[2:]} "
                        f"and {first.shape} in two materials; accepted: one, or two names",
                        "law-variables",
                    )
                values[name][cells] = first
        return {name: array.reshape(-1, *array.shape[2:]) for name, array in values.items()}

    def _function(self, *shape: int) -> fem.Function:
        """Return a function at the quadrature points."""
        cell = self._domain.mesh.topology.cell_name()
        element = basix.ufl.quadrature_element(cell, shape, degree=self._degree)
        return fem.Function(fem.functionspace(self._domain.mesh, element))

    @cached_property
    def _stress(self) -> fem.Function:
        return self._function(self._size)

    @cached_property
    def _stiffness(self) -> fem.Function:
        return self._function(self._size, self._size)

    @cached_property
    def _weighed(self) -> fem.Function:
        return self._function()

    @cached_property
    def _rule(self) -> tuple[Array, Array]:
        """The points of the reference cell and their weights."""
        cell = self._domain.mesh.topology.cell_name()
        element = basix.ufl.quadrature_element(cell, degree=self._degree)
        points, weights = element.custom_quadrature()
        return np.asarray(points), np.asarray(weights)

    @property
    def points(self) -> Array:
        """The quadrature points of the reference cell, shape (q, d)."""
        return self._rule[0]

    @cached_property
    def places(self) -> Array:
        """The quadrature points of the owned cells, by cell and point, shape (places, d)."""
        space = self._function().function_space
        at = space.tabulate_dof_coordinates()[space.dofmap.list[: self._owned]]
        return np.asarray(at.reshape(-1, at.shape[-1])[:, : self._domain.dim])

    @cached_property
    def volumes(self) -> Array:
        """The volume of each quadrature point, shape (places,)."""
        shape, of = shape_of(self._domain.mesh), geometry_nodes(self._domain)
        return integration_weights(self._domain.revolved, shape, of, *self._rule).ravel()

    def law(self, law: Law | Graded) -> FormLaw:
        """Return a law for forms, with the stress and stiffness of `set`."""
        return QuadratureLaw(self._stress, self._stiffness) if isinstance(law, HistoryLaw) else law

    def fitted_law(self, law: Law | Graded) -> FormLaw:
        """Return a law for any points, with the stress of the last `fit`."""
        return QuadratureLaw(self.fits["stress"]) if isinstance(law, HistoryLaw) else law

    def of(self, state: LinearisationPoint) -> InternalVariables | None:
        """Return the variables at the beginning of a state's step; None without any."""
        part = state.history.get(VARIABLES, self.initial)
        assert part is None or isinstance(part, InternalVariables)
        return part

    def _strain(self, at: fem.Function) -> Expr:
        u = ufl.as_vector([at[i] for i in range(self._domain.dim)])
        return to_vector(strain(u, self.kinematics), self._size)

    def _responses(
        self, state: LinearisationPoint, kind: str = ""
    ) -> Iterator[tuple[Indices, Response]]:
        """Yield chunks of cells and the response, with "tangent", "symmetric" part or "secant"."""
        for law, cells, strains, variables in self._points(state, state.x):
            response = respond(law, strains, variables, "tangent" if kind == "symmetric" else kind)
            yield cells, response.symmetrised() if kind == "symmetric" else response

    def _points(
        self, state: LinearisationPoint, x: Array
    ) -> Iterator[tuple[HistoryLaw, Indices, Array, dict[str, Array]]]:
        """Yield a law, a chunk of cells, strains of x and the variables before at their points."""
        before = self.of(state)
        for law, law_cells in self._laws:
            assert before is not None
            values = self._pointwise.values("strain", self._strain, self.points, x, law_cells)
            for cells, strains in values:
                if cells.size == 0:  # a rank may have no cells of a law
                    continue
                variables = self._at(before.arrays, law, cells)
                yield law, cells, strains.reshape(-1, self._size), variables

    def _at(self, arrays: Mapping[str, Array], law: HistoryLaw, cells: Indices) -> dict[str, Array]:
        """Return the variables of a law at the points of some cells."""
        return {name: self._in(cells, arrays[name]) for name in law.variables(self._size)}

    def _in(self, cells: Indices, array: Array) -> Array:
        """Return values at the points of ascending cells, without a copy if these are all."""
        if cells.size == self._owned:
            values = array.view()
        else:
            values = self.by_cell(array)[cells].reshape(-1, *array.shape[1:])
        values.flags.writeable = False  # a user's law cannot change the history
        return values

    def by_cell(self, array: Array) -> Array:
        """Return values by place as those by cell and point."""
        return array.reshape(self._owned, self.points.shape[0], *array.shape[1:])

    def _put(self, into: dict[str, Array], cells: Indices, values: Mapping[str, Array]) -> None:
        """Write values of variables at the points of some cells."""
        for name, value in values.items():
            by_cell = self.by_cell(into[name])
            by_cell[cells] = value.reshape(by_cell[cells].shape)

    @collective
    def set(self, state: LinearisationPoint, kind: str = "") -> None:
        """Set stresses, and the stiffness of a kind, to those at a state. Collective."""
        before = self.of(state)
        if before is None:
            return
        if self._seen is not None:
            variables, last, at = self._seen
            if variables is before and kind in ("", last) and np.array_equal(state.x, at):
                return  # the residual of a step is that of the check before it
        self._seen = None
        for cells, response in self._responses(state, kind):
            _fill(self._stress, cells, response.stress)
            if kind:
                assert response.stiffness is not None
                _fill(self._stiffness, cells, response.stiffness)
        self._seen = before, kind, state.x.copy()

    @collective
    def commit(self, state: LinearisationPoint) -> InternalVariables | None:
        """Return the variables at the end of the step that led to a state. Collective."""
        before = self.of(state)
        if before is None:
            return None
        arrays = {name: array.copy() for name, array in before.arrays.items()}
        for cells, response in self._responses(state):
            self._put(arrays, cells, response.variables)
        return before.replaced(arrays)

    def _differentials(
        self, state: LinearisationPoint, along: Array, change: InternalVariables
    ) -> Iterator[tuple[Indices, Response]]:
        """Yield chunks of cells and the differential of the response at their points."""
        moved = self._points(state, along)
        for (law, cells, strains, variables), (_, _, way, _) in zip(
            self._points(state, state.x), moved, strict=True
        ):
            changed = self._at(change.arrays, law, cells)
            yield cells, differential(law, strains, variables, way, changed)

    @collective
    def commit_along(
        self, state: LinearisationPoint, along: Array, change: InternalVariables
    ) -> InternalVariables:
        """Return the differential of `commit`, by unknowns and variables before. Collective."""
        arrays = {name: np.zeros_like(array) for name, array in change.arrays.items()}
        for cells, response in self._differentials(state, along, change):
            self._put(arrays, cells, response.variables)
        return change.replaced(arrays)

    @collective
    def before_along(self, state: LinearisationPoint, change: InternalVariables) -> None:
        """Set stresses to their differential by the variables before a step. Collective."""
        self._seen = None
        self._stress.x.array[:] = 0.0
        for cells, response in self._differentials(state, np.zeros_like(state.x), change):
            _fill(self._stress, cells, response.stress)

    @collective
    def commit_transposed(self, state: LinearisationPoint, after: InternalVariables) -> None:
        """Set stresses whose forces are derivatives of a quantity by the unknowns. Collective.

        `after` has its derivatives by the variables at the end of the step.
        """
        self._seen = None
        self._stress.x.array[:] = 0.0
        volumes = self.by_cell(self.volumes)
        for law, cells, strains, variables in self._points(state, state.x):
            weights = self._at(after.arrays, law, cells)
            by_strain = _gradient(law, strains, variables, weights, OF_STRAIN)
            volume = volumes[cells].ravel()
            _fill(self._stress, cells, by_strain / volume[:, None])

    @collective
    def before_transposed(
        self, state: LinearisationPoint, along: Array, after: InternalVariables | None
    ) -> InternalVariables | None:
        """Return the derivatives of a quantity by the variables before a step. Collective.

        `along` has its derivatives by the forces of the stresses, local values; `after` those by
        the variables at the end of the step, None for a last step.
        """
        before = self.of(state)
        if before is None:
            return None
        arrays = {name: np.zeros_like(array) for name, array in before.arrays.items()}
        moved, volumes = self._points(state, along), self.by_cell(self.volumes)
        for (law, cells, strains, variables), (_, _, by_stress, _) in zip(
            self._points(state, state.x), moved, strict=True
        ):
            weights = {} if after is None else self._at(after.arrays, law, cells)
            volume = volumes[cells].ravel()
            weights[OF_STRAIN] = volume[:, None] * by_stress
            points = law, strains, variables, weights
            self._put(arrays, cells, {name: _gradient(*points, name) for name in variables})
        return before.replaced(arrays)

    def weigh(self, state: LinearisationPoint, after: InternalVariables) -> None:
        """Set the density of `divided` to the sum of weighted variables at the end of a step."""
        ends = self.commit(state)
        assert ends is not None
        total = sum(_dot(after.arrays[name], ends.arrays[name]) for name in after.arrays)
        cells = np.arange(self._owned, dtype=np.int32)
        _fill(self._weighed, cells, total / self.volumes)

    def divided(self, functions: ufl.Argument) -> fem.Form | None:
        """Return the form of the sum of `weigh` by test function; None without variables."""
        if self.initial is None:
            return None
        dx = self._domain.dx(metadata={"quadrature_degree": self._degree})
        return fem.form(functions * self._weighed * dx)

    def energies(self, state: LinearisationPoint) -> tuple[float, float | None]:
        """Return the dissipation of a step, and the stored energy if laws have it. Collective."""
        sums, stated, volumes = np.zeros(2), self.initial is not None, self.by_cell(self.volumes)
        with on_all_ranks(self.comm):
            for cells, response in self._responses(state):
                stated = stated and response.energy is not None
                for k, values in enumerate((response.dissipation, response.energy)):
                    if values is not None:
                        sums[k] += volumes[cells].ravel() @ values
        lost, stored = map(float, self.comm.allreduce(sums, op=MPI.SUM))
        return lost, stored if self.comm.allreduce(stated, op=MPI.LAND) else None

    def silence(self) -> None:
        """Set the stresses of the laws to zero."""
        self._seen = None
        if self.initial is not None:
            self._stress.x.array[:] = 0.0

    def variables(self, law: Law) -> Mapping[str, ArrayLike]:
        """Return the internal variables of a law in the reference configuration."""
        return law.variables(self._size) if isinstance(law, HistoryLaw) else {}

    @property
    def names(self) -> list[str]:
        """The names of the variables."""
        return [] if self.initial is None else list(self.initial.arrays)

    @cached_property
    def fits(self) -> dict[str, fem.Function]:
        """Polynomials of stress and variables in each cell, by name."""
        if self.initial is None:
            return {}
        shapes = {name: array.shape[1:] for name, array in self.initial.arrays.items()}
        shapes["stress"] = (self._size,)
        mesh, degree = self._domain.mesh, self._fitted
        return {
            name: fem.Function(fem.functionspace(mesh, ("DG", degree, shape)), name=name)
            for name, shape in shapes.items()
        }

    @cached_property
    def _fitting(self) -> Array:
        """Matrix of the least squares fit of polynomials to values at points, (dofs, points)."""
        cell = self._domain.mesh.topology.cell_name()
        element = basix.ufl.element("DG", cell, self._fitted)
        return np.linalg.pinv(element.tabulate(0, self.points)[0])

    @collective
    def secant_shear(self, state: LinearisationPoint) -> Array:
        """Return the mean secant shear moduli of owned cells, 0 without history. Collective."""
        moduli = np.zeros(self._owned)
        for cells, response in self._responses(state, "secant"):
            assert response.stiffness is not None
            moduli[cells] = response.stiffness[:, -1, -1].reshape(cells.size, -1).mean(axis=1) / 2
        return moduli

    @collective
    def fit(self, state: LinearisationPoint) -> None:
        """Set `fits` to stress and variables at a state. Collective."""
        fits = self.fits
        for cells, response in self._responses(state):
            for name, values in {**response.variables, "stress": response.stress}.items():
                by_cell = values.reshape(cells.size, self.points.shape[0], -1)
                _fill(fits[name], cells, np.einsum("dq,cqi->cdi", self._fitting, by_cell))


def _gradient(
    law: HistoryLaw,
    strain: Array,
    variables: Mapping[str, Array],
    weights: Mapping[str, Array],
    name: str,
) -> Array:
    """Return the derivative of a weighted sum of the response at each point.

    `weights` are those of the variables at the end and, under `OF_STRAIN`, of the stress; the
    derivative is by the variable `name` at the beginning, or the strain.
    """
    still = {key: np.zeros_like(value) for key, value in (*variables.items(), (OF_STRAIN, strain))}
    slopes = np.zeros((len(strain), still[name][:1].size))
    for k in range(slopes.shape[1]):
        unit = np.zeros_like(slopes)
        unit[:, k] = 1.0
        direction = still | {name: unit.reshape(still[name].shape)}
        response = differential(law, strain, variables, direction.pop(OF_STRAIN), direction)
        ends = {**response.variables, OF_STRAIN: response.stress}
        slopes[:, k] = np.sum(
            [_dot(weight, ends[part]) for part, weight in weights.items()], axis=0
        )
    return slopes.reshape(still[name].shape)


def _dot(one: Array, other: Array) -> Array:
    """Return the products of values at each point, shape (n,)."""
    return np.asarray((one * other).reshape(len(one), -1).sum(axis=1))


def _fill(function: fem.Function, cells: Indices, values: Array) -> None:
    """Write values in cells, by dof."""
    blocks = function.x.array.reshape(-1, function.function_space.dofmap.index_map_bs)
    dofs = function.function_space.dofmap.list[cells]
    blocks[dofs] = values.reshape(*dofs.shape, blocks.shape[1])
