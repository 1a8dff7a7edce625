"""Indentation of half spaces beside closed forms: punch, cone and ball, insulating and conducting.

`python3 -m scripts.studies.indentation [--out DIR] [--coarse]`, also under mpirun. Each problem is
solved in two boxes; the error by the box is of first order in the contact radius over its size,
and is extrapolated to none. `indentation_figures.py` draws pressure, and the current of an
experiment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from contact import Case, Solution, load_case
from contact.library.materials import find
from contact.results.resultants import charge_balance
from contact.typing import Array
from forms.elasticity import isotropic
from forms.piezo import hexagonal_voigt
from scripts.cases import CASES
from scripts.reporting import Report, append, empty, solved
from scripts.studies import half_space
from scripts.studies.half_space import HalfSpace, Indentation

#: Contact radius that is aimed at, radius of curvature of the ball, half angle of the cone.
RADIUS, CURVATURE, HALF_ANGLE = 0.1, 1.0, 70.3

#: Shape -> second moment of its pressure, a^2/<r^2>, known from the closed form.
MOMENTS = {"punch": None, "cone": 3.0, "ball": 2.5}

#: Constants of the thesis's material: isotropic elasticity, the coupling of PZT-5A.
THESIS = {"young": 58.7102, "poisson": 0.3912}
COUPLING = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}

MATERIALS = ("PZT-4", "PZT-5A", "thesis")


@dataclass(frozen=True)
class Setting:
    """An indentation."""

    #: Name in the library, or "thesis"; "elastic" without coupling.
    material: str
    #: "punch", "cone" or "ball".
    shape: str
    #: Of a conducting indenter (GV); None for an insulating one.
    potential: float | None = None
    #: Elements on the contact radius.
    fineness: float = 12.0
    #: -90: into the half space; 90: out of it.
    poling: float = -90.0
    #: "GPa", or "SI".
    units: str = "GPa"

    @property
    def depth(self) -> float:
        """The depth that is prescribed: that of the aimed radius for an insulating indenter."""
        slope = 1 / np.tan(np.deg2rad(HALF_ANGLE))
        return {
            "punch": 0.01,
            "cone": np.pi / 2 * RADIUS * slope,
            "ball": RADIUS**2 / CURVATURE,
        }[self.shape]

    @property
    def radius(self) -> float:
        """The contact radius of the closed form at the prescribed depth."""
        raised = 0.0
        if self.potential is not None:
            raised = float(self.body.inverse[0, 1] / self.body.inverse[0, 0]) * self.potential
        if self.shape == "cone":
            return float(2 / np.pi * np.tan(np.deg2rad(HALF_ANGLE)) * (self.depth + raised))
        return float(np.sqrt(CURVATURE * (self.depth + raised))) if self.shape == "ball" else RADIUS

    @property
    def body(self) -> HalfSpace:
        """The half space, in GPa, GV and C/m2."""
        if self.material == "thesis":
            return HalfSpace(isotropic(*THESIS.values()), *hexagonal_voigt(**COUPLING))
        entry = find(self.material)
        sign = -np.sign(self.poling)
        return HalfSpace(entry.stiffness / 1e9, sign * entry.coupling, 1e9 * entry.permittivity)

    def case(self, extent: float, *more: str) -> Case:
        """Return the case in a box of an extent, in contact radii; `more` are overrides."""
        unit = 1e9 if self.units == "SI" else 1.0
        insulating = self.potential is None
        name = "indent-pzt4-insulating.toml" if insulating else "indent-pzt4-conducting.toml"
        changes = [
            # Fine at the edge of the contact: that of a smooth one is close to that of the part.
            f"mesh.radius={self.radius * (1.0 if self.shape == 'punch' else 1.03)}",
            f"mesh.contact_size={RADIUS / self.fineness}",
            f"mesh.edge_size={RADIUS / self.fineness / 50}",
            f"mesh.extent={extent * RADIUS}",
            f"mesh.size={extent * RADIUS / 8}",
            f"contact.rigid.displacement=[0.0, {-self.depth}]",
            f"contact.foundation={_foundation(self.shape)}",
            f"material={self._material()}",
        ]
        if not insulating:
            changes.append(f"electric.phi_f={(self.potential or 0.0) * unit}")
            changes.append(f"electric.k_e={1e6 / unit}")
        return load_case(CASES / name, [*changes, *more])

    def _material(self) -> str:
        if self.material == "thesis":
            given = [f"{key} = {value}" for key, value in THESIS.items()]
            piezo = ", ".join(f"{key} = {value}" for key, value in COUPLING.items())
            return f"{{ {', '.join(given)}, poling = {self.poling}, piezo = {{ {piezo} }} }}"
        return f'{{ name = "{self.material}", units = "{self.units}", poling = {self.poling} }}'

    def surface(self, r: Array) -> Array:
        """Return the depth of the surface beneath the indenter, at distances from the axis."""
        slope = 1 / np.tan(np.deg2rad(HALF_ANGLE))
        profile = {"punch": 0 * r, "cone": slope * r, "ball": r**2 / (2 * CURVATURE)}
        return np.asarray(self.depth - profile[self.shape])

    def closed(self, radius: float) -> Indentation:
        """Return the closed form, at a contact radius."""
        body, phi = self.body, self.potential
        if self.shape == "punch":
            return half_space.punch(body, RADIUS, self.depth, phi)
        if self.shape == "cone":
            return half_space.cone(body, HALF_ANGLE, radius, phi)
        return half_space.ball(body, CURVATURE, radius, phi)


def _foundation(shape: str) -> str:
    if shape == "punch":
        return '{ shape = "plane", point = [0.0, 0.0], normal = [0.0, -1.0] }'
    own = f"radius = {CURVATURE}" if shape == "ball" else f"half_angle = {HALF_ANGLE}"
    name = "paraboloid" if shape == "ball" else "cone"
    return f'{{ shape = "{name}", apex = [0.0, 0.0], axis = [0.0, 1.0], {own} }}'


@dataclass(frozen=True)
class Found:
    """Results of a solution, in GPa, m, GV and C: ratios to the closed form at its own radius."""

    #: P, delta, Q, and phi(0) of an insulating indenter; NaN for those that do not exist.
    force: float
    depth: float
    charge: float
    potential: float
    #: a, of the second moment of the pressure.
    radius: float
    #: Number of unknowns.
    unknowns: int


def compared(setting: Setting, solution: Solution) -> Found:
    """Compare a solution with the closed form. Collective."""
    unit = 1e9 if setting.units == "SI" else 1.0
    nodes, problem = solution.problem.nodes, solution.problem
    r, pressure = nodes.points[:, 0], solution.pressure
    factor, radius = MOMENTS[setting.shape], RADIUS
    if factor is not None:
        radius = float(np.sqrt(factor * nodes.sum(pressure * r**2) / nodes.sum(pressure)))
    exact = setting.closed(radius)
    charge = potential = np.nan
    if setting.potential is not None:
        # Of the free charges D.nu of the body, nu outwards: D_z with z into it is minus that.
        charge = -charge_balance(problem, solution.state).foundation / exact.charge
    else:
        inner = r < 0.3 * radius
        phi = problem.body.phi_scale * solution.nodal[:, -1]
        # phi is (M_21/M_11) u_z everywhere beneath the indenter.
        expected = half_space.potential_beneath(setting.body, 1.0) * setting.surface(r)
        ratio = np.where(inner, phi / unit / expected, 0.0)
        potential = nodes.sum(ratio) / nodes.sum(inner.astype(float))
    return Found(
        float(solution.contact_force[1]) / unit / exact.force,
        setting.depth / exact.depth,
        float(charge),
        float(potential),
        radius,
        problem.body.layout.unknowns,
    )


def extrapolated(setting: Setting, extent: float = 30.0) -> tuple[Found, list[Found]]:
    """Return the extrapolation to no box, and the results of the two boxes. Collective."""
    boxes = [extent, 2 * extent]
    found = [compared(setting, solved(setting.case(box))) for box in boxes]

    def limit(name: str) -> float:
        x = [f.radius / RADIUS / box for f, box in zip(found, boxes, strict=True)]
        first, second = (getattr(f, name) for f in found)
        return float(second - (first - second) * x[1] / (x[0] - x[1]))

    names = ("force", "depth", "charge", "potential")
    return replace(found[-1], **{name: limit(name) for name in names}), found


def write_table(report: Report, fineness: float, materials: Sequence[str] = MATERIALS) -> None:
    """Tabulate ratios to the closed forms. Collective."""
    rows = []
    for material in materials:
        for shape in MOMENTS:
            for potential in (None, 0.0, 0.002):
                setting = Setting(material, shape, potential, fineness)
                found, boxes = extrapolated(setting)
                kind = "insulating" if potential is None else f"at {potential:g} GV"
                rows.append(
                    {
                        "material": material,
                        "shape": shape,
                        "indenter": kind,
                        "P": found.force,
                        "delta": found.depth,
                        "Q": found.charge,
                        "phi": found.potential,
                        "P in the box": boxes[-1].force,
                        "unknowns": found.unknowns,
                    }
                )
    note = (
        "Ratios of the computed to the closed form at the computed contact radius (that of the "
        "punch is given), extrapolated from boxes of 30 and 60 contact radii; phi is the potential "
        r"over $(M_{21}/M_{11})\, u_z$ beneath an insulating indenter. At a potential the "
        "foundation conducts across gaps up to 1e-6 m: with conduction in contact alone, contact "
        "could end at any smaller radius, with a singular pressure."
    )
    report.table("closed-forms", "Indentation, computed over closed form", rows, note)


def half_spaces(report: Report) -> None:
    """Tabulate the moduli of the half spaces, and charge over force of a grounded indenter."""
    columns = empty("material", "E* insulating (GPa)", "E* conducting (GPa)", "|Q/P| (pC/N)")
    for material in MATERIALS:
        body = Setting(material, "ball", 0.0).body
        charge = 1e3 * abs(body.charge_ratio)  # from C/m2 over GPa
        append(columns, material, body.insulating, body.conducting, charge)
    note = (
        "Q/P: charge over force of a grounded indenter. The material of the thesis has isotropic "
        "elasticity and the coupling of PZT-5A."
    )
    report.table("half-spaces", "Moduli of piezoelectric half spaces", columns, note)


def units_and_poling(report: Report, fineness: float) -> None:
    """Tabulate the effects of poling and units on a ball on PZT-4. Collective."""
    columns = empty("indenter", "given", "P", "Q or phi", "largest difference of p", "of phi")
    for potential in (None, 0.0):
        kind = "insulating" if potential is None else "grounded"
        first: tuple[float, float, Array, Array] | None = None
        for given, poling, units in (
            ("GPa", -90.0, "GPa"),
            ("SI", -90.0, "SI"),
            ("poling reversed", 90.0, "GPa"),
        ):
            setting = Setting("PZT-4", "ball", potential, fineness, poling, units)
            solution, unit = solved(setting.case(20.0)), 1e9 if units == "SI" else 1.0
            problem, sign = solution.problem, -np.sign(poling)
            force = float(solution.contact_force[1]) / unit
            phi = sign * solution.nodal[:, -1] * problem.body.phi_scale / unit
            other = sign * charge_balance(problem, solution.state).foundation
            if potential is None:
                # Beneath the tip it is largest.
                other = problem.comm.allreduce(np.abs(phi).max(initial=0.0), op=MPI.MAX)
            found = (force, float(other), solution.pressure / unit, phi)
            first = found if first is None else first
            off = [
                problem.comm.allreduce(np.abs(now - then).max(initial=0.0), op=MPI.MAX)
                / problem.comm.allreduce(np.abs(then).max(initial=0.0), op=MPI.MAX)
                for now, then in zip(found[2:], first[2:], strict=True)
            ]
            append(columns, kind, given, *found[:2], *off)
    note = (
        "In a box of 20 contact radii, in GPa, GV and C; phi and Q of the body poled the other way "
        "with the sign turned. Differences to the first row of three, over the largest."
    )
    report.table("units-and-poling", "A ball on PZT-4: units and poling", columns, note)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables."""
    report = Report.of(__doc__, "indentation", arguments)
    fineness = 6.0 if report.coarse else 12.0
    half_spaces(report)
    units_and_poling(report, fineness)
    write_table(report, fineness, MATERIALS[:1] if report.coarse else MATERIALS)


if __name__ == "__main__":
    main()
