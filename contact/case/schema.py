"""The JSON schema of the case file, for editors that complete and check TOML."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaWarningKind

import meshes
from contact.case.file import DEFAULT, Case
from contact.case.mesh import COMMON, Mesh
from contact.mesh import grid
from contact.model.material import CONSTANTS, Material
from contact.model.messages import keys_of, kinds_of, sections_of
from contact.model.section import conditions
from contact.model.units import BY_NAME
from contact.settings import ReadWith

#: Version of the schema's own language.
DIALECT = "https://json-schema.org/draft/2020-12/schema"

#: Ends the text of a docstring, before its keys.
DOCUMENTED = re.compile(r"\n\n(?:Attributes|Parameters|Examples)\n")

LENGTH = {"type": "number", "exclusiveMinimum": 0}


class _Generator(GenerateJsonSchema):
    """Leaves out defaults that are formulas, which JSON does not have, without a word."""

    def emit_warning(self, kind: JsonSchemaWarningKind, detail: str) -> None:
        """Say nothing."""


def schema() -> dict[str, Any]:
    """Return the JSON schema of the case file.

    It knows keys, kinds of values and bounds, and the keys that are read with some values of
    another alone. `contact check` knows the rest, which depends on more, or on the mesh.

    Returns
    -------
    The schema, of plain dictionaries and lists.
    """
    made = _plain(Case.model_json_schema(schema_generator=_Generator))
    tables = made["$defs"]
    for name, section in below(Case).items():
        tables[name]["additionalProperties"] = False  # pydantic says so of models alone
        # Those of dataclasses have no keys described by pydantic, those of models have them twice.
        tables[name]["description"] = DOCUMENTED.split(inspect.getdoc(section) or "")[0]
        for key, field in keys_of(section).items():
            tables[name]["properties"][key].setdefault("description", field.description)
        rules = _material_rules() if section is Material else _rules(section, _defaults(section))
        if rules:
            tables[name] |= _unseen({"allOf": rules})
        key, kinds = kinds_of([section])
        if kinds and section is not type(DEFAULT):  # the key tells sections of a place apart
            required = tables[name].setdefault("required", [])
            required += [] if key in required else [key]
    about = tables["About"]["properties"]
    about["units"] = _or(about["units"], BY_NAME)
    _add_generators(tables["Mesh"])
    made = _guided(made, tables)
    return {"$schema": DIALECT, **made, "title": "Case file of contact-fenicsx"}


def _unseen(rule: dict[str, Any]) -> dict[str, Any]:
    """Return a rule that is checked, but in which Taplo looks for no keys to complete."""
    return {"if": {}, "then": rule}


def _plain(node: Any) -> Any:
    """Return a schema without null, which TOML does not have, and without OpenAPI's words.

    A value may fit several kinds: which one reads it is told by more than the schema says.
    """
    if isinstance(node, list):
        return [_plain(entry) for entry in node if entry != {"type": "null"}]
    if not isinstance(node, dict):
        return node
    made = {
        "anyOf" if key == "oneOf" else key: _plain(value)
        for key, value in node.items()
        if key != "discriminator" and not (key == "default" and isinstance(value, dict | None))
    }
    if len(made.get("anyOf", ())) == 1:
        made |= made.pop("anyOf")[0]
    return made


def _guided(node: Any, tables: Mapping[str, Any]) -> Any:
    """Return a schema whose errors in tables name the key: those of `anyOf` name the table alone.

    `anyOf` stays for completion, with a kind that takes all.
    """
    if isinstance(node, list):
        return [_guided(entry, tables) for entry in node]
    if not isinstance(node, dict):
        return node
    made = {key: _guided(value, tables) for key, value in node.items()}
    kinds = made.get("anyOf", [])
    if any("$ref" in kind for kind in kinds):
        made |= {"anyOf": [*kinds, True], **_unseen(_meant(kinds, tables))}
    return made


def _meant(kinds: list[dict[str, Any]], tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return the kinds of values, each asked for where the value looks like it."""
    read = [kind for kind in kinds if "$ref" in kind]
    lists = [kind for kind in kinds if kind.get("type") == "array"]
    rest: dict[str, Any] = {"anyOf": [kind for kind in kinds if kind not in read + lists]}
    if not rest["anyOf"]:
        rest = {"type": ["object", "array"] if lists else "object"}
    if lists:
        rest = {"if": {"type": "array"}, "then": {"anyOf": lists}, "else": rest}
    return {"if": {"type": "object"}, "then": _told_apart(read, tables), "else": rest}


def _told_apart(read: list[dict[str, Any]], tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return tables of which the value of one key tells which it is."""
    if len(read) == 1:
        return read[0]
    named, key = {}, ""
    for kind in read:
        table = tables[kind["$ref"].rpartition("/")[2]]
        key, value = next((k, v["const"]) for k, v in table["properties"].items() if "const" in v)
        named[value] = kind, {"required": [key] if key in table.get("required", ()) else []}
    rest: dict[str, Any] = {"required": [key], "properties": {key: {"enum": [*named]}}}
    for value, (kind, told) in named.items():
        this = {**told, "properties": {key: {"const": value}}}
        rest = {"if": this, "then": kind, "else": rest}
    return rest


def below(section: type) -> dict[str, type]:
    """Return the sections below one, by their names in the schema."""
    found: dict[str, type] = {}
    for field in keys_of(section).values():
        for name, inner in sections_of(field.annotation).items():
            found |= {name: inner, **below(inner)}
    return found


def _or(known: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """Return a schema that takes another kind of value too."""
    described: dict[str, Any] = {k: known[k] for k in ("description", "default") if k in known}
    kinds = known.get("anyOf") or [{k: v for k, v in known.items() if k not in described}]
    return {**described, "anyOf": [*kinds, other]}


def _defaults(section: type) -> dict[str, Any]:
    return {key: field.default for key, field in keys_of(section).items()}


def _rules(section: type, defaults: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return rules on the keys of a section that are read with some values of another alone."""
    return [
        _rule(key, field.default, needs, defaults[needs.key])
        for key, field, needs in conditions(section)
    ]


def _rule(key: str, default: Any, needs: ReadWith, other: Any) -> dict[str, Any]:
    """Return the rule on a key with a default; `other` is that of the key that it needs."""
    met: dict[str, Any] = {"required": [needs.key]}
    if needs.value is not None:
        values: list[Any] = [*needs.value] if isinstance(needs.value, tuple) else [needs.value]
        met = {} if other in values else met
        met["properties"] = {needs.key: {"enum": values}}
    unread = {"properties": {key: False if default is None else {"const": default}}}
    return {"if": met, "then": {"required": [key]} if needs.required else True, "else": unread}


def _material_rules() -> list[dict[str, Any]]:
    """Return the rules on `[material]`, which has a law by default where it has no name."""
    defaults = _defaults(Material)
    named = {"allOf": _rules(Material, defaults), "properties": dict.fromkeys(CONSTANTS, False)}
    own = {"allOf": _rules(Material, {**defaults, "law": "linear"})}
    return [{"if": {"required": ["name"]}, "then": named, "else": own}]


def _add_generators(mesh: dict[str, Any]) -> None:
    """Add the mesh generators with their parameters, which stand in `[mesh]` itself."""
    own = {name: [*meshes.parameters(name)] for name in meshes.GENERATORS}
    keys = mesh["properties"]
    for key in sorted({key for parameters in own.values() for key in parameters}):
        said = f"Parameter of {', '.join(name for name in own if key in own[name])}."
        keys[key] = _or(keys[key], LENGTH) if key in keys else {"description": said, **LENGTH}
    keys["generator"]["enum"] = [*grid.SIDES, *own]
    rules: list[Any] = [{"oneOf": [{"required": ["generator"]}, {"required": ["file"]}]}]
    none = {"parameters": {"maxProperties": 0}}
    of_file = {*COMMON, "parameters"} - {"generator", "cell"}
    rules.append({"if": {"required": ["file"]}, "then": _keys(of_file, none)})
    for name in grid.SIDES:
        taken = {"required": ["size", "cells"], **_keys({*keys_of(Mesh)} - {"file"}, none)}
        taken["properties"]["size"] = {"type": "array"}
        rules.append({"if": _with_generator(name), "then": taken})
    for name, parameters in own.items():
        taken = _keys(
            {*COMMON, "parameters", *parameters} - {"file"},
            {"size": LENGTH, "parameters": _keys(parameters)},
        )
        rules.append({"if": _with_generator(name), "then": taken})
    mesh |= _unseen({"allOf": rules})


def _with_generator(name: str) -> dict[str, Any]:
    return {"required": ["generator"], "properties": {"generator": {"const": name}}}


def _keys(names: Iterable[str], kinds: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return a schema of tables with keys of some names, some of them of narrower kinds."""
    return {"propertyNames": {"enum": sorted(names)}, "properties": dict(kinds or {})}
