"""The reference page of the case file, made from the models themselves.

``python3 -m contact.case.reference`` writes ``docs/case-file.md``.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import meshes
from contact.case import grammar as formulas
from contact.case.file import Case
from contact.case.messages import keys_of
from contact.case.text import literal
from contact.case.types import Section, accepted_by, sections_of

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
    for key, field in keys_of(Case).items():
        for section in sections_of(field.annotation).values():
            lines += _describe(section)
        if key == "mesh":
            lines += _recipes()
    return "\n".join(lines) + "\n"


def _describe(section: type[Section]) -> Iterator[str]:
    """Describe a section and those in it. Its docstring is ``heading: text``."""
    heading, text = (inspect.getdoc(section) or "").split(": ", 1)
    yield from ("", f"## {heading}", "", text[0].upper() + text[1:], "", *_rows(section))
    for field in section.model_fields.values():
        for inner in sections_of(field.annotation).values():
            yield from _describe(inner)


def _rows(section: type[Section]) -> Iterator[str]:
    yield "| key | accepted | default | meaning |"
    yield "|---|---|---|---|"
    for key, field in keys_of(section).items():
        accepted = accepted_by(field.annotation, field.metadata)
        meaning = field.description or ""
        cells = (f"`{key}`", accepted, _default(field), meaning)
        yield "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def _default(field: Any) -> str:
    if field.is_required():
        return "required"
    if field.default is None or isinstance(field.default, Section | dict | tuple):
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
