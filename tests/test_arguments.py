"""What functions of a user may return."""

import numpy as np
import pytest

from contact.arguments import naming, real
from contact.errors import InputError


@pytest.mark.core
@pytest.mark.parametrize(
    "values",
    [
        np.array([1.0, 2.0]),
        np.ma.masked_array([1.0, 2.0], mask=[False, True]),
        np.array([1.0, 2.0]).view(np.recarray),
        np.array([1.0, 2.0], dtype=np.float32),
        [1, 2],
    ],
)
def test_what_is_returned_becomes_a_plain_array_of_its_own(values):
    """Masked arrays and matrices have products of their own, and hide what is no number."""
    found = real(values, (2,), "one number for each node")
    assert type(found) is np.ndarray
    assert found.dtype == float
    assert found.tolist() == [1.0, 2.0]
    assert not np.shares_memory(found, values)


@pytest.mark.core
def test_what_is_no_number_for_each_is_named():
    with (
        pytest.raises(InputError, match=r"\[own-function\]"),
        naming("mu"),
    ):
        real(np.zeros(3), (2,), "one number")
