"""Critical friction, from which on several solutions may exist, by the Jacobian at a solution.

Where nodes slide in given directions t, and mu is that of their present slips, the increments of
pressures and of slips satisfy S_nt du + w dp = 0 and S_tt du + w mu dp = 0, S being the stiffness
of the body condensed onto them with nodes that are open left free. So S_tt - mu S_nt is singular at
a critical mu: the pencil's real eigenvalues (Hassani, Hild, Ionescu and Sakki 2003). Modes in which
a body without supports slides nearly as a rigid one are left out: they say nothing about its
deformation.

Where the bodies, without any contact force, can be in balance where they do not meet, that is a
solution too, whatever the friction: rings in a row, which roll out of a pinch or are jammed in it.

References
----------
Hassani, Hild, Ionescu and Sakki, A mixed finite element method and solution multiplicity for
Coulomb frictional contact, Comput. Methods Appl. Mech. Engrg. 192 (2003) 4517.
Klarbring, Examples of non-uniqueness and non-existence of solutions to quasistatic contact problems
with friction, Ing.-Arch. 60 (1990) 529.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve, eigh

from contact.interface.multipliers import constraint_active
from contact.linear.operator import Counters
from contact.problem.condensed import Condensation, condensation_pays
from contact.problem.problem import ContactProblem
from contact.problem.rigid_modes import groups, null_space
from contact.problem.state import State
from contact.ranks import on_root
from contact.tolerances import BALANCED, EPS, NEGLIGIBLE
from contact.typing import Array

#: Contact nodes up to which eigenvalues take no time to speak of.
MOST = 300

#: Energy of rigid sliding over that of the next mode, which deforms: below this. On curved surfaces
#: their normals' tilt resists it, by 2e-3 and less; the first modes of slender bodies differ by 16.
RIGID = 1e-2


def uniqueness(
    problem: ContactProblem, state: State, condensation: Condensation | None = None
) -> tuple[float, bool]:
    """Return the least multiple of the present mu at which the linearised problem is singular.

    Beside it, whether a state without contact forces is in equilibrium too. Below 1 the friction
    that is there is enough for several solutions. The touching nodes, or those that touch in the
    reference configuration, slide in the directions of their friction stresses, or all in one
    direction (`_uniform`); by other slips the Jacobian may be singular at less. Infinity without
    such a factor, and with a layer, a potential, or a smoothed pressure; NaN with more than `MOST`
    contact nodes. Collective.
    """
    interface = problem.interface
    nodes, friction = interface.nodes, interface.friction
    known = friction.acts and friction.local and not interface.foundation.active
    known = (
        known and not problem.piezoelectric and interface.operator_nodes.size == nodes.nodes.size
    )
    if not known or nodes.size == 0:
        return np.inf, False
    if nodes.size > MOST:
        return np.nan, False
    if condensation is None and not condensation_pays(problem, "auto"):
        return np.inf, False
    jump = nodes.jump(state.x)
    pressure = interface.pressure(jump, state.multipliers)
    rounding_stress = interface.negligible(jump, pressure)
    closed = constraint_active(pressure, interface.normal_gap(jump), interface.c_b, rounding_stress)
    if nodes.maximum(closed.astype(float)) == 0:
        closed = interface.gap <= EPS * interface.size
    mu = friction.by_pressure(interface.slip_length(jump), np.maximum(pressure, EPS))
    condensation = condensation or Condensation(problem, Counters())
    stiffness = condensation.stiffness(state)
    if stiffness is None:
        return np.inf, False
    columns, body = [], problem.body
    balanced = nodes.maximum(pressure) > interface.rounding_stress(jump)
    external = body.external(state.time)
    for group in groups(problem):
        free = null_space(group.supports)
        along = group.normal[:, None, :] * nodes.admissible_normal[:, :, None]
        columns.append((along + group.tangential) @ free)
        for motion in (group.moved @ free).T:
            most = body.product(np.abs(external), np.abs(motion))
            balanced &= bool(abs(body.product(external, motion)) <= BALANCED * most)
    motions = np.concatenate(columns, axis=2)
    ranks = nodes.comm.gather(
        (
            *(
                nodes.admissible_normal,
                nodes.tangential_projector,
                state.multipliers.friction,
                closed,
                mu,
                motions,
            ),
            nodes.weight[:, None] * state.multipliers.vectors(nodes),
            interface.normal_gap(jump),
        )
    )

    def found() -> tuple[float, bool]:
        normal, tangent, force, touches, rates, moved, forces, normal_gap = (
            np.concatenate(part) for part in zip(*ranks, strict=True)
        )
        if not np.any(touches & (rates > 0)):
            return np.inf, False
        rigid = motions.shape[2]
        closed = _onto_closed(stiffness, touches)
        if closed is None:
            return np.inf, False
        uniform = _uniform(closed, normal[touches], tangent[touches])
        own = _along(tangent, force)
        unknown = np.linalg.norm(own, axis=1) < 0.5
        own = own[touches]
        own[unknown[touches]] = uniform[0][unknown[touches]]
        largest = np.abs(stiffness).max()
        factor = min(
            _factor(closed, normal[touches], t, rates[touches], rigid, largest)
            for t in (*uniform, own)
        )
        if not balanced:
            return factor, False
        size = problem.domain.size
        return factor, _free_of_contact(stiffness, normal, moved, forces, normal_gap, size)

    return on_root(nodes.comm, found)


def _free_of_contact(
    stiffness: Array, normal: Array, motions: Array, forces: Array, normal_gap: Array, size: float
) -> bool:
    """Tell whether bodies can be in balance, and nowhere meet, without these contact forces."""
    # Free motions, shape (n, d, m), may be as large as the bodies.
    count, dim, many = motions.shape
    used = np.diag(stiffness) > 0
    basis = motions.reshape(count * dim, many)[used]
    free, sizes, _ = np.linalg.svd(basis, full_matrices=False)
    free = free[:, sizes > NEGLIGIBLE * sizes.max(initial=0.0)]
    matrix = stiffness[np.ix_(used, used)] + np.abs(stiffness).max() * free @ free.T
    load, change = forces.ravel()[used], np.zeros(count * dim)
    try:
        change[used] = cho_solve(cho_factor(matrix), load)
    except LinAlgError:
        return False
    way = change.reshape(count, dim)
    met = np.isfinite(normal_gap)
    # nu . v = (P nu) . v for unconstrained v, with P nu = nu_a/|nu_a|^2.
    normal = normal / np.maximum(np.sum(normal**2, axis=1), np.finfo(float).tiny)[:, None]
    allowed = BALANCED * np.linalg.norm(way, axis=1).max()
    room = (normal_gap - np.einsum("nd,nd->n", normal, way))[met] + allowed
    if room.min() >= 0 or free.shape[1] == 0:
        return bool(room.min() >= 0)
    from scipy.optimize import linprog  # takes a while to load

    columns = np.zeros((count * dim, free.shape[1]))
    columns[used] = free / np.abs(free).max(axis=0)
    rising = np.einsum("nd,ndm->nm", normal, columns.reshape(count, dim, -1))[met]
    scale = -room.min()
    found = linprog(
        np.zeros(rising.shape[1]), rising, room / scale, bounds=(-size / scale, size / scale)
    )
    return bool(found.status == 0)


def _onto_closed(stiffness: Array, touches: NDArray[np.bool_]) -> Array | None:
    """Return the stiffness condensed onto the nodes that touch, (k, d, k, d); None if singular."""
    count = touches.size
    rows = np.arange(stiffness.shape[0]).reshape(count, -1)
    closed, free = rows[touches].ravel(), rows[~touches].ravel()
    free = free[np.diag(stiffness)[free] > 0]
    found = stiffness[np.ix_(closed, closed)]
    if free.size:
        try:
            factors = cho_factor(stiffness[np.ix_(free, free)])
        except LinAlgError:
            return None
        found = found - stiffness[np.ix_(closed, free)] @ cho_solve(
            factors, stiffness[np.ix_(free, closed)]
        )
    shape = (np.count_nonzero(touches), rows.shape[1])
    return np.asarray(found.reshape(*shape, *shape))


def _along(tangent: Array, vectors: Array) -> Array:
    """Return unit tangential vectors along others, shape (n, d); 0 without any."""
    along = np.einsum("nij,nj->ni", tangent, vectors)
    size = np.linalg.norm(along, axis=1)
    size[size <= EPS * max(size.max(initial=0.0), np.finfo(float).tiny)] = np.inf
    return np.asarray(along / size[:, None])


def _uniform(stiffness: Array, normal: Array, tangent: Array) -> list[Array]:
    """Return fields of unit tangential vectors, (n, d): along one direction, or around a curve."""
    # In 3-D those that are principal for the pressures which the slips change, |S_nt d|^2, beside
    # the stiffness d S_tt d: they turn with the axes, and of one node, where S_tt is isotropic, or
    # S_nt its eigenvector, the least critical mu is along the first. Where all are alike those
    # along the axes.
    if normal.shape[1] == 2:  # the tangent turns with the surface
        return [_along(tangent, np.stack([-normal[:, 1], normal[:, 0]], axis=1))]
    forces = np.einsum("nimj,mjk->nik", stiffness, tangent)
    against = np.einsum("nik,nil->kl", tangent, forces)
    changes = np.einsum("ni,nik->nk", normal, forces)
    pressures = changes.T @ changes
    # Rounding does not choose between directions that are alike.
    pressures += 1e-6 * np.trace(pressures) * np.diag([3.0, 2.0, 1.0])
    values, vectors = np.linalg.eigh((against + against.T) / 2)
    used = values > NEGLIGIBLE * values.max(initial=0.0)
    back = vectors[:, used] / np.sqrt(values[used])
    directions = back @ np.linalg.eigh(back.T @ pressures @ back)[1][:, ::-1]
    found = [_along(tangent, np.broadcast_to(d, normal.shape)) for d in directions.T]
    return found or [np.zeros_like(normal)]


def _factor(
    stiffness: Array, normal: Array, along: Array, mu: Array, rigid: int, largest: float
) -> float:
    """Return the least |factor| at which S_tt - factor mu S_nt is singular."""
    # S is condensed onto the nodes that touch; `largest` is its largest entry before that. Supports
    # leave `rigid` motions of the bodies free.
    on = np.linalg.norm(along, axis=1) > 0.5
    if not on.any():  # supports let none of them slide
        return np.inf
    normal, along, mu = normal[on], along[on], mu[on]
    forces = np.einsum("nimj,mj->nim", stiffness[on][:, :, on], along)
    slides = np.einsum("ni,nim->nm", along, forces)
    presses = np.einsum("ni,nim->nm", normal, forces)
    energies, modes = eigh((slides + slides.T) / 2)
    ladder = np.append(energies, largest)[: rigid + 1]
    sliding = np.flatnonzero(ladder[:-1] < RIGID * ladder[1:])
    begin = sliding[-1] + 1 if sliding.size else 0
    energies, modes = energies[begin:], modes[:, begin:]
    if energies.size == 0 or energies[0] <= 1e-10 * largest:  # friction alone resists
        return np.inf
    modes = modes / np.sqrt(energies)
    with np.errstate(over="ignore", invalid="ignore"):
        coupling = modes.T @ (mu[:, None] * presses) @ modes
    if not np.isfinite(coupling).all():  # mu is beyond all
        return 0.0
    values = np.linalg.eigvals(coupling)
    real = np.abs(values[np.abs(values.imag) <= 1e-8 * np.abs(values)].real)
    return float(1 / real.max()) if real.max(initial=0.0) > 0 else np.inf
