"""Laws of the stress with internal variables: a stress update at points, in NumPy.

Tensors are vectors of their components xx, yy, zz, yz, xz, xy, in the plane and of bodies of
revolution xx, yy, zz, xy, with shears times sqrt(2) (Mandel's notation): products of tensors are
those of vectors, and a law that takes any number of components is written once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
import ufl
from numpy.typing import ArrayLike, NDArray
from ufl.core.expr import Expr

from forms.crystal import VOIGT
from forms.elasticity import ElasticConstants, moduli
from forms.kinematics import embed

#: Number of components -> the pairs of tensor indices that they stand for.
PAIRS = {4: ((0, 0), (1, 1), (2, 2), (0, 1)), 6: VOIGT}

#: Part of a strain, and the least strain, by which differences of the stress are taken.
DIFFERENCE, LEAST = 1e-6, 1e-12

#: Name of the strain, and of the stress, among the variables of a point.
_STRAIN = ""


def components(dim: int) -> int:
    """Return the number of components of a symmetric tensor in 2-D or 3-D."""
    return 4 if dim == 2 else 6


def to_vector(tensor: Expr, size: int) -> Expr:
    """Return the components of a symmetric tensor as a UFL vector of 4 or 6."""
    t = embed(tensor)
    return ufl.as_vector([t[i, j] if i == j else 2**0.5 * t[i, j] for i, j in PAIRS[size]])


def to_tensor(vector: Expr) -> Expr:
    """Return the 3 x 3 tensor of 4 or 6 components."""
    rows = [[ufl.as_ufl(0.0)] * 3 for _ in range(3)]
    for k, (i, j) in enumerate(PAIRS[vector.ufl_shape[0]]):
        rows[i][j] = rows[j][i] = vector[k] if i == j else vector[k] / 2**0.5
    return ufl.as_tensor(rows)


def isotropic_stiffness(bulk: ArrayLike, shear: ArrayLike, size: int) -> NDArray[np.float64]:
    """Return k I (x) I + 2 G (1 - I (x) I/3) for moduli of shape (...), shape (..., size, size)."""
    one = np.zeros(size)
    one[:3] = 1.0
    spherical = np.outer(one, one)
    k, g = (np.asarray(modulus, dtype=float)[..., None, None] for modulus in (bulk, shear))
    return np.asarray(k * spherical + 2 * g * (np.eye(size) - spherical / 3))


@dataclass(frozen=True)
class Response:
    """The response of a material at n points to a strain.

    Attributes
    ----------
    stress
        At the end of the step, shape (n, s) with s components.
    variables
        The internal variables there, shape (n, ...).
    stiffness
        Derivative of the stress by the strain, shape (n, s, s), or another positive matrix where
        the "secant" is asked for. None: differences of the stress, and the elastic stiffness.
    dissipation
        Energy that was dissipated during the step, by volume, shape (n,); None for nothing.
    energy
        Energy that is stored at its end, by volume, shape (n,), from which a balance can tell
        whether the dissipation is right. None: the work of the stresses less the dissipation.
    """

    stress: NDArray[np.float64]
    variables: Mapping[str, NDArray[np.float64]]
    stiffness: NDArray[np.float64] | None = None
    dissipation: NDArray[np.float64] | None = None
    energy: NDArray[np.float64] | None = None

    def symmetrised(self) -> Response:
        """Return the same with the symmetric part of the stiffness."""
        assert self.stiffness is not None
        return replace(self, stiffness=(self.stiffness + self.stiffness.transpose(0, 2, 1)) / 2)


@runtime_checkable
class HistoryLaw(ElasticConstants, Protocol):
    """A law of the stress with internal variables; see `hencky.Hencky`.

    A subclass of `forms.hencky.Isotropic` has the elastic constants. `symmetric`, where a law has
    that and it is False, says that its stiffness is not symmetric. `differential`, where it has
    that, is its own `differential` (the function below).

    Examples
    --------
    A user's own return mapping is a class with these methods: `forms.j2.J2` is one, and
    ``tests/problem/test_history.py`` has another, scalar damage in ten lines.
    """

    def variables(self, size: int) -> Mapping[str, ArrayLike]:
        """Return the names of the variables, with their values in the reference configuration.

        Names are identifiers in ASCII that no other field of the results has.

        Parameters
        ----------
        size
            Number of components of a tensor, 4 or 6.
        """

    def respond(
        self,
        strain: NDArray[np.float64],
        variables: Mapping[str, NDArray[np.float64]],
        kind: str = "",
    ) -> Response:
        """Return the response at n points.

        Parameters
        ----------
        strain
            At the end of the step, shape (n, s).
        variables
            At its beginning, shape (n, ...).
        kind
            "tangent" or "secant": the stiffness that is asked for; empty for none.
        """


def with_stiffness(
    law: HistoryLaw,
    strain: NDArray[np.float64],
    variables: Mapping[str, NDArray[np.float64]],
    kind: str,
    found: Response,
) -> Response:
    """Return the response of a law with a stiffness, where one is asked for and it has none.

    Parameters
    ----------
    law, strain, variables, kind
        As of `HistoryLaw.respond`.
    found
        The response to these.
    """
    if not kind or found.stiffness is not None:
        return found
    n, size = strain.shape
    stiffness = np.empty((n, size, size))
    if kind == "secant":
        stiffness[:] = isotropic_stiffness(*moduli(float(law.young), float(law.poisson)), size)
    else:
        still = {name: np.zeros_like(value) for name, value in variables.items()}
        for k, unit in enumerate(np.eye(size)):
            moved = np.tile(unit, (n, 1))
            stiffness[:, :, k] = differential(law, strain, variables, moved, still).stress
    return replace(found, stiffness=stiffness)


def differential(
    law: HistoryLaw,
    strain: NDArray[np.float64],
    variables: Mapping[str, NDArray[np.float64]],
    moved: NDArray[np.float64],
    changed: Mapping[str, NDArray[np.float64]],
) -> Response:
    """Return the differential of stress and variables at the end of a step.

    Central differences, one component after the other, where the law has none of its own: the sum
    is linear in the changes, so that its transpose is made of the same numbers.

    Parameters
    ----------
    law, strain, variables
        As of `HistoryLaw.respond`.
    moved, changed
        Changes of the strain, and of the variables at the beginning, of the same shapes.
    """
    own = getattr(law, "differential", None)
    if own is not None:
        return own(strain, variables, moved, changed)  # type: ignore[no-any-return]
    n = len(strain)
    point, ways = {**variables, _STRAIN: strain}, {**changed, _STRAIN: moved}
    total = {name: np.zeros((n, value[:1].size)) for name, value in point.items()}
    for name, value in point.items():
        flat, way = value.reshape(n, -1), ways[name].reshape(n, -1)
        sizes = np.linalg.norm(flat, axis=1) if name == _STRAIN else np.abs(flat).max(initial=0.0)
        step = np.broadcast_to(np.maximum(DIFFERENCE * sizes, LEAST), n)[:, None]
        for k in np.flatnonzero(way.any(axis=0)):
            unit = step * np.eye(flat.shape[1])[k]
            up, down = (
                _end(law, point | {name: (flat + s * unit).reshape(value.shape)}) for s in (1, -1)
            )
            for part, sums in total.items():
                sums += way[:, k, None] * (up[part] - down[part]).reshape(n, -1) / (2 * step)
    ends = {name: sums.reshape(point[name].shape) for name, sums in total.items()}
    return Response(ends.pop(_STRAIN), ends)


def _end(
    law: HistoryLaw, point: Mapping[str, NDArray[np.float64]]
) -> dict[str, NDArray[np.float64]]:
    """Return variables and stress, under the name of the strain, at the end of a step."""
    found = law.respond(point[_STRAIN], {k: v for k, v in point.items() if k != _STRAIN}, "")
    return {**found.variables, _STRAIN: found.stress}


@dataclass(frozen=True)
class QuadratureLaw:
    """A law with internal variables in forms: its stress and stiffness at quadrature points.

    Attributes
    ----------
    stress, stiffness
        Functions at quadrature points, shapes (s,) and (s, s).
    """

    stress: Expr
    stiffness: Expr | None = None

    def secant_stress(self, frozen: Expr, eps: Expr) -> Expr:
        """Return the stress, linearised about a frozen strain where the strain is another one."""
        if frozen == eps or self.stiffness is None:
            return to_tensor(self.stress)
        change = to_vector(eps - frozen, self.stress.ufl_shape[0])
        return to_tensor(self.stress + ufl.dot(self.stiffness, change))
