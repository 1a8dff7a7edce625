"""An estimate of the discretisation error in the energy norm.

Degree 1: eta_K^2 = int_K (G sigma - sigma) : S : (G sigma - sigma), G sigma being the nodal means
of the stress inside each material (Zienkiewicz and Zhu, IJNME 24, 1987); also of degree 2 with the
mean dilatation, whose constant pressures leave the stress an error of first order. Degree 2: the
energy of the errors of `contact.results.local_problems`. Of degree 1 the loads that nodes do not
see are added (`oscillation`). S is the compliance of the last linearisation, with the secant
modulus. In a piezoelectric body sigma is the pair (sigma, D), and S that of [F, -e^T; e, beta],
whose energy is eps : F eps + E . beta E. At the contact pressures times gaps between the nodes are
added, and friction times slip that is not dissipated (Krause, Veeser and Walloth, Numer. Math.
130, 2015), at most the energy of tractions that move to where the gap is closed.

`nodal_means` are means of the cells around a vertex. Across facets inside of the body at which
something acts, stresses jump: there the cells fall into groups that these facets separate, as the
materials do. `intervals` are those of the quoted quantities on three nested uniform meshes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from ufl.classes import Constant, ConstantValue, MultiIndex
from ufl.corealg.traversal import traverse_unique_terminals

from contact import _compat
from contact.body.elements import MEAN_DILATATION, in_chunks
from contact.body.materials import factor_of
from contact.mesh.cells import rule, shape_of
from contact.mesh.domain import Domain, members, part_name
from contact.mesh.entities import Indices, accumulated, cell_facets, cells_at, sums_at, with_ghosts
from contact.mesh.geometry import geometry_nodes, integration_weights
from contact.mesh.owners import Owners
from contact.model.body import Bolt
from contact.model.material import Material
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.ranks import exchanged
from contact.results.fields import DerivedFields
from contact.results.local_problems import LocalProblems
from contact.tolerances import NEGLIGIBLE, ROUNDING
from contact.typing import Array
from forms.crystal import VOIGT
from forms.elasticity import Anisotropic, mandel, moduli
from forms.hencky import is_linear
from forms.history import HistoryLaw, isotropic_stiffness
from forms.plane_stress import without_stress_across

#: Degrees of the rules for loads on facets, far above their own, and in cells, which are many.
ON_FACETS, IN_CELLS = 9, 4

#: Parts of loads in UFL that are the same everywhere.
UNIFORM = Constant, ConstantValue, MultiIndex

#: Factors of the components of a tensor in the basis of Mandel.
MANDEL = np.array([1.0] * 3 + [np.sqrt(2.0)] * 3)


@dataclass(frozen=True)
class Estimate:
    """The estimated discretisation error of a solution."""

    squares: Array  #: eta_K^2 of the owned cells, shape (cells,) (work)
    contact: float  #: the part of their sum that is from the contact
    energy: float  #: the square of the energy norm of the solution, over all ranks
    total: float  #: the sum of eta_K^2 over all ranks
    #: Mean of bulk over shear modulus, weighted by the energy, the latter |s|/(2 |e|) of the
    #: deviatoric stress and the whole deviatoric strain; of a crystal as of `_of_crystal`. None in
    #: plane stress, where volumes are free to change.
    stiffness_ratio: float | None

    @property
    def cells(self) -> Array:
        """eta_K of the owned cells over the same norm: the sum of its squares is `relative`^2."""
        whole = self.energy + self.total
        return np.sqrt(self.squares / whole) if whole != 0 else np.zeros_like(self.squares)

    @property
    def relative(self) -> float:
        """The estimated error, normalised: sqrt(total / (energy + total))."""
        whole = self.energy + self.total
        return float(np.sqrt(self.total / whole)) if whole != 0 else 0.0


def estimated(
    problem: ContactProblem, state: State, fields: DerivedFields | None = None
) -> Estimate:
    """Estimate the error of a state, whose fields may be known already. Collective."""
    body, shape = problem.body, shape_of(problem.domain.mesh)
    if body.degree == 1 and not shape.simplex:
        # Stresses vary in the cell, and are most exact in its middle.
        fields = DerivedFields(body, state, shape.nodes(1))
    fields = fields or DerivedFields(body, state)
    flux, strain = sampled(fields)
    secant = body.laws.secant_shear(state)
    local = None
    if body.degree == 2 and body.element != MEAN_DILATATION:
        local = LocalProblems(problem, state, flux)
    at, weights = rule(shape, 2 * body.degree)
    linear, shapes = shape.lagrange(1, at), shape.lagrange(shape.degree_of(flux.shape[1]), at)
    apart, modulus = _acting_inside(problem), np.ones(len(flux))
    squares, sums, volume = np.zeros(len(flux)), np.zeros(3), 0.0
    for material, cells in zip(body.description.materials, body.cells, strict=True):
        law, factor = material.law, factor_of(body.domain, material, cells)
        shear = secant[cells]
        if not isinstance(law, Anisotropic | HistoryLaw):
            shear = np.asarray(law.secant_modulus(strain[cells] ** 2)).mean(axis=1)
        modulus[cells] = factor * (
            _mean_shear(law, body.dim) if isinstance(law, Anisotropic) else shear
        )
        means, places = None, None
        if local is not None:
            squares[cells] = local.squares(cells, _stiffness(material, shear, factor))
        else:
            # Of degree 1 stresses are most exact in the middle of a cell.
            values = flux.mean(axis=1) if body.degree == 1 else flux[:, : shape.corners]
            means, places = nodal_means(body.domain, cells, values[cells], apart)
            del values  # as large as the stresses
        for some in in_chunks(np.arange(cells.size)):
            chosen = cells[some]
            energy = _density(material, shear[some], factor[some])
            of, raw = geometry_nodes(body.domain, chosen), flux[chosen]
            if len(fields.points) > 1:  # else constant in a cell
                raw = shapes @ raw
            volumes = integration_weights(body.domain.revolved, shape, of, at, weights)
            volume += float(volumes.sum())
            if means is not None and places is not None:
                smooth = linear @ means[places[some]]
                squares[chosen] = np.sum(volumes * energy(smooth - raw), axis=1)
            known = np.sum(volumes * energy(raw), axis=1)
            sums[0] += known.sum()
            if material.in_plane_stress:
                continue
            whole = shear[some]
            if isinstance(law, HistoryLaw):
                whole = _over_whole_strain(law, flux[chosen], strain[chosen])
                known = np.sum(volumes * _density(material, whole, factor[some])(raw), axis=1)
            ratio = _stiffness_ratio(problem.domain, material, whole, flux[chosen])
            sums[1:] += known @ ratio, known.sum()
    if body.degree == 1:  # the local problems of degree 2 see loads up to the third degree
        # A surface is as stiff as E/(1 - nu^2), twice the shear modulus and more.
        squares += oscillation(problem, state.time) / (2 * modulus)
    at_contact = _at_contact(problem, state, modulus)
    squares += at_contact
    sums = body.comm.allreduce(np.append(sums, [squares.sum(), at_contact.sum()]), op=MPI.SUM)
    energies, by_ratio, with_ratio, total, contact = map(float, sums)
    if energies <= _rounding_energy(problem, state, volume):
        return Estimate(np.zeros_like(squares), 0.0, 0.0, 0.0, None)
    mean_ratio = by_ratio / with_ratio if with_ratio > 0 else None
    return Estimate(squares, contact, energies, total, mean_ratio)


def _mean_shear(law: Anisotropic, dim: int) -> float:
    """Return the mean shear modulus of a crystal."""
    return float(np.diag(mandel(law.stiffness))[5 if dim == 2 else 3 :].mean()) / 2


def _stiffness_ratio(domain: Domain, material: Material, shear: Array, flux: Array) -> Array:
    """Return bulk over shear modulus of cells, or of a crystal its ratio of `_of_crystal`."""
    if isinstance(material.law, Anisotropic):
        return _of_crystal(domain, material, flux.mean(axis=1))
    return np.asarray(_bulk(material) / shear, dtype=np.float64)


def _acting_inside(problem: ContactProblem) -> list[str]:
    """Return the parts inside of the body at which something acts, and stresses jump."""
    # At cuts of bolts it is the displacement that jumps.
    body = problem.body
    groups = [one for one in body.global_unknowns.groups if not isinstance(one.description, Bolt)]
    acting = [*(fixed.on for fixed in body.description.fixed), *(group.part for group in groups)]
    parts = dict.fromkeys(name for part in acting for name in members(part))
    return [name for name in parts if name in problem.domain.inside]


def _rounding_energy(problem: ContactProblem, state: State, volume: float) -> float:
    """Return the energy of strains that a rigid motion leaves by rounding. Collective."""
    # They are differences of displacements over the size of a cell, in all directions.
    body, comm, topology = problem.body, problem.comm, problem.domain.mesh.topology
    moved = float(np.abs(body.nodal(state.x)[:, : body.dim]).max(initial=0.0))
    size = body.domain.size / topology.index_map(body.dim).size_global ** (1 / body.dim)
    strain = ROUNDING * comm.allreduce(moved, op=MPI.MAX) / size
    energy = body.layout.stiffness * (body.dim * strain) ** 2
    return energy * comm.allreduce(volume, op=MPI.SUM)


def sampled(fields: DerivedFields) -> tuple[Array, Array]:
    """Return stresses in the basis of Mandel, with D if coupled, and |dev eps|, at the points."""
    body, columns = fields.body, fields.columns
    count = body.domain.mesh.topology.index_map(body.dim).size_local
    flux = np.zeros((count, len(fields.points), 9 if body.piezoelectric else 6))
    strain = np.zeros(flux.shape[:2])
    stress = columns["stress"].start
    for chosen, values in fields.chunks():
        for m, (i, j) in enumerate(VOIGT):
            flux[chosen, :, m] = MANDEL[m] * values[..., stress + 3 * i + j]
        if body.piezoelectric:
            charge = values[..., columns["electric_displacement"]]
            flux[chosen, :, 6 : 6 + body.dim] = charge
        strain[chosen] = values[..., columns["dev_strain"].start]
    return flux, strain


def _bulk(material: Material) -> float:
    """Return the bulk modulus."""
    return moduli(float(material.law.young), float(material.law.poisson))[0]


def _over_whole_strain(law: HistoryLaw, flux: Array, strain: Array) -> Array:
    """Return |s|/(2 |e|) of cells, at most the shear modulus, and positive."""
    # Volumes change wrongly with the whole strain, however many steps it has been in: the pressure
    # of that is to be seen beside s. The secant of a step is nearly elastic where the step is
    # short.
    stress = flux[..., :6].copy()
    stress[..., :3] -= stress[..., :3].mean(axis=-1, keepdims=True)
    modulus = moduli(float(law.young), float(law.poisson))[1]
    elastic = 2 * modulus * strain.mean(axis=1)
    size = np.linalg.norm(stress, axis=-1).mean(axis=1)
    whole = np.linalg.norm(flux[..., :6], axis=-1).mean(axis=1)
    strained = elastic > NEGLIGIBLE * whole
    share = np.divide(size, elastic, out=np.ones_like(size), where=strained)
    return np.asarray(modulus * np.clip(share, NEGLIGIBLE, 1.0))


def _of_crystal(domain: Domain, material: Material, flux: Array) -> Array:
    """Return by how much the stiffest strain is stiffer than the rest of the strain of cells."""
    # The eigenvalue of the stiffest strain over the Rayleigh quotient of the strain without that,
    # by 3/2 in 3-D, so that it is the ratio of bulk and shear modulus where the stiffness is
    # isotropic: then the stiffest strain is that of the volume, of fibres that along them.
    whole = _stiffness(material, np.ones(1), np.ones(1))[0]
    kept = list(range(6)) if domain.dim == 3 else [0, 1, 5]
    if domain.revolved:
        kept = [0, 1, 2, 5]
    strain = (flux[:, : len(whole)] @ np.linalg.inv(whole).T)[:, kept]
    stiffness = whole[np.ix_(kept, kept)]
    values, ways = np.linalg.eigh(stiffness)
    rest = strain - np.outer(strain @ ways[:, -1], ways[:, -1])
    square = np.sum(rest**2, axis=1)
    seen = square > NEGLIGIBLE**2 * np.sum(strain**2, axis=1)
    quotient = np.full(len(flux), values[:-1].mean())
    np.divide(np.sum((rest @ stiffness) * rest, axis=1), square, out=quotient, where=seen)
    return np.asarray(values[-1] / quotient * 2 / sum(k < 3 for k in kept))


def _density(material: Material, shear: Array, factor: Array) -> Callable[[Array], Array]:
    """Return the energy density of fluxes of shape (cells, q, components) in a material."""
    if material.piezo is None and not isinstance(material.law, Anisotropic):
        bulk = _bulk(material)

        def isotropic(flux: Array) -> Array:
            trace = flux[..., :3].sum(axis=-1)
            size = np.einsum("cqi,cqi->cq", flux, flux)
            density = trace**2 / (9 * bulk) + (size - trace**2 / 3) / (2 * shear[:, None])
            return density / factor[:, None]

        return isotropic
    compliance = np.linalg.inv(_stiffness(material, shear, factor))
    # Without coupling a neighbour's D is zero here.
    size = compliance.shape[1]
    return lambda flux: np.sum((flux[..., :size] @ compliance) * flux[..., :size], axis=-1)


def _stiffness(material: Material, shear: Array, factor: Array) -> Array:
    """Return the stiffness of each cell, or one, shape (cells, 6, 6); with coupling 9 by 9."""
    # It maps strains to stresses in the basis of Mandel, and (eps, E) to (sigma, D); in plane
    # stress those in the plane, the strains across being those at which no stress acts.
    law = material.law
    if isinstance(law, Anisotropic):
        stiffness = mandel(law.stiffness)[None]
    else:
        own = shear[:1] if is_linear(law) else shear
        stiffness = isotropic_stiffness(_bulk(material), own, 6)
        if material.in_plane_stress:
            stiffness = without_stress_across(stiffness)
    if material.factor is not None:
        stiffness = factor[:, None, None] * stiffness
    piezo = material.piezo
    if piezo is None:
        return stiffness
    coupling = np.array([np.asarray(piezo.e)[:, j, k] for j, k in VOIGT]).T * MANDEL
    whole = np.zeros((len(stiffness), 9, 9))
    whole[:, :6, :6], whole[:, 6:, 6:] = stiffness, np.asarray(piezo.beta)
    whole[:, :6, 6:], whole[:, 6:, :6] = -coupling.T, coupling
    return whole


def _at_contact(problem: ContactProblem, state: State, modulus: Array) -> Array:
    """Return the share of contact in eta_K^2 of the owned cells, shape (cells,). Collective."""
    # Between its nodes, all values linear: p |u_n - g| and s |u_t| - lambda_f . u_t, where
    # complementarity holds at the nodes alone. Their integral D over a facet counts a multiplier
    # lambda that is spread over its size h, however narrow the contact, as at an edge. Moved to a
    # width b < h, where the gap is closed, lambda leaves D b/h and costs S log(h/b), as a line
    # load does, with S = h/(2 pi g) int |lambda|^2 as of a load that nodes do not see. Where S < D
    # the sum is least for b/h = S/D: S (1 + log(D/S)).
    body, interface = problem.body, problem.interface
    domain, d, jump = body.domain, body.dim, problem.nodal(state)
    sides = tuple(dict.fromkeys(name for c in problem.contacts for name in members(c.on)))
    squares = np.zeros(domain.mesh.topology.index_map(d).size_local)
    cells, place = cells_at(domain.mesh, domain.facets(part_name(sides)))
    shape = shape_of(domain.mesh)
    closures = shape.facet_nodes(body.degree)[place]
    nodes = np.take_along_axis(body.space.dofmap.list[cells], closures, axis=1)
    index_map = body.space.dofmap.index_map
    values = np.zeros((index_map.size_local + index_map.num_ghosts, 3 + 2 * d))
    normal_gap = interface.normal_gap(jump)
    values[interface.nodes.nodes] = np.column_stack(
        [
            state.multipliers.contact,
            np.where(np.isfinite(normal_gap), normal_gap, 0.0),  # no rigid part: no pressure on it
            interface.bound(jump, state.multipliers),
            interface.slip(jump),
            state.multipliers.friction,
        ]
    )
    values = with_ghosts(index_map, values)
    at, weights = rule(shape.facet, 4)
    found = shape.facet.lagrange(body.degree, at) @ values[nodes]
    contact, normal_gap, bound = (found[..., i] for i in range(3))
    slip, friction = found[..., 3 : 3 + d], found[..., 3 + d :]
    # Next to a single node the quadratic function of its lambda_c is negative.
    density = np.maximum(contact, 0.0) * np.abs(normal_gap) + np.abs(
        bound * np.linalg.norm(slip, axis=-1) - np.sum(slip * friction, axis=-1)
    )
    behind = geometry_nodes(domain, cells)
    ends = shape.facet_nodes(domain.order)[place]
    of_facet = np.take_along_axis(behind, ends[..., None], axis=1)
    areas = integration_weights(domain.revolved, shape.facet, of_facet, at, weights)
    products = np.sum(areas * density, axis=1)
    size = integration_weights(False, shape.facet, of_facet, at, weights).sum(axis=1)
    share = size ** (1 / shape.facet.dim) / np.pi * _compliance(problem, cells, modulus)
    moved = share * np.sum(areas * (contact**2 + np.sum(friction**2, axis=-1)), axis=1)
    ratio = np.divide(products, moved, out=np.ones_like(moved), where=moved > 0)
    # Beside a facet that touches with all of its nodes there is room, and b is h.
    touches = values[nodes, 0] > interface.negligible(jump, state.multipliers.contact)
    within = sums_at(index_map, nodes[touches.all(axis=1)], 1.0) > 0
    alone = ~np.any(touches & within[nodes], axis=1)
    moved *= 1 + alone * np.log(np.maximum(ratio, 1.0))
    np.add.at(squares, cells, np.minimum(products, moved))
    return squares


def _compliance(problem: ContactProblem, cells: Indices, modulus: Array) -> Array:
    """Return 1/(2 g) of cells at the contact, of two bodies with that of the other. Collective."""
    found, domain = 1 / (2 * modulus[cells]), problem.domain
    for contact in problem.contacts:
        if contact.against is not None:
            own, other = (
                cells_at(domain.mesh, domain.facets(part))[0]
                for part in (contact.on, contact.against)
            )
            # The softest: which cells are opposite is not asked.
            softest = np.max(1 / (2 * modulus[other]), initial=0.0)
            found[np.isin(cells, own)] += problem.comm.allreduce(float(softest), op=MPI.MAX)
    return found


def oscillation(problem: ContactProblem, time: float) -> Array:
    """Return the square of the data oscillation of the owned cells, shape (cells,). Collective.

    Sums over facets of h |t - t_h|^2 and over cells of h^2 |f - f_h|^2 (Verfürth, A Posteriori
    Error Estimation Techniques for Finite Element Methods, 2013, section 1.4), t_h and f_h being
    the mean loads at the nodes, without charges; h/pi is the constant of Poincaré's inequality.
    """
    domain = problem.domain
    mesh, d = domain.mesh, domain.dim
    squares = np.zeros(mesh.topology.index_map(d).size_local)
    whole, forms = shape_of(mesh), problem.body.forms
    facets, forms.time.value = whole.facet_corners, time
    vertices = _compat.geometry_dofmap(mesh)[:, : whole.corners]
    given = forms.weak_form.loads.items()
    for load in (one for key, loads in given if "charge" not in key for one in loads):
        if all(isinstance(part, UNIFORM) for part in traverse_unique_terminals(load.value)):
            continue
        shape = whole
        cells: Indices = np.arange(len(squares), dtype=np.int32)
        place: NDArray[np.intp] = np.zeros(len(squares), dtype=np.intp)
        if load.on is not None:
            shape = whole.facet
            cells, place = cells_at(mesh, domain.facets(load.on))
        of, corners = geometry_nodes(domain, cells), vertices[cells]
        at, weights = rule(shape, IN_CELLS if load.on is None else ON_FACETS)
        points = at
        if load.on is not None:
            points = np.concatenate([whole.on_facet(k, at) for k in range(len(facets))])
        shown = len(cells), len(points) // len(at), len(at), *(load.value.ufl_shape or (1,))
        values = np.asarray(fem.Expression(load.value, points).eval(mesh, cells)).reshape(shown)
        found = load.amplitude(time) * values[np.arange(len(cells)), place]
        if load.on is not None:
            nodes = whole.facet_nodes(domain.order)[place]
            of = np.take_along_axis(of, nodes[..., None], axis=1)
            corners = np.take_along_axis(corners, facets[place], axis=1)
        sizes = integration_weights(domain.revolved, shape, of, at, weights)
        unseen = found - _seen(domain, corners, shape.lagrange(1, at), sizes, found)
        area = integration_weights(False, shape, of, at, weights).sum(axis=1)
        share = (area ** (1 / shape.dim) / np.pi) ** (1 + (load.on is None))
        np.add.at(squares, cells, share * np.einsum("nq,nqc->n", sizes, unseen**2))
    return squares


def _seen(
    domain: Domain, corners: NDArray[np.integer], hats: Array, sizes: Array, values: Array
) -> Array:
    """Return linear functions of mean values, (n, q, c), around vertices, (n, k). Collective."""
    with_ones = np.concatenate([values, np.ones((*sizes.shape, 1))], axis=2)
    shares = np.einsum("nq,qk,nqc->nkc", sizes, hats, with_ones)
    found = sums_at(domain.mesh.geometry.index_map(), corners, shares)[corners]
    # On the axis of revolution there is no area.
    means = found[..., :-1] / np.where(found[..., -1:] > 0, found[..., -1:], 1.0)
    return np.asarray(hats @ means)


def nodal_means(
    domain: Domain, cells: Indices, values: Array, apart: Sequence[str] = ()
) -> tuple[Array, NDArray[np.integer]]:
    """Return means around vertices, (n, components), and places of corners, (cells, corners).

    Values are those at corners, (cells, corners, components), or constant in cells, (cells,
    components); across parts that are `apart` there are no means. Collective.
    """
    corners = shape_of(domain.mesh).corners
    dofmap, index_map = _compat.geometry_dofmap(domain.mesh), domain.mesh.geometry.index_map()
    sums = np.zeros((index_map.size_local + index_map.num_ghosts, values.shape[-1] + 1))
    for some in in_chunks(np.arange(cells.size)):
        vertices = dofmap[cells[some], :corners]
        here = values[some].reshape(-1, values.shape[-1])
        # The constants of a cell go to all of its corners.
        column = np.repeat(np.arange(len(here)), vertices.size // max(len(here), 1))
        rows = np.ones(vertices.size), (vertices.ravel(), column)
        around = sparse.csr_array(rows, shape=(len(sums), len(here)))
        sums[:, :-1] += around @ here
        sums[:, -1] += around.sum(axis=1)
    if domain.comm.size > 1:
        sums = accumulated(index_map, sums)
    with np.errstate(invalid="ignore"):
        means = np.asarray(sums[:, :-1] / sums[:, -1:])
    places = dofmap[cells, :corners]
    return _separated(domain, cells, values, apart, means, places) if apart else (means, places)


def _separated(
    domain: Domain,
    cells: Indices,
    values: Array,
    apart: Sequence[str],
    means: Array,
    places: NDArray[np.integer],
) -> tuple[Array, NDArray[np.integer]]:
    """Return means and places with those of groups at the vertices of parts. Collective."""
    # Corners of two cells at a vertex are of one group where a facet joins the cells that has the
    # vertex and is in no part. The rank that owns a vertex is sent all corners there, and returns
    # the mean of its group to each.
    mesh, comm, d = domain.mesh, domain.comm, domain.dim
    shape = shape_of(mesh)
    mesh.topology.create_connectivity(d, d - 1)
    of_facets, of_nodes = mesh.topology.index_map(d - 1), mesh.geometry.index_map()
    facet_owners, owners = Owners.of(of_facets, comm), Owners.of(of_nodes, comm)
    own = np.unique(np.concatenate([domain.facets_anywhere(name) for name in apart]))
    local = cell_facets(mesh)[cells]
    facets = of_facets.local_to_global(local.ravel()).reshape(local.shape)
    nodes = of_nodes.local_to_global(places.ravel()).reshape(places.shape)
    within = facet_owners.requested(of_facets.local_to_global(own.astype(np.int32)))
    cut = np.isin(facets, facet_owners.among(within, facets.ravel()))
    named = owners.requested(nodes[:, shape.facet_corners][cut].ravel())
    chosen = np.isin(nodes, owners.among(named, nodes.ravel()))
    joins = np.zeros((len(shape.facet_corners), shape.corners), dtype=bool)
    np.put_along_axis(joins, shape.facet_corners, True, axis=1)
    cell, facet, corner = np.nonzero(chosen[:, None] & joins & ~cut[:, :, None])
    before = comm.exscan(int(chosen.sum())) or 0
    number = before + np.cumsum(chosen).reshape(chosen.shape) - 1
    ranks = owners.ranks(nodes[chosen])
    around = values[chosen] if values.ndim == 3 else values[np.nonzero(chosen)[0]]
    by, numbers, around = exchanged(comm, ranks, number[chosen], around)
    # A cell at a vertex is joined to those of its facets that are in no part.
    at = np.column_stack([number[cell, corner], facets[cell, facet], nodes[cell, corner]])
    joined = exchanged(comm, owners.ranks(at[:, 2]), at)[1]
    _, meets = np.unique(joined[:, 1:], axis=0, return_inverse=True)
    size = len(numbers) + len(joined)
    links = np.ones(len(joined)), (np.searchsorted(numbers, joined[:, 0]), len(numbers) + meets)
    groups = connected_components(sparse.csr_array(links, shape=(size, size)), directed=False)[1]
    _, group = np.unique(groups[: len(numbers)], return_inverse=True)
    entries = np.ones(group.size), (group, np.arange(group.size))
    onto = sparse.csr_array(entries, shape=(group.max(initial=-1) + 1, group.size))
    sums = onto @ np.column_stack([around, np.ones(group.size)])
    found = exchanged(comm, by, (sums[:, :-1] / sums[:, -1:])[group])[1]
    # They come back in the order in which the corners went.
    order = np.empty(ranks.size, dtype=np.intp)
    order[np.argsort(ranks, kind="stable")] = np.arange(ranks.size)
    places = places.copy()
    places[chosen] = len(means) + order
    return np.concatenate([means, found]), places


#: Quantity -> its interval; None where it does not converge like the error.
Intervals: TypeAlias = dict[str, list[float] | None]

#: Columns of ``adapt.csv`` that are no quantities of the body.
OF_MESHES = ("unknowns", "error", "kkt")

#: Factor of safety of the width, and the largest one by which C may grow from mesh to mesh.
SAFETY = 1.25

#: Ends of the names of a vector's components, whose rounding is that of the vector.
AXES = ("_x", "_y", "_z")


def intervals(rows: Sequence[Mapping[str, float]]) -> Intervals | None:
    """Return the interval of each quantity; None unless the error falls on the last three meshes.

    The grid convergence index (Roache, J. Fluids Eng. 116, 1994) with |Q - Q_h| <= C e, e being the
    estimated error in the energy norm: C is the larger |Q_j - Q_k|/(e_j - e_k) of the last two
    refinements. Where C grows it goes on to grow, and the changes to come are a geometric series.
    Residuals are added. One whose changes are of both signs has not begun to converge. Rows are
    those of ``adapt.csv``, of uniform refinement.
    """
    if len(rows) < 3 or not rows[-3]["error"] > rows[-2]["error"] > rows[-1]["error"]:
        return None
    last, error = rows[-3:], [float(row["error"]) for row in rows[-3:]]
    quantities = [name for name in rows[-1] if name not in OF_MESHES]
    sizes: dict[str, float] = {}
    for name in quantities:
        size = max(abs(row[name]) for row in last)
        sizes[_whole(name)] = max(size, sizes.get(_whole(name), 0.0))
    found: Intervals = {}
    for name in quantities:
        uncertainty = max(ROUNDING, *(row["kkt"] for row in last)) * sizes[_whole(name)]
        values = [float(row[name]) for row in last]
        changes = [values[k + 1] - values[k] for k in (0, 1)]
        first, second = (
            max(abs(changes[k]) - 2 * uncertainty, 0.0) / (error[k] - error[k + 1]) for k in (0, 1)
        )
        turns = min(first, second) > 0 and changes[0] * changes[1] < 0
        growth = max(second / first, 1.0) if first > 0 else 1.0 if second == 0 else np.inf
        ratio = growth * error[2] / error[1]
        if turns or growth > SAFETY or ratio >= 1:
            found[name] = None
            continue
        change = max(first, second) * (error[1] - error[2])
        width = SAFETY * change * ratio / (1 - ratio) + uncertainty
        found[name] = [values[2] - width, values[2] + width]
    return found


def _whole(name: str) -> str:
    """Return the name of the vector of a component, or the name itself."""
    return name[:-2] if name.endswith(AXES) else name
