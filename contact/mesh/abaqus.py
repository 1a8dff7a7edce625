"""Input files of Abaqus and CalculiX: nodes, elements, sets, surfaces, and assemblies of parts.

meshio's reader drops surfaces and assemblies. A set of elements is a region, or a part if they lie
on the boundary; a set of nodes is a part, the facets all of whose nodes it has; a surface is one.
Each instance is a copy of its part in its place, with numbers of its own, so that the nodes of
instances that touch stay apart.

References
----------
CalculiX CrunchiX USER'S MANUAL, *NODE, *ELEMENT, *NSET, *ELSET, *SURFACE (numbers of faces), and
chapter 6.2 (elements). Abaqus Keywords Guide, *ASSEMBLY, *PART and *INSTANCE, which CalculiX lacks.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from contact.mesh.cells import FACES, joined_facets, single_facets, unique_rows
from contact.mesh.contents import ELEMENTS, Contents, Ints, Kind, decoded
from contact.mesh.entities import places_of
from contact.typing import Array

#: Types of elements: beginnings of their names, and their dimension.
TYPES = (
    (re.compile(r"(?:(?:AC|D|F)?C3D|SC|CSS)(\d+)"), 3),
    (re.compile(r"(?:AC|D)?(?:CPS|CPE|CPEG|CAX|CGAX|C2D|MAX|M3D|S|DS|R3D|SFM3D|STRI)(\d+)"), 2),
    (re.compile(r"(?:T2D|T3D|B2|B3|R2D|RAX|SAX|F2D)(\d)"), 1),
)

#: Commas that are not within quotation marks.
COMMA = re.compile(r',(?=(?:[^"]*"[^"]*")*[^"]*$)')

#: Elements between nodes that are no part of a mesh.
NO_CELLS = re.compile(r"MASS|ROTARYI|SPRIN|DASHPOT|CONN|GAP|DCOUP|USER|U\d")

#: Beginnings of the names of plane elements, and the kinematics for which they are made.
KINEMATICS = {"CPS": "plane_stress", "CPE": "plane_strain", "CAX": "axisymmetric"}
KINEMATICS["CGAX"] = KINEMATICS["CAX"]

#: Either side of a shell, which is a facet of solids as a whole.
SIDES = {"", "S1", "S2", "SPOS", "SNEG"}

#: Keywords that make or move nodes and elements which do not stand in the file.
MAKING = {"SYSTEM", "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "IMPORT"}
MAKING |= {"SYMMETRIC MODEL GENERATION"}

#: Keywords whose data lines may stand in a file of their own, by INPUT.
FROM_FILES = {"NODE", "ELEMENT"}

#: Keywords that begin or end a part or an instance; one ends where the next begins, too.
NESTING = {"PART", "END PART", "INSTANCE", "END INSTANCE"}

#: Numbers of nodes and elements have 32 bits: an instance's begin at a multiple of this one.
STRIDE = 1 << 32

#: A number, or the key of a set.
Member: TypeAlias = int | str

#: A keyword, its options, and its data lines.
Block: TypeAlias = tuple[str, dict[str, str], list[str]]


def read_abaqus(file: Path) -> Contents:
    """Read an input file, and those that it includes; raise errors of any kind if it is wrong."""
    deck = Deck()
    parts: dict[str, list[Block]] = {}
    part: list[Block] | None = None
    for block in _blocks(file):
        keyword, options, lines = block
        try:
            if keyword in NESTING:
                part = None
                deck.enter("")
            if keyword == "PART":
                part = parts[options["NAME"].strip('"').upper()] = []
            elif keyword == "INSTANCE":
                deck.enter(options["NAME"].strip('"'), _motion(lines))
                for inside in parts[options["PART"].strip('"').upper()]:
                    deck.take(*inside)
            elif part is not None:
                part.append(block)
            elif keyword not in NESTING:
                deck.take(*block)
        except (KeyError, ValueError) as error:
            said = f"there is no {error}" if isinstance(error, KeyError) else error
            name = f", NAME={options['NAME']}" if "NAME" in options else ""
            raise ValueError(f"*{keyword}{name}: {said}") from error
    return _contents(deck)


def included_files(file: Path) -> list[Path]:
    """Return an input file and those that it includes, each once; a ValueError without one."""
    return [*dict.fromkeys([file, *(inner for inner, _ in _lines(file))])]


def _blocks(file: Path) -> list[Block]:
    """Return keywords with their options and data lines."""
    found: list[Block] = []
    for _, line in _lines(file):
        if line.startswith("*"):
            found.append((*_keyword(line), []))
        elif found:
            found[-1][2].append(line)
    return found


def _split(line: str) -> list[str]:
    """Return the values of a line."""
    return COMMA.split(line) if '"' in line else line.split(",")


def _row(line: str) -> list[str]:
    """Return the values of a data line, without a comma at its end."""
    return [value.strip() for value in _split(line.rstrip(","))]


def _keyword(line: str) -> tuple[str, dict[str, str]]:
    """Return the keyword of a line, and its options."""
    first, *others = _split(line[1:])
    pairs = (other.partition("=") for other in others)
    options = {key.strip().upper().replace(" ", ""): value.strip() for key, _, value in pairs}
    return " ".join(first.upper().split()), options


def _lines(file: Path) -> Iterator[tuple[Path, str]]:
    """Yield the lines without comments, those of included files in their places, with the files."""
    pending = ""
    for raw in decoded(file.read_bytes()).splitlines():
        line = pending + raw.strip()
        pending = ""
        if not line or line.startswith("**"):
            continue
        if line.startswith("*") and line.endswith(","):
            pending = line
            continue
        keyword, options = _keyword(line) if line.startswith("*") else ("", {})
        if keyword != "INCLUDE":
            yield file, line
        if keyword == "INCLUDE" or (keyword in FROM_FILES and "INPUT" in options):
            given = options.get("INPUT", "").strip('"')
            inner = file.parent / given
            if not given or not inner.is_file():
                raise ValueError(f"*{keyword}: there is no file {given!r} beside {file.name}")
            yield from _lines(inner)


def _real(value: str) -> float:
    """Return a number, which may have Fortran's exponent, 0 for none."""
    return float(value.replace("D", "E").replace("d", "e") or 0)


def _motion(lines: Sequence[str]) -> tuple[Array, Array]:
    """Return R and t of x -> R x + t: a translation, then a rotation about an axis."""
    rows = [[_real(value) for value in _row(line)] for line in lines]
    shift, about = (*rows, [], [])[:2]
    axis = np.subtract(about[3:6], about[:3]) if len(about) == 7 else np.zeros(3)
    length = float(np.linalg.norm(axis))
    known = len(rows) <= 2 and len(shift) <= 3 and len(about) in (0, 7)
    if not known or not np.isfinite([*shift, *about]).all() or bool(about) != (length > 0):
        raise ValueError(
            f"given {'; '.join(lines)}; accepted: a line of its translation, then one of two "
            "points of an axis and an angle"
        )
    turn = Rotation.from_rotvec(about[6] / length * axis if about else axis, degrees=True)
    moved, start = (np.array([*row, 0.0, 0.0, 0.0][:3]) for row in (shift, about))
    return turn.as_matrix(), turn.apply(moved - start) + start


@dataclass
class Deck:
    """Nodes, elements, sets and surfaces by number and by key: INSTANCE.NAME or NAME, capitals."""

    points: dict[int, list[float]] = field(default_factory=dict)
    elements: dict[str, list[int]] = field(default_factory=dict)
    nodes: dict[str, list[Member]] = field(default_factory=dict)
    nodes_of: dict[str, list[str]] = field(default_factory=dict)
    sets: dict[str, list[Member]] = field(default_factory=dict)
    surfaces: dict[str, tuple[str, list[tuple[Member, str]]]] = field(default_factory=dict)
    names: dict[str, tuple[str, str]] = field(default_factory=dict)  #: instance and name of keys
    instances: dict[str, int] = field(default_factory=dict)  #: offset of the numbers of each
    home: str = ""  #: instance of names and numbers without one, with `offset` and `motion`
    offset: int = 0
    motion: tuple[Array, Array] | None = None

    def enter(self, home: str, motion: tuple[Array, Array] | None = None) -> None:
        """Let the next keywords be those of a new instance, moved; of the assembly for ""."""
        self.home, self.motion = home, motion
        self.offset = STRIDE * (len(self.instances) + 1) if home else 0
        if home.upper() in self.instances:
            raise ValueError("it is there twice; accepted: once")
        if home:
            self.instances[home.upper()] = self.offset

    def take(self, keyword: str, options: Mapping[str, str], lines: Sequence[str]) -> None:
        """Take a keyword with its data."""
        if keyword in MAKING or (keyword == "NODE" and options.get("SYSTEM", "R").upper() != "R"):
            word = keyword if keyword in MAKING else f"SYSTEM={options['SYSTEM']}"
            raise ValueError(f"{word} makes or moves nodes or elements; accepted: all in the file")
        if keyword == "NODE":
            self._take_nodes(options, lines)
        elif keyword == "ELEMENT":
            self._take_elements(options, lines)
        elif keyword in ("NSET", "ELSET"):
            self._take_set(keyword, options, lines)
        elif keyword == "SURFACE":
            if "COMBINE" in options:
                raise ValueError("it is made of other surfaces; accepted: faces of elements")
            instance, kind = options.get("INSTANCE", ""), options.get("TYPE", "ELEMENT").upper()
            rows = [(*_row(line), "")[:2] for line in lines]
            faces = [(self.member(own, instance), label.upper()) for own, label in rows]
            self.surfaces.setdefault(self.key(options["NAME"]), (kind, []))[1].extend(faces)

    def _take_nodes(self, options: Mapping[str, str], lines: Sequence[str]) -> None:
        rows = [_row(line) for line in lines]
        numbers = [self.number(row[0]) for row in rows]
        points = [[_real(value) for value in [*row[1:4], "", ""][:3]] for row in rows]
        if self.motion is not None and points:
            turn, shift = self.motion
            with np.errstate(invalid="ignore"):  # infinite ones are refused with all others
                points = [[*map(float, x)] for x in np.array(points) @ turn.T + shift]
        for number, point in zip(numbers, points, strict=True):
            if self.points.setdefault(number, point) != point and not np.isnan(point).any():
                raise ValueError(f"node {number % STRIDE} is at two places; accepted: one")
        if "NSET" in options:
            self.nodes.setdefault(self.key(options["NSET"]), []).extend(numbers)

    def _take_elements(self, options: Mapping[str, str], lines: Sequence[str]) -> None:
        kind = options.get("TYPE", "").upper()
        if NO_CELLS.match(kind):
            self.sets.setdefault(self.key(options.get("ELSET", kind)), [])
            return
        count = _element_type(kind).nodes + 1
        values = [self.number(value) for line in lines for value in _row(line) if value]
        if len(values) % count:
            raise ValueError(f"TYPE={kind}: {len(values)} numbers, {count} an element")
        self.elements.setdefault(kind, []).extend(values)
        if "ELSET" in options:
            self.sets.setdefault(self.key(options["ELSET"]), []).extend(values[::count])

    def _take_set(self, keyword: str, options: Mapping[str, str], lines: Sequence[str]) -> None:
        instance, key = options.get("INSTANCE", ""), self.key(options[keyword])
        members = (self.nodes if keyword == "NSET" else self.sets).setdefault(key, [])
        if keyword == "NSET" and "ELSET" in options:
            self.nodes_of.setdefault(key, []).append(self.key(options["ELSET"], instance))
        elif "GENERATE" in options:
            for row in map(_row, lines):
                first, last = (self.number(value, instance) for value in row[:2])
                members.extend(range(first, last + 1, int((*row, "", "")[2] or 1)))
        else:
            every = (value for line in lines for value in _row(line) if value)
            members.extend(self.member(value, instance) for value in every)

    def key(self, given: str, instance: str = "") -> str:
        """Return the key of a name, of an instance where one is given: capitals do not matter."""
        home, own = self._resolve(given, instance)
        key = f"{home}.{own}".upper() if home else own.upper()
        self.names.setdefault(key, (home, own))
        return key

    def member(self, given: str, instance: str = "") -> Member:
        """Return the number that a word stands for, or the key of a set."""
        if given.isdigit() and not instance:  # most of them, millions in a file
            return int(given) + self.offset
        home, own = self._resolve(given, instance)
        if not own.lstrip("+-").isdigit():
            return self.key(given, instance)
        return int(own) + self.instances[home.upper()] if home else int(own)

    def number(self, given: str, instance: str = "") -> int:
        """Return the number that a word stands for."""
        return int(self.member(given, instance))

    def _resolve(self, given: str, instance: str) -> tuple[str, str]:
        """Return the instance of a name or a number, "" for none, and its own name or number."""
        before, _, own = (word.strip('"') for word in given.strip().rpartition("."))
        if before.upper() in self.instances:
            return before, own
        home = instance.strip('"') or self.home
        if home and home.upper() not in self.instances:
            raise KeyError(home)
        return home, given.strip().strip('"')

    def as_given(self, member: Member) -> Member:
        """Return a number or a key as it stands in the file."""
        return member % STRIDE if isinstance(member, int) else self.names[member][1]

    def names_by_key(self) -> dict[str, str]:
        """Return the names by key: those of instances behind them where others have them."""
        count = Counter(own.upper() for _, own in self.names.values())
        return {
            key: f"{home}.{own}" if home and count[own.upper()] > 1 else own
            for key, (home, own) in self.names.items()
        }


def _element_type(kind: str) -> Kind:
    """Return the shape and the number of nodes of a type of elements."""
    for pattern, dim in TYPES:
        if match := pattern.match(kind):
            count = int(match[1])
            if dim == 1:  # T3D2, RAX2, B31: nodes, or the order
                count = count if "D" in kind or kind.startswith("RAX") else count + 1
            if kind.startswith("STRI65"):
                count = 6
            for name, (of, corners, second) in ELEMENTS.items():
                if of == dim and count in (corners, *second):
                    return Kind(name, count)
    raise ValueError(f"TYPE={kind}: elements that are not known")


def _contents(found: Deck) -> Contents:
    """Return nodes, elements by block, sets and surfaces as contents of a mesh file."""
    tags = np.array(sorted(found.points), dtype=np.int64)
    points = np.array([found.points[tag] for tag in tags], dtype=float).reshape(-1, 3)
    blocks: list[tuple[str, Ints]] = []
    homes = [np.zeros((0, 3), dtype=np.int64)]
    for block, (kind, values) in enumerate(found.elements.items()):
        known = _element_type(kind)
        rows = np.array(values, dtype=np.int64).reshape(-1, known.nodes + 1)
        nodes = places_of(rows[:, 1:], tags)
        if np.any(nodes < 0):
            raise ValueError("it has elements whose nodes it does not have")
        if known == Kind("interval", 3):  # the middle one last, wherever the program has it
            middle = points[nodes].mean(axis=1, keepdims=True)
            order = np.argsort(-np.linalg.norm(points[nodes] - middle, axis=2), 1, kind="stable")
            nodes = np.take_along_axis(nodes, order, axis=1)
        blocks.append((known.name, nodes))
        places = np.arange(len(rows))
        homes.append(np.column_stack([rows[:, 0], np.full_like(places, block), places]))
    elements = np.concatenate(homes)
    if np.unique(elements[:, 0]).size < len(elements):
        raise ValueError("*ELEMENT: a number is there twice; accepted: once")
    made, names = Contents(points, blocks), found.names_by_key()
    for key, members in found.sets.items():
        made.groups[names[key]] = _by_block(_numbers(found.sets, members), elements)
    for key, sets in found.nodes_of.items():
        for block, within in _by_block(_numbers(found.sets, sets), elements).items():
            found.nodes[key] += map(int, tags[np.unique(blocks[block][1][within])])
    for key, members in found.nodes.items():
        numbers = _numbers(found.nodes, members)
        made.nodes[names[key]] = np.flatnonzero(np.isin(tags, numbers))
    dim = max((kind.dim for kind in made.kinds), default=0)
    for key, (sort, lines) in found.surfaces.items():
        name = names[key]
        if sort == "NODE":
            numbers = _numbers(found.nodes, [member for member, _ in lines])
            made.nodes[name] = np.flatnonzero(np.isin(tags, numbers))
        elif sort == "ELEMENT":
            made.surfaces[name] = _faces(found, lines, elements, blocks, dim)
    plane = [kind for kind in found.elements if dim == 2 and _element_type(kind).dim == 2]
    made_for = {own for kind in plane for of, own in KINEMATICS.items() if kind.startswith(of)}
    if len(made_for) == 1 and made_for != {"plane_strain"}:
        made.space["kinematics"] = made_for.pop()
    return made


def _numbers(sets: dict[str, list[Member]], given: Iterable[Member]) -> list[int]:
    """Return the numbers of members, each a number or a set, which may have sets in it too."""
    numbers: list[int] = []
    for member in given:
        if isinstance(member, int):
            numbers.append(member)
        elif member in sets:
            numbers += _numbers(sets, sets[member])
        else:
            raise ValueError(f"there is no set {member}")
    return numbers


def _by_block(numbers: Sequence[int], elements: Ints) -> dict[int, Ints]:
    """Return elements by block, those that are there; rows are number, block, place in it."""
    here = elements[np.isin(elements[:, 0], numbers)]
    return {int(b): np.unique(here[here[:, 1] == b, 2]) for b in np.unique(here[:, 1])}


def _faces(
    found: Deck,
    rows: Sequence[tuple[Member, str]],
    elements: Ints,
    blocks: Sequence[tuple[str, Ints]],
    dim: int,
) -> Ints:
    """Return the faces of a surface by their corners; edges of shells are no faces of solids."""
    faces: list[Ints] = []
    whole: dict[str, list[Ints]] = {}
    for given, label in rows:
        for block, members in _by_block(_numbers(found.sets, [given]), elements).items():
            name, nodes = blocks[block]
            of, corners = ELEMENTS[name][0], FACES.get(name, ())
            number = int(label[1]) if re.fullmatch(r"[SE]\d", label) else 0
            if of == dim - 1 and label in SIDES:
                faces.append(nodes[members][:, : len(corners) or 2])
            elif of == dim and 0 < number <= len(corners):
                faces.append(nodes[members][:, list(corners[number - 1])])
            elif of == dim and label == "":
                whole.setdefault(name, []).append(nodes[members])
            elif of == dim or not (number or label in SIDES):
                word = f"*SURFACE: elements {found.as_given(given)} have"
                raise ValueError(f"{word} no face {label!r}")
    every: list[Ints] = []
    for name, alike in whole.items():
        cells = unique_rows(np.concatenate(alike))
        every += [cells[:, list(face)] for face in FACES[name]]
    return joined_facets([*faces, single_facets(joined_facets(every))] if every else faces)
