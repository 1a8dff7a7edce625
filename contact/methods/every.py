"""All methods by their names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from contact.methods.fixed_point import FixedPoint
from contact.methods.method import Method
from contact.methods.newton import Newton
from contact.methods.penalty import Penalty
from contact.methods.report import Monitor
from contact.problem.problem import ContactProblem

#: Name of a method -> its class.
METHODS: Mapping[str, Callable[[ContactProblem, Any, Monitor | None], Method]] = {
    "uzawa": FixedPoint,
    "penalty": Penalty,
    "newton": Newton,
}
