"""Checks of laws with internal variables, built in or a user's own, and of their responses."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from mpi4py import MPI

from contact.arguments import SAMPLES, Returned, check_finite, expect, naming, real, shorten
from contact.ranks import on_all_ranks
from contact.typing import Array
from forms.history import HistoryLaw, Response, with_stiffness
from forms.plane_stress import HenckyAtPoints, PlaneStressHistory

#: Names of variables, which are those of fields and of arrays in files.
NAME = "an identifier of ASCII letters, digits and underscores"

#: Optional parts of a response.
ENERGIES = "dissipation", "energy"
OPTIONAL = "stiffness", *ENERGIES


def name_of(law: object) -> str:
    """Return a law's class for messages, in plane stress that of its base."""
    while isinstance(law, PlaneStressHistory | HenckyAtPoints):
        law = law.base
    return type(law).__name__


def first_values(law: HistoryLaw, size: int) -> dict[str, Array]:
    """Return the variables in the reference configuration, with s = `size` components, checked."""
    place = f"{name_of(law)}: variables"
    with naming(place):
        given = law.variables(size)
        _returned(given, "a mapping of names to numbers, {} for none", isinstance(given, Mapping))
    found = {}
    for name, value in given.items():
        fits = isinstance(name, str) and name.isascii() and name.isidentifier()
        expect(f"{place}: the name", name, NAME, fits, "law-variables")
        with naming(f"{place}: {name!r}"):
            found[name] = real(value, np.shape(value), "a real number, or an array of them")
    return found


def respond(
    law: HistoryLaw, strain: Array, variables: Mapping[str, Array], kind: str = ""
) -> Response:
    """Return `HistoryLaw.respond` of a law at n points, checked, with the stiffness of `kind`."""
    place, (n, size) = f"{name_of(law)}: respond", strain.shape
    with naming(place):
        found = law.respond(strain, variables, kind)
        _returned(found, "a Response(stress, variables, ...)", isinstance(found, Response))
    with naming(f"{place}: variables"):
        given = [*found.variables] if isinstance(found.variables, Mapping) else found.variables
        fits = isinstance(given, list) and {*given} == variables.keys()
        _returned(given, f"a mapping with the names {[*variables]}", fits)
    shapes = {"stress": (n, size), "stiffness": (n, size, size)} | dict.fromkeys(ENERGIES, (n,))
    parts = [(name, getattr(found, name), shape) for name, shape in shapes.items()]
    parts += [(repr(name), found.variables[name], had.shape) for name, had in variables.items()]
    for name, value, shape in parts:
        if value is None and name in OPTIONAL:
            continue
        with naming(f"{place}: {name}"):
            _check_array(value, shape)
    with naming(place):
        return with_stiffness(law, strain, variables, kind, found)


def _returned(given: object, accepted: str, fits: bool) -> None:
    """Refuse a returned value unless it fits, inside `naming`."""
    if not fits:
        raise Returned(f"the function returns {shorten(repr(given))}; accepted: {accepted}")


def _check_array(given: object, shape: tuple[int, ...]) -> None:
    """Refuse all but real arrays of a shape, inside `naming`."""
    accepted = f"an array of real numbers of shape {shape}, a row per point"
    _returned(given, accepted, isinstance(given, np.ndarray))
    assert isinstance(given, np.ndarray)
    if given.dtype.kind not in "biuf" or given.shape != shape:
        shown = f"values of shape {given.shape} ({given.dtype})"
        raise Returned(f"the function returns {shown}; accepted: {accepted}")


def check_law(law: HistoryLaw, size: int, comm: MPI.Intracomm) -> None:
    """Refuse, on all ranks, a law that fails at zero or small strains of `size` components."""
    law = law.base if isinstance(law, PlaneStressHistory) else law
    with on_all_ranks(comm):
        first = first_values(law, size)
    every = comm.allgather([(name, value.shape) for name, value in first.items()])
    words = "the same names and shapes on all ranks"
    fits = all(each == every[0] for each in every)
    expect(f"{name_of(law)}: variables", every, words, fits, "law-variables")
    small = [way * SAMPLES[k] * np.eye(size) for way in (1, -1) for k in (0, 12)]
    strain = np.concatenate([np.zeros((1, size)), *small])
    variables = {
        name: np.broadcast_to(value, (len(strain), *value.shape)) for name, value in first.items()
    }
    with on_all_ranks(comm), np.errstate(all="ignore"):
        for kind in ("", "tangent", "secant"):
            found = respond(law, strain, variables, kind)
            for name in ("stress", *OPTIONAL):
                if (values := getattr(found, name)) is not None:
                    with naming(f"{name_of(law)}: respond: {name}"):
                        rows = values.reshape(len(strain), -1).sum(axis=1)
                        check_finite(rows, lambda i: f"at the strain {strain[i].tolist()}")
