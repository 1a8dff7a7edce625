"""One generator of all random problems, the same ones on every machine and rank."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from contact.case.file import Case, parse_case
from scripts.studies.robustness.bodies import BODIES, Bodies
from scripts.studies.robustness.check import Mesh, write_msh
from scripts.studies.robustness.one_body import CELLS, HARD, PLAIN, Families


@dataclass(frozen=True)
class Problem:
    """A random problem.

    Attributes
    ----------
    family, name
        Its family, and the same with its number.
    tables, case
        Its case, as drawn and read.
    mesh
        Mesh of the problems of several bodies, which the independent assembly takes.
    """

    family: str
    name: str
    tables: Mapping[str, Any]
    case: Case
    mesh: Mesh | None = None


#: Kind -> its families, and the seed, which the number of the family follows.
KINDS: dict[str, tuple[Families, tuple[int, ...]]] = {
    "plain": (PLAIN, (20240229,)),
    "hard": (HARD, (20240229, 1)),
    "cells": (CELLS, (20240229, 2)),
    "bodies": (BODIES, (37,)),
}


def problems(
    kind: str,
    only: str | None = None,
    coarse: bool = False,
    seed: int | None = None,
    folder: Path | None = None,
) -> Iterator[Problem]:
    """Draw problems."""
    families, (usual, *more) = KINDS[kind]
    for number, (family, (draw, count)) in enumerate(families.items()):
        if only is not None and only.rsplit("-", 1)[0] != family:
            continue
        key = [usual if seed is None else seed, *more, number]
        rng, mesh = np.random.default_rng(key), None
        for k in range(count // 10 if coarse else count):
            name, bodies = f"{family}-{k}", None
            wanted = only in (None, family, name)
            if kind == "bodies":
                if not wanted:
                    continue
                bodies = Bodies(np.random.default_rng([*key, k]))
                tables = draw(bodies.rng, bodies)
                mesh, file = bodies.mesh(), str(Path(folder or ".", "body.msh"))
                write_msh(mesh, Path(file))
                tables = {"mesh": {"file": file}, "material": bodies.materials(), **tables}
            else:
                tables = draw(rng)
            if wanted:
                yield Problem(family, name, tables, parse_case(tables, source=name), mesh)
