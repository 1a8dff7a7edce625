"""Contact directions and gaps, of shapes and functions that may be a user's own."""

from __future__ import annotations

from mpi4py import MPI

from contact.calling import naming, on_all_ranks, real
from contact.errors import InputError
from contact.interface.obstacle.protocol import Obstacle, Shape
from contact.typing import Array


def measured(
    obstacle: Obstacle, points: Array, normal: Array, comm: MPI.Intracomm, key: str
) -> tuple[Array, Array]:
    """Return the contact directions, (n, d), and gaps, (n,), at points of a body. Collective.

    Parameters
    ----------
    obstacle, points, normal
        As in `Obstacle.measure`.
    comm, key
        Who asks together, and what messages call the contact.

    Raises
    ------
    InputError
        On all ranks, if the obstacle is none in this space, or a function of it fails on one.
    """
    what = f"{key}.{'foundation' if obstacle.is_shape else 'gap'}"
    if isinstance(obstacle, Shape):
        try:
            obstacle.check(points.shape[1])
        except InputError as error:
            raise InputError(f"{what}: {error}") from None
    with on_all_ranks(comm), naming(what):
        direction, gap = obstacle.measure(points, normal)
        # What is no number is refused by those who know whether it is needed.
        accepted = "a direction and a gap for each of the points"
        return real(direction, points.shape, accepted), real(gap, points.shape[:1], accepted)
