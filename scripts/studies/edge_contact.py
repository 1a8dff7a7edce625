"""The estimated discretisation error beside the error, where bodies touch at edges.

`python3 -m scripts.studies.edge_contact [--out DIR] [--coarse]`; the page is docs/error.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from mpi4py import MPI

from contact import Body, Contact, Domain, Fixed, Friction, Motion, Plane, build_problem, parse_case
from contact.mesh.domain import revolved
from contact.mesh.geometry import geometry_nodes
from contact.mesh.grid import rectangle
from contact.mesh.transfer import refined
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.results.error_estimate import estimated
from contact.typing import Array
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from scripts.reporting import Report, append, empty
from scripts.studies.effectivity import compared
from scripts.studies.error_norms import errors
from tests.problems.mechanics import state_of

#: Refinements of the reference about the edges: the last cells are narrower than most contacts.
LOCAL = 8

#: Cells in the thickness.
MESHES = (1, 2, 4, 8)

STEEL, RUBBED = Linear(206e3, 0.3), Friction(ConstantCoefficient(0.1))


@dataclass(frozen=True)
class Edged:
    """A problem of contact at edges."""

    #: Returns the problem with n cells in the thickness, of a degree.
    make: Callable[[int, int], ContactProblem]
    #: Places of the edges.
    edges: Array

    def reference(self, n: int, local: int = LOCAL) -> tuple[ContactProblem, State]:
        """Return the problem of n cells and degree 2, cut about the edges, and its solution."""
        problem = self.make(n, 2)
        domain = problem.domain
        for _ in range(local):
            corners = geometry_nodes(domain)
            size = np.ptp(corners, axis=1).max(axis=1)
            ways = corners.mean(axis=1)[:, None] - self.edges
            near = np.linalg.norm(ways, axis=2).min(axis=1) < 1.5 * size
            domain = refined(domain, np.flatnonzero(near).astype(np.int32))
        body = problem.body
        fine = ContactProblem(domain, body.description, problem.contacts, degree=body.degree)
        return fine, state_of(fine, 1e-9)


def edged() -> dict[str, Edged]:
    """Return the problems by their names."""
    return {
        "Belleville washer": Edged(washer, np.array([_cone(0.0, 0.0), _cone(25.0, 3.0)])),
        "leaf": Edged(leaf, np.array([[50.0, 0.0]])),
        "flat punch": Edged(punch, np.array([[1.0, 2.0]])),
        "block in a corner": Edged(cornered, np.array([[0.0, 0.0], [0.0, 1.0]])),
        "beam on a knife": Edged(partial(beam, 4.0), np.array([[4.0, 0.0]])),
        "the same, between nodes": Edged(partial(beam, 4.1), np.array([[4.1, 0.0]])),
    }


def _cone(along: Any, across: Any) -> tuple[Any, Any]:
    """Return points of the section of a washer: from its outer edge on the ground inwards."""
    slope = np.arctan2(2.2, 25.0)
    sine, cosine = np.sin(slope), np.cos(slope)
    return 51.0 - along * cosine - across * sine, along * sine + across * cosine


def _moved(domain: Domain, place: Callable[[Any, Any], tuple[Any, Any]]) -> Domain:
    """Return a mesh whose points have been moved."""
    x = domain.mesh.geometry.x
    x[:, 0], x[:, 1] = place(x[:, 0].copy(), x[:, 1].copy())
    return domain


def washer(n: int, degree: int) -> ContactProblem:
    """Return a Belleville washer that two plates flatten by half of its rise. Collective."""
    strip = rectangle(MPI.COMM_WORLD, [0.0, 0.0], [25.0, 3.0], [10 * n, n])
    domain = revolved(_moved(strip, _cone))
    plates = [
        Contact("bottom", Plane((0.0, 0.0), (0.0, 1.0)), friction=RUBBED),
        Contact(
            "top",
            Plane((0.0, float(_cone(25.0, 3.0)[1])), (0.0, -1.0)),
            friction=RUBBED,
            rigid=Motion([0.0, -1.1]),
        ),
    ]
    return ContactProblem(domain, Body(STEEL, []), plates, degree=degree)


def leaf(n: int, degree: int) -> ContactProblem:
    """Return half of a leaf whose end slides on a plate; its middle goes down. Collective."""
    strip = rectangle(MPI.COMM_WORLD, [0.0, 0.0], [50.0, 1.0], [20 * n, n])
    domain = _moved(strip, lambda x, y: (x, y + 0.1 * (50.0 - x)))
    body = Body(STEEL, [Fixed("left", [0.0, -1.0])])
    plate = Contact("bottom", Plane((0.0, 0.0), (0.0, 1.0)), friction=RUBBED)
    return ContactProblem(domain, body, plate, degree=degree)


def punch(n: int, degree: int) -> ContactProblem:
    """Return a block under a rigid punch of half width 1, from the middle on. Collective."""
    return _problem(
        [4.0, 2.0], [8 * n, 4 * n], degree, overlap="press",
        fixed={"left": [0.0, "free"], "bottom": [0.0, 0.0]},
        gaps={"top": "where(x < 1.0001, -0.001, 1.0)"},
    )  # fmt: skip


def cornered(n: int, degree: int) -> ContactProblem:
    """Return a block that is pressed into a corner, and turned in it. Collective."""
    return _problem(
        [1.0, 1.0], [4 * n, 4 * n], degree,
        parts={"wall": {"side": "left", "from": 0.25}}, fixed={"right": [-0.01, -0.01]},
        gaps={"bottom": "0.05*x", "wall": "0.05*(1 - y)"},
    )  # fmt: skip


def beam(at: float, n: int, degree: int) -> ContactProblem:
    """Return a cantilever on the edge of a knife, under a load at its end. Collective."""
    return _problem(
        [8.0, 1.0], [8 * n, n], degree, fixed={"left": [0.0, 0.0]},
        load=[{"on": "right", "traction": [0.0, -1e-3]}], gaps={"bottom": f"abs(x - {at})"},
    )  # fmt: skip


def _problem(
    size: list[float],
    cells: list[int],
    degree: int,
    *,
    fixed: dict[str, list[Any]],
    gaps: dict[str, str],
    parts: dict[str, Any] | None = None,
    overlap: str = "refuse",
    load: Sequence[dict[str, Any]] = (),
) -> ContactProblem:
    """Return a rectangle of E = 1 and nu = .3 with supports and gaps of its sides."""
    tables = {
        "mesh": {"generator": "rectangle", "size": size, "cells": cells, "parts": parts or {}},
        "space": {"degree": degree},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": on, "displacement": u} for on, u in fixed.items()],
        "load": list(load),
        "contact": [{"on": on, "gap": gap, "overlap": overlap} for on, gap in gaps.items()],
    }
    return build_problem(parse_case(tables))


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the table of estimates beside errors. Collective."""
    report = Report.of(__doc__, "discretisation", arguments)
    meshes = MESHES[:1] if report.coarse else MESHES
    shown = *(f"error, {n}" for n in meshes), *(f"effectivity, {n}" for n in meshes)
    columns = empty("problem", "element", *shown)
    for name, one in edged().items():
        fine, best = one.reference(4 * meshes[-1])
        norm = errors(fine.body, best.x, None).energy
        for degree in (1, 2):
            relative, effectivity = [], []
            for n in meshes:
                problem = one.make(n, degree)
                state, error = compared(problem, fine, best)
                relative.append(error / norm)
                effectivity.append(float(np.sqrt(estimated(problem, state).total)) / error)
            append(columns, name, f"P{degree}", *relative, *effectivity)
    report.table(
        "edges", "Estimated error over the error where bodies touch at edges", columns, NOTE
    )


NOTE = (
    "The columns are those of meshes of 1, 2, 4 and 8 cells in the thickness of washer, leaf and "
    "beam, in half of the punch's half width, and in a quarter of the block's side. Errors are "
    "relative, in the energy norm, to P2 on 32 such cells, those about the edges cut "
    f"{LOCAL} times more. Belleville washer 100 x 51 x 3 that two plates flatten by half of its "
    "rise 2.2, with friction; half of a leaf, whose end slides on a plate; rigid flat punch on a "
    "block; block that its supports turn in a corner; cantilever on the edge of a knife at a node, "
    "or between two."
)


if __name__ == "__main__":
    main()
