"""One material of a library: its constants, their source, and the constants that follow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contact.typing import Array
from forms.crystal import coupling_tensor, isotropic_about_x3, stiffness_tensor
from forms.elasticity import Anisotropic
from forms.piezo import Piezo, from_voigt

#: Classes that are the same however they are turned about X3.
ROUND = ("isotropic", "6mm")


@dataclass(frozen=True, eq=False)
class Entry:
    """A material.

    Attributes
    ----------
    name, source, temperature, condition
        Its name, the source of its constants, and the temperature and conditions of these.
    symmetry
        Crystal class, or "isotropic".
    stiffness
        C at constant field in Voigt's notation, shape (6, 6) (Pa).
    isotropic
        Young's modulus (Pa) and Poisson's ratio; None for crystals.
    coupling
        e, shape (3, 6) (C/m2); None for a material that is not piezoelectric.
    permittivity
        At constant strain, shape (3, 3) (F/m); None likewise.
    published
        Indices (i, J) of d_iJ -> published value (C/N).
    within
        By which share d = s e may differ from these.
    checked
        Where else the constants were found, and how they differ there; empty where nobody looked.
    """

    name: str
    source: str
    temperature: str
    condition: str
    symmetry: str
    stiffness: Array
    isotropic: tuple[float, float] | None = None
    coupling: Array | None = None
    permittivity: Array | None = None
    published: tuple[tuple[tuple[int, int], float], ...] = ()
    within: float = 0.05
    checked: str = ""

    @property
    def piezo(self) -> Piezo | None:
        """The piezoelectric tensors in the axes of the crystal, SI."""
        if self.coupling is None or self.permittivity is None:
            return None
        return from_voigt(self.coupling, self.permittivity)

    @cached_property
    def compliance(self) -> Array:
        """S = C^-1 at constant field, shape (6, 6) (1/Pa)."""
        return np.asarray(np.linalg.inv(self.stiffness))

    @cached_property
    def charge_constants(self) -> Array:
        """D = e s, Bechmann's relation, shape (3, 6) (C/N); zeros without coupling."""
        if self.coupling is None:
            return np.zeros((3, 6))
        return np.asarray(self.coupling @ self.compliance)

    @property
    def free_permittivity(self) -> Array:
        """The permittivity at constant stress, shape (3, 3) (F/m)."""
        assert self.coupling is not None
        assert self.permittivity is not None
        return np.asarray(self.permittivity + self.charge_constants @ self.coupling.T)

    @property
    def voltage_constants(self) -> Array:
        """g, the field of a stress at open circuit, shape (3, 6) (V m/N)."""
        return np.asarray(np.linalg.solve(self.free_permittivity, self.charge_constants))

    def bar_coupling(self, field: int, strain: int) -> float:
        """Return k = d / sqrt(s eps) of a bar: k_33 of (2, 2), k_31 of (2, 0), k_15 of (0, 4)."""
        free = self.free_permittivity[field, field] * self.compliance[strain, strain]
        return float(abs(self.charge_constants[field, strain]) / np.sqrt(free))

    def check(self) -> None:
        """Check that the constants are those of a material.

        Raises
        ------
        ValueError
            If stiffness or permittivity are not positive definite, a crystal of class 6mm is not
            the same all around, d = e s differs from the published values, or k_33 is not below 1.
        """
        Anisotropic(self.stiffness).check()
        tensors = [stiffness_tensor(self.stiffness)]
        if self.coupling is not None and self.permittivity is not None:
            from_voigt(self.coupling, self.permittivity)
            tensors += [coupling_tensor(self.coupling), self.permittivity]
        if self.symmetry in ROUND and not isotropic_about_x3(*tensors):
            raise ValueError(f"class {self.symmetry}: the constants change with a turn about X3")
        for (i, j), given in self.published:
            found = float(self.charge_constants[i, j])
            if not abs(found - given) <= self.within * abs(given):
                raise ValueError(
                    f"d{i + 1}{j + 1} = {given * 1e12:.4g} pC/N is published, and e s makes "
                    f"{found * 1e12:.4g}: they differ by more than {self.within:g}"
                )
        if self.coupling is not None and not self.bar_coupling(2, 2) < 1:
            raise ValueError(f"k33 = {self.bar_coupling(2, 2):.4g}, which is not below 1")
