"""The JSON schema of the case file, for editors that complete and check TOML."""

from __future__ import annotations

import warnings
from typing import Any

from pydantic.json_schema import PydanticJsonSchemaWarning

import meshes
from contact.case.file import Case
from contact.mesh import grid
from contact.model.messages import keys_of, sections_of
from contact.model.units import BY_NAME

#: Version of the schema's own language.
DIALECT = "https://json-schema.org/draft/2020-12/schema"
#: A parameter of a mesh generator, which stands in `[mesh]` itself.
LENGTH = {"type": "number", "exclusiveMinimum": 0}


def schema() -> dict[str, Any]:
    """Return the JSON schema of the case file: its keys, kinds of values and bounds."""
    with warnings.catch_warnings():  # defaults that are formulas, which JSON does not have
        warnings.simplefilter("ignore", PydanticJsonSchemaWarning)
        made = Case.model_json_schema()
    tables = made["$defs"]
    about, mesh = (tables[name]["properties"] for name in ("About", "Mesh"))
    about["units"] = {"anyOf": [about["units"], BY_NAME]}
    mesh["generator"]["enum"] = [*grid.SIDES, *meshes.GENERATORS]
    for key in sorted({key for name in meshes.GENERATORS for key in meshes.parameters(name)}):
        mesh[key] = {"anyOf": [mesh[key], LENGTH]} if key in mesh else LENGTH
    for name, section in sections(Case).items():
        tables[name]["additionalProperties"] = False  # pydantic says so of models alone
        for key, field in keys_of(section).items():
            tables[name]["properties"][key].setdefault("description", field.description)
    required = ["mesh", "material", *made["required"]]  # without objects of Python
    return {
        "$schema": DIALECT,
        **made,
        "required": required,
        "title": "Case file of contact-fenicsx",
    }


def sections(above: type) -> dict[str, type]:
    """Return the sections below one, by their names in the schema."""
    found: dict[str, type] = {}
    for field in keys_of(above).values():
        for name, inner in sections_of(field.annotation).items():
            found |= {name: inner, **sections(inner)}
    return found
