"""Remarks on the discretisation error: elements that lock, meshes that are too coarse."""

from __future__ import annotations

from collections.abc import Iterator

from contact.body.elements import MEAN_DILATATION, unlocked
from contact.mesh.cells import shape_of
from contact.output.solution import Remark, Solution

#: Ratio of bulk to shear modulus, of nu = 0.475, from which on elements of degree 1 lock.
LOCKED = 20.0

#: Largest estimated error without a warning: its square is that of displacements under loads.
COARSE = 0.15


def locks(solution: Solution) -> bool:
    """Whether elements of degree 1 are much too stiff, for volumes hardly change."""
    ratio = None if solution.error is None else solution.error.stiffness_ratio
    return _remedy(solution) is not None and ratio is not None and ratio >= LOCKED


def _remedy(solution: Solution) -> str | None:
    body = solution.problem.equilibrium
    return unlocked(body.element, body.degree, shape_of(body.domain.mesh))


def remarks(solution: Solution) -> Iterator[Remark]:
    """Say where the mesh locks, or the estimated error is large, as where slender parts bend."""
    error = solution.error
    assert error is not None
    if locks(solution):
        yield (
            f"the mesh locks: the bulk modulus is {error.stiffness_ratio:.3g} times the shear "
            f"modulus where the energy is, and from {LOCKED:g} on elements of degree 1 are too "
            "stiff: displacements are too small, and the estimated error is a lower bound; "
            f"{_remedy(solution)}"
        )
    elif error.relative > COARSE:
        # The mean dilatation is no bound from below: it may be too soft as well.
        mean = solution.problem.equilibrium.element == MEAN_DILATATION
        yield (
            f"the mesh is too coarse: the estimated discretisation error is "
            f"{error.relative:.1%} (energy norm), and "
            f"{'displacements are off' if mean else 'the body is too stiff'} by about "
            f"{error.relative**2:.1%}, more where slender parts bend; a finer mesh, or "
            "space.degree = 2, has less of it"
        )
