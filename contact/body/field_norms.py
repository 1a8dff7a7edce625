"""The sizes of forces and charges, apart: they have no common unit."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from contact.typing import Array


class Fields(Protocol):
    """Unknowns of which some are displacements, and the others potentials."""

    @property
    def dim(self) -> int:
        """Number of displacement components of a node."""

    @property
    def block_size(self) -> int:
        """Number of unknowns of a node."""

    @property
    def mechanical(self) -> NDArray[np.bool_]:
        """Which of owned values are displacements or forces."""

    def norm(self, values: Array) -> float:
        """Return the Euclidean norm of owned values. Collective."""


def of_fields(fields: Fields, sizes: Array) -> Array:
    """Return for each owned value the size of its field."""
    return np.where(fields.mechanical, sizes[0], sizes[-1])


def field_norms(fields: Fields, values: Array) -> Array:
    """Return the norms of forces and, where there is a potential, of charges. Collective.

    Returns
    -------
    Shape (1,) or (2,): of the mechanical field, and of the electric one.
    """
    if fields.block_size == fields.dim:
        return np.array([fields.norm(values)])
    chosen = fields.mechanical
    return np.array([fields.norm(np.where(part, values, 0.0)) for part in (chosen, ~chosen)])
