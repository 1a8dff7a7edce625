"""Laws on the contact boundary: friction, charge and layer, one definition each.

Each law is a frozen dataclass that is called with UFL expressions or NumPy arrays, and
knows the bounds that the theorems ask for. `derivative` is the derivative with respect to
the argument, used by Newton's method.
"""

from forms.laws.charge import (
    Conductivity,
    PerfectConductivity,
    PotentialLaw,
    RampConductivity,
    ShiftedConductivity,
    Truncation,
)
from forms.laws.friction import (
    ConstantCoefficient,
    Coulomb,
    FrictionCoefficient,
    FrictionLaw,
    SlipCoefficient,
    Tresca,
)
from forms.laws.layer import Compliance, PenetrationLaw, PotentialFactor, StiffnessLaw

__all__ = [
    "Compliance",
    "Conductivity",
    "ConstantCoefficient",
    "Coulomb",
    "FrictionCoefficient",
    "FrictionLaw",
    "PenetrationLaw",
    "PerfectConductivity",
    "PotentialFactor",
    "PotentialLaw",
    "RampConductivity",
    "ShiftedConductivity",
    "SlipCoefficient",
    "StiffnessLaw",
    "Tresca",
    "Truncation",
]
