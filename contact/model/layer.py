"""A compliant layer in front of the rigid part of a foundation.

It presses with h_nu(phi - phi_F) p_nu(u_nu - rho_0), section 8.1.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.arguments import check_slope, naming, real
from contact.errors import InputError
from contact.typing import Array
from forms.laws import PenetrationLaw, StiffnessLaw

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
        """Refuse laws that are none of a layer, (h6) and (h7).

        Parameters
        ----------
        size
            Of the body: p_nu is looked at for penetrations up to it, or to the rigid part.

        Raises
        ------
        InputError
            If the thickness, p_nu or h_nu is negative or no number, a law has no derivative, or one
            that is not its own, or p_nu does not vanish before the layer is touched.
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
            if not callable(getattr(law, "derivative", None)):
                raise InputError(f"layer: {name} has no method `derivative`", "layer-law")
            with np.errstate(all="ignore"):
                with naming(f"layer: {name}"):
                    values = real(law(samples), samples.shape, EACH)
                with naming(f"layer: {name}: derivative"):
                    slopes = real(law.derivative(samples), samples.shape, EACH)
            if not (np.isfinite(values).all() and np.isfinite(slopes).all()):
                bad = samples[~(np.isfinite(values) & np.isfinite(slopes))][0]
                raise InputError(
                    f"layer: {name} or its derivative is no number at {bad:g}", "layer-law"
                )
            if values.min() < 0:
                bad = samples[np.argmin(values)]
                raise InputError(
                    f"layer: {name} is negative at {bad:g}; accepted: values >= 0", "layer-law"
                )
            if name == "p_nu" and np.any(values[samples < 0] > 0):
                raise InputError(
                    "layer: p_nu presses before the layer is touched; accepted: 0 at negative "
                    "penetrations",
                    "layer-law",
                )
            check_slope(f"layer: {name}: derivative", law, law.derivative, samples[samples != 0])

    def depths(self, size: float) -> Array:
        """Return penetrations from 0 to the rigid part, or to the size of the body if it is less.

        Parameters
        ----------
        size
            Of the body.
        """
        return min(float(self.thickness), size) * np.concatenate([[0.0], np.logspace(-6, 0, 73)])

    def falls(self, size: float) -> bool:
        """Tell whether p_nu falls somewhere: several solutions may then exist.

        Parameters
        ----------
        size
            Of the body.
        """
        values = np.broadcast_to(self.p_nu(self.depths(size)), (74,))
        return bool(np.any(np.diff(values) < -1e-12 * values.max()))
