"""Parts of bodies whose meshes are apart that face each other: where contact may be."""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from contact.interface.mortar.coupling import couple
from contact.interface.mortar.surface import Surface, surface_of
from contact.interface.pairing import CHORDS, REACH
from contact.mesh.domain import Domain
from contact.mesh.entities import components, owned_among


def facing_parts(domain: Domain) -> list[tuple[str, str]]:
    """Return pairs of parts of different bodies that face each other, nearest first. Collective.

    The finer side is the first of a pair. Parts that belong to several bodies are left out.
    """
    space = fem.functionspace(domain.mesh, ("Lagrange", 1))
    piece, count = components(space)
    if count == 1:
        return []
    comm = domain.comm
    sides: list[tuple[float, str, Surface, Surface, int]] = []
    for name in sorted(domain.parts):
        own = surface_of(domain, space, name)
        every = own.gathered(comm)
        _, local = owned_among(space.dofmap.index_map, every.nodes.ravel())
        there = np.zeros(count, dtype=np.intc)
        there[piece[local]] = 1
        comm.Allreduce(MPI.IN_PLACE, there, op=MPI.MAX)
        if there.sum() == 1:
            sides.append((float(every.radii.mean()), name, own, every, int(there.argmax())))
    found = []
    sides.sort(key=lambda side: side[:2])
    for i, (_, on, slave, fine, body) in enumerate(sides):
        for _, against, _, master, other in sides[i + 1 :]:
            if other == body:
                continue
            gap = couple(slave, master, REACH * domain.size, comm).gap
            # They look away from each other where it is negative.
            if gap.size and gap.min() > -2 * CHORDS * float(fine.radii.max()):
                found.append((float(gap.min()), on, against))
    return [(on, against) for _, on, against in sorted(found)]
