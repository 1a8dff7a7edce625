"""Building blocks of descriptions: tables of a case file; for kinds of values see `values`."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from functools import cache
from typing import (
    Annotated,
    Any,
    ClassVar,
    Self,
    TypeVar,
    get_args,
    get_origin,
)

from pydantic import (
    BaseModel,
    ConfigDict,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticOmit, core_schema

from contact.model.formula import Expression
from contact.model.messages import (
    Words,
    accepted_by,
    describe,
    fault,
    fields_of,
    keys_of,
    shown,
)
from contact.settings import ReadWith

Table = TypeVar("Table")


class Section(BaseModel):
    """A table of the case file: frozen, without unknown keys, NaN or infinity.

    The docstring below a key is its description. A key with `ReadWith` is refused where it would
    have no effect, and left out where the case is written.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        arbitrary_types_allowed=True,  # objects of Python
        validate_default=False,
        use_attribute_docstrings=True,
        defer_build=True,  # the case's own is all that reads; each would take milliseconds
    )

    #: Unknown keys that a user may look for here, each with a hint to its place.
    hints: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="after")
    def _check_conditions(self) -> Self:
        return check_conditions(self)

    def __copy__(self) -> Self:
        """Return a copy without cached properties, which those of an update would not be."""
        made = super().__copy__()
        for name in made.__dict__.keys() - type(self).model_fields.keys():
            del made.__dict__[name]
        return made

    @model_serializer(mode="wrap")
    def _write(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        unread, keys = (
            without_effect(self),
            {n: f.alias or n for n, f in fields_of(type(self)).items()},
        )
        written = {keys.get(name, name): value for name, value in handler(self).items()}
        return {key: value for key, value in written.items() if key not in unread}


#: The context of a description that is made in Python, where values may be objects.
IN_PYTHON = {"python": True}


class Described(Section):
    """A section that is made in Python too: its `__init__` has the arguments of Python."""

    def __init_subclass__(cls, **options: Any) -> None:
        """Let tables be read without `__init__`, so that messages name their keys."""
        super().__init_subclass__(**options)
        cls.__init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        """Enter the keys under "Parameters" in the docstring, in the order of the arguments."""
        said = {key: field.description or "" for key, field in keys_of(cls).items()}
        own = [key for key in inspect.signature(cls.__init__).parameters if key in said] or [*said]
        lines = [line for key in own for line in (key, textwrap.indent(said[key], "    "))]
        text, _, examples = inspect.cleandoc(cls.__doc__ or "").partition("\n\nExamples\n")
        parts = [text, "\n".join(["Parameters", "----------", *lines])]
        cls.__doc__ = "\n\n".join([*parts, *([f"Examples\n{examples}"] if examples else [])])

    def __init__(self, **given: Any) -> None:
        try:
            self.__pydantic_validator__.validate_python(
                given, self_instance=self, context=IN_PYTHON
            )
        except ValidationError as error:
            raise describe(
                error, type(self), called(type(self).__name__, given.get("on"))
            ) from None


def called(title: Any, on: Any) -> str:
    """Return the name of a description in messages."""
    return f"{title} on {on!r}" if on else str(title)


@cache
def conditions(of: type) -> tuple[tuple[str, FieldInfo, ReadWith], ...]:
    """Return the keys of a kind of table that are read under a condition."""
    return tuple(
        (key, field, mark)
        for key, field in keys_of(of).items()
        for mark in field.metadata
        if isinstance(mark, ReadWith)
    )


def without_effect(table: Any) -> set[str]:
    """Return the keys of a table that are not read, given the others."""
    of: Any = type(table)
    return {key for key, _, needs in conditions(of) if not needs.met(value_of(table, needs.key))}


def value_of(table: Any, key: str) -> Any:
    """Return the value of a key, whose attribute may have another name."""
    of: Any = type(table)
    return getattr(table, next(n for n, f in fields_of(of).items() if key in (n, f.alias)))


def check_conditions(table: Table) -> Table:
    """Return a table, if no key is without effect and none is missing."""
    of: Any = type(table)
    for key, info, needs in conditions(of):
        value, other = value_of(table, key), value_of(table, needs.key)
        if not needs.met(other):
            if value != info.default:
                raise fault(key, as_given(value), f"{key} with {needs}")
        elif needs.required and value is None:
            accepted = accepted_by(info.annotation, info.metadata)
            raise fault(key, Words("missing"), f"{accepted} with {needs.key} = {shown(other)}")
    return table


class Own:
    """Marks an object of Python's among kinds of values: no case file has it."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        """Take it as it is; who gives the kind its tag knows it."""
        return core_schema.any_schema()

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        """Leave it out."""
        raise PydanticOmit


class FromTable:
    """Lets pydantic read a frozen dataclass from a table, with all the checks of a section."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> core_schema.CoreSchema:
        """Make the schema of the dataclass accept tables, without the fields for Python alone."""
        schema = handler.resolve_ref_schema(handler(source))
        # Strictness, which the fields are to have, would take instances alone here.
        schema["strict"] = False
        inner = schema["schema"]
        while "fields" not in inner:
            inner = inner["schema"]
        known = fields_of(source)
        inner["fields"] = [entry for entry in inner["fields"] if entry["name"] in known]
        for entry in inner["fields"]:
            if known[entry["name"]].is_required() and entry["schema"]["type"] == "default":
                entry["schema"] = entry["schema"]["schema"]
        return core_schema.no_info_before_validator_function(_with_tuples, schema)


def _with_tuples(given: Any) -> Any:
    # TOML has lists, and strict fields take tuples alone.
    if not isinstance(given, Mapping):
        return given
    return {key: tuple(v) if isinstance(v, list) else v for key, v in given.items()}


def walk(
    value: Any, path: tuple[str, ...] = (), marks: tuple[Any, ...] = ()
) -> Iterator[tuple[str, Any, tuple[Any, ...]]]:
    """Give all lists and values below a value of the case.

    Yields
    ------
    The dotted path, the value, and the marks of its type.
    """
    if isinstance(value, BaseModel) or is_dataclass(value):
        of: Any = type(value)
        for name, key, below in _marked(of):
            yield from walk(getattr(value, name), (*path, key), below)
        return
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield from walk(entry, (*path, key), marks)
        return
    yield ".".join(path), value, marks
    if isinstance(value, tuple):
        for i, entry in enumerate(value):
            yield from walk(entry, (*path, str(i)), marks)


@cache
def _marked(of: Any) -> tuple[tuple[str, str, tuple[Any, ...]], ...]:
    """Return the fields of a kind of table, their keys, and the marks of their types."""
    return tuple(
        (name, field.alias or name, (*field.metadata, *_marks(field.annotation)))
        for name, field in fields_of(of).items()
    )


def _marks(annotation: Any) -> Iterator[Any]:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        yield from arguments[1:]
    for argument in arguments[:1] if origin is Annotated else arguments:
        yield from _marks(argument)


def as_given(value: Any) -> Any:
    """Return a value of the case as a message shows it."""
    if isinstance(value, tuple):
        return [as_given(entry) for entry in value]
    return value.source if isinstance(value, Expression) else value
