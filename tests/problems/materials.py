"""Hencky's laws that tests share, one of each kind."""

from forms.hencky import Linear, Log, UserLaw
from forms.ops import exp

#: Yield strain |dev eps|.
XI = 0.05
LAWS = {
    "linear": Linear(1.0, 0.3),
    "norm": Log(2.0, 0.25, yield_strain=XI),
    "square": Log(2.0, 0.25, yield_strain=XI**2, argument="square"),
    "norm with floor": Log(2.0, 0.25, yield_strain=XI, g_min=0.4),
    "square with floor": Log(2.0, 0.25, yield_strain=XI**2, argument="square", g_min=0.3),
    "user": UserLaw(2.0, 0.25, modulus=lambda t: 0.3 + 0.5 * exp(-t / XI)),
}
