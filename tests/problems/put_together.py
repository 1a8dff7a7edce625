"""A block over a foundation, put together in Python."""

from typing import Any

from mpi4py import MPI

from contact import Body, Contact, Domain, Fixed, Linear, Problem
from contact.mesh.grid import rectangle

LAW = Linear(10.0, 0.3)
TOP = Fixed("top", [0.0, -0.005])


def block() -> Domain:
    return rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (8, 4))


def problem(
    *fixed: Any, loads: Any = (), contact: Any = None, law: Any = LAW, **more: Any
) -> Problem:
    domain, contact = block(), Contact("bottom") if contact is None else contact
    return Problem(domain, Body(law, fixed or (TOP,), loads, **more), contact)
