"""One generator of all random problems, the same ones on every machine and rank."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from contact.case.file import Case, parse_case
from contact.mesh.domain import Domain
from scripts.studies.robustness.bodies import BODIES, Bodies
from scripts.studies.robustness.check import Mesh, write_msh
from scripts.studies.robustness.held import HELD
from scripts.studies.robustness.one_body import CELLS, HARD, PAIRS, PLAIN, PLASTIC, Families


@dataclass(frozen=True)
class Problem:
    """A random problem."""

    #: Its family with its number.
    name: str
    #: Its case, as drawn and read.
    tables: Mapping[str, Any]
    case: Case
    #: Mesh of the problems of several bodies, which the independent assembly takes.
    mesh: Mesh | None = None
    #: Mesh in place of that of the case.
    domain: Domain | None = None


@dataclass(frozen=True)
class Kind:
    """A kind of problems."""

    #: Of its table.
    caption: str
    families: Families
    #: The seed, which the number of the family or of the problem follows.
    key: tuple[int, ...] = ()


KINDS = {
    "plain": Kind("Problems like those of the thesis", PLAIN, (20240229,)),
    "hard": Kind("Bodies that bend, stick, stretch and harden", HARD, (20240229, 1)),
    "cells": Kind("Cells of all shapes", CELLS, (20240229, 2)),
    "bodies": Kind("Several bodies, checked by an independent assembly", BODIES, (37,)),
    "held": Kind("Bodies that friction alone holds", HELD, (11,)),
    "plastic": Kind("Evolutions of metals, checked by their energies", PLASTIC),
    "pairs": Kind("Blocks on each other", PAIRS),
}

#: Kinds whose families draw one problem after the other from one stream of random numbers.
STREAMS = ("plain", "hard", "cells")


def problems(
    kind: str,
    only: str | None = None,
    coarse: bool = False,
    seed: int | None = None,
    folder: Path | None = None,
) -> Iterator[Problem]:
    """Draw problems."""
    key = KINDS[kind].key
    if seed is not None:
        key = (seed, *key[1:])
    for number, (family, (draw, numbers)) in enumerate(KINDS[kind].families.items()):
        if only is not None and only.rsplit("-", 1)[0] != family:
            continue
        stream = np.random.default_rng([*key, number])
        for k in numbers[: len(numbers) // 10 if coarse else None]:
            name, mesh, domain = f"{family}-{k}", None, None
            wanted = only in (None, family, name)
            if kind in STREAMS:
                tables = draw(stream)
            elif not wanted:
                continue
            elif kind == "bodies":
                bodies = Bodies(np.random.default_rng([*key, number, k]))
                tables = draw(bodies.rng, bodies)
                mesh, file = bodies.mesh(), str(Path(folder or ".", "body.msh"))
                write_msh(mesh, Path(file))
                tables = {"mesh": {"file": file}, "material": bodies.materials(), **tables}
            elif kind == "held":
                tables, domain = draw(np.random.default_rng([*key, k]))
            else:
                tables = draw(np.random.default_rng([*key, k]), k)
            if wanted:
                yield Problem(name, tables, parse_case(tables, source=name), mesh, domain)
