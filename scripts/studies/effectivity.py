"""The estimated discretisation error beside the error, where the exact solution is known.

`python3 -m scripts.studies.effectivity [--out DIR] [--coarse]`; the page is docs/error.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact import Body, Contact, Fixed, Load
from contact.body.elements import MEAN_DILATATION
from contact.mesh.grid import box
from contact.mesh.transfer import carry
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.results.error_estimate import estimated
from forms.hencky import Linear, Log
from scripts.reporting import Report, append, empty
from scripts.studies.discretisation import BARS, bar
from scripts.studies.error_norms import errors
from scripts.studies.exact_solutions import Singular, exact, manufactured, nearly_isochoric
from scripts.studies.hertz_exact import Line
from scripts.studies.manufactured_contact import PiezoLayers, Sliding
from tests.problems.mechanics import flat, state_of
from tests.problems.piezo import SCALED, pzt
from tests.problems.revolution import Drum, Layers, Tube, pressed_cylinder

#: Effectivities that are asked for, and why some are not.
WITHIN = 0.7, 1.5
WHY = {
    ("tube, nu = 0.4999", "P1"): "locked",
    ("tube, nu = 0.4999", "P2"): "wrong pressures",
    ("bar, nu = 0.4999", "P1"): "locked",
    ("pressed cylinder, revolved", "P2"): "rim far in the plastic range",
}


@dataclass(frozen=True)
class Known:
    """A problem whose solution is known."""

    #: Of the solution.
    source: str
    #: Returns the problem with n cells along an edge, of a degree.
    make: Callable[[int, int], ContactProblem]
    #: Returns the solution of a problem, as `errors` takes it.
    solution: Callable[[ContactProblem], Any]
    #: Those looked at, of degree 1 and 2; 0 for none.
    cells: tuple[int, int] = (32, 16)


MANUFACTURED = "manufactured"
LAME = "Lamé's rings"


def known() -> dict[str, Known]:
    """Return problems whose solution is known, by their names."""
    tube, soft, drum, layers = Tube(), Tube(law=Linear(1.0, 0.4999)), Drum(), Layers()
    singular, line, crystal = Singular(), Line(), pzt(2)
    one, other, yielding = Linear(1.0, 0.3), Linear(3.0, 0.2), Log(1.0, 0.3, yield_strain=0.02)
    poled = PiezoLayers(SCALED.law(), (crystal, pzt(2, scale=-0.5)))

    def smooth(dim: int, cells: tuple[int, int], **more: Any) -> Known:
        solution = exact(dim, charged="piezo" in more)
        make = partial(_manufactured, dim, more)
        return Known(MANUFACTURED, make, lambda _: solution, cells)

    def isochoric(cells: tuple[int, int], cell: str | None = None) -> Known:
        law = Linear(1.0, 0.4999)
        parts = nearly_isochoric(law)
        more = {"law": law, "parts": parts, "element": MEAN_DILATATION, "cell": cell}
        make = partial(_manufactured, 2, more)
        return Known(MANUFACTURED, make, lambda _: lambda x: ufl.as_vector([f(x) for f in parts]),
                     cells)  # fmt: skip

    def sliding(cells: tuple[int, int], *laws: Any, dim: int = 2) -> Known:
        block = Sliding(laws, dim)
        return Known(MANUFACTURED, block.problem, lambda p: lambda _: block.exact(p.domain), cells)

    def rings(tube: Tube) -> Known:
        return Known(LAME, tube.problem, lambda _: tube.displacement)

    return {
        "Hencky, 2-D": smooth(2, (32, 16)),
        "Hencky, 3-D": smooth(3, (8, 4)),
        "Hencky, plane stress": smooth(2, (32, 16), plane_stress=True),
        "quadrilaterals": smooth(2, (32, 16), cell="quadrilateral"),
        "hexahedra": smooth(3, (8, 4), cell="hexahedron"),
        "piezoelectric": smooth(2, (32, 16), law=SCALED.law(), piezo=crystal),
        "piezoelectric, 3-D": smooth(3, (8, 4), law=SCALED.law(), piezo=pzt(3)),
        "piezoelectric layers, friction": Known(
            MANUFACTURED, poled.problem, lambda _: poled.fields, (32, 16)
        ),
        "open, stick, slip": sliding((32, 16), one),
        "the same, Hencky": sliding((32, 16), yielding),
        "the same, 3-D": sliding((8, 8), one, dim=3),
        "the same, two bodies": sliding((32, 16), one, other),
        "two bodies, Hencky": sliding((32, 16), yielding, other),
        "two bodies, 3-D": sliding((8, 8), one, other, dim=3),
        "two materials": Known(
            LAME, lambda n, p: layers.problem(n, p, 1), lambda _: layers.displacement, (24, 12)
        ),
        "two rings": Known(
            LAME, lambda n, p: layers.problem(n, p, 2), lambda _: layers.displacement, (24, 12)
        ),
        "tube in a casing": rings(tube),
        "tube, nu = 0.4999": rings(soft),
        "mean dilatation, nu = 0.4999": isochoric((0, 16)),
        "the same, quadrilaterals": isochoric((32, 0), "quadrilateral"),
        "Hencky, revolved": Known(MANUFACTURED, drum.problem, lambda _: drum.displacement),
        "end of contact": Known("Williams' series", singular.problem, lambda _: singular.ufl),
        "Hertz's cylinder": Known("Hertz", line.problem, partial(_interpolated, line)),
    }


def _manufactured(dim: int, more: dict[str, Any], n: int, degree: int) -> ContactProblem:
    return manufactured(dim, degree, n, **more)


def _interpolated(line: Line, problem: ContactProblem) -> Callable[[Any], fem.Function]:
    """Return Hertz's displacement among the functions of degree 5."""
    mesh = problem.domain.mesh
    element = basix.ufl.element("Lagrange", mesh.topology.cell_name(), 5, shape=(2,))
    found = fem.Function(fem.functionspace(mesh, element))
    found.interpolate(lambda x: line.displacement(x[:2]))
    return lambda _: found


def beside() -> dict[str, tuple[Callable[[int, int], ContactProblem], list[Any], int]]:
    """Return problems of n cells a unit and a degree, those looked at, and n of the finest."""
    few = [(1, 8), (1, 16), (2, 8)]
    return {
        **{name: (partial(bar, **more), few, 64) for name, more in BARS.items()},
        "pressed cylinder, revolved": (partial(pressed_cylinder, MPI.COMM_WORLD), few, 48),
        "block": (block, [(1, 4), (2, 2), (2, 3)], 8),
    }


def block(n: int, degree: int) -> ContactProblem:
    """Return a block 2 x 1 x 1 that is clamped at one end and sheared at the other. Collective."""
    domain = box(MPI.COMM_WORLD, [0.0] * 3, [2.0, 1.0, 1.0], [2 * n, n, n])
    support, load = Fixed("left", [0.0] * 3), Load("right", [0.0, 0.0, -1e-3])
    body = Body(Linear(1.0, 0.3), [support], [load])
    return ContactProblem(domain, body, Contact("bottom", flat(10.0)), degree=degree)


def compared(problem: ContactProblem, fine: ContactProblem, best: State) -> tuple[State, float]:
    """Return the solution, and its error in energy against that of a finer mesh. Collective."""
    state = state_of(problem, 1e-9)
    other = carry(problem.body.function(state.x), fine.body.space)
    return state, errors(fine.body, best.x, other).energy


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the table of estimates beside known errors. Collective."""
    report = Report.of(__doc__, "discretisation", arguments)
    share = 2 if report.coarse else 1
    columns = empty(
        "problem", "known by", "element", "cells", "error", "estimate", "effectivity", "why not",
    )  # fmt: skip
    for name, one in known().items():
        for degree, cells in enumerate(one.cells, 1):
            if not cells:
                continue
            n = cells // share if cells > 8 else cells
            problem = one.make(n, degree)
            x = state_of(problem, 1e-9)
            error = errors(problem.body, x.x, one.solution(problem)).energy
            _append(columns, (name, one.source, f"P{degree}", n), problem, x, error)
    for name, (make, looked_at, most) in beside().items():
        fine = make(most // share, 2)
        best = state_of(fine, 1e-9)
        for degree, n in looked_at:
            problem = make(n, degree)
            x, error = compared(problem, fine, best)
            _append(columns, (name, f"P2, {most // share}", f"P{degree}", n), problem, x, error)
    report.table(
        "effectivity",
        "Estimated error over the error, in the energy norm, relative",
        columns,
        NOTE,
    )


NOTE = (
    "Known by manufactured solutions: smooth displacements and potentials (Hencky's law, also in "
    "plane stress, on quadrilaterals and hexahedra; PZT-5A; nearly isochoric); two layers of "
    "PZT-5A poled up and down that slide on a conductive foundation; blocks whose contact is "
    "open, sticks and slips, on a foundation or on each other. Lamé's rings: a tube under a "
    "pressed-on casing; a tube in another one (one body with two materials, or two bodies whose "
    "meshes do not match), revolved. Williams' series: the end of a contact without friction. "
    "Hertz: a cylinder in a half plane. P2, n: compared with P2 on n cells a unit: bars, cylinder "
    "(Hencky's law and friction, revolved), and a block (3-D, clamped at an end)."
)


def _append(
    columns: dict[str, list[Any]],
    row: tuple[str, str, str, int],
    problem: ContactProblem,
    state: State,
    error: float,
) -> None:
    found = estimated(problem, state)
    norm = errors(problem.body, state.x, None).energy
    estimate = float(np.sqrt(found.total))
    ratio = estimate / error
    why = "" if WITHIN[0] <= ratio <= WITHIN[1] else WHY.get((row[0], row[2]), "?")
    append(columns, *row, error / norm, estimate / norm, ratio, why)


if __name__ == "__main__":
    main()
