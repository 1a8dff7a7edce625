"""The operators of a whole body: with global unknowns, and after a change of unknowns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from contact.body.masters import Masters
from contact.history import Evaluated
from contact.linear.bordered import BorderedBulk, BorderedOperator
from contact.linear.change import Change, ChangedBulk, ChangedOperator
from contact.linear.operator import Bulk, SparseOperator
from contact.typing import Array

#: An operator of all unknowns of a body.
WholeOperator: TypeAlias = SparseOperator | BorderedOperator | ChangedOperator


def make_operator(
    body: Bulk,
    rest: Evaluated,
    masters: Masters,
    blocks: tuple[NDArray[np.int32], Array | None, Change | None],
    options: Mapping[str, Any],
) -> WholeOperator:
    """Return the operator of a body with blocks at nodes. Collective.

    Parameters
    ----------
    body, rest, masters
        The body, its unknowns at rest, and its global unknowns.
    blocks
        Contact nodes, then others that have blocks; how the foundation moves at the former, shape
        (n, block size, m); and the change of unknowns after which blocks are those of nodes.
    options
        Of `SparseOperator`.
    """
    nodes, motion, change = blocks
    changed = None if change is None else ChangedBulk(body, change, rest)
    bulk = body if changed is None else changed
    inner: SparseOperator | BorderedOperator
    if masters.size == 0:
        inner = SparseOperator(bulk, nodes, **options)
    else:
        motions = masters.ties
        if motion is not None:
            size = body.layout.block_size
            dofs = nodes[: motion.shape[0], None] * size + np.arange(size)
            motions = masters.with_foundations(dofs, motion)
        inner = BorderedOperator(BorderedBulk(bulk, motions, masters.free), nodes, **options)
    return inner if changed is None else ChangedOperator(changed, inner)
