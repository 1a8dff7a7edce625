"""Types that all packages share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Real values; docstrings give the shape.
Array = NDArray[np.float64]
