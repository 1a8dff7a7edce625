"""Types that all packages share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

#: Real values; docstrings give the shape.
Array = NDArray[np.float64]

#: A value of the case file; the entries of lists and tables are such values.
TableValue: TypeAlias = str | float | Sequence[object] | Mapping[str, object]
