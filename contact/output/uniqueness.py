"""Whether friction is strong enough for several solutions, by the solution's own Jacobian.

Where nodes slide in given directions t, the increments of pressures and of slips satisfy
S_nt du + w dp = 0 and S_tt du + w mu dp = 0, S being the stiffness of the body condensed onto them
with nodes that are open left free. So S_tt - mu S_nt is singular at a critical mu: the pencil's
real eigenvalues (Hassani, Hild, Ionescu and Sakki 2003). A body that no support holds slides nearly
like a rigid one against next to nothing, so that the pencil, and the body, are looked at without
that: such slips say nothing about its deformation.

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

from contact.interface.active_set import touching
from contact.linear.operator import Counters
from contact.problem.condensed import Condensation, condensable, pays
from contact.problem.problem import ContactProblem
from contact.problem.rigid_modes import groups, null_space
from contact.problem.state import State
from contact.ranks import on_root
from contact.tolerances import EPS, NEGLIGIBLE
from contact.typing import Array

#: Contact nodes up to which eigenvalues take no time to speak of.
MOST = 300

#: Relative accuracy of the balance, and of displacements, without contact forces.
BALANCED = 1e-6

#: Energy of rigid sliding over that of the next mode, which deforms: below this. On curved surfaces
#: their normals' tilt resists it, by 2e-3 and less; the first modes of slender bodies differ by 16.
RIGID = 1e-2


def uniqueness(
    problem: ContactProblem, state: State, condensation: Condensation | None = None
) -> tuple[float, bool]:
    """Return the least factor of mu from which on the Jacobian at a solution may be singular.

    Beside it, whether friction alone keeps the bodies in contact: the state without contact forces
    is a solution too. Below 1 the friction that is there is enough for several solutions. The
    touching nodes slide in the directions of their friction stresses, or all in one direction, or
    in the opposite ones; of a body that touches nothing those that touch in the reference
    configuration. Infinity without such a factor, and where nothing is known: with a layer, a
    potential, or a smoothed pressure, and of slips against which the bodies do not deform. NaN with
    more than `MOST` contact nodes, where it is not looked for. Collective.

    Parameters
    ----------
    problem, state
        The problem and its solution.
    condensation
        The body condensed onto its contact nodes, where a method has that already.
    """
    interface = problem.interface
    jump, friction = interface.jump, interface.friction
    known = friction.acts and friction.local and not interface.law.active
    known = known and not problem.piezoelectric and interface.coupled.size == jump.nodes.size
    if not known or jump.size == 0:
        return np.inf, False
    if jump.size > MOST:
        return np.nan, False
    if condensation is None and not (condensable(problem, "auto") and pays(problem, "auto")):
        return np.inf, False
    nodal = jump.apply(state.x)
    pressure = interface.pressure(nodal, state.forces)
    rounding = interface.negligible(nodal, pressure)
    closed = touching(pressure, interface.opening(nodal), interface.stiffness, rounding)
    if jump.maximum(closed.astype(float)) == 0:
        closed = jump.gap <= EPS * interface.size
    mu = friction.by_pressure(np.maximum(pressure, EPS), interface.slip_length(nodal))
    condensation = condensation or Condensation(problem, Counters())
    stiffness = condensation.stiffness(state)
    if stiffness is None:
        return np.inf, False
    columns = [
        (group.normal[:, None, :] * jump.lift[:, :, None] + group.tangential)
        @ null_space(group.supports)
        for group in groups(problem)
    ]
    motions = np.concatenate(columns, axis=2)
    pressed = jump.maximum(pressure) > interface.rounding(nodal)
    ranks = jump.comm.gather(
        (
            *(jump.lift, jump.tangent, state.forces.friction, closed, mu, motions),
            jump.weight[:, None] * state.forces.vectors(jump),
            interface.opening(nodal),
        )
    )

    def found() -> tuple[float, bool]:
        normal, tangent, force, touches, rates, moved, forces, opening = (
            np.concatenate(part) for part in zip(*ranks, strict=True)
        )
        if not np.any(touches & (rates > 0)):
            return np.inf, False
        along = _directions(normal, tangent, None)
        own = _directions(normal, tangent, force)
        rigid = motions.shape[2]
        factor = min(_factor(stiffness, normal, t, touches, rates, rigid) for t in (along, own))
        if not pressed:
            return factor, False
        size = problem.domain.size
        return factor, _free_of_contact(stiffness, normal, moved, forces, opening, size)

    return on_root(jump.comm, found)


def _free_of_contact(
    stiffness: Array, normal: Array, motions: Array, forces: Array, opening: Array, size: float
) -> bool:
    """Tell whether bodies can be in balance, and nowhere meet, without these contact forces.

    Free motions, shape (n, d, m), may be as large as the bodies.
    """
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
    # Loads on a body that contact alone holds need contact forces.
    if np.linalg.norm(free.T @ load) > BALANCED * np.linalg.norm(load):
        return False
    way = change.reshape(count, dim)
    met = np.isfinite(opening)
    allowed = BALANCED * np.linalg.norm(way, axis=1).max()
    room = (opening - np.einsum("nd,nd->n", normal, way))[met] + allowed
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


def _directions(normal: Array, tangent: Array, force: Array | None) -> Array:
    """Return unit tangential vectors along forces, or along one direction; 0 without any."""
    if force is None:
        first = np.zeros_like(normal)
        first[:, 0] = 1.0
        if normal.shape[1] == 2:  # the tangent turns with the surface
            first = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    else:
        first = force
    along = np.einsum("nij,nj->ni", tangent, first)
    size = np.linalg.norm(along, axis=1)
    fallback = size <= EPS * max(size.max(initial=0.0), np.finfo(float).tiny)
    if force is not None and fallback.any():
        along[fallback] = _directions(normal, tangent, None)[fallback]
        size = np.linalg.norm(along, axis=1)
    return np.asarray(along / np.maximum(size, np.finfo(float).tiny)[:, None])


def _factor(
    stiffness: Array,
    normal: Array,
    along: Array,
    touches: NDArray[np.bool_],
    mu: Array,
    rigid: int,
) -> float:
    """Return the least |factor| at which S_tt - factor mu S_nt is singular.

    Supports leave `rigid` motions of the bodies free.
    """
    count, dim = normal.shape
    rows = np.arange(count * dim).reshape(count, dim)
    closed = np.flatnonzero(touches & (np.linalg.norm(along, axis=1) > 0.5))
    if closed.size == 0:  # supports let none of them slide
        return np.inf
    free = rows[~touches].ravel()
    free = free[np.diag(stiffness)[free] > 0]
    kept = np.zeros((2, closed.size, count * dim))
    kept[0, np.arange(closed.size)[:, None], rows[closed]] = along[closed]
    kept[1, np.arange(closed.size)[:, None], rows[closed]] = normal[closed]
    try:
        to_free = kept[0] @ stiffness[:, free]
        factors = cho_factor(stiffness[np.ix_(free, free)]) if free.size else None
        response = cho_solve(factors, to_free.T) if factors is not None else to_free.T
        slides = kept[0] @ stiffness @ kept[0].T - to_free @ response
        presses = kept[1] @ stiffness @ kept[0].T - (kept[1] @ stiffness[:, free]) @ response
        energies, modes = eigh((slides + slides.T) / 2)
    except LinAlgError:
        return np.inf
    largest = np.abs(stiffness).max()
    ladder = np.append(energies, largest)[: rigid + 1]
    sliding = np.flatnonzero(ladder[:-1] < RIGID * ladder[1:])
    begin = sliding[-1] + 1 if sliding.size else 0
    energies, modes = energies[begin:], modes[:, begin:]
    if energies.size == 0 or energies[0] <= 1e-10 * largest:  # friction alone resists
        return np.inf
    modes = modes / np.sqrt(energies)
    values = np.linalg.eigvals(modes.T @ (mu[closed, None] * presses) @ modes)
    real = np.abs(values[np.abs(values.imag) <= 1e-8 * np.abs(values)].real)
    return float(1 / real.max()) if real.max(initial=0.0) > 0 else np.inf
