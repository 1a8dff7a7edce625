"""Foundations, and boundary forms integrated by the vertex rule against nodal sums."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact import Contact, Friction, GapFunction, InputError, Plane, Sphere
from contact.mesh.grid import box, rectangle
from contact.problem.problem import ContactProblem
from contact.thesis.penalty import PenalisedLaw, Regularisation
from contact.thesis.uzawa import augmentation
from forms import foundation as forms
from forms.laws import ConstantCoefficient
from tests.problems.mechanics import bar, flat, leaning_block

R, EPS = 3.7, 0.02


def turned(dim):
    """Return a problem whose contact part is flat but along no axis."""
    if dim == 2:
        example = bar(MPI.COMM_SELF, 4)
        domain = rectangle(MPI.COMM_SELF, [0, 0], [1, 1], [5, 2], rotation=25.0)
    else:
        example = leaning_block(MPI.COMM_SELF, 2)
        domain = box(
            MPI.COMM_SELF, [0] * 3, [1] * 3, [3, 2, 1], rotation=25.0, axis=(1.0, 2.0, 0.5)
        )
    body = example.description
    supported = type(body)(body.law, [type(body.fixed[0])("top", body.fixed[0].displacement)])
    friction = Friction(ConstantCoefficient(0.4))
    gap = GapFunction(lambda points: 0.02 * np.sin(5 * points[:, 0]))
    return ContactProblem(domain, supported, Contact("bottom", gap, press=True), friction)


@pytest.fixture(scope="module", params=[2, 3], ids=["in the plane", "in space"])
def problem(request):
    return turned(request.param)


@pytest.fixture(scope="module")
def x(problem):
    """Return random unknowns, also where they are fixed."""
    return 0.03 * np.random.default_rng(5).standard_normal(problem.body.owned)


def vertex_rule(problem):
    return problem.domain.ds("bottom")(
        metadata={"quadrature_rule": "vertex", "quadrature_degree": 1}
    )


def field(problem, values):
    """Return a scalar P1 function with nodal values on the contact nodes."""
    function = fem.Function(fem.functionspace(problem.domain.mesh, ("Lagrange", 1)))
    function.x.array[problem.nodes.nodes] = values
    return function


def assembled(form):
    return fem.assemble_vector(fem.form(form)).array


def lumped(problem, vectors):
    total = np.zeros(problem.body.owned)
    problem.nodes.add_jump_transposed(problem.nodes.weight[:, None] * vectors, total)
    return total


@pytest.mark.core
def test_augmentation_is_the_form_of_the_augmentation_form(problem, x):
    body, nodes = problem.body, problem.nodes
    v, nu, ds = ufl.TestFunction(body.space), normal_of(problem), vertex_rule(problem)
    for friction in (True, False):
        blocks = augmentation(nodes, R, friction)
        total = lumped(problem, np.einsum("nij,nj->ni", blocks, nodes.jump(x)))
        form = forms.augmentation_form(body.function(x), v, nu, R, friction) * ds
        assert assembled(form) == pytest.approx(total, abs=1e-15)


def normal_of(problem):
    return ufl.FacetNormal(problem.domain.mesh)


@pytest.mark.core
def test_auxiliary_load(problem):
    random = np.random.default_rng(6)
    nodes, v = problem.nodes, ufl.TestFunction(problem.body.space)
    phi_c, lam_c = random.standard_normal((2, nodes.size))
    phi_f, lam_f = fem.Function(problem.body.space), fem.Function(problem.body.space)
    for function in (phi_f, lam_f):
        function.x.array[:] = random.standard_normal(function.x.array.size)
    form = forms.auxiliary_load(
        field(problem, phi_c), phi_f, field(problem, lam_c), lam_f, v, normal_of(problem), R
    )
    tangential = [nodes.tangential_component(nodes.jump(f.x.array)) for f in (phi_f, lam_f)]
    vectors = (R * phi_c - lam_c)[:, None] * nodes.normal + R * tangential[0] - tangential[1]
    assert assembled(form * vertex_rule(problem)) == pytest.approx(
        lumped(problem, vectors), abs=1e-14
    )


@pytest.mark.core
def test_penalty_forms(problem, x):
    body, nodes = problem.body, problem.nodes
    v, nu, ds = ufl.TestFunction(body.space), normal_of(problem), vertex_rule(problem)
    u, nodal = body.function(x), nodes.jump(x)
    laws = PenalisedLaw(problem.interface, Regularisation(EPS, EPS), nodal)
    multipliers = laws.multipliers(nodal)
    gap = field(problem, nodes.gap)
    assert 0 < np.count_nonzero(multipliers.contact) < nodes.size
    normal = forms.penalty(u, v, nu, gap, EPS) * ds
    expected = lumped(problem, multipliers.contact[:, None] * nodes.normal)
    assert assembled(normal) == pytest.approx(expected, abs=1e-14)
    pressure = multipliers.contact
    bound = field(problem, problem.interface.friction.bound(pressure, pressure))
    friction = forms.penalty_friction(u, u, v, nu, bound, EPS) * ds
    assert assembled(friction) == pytest.approx(lumped(problem, multipliers.friction), abs=1e-14)


@pytest.mark.core
def test_plane():
    plane = Plane((0.0, -1.0), (0.0, 2.0))
    points = np.array([[0.3, 0.5], [2.0, -1.0]])
    down = np.array([[0.0, -1.0], [np.sin(0.3), -np.cos(0.3)]])
    direction, gap = plane.measure(points, down)
    assert direction.tolist() == [[0.0, -1.0]] * 2
    assert gap == pytest.approx([1.5, 0.0])
    direction, gap = Plane((0.0, -1.0), (0.0, 1.0), direction="body").measure(points[[0, 0]], down)
    assert direction is down
    assert gap == pytest.approx([1.5, 1.5 / np.cos(0.3)])
    # A normal that does not lead to the foundation never meets it.
    away = Plane((0.0, -1.0), (0.0, 1.0), direction="body").measure(points, -down)[1]
    assert np.all(np.isinf(away))


@pytest.mark.core
@pytest.mark.parametrize("inside", [False, True])
def test_sphere_along_its_radius_and_along_the_body_s_normal(inside):
    sphere = Sphere((1.0, 0.0, 0.0), 2.0, inside)
    random = np.random.default_rng(0)
    unit = random.standard_normal((20, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    distance = random.uniform(0.5, 1.9, 20) if inside else random.uniform(2.1, 5, 20)
    points = sphere.centre + distance[:, None] * unit
    direction, gap = sphere.measure(points, unit)
    assert direction == pytest.approx(unit if inside else -unit)
    assert gap == pytest.approx(np.abs(distance - 2.0))
    nearly = direction + 0.1 * random.standard_normal((20, 3))
    nearly /= np.linalg.norm(nearly, axis=1)[:, None]
    along, gap = Sphere((1.0, 0.0, 0.0), 2.0, inside, direction="body").measure(points, nearly)
    touching = points + gap[:, None] * along
    met = np.isfinite(gap)
    assert met.any()
    assert np.linalg.norm(touching - sphere.centre, axis=1)[met] == pytest.approx(2.0)
    assert np.all(gap[met] > 0)
    away = Sphere((1.0, 0.0, 0.0), 2.0, False, direction="body").measure(points, unit)[1]
    assert inside or np.all(np.isinf(away)), "a ray that leads away never touches"


@pytest.mark.core
def test_gap_function_and_directions_of_the_body():
    direction, gap = flat(0.3).measure(np.zeros((4, 2)), np.tile([0.0, -1.0], (4, 1)))
    assert gap.tolist() == [0.3] * 4
    assert direction.shape == (4, 2)


def test_a_foundation_that_no_node_can_reach_is_refused():
    example = bar(MPI.COMM_SELF, 4)
    with pytest.raises(InputError, match=r"\[foundation-missed\]"):
        ContactProblem(
            example.domain,
            example.description,
            Contact("bottom", Plane((0, 9), (0, -1), direction="body")),
        )
