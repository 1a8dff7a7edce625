"""Section of the case file about the method: the options that the methods themselves take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Discriminator, PlainSerializer

from contact.case.accepted import either
from contact.case.showing import shown
from contact.case.types import UNKNOWN, FromTable, fault
from contact.case.unions import union_of
from contact.methods.options import (
    OPTIONS,
    FixedPointOptions,
    NewtonOptions,
    Options,
)
from contact.settings import Accepted, read_by, settings_of

#: The options where the case file names no method.
DEFAULT = NewtonOptions()


def _method(given: Any) -> Any:
    if isinstance(given, Mapping):
        return given.get("method", DEFAULT.method)
    return getattr(given, "method", None)


def _member(given: Any) -> str | None:
    """Return the tag of the union's member that a table belongs to."""
    return OPTIONS[_method(given)].__name__ if isinstance(given, Mapping | Options) else None


def _refuse_unread(given: Any) -> Any:
    """Refuse a method that is none, and keys that the chosen one does not read."""
    if not isinstance(given, Mapping):
        return given
    method = _method(given)
    if not isinstance(method, str) or method not in OPTIONS:
        raise fault("method", method, either([shown(name) for name in OPTIONS]))
    offered = settings_of(OPTIONS[method])
    for key, value in given.items():
        if key in offered:
            needs = offered[key].condition
            if needs is not None and needs.value != given.get(
                needs.key, offered[needs.key].default
            ):
                raise fault(key, value, f"{key} with {needs.key} = {shown(needs.value)}")
            continue
        readers = [name for name, options in OPTIONS.items() if key in settings_of(options)]
        if readers:
            names = either([shown(name) for name in readers])
            raise fault(key, value, f"{key} with method = {names}")
        if key in {field.name for field in fields(OPTIONS[method])}:  # for Python alone
            raise fault(key, UNKNOWN, ", ".join(offered))
    return given


def _check(options: Options) -> Options:
    if isinstance(options, FixedPointOptions) and options.inner_tolerance is not None:
        if options.inner_tolerance > options.tolerance:
            accepted = f"at most tolerance = {options.tolerance:g}"
            raise fault("inner_tolerance", options.inner_tolerance, accepted)
    return options


def _read(options: Options) -> dict[str, Any]:
    return {key: value for key, value in read_by(options).items() if value is not None}


#: `[solver]`: the options of one method, by its name: one of those that `OPTIONS` lists.
if TYPE_CHECKING:
    Solver: TypeAlias = Options
else:
    Solver = Annotated[
        union_of(OPTIONS.values(), FromTable),
        Discriminator(_member),
        BeforeValidator(_refuse_unread),
        AfterValidator(_check),
        PlainSerializer(_read),
        Accepted("a table"),
    ]
