"""Forms over parts and regions: the same code whatever their numbers, and the same values."""

import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact import Body, Fixed, Linear, Load
from contact.body.equilibrium import BodyEquilibrium
from contact.mesh.domain import compiled, from_mesh
from contact.mesh.grid import Piece, rectangle
from contact.model.material import Material
from tests.problems.sizes import integral

COMM = MPI.COMM_WORLD

pytestmark = pytest.mark.parallel(2)


def layers():
    """Return a plate of two regions, whose side on top has a part of its own."""
    plain = rectangle(COMM, (0, 0), (4, 1), (8, 4), {"loaded": Piece("top", 2.0, 4.0)})
    regions = {"low": lambda x: x[1] < 0.51, "high": lambda x: x[1] > 0.49}
    return from_mesh(plain.mesh, plain.parts, regions=regions)


def code(form):
    """Return the name of the module of compiled code."""
    return form.module.__name__


def value(form):
    return COMM.allreduce(fem.assemble_scalar(form))


def test_other_parts_are_the_same_code():
    domain = layers()
    x = ufl.SpatialCoordinate(domain.mesh)
    forms = {part: compiled((x[0] + 2 * x[1]) * domain.ds(part)) for part in domain.parts}
    assert len({code(form) for form in forms.values()}) == 1
    for part, form in forms.items():
        known = integral(domain, lambda x, _: x[0] + 2 * x[1], part)
        assert value(form) == pytest.approx(known, rel=1e-13)
    low, high = (compiled(x[0] * x[1] * domain.dx_in(name)) for name in ("low", "high"))
    assert code(low) == code(high) and value(low) == pytest.approx(1.0, rel=1e-13)
    assert value(high) == pytest.approx(3.0, rel=1e-13)


def test_parts_that_overlap_and_cells_in_one_form():
    domain = layers()
    x = ufl.SpatialCoordinate(domain.mesh)
    form = x[0] * domain.ds("top") + 3 * x[0] * domain.ds("loaded") + x[1] * domain.ds("right")
    form += x[0] * domain.dx + 2 * x[1] * domain.dx_in("high")
    # 8 + 3 * 6 + 1/2 on the sides, 8 + 2 * 3/2 inside.
    assert value(compiled(form)) == pytest.approx(8 + 18 + 0.5 + 8 + 3, rel=1e-13)
    assert value(compiled(form)) == pytest.approx(value(fem.form(form)), rel=1e-13)


def test_materials_of_one_law_are_the_same_code_and_so_are_loads():
    domain = layers()
    materials = [Material(Linear(1.0, 0.3), on="low"), Material(Linear(2.0, 0.2), on="high")]
    loads = [Load("top", traction=[0.0, -0.1]), Load("right", traction=[0.2, 0.0])]
    body = BodyEquilibrium(domain, Body(materials, Fixed("bottom", [0.0, 0.0]), loads))
    for forms in (body.forms.law_forces, body.forms.secant):
        assert len(forms) == 2 and len({code(form) for form in forms}) == 1
    shares = body._loads._shares
    assert len({code(form) for share in shares for form in share.forms}) == 1
    total = [COMM.allreduce(sum(body.nodal(body.external())[:, k])) for k in range(2)]
    assert total == pytest.approx([0.2, -0.4], rel=1e-12)
