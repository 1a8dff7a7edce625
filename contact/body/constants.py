"""Numbers as form constants: their values are not compiled in, and a form compiles once."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace

import numpy as np
from dolfinx import fem
from dolfinx.mesh import Mesh

from forms.elasticity import Anisotropic
from forms.hencky import Law
from forms.piezo import Piezo


def constant(mesh: Mesh, value: float) -> fem.Constant:
    """Return a number as a form constant."""
    return fem.Constant(mesh, np.float64(value))


def law_with_constants(law: Law, mesh: Mesh) -> Law:
    """Return a law with form constants for its numbers."""
    if isinstance(law, Anisotropic):
        return Anisotropic(fem.Constant(mesh, np.asarray(law.stiffness, dtype=float)))
    if not is_dataclass(law) or getattr(law, "g_min", 0.0) > 0:
        return law
    numbers = {
        f.name: constant(mesh, getattr(law, f.name))
        for f in fields(law)
        if f.name != "g_min" and isinstance(getattr(law, f.name), int | float)
    }
    return replace(law, **numbers)


def piezo_with_constants(piezo: Piezo, mesh: Mesh) -> Piezo:
    """Return piezoelectric tensors as form constants."""
    return Piezo(
        fem.Constant(mesh, np.asarray(piezo.e, dtype=float)),
        fem.Constant(mesh, np.asarray(piezo.beta, dtype=float)),
    )
