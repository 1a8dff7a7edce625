"""What is no layer is refused, and what is unusual of one is said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

from contact import InputError
from contact import solve as solve_case
from contact.methods.options import OPTIONS, NewtonOptions
from contact.model.foundation import Layer
from contact.problem.problem import ContactProblem
from forms.laws import (
    Compliance,
    PotentialFactor,
)
from forms.ops import positive_part
from tests.problems.compliance import LayerColumn
from tests.problems.mechanics import leaning_block


@dataclass(frozen=True)
class Made:
    """A law made of two functions."""

    value: Callable[[np.ndarray], np.ndarray]
    slope: Callable[[np.ndarray], np.ndarray]

    def __call__(self, s):
        return self.value(s)

    def derivative(self, s):
        return self.slope(s)


ONE, ZERO = (lambda s: 1.0 + 0 * s), (lambda s: 0 * s)
NO_LAYERS = [
    Layer(0.2, Made(lambda s: 0.01 + positive_part(s), ONE), Made(ONE, ZERO)),
    Layer(0.2, Made(lambda s: -positive_part(s), ONE), Made(ONE, ZERO)),
    Layer(0.2, Made(np.sqrt, ONE), Made(ONE, ZERO)),
    Layer(0.2, Compliance(0.1), PotentialFactor(-1.0)),
    Layer(0.2, Compliance(0.1), Made(lambda s: 1 / s, ZERO)),
    Layer(0.2, positive_part, Made(ONE, ZERO)),
    Layer(-0.1, Compliance(0.1), PotentialFactor(1.0)),
    Layer(np.nan, Compliance(0.1), PotentialFactor(1.0)),
]


@pytest.mark.parametrize("layer", NO_LAYERS)
def test_what_is_no_layer_is_refused(layer):
    bare = leaning_block(MPI.COMM_SELF, 2)
    contact = bare.contacts[0].model_copy(update={"layer": layer})
    with pytest.raises(InputError, match=r"\[layer-law\]"):
        ContactProblem(bare.domain, bare.description, contact)


def hump(s):
    return positive_part(s) * np.exp(-positive_part(s) / 0.05)


def hump_slope(s):
    return np.where(s > 0, (1 - s / 0.05) * np.exp(-positive_part(s) / 0.05), 0.0)


@pytest.mark.parametrize("method", ["uzawa", "newton", "penalty"])
def test_falling_law_is_solved_with_a_warning(method):
    column = LayerColumn(0.3, p_nu=Made(hump, hump_slope))
    solution = solve_case(column.problem(), OPTIONS[method](tolerance=1e-10))
    assert solution.converged, solution.outcome
    assert any("p_nu falls" in warning for warning in solution.warnings)
    assert np.allclose(solution.normal_displacement, column.solution()[0], rtol=0, atol=1e-8)


def test_layer_thicker_than_the_gap_presses_at_rest():
    column = LayerColumn(0.0, touch=-0.1, gap=0.05)
    solution = solve_case(column.problem(), NewtonOptions(tolerance=1e-11))
    assert solution.converged
    u_n, _, layer, _, _ = column.solution()
    assert layer > 1.0
    assert np.allclose(solution.normal_displacement, u_n, rtol=0, atol=1e-10)
    assert not any("p_nu" in warning for warning in solution.warnings)
