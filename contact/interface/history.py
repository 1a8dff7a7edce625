"""What friction remembers between the steps of an evolution.

Friction acts against what has slipped since the end of the last step, and a coefficient
mu(slip) looks at all that has slipped so far. A static problem is one step from rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from contact.history import CONTACT_NODES
from contact.interface.jump import Jump
from contact.typing import Array


@dataclass(frozen=True)
class SlipHistory:
    """The tangential jump at the end of the last step, and the way that it has gone.

    Its arrays are not to be written to (they are marked so). Open nodes have them too: one that
    touches again slips from where it was at the end of the last step.

    Attributes
    ----------
    jump
        j_tau at the end of the last step, tangential vectors, shape (n, d) (length).
    accumulated
        Sum of |Delta j_tau| over all steps, shape (n,) (length).
    """

    jump: Array
    accumulated: Array

    def __post_init__(self) -> None:
        """Keep whoever holds it from changing it."""
        self.jump.flags.writeable = self.accumulated.flags.writeable = False

    @staticmethod
    def rest(jump: Jump) -> SlipHistory:
        """Return that of a body that has never slipped."""
        return SlipHistory(np.zeros(jump.normal.shape), np.zeros(jump.gap.size))

    @property
    def place(self) -> str:
        """Its arrays live at the contact nodes."""
        return CONTACT_NODES

    @property
    def arrays(self) -> Mapping[str, Array]:
        """Both arrays by name."""
        return {"jump": self.jump, "accumulated": self.accumulated}

    def replaced(self, arrays: Mapping[str, Array]) -> SlipHistory:
        """Return a slip history with other arrays."""
        return SlipHistory(arrays["jump"], arrays["accumulated"])
