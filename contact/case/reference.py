"""The reference page of the case file, made from the models themselves.

``python3 -m contact.case.reference`` writes ``docs/case-file.md``.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from dataclasses import is_dataclass
from pathlib import Path

from pydantic.fields import FieldInfo

import meshes
from contact.case import formula as formulas
from contact.case.accepted import accepted_by, either, keys_of, sections_of
from contact.case.file import Case
from contact.case.solver import DEFAULT
from contact.case.text import literal
from contact.case.types import Section
from contact.methods.options import OPTIONS
from contact.settings import ReadWith

PAGE = Path(__file__).parents[2] / "docs" / "case-file.md"

INTRODUCTION = f"""\
# The case file

<!-- Made by `python3 -m contact.case.reference`; edit the models in contact/case/ instead. -->

A case file is a TOML file that says all about a problem and how it is solved:

```
python3 -m contact check CASE.toml
python3 -m contact solve CASE.toml --out DIR [--set path.to.key=value]... [PETSc options]
```

`check` prints the case with all defaults, the parts of the mesh and the number of unknowns. Each
`--set` replaces a value of the file: its path is dotted, entries of lists are numbered from 0
(`--set load.0.traction='[0, -0.05]'`), its value is TOML, and a bare word is a text.

Lengths, forces and charges are in any consistent system of units; no key has a unit built in.
An unknown key is an error.

**Formulas.** Where a number *or a formula* is accepted, a formula is a text of
{formulas.ACCEPTED}.
Functions have NumPy's meaning: `log` is natural, angles are in radians; `min` and `max` take two
arguments or more. A comparison counts as 1 or 0. Formulas are parsed, never executed.
"""


def page() -> str:
    """Return the reference page (Markdown)."""
    lines = [INTRODUCTION, "## Top level", "", *_rows(Case)]
    described = [list(sections_of(field.annotation).values()) for field in keys_of(Case).values()]
    top = {section for sections in described for section in sections}
    for key, sections in zip(keys_of(Case), described, strict=True):
        if any(is_dataclass(section) for section in sections):
            lines += _options(key, sections)
        else:
            lines += [line for section in sections for line in _describe(section, top)]
        if key == "mesh":
            lines += _recipes()
    return "\n".join(lines) + "\n"


def _describe(section: type[Section], elsewhere: AbstractSet[type]) -> Iterator[str]:
    """Describe a section and those in it. Its docstring is ``heading: text``.

    Parameters
    ----------
    section
        The section.
    elsewhere
        Sections that have a place of their own.
    """
    heading, text = (inspect.getdoc(section) or "").split(": ", 1)
    yield from ("", f"## {heading}", "", text[0].upper() + text[1:], "", *_rows(section))
    for field in section.model_fields.values():
        for inner in sections_of(field.annotation).values():
            if inner not in elsewhere and not is_dataclass(inner):
                yield from _describe(inner, elsewhere)


def _rows(section: type) -> Iterator[str]:
    yield "| key | accepted | default | meaning |"
    yield "|---|---|---|---|"
    for key, field in keys_of(section).items():
        yield _row(f"`{key}`", *_cells(field))


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def _cells(field: FieldInfo) -> tuple[str, str, str]:
    """Return what a key accepts, its default and its meaning."""
    accepted = accepted_by(field.annotation, field.metadata)
    needs = "".join(
        f" Read with `{mark.key} = {literal(mark.value)}` only."
        for mark in field.metadata
        if isinstance(mark, ReadWith)
    )
    return accepted, _default(field), (field.description or "") + needs


def _options(key: str, classes: list[type]) -> Iterator[str]:
    """Describe a table that is read as options: of one class, or of one for each method."""
    yield from ("", f"## `[{key}]`", "")
    if len(classes) == 1:
        yield from ((inspect.getdoc(classes[0]) or "").split("\n")[0], "", *_rows(classes[0]))
        return
    yield "Method, tolerances and limits. What the method does not read is refused."
    yield from ("", "| method | |", "|---|---|")
    rows: dict[tuple[str, ...], list[str]] = {}
    for options in classes:
        keys = keys_of(options)
        method = f"`{keys.pop('method').default}`"
        yield _row(method, (inspect.getdoc(options) or "").split("\n")[0])
        for name, field in keys.items():
            rows.setdefault((f"`{name}`", *_cells(field)), []).append(method)
    yield from ("", "| key | accepted | default | method | meaning |", "|---|---|---|---|---|")
    default = literal(DEFAULT.method)
    yield _row(
        "`method`", either([literal(name) for name in OPTIONS]), f"`{default}`", "", "See above."
    )
    for (name, accepted, default, meaning), methods in rows.items():
        which = "all" if len(methods) == len(classes) else ", ".join(methods)
        yield _row(name, accepted, default, which, meaning)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    if (
        field.default is None
        or isinstance(field.default, Section | dict | tuple)
        or is_dataclass(field.default)
    ):
        return ""
    return f"`{literal(field.default)}`"


def _recipes() -> Iterator[str]:
    yield from ("", "### Mesh recipes", "")
    yield "Further values of `generator`, meshed by Gmsh. Their parameters stand in `[mesh]`."
    yield from ("", "| generator | body and parts | parameters and defaults |", "|---|---|---|")
    for name, recipe in meshes.RECIPES.items():
        summary = " ".join((inspect.getdoc(recipe) or "").split("\n\n")[0].split())
        defaults = ", ".join(f"`{k} = {v:g}`" for k, v in meshes.parameters(name).items())
        yield f"| `{name}` | {summary} | {defaults} |"


def main(arguments: list[str]) -> None:
    """Write the page to a file, by default docs/case-file.md."""
    path = Path(arguments[0]) if arguments else PAGE
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(page())


if __name__ == "__main__":
    main(sys.argv[1:])
