"""The action of the foundation on the body: pointwise laws and boundary integrands.

The solver takes `penalty_pressure` and `penalty_friction_modulus` alone, at the contact nodes. The
integrands are the reference for tests and notebooks: those of the weak forms, to be integrated over
Gamma_3 with the vertex rule, which makes them equal to the nodal ones for P1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import ufl
from ufl.core.expr import Expr

from forms.kinematics import normal_part, tangential_part
from forms.ops import Value, positive_part, sqrt

#: A pointwise law of one argument, for instance one of `forms.laws`.
Law: TypeAlias = Callable[[Value], Value]


def penalty_pressure(u_n: Value, gap: Value, eps: Value) -> Value:
    """Return [u_nu - rho]^+ / eps, the pressure of the penalised problem, (4.2) with a gap."""
    return positive_part(u_n - gap) / eps


def penalty_friction_modulus(bound: Value, slip: Value, eps: Value) -> Value:
    """Return s / (|u_tau| + eps): the friction modulus of (4.33), frozen."""
    return bound / (slip + eps)


def augmentation_form(u: Expr, v: Expr, nu: Expr, r: Value, friction: bool = True) -> Expr:
    """Return r u_nu v_nu + r u_tau . v_tau, the left-hand side of Step 1 of Algorithm 2.

    That of the solver, node by node, is `augmentation` in `contact.thesis.uzawa`.
    """
    form = r * normal_part(u, nu) * normal_part(v, nu)
    if friction:
        form += r * ufl.inner(tangential_part(u, nu), tangential_part(v, nu))
    return form


def auxiliary_load(
    phi_c: Expr, phi_f: Expr, lambda_c: Expr, lambda_f: Expr, v: Expr, nu: Expr, r: Value
) -> Expr:
    """Return the right-hand side of Step 1 of Algorithm 2 on Gamma_3.

    That of the solver is `displacement_load` in `contact.thesis.uzawa`.
    """
    normal = (r * phi_c - lambda_c) * normal_part(v, nu)
    return normal + ufl.inner(r * phi_f - lambda_f, tangential_part(v, nu))


def penalty(u: Expr, v: Expr, nu: Expr, gap: Expr, eps: Value) -> Expr:
    """Return [u_nu - rho]^+ v_nu / eps, the form Phi/eps of (4.32) with a gap."""
    return penalty_pressure(normal_part(u, nu), gap, eps) * normal_part(v, nu)


def penalty_friction(u_frozen: Expr, u: Expr, v: Expr, nu: Expr, bound: Expr, eps: Value) -> Expr:
    """Return the form J_eps(u_frozen; u, v) of (4.33) for a friction bound s."""
    frozen = tangential_part(u_frozen, nu)
    modulus = penalty_friction_modulus(bound, sqrt(ufl.inner(frozen, frozen)), eps)
    return modulus * ufl.inner(tangential_part(u, nu), tangential_part(v, nu))


def compliance(
    u: Expr, v: Expr, nu: Expr, p_nu: Law, h_nu: Law, rho_0: Expr, difference: Value
) -> Expr:
    """Return h_nu(phi - phi_F) p_nu(u_nu - rho_0) v_nu.

    The form j_1, (6.12), has the rho of the constraint. Here rho_0 is rho less the thickness of the
    layer, which is thus pressed before the rigid part. That of the solver is `layer_pressure` in
    `contact.interface.foundation`.
    """
    return h_nu(difference) * p_nu(normal_part(u, nu) - rho_0) * normal_part(v, nu)


def electric_contact(
    u: Expr, phi: Expr, xi: Expr, nu: Expr, psi: Law, phi_l: Law, gap: Expr, phi_f: Value
) -> Expr:
    """Return psi(u_nu - rho) phi_L(phi - phi_F) xi, the form l of (5.11).

    That of the solver, node by node, is `FoundationLaw.charge` in `contact.interface.foundation`.
    """
    return psi(normal_part(u, nu) - gap) * phi_l(phi - phi_f) * xi
