"""Parts of input files and their instances in an assembly, as one set of nodes and elements.

Each instance is a copy of its part in its place, with numbers of its own, so that the nodes of
instances that touch stay apart.

References
----------
Abaqus Keywords Guide, *ASSEMBLY, *PART and *INSTANCE; CalculiX knows none of them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from contact.typing import Array

#: A number, or the name of a set.
Member = int | str

#: Numbers of nodes and elements have 32 bits: an instance's begin at a multiple of this one.
STRIDE = 1 << 32

#: Keywords that begin or end a part or an instance.
NESTING = {"PART", "END PART", "INSTANCE", "END INSTANCE"}

#: The data lines of an instance.
PLACE = "accepted: a line of its translation, then one of two points of an axis and an angle"


def real(value: str) -> float:
    """Return a number, which may have Fortran's exponent, 0 for none."""
    try:
        return float(value or 0)
    except ValueError:
        return float(re.sub(r"[Dd](?=[+-]?\d+$)", "E", value))


@dataclass
class Scope:
    """Nodes, elements, sets and surfaces by number and by name, of a part or of the assembly.

    A name of an instance stands behind that of the instance; ``names`` has both as they were
    given, and ``instances`` that which is added to the numbers of each.
    """

    points: dict[int, list[float]] = field(default_factory=dict)
    elements: dict[str, list[int]] = field(default_factory=dict)
    nodes: dict[str, list[Member]] = field(default_factory=dict)
    nodes_of: dict[str, list[str]] = field(default_factory=dict)
    sets: dict[str, list[Member]] = field(default_factory=dict)
    surfaces: dict[str, tuple[str, list[tuple[Member, str]]]] = field(default_factory=dict)
    names: dict[str, tuple[str, str]] = field(default_factory=dict)
    instances: dict[str, int] = field(default_factory=dict)
    other: list[str] = field(default_factory=list)

    def put(self, number: int, point: list[float]) -> None:
        """Add a node, which may stand there already."""
        if self.points.setdefault(number, point) != point and not np.isnan(point).any():
            raise ValueError(f"*NODE: node {number % STRIDE} is at two places; accepted: one")

    def name(self, given: str, instance: str = "") -> str:
        """Return the key of a name, of an instance where one is given: capitals do not matter."""
        home, own = self._home(given, instance)
        key = f"{home}.{own}".upper() if home else own.upper()
        self.names.setdefault(key, (home, own))
        return key

    def member(self, given: str, instance: str = "") -> Member:
        """Return the number that a word stands for, or the key of a set."""
        # Most are plain numbers, and files have millions of them.
        home, own = ("", given) if given.isdigit() and not instance else self._home(given, instance)
        if not own.lstrip("+-").isdigit():
            return self.name(given, instance)
        return int(own) + self.instances[home.upper()] if home else int(own)

    def number(self, given: str, instance: str = "") -> int:
        """Return the number that a word stands for."""
        member = self.member(given, instance)
        if isinstance(member, str):
            raise ValueError(f"{given!r} where a number belongs")
        return member

    def said(self, member: Member) -> Member:
        """Return a member as it was given."""
        return member % STRIDE if isinstance(member, int) else self.names[member][1]

    def shown(self) -> dict[str, str]:
        """Return the names by key: those of instances behind them where others have them."""
        count = Counter(own.upper() for _, own in self.names.values())
        found = {}
        for key, (home, own) in self.names.items():
            alone = not home or count[own.upper()] == 1
            found[key] = own if alone else f"{home}.{own}"
        return found

    def place(self, part: Scope, instance: str, motion: Motion) -> None:
        """Add a part in its place, by the numbers and names of an instance."""
        shift, before = self.instances[instance.upper()], f"{instance.upper()}."

        def own(member: Member) -> Member:
            return before + member if isinstance(member, str) else member + shift

        for number, point in zip(part.points, motion(part.points), strict=True):
            self.put(number + shift, point)
        for kind, values in part.elements.items():
            self.elements.setdefault(kind, []).extend(value + shift for value in values)
        for into, given in ((self.nodes, part.nodes), (self.sets, part.sets)):
            for key, members in given.items():
                into.setdefault(before + key, []).extend(map(own, members))
        for key, sets in part.nodes_of.items():
            self.nodes_of.setdefault(before + key, []).extend(before + name for name in sets)
        for key, (kind, rows) in part.surfaces.items():
            faces = self.surfaces.setdefault(before + key, (kind, []))[1]
            faces.extend((own(member), label) for member, label in rows)
        for key, (_, word) in part.names.items():
            self.names.setdefault(before + key, (instance, word))
        self.other += [word for word in part.other if word not in self.other]

    def _home(self, given: str, instance: str) -> tuple[str, str]:
        """Return the instance to which a name or a number belongs, "" for none, and its own."""
        before, _, own = (word.strip('"') for word in given.strip().rpartition("."))
        if before.upper() in self.instances:
            return before, own
        home = instance.strip('"')
        if home and home.upper() not in self.instances:
            raise ValueError(f"there is no instance {home}; accepted: those that have ended above")
        return home, given.strip().strip('"')


@dataclass(frozen=True)
class Motion:
    """A translation, and behind it a rotation about an axis of the assembly."""

    shift: Array
    start: Array
    turn: Array

    @classmethod
    def of(cls, instance: str, lines: Sequence[Sequence[str]]) -> Motion:
        """Return the motion of an instance by its data lines."""
        rows = [[real(value) for value in line] for line in lines]
        shift, about = (*rows, [], [])[:2]
        axis = np.array(about[3:6]) - about[:3] if len(about) == 7 else np.zeros(3)
        length = float(np.linalg.norm(axis))
        known = len(rows) <= 2 and len(shift) <= 3 and len(about) in (0, 7)
        if not known or not np.isfinite([*shift, *about]).all() or bool(about) != (length > 0):
            given = "; ".join(", ".join(line) for line in lines)
            raise ValueError(f"*INSTANCE, NAME={instance}: given {given}; {PLACE}")
        turn = Rotation.from_rotvec(about[6] / length * axis if about else axis, degrees=True)
        moved, start = (np.array([*row, 0.0, 0.0, 0.0][:3]) for row in (shift, about))
        return cls(moved, start, turn.as_matrix())

    def __call__(self, points: Mapping[int, list[float]]) -> list[list[float]]:
        """Return the places of points."""
        x = np.array([*points.values()]).reshape(-1, 3) + self.shift - self.start
        with np.errstate(invalid="ignore"):  # infinite ones are refused with all others
            return [[*map(float, row)] for row in x @ self.turn.T + self.start]


@dataclass
class Assembly:
    """The parts of a file and their assembly, and the scope of the next keyword in it.

    A part or an instance ends where its END stands, the next one begins, or the file ends.
    """

    whole: Scope = field(default_factory=Scope)
    parts: dict[str, Scope] = field(default_factory=dict)
    here: Scope = field(init=False)
    _unused: dict[str, str] = field(default_factory=dict)
    _placed: tuple[str, str, Motion] | None = None

    def __post_init__(self) -> None:
        """Begin outside of parts."""
        self.here = self.whole

    def nest(
        self, keyword: str, options: Mapping[str, str], lines: Sequence[Sequence[str]]
    ) -> None:
        """Begin or end a part or an instance."""
        self._end()
        if keyword.startswith("END"):
            return
        name = options["NAME"].strip('"')
        if name.upper() in (self.parts if keyword == "PART" else self.whole.instances):
            raise ValueError(f"*{keyword}, NAME={name}: it is there twice; accepted: once")
        self.here = Scope()
        if keyword == "PART":
            self.parts[name.upper()] = self.here
            self._unused[name.upper()] = name
        else:
            part = options["PART"].strip('"')
            if part.upper() not in self.parts:
                word = f"*INSTANCE, NAME={name}: there is no part {part!r}"
                raise ValueError(f"{word}; accepted: those that stand above it")
            self._placed = name, part.upper(), Motion.of(name, lines)

    def flat(self) -> Scope:
        """Return the assembly; parts without an instance are left out."""
        self._end()
        unused = (f"PART, NAME={name} without an instance" for name in self._unused.values())
        self.whole.other[:0] = unused
        return self.whole

    def _end(self) -> None:
        """Place the instance that ends here, if one does."""
        if self._placed is not None:
            name, part, motion = self._placed
            self.whole.instances[name.upper()] = STRIDE * (len(self.whole.instances) + 1)
            self._unused.pop(part, None)
            for own in (self.parts[part], self.here):
                self.whole.place(own, name, motion)
        self._placed, self.here = None, self.whole
