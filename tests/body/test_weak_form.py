"""The terms of the residual of a body, each by its closed form for linear fields."""

import numpy as np
import pytest
import ufl
from mpi4py import MPI

from contact import Body, Elastic, Fixed, Linear, Load
from contact.body.equilibrium import BodyEquilibrium
from contact.body.loads import assembled
from contact.mesh.domain import compiled
from contact.mesh.grid import rectangle
from tests.problems.piezo import SCALED

COMM = MPI.COMM_WORLD


@pytest.mark.core
@pytest.mark.parallel(2)
@pytest.mark.filterwarnings("ignore:Load.force=")
def test_each_term_of_the_residual():
    """R(x; z) of [0, 2] x [0, 1] with u = (a x, b y), phi = c y, v = (x, 2 y), xi = 3 y."""
    a, b, c = 0.3, -0.2, 0.7
    law, crystal = Linear(58.7, 0.3), SCALED.crystal().in_plane()
    loads = [
        Load(body_force=[0.5, 0.25], body_charge=0.4),
        Load("top", traction=[1.0, -0.5], pressure=2.0, charge=0.3),
        Load("right", force=[0.8, 0.6]),
    ]
    elastic = Elastic("right", [3.0, 2.0], normal=5.0)
    fixed = Fixed("left", [0.0, 0.0], potential=0.0)
    described = Body(law, fixed, loads, piezo=crystal, elastic=elastic)
    body = BodyEquilibrium(rectangle(COMM, (0, 0), (2, 1), (4, 3)), described)

    points = body.layout.points
    x, z = (
        np.column_stack([points * scales[:2], scales[2] * points[:, 1] / body.phi_scale])
        for scales in np.array([[a, b, c], [1.0, 2.0, 3.0]])
    )
    body.forms.put(body.nodal(body.local(x.ravel())), np.zeros(0))
    terms = body.forms.residual(body.forms.split(ufl.TestFunction(body.space)))
    work = [assembled(compiled(term.form), body.owned) @ z.ravel() for term in terms]
    found = [COMM.allreduce(float(value), op=MPI.SUM) for value in work]

    strain, field = np.diag([a, b, 0.0]), np.array([0.0, c, 0.0])
    stress = (law.bulk - 2 / 3 * law.shear) * (a + b) * np.eye(3) + 2 * law.shear * strain
    stress += np.einsum("ijk,i->jk", crystal.e, field)
    charge = np.einsum("ijk,jk->i", crystal.e, strain) - crystal.beta @ field
    known = {
        "internal forces": 2 * (stress[0, 0] + 2 * stress[1, 1] + 3 * charge[1]),
        "elastic supports": (3 + 5) * 2 * a * 2 + 2 * b * 2 / 3,
        "body force": -(0.5 * 2 + 0.25 * 2),
        "traction": -(1.0 * 2 - 0.5 * 4),
        "resultant": -(0.8 * 2 + 0.6 * 1),
        "pressure": 2.0 * 4,
        "body charge": 0.4 * 3,
        "charge": -0.3 * 6,
    }
    assert found == pytest.approx([*known.values()], rel=1e-12, abs=1e-12)
