"""Kinematics: small strains, the deviator, and the normal/tangential split.

Strains are 3 x 3 tensors in 3-D, in plane strain, and of a body of revolution, of which the half
plane is meshed. A `Kinematics` has the gradient of a displacement, and the extent 2 pi r of a ring.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Protocol

import ufl
from ufl.core.expr import Expr
from ufl.domain import extract_unique_domain


class Strained(Protocol):
    """The gradient of a displacement, whose symmetric part is the strain."""

    def gradient(self, u: Expr) -> Expr:
        """Return the displacement gradient, a 3 x 3 tensor."""


class Kinematics(Strained, Protocol):
    """The kinematics of a body by its mesh."""

    @property
    def added_degree(self) -> int:
        """The degree of the extent, added to that of a quadrature rule."""

    def extent(self, x: Expr) -> Expr | None:
        """Return the size of the body by unit of the mesh; None for 1."""

    def mean_gradient(self, u: Expr, centroid: Expr | None = None) -> Expr:
        """Return the mean of the gradient of a quadratic u over a cell, a straight simplex.

        Parameters
        ----------
        u
            The displacement.
        centroid
            The centroid of the cell; None where the gradient is evaluated there.
        """


@dataclass(frozen=True)
class Cartesian:
    """A body in 3-D, or a plane one in plane strain, of thickness 1."""

    added_degree = 0

    def gradient(self, u: Expr) -> Expr:
        """Return grad u, in the plane with zeros in the third row and column."""
        return embed(ufl.grad(u))

    def extent(self, x: Expr) -> None:
        """Return None: the mesh is the body."""
        return None

    def mean_gradient(self, u: Expr, centroid: Expr | None = None) -> Expr:
        """Return grad u at the centroid, by Taylor's formula: it is linear in the cell."""
        grad = ufl.grad(u)
        return embed(grad if centroid is None else grad + _directed(grad, _way(u, centroid)))


@dataclass(frozen=True)
class Axisymmetric:
    """A body of revolution without torsion: x is r, y is z, and the third axis that of theta.

    Parameters
    ----------
    on_axis
        True for points on the axis too, with the limit u_r,r of u_r/r. The points of a quadrature
        rule lie inside the cells.
    """

    on_axis: bool = False

    added_degree = 1

    def gradient(self, u: Expr) -> Expr:
        """Return the gradient in cylindrical coordinates: eps_theta = u_r/r."""
        grad, r = ufl.grad(u), ufl.SpatialCoordinate(extract_unique_domain(u))[0]
        hoop = u[0] / r
        if self.on_axis:
            # Rounding may put points a little beside the axis.
            jacobian = ufl.Jacobian(extract_unique_domain(u))
            rounding_length = 1e-9 * ufl.sqrt(ufl.inner(jacobian, jacobian))
            hoop = ufl.conditional(ufl.gt(r, rounding_length), hoop, grad[0, 0])
        return embed(grad, hoop)

    def extent(self, x: Expr) -> Expr:
        """Return 2 pi r, the length of the ring through a point of the half plane."""
        return 2 * ufl.pi * x[0]

    def mean_gradient(self, u: Expr, centroid: Expr | None = None) -> Expr:
        """Return the mean over the ring: that of r times the gradient, over that of r.

        r grad u and u_r are quadratic in the triangle: their means are their values at the
        centroid, and their second derivatives times half of the triangle's second moments.
        """
        mesh = extract_unique_domain(u)
        r, jacobian = ufl.SpatialCoordinate(mesh)[0], ufl.Jacobian(mesh)
        moments = jacobian * ufl.as_matrix([[2, -1], [-1, 2]]) / 36 * ufl.transpose(jacobian)
        weighted = embed(r * ufl.grad(u), u[0])
        i, j, k, m = ufl.indices(4)
        second = ufl.grad(ufl.grad(weighted))
        if centroid is not None:
            way = _way(u, centroid)
            moments, r = moments + ufl.outer(way, way), centroid[0]
            weighted += _directed(weighted, way)
        return (weighted + ufl.as_tensor(second[i, j, k, m] * moments[k, m] / 2, (i, j))) / r


@dataclass(frozen=True)
class Isochoric:
    """The deviator of another kinematics: strains are dev eps."""

    base: Strained

    def gradient(self, u: Expr) -> Expr:
        """Return the deviator of the displacement gradient."""
        return ufl.dev(self.base.gradient(u))


@dataclass(frozen=True)
class CellMean:
    """The mean of another kinematics over each cell, evaluated at its centroid."""

    base: Kinematics

    def gradient(self, u: Expr) -> Expr:
        """Return the mean of the displacement gradient."""
        return self.base.mean_gradient(u)


@dataclass(frozen=True)
class MeanDilatation:
    """Another kinematics with the mean volumetric strain of each cell, against locking.

    eps_bar = dev eps + (1/3) mean(tr eps) I (Nagtegaal, Parks and Rice, CMAME 4, 1974; the B-bar
    method of Hughes, IJNME 15, 1980): with quadratic displacements on straight simplices P2-P0 with
    the pressure condensed.

    Parameters
    ----------
    base
        The kinematics without the mean.
    centroid
        The centroid of the cell, a vector that is constant in it.
    """

    base: Kinematics
    centroid: Expr

    def gradient(self, u: Expr) -> Expr:
        """Return the displacement gradient with the mean of its trace."""
        gradient, mean = self.base.gradient(u), self.base.mean_gradient(u, self.centroid)
        return gradient + ufl.tr(mean - gradient) / 3 * ufl.Identity(3)


@dataclass(frozen=True)
class MultilinearMean:
    """The same on quadrilaterals and hexahedra of degree 1: Q1-P0 with the pressure condensed.

    The mean of tr grad u is a sum of weights times the displacements of the corners, each a Taylor
    sum over sets of axes of the cell: derivatives of u along the set's axes times the distances to
    the corner. Jacobian and moments are functions, for UFL cannot differentiate its own Jacobian.

    Parameters
    ----------
    base
        The kinematics without the mean.
    jacobian
        The derivatives of x by the coordinates of the reference cell.
    moments
        The sum over the corners of weights times ways from the point, a row for each set of
        `axes_of`.
    """

    base: Kinematics
    jacobian: Expr
    moments: Expr

    def gradient(self, u: Expr) -> Expr:
        """Return the displacement gradient with the mean of its trace."""
        gradient, dim = self.base.gradient(u), self.moments.ufl_shape[1]
        derivatives: dict[tuple[int, ...], Expr] = {(): u}
        mean = 0
        for row, axes in enumerate(axes_of(dim)):
            if axes:
                slope = ufl.as_vector([self.jacobian[i, axes[-1]] for i in range(dim)])
                derivatives[axes] = ufl.dot(ufl.grad(derivatives[axes[:-1]]), slope)
            mean += sum(self.moments[row, i] * derivatives[axes][i] for i in range(dim))
        return gradient + (mean - ufl.tr(gradient)) / 3 * ufl.Identity(3)


def axes_of(dim: int) -> list[tuple[int, ...]]:
    """Return all sets of axes, each behind those that are parts of it."""
    return [axes for size in range(dim + 1) for axes in combinations(range(dim), size)]


def _way(u: Expr, centroid: Expr) -> Expr:
    """Return the vector from the point of evaluation to the centroid of its cell."""
    return centroid - ufl.SpatialCoordinate(extract_unique_domain(u))


def _directed(tensor: Expr, way: Expr) -> Expr:
    """Return the derivative of a tensor along a vector."""
    i, j, k = ufl.indices(3)
    return ufl.as_tensor(ufl.grad(tensor)[i, j, k] * way[k], (i, j))


#: The kinematics of a mesh that is the body.
CARTESIAN = Cartesian()


def strain(u: Expr, kinematics: Strained = CARTESIAN) -> Expr:
    """Return the linearised strain eps(u) = (grad u + grad u^T)/2, a 3 x 3 tensor."""
    return ufl.sym(kinematics.gradient(u))


def embed(tensor: Expr, out_of_plane: Expr | float = 0.0) -> Expr:
    """Return a plane tensor as a 3 x 3 tensor; a 3 x 3 tensor is returned as it is.

    Parameters
    ----------
    tensor
        A 2 x 2 or 3 x 3 tensor.
    out_of_plane
        The component 33: 0 for a body in plane strain, u_r/r for one of revolution.
    """
    if tensor.ufl_shape == (3, 3):
        return tensor
    t = tensor
    return ufl.as_tensor(
        [[t[0, 0], t[0, 1], 0.0], [t[1, 0], t[1, 1], 0.0], [0.0, 0.0, out_of_plane]]
    )


def deviator_squared(eps: Expr) -> Expr:
    """Return |dev eps|^2 = eps : eps - (tr eps)^2 / 3, equation (7.12).

    dev eps = eps - (tr eps / 3) I with 1/3 in plane strain too, where (1.10) has 1/d: the body is
    three-dimensional with eps_zz = 0.
    """
    return ufl.inner(eps, eps) - ufl.tr(eps) ** 2 / 3


def normal_part(u: Expr, nu: Expr) -> Expr:
    """Return u_nu = u . nu."""
    return ufl.dot(u, nu)


def tangential_part(u: Expr, nu: Expr) -> Expr:
    """Return u_tau = u - u_nu nu."""
    return u - ufl.dot(u, nu) * nu


def von_mises(sigma: Expr) -> Expr:
    """Return the von Mises stress sqrt(3/2) |dev sigma| of a 3 x 3 stress tensor."""
    s = ufl.dev(sigma)
    return ufl.sqrt(1.5 * ufl.inner(s, s))


def principal_values(sigma: Expr) -> Expr:
    """Return the eigenvalues of a symmetric 3 x 3 tensor, the largest first.

    By the angle of Lode, Smith, Comm. ACM 4 (1961) 168; equal ones are off by the root of rounding.
    """
    s = ufl.dev(sigma)
    size = ufl.sqrt(ufl.inner(s, s) / 6)
    # Its cube would vanish before it does.
    unit = s / ufl.max_value(size, 1e-150)
    cosine = ufl.max_value(ufl.min_value(ufl.det(unit) / 2, 1.0), -1.0)
    angle, mean = ufl.acos(cosine) / 3, ufl.tr(sigma) / 3
    turns = (0.0, -2 * ufl.pi / 3, 2 * ufl.pi / 3)
    return ufl.as_vector([mean + 2 * size * ufl.cos(angle + turn) for turn in turns])
