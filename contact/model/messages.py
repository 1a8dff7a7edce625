"""One message for a wrong case file: the file, the key, the given value, the accepted values.

The words come from the models: each kind of value carries the accepted ones in words
(`contact.settings.Accepted`), and the nearest key is found among those of its table.
"""

from __future__ import annotations

import inspect
import re
import types
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError, PydanticUndefined

from contact.errors import InputError, clipped, nearest, shown
from contact.settings import Accepted, Internal, Required

#: Most characters of a key, a path of keys, and a list of accepted names.
KEY, PATH, LIST = 60, 100, 300

#: pydantic's names for an unknown key, of a section and of a class of options.
UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")

#: pydantic's names for a table of none of several kinds.
UNKNOWN_KIND = ("union_tag_invalid", "union_tag_not_found")


class Words(str):
    """Words for a message, as against a text given in the case file."""


#: Introduces the nearest of the accepted keys.
MEANT = ", did you mean {}?"

#: Stands for the given value where the key itself is wrong.
UNKNOWN = Words("unknown key")

#: Identifiers of these words of the program's for a given value, see `InputError`.
IDENTIFIERS = {UNKNOWN: "unknown-key", Words("missing"): "missing"}


def fault(key: str, given: Any, accepted: str, identifier: str = "") -> PydanticCustomError:
    """Return an error for a validator to raise.

    Parameters
    ----------
    key
        Dotted path below the model that raises it.
    given
        The given value of the case file, words inside `Words`, or `UNKNOWN`.
    accepted
        The accepted values, in words.
    identifier
        See `InputError`; by default that of an unknown or missing key, or of a wrong value.
    """
    context = {"key": key, "given": given, "accepted": accepted, "identifier": identifier}
    return PydanticCustomError("fault", "fault", context)


def path_of(keys: Iterable[str]) -> str:
    """Join keys to a path, as on the command line; a long one loses its middle."""
    text = ".".join(clipped(key, KEY) for key in keys)
    return text if len(text) <= PATH else f"{text[: PATH // 2 - 3]}...{text[-PATH // 2 :]}"


def listed(options: Iterable[str]) -> str:
    """List accepted names; of very many, the first ones and how many more there are."""
    given = [clipped(option) for option in options]
    kept, length = 0, 0
    while kept < len(given) and length < LIST:
        length += len(given[kept]) + 2
        kept += 1
    more = f" and {len(given) - kept} more" if kept < len(given) else ""
    return ", ".join(given[:kept]) + more


def either(options: Iterable[str]) -> str:
    """Join options: ``a, b or c``."""
    *first, last = options
    return f"{', '.join(first)} or {last}" if first else last


def sections_of(annotation: Any) -> dict[str, type]:
    """Return the classes that read tables in an annotation, by their names.

    These are sections, and classes of options (`contact.settings`).
    """
    if isinstance(annotation, type) and (
        issubclass(annotation, BaseModel) or is_dataclass(annotation)
    ):
        return {annotation.__name__: annotation}
    found: dict[str, type] = {}
    if get_origin(annotation) is not Literal:
        for argument in get_args(annotation):
            found |= {} if is_own(argument) else sections_of(argument)
    return found


def is_own(annotation: Any) -> bool:
    """Tell whether it stands for objects of Python, see `section.Own`."""
    return any(getattr(mark, "tag", "") == "own" for mark in get_args(annotation))


@cache
def keys_of(section: type) -> Mapping[str, FieldInfo]:
    """Return the keys of a section, or of a class of options, as in the case file."""
    return {field.alias or name: field for name, field in fields_of(section).items()}


@cache
def fields_of(section: type) -> Mapping[str, FieldInfo]:
    """Return the same by the names of the attributes."""
    if issubclass(section, BaseModel):
        return section.model_fields
    options: Any = section
    hints, found = get_type_hints(options, include_extras=True), {}
    meanings: dict[str, str] = {}
    for base in reversed(section.__mro__):  # under "Attributes" in their docstrings
        text = inspect.cleandoc(base.__doc__ or "").partition("Attributes\n----------\n")[2]
        for names, said in re.findall(r"^(\w+(?:, \w+)*)\n((?:[ ]+.*\n?|\n)+)", text, re.MULTILINE):
            meanings |= dict.fromkeys(names.split(", "), " ".join(said.split()))
    for field in fields(options):
        marks = get_args(hints[field.name])[1:]
        if any(isinstance(mark, Internal) for mark in marks):
            continue
        needed = field.default is MISSING or any(isinstance(mark, Required) for mark in marks)
        default = PydanticUndefined if needed else field.default
        found[field.name] = FieldInfo.from_annotated_attribute(hints[field.name], default)
        found[field.name].description = meanings.get(field.name, "")
    return found


def kinds_of(sections: Iterable[type]) -> tuple[str, dict[str, type]]:
    """Return the key that tells sections of one place apart, and its value for each.

    Nothing for sections without such a key: one with a single literal as its value.
    """
    found: dict[str, type] = {}
    name = ""
    for section in sections:
        for key, field in keys_of(section).items():
            if get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1:
                name = key
                found[get_args(field.annotation)[0]] = section
                break
    return name, found


def accepted_by(annotation: Any, metadata: Iterable[Any] = ()) -> str:
    """Return the accepted values of an annotation in words, tables after other kinds."""
    others: list[str] = []
    for item in reversed([*metadata]):  # the last one is of the narrower type
        if isinstance(item, Accepted):
            return item.text
    if get_origin(annotation) is Annotated:
        return accepted_by(get_args(annotation)[0], get_args(annotation)[1:])
    if get_origin(annotation) is Literal:
        return either(shown(value) for value in get_args(annotation))
    if get_origin(annotation) in (Union, types.UnionType):
        known = (kind for kind in get_args(annotation) if not is_own(kind))
        some = [kind for kind in known if kind is not type(None)]
        if len(some) == 1:  # a value that may be missing
            return accepted_by(some[0])
        others += [accepted_by(kind) for kind in some if not sections_of(kind)]
    key, kinds = kinds_of(sections_of(annotation).values())
    table = f"a table with {key} = {either(map(shown, kinds))}" if kinds else "a table"
    return ", or ".join([*others, table])


def describe(error: ValidationError, root: type[BaseModel], source: str) -> InputError:
    """Return the error, of a one-line message, for the first mistake of a case.

    An unknown key comes before all else: a missing key or a wrong value elsewhere is often but
    its consequence.
    """
    errors = sorted(error.errors(), key=lambda e: e["type"] not in UNKNOWN_KEY)
    return _message(errors[0], root).within(f"{source}: ")


def describe_fault(error: PydanticCustomError) -> InputError:
    """Return the error for a fault that was raised outside of pydantic's validation."""
    return _line([], **(error.context or {}))


def _message(error: ErrorDetails, root: type[BaseModel]) -> InputError:
    keys, sections, others, accepted = _locate(error["loc"], root)
    kind, context, given = error["type"], error.get("ctx", {}), error["input"]
    if kind == "fault":
        return _line(keys, **context)
    if kind in UNKNOWN_KEY:
        return _unknown([*keys, str(error["loc"][-1])], given, sections, others, root)
    if kind in UNKNOWN_KIND and isinstance(given, Mapping):
        name, kinds = kinds_of(sections)
        return _line(keys, name, given.get(name, Words("missing")), either(map(shown, kinds)))
    if kind == "value_error":
        # Raised by a formula or a dataclass, whose message is complete.
        whole: InputError = context["error"]
        text = whole.words
        own = [f"{section.__name__}: " for section in sections if section.__name__ in text]
        words = text.removeprefix(own[0] if own else "")
        return InputError(f"{path_of(keys)}{'.' if own else ': '}{words}", whole.identifier)
    return _line(keys, "", Words("missing") if kind == "missing" else given, accepted)


def _line(keys: list[str], key: str, given: Any, accepted: str, identifier: str = "") -> InputError:
    """Return the error for a fault of a key below others; see `fault`."""
    keys = [*keys, *(key.split(".") if key else ())]
    if isinstance(given, Words):
        identifier = identifier or IDENTIFIERS.get(given, "")
    if given is UNKNOWN:
        options = accepted.split(", ")
        given, accepted = f"{UNKNOWN}{nearest(keys[-1], options, MEANT)}", listed(options)
    elif isinstance(given, Mapping | BaseModel):
        given = "given a table"
    elif not isinstance(given, Words):
        given = f"given {shown(given)}"
    return InputError(f"{path_of(keys)}: {given}; accepted: {accepted}", identifier or "value")


def _unknown(
    keys: list[str], given: Any, sections: list[type], others: list[type], root: type[BaseModel]
) -> InputError:
    """Return the error for an unknown key of sections, which may have a meaning elsewhere.

    `others` are all sections that could stand there.
    """
    key = keys[-1]
    name, kinds = kinds_of(others)
    owners = [shown(value) for value, kind in kinds.items() if key in keys_of(kind)]
    if owners:
        return _line(keys, "", given, f"{key} with {name} = {either(owners)}")
    options = dict.fromkeys(key for section in sections for key in keys_of(section))
    tables: dict[str, list[type]] = {}
    for top, field in keys_of(root).items():
        title = f"[[{top}]]" if get_origin(field.annotation) is tuple else f"[{top}]"
        tables[title] = list(sections_of(field.annotation).values())
    own = next((title for title in tables if title.strip("[]") == key and tables[title]), None)
    homes = [title for title, read in tables.items() if any(key in keys_of(s) for s in read)]
    found = [getattr(section, "hints", {}).get(key) for section in sections]
    hints = [hint for hint in found if hint is not None]
    if own:
        hint = f" here: {own} is a table of its own, at the top level"
    elif hints:
        hint = f": {hints[0]}"
    elif homes:
        hint = f" here: it belongs to {' or '.join(homes)}"
    else:
        here = [shown(value) for value, kind in kinds.items() if kind in sections]
        hint = "".join(f" with {name} = {value}" for value in here) + nearest(key, options, MEANT)
    return _line(keys, "", Words(f"{UNKNOWN}{hint}"), listed(options), "unknown-key")


def _locate(
    location: tuple[int | str, ...], root: type[BaseModel]
) -> tuple[list[str], list[type], list[type], str]:
    """Follow a location of pydantic's through the sections.

    Returns
    -------
    The keys as in the case file (without pydantic's tags of unions), the sections that read the
    table there, all that could stand there, and the accepted values in words.
    """
    keys: list[str] = []
    here: list[type] = [root]
    others: list[type] = []
    accepted = "tables"
    named = False  # the next item is a name chosen by the user
    for item in location:
        kinds = kinds_of(here)[1]
        if isinstance(item, int) or named:
            keys.append(str(item))
            named = False
        elif len(kinds) > 1 and item in kinds:
            here = [kinds[item]]
        else:
            fields = {key: field for section in here for key, field in keys_of(section).items()}
            if item not in fields:
                continue
            field = fields[item]
            keys.append(item)
            here = others = list(sections_of(field.annotation).values())
            accepted = accepted_by(field.annotation, field.metadata)
            named = get_origin(field.annotation) is dict
    return keys, here, others, accepted
