"""Regions of cells, and refinement, which hands down regions and parts."""

import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.errors import InputError
from contact.mesh.domain import from_mesh
from contact.mesh.grid import Piece, box, rectangle
from contact.mesh.transfer import refined
from tests.problems.sizes import integral, measures

COMM = MPI.COMM_WORLD


def two_regions():
    mesh = dmesh.create_rectangle(
        COMM, [(0, 0), (4, 1)], [8, 2], ghost_mode=dmesh.GhostMode.shared_facet
    )
    regions = {"left": lambda x: x[0] < 1.01, "all": lambda x: x[0] < 5.0}
    return from_mesh(mesh, {"bottom": lambda x: x[1] < 0.01}, regions=regions)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("refine", [False, True])
def test_regions(refine):
    domain = refined(two_regions()) if refine else two_regions()
    volumes = {name: integral(domain, region=name) for name in domain.regions}
    assert volumes == pytest.approx({"left": 1.0, "all": 4.0})
    one = fem.Constant(domain.mesh, 1.0)
    mixed = fem.form(one * domain.dx + one * domain.dx_in("left") + one * domain.ds("bottom"))
    assert COMM.allreduce(fem.assemble_scalar(mixed)) == pytest.approx(9.0)
    with pytest.raises(InputError, match=r"\[part-name\]"):
        domain.cells("lift")
    with pytest.raises(InputError, match=r"\[part-facets\]"):
        from_mesh(domain.mesh, {}, regions={"none": lambda x: x[0] > 5.0})


def refinable():
    ghosted = dmesh.create_unit_cube(COMM, 2, 2, 2, ghost_mode=dmesh.GhostMode.shared_facet)
    return {
        "rectangle": lambda: rectangle(
            COMM, (0, 0), (4, 1), (8, 2), {"a": Piece("top", 2.0, 4.0)}, rotation=20.0
        ),
        "box": lambda: box(COMM, (0, 0, 0), (4, 1, 2), (4, 1, 2), {"a": Piece("left")}),
        "ghosted": lambda: from_mesh(ghosted, {"a": lambda x: x[2] < 0.6}),
        "two cells": lambda: rectangle(COMM, (0, 0), (1, 1), (1, 1)),
    }


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("kind", ["rectangle", "box", "ghosted", "two cells"])
def test_refinement_keeps_the_parts(kind):
    coarse = refinable()[kind]()
    fine = refined(refined(coarse))
    assert measures(fine) == pytest.approx(measures(coarse))
    assert integral(fine) == pytest.approx(integral(coarse))
    assert fine.size == coarse.size
    assert list(fine.parts) == list(coarse.parts)
    dim = coarse.dim
    count = [d.mesh.topology.index_map(dim).size_global for d in (coarse, fine)]
    assert count[1] == count[0] * 2 ** (2 * dim)
    for name in coarse.parts:
        facets = [COMM.allreduce(d.facets(name).size) for d in (coarse, fine)]
        assert facets[1] == facets[0] * 2 ** (2 * (dim - 1))
