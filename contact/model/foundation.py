"""Laws of a foundation: a compliant layer in front of its rigid part, and its charge.

The layer presses with h_nu(phi - phi_F) p_nu(u_nu - rho_0), section 8.1.2. The charge per area is
psi(u_nu - rho) phi_L(phi - phi_F), psi a capacitance per area (`forms.laws`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np

from contact.arguments import SAMPLES, check_slope, expect, naming, real
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.mesh.geometry import area, volume
from contact.model.fields import GivenAmplitude, GivenTimed, amplitude_of
from contact.model.formula import ZERO, as_number
from contact.model.section import Described, FactorOfTime, Timed
from contact.settings import NonNegative, Positive, ReadWith, Switch
from contact.typing import Array
from forms import laws
from forms.laws import Conductivity, PenetrationLaw, PotentialLaw, StiffnessLaw, Truncation

#: Values that a law of a layer returns.
EACH = "one number for each penetration or difference"


@dataclass(frozen=True)
class Layer:
    """A compliant layer in front of the rigid part, which presses with h_nu(phi - phi_F) p_nu(s).

    Parameters
    ----------
    thickness
        rho - rho_0 >= 0: the layer is touched before the rigid part (length). Infinity: there
        is no rigid part, law (1.27), and the contact's gap is that of the first touch. Of
        several layers in one, one value per node, shape (n,).
    p_nu, h_nu
        Penetration law and stiffness of section 8.1.2, or any others with their derivative.
        They are vectorised functions; p_nu must vanish for negative arguments.
    lagged
        Whether the force is taken from the previous outer iterate, as in the thesis.
    """

    thickness: float | Array
    p_nu: PenetrationLaw
    h_nu: StiffnessLaw
    lagged: bool = False

    def check(self, size: float) -> None:
        """Refuse laws that are none of a layer, (h~6) and (h~7) of chapter 6.

        InputError if the thickness, p_nu or h_nu is negative or no number, p_nu presses before the
        layer is touched, or a derivative is not the slope of its law. Penetrations are those of
        `depths`.
        """
        if not self.thickness >= 0:
            raise InputError(
                f"layer: the thickness is {self.thickness:g}; accepted: >= 0, or inf", "layer-law"
            )
        depths = self.depths(size)
        differences = np.concatenate([[0.0], np.logspace(-6, 3, 37)])
        for name, law, samples in (
            ("p_nu", self.p_nu, np.concatenate([-size * np.logspace(-9, 0, 37), depths])),
            ("h_nu", self.h_nu, np.concatenate([-differences, differences])),
        ):
            fits = hasattr(law, "derivative")
            expect(f"layer: {name}", law, "a function with a derivative", fits, "layer-law")
            with np.errstate(all="ignore"), naming(f"layer: {name}"):
                values, slopes = (
                    real(f(samples), samples.shape, EACH) for f in (law, law.derivative)
                )
            wrong = ~np.isfinite(values + slopes) | (values < 0)
            if name == "p_nu":
                wrong |= (samples < 0) & (values > 0)
            if wrong.any():
                place, value, slope = (given[wrong][0] for given in (samples, values, slopes))
                raise InputError(
                    f"layer: {name} is {value:g} at {place:g}, its derivative {slope:g}; accepted: "
                    "finite numbers >= 0, of p_nu 0 at negative penetrations, finite derivatives",
                    "layer-law",
                )
            check_slope(f"layer: {name}: derivative", law, law.derivative, samples[samples != 0])

    def depths(self, size: float) -> Array:
        """Return penetrations from 0 to the rigid part, or to the body's size if that is less."""
        return min(float(self.thickness), size) * np.concatenate([[0.0], np.logspace(-6, 0, 73)])

    def falls(self, size: float) -> bool:
        """Tell whether p_nu falls somewhere up to a size: several solutions may then exist."""
        values = np.broadcast_to(self.p_nu(self.depths(size)), (74,))
        return bool(np.any(np.diff(values) < -1e-12 * values.max()))


#: Width of the ramp of psi over the height of the body.
RAMP = 0.1


@dataclass(frozen=True)
class Conductor:
    """A conductive foundation at the potential phi_f: D.nu = psi(u_nu - rho) phi_L(phi - phi_f).

    Parameters
    ----------
    psi
        Law psi of the charge (capacitance/area), for instance `ShiftedConductivity`.
    phi_f
        Potential of the foundation; of several conductors in one, one value per node, shape (n,).
    phi_l
        Truncation phi_L of the potential difference; by default there is none.
    lagged
        Whether the charge is taken from the previous outer iterate, as Algorithm 4 of the
        thesis does, for small k_e (Theorem 5.2 proves that it then converges). Else phi is
        implicit, as a Robin term in Algorithm 5, and psi is lagged until the residual is small.
    phi_f_at
        phi_f as a function of time; None where it is always the same.
    share
        Continuation factor of psi, from 0 to 1.
    """

    psi: Conductivity
    phi_f: float | Array
    phi_l: PotentialLaw = field(default_factory=lambda: Truncation(np.inf))
    lagged: bool = False
    phi_f_at: Callable[[float], float | Array] | None = None
    share: float = 1.0

    def check(self) -> None:
        """Refuse laws that lack something, or whose derivatives are not their own."""
        for name, law, methods in (
            ("psi", self.psi, ("k_e", "delta", "follows_gap", "at", "gap_slope")),
            ("phi_l", self.phi_l, ("__call__", "derivative")),
        ):
            has_all = all(hasattr(law, method) for method in methods)
            accepted = f"an object with {', '.join(methods)}"
            expect(f"Conductor: {name}", law, accepted, has_all, "conductor-law")
        both = np.concatenate([-SAMPLES[::-1], SAMPLES])
        never, psi = np.zeros(both.size, dtype=bool), self.psi
        if psi.follows_gap:
            check_slope(
                "Conductor: psi: gap_slope",
                lambda s: psi.at(s, never, never),
                lambda s: psi.gap_slope(s, never),
                both,
            )
        check_slope("Conductor: phi_l: derivative", self.phi_l, self.phi_l.derivative, both)

    def at(self, time: float) -> Conductor:
        """Return the foundation at a time."""
        return self if self.phi_f_at is None else replace(self, phi_f=self.phi_f_at(time))


class Electric(Described):
    """`[electric]`: a conductive foundation, D.nu = psi(u_nu - rho) phi_L(phi - phi_f)."""

    law: Literal["shifted", "perfect", "ramp"] = "shifted"
    """psi: `shifted`, k_e clip(1 + delta (u_nu - rho), 0, 1); `perfect`, k_e where rigid part or
    layer press; `ramp`, as the thesis has it, zero where u_nu <= rho, with which no contact
    conducts."""
    k_e: NonNegative
    """k_e of the foundation: a capacitance per area, for D.nu is a charge."""
    phi_f: Timed = ZERO
    """Potential phi_F of the foundation."""
    amplitude: FactorOfTime | None = None
    """Factor of phi_f as a function of time, see `[evolution]`. Without one phi_f is constant."""
    delta: Annotated[Positive | None, ReadWith("law", ("shifted", "ramp"))] = None
    """Slope of psi (1/length): psi rises within 1/delta of the gap. Default: 10 / H, H the volume
    of the body over the area of its contact part, or its diameter where that is smaller. A
    warning says where 1/delta is below two spacings of the contact nodes."""
    limit: Positive | None = None
    """Limit L of the truncation phi_L. Default: no truncation."""
    lagged: Switch = False
    """`true`: the charge is taken from the previous outer iteration, as in Algorithm 4; converges
    for small k_e only; not with method `newton`."""

    def __init__(
        self,
        k_e: float,
        phi_f: GivenTimed = 0.0,
        law: Literal["shifted", "perfect", "ramp"] = "shifted",
        delta: float | None = None,
        limit: float | None = None,
        lagged: bool = False,
        amplitude: GivenAmplitude | None = None,
    ) -> None:
        super().__init__(
            law=law,
            k_e=k_e,
            phi_f=phi_f,
            amplitude=amplitude,
            delta=delta,
            limit=limit,
            lagged=lagged,
        )

    def conductor(self, domain: Domain, part: str) -> Conductor:
        """Return the law in front of a part of a mesh. Collective."""
        psi: laws.Conductivity
        if self.law == "perfect":
            psi = laws.PerfectConductivity(self.k_e)
        else:
            slope = self.delta or 1 / conduction_ramp(domain, part)
            kind = {"shifted": laws.ShiftedConductivity, "ramp": laws.RampConductivity}[self.law]
            psi = kind(self.k_e, slope)
        truncation = laws.Truncation(np.inf if self.limit is None else self.limit)
        phi_f = as_number(self.phi_f)
        if isinstance(phi_f, float) and self.amplitude is None:
            return Conductor(psi, phi_f, truncation, self.lagged)
        # A foundation has its potential from the beginning.
        factor, number = amplitude_of(self.amplitude, known=True), self.phi_f.number

        def phi_f_at(time: float) -> float:
            """Return the potential of the foundation at a time."""
            return float(factor(time) * number(time))

        return Conductor(psi, phi_f_at(0.0), truncation, self.lagged, phi_f_at)


def conduction_ramp(domain: Domain, part: str) -> float:
    """Return the default width 1/delta of psi's ramp, whatever the mesh (length). Collective."""
    height = volume(domain) / area(domain, part)
    return RAMP * min(height, domain.size)
