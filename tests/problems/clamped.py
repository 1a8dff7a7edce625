"""Rectangles that are clamped at their left side, above a foundation along their bottom."""

from typing import Any


def clamped(size: list[float], cells: list[int], **tables: Any) -> dict[str, Any]:
    """Return the tables of a case of E = 1 and nu = 0.3; those that are given replace its own."""
    return {
        "mesh": {"generator": "rectangle", "size": size, "cells": cells},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0]}],
        "contact": {"on": "bottom"},
        **tables,
    }
