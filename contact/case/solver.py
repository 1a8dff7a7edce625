"""Section of the case file about the method: the options that the methods themselves take."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from pydantic import AfterValidator, Discriminator, PlainSerializer, Tag

from contact.case.messages import fault, keys_of
from contact.case.section import FromTable, check_conditions, without_effect
from contact.methods.options import OPTIONS, FixedPointOptions, NewtonOptions, Options
from contact.settings import Accepted

#: The options where the case file names no method.
DEFAULT = NewtonOptions()


def _method(given: Any) -> str:
    method = given.get("method", DEFAULT.method) if isinstance(given, Mapping) else None
    return str(getattr(given, "method", method))


def _check(options: Options) -> Options:
    check_conditions(options)
    if isinstance(options, FixedPointOptions) and options.inner_tolerance is not None:
        if options.inner_tolerance > options.tolerance:
            accepted = f"at most tolerance = {options.tolerance:g}"
            raise fault("inner_tolerance", options.inner_tolerance, accepted)
    return options


def _read(options: Options) -> dict[str, Any]:
    of: type = type(options)
    keys = (key for key in keys_of(of) if key not in without_effect(options))
    return {key: getattr(options, key) for key in keys if getattr(options, key) is not None}


#: `[solver]`: the options of one method, by its name: one of those that `OPTIONS` lists.
if TYPE_CHECKING:
    Solver: TypeAlias = Options
else:
    Solver = Annotated[
        reduce(or_, (Annotated[kind, FromTable, Tag(name)] for name, kind in OPTIONS.items())),
        Discriminator(_method),
        AfterValidator(_check),
        PlainSerializer(_read),
        Accepted("a table"),
    ]
