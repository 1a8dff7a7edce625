"""The reference page of the case file, made from the models themselves.

``python3 -m scripts.case_page`` writes ``docs/case-file.md``.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import is_dataclass
from pathlib import Path

from pydantic.fields import FieldInfo

import meshes
from contact.case.file import DEFAULT, Case, literal
from contact.errors import shown
from contact.model import formula as formulas
from contact.model.messages import accepted_by, either, keys_of, kinds_of, sections_of
from contact.settings import ReadWith

PAGE = Path(__file__).parents[1] / "docs" / "case-file.md"

INTRODUCTION = f"""\
# The case file

<!-- Made by `python3 -m scripts.case_page`; edit contact/model/, contact/case/ instead. -->

A case file is a TOML file with a problem and its method:

```
python3 -m contact check CASE.toml
python3 -m contact solve CASE.toml --out DIR [--set path.to.key=value]... [PETSc options]
```

`check` prints the case with all defaults, the parts of the mesh with area, centroid and normal, the
volume of its regions, the number of unknowns, and the resultant of the loads. `--set` replaces
a value of the file. The names of nested keys are joined by dots, and entries of lists are numbered
from 0 (`--set load.0.traction='[0, -0.05]'`). The value is TOML; a bare word is a text.

Any consistent system of [units](model.md#units) may be used. An unknown key is an error.
`contact schema` prints a JSON schema of the file, by which
[editors](install.md#an-editor-that-completes-case-files) complete and check it.

**Formulas.** Where a number *or a formula* is accepted, a formula is a text of
{formulas.ACCEPTED}.
Functions have NumPy's meaning: `log` is natural, angles are in radians; `min` and `max` take two
arguments or more. A comparison counts as 1 or 0. Formulas are parsed, never executed.
"""


def page() -> str:
    """Return the reference page (Markdown)."""
    lines = [INTRODUCTION, "## Top level", "", *_rows(Case)]
    described = {key: list(sections_of(f.annotation).values()) for key, f in keys_of(Case).items()}
    top = [section for sections in described.values() for section in sections]
    for key, sections in described.items():
        if key in ("solver", "output"):
            lines += _options(key, sections)
            continue
        for section in sections:
            lines += _describe(key, section, top)
        if key == "mesh":
            lines += _generators()
    return "\n".join(lines) + "\n"


def _describe(key: str, section: type, elsewhere: Collection[type]) -> Iterator[str]:
    """Describe a section and those in it. Its docstring is ``heading: text``."""
    text = re.split(r"\n\n(?:Attributes|Parameters)\n", inspect.getdoc(section) or "")[0]
    name, kinds = kinds_of([section])
    if is_dataclass(section):
        heading = f"`{key} = {{ {name} = {shown(*kinds)}, ... }}`"
    elif not text.startswith("`"):
        return
    else:
        heading, text = text.split(": ", 1)
    yield from ("", f"## {heading}", "", text[0].upper() + text[1:], "", *_rows(section))
    for name, field in keys_of(section).items():
        for inner in sections_of(field.annotation).values():
            if inner not in elsewhere:
                yield from _describe(name, inner, elsewhere)


def _rows(section: type) -> Iterator[str]:
    yield "| key | accepted | default | meaning |"
    yield "|---|---|---|---|"
    for key, field in keys_of(section).items():
        yield _row(f"`{key}`", *_cells(field))


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def _cells(field: FieldInfo) -> tuple[str, str, str]:
    """Return the accepted values of a key, its default and its meaning."""
    accepted = accepted_by(field.annotation, field.metadata)
    meaning = " ".join((field.description or "").split())
    for mark in field.metadata:
        if isinstance(mark, ReadWith) and mark.value is not None:
            required = " and required by" if mark.required else ""
            meaning += f" Read with{required} `{mark}` only."
    return accepted, _default(field), meaning


def _options(key: str, classes: Sequence[type]) -> Iterator[str]:
    """Describe a table that is read as options: of one class, or of one for each method."""
    yield from ("", f"## `[{key}]`", "")
    name, kinds = kinds_of(classes)
    if not kinds:
        yield from ((inspect.getdoc(classes[0]) or "").split("\n")[0], "", *_rows(classes[0]))
        return
    yield "Method, tolerances and limits. A key that the method does not read is refused."
    yield from ("", "| method | |", "|---|---|")
    rows: dict[tuple[str, ...], list[str]] = {}
    for value, options in kinds.items():
        yield _row(f"`{value}`", (inspect.getdoc(options) or "").split("\n")[0])
        for key, field in keys_of(options).items():
            if key != name:
                rows.setdefault((f"`{key}`", *_cells(field)), []).append(f"`{value}`")
    yield from ("", "| key | accepted | default | method | meaning |", "|---|---|---|---|---|")
    accepted = either(map(shown, kinds))
    yield _row(f"`{name}`", accepted, f"`{literal(DEFAULT.method)}`", "", "See above.")
    for (key, accepted, default, meaning), methods in rows.items():
        which = "all" if len(methods) == len(kinds) else ", ".join(methods)
        yield _row(key, accepted, default, which, meaning)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = getattr(field.default, "source", field.default)
    return f"`{literal(value)}`" if isinstance(value, str | int | float) else ""


def _generators() -> Iterator[str]:
    yield from ("", "### Parametric mesh generators", "")
    yield (
        "Further values of `generator`, meshed by Gmsh. Their parameters are keys of `[mesh]`. "
        "`contact check` lists the parts that they name."
    )
    yield from ("", "| generator | body | parameters and defaults |", "|---|---|---|")
    for name, generator in meshes.GENERATORS.items():
        summary = " ".join((inspect.getdoc(generator) or "").split("\n\n")[0].split())
        defaults = ", ".join(f"`{k} = {v:g}`" for k, v in meshes.parameters(name).items())
        yield f"| `{name}` | {summary} | {defaults} |"


if __name__ == "__main__":
    PAGE.write_text(page())
