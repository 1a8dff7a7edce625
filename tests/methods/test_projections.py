"""What an iteration of the block relaxation is made of: projections and their acceleration."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from contact.interface.complementarity import project_disc, project_half_line
from contact.interface.foundation import NormalGraph
from contact.thesis.acceleration import ResidualMinimiser
from contact.thesis.uzawa import FrozenProblem, disc_derivative
from forms.laws import Compliance


@pytest.mark.core
def test_projections():
    z = np.array([[3.0, 4.0], [0.3, 0.4], [0.0, 0.0], [-6.0, 8.0]])
    assert project_disc(z, np.array([1.0, 1.0, 0.0, 0.0])) == pytest.approx(
        np.array([[0.6, 0.8], [0.3, 0.4], [0.0, 0.0], [0.0, 0.0]])
    )
    assert project_half_line(np.array([-1.0, 2.0])).tolist() == [0.0, 2.0]


@pytest.mark.core
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_the_derivative_of_the_projection_onto_a_disc(dim):
    random = np.random.default_rng(dim)
    z, radius = random.standard_normal((40, dim)), random.uniform(0, 2, 40)
    directions, h = random.standard_normal((40, dim, 5)), 1e-6
    exact = disc_derivative(z, radius, directions)
    for k in range(5):
        step = h * directions[:, :, k]
        slope = (project_disc(z + step, radius) - project_disc(z - step, radius)) / (2 * h)
        assert np.abs(exact[:, :, k] - slope).max() < 1e-6


@pytest.mark.core
@pytest.mark.parametrize("seed", range(5))
def test_the_acceleration_solves_random_complementarity_problems(seed):
    """Find p >= 0 with u = u_0 - C p <= 0, p u = 0, for a random positive definite C."""
    random = np.random.default_rng(seed)
    m, r = 60, 1.0
    basis = np.linalg.qr(random.standard_normal((m, m)))[0]
    compliance = basis @ np.diag(np.geomspace(0.02, 20, m)) @ basis.T
    u_0 = random.standard_normal(m)
    matrix = np.linalg.inv(np.eye(m) + r * compliance)

    def project(z):
        return np.maximum(z, 0.0)

    def solves(depth):
        accelerator = ResidualMinimiser(
            lambda a, b: a.T @ b, project, lambda z, d: (z > 0)[:, None] * d, depth
        )
        z = np.zeros(m)
        for count in range(1, 2000):
            force = project(z)
            q = 2 * force - z
            u = matrix @ (u_0 - compliance @ q)
            p = q + r * u
            if np.linalg.norm(p - project(p + r * u)) < 1e-9:
                return count, p
            image = force + r * u
            z = accelerator.next(p, p + r * u, image) if depth else image
        raise AssertionError("not converged")

    slow, expected = solves(0)
    for depth in (2, 10, 40):
        fast, found = solves(depth)
        assert fast < slow
        assert found == pytest.approx(expected, abs=1e-7)
    assert fast <= 60


@pytest.mark.core
@pytest.mark.parametrize("nodes", [0, 3])
@pytest.mark.parametrize("layer", [False, True])
def test_several_points_are_projected_as_one_after_the_other(nodes, layer):
    """Ranks without contact nodes too."""
    rng = np.random.default_rng(1)
    gap = np.full(nodes, 0.5)
    law = NormalGraph(Compliance(2.0), np.ones(nodes), 0 * gap, gap) if layer else None
    frozen = SimpleNamespace(
        layer=law, r=3.0, origin=np.zeros((nodes, 3)), interface=SimpleNamespace(gap=gap)
    )  # fmt: skip
    project = partial(FrozenProblem.project, frozen, bound=np.full(nodes, 0.4))
    points = rng.normal(size=(5, nodes, 3))
    found = project(points)
    assert found.shape == points.shape
    for point, one in zip(points, found, strict=True):
        assert np.array_equal(project(point), one)
    assert nodes == 0 or (found[..., 0] > 0).any()
