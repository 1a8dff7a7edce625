"""Input files of Abaqus and CalculiX: nodes, elements, sets and surfaces.

meshio's reader knows no surfaces, and neither the keywords nor the elements that these files have
in practice. A set of elements is a region, or a part if they lie on the boundary; a set of nodes
is a part, the facets all of whose nodes it holds; a surface is a part.

References
----------
CalculiX CrunchiX USER'S MANUAL, *NODE, *ELEMENT, *NSET, *ELSET, *SURFACE (numbers of faces), and
chapter 6.2 (elements).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from contact.mesh.assembly import NESTING, Assembly, Member, Scope, real
from contact.mesh.cells import distinct, once, together
from contact.mesh.contents import ELEMENTS, Contents, Ints, Kind, letters, same_name

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

#: Corners of the faces S1, S2, ... of elements.
FACES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quadrilateral": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetrahedron": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "prism": ((0, 1, 2), (3, 5, 4), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "hexahedron": (
        (0, 1, 2, 3),
        (4, 7, 6, 5),
        (0, 4, 5, 1),
        (1, 5, 6, 2),
        (2, 6, 7, 3),
        (3, 7, 4, 0),
    ),
}

#: Either side of a shell, which is a facet of solids as a whole.
SIDES = {"", "S1", "S2", "SPOS", "SNEG"}

#: Keywords without a meaning for a mesh that are not worth a word.
SILENT = {"HEADING", "PREPRINT", "ASSEMBLY", "END ASSEMBLY"}

#: Keywords that make or move nodes and elements which do not stand in the file.
MAKING = {"SYSTEM", "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "IMPORT"}
MAKING |= {"SYMMETRIC MODEL GENERATION"}

#: The files that are read.
FLAT = "accepted: every node and element in the file"

#: Keywords whose data lines may stand in a file of their own, by INPUT.
FROM_FILES = {"NODE", "ELEMENT"}


def read(file: Path) -> Contents:
    """Read an input file, and those that it includes; raise errors of any kind if it is wrong."""
    found = Assembly()
    for keyword, options, lines in _blocks(file):
        if keyword in NESTING:
            found.nest(keyword, options, lines)
        else:
            _take(found.here, keyword, options, lines)
    try:
        return _deck(found.flat())
    except RecursionError:
        raise ValueError("a set holds itself") from None


def included(file: Path) -> list[Path]:
    """Return an input file and those that it includes, each once; a ValueError without one."""
    return [*dict.fromkeys([file, *(inner for inner, _ in _lines(file))])]


def _blocks(file: Path) -> Iterator[tuple[str, dict[str, str], list[list[str]]]]:
    """Yield keywords with their options and the values of their data lines."""
    keyword = ""
    options: dict[str, str] = {}
    values: list[list[str]] = []
    for _, line in _lines(file):
        if not line.startswith("*"):
            values.append([value.strip() for value in _split(line.rstrip(","))])
            continue
        if keyword:
            yield keyword, options, values
        (keyword, options), values = _keyword(line), []
    if keyword:
        yield keyword, options, values


def _split(line: str) -> list[str]:
    """Return the values of a line."""
    return COMMA.split(line) if '"' in line else line.split(",")


def _keyword(line: str) -> tuple[str, dict[str, str]]:
    """Return the keyword of a line, and its options."""
    first, *others = _split(line[1:])
    pairs = (other.partition("=") for other in others)
    options = {key.strip().upper().replace(" ", ""): value.strip() for key, _, value in pairs}
    return " ".join(first.upper().split()), options


def _lines(file: Path, depth: int = 0) -> Iterator[tuple[Path, str]]:
    """Yield the lines without comments, those of included files in their places, with the files."""
    if depth > 10:
        raise ValueError(f"*INCLUDE: {file.name} includes itself")
    pending = ""
    for raw in letters(file.read_bytes()).splitlines():
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
            yield from _lines(inner, depth + 1)


def _take(
    found: Scope, keyword: str, options: dict[str, str], lines: Sequence[Sequence[str]]
) -> None:
    """Take a keyword with its data."""
    if keyword in MAKING or (keyword == "NODE" and options.get("SYSTEM", "R").upper() != "R"):
        word = keyword if keyword in MAKING else f"NODE, SYSTEM={options['SYSTEM']}"
        raise ValueError(f"*{word} makes or moves nodes or elements; {FLAT}")
    if keyword == "NODE":
        numbers = [found.number(line[0]) for line in lines]
        for number, line in zip(numbers, lines, strict=True):
            found.put(number, [real(value) for value in [*line[1:4], "", ""][:3]])
        if "NSET" in options:
            found.nodes.setdefault(found.name(options["NSET"]), []).extend(numbers)
    elif keyword == "ELEMENT":
        kind = options.get("TYPE", "").upper()
        if NO_CELLS.match(kind):
            found.other.append(f"ELEMENT, TYPE={kind}")
            found.sets.setdefault(found.name(options.get("ELSET", kind)), [])
            return
        numbers = found.elements.setdefault(kind, [])
        count = _known(kind).nodes + 1
        values = [found.number(value) for line in lines for value in line if value]
        if len(values) % count:
            raise ValueError(f"*ELEMENT, TYPE={kind}: {len(values)} numbers, {count} an element")
        numbers.extend(values)
        if "ELSET" in options:
            found.sets.setdefault(found.name(options["ELSET"]), []).extend(values[::count])
    elif keyword in ("NSET", "ELSET"):
        into = found.nodes if keyword == "NSET" else found.sets
        instance = options.get("INSTANCE", "")
        key = found.name(options[keyword])
        members = into.setdefault(key, [])
        if keyword == "NSET" and "ELSET" in options:
            found.nodes_of.setdefault(key, []).append(found.name(options["ELSET"], instance))
        elif "GENERATE" in options:
            for line in lines:
                first, last = (found.number(value, instance) for value in line[:2])
                members.extend(range(first, last + 1, int((*line, "", "")[2] or 1)))
        else:
            every = (value for line in lines for value in line if value)
            members.extend(found.member(value, instance) for value in every)
    elif keyword == "SURFACE":
        instance = options.get("INSTANCE", "")
        rows = [(found.member(line[0], instance), (*line, "")[1].upper()) for line in lines]
        kind = options.get("TYPE", "ELEMENT").upper()
        if "COMBINE" in options:
            word = f"*SURFACE, COMBINE={options['COMBINE']}"
            raise ValueError(f"{word}: no surfaces are made of others; accepted: faces of elements")
        found.surfaces.setdefault(found.name(options["NAME"]), (kind, []))[1].extend(rows)
    elif keyword not in SILENT and keyword not in found.other:
        found.other.append(keyword)


def _known(kind: str) -> Kind:
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
    raise ValueError(f"*ELEMENT, TYPE={kind}: elements that are not known")


def _deck(found: Scope) -> Contents:
    tags = np.array(sorted(found.points), dtype=np.int64)
    points = np.array([found.points[tag] for tag in tags], dtype=float).reshape(-1, 3)
    blocks: list[tuple[str, Ints]] = []
    homes = [np.zeros((0, 3), dtype=np.int64)]
    for block, (kind, values) in enumerate(found.elements.items()):
        known = _known(kind)
        rows = np.array(values, dtype=np.int64).reshape(-1, known.nodes + 1)
        nodes = np.minimum(np.searchsorted(tags, rows[:, 1:]), max(tags.size - 1, 0))
        if tags.size == 0 or np.any(tags[nodes] != rows[:, 1:]):
            raise ValueError("it has elements whose nodes it does not have")
        if known == Kind("interval", 3):  # the middle one last, wherever the program has it
            middle = points[nodes].mean(axis=1, keepdims=True)
            order = np.argsort(-np.linalg.norm(points[nodes] - middle, axis=2), 1, kind="stable")
            nodes = np.take_along_axis(nodes, order, axis=1)
        blocks.append((known.name, nodes))
        places = np.arange(len(rows))
        homes.append(np.column_stack([rows[:, 0], np.full_like(places, block), places]))
    elements = np.concatenate(homes)
    elements = elements[np.argsort(elements[:, 0], kind="stable")]
    twice = elements[1:, 0][np.diff(elements[:, 0]) == 0]
    if twice.size:
        number = found.said(int(twice[0]))
        raise ValueError(f"*ELEMENT: element {number} is there twice; accepted: once")
    deck, names = Contents(points, blocks), found.shown()
    for key in found.sets:
        members = _members(found.sets, key)
        deck.groups[names[key]] = _by_block(members, elements)
    for key, sets in found.nodes_of.items():
        chosen = [number for name in sets for number in _members(found.sets, name)]
        for block, within in _by_block(chosen, elements).items():
            found.nodes[key] += map(int, tags[np.unique(blocks[block][1][within])])
    for key in found.nodes:
        numbers = _members(found.nodes, key)
        deck.nodes[names[key]] = np.flatnonzero(np.isin(tags, numbers))
    dim, twice = max((kind.dim for kind in deck.kinds), default=0), []
    for key, (sort, lines) in found.surfaces.items():
        name = names[key]
        if sort == "NODE":
            numbers = _named(found.nodes, [member for member, _ in lines])
            own = np.flatnonzero(np.isin(tags, numbers))
            if not np.array_equal(deck.nodes.setdefault(name, own), own):
                twice.append(name)
            deck.nodes[name] = own
        elif sort == "ELEMENT":
            deck.surfaces[name] = _faces(found, lines, elements, blocks, dim)
    if twice:
        deck.notes.append(same_name(twice))
    plane = [kind for kind in found.elements if dim == 2 and _known(kind).dim == 2]
    made_for = {own for kind in plane for of, own in KINEMATICS.items() if kind.startswith(of)}
    if len(made_for) == 1 and made_for != {"plane_strain"}:
        deck.space["kinematics"] = made_for.pop()
    if found.other:
        deck.notes.append(f"left out: {', '.join(f'*{word}' for word in found.other)}")
    return deck


def _members(sets: dict[str, list[Member]], key: str) -> list[int]:
    """Return the numbers of a set, those of sets in it too."""
    if key not in sets:
        raise ValueError(f"there is no set {key}")
    return _named(sets, sets[key])


def _named(sets: dict[str, list[Member]], given: Sequence[Member]) -> list[int]:
    """Return the numbers of members, each a number or a set."""
    numbers: list[int] = []
    for member in given:
        numbers += [member] if isinstance(member, int) else _members(sets, member)
    return numbers


def _by_block(numbers: Sequence[int], elements: Ints) -> dict[int, Ints]:
    """Return elements by block, those that are there; rows are number, block, place in it."""
    here = elements[np.isin(elements[:, 0], numbers)]
    return {int(b): np.unique(here[here[:, 1] == b, 2]) for b in np.unique(here[:, 1])}


def _faces(
    found: Scope,
    rows: Sequence[tuple[Member, str]],
    elements: Ints,
    blocks: Sequence[tuple[str, Ints]],
    dim: int,
) -> Ints:
    """Return the faces of a surface by their corners; edges of shells are no faces of solids."""
    faces: list[Ints] = []
    whole: dict[str, list[Ints]] = {}
    for given, label in rows:
        for block, members in _by_block(_named(found.sets, [given]), elements).items():
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
                word = f"*SURFACE: elements {found.said(given)} have"
                raise ValueError(f"{word} no face {label!r}")
    every: list[Ints] = []
    for name, alike in whole.items():
        cells = distinct(np.concatenate(alike))
        every += [cells[:, list(face)] for face in FACES[name]]
    return together([*faces, once(together(every))] if every else faces)
