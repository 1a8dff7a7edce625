"""The weak form of one body: its residual, the sum of its named terms.

The unknowns x = (u, phi) of a body under given loads satisfy, for all test functions z = (v, xi)
that vanish where displacements and potentials are prescribed,

    G_0(x; z) = internal_forces + elastic_supports + body_forces + tractions + pressures + charges
              = -int_Gamma_3 ((lambda_c + p_l) v_nu + lambda_f . v_tau - (D.nu) xi),

with the pressure p_l of a layer. The first line is of this module, the second of
`contact.interface`. That is (10) of docs/theory.md; with (11) it is (5.26) of the thesis, with a
layer (6.31), without a potential (3.9). Numbers of two parts, as these, are those of equations of
the thesis. The test function of the potential is negated, so that the derivative of G_0 is
symmetric. Loads are negative terms: G_0 = <F(x), z> - <f, z>. Stresses are those of `forms`.

Measures, fields and laws in UFL are made by `contact.body.materials` and `contact.body.loads`;
`contact.body.assembly` compiles the terms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import ufl
from ufl.core.expr import Expr

from contact.mesh.domain import Measure
from contact.model.fields import Factor
from forms.hencky import FormLaw, secant_form
from forms.history import QuadratureLaw
from forms.kinematics import Strained
from forms.piezo import Piezo, symmetrised_form


class Fields(NamedTuple):
    """A displacement and a potential, None without coupling: x = (u, phi), or z = (v, xi)."""

    u: Expr
    phi: Expr | None


class Solid(NamedTuple):
    """Cells of one material: law, tensors, signed kinematics of the strains, and measure."""

    law: FormLaw
    piezo: Piezo | None
    strains: tuple[tuple[int, Strained], ...]
    dx: Measure


class ElasticSupport(NamedTuple):
    """An elastic support: k_i along the axes, if given, k_nu along the normal, and measure."""

    axes: Sequence[Expr]
    normal: Expr
    ds: Measure


class LoadDensity(NamedTuple):
    """A load per area or volume: value, measure, part, factor; whether the value varies in time."""

    value: Expr
    over: Measure
    on: str | None
    amplitude: Factor
    time_dependent: bool


class Term(NamedTuple):
    """A term of the residual; of a load, without its amplitude."""

    form: ufl.Form
    load: LoadDensity | None = None


@dataclass(frozen=True)
class WeakForm:
    """The residual G_0(x; z) of one body, without contact."""

    nu: Expr  #: the unit normal out of the body
    solids: Sequence[Solid]
    elastic: Sequence[ElasticSupport]
    #: By their keys in the case file, ``traction`` with resultants too.
    loads: Mapping[str, Sequence[LoadDensity]]

    def residual(
        self, x: Fields, z: Fields, secant_at: Expr | None = None, history_at: Expr | None = None
    ) -> list[Term]:
        """Return the terms of G_0(x; z), of each material, support and load one.

        `secant_at` is the displacement of the secant modulus (Kacanov), `history_at` that at which
        stress updates with internal variables are linearised; by default both are that of x.
        """
        return (
            self.internal_forces(x, z, secant_at, history_at)
            + self.elastic_supports(x, z)
            + self.body_forces(z)
            + self.tractions(z)
            + self.pressures(z)
            + self.charges(z)
        )

    def internal_forces(
        self, x: Fields, z: Fields, secant_at: Expr | None, history_at: Expr | None
    ) -> list[Term]:
        """Return int_Omega sigma : eps(v) + D . grad(xi) dx: A of (3.10), A-check of (5.27).

        With `secant_at` u_n they are B(u_n; u, v) of (3.28) and B-check of (5.31). The laws are (1)
        and (4) of docs/theory.md.
        """
        terms = []
        for law, piezo, strains, dx in self.solids:
            u_0 = history_at if isinstance(law, QuadratureLaw) else secant_at
            u_0, work = x.u if u_0 is None else u_0, 0
            for sign, kinematics in strains:
                if piezo is None:
                    work += sign * secant_form(law, u_0, x.u, z.u, kinematics)
                else:
                    work += sign * symmetrised_form(law, piezo, u_0, *x, *z, kinematics)
            terms.append(Term(work * dx))
        return terms

    def elastic_supports(self, x: Fields, z: Fields) -> list[Term]:
        """Return int k_i u_i v_i + k_nu u_nu v_nu da of the tractions -k_i u_i, -k_nu u_nu nu."""
        terms = []
        for axes, normal, ds in self.elastic:
            work = normal * ufl.dot(x.u, self.nu) * ufl.dot(z.u, self.nu)
            for i, k in enumerate(axes):
                work += k * x.u[i] * z.u[i]
            terms.append(Term(work * ds))
        return terms

    def body_forces(self, z: Fields) -> list[Term]:
        """Return - int_Omega f_0 . v dx, (3.8)."""
        loads = self.loads.get("body_force", ())
        return [Term(-ufl.dot(f.value, z.u) * f.over, f) for f in loads]

    def tractions(self, z: Fields) -> list[Term]:
        """Return - int_Gamma_2 f_2 . v da, (3.8); of a resultant force F, f_2 = F/|Gamma_2|."""
        loads = self.loads.get("traction", ())
        return [Term(-ufl.dot(f.value, z.u) * f.over, f) for f in loads]

    def pressures(self, z: Fields) -> list[Term]:
        """Return int_Gamma_2 p v_nu da: the traction f_2 = -p nu."""
        loads = self.loads.get("pressure", ())
        return [Term(p.value * ufl.dot(self.nu, z.u) * p.over, p) for p in loads]

    def charges(self, z: Fields) -> list[Term]:
        """Return int_Omega q_0 xi dx - int_Gamma_b q_2 xi da, (5.29)."""
        volume, surface = (self.loads.get(key, ()) for key in ("body_charge", "charge"))
        return [
            *(Term(q.value * z.phi * q.over, q) for q in volume),
            *(Term(-q.value * z.phi * q.over, q) for q in surface),
        ]
