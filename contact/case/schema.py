"""The JSON schema of the case file, for editors that complete and check TOML."""

from __future__ import annotations

from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaWarningKind

import meshes
from contact.case.file import Case

#: Version of the schema's own language.
DIALECT = "https://json-schema.org/draft/2020-12/schema"


class _Generator(GenerateJsonSchema):
    """Leaves out defaults that are formulas, which JSON does not have, without a word."""

    def emit_warning(self, kind: JsonSchemaWarningKind, detail: str) -> None:
        """Say nothing."""


def schema() -> dict[str, Any]:
    """Return the JSON schema of the case file.

    It knows keys, kinds of values and bounds. `contact check` knows the rest, which depends on
    other keys or on the mesh.

    Returns
    -------
    The schema, of plain dictionaries and lists.
    """
    made = _open(Case.model_json_schema(schema_generator=_Generator))
    _add_generators(made["$defs"]["Mesh"])
    return {"$schema": DIALECT, **made, "title": "Case file of contact-fenicsx"}


def _open(node: Any) -> Any:
    """Let a value fit several kinds: which one reads it is told by more than the schema says."""
    if isinstance(node, list):
        return [_open(entry) for entry in node]
    if not isinstance(node, dict):
        return node
    return {"anyOf" if key == "oneOf" else key: _open(value) for key, value in node.items()}


def _add_generators(mesh: dict[str, Any]) -> None:
    """Add the parameters of the mesh generators, which stand in `[mesh]` itself."""
    number = {"type": "number", "exclusiveMinimum": 0}
    names = {name for generator in meshes.GENERATORS for name in meshes.parameters(generator)}
    for name in sorted(names):
        known = mesh["properties"].get(name)
        mesh["properties"][name] = number if known is None else _or(known, number)


def _or(known: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """Return a schema that takes another kind of value too."""
    described = {key: known[key] for key in ("description", "default") if key in known}
    kinds = known.get("anyOf") or [{k: v for k, v in known.items() if k not in described}]
    return {**described, "anyOf": [*kinds, other]}
