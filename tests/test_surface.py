"""The names that the package offers: documented, importable."""

import collections.abc
import doctest
import inspect
import re
import sys
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

import contact

#: Arguments and attributes that take any value, and why no type says more.
ANYTHING = {
    "parse_case: data": "tables of a file, whose values are checked one by one, with a message",
    "Solution.view: return": "what pyvista shows in a notebook; nothing after a window",
    "Solution.movements: return": "tables as in summary.json, of numbers and lists",
    "Solution: source": "the Case, whose module is above that of results",
    "make_material: keys": "keys of a table, in which there are lists and tables",
}

#: Types that say nothing of what is in them.
BARE = (Any, object, dict, list, tuple, set, type)
BARE += (collections.abc.Callable, collections.abc.Mapping, collections.abc.Sequence)


def test_each_name_is_there_and_documented_with_examples_that_are_right() -> None:
    runner = doctest.DocTestRunner(verbose=False)  # which prints what fails
    for name in contact.__all__:
        found = getattr(contact, name)
        assert name in dir(contact)
        assert isinstance(found, str) or found.__doc__, name
        module = sys.modules.get(getattr(found, "__module__", ""))
        for test in doctest.DocTestFinder().find(found, name, module) if module else ():
            runner.run(test)
    assert runner.tries > 0 and runner.failures == 0


def anything(hint: Any) -> bool:
    """Tell whether a type, or one within it, takes any value, but for arrays of any shape."""
    if hint in BARE:
        return True
    if isinstance(hint, list):  # the arguments of a function
        return any(map(anything, hint))
    origin = typing.get_origin(hint)
    if isinstance(origin, type) and issubclass(origin, np.ndarray | np.generic | np.dtype):
        return False
    inner = () if origin is typing.Literal else typing.get_args(hint)
    return any(map(anything, inner))


def untyped(annotations: Mapping[str, Any], module: str) -> set[str]:
    """Return which of the annotated names of a module take any value."""
    found = set()
    for name, annotation in annotations.items():
        hint = annotation
        if isinstance(annotation, str):
            try:
                hint = eval(annotation, vars(sys.modules[module]))
            except NameError:  # imported for type checkers alone
                hint = Any if re.search(r"\b(Any|object)\b", annotation) else str
        if anything(hint):
            found.add(name)
    return found


def functions(made: Any) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Give a function, or the public methods and properties of a class of the program."""
    if inspect.isfunction(made):
        yield "", made
        return
    seen: set[str] = set()
    for base in inspect.getmro(made):
        for name, member in [*vars(base).items()]:  # pydantic adds some when they are asked for
            if name in seen:  # a class of its own has taken its place
                continue
            seen.add(name)
            if isinstance(member, staticmethod | classmethod):
                member = member.__func__
            member = getattr(member, "fget", getattr(member, "func", member))
            public = not name.startswith("_") or name in ("__init__", "__call__")
            if inspect.isfunction(member) and public and of_the_program(member.__module__):
                yield f".{name}", member


def of_the_program(module: str) -> bool:
    """Tell whether a module is one of the program."""
    return module.split(".")[0] in ("contact", "forms")


def found_untyped(name: str, made: Any) -> set[str]:
    """Return the arguments, results and attributes of a public name that take any value."""
    found = set()
    for label, function in functions(made):
        for argument in inspect.signature(function).parameters.values():
            if argument.annotation is inspect.Parameter.empty and argument.name != "self":
                assert argument.name == "cls", f"{name}{label}: {argument.name} without a type"
        # That of a dataclass, or a section, has the types of its fields, which are looked at below.
        if not function.__code__.co_filename.endswith(("<string>", "model/section.py")):
            found |= {
                f"{name}{label}: {argument}"
                for argument in untyped(function.__annotations__, function.__module__)
            }
    for base in inspect.getmro(made) if inspect.isclass(made) else ():
        if of_the_program(base.__module__):
            fields = {k: v for k, v in inspect.get_annotations(base).items() if k[0] != "_"}
            found |= {f"{name}: {field}" for field in untyped(fields, base.__module__)}
    return found


def test_public_signatures_have_types() -> None:
    found: set[str] = set()
    for name in contact.__all__:
        made = getattr(contact, name)
        found |= set() if isinstance(made, str) else found_untyped(name, made)
    assert found == ANYTHING.keys()
