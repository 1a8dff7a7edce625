"""Curved sides that touch are accepted, though their facets cut each other; overlaps are told."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import (
    Body,
    Contact,
    Linear,
    Problem,
)
from contact.errors import InputError
from tests.problems import overlapping
from tests.problems.overlapping import ELEMENTS, PLANE, POISSON, SPACE, YOUNG, body, layers, told

COMM = MPI.COMM_WORLD

#: Cells in the plane; quadrilaterals find what triangles do.
IN_PLANE = ("triangle", pytest.param("quadrilateral", marks=pytest.mark.slow))


@pytest.mark.parallel(2)
@pytest.mark.parametrize("counts", [(7, 12), (16, 9)])
@pytest.mark.parametrize("cell", [*PLANE, *SPACE])
def test_ellipses_that_touch_are_accepted(cell, counts):
    """Their curvature is known to some per cent alone, from the corners of facets."""
    for axis in (0.5, 2.0):
        domain = layers(COMM, cell, 1, "ring", 0.0, counts=counts)
        domain.mesh.geometry.x[:, 1] *= axis
        check_refused(domain, 0.0)


@pytest.mark.parallel(2)
@pytest.mark.parametrize("cell", IN_PLANE)
def test_waves_that_touch_are_accepted(cell):
    """Their curvature changes by its own size from facet to facet; deeper is an overlap."""
    for counts in ((6, 4), (4, 7)):
        for height, periods, order in ((0.05, 1, 1), (0.1, 0.75, 1), (0.05, 1, 2), (0.1, 0.75, 2)):
            for depth in (0.0, 0.3 / min(counts)):
                domain = layers(COMM, cell, order, "flat", depth, counts=counts)
                x = domain.mesh.geometry.x
                x[:, 0] += height * np.sin(2 * np.pi * periods * x[:, 1])
                check_refused(domain, depth)


def of_half_ellipses(cell, order, axis, counts, depth):
    """Return two shells around half an ellipse; facets are longest at the tip, half a radius."""
    domain = layers(COMM, cell, order, "flat", depth, counts=counts)
    x, y = domain.mesh.geometry.x, domain.mesh.geometry.x[:, 1] - 0.5
    angle = np.pi * y * (1.25 - y**2)
    x[:, :2] = np.column_stack([x[:, 0] * np.cos(angle), axis * x[:, 0] * np.sin(angle)])
    return domain


@pytest.mark.parallel(2)
@pytest.mark.parametrize("cell", [*IN_PLANE, "hexahedron"])
def test_curved_cells_that_turn_are_accepted(cell):
    """Edges of a body are where normals at the ends of its facets differ, not those of chords."""
    for counts in ((4, 5), (5, 9), (4, 13)) if cell in PLANE else ((5, 9),):
        for axis in (0.5, 0.35):
            for depth in (0.0, 0.3 / min(counts)):
                check_refused(of_half_ellipses(cell, 2, axis, counts, depth), depth, 2.0)


@pytest.mark.parallel
@pytest.mark.parametrize("cell", PLANE)
def test_a_coarse_tip_is_refused_with_the_way_out(cell):
    """Its vertices may be those of a polygon, which overlaps; flat sides are told none of it."""
    for axis in (0.5, 0.35):
        domain = of_half_ellipses(cell, 1, axis, (4, 5), 0.0)
        contact = Contact("outer0", against="inner1")
        told(domain, Body(Linear(YOUNG, POISSON), []), contact, words="(mesh.order)")
    with pytest.raises(InputError) as raised:
        Problem(layers(COMM, cell, 1, "flat", 0.1), body("flat", 2, 2), contact)
    assert "curve whose" not in str(raised.value)


@pytest.mark.parallel(2)
@pytest.mark.parametrize("cell", PLANE)
def test_steep_waves_of_curved_cells_are_accepted(cell):
    """Of up to three facets a period, where chords turn by a right angle."""
    for counts, periods in (((7, 4), 1), ((4, 13), 1), ((8, 20), 2)):
        for depth in (0.0, 0.2 / min(counts)):
            domain = layers(COMM, cell, 2, "flat", depth, counts=counts)
            x = domain.mesh.geometry.x
            x[:, 0] += 0.2 * np.sin(2 * np.pi * periods * x[:, 1])
            check_refused(domain, depth, 2.0)


@pytest.mark.parallel(2)
@pytest.mark.parametrize("cell", SPACE)
def test_irregular_bowls_that_touch_are_accepted(cell):
    """Facets of a third of the radius whose normals are up to half a right angle apart."""
    for counts, turn in (((8, 6), 1.6), ((6, 8), 1.5)):
        for depth in (0.0, 0.3 * 1.5 * turn / min(counts)):
            domain = layers(COMM, cell, 1, "flat", depth, counts=counts)
            x = domain.mesh.geometry.x
            within = (np.abs(x[:, 1:] - 0.5) < 0.5 - 1e-9).all(axis=1)
            aside = np.where(within, np.sin(1e3 * (x @ [1.0, 8.0, 6.0])), 0.0)
            angle = turn * (x[:, 1:] - 0.5 + 0.3 / max(counts) * aside[:, None])
            way = np.column_stack([np.ones(len(x)), np.tan(angle)])
            x[:] = x[:, :1] * way / np.linalg.norm(way, axis=1)[:, None]
            check_refused(domain, depth)


@pytest.mark.parallel
@pytest.mark.parametrize("element", ELEMENTS)
def test_lenses_within_a_facet(element):
    """Two arcs that no vertex of either lies in: less deep than both sagittas, facets are apart.

    Gaps of degree 2 have the depth, or the warning of what is set to zero; curved cells refuse it.
    """
    order, degree = element
    for counts in ((5, 5), (5, 7)):
        sagittas = sum(1 / count**2 / 8 for count in counts)
        for share in (0.1, 0.6, 1.2, 2.0):
            depth = share * sagittas
            domain = layers(COMM, "quadrilateral", order, "flat", 0.0, counts=counts)
            x, second = domain.mesh.geometry.x, overlapping.of_layer(domain, 1)
            rise = depth / 2 - 1 + np.sqrt(1 - (x[:, 1] - 0.5) ** 2)
            x[:, 0] += np.where(second, -rise, rise)
            given, contact = Body(Linear(YOUNG, POISSON), []), Contact("outer0", against="inner1")
            if order == 2:
                assert 0.7 * depth < told(domain, given, contact, degree) < depth
            elif share > 1:
                found = told(domain, given, contact, degree)
                assert found == pytest.approx(depth - sagittas, rel=0.03)
            else:
                (found,) = Problem(domain, given, contact, degree=degree).geometries
                deepest = found.nodes.maximum(-found.nodes.gap, -1.0)
                if degree == 1:
                    assert found.cut < 1e-12 and deepest < 0.95 * (depth - sagittas)
                else:
                    assert deepest + found.cut == pytest.approx(depth, rel=0.05)


def check_refused(domain, depth, most=1.2):
    """Two layers are refused as a pair, and said to overlap without it, if there is a depth."""
    given = Body(Linear(YOUNG, POISSON), [])
    for on, against in (("outer0", "inner1"), ("inner1", "outer0")):
        if depth == 0:
            assert Problem(domain, given, Contact(on, against=against)).nodes.size > 0
            continue
        assert 0.3 * depth < told(domain, given, Contact(on, against=against)) < most * depth
    assert bool(Problem(domain, given, Contact("outer1", 0.1)).unpaired) == (depth > 0)
