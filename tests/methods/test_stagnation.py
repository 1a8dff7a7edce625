"""When a loop that gets no further is given up."""

from __future__ import annotations

import pytest

from contact.methods.stagnation import Stagnation


@pytest.mark.parametrize(("rate", "given_up"), [(0.4, False), (0.8, False), (0.95, True)])
def test_steps_together_make_progress_where_they_halve_the_measure_in_time(rate, given_up):
    stagnation = Stagnation(patience=8, progress=0.5, together=True)
    assert any(stagnation(rate**step) for step in range(40)) == given_up


def test_each_step_by_itself_is_compared_with_the_best_one():
    stagnation = Stagnation(patience=8, progress=0.5)
    assert [stagnation(0.8**step) for step in range(10)] == 8 * [False] + 2 * [True]


def test_what_rises_again_is_compared_with_the_last_progress():
    stagnation = Stagnation(patience=3, progress=0.5, together=True)
    assert [stagnation(at) for at in (1.0, 0.6, 0.9, 0.45, 0.6, 0.5, 0.3)] == 6 * [False] + [True]
    assert stagnation.best == 0.3
