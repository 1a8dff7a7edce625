"""The examples that the methods are compared on: every case file, tables with all their rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from contact import Case, load_case
from scripts.cases import CASES, TABLE_8_4

#: Tolerance on the residuals of `newton` and `uzawa`.
TOLERANCE = 1e-10

#: rho of (7.16) in Table 7.1, and none.
RHO = (0.0, 1e5, 1e6, 1e7, 6e7)


@dataclass(frozen=True)
class Example:
    """A case file with changes."""

    #: In the tables.
    label: str
    #: Of the case file.
    name: str
    #: To the case file, its mesh aside.
    changes: tuple[str, ...] = ()

    def case(self, coarse: bool) -> Case:
        """Return the case on its mesh of moderate size, or on a coarse one."""
        meshes = COARSE if coarse else MESHES
        mesh = next((mesh for start, mesh in meshes.items() if self.name.startswith(start)), ())
        exact = ("solver.method=newton", f"solver.tolerance={TOLERANCE}")
        return load_case(CASES / f"{self.name}.toml", [*mesh, *exact, *self.changes])


#: Start of a case file's name -> its mesh; the others keep that of the file.
MESHES: Mapping[str, tuple[str, ...]] = {
    "bar": ("mesh.cells=[128, 32]",),
    "piezo-column": (),
    "piezo": ("mesh.cells=[64, 32]",),
    "compliance": ("mesh.cells=[96, 16]",),
}
COARSE: Mapping[str, tuple[str, ...]] = {
    "bar": ("mesh.cells=[64, 16]",),
    "hertz-sphere": ("mesh.contact_size=0.3",),
    "piezo-column": (),
    "piezo": ("mesh.cells=[16, 8]",),
    "compliance": ("mesh.cells=[24, 4]",),
}


def examples() -> list[Example]:
    """Return all case files of one static step, those of tables with the rows of these."""
    found = []
    for name, load in (("bar", -0.005), ("bar-large", -0.05)):
        for rho in RHO:
            changes = (f"friction.mu.rho={rho}",)
            found.append(Example(f"7.2, f2 = {load:g}, rho = {short(rho)}", name, changes))
    others = {
        "7.1, load 160, no friction": "hertz-small",
        "7.1": "hertz",
        "sphere": "hertz-sphere",
        "8.1, insulated": "piezo-8-1",
        "8.1": "piezo-8-1-conductive",
        "8.2": "piezo-8-2",
        "column": "piezo-column",
        "sensor": "piezo-sensor",
        "8.3": "compliance-8-3",
        "8.3, top only": "compliance-8-3-top",
        "8.3, layer": "compliance-8-3-layer",
        "8.3, no rigid part": "compliance-8-3-soft",
    }
    found += [Example(label, name) for label, name in others.items()]
    for suffix in ("", "-layer"):
        name, words = f"compliance-8-4{suffix}", suffix.replace("-", ", ")
        for mu, k_e in ((0.6, 1.0), (0.6, 0.0), (0.0, 1.0)):
            changes = (f"friction.mu={mu}", f"electric.k_e={k_e}")
            found.append(Example(f"8.4{words}, mu = {mu:g}, k_e = {k_e:g}", name, changes))
        for value in TABLE_8_4:
            changes = (f"friction.mu={value}", f"electric.k_e={value}")
            found.append(Example(f"8.4{words}, mu = k_e = {value:g}", name, changes))
    known = {example.name for example in found}
    return found + [Example(name, name) for name in static_cases() if name not in known]


def static_cases() -> list[str]:
    """Return the names of the case files that do not go on in time."""
    files = sorted(CASES.glob("*.toml"))
    return [file.stem for file in files if load_case(file).evolution is None]


def short(number: float) -> str:
    """Return a number such as 60000000.0 as 6e7."""
    return f"{number:.0e}".replace("e+0", "e") if number > 0 else "0"
