"""Small strains, the three-dimensional deviator, and the normal/tangential split."""

from __future__ import annotations

import ufl
from ufl.core.expr import Expr


def strain(u: Expr) -> Expr:
    """Return the linearised strain eps(u) = (grad u + grad u^T)/2, a d x d tensor."""
    return ufl.sym(ufl.grad(u))


def embed(tensor: Expr, out_of_plane: Expr | float = 0.0) -> Expr:
    """Return a plane tensor as a 3 x 3 tensor; a 3 x 3 tensor is returned as it is.

    Parameters
    ----------
    tensor
        A 2 x 2 or 3 x 3 tensor.
    out_of_plane
        The zz component: 0 for the strain of a body in plane strain.
    """
    if tensor.ufl_shape == (3, 3):
        return tensor
    t = tensor
    return ufl.as_tensor(
        [[t[0, 0], t[0, 1], 0.0], [t[1, 0], t[1, 1], 0.0], [0.0, 0.0, out_of_plane]]
    )


def deviator(eps: Expr) -> Expr:
    """Return dev eps = eps - (tr eps / 3) I as a 3 x 3 tensor, equations (1.10) and (7.12).

    The factor is 1/3 in plane strain too: the body is three-dimensional with eps_zz = 0.
    """
    return ufl.dev(embed(eps))


def deviator_squared(eps: Expr) -> Expr:
    """Return |dev eps|^2 = eps : eps - (tr eps)^2 / 3, equation (7.12)."""
    return ufl.inner(eps, eps) - ufl.tr(eps) ** 2 / 3


def normal_part(u: Expr, nu: Expr) -> Expr:
    """Return u_nu = u . nu."""
    return ufl.dot(u, nu)


def tangential_part(u: Expr, nu: Expr) -> Expr:
    """Return u_tau = u - u_nu nu."""
    return u - ufl.dot(u, nu) * nu


def von_mises(sigma: Expr) -> Expr:
    """Return the von Mises stress sqrt(3/2) |dev sigma| of a 3 x 3 stress tensor."""
    s = ufl.dev(sigma)
    return ufl.sqrt(1.5 * ufl.inner(s, s))
