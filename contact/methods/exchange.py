"""A condensed problem in the local variables of its contacts, for other solvers."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_solve

from contact.errors import InputError
from contact.methods.convex.local import LocalProblem
from contact.methods.convex.reduced import NULL, bases, cholesky, without_potential
from contact.methods.sure import Gathered
from contact.problem.condensed import CondensedProblem
from contact.typing import Array


def local_problem(problem: CondensedProblem) -> LocalProblem:
    """Return W, q and mu of the contacts that may close. On one rank.

    The first direction of a contact is against nu, from the foundation to the body. Nodes that
    are fixed along it are left out.

    Raises
    ------
    InputError
        If contact alone holds the body, a layer or a current answers, or friction is not
        Coulomb's with a constant coefficient.
    """
    interface = problem.interface
    if interface.response.active:
        raise InputError("a layer or a current answers; accepted: rigid, insulated foundations")
    of = Gathered.of(problem, problem.start())
    assert of is not None
    n, d = of.normal.shape
    stiffness, load = of.stiffness, of.load
    if of.free.shape[1] > d:
        stiffness, load, _ = without_potential(stiffness, load, of.free)
    free = of.free[:, :d]
    moves = np.abs(np.linalg.norm(of.normal * free, axis=1) - 1) < 1e-6
    contacts = np.isfinite(of.gap) & (of.weight > 0) & moves
    basis, role = bases(of.normal, of.tangent, contacts, free)
    if np.any(role[contacts, 1:] != 1):
        raise InputError("contact nodes cannot slip; accepted: contact nodes that are free to")
    mu = np.zeros(n)
    if interface.friction.acts:
        mu[: interface.jump.gap.size] = _coefficient(problem)
    size = np.sqrt(np.diag(stiffness))
    factor = cholesky(np.asfortranarray(stiffness / size[:, None] / size))
    if factor is None or np.diag(factor).min() ** 2 < NULL:
        raise InputError("contact alone holds the body; accepted: supports that hold it")
    directions = np.zeros((n * d, np.count_nonzero(contacts) * d))
    frames = basis[contacts]
    frames[:, :, 0] *= -1.0
    rows = np.arange(n * d).reshape(n, d)[contacts]
    columns = np.arange(rows.size).reshape(-1, d)
    directions[rows[:, :, None], columns[:, None, :]] = frames
    right = np.column_stack([directions, load]) / size[:, None]
    solved = cho_solve((factor, True), right) / size[:, None]
    jumps = directions.T @ solved
    flexibility, q = jumps[:, :-1], jumps[:, -1]
    q[::d] += of.gap[contacts]
    return LocalProblem((flexibility + flexibility.T) / 2, q, mu[contacts])


def _coefficient(problem: CondensedProblem) -> Array:
    """Return mu of each node; it must be Coulomb's, the same whatever slips."""
    interface = problem.interface
    one = np.ones(interface.jump.gap.size)
    bound = interface.friction.bound
    mu = bound(one, 0 * one)
    others = bound(2 * one, 0 * one) / 2, bound(one, problem.scales.size * one)
    if interface.friction.smoothing.radius > 0 or any(np.any(mu != other) for other in others):
        raise InputError("friction is not Coulomb's with a constant mu; accepted: that, or none")
    return mu
