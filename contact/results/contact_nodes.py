"""Results of contact: at its nodes, of each contact, and both sides as tables and surfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from numpy.typing import NDArray
from scipy.spatial import KDTree

from contact.body.equilibrium import BodyEquilibrium
from contact.errors import InputError, counted
from contact.interface.mortar.lumping import JumpRows, Lumping
from contact.interface.mortar.surface import surface_of
from contact.interface.nodes import make_read_only
from contact.mesh.cells import Shape, shape_of
from contact.mesh.entities import paths, places_of
from contact.mesh.owners import Owners
from contact.problem.problem import ContactProblem
from contact.problem.residuals import dissipated
from contact.problem.state import State
from contact.results.quantities import values_of
from contact.results.quantity import AGAINST, NODES, SURFACE
from contact.results.resultants import resultant
from contact.typing import Array

#: Nodes with less than this share of the mean area have none but by rounding.
LEAST_AREA = 1e-9

Values = NDArray[Any]
#: Columns of equal length by name.
Table = Mapping[str, Values]


@dataclass(frozen=True)
class Grid:
    """Cells with fields, or this rank's share of them."""

    points: Array  #: nodes, shape (n, d), those of the ranks one rank after the other
    cells: NDArray[np.int64]  #: nodes in dolfinx's order, numbered over all ranks, shape (m, k)
    shape: Shape  #: of the cells
    at_points: Mapping[str, Values]  #: fields by name, one row per node
    in_cells: Mapping[str, Values] = field(default_factory=dict)  #: likewise per cell


def tangent_of(normal: Array) -> Array:
    """Return nu turned counter-clockwise by 90 degrees, (n, 2): x on a bottom, nu = (0, -1)."""
    return np.column_stack([-normal[:, 1], normal[:, 0]])


@dataclass(frozen=True, eq=False, repr=False)
class ContactResult:
    """The contact nodes of all ranks, on each of them, in the order of ``contact.csv``.

    In 2-D that is along Gamma_3 from node to node, each connected component from its end with the
    smaller x (then y); in 3-D by x, then y, then z. Nodes of one contact follow those of another.

    Attributes
    ----------
    points, weight
        Places in the reference configuration, shape (n, d), and the areas they stand for, (n,).
    normal
        Contact direction, out of the body, shape (n, d).
    gap, opening
        Initial and present distance to the foundation along it, shape (n,) (length).
    normal_displacement, slip
        Displacement along it, shape (n,), and tangential one, shape (n, d) (length).
    pressure, friction, traction
        Contact pressure -sigma_nu, (n,), friction stress -sigma_tau, and both together: the stress
        of the body on the foundation, (n, d).
    friction_bound
        Shape (n,) (stress).
    status
        "open", "stick" or "slip", shape (n,).
    potential, charge
        Of a piezoelectric body: potential, and charge that leaves through the foundation, shape
        (n,); else None.
    entry, node
        Number of the contact, and of the node over all ranks, shape (n,).
    """

    points: Array
    weight: Array
    normal: Array
    gap: Array
    opening: Array
    normal_displacement: Array
    slip: Array
    pressure: Array
    friction: Array
    traction: Array
    friction_bound: Array
    status: NDArray[np.str_]
    entry: NDArray[np.intp]
    node: NDArray[np.int64]
    _problem: ContactProblem
    potential: Array | None = None
    charge: Array | None = None

    def __post_init__(self) -> None:
        """Mark the arrays as read-only: other results are computed from the state."""
        make_read_only(self)

    def __repr__(self) -> str:
        """Return the numbers of nodes and of nodes in contact, and the largest pressure."""
        closed = np.count_nonzero(self.status != "open")
        words = f"{counted(self.status.size, 'node')}, {closed} in contact"
        return f"<ContactResult: {words}, pressure up to {self.pressure.max(initial=0.0):.4g}>"

    @property
    def part(self) -> NDArray[Any] | None:
        """Part of each node; None for a single contact."""
        names = np.array([contact.on for contact in self._problem.contacts])
        return names[self.entry] if names.size > 1 else None

    def tangential(self, vectors: Array) -> Array:
        """Return the component along `tangent_of` the contact direction; in 3-D the vectors."""
        if self._problem.dim == 3:
            return vectors
        return np.asarray(np.einsum("ni,ni->n", vectors, tangent_of(self.normal)))

    def function(self, name: str) -> fem.Function:
        """Return one of the arrays as a function on a mesh of the contact surface. Collective.

        It is NaN at nodes that are constrained, and hence no contact nodes.

        Raises
        ------
        InputError
            If there is no such array of numbers.
        """
        known = {k: v for k, v in vars(self).items() if getattr(v, "dtype", None) == np.float64}
        if name not in known:
            raise InputError(
                f"contact.function({name!r}): accepted: {', '.join(known)}", "no-such-name"
            )
        values, domain = known[name], self._problem.domain
        facets = np.concatenate([domain.facets(contact.on) for contact in self._problem.contacts])
        surface = dmesh.create_submesh(domain.mesh, domain.dim - 1, np.unique(facets))[0]
        element = ("Lagrange", self._problem.body.degree, values.shape[1:])
        made = fem.Function(fem.functionspace(surface, element), name=name)
        places = made.function_space.tabulate_dof_coordinates()[:, : domain.dim]
        distance, nearest = KDTree(self.points).query(places)
        rows = values[nearest]
        rows[distance > 1e-9 * domain.size] = np.nan
        made.x.array[:] = rows.ravel()
        return made


def contact_result(
    problem: ContactProblem, state: State, status: NDArray[np.str_]
) -> ContactResult:
    """Return the contact nodes of all ranks, with the status of this rank's. Collective."""
    nodes, jump, multipliers = problem.nodes, problem.nodal(state), state.multipliers
    gap, normal_displacement = nodes.gap, nodes.normal_component(jump)
    pressure = problem.interface.pressure(jump, multipliers)
    own: dict[str, NDArray[Any]] = {
        "points": _clean(problem, nodes.points),
        "weight": nodes.weight,
        "normal": nodes.normal,
        "gap": gap,
        "opening": gap - normal_displacement,
        "normal_displacement": normal_displacement,
        "slip": nodes.tangential_component(jump),
        "pressure": pressure,
        "friction": multipliers.friction,
        "traction": pressure[:, None] * nodes.normal + multipliers.friction,
        "friction_bound": problem.interface.bound(jump, multipliers),
        "status": status,
        "entry": problem.entry_numbers,
        "node": problem.body.layout.index_map.local_to_global(nodes.nodes),
    }
    if problem.piezoelectric:
        own["potential"] = problem.body.phi_scale * jump[:, -1]
        own["charge"] = problem.interface.foundation.charge(jump, pressure)
    own = {name: nodes.gather(values) for name, values in own.items()}
    order = _by_position(problem, nodes.gather(nodes.points))
    if problem.dim == 2:
        order = _along_chain(own["node"], order, nodes.gather(_links(problem)))
    order = order[np.argsort(own["entry"][order], kind="stable")]
    arrays: dict[str, Any] = {name: values[order] for name, values in own.items()}
    return ContactResult(**arrays, _problem=problem)


def _clean(problem: ContactProblem, points: Array) -> Array:
    """Return points without coordinates such as -3e-19, which mesh generators leave."""
    return np.where(np.abs(points) < 1e-15 * problem.domain.size, 0.0, points)


def _by_position(problem: ContactProblem, points: Array) -> NDArray[np.intp]:
    """Return the order of points by x, then y, then z."""
    # Coordinates that differ by rounding alone must not change the order.
    return np.lexsort(np.round(points / (1e-9 * problem.domain.size)).T[::-1])


def _links(problem: ContactProblem) -> NDArray[np.int64]:
    """Return the global numbers of neighbours on the owned facets of Gamma_3, shape (m, 2)."""
    space = problem.body.space
    parts = [surface_of(problem.domain, space, contact.on).nodes for contact in problem.contacts]
    nodes = np.concatenate(parts)
    # Both ends, then the middle node if there is one.
    chain = nodes if nodes.shape[1] == 2 else nodes[:, [0, 2, 1]]
    return np.concatenate([chain[:, k : k + 2] for k in range(chain.shape[1] - 1)])


def _along_chain(
    names: NDArray[np.int64], by_position: NDArray[np.intp], links: NDArray[np.int64]
) -> NDArray[np.intp]:
    """Follow the links from node to node; pieces come in the order of their first ends."""
    both = np.isin(links, names).all(axis=1)
    # Number the nodes by position, so that every choice is one of position.
    rank = np.empty_like(by_position)
    rank[by_position] = np.arange(by_position.size)
    sorter = np.argsort(names)
    edges = rank[sorter[np.searchsorted(names, links[both], sorter=sorter)]]
    return np.asarray(by_position[np.concatenate(paths(edges, names.size))])


@dataclass(frozen=True)
class ContactShare:
    """The results of one contact, as they stand in the summary."""

    problem: ContactProblem = field(repr=False)
    state: State = field(repr=False)
    own: NDArray[np.bool_] = field(repr=False)  #: its nodes among the owned contact nodes
    force: Array  #: of the body on its foundation, or on the other body, see `Resultant`
    moment: Array  #: as the force
    area: float  #: tributary areas of the nodes that touch (length^(d - 1))
    max_pressure: float  #: largest contact pressure (stress)
    mean_pressure: float  #: mean contact pressure over `area` (stress)
    stick: float  #: share of `area` that sticks
    slip: float  #: share of `area` that slips
    dissipation: float  #: of friction in the step (work)


def contact_shares(
    problem: ContactProblem, state: State, status: NDArray[np.str_]
) -> dict[str, ContactShare]:
    """Return the results of each contact by its name, with the status of its nodes. Collective."""
    nodes, jump = problem.nodes, problem.nodal(state)
    pressure = problem.interface.pressure(jump, state.multipliers)
    forces = nodes.weight[:, None] * problem.interface.traction(jump, state.multipliers)
    found = {}
    for number, contact in enumerate(problem.contacts):
        own = problem.entry_numbers == number
        total = resultant(problem, nodes.points[own], forces[own])
        stick, slides = (nodes.sum(own & (status == name)) for name in ("stick", "slip"))
        area = stick + slides
        found[contact.label] = ContactShare(
            problem=problem,
            state=state,
            own=own,
            force=total.force,
            moment=total.moment,
            area=area,
            max_pressure=nodes.maximum(np.where(own, pressure, 0.0)),
            mean_pressure=nodes.sum(np.where(own, pressure, 0.0)) / area if area > 0 else 0.0,
            stick=stick / area if area > 0 else 0.0,
            slip=slides / area if area > 0 else 0.0,
            dissipation=dissipated(problem, state, own),
        )
    return found


def contact_table(contact: ContactResult) -> Table:
    """Return the columns of ``contact.csv``, the same on all ranks."""
    return values_of(NODES, contact)


def contact_surface(listed: ContactResult, state: State) -> Grid:
    """Return this rank's share of the contact part. Collective."""
    problem = listed._problem
    body, d = problem.body, problem.dim
    owners = Owners.of(body.layout.index_map, problem.comm)
    parts = [surface_of(problem.domain, body.space, contact.on) for contact in problem.contacts]
    # A node of two contacts is one of each.
    nodes, cells = _numbered(owners, [part.nodes for part in parts])
    owner = np.repeat(np.arange(len(nodes)), [own.size for own in nodes]).astype(np.int32)
    points, x = _at_nodes(body, state, np.concatenate(nodes) - owners.begin)
    rigid = np.array([contact.against is None for contact in problem.contacts], dtype=np.int32)
    fields: dict[str, Values] = {
        "displacement": x[:, :d],
        "entry": owner,
        "rigid": rigid[owner],
    }
    if problem.piezoelectric:
        fields["potential"] = body.phi_scale * x[:, d]
    size = owners.begins[-1]
    known, numbers = owner * size + np.concatenate(nodes), listed.entry * size + listed.node
    for name, values in values_of(SURFACE, listed).items():
        fields[name] = _at(known, numbers, values)
    return Grid(points, cells, shape_of(problem.domain.mesh).facet, fields)


def _numbered(
    owners: Owners, sides: Sequence[NDArray[np.int64]]
) -> tuple[list[NDArray[np.int64]], NDArray[np.int64]]:
    """Return the nodes of this rank on facets, and the facets by numbers of them. Collective."""
    # The nodes of each side, ascending, and those of the ranks one after the other.
    nodes = [owners.requested(facets.ravel()) for facets in sides]
    begin, cells = owners.comm.exscan(sum(own.size for own in nodes)) or 0, []
    for own, facets in zip(nodes, sides, strict=True):

        def of(given: NDArray[np.int64], own: Values = own, first: int = begin) -> Values:
            return first + np.searchsorted(own, given)

        cells.append(owners.values(facets.ravel(), of).reshape(facets.shape))
        begin += own.size
    return nodes, np.concatenate(cells)


def _at_nodes(body: BodyEquilibrium, state: State, nodes: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return points and unknowns, (n, d) and (n, k), of nodes of this rank."""
    return body.layout.points[nodes], body.nodal(state.x)[nodes]


def _at(known: NDArray[np.int64], numbers: NDArray[np.int64], values: Values) -> Values:
    """Return values by numbers at some that are known: NaN, or -1, where there is none."""
    none = np.nan if values.dtype.kind == "f" else -1
    found = np.full((len(known), *values.shape[1:]), none, dtype=values.dtype)
    place = places_of(known, numbers)
    found[place >= 0] = values[place[place >= 0]]
    return found


def opposite_surface(problem: ContactProblem, state: State) -> Grid | None:
    """Return this rank's share of the parts `against`; None if all obstacles are rigid. Collective.

    Its stresses are the forces int N_l lambda on its nodes over their areas: a constant pressure is
    the same constant on both sides.
    """
    body, d = problem.body, problem.dim
    owners = Owners.of(body.layout.index_map, problem.comm)
    pressure = problem.interface.pressure(problem.nodal(state), state.multipliers)
    stresses = np.column_stack([pressure, state.multipliers.vectors(problem.nodes)])
    ends = np.cumsum([own.nodes.nodes.size for own in problem.geometries])[:-1]
    sides, facets = [], []
    for i, own in enumerate(np.split(stresses, ends)):
        against, geometry = problem.contacts[i].against, problem.geometries[i]
        if against is None or geometry.jumps is None:
            continue
        surface = surface_of(problem.domain, body.space, against)
        lumped = Lumping.of(surface)
        acting = _acting(owners, geometry.jumps, lumped, geometry.nodes.weight[:, None] * own)
        points, x = _at_nodes(body, state, lumped.nodes - owners.begin)
        sides.append(
            {
                "points": points,
                "displacement": x[:, :d],
                "pressure": acting[:, 0],
                "traction": acting[:, 1:],
                "normal": lumped.normal / np.linalg.norm(lumped.normal, axis=1)[:, None],
                "weight": lumped.weight,
                "entry": np.full(lumped.nodes.size, i, dtype=np.int32),
            }
        )
        facets.append(surface.nodes)
    if not sides:
        return None
    fields = {name: np.concatenate([side[name] for side in sides]) for name in sides[0]}
    _, cells = _numbered(owners, facets)
    return Grid(fields.pop("points"), cells, shape_of(problem.domain.mesh).facet, fields)


def _acting(owners: Owners, jumps: JumpRows, lumped: Lumping, forces: Array) -> Array:
    """Return the stresses on nodes of the other side, (m, k), of forces at contact nodes."""
    # Of all ranks, on nodes of this one. Collective.
    on_nodes: Array = np.zeros((lumped.nodes.size, forces.shape[1]))
    nodes, sums = owners.sums(jumps.masters, jumps.M.T @ forces)
    on_nodes[np.searchsorted(lumped.nodes, nodes)] = sums
    if lumped.jumps is not None:
        on_nodes = lumped.jumps.on_coefficients(owners, on_nodes)
    weight = lumped.weight
    area, count = owners.comm.allreduce(np.array([weight.sum(), weight.size]))
    some = weight > LEAST_AREA * area / count
    return np.where(some[:, None], on_nodes / np.where(some, weight, 1.0)[:, None], np.nan)


def opposite_table(problem: ContactProblem, surface: Grid) -> Table:
    """Return the rows of ``contact-against.csv``: nodes with an area, contact by contact."""
    fields, points = surface.at_points, _clean(problem, surface.points)
    names = np.array([contact.against or "" for contact in problem.contacts])
    columns = values_of(AGAINST, {"on": names[fields["entry"]], "x": points, **fields})
    order = _by_position(problem, points)
    order = order[np.argsort(fields["entry"][order], kind="stable")]
    order = order[np.isfinite(columns["pressure"][order])]
    return {name: values[order] for name, values in columns.items()}
