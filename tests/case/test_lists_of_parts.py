"""Lists of parts where a part is asked for: as one name for all of them."""

import tomllib

import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact import Body, Contact, Fixed, InputError, Linear, Load, Problem, parse_case, solve
from contact.mesh.domain import part_name
from contact.mesh.grid import rectangle

BLOCK = """
[mesh]
generator = "rectangle"
size = [2.0, 1.0]
cells = [16, 8]
[mesh.parts.loaded]
side = "top"
from = 0.5
to = 1.5
[mesh.parts.near]
side = "bottom"
from = 0.0
to = 1.0
[mesh.parts.far]
side = "bottom"
from = 1.0
to = 2.0
[material]
young = 10.0
poisson = 0.3
[[fixed]]
on = {fixed}
displacement = [0.0, "free"]
[[load]]
on = {load}
traction = [0.0, -0.01]
[contact]
on = {contact}
[friction]
law = "coulomb"
mu = 0.3
"""


def block(fixed='["left", "right"]', load='"top"', contact='"bottom"'):
    return parse_case(tomllib.loads(BLOCK.format(fixed=fixed, load=load, contact=contact)))


def test_a_list_is_the_whole_that_its_parts_make():
    whole = solve(block())
    pieces = solve(block(load='["loaded", "top"]', contact='["near", "far"]'))
    assert whole.converged and pieces.converged
    assert pieces.state.x == pytest.approx(whole.state.x, abs=1e-12)
    # `loaded` is a piece of `top`: what is in both is loaded once.
    assert pieces.contact_force == pytest.approx(whole.contact_force, abs=1e-12)
    assert pieces.contact_area == pytest.approx(2.0)


def test_reactions_are_those_of_each_part():
    # The sides hold eps_x = 0: sigma_x = nu/(1 - nu) sigma_y.
    solution = solve(block())
    assert solution.reaction("left") == pytest.approx([0.3 / 0.7 * 0.01, 0.0], abs=1e-9)
    assert solution.reaction("right") == pytest.approx([-0.3 / 0.7 * 0.01, 0.0], abs=1e-9)


def test_measures_count_what_is_in_two_parts_once():
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (8, 4))
    x = ufl.SpatialCoordinate(domain.mesh)
    for given, expected in (("top", 2.0), (["top", "left"], 3.0), (["top", "top"], 2.0)):
        form = fem.form((1 + 0 * x[0]) * domain.ds(part_name(given)))
        assert fem.assemble_scalar(form) == pytest.approx(expected)


def test_lists_in_python():
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (16, 8))
    supports = [Fixed(["left", "right"], [0.0, None])]
    body = Body(Linear(10.0, 0.3), supports, [Load(["top"], [0.0, -0.01])])
    solution = solve(Problem(domain, body, Contact(["bottom"])))
    assert solution.contact_force == pytest.approx([0.0, -0.02])
    with pytest.raises(InputError, match=r"\[value\]"):
        Fixed([3], [0.0, 0.0])


def test_several_parts_are_one_electrode_and_one_rigid_body():
    text = """
    [mesh]
    generator = "rectangle"
    size = [2.0, 1.0]
    cells = [8, 4]
    [mesh.parts.one]
    side = "left"
    from = 0.25
    to = 0.75
    [mesh.parts.two]
    side = "right"
    from = 0.25
    to = 0.75
    [material]
    name = "PZT-4"
    [[fixed]]
    on = "bottom"
    potential = 0.0
    [[electrode]]
    on = ["one", "two"]
    [[rigid]]
    on = ["one", "two"]
    displacement = [0.0, "free"]
    force = [0.0, -1e7]
    [contact]
    on = "bottom"
    """
    solution = solve(parse_case(tomllib.loads(text)))
    assert solution.converged
    assert solution.contact_force[1] == pytest.approx(-1e7)
    facets = solution.problem.domain.facets(part_name(["one", "two"]))
    for function, column in ((solution.displacement, 1), (solution.potential, 0)):
        sides = fem.locate_dofs_topological(function.function_space, 1, facets)
        nodal = function.x.array.reshape(-1, function.function_space.dofmap.bs)[sides, column]
        assert sides.size == 6 and abs(nodal[0]) > 0
        assert nodal == pytest.approx(nodal[0], rel=1e-9)
