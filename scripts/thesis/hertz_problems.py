"""Hertz's cylinder and sphere: the classical solutions, and the cases to compare with them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact import Case, load_case
from contact.typing import Array
from scripts.cases import CASES


@dataclass(frozen=True)
class Cylinder:
    """Hertz's line contact of an elastic cylinder with a rigid plane."""

    #: Line load of the whole cylinder (force/length).
    load: float
    young: float = 2000.0
    poisson: float = 0.3
    radius: float = 8.0

    @property
    def half_width(self) -> float:
        """Return b = 2 sqrt(F R (1 - nu^2) / (pi E))."""
        modulus = self.young / (1 - self.poisson**2)
        return float(2 * np.sqrt(self.load * self.radius / (np.pi * modulus)))

    @property
    def peak(self) -> float:
        """Return p_0 = 2 F / (pi b)."""
        return 2 * self.load / (np.pi * self.half_width)

    def pressure(self, x: Array) -> Array:
        """Return p_0 sqrt(1 - x^2/b^2)."""
        return self.peak * np.sqrt(np.maximum(1 - (x / self.half_width) ** 2, 0.0))


@dataclass(frozen=True)
class Sphere:
    """Hertz's point contact of an elastic sphere with a rigid plane."""

    force: float = 100.0
    young: float = 1000.0
    poisson: float = 0.3
    radius: float = 10.0

    @property
    def contact_radius(self) -> float:
        """Return a = (3 F R / (4 E*))^(1/3)."""
        modulus = self.young / (1 - self.poisson**2)
        return float(np.cbrt(3 * self.force * self.radius / (4 * modulus)))

    @property
    def peak(self) -> float:
        """Return p_0 = 3 F / (2 pi a^2)."""
        return 3 * self.force / (2 * np.pi * self.contact_radius**2)

    @property
    def approach(self) -> float:
        """Return delta = a^2/R, the approach of infinitely distant points."""
        return self.contact_radius**2 / self.radius

    def axial(self, depth: float) -> float:
        """Return Hertz's approach of the point of the axis at a depth: delta - u_z(depth).

        u_z is the integral of the axial strain from there to infinity.
        """
        zeta = np.geomspace(depth / self.contact_radius, 1e5, 20001)
        axial = -1 / (1 + zeta**2)
        radial = -(1 + self.poisson) * (1 - zeta * np.arctan(1 / zeta)) - axial / 2
        strain = self.peak * (axial - 2 * self.poisson * radial) / self.young
        # Beyond, the strain falls like 1/zeta^2.
        integral = np.trapezoid(strain, zeta) + strain[-1] * zeta[-1]
        return self.approach + self.contact_radius * float(integral)


def cylinder(
    load: float,
    *,
    mu: str = "0.0",
    direction: str = "foundation",
    shape: str = "quarter_disc",
    fineness: float = 20.0,
    degree: int = 1,
) -> Case:
    """Return Example 7.1 with another load, friction, contact direction and shape."""
    hertz = Cylinder(load)
    b = hertz.half_width
    changes = [
        f"title=Hertz: {shape}, load {load:g}, mu = {mu}, direction {direction}",
        f"mesh.contact_size={b / fineness}",
        f"mesh.contact_width={1.25 * b}",
        f"mesh.size={min(0.8, 9.6 / fineness)}",
        f"contact.direction={direction}",
        f"space.degree={degree}",
    ]
    if mu != "(7.16)":
        changes.append(f"friction.mu={mu}")
    width = 2 * hertz.radius
    if shape != "quarter_disc":
        changes += [f"mesh.generator={shape}", "fixed.0.on=top"]
    if shape == "disc":
        # The platen touches the arc within 30 degrees of the top.
        changes.append("mesh.top_angle=30.0")
        width = 2 * hertz.radius * np.sin(np.deg2rad(30.0))
    changes.append(f"load.0.traction=[0.0, {-load / width}]")
    return load_case(CASES / "hertz.toml", changes)


def sphere(fineness: float, degree: int = 1) -> Case:
    """Return the sphere with a number of elements on Hertz's contact radius."""
    a = Sphere().contact_radius
    return load_case(
        CASES / "hertz-sphere.toml",
        [
            f"mesh.contact_size={a / fineness}",
            f"mesh.contact_width={1.15 * a}",
            f"mesh.size={min(2.0, 12.0 / fineness)}",
            f"space.degree={degree}",
        ],
    )
