"""Meshes that fall apart: every piece has to be held."""

from pathlib import Path

import gmsh
import numpy as np
import pytest
from mpi4py import MPI

from contact.case.build import build_problem
from contact.case.file import parse_case
from contact.errors import InputError
from contact.mesh.entities import connected_components

COMM = MPI.COMM_WORLD


def write_two_squares(path: Path, *, share: bool) -> None:
    """Write two squares side by side, with one edge between them or two on top of each other."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ, model = gmsh.model.occ, gmsh.model
        squares = [(2, occ.addRectangle(x, 0, 0, 1, 1)) for x in (0.0, 1.0)]
        if share:
            occ.fragment(squares[:1], squares[1:])
        occ.synchronize()
        edges = [(tag, occ.getCenterOfMass(1, tag)) for _, tag in model.getEntities(1)]
        for name, axis, value in (("left", 0, 0.0), ("bottom", 1, 0.0), ("top", 1, 1.0)):
            tags = [tag for tag, middle in edges if abs(middle[axis] - value) < 1e-9]
            model.addPhysicalGroup(1, tags, name=name)
        model.addPhysicalGroup(2, [tag for _, tag in model.getEntities(2)], name="body")
        model.mesh.setSize(model.getEntities(0), 0.3)
        model.mesh.generate(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def squares(folder: Path, *, share: bool, friction: bool = True) -> dict:
    path = folder / "squares.msh"
    if COMM.rank == 0:
        write_two_squares(path, share=share)
    COMM.Barrier()
    case = {
        "mesh": {"file": str(path)},
        "material": {"law": "linear", "young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0]}],
        "load": [{"on": "top", "traction": [0.0, -0.01]}],
        "contact": {"on": "bottom"},
    }
    return {**case, "friction": {"law": "coulomb", "mu": 0.3}} if friction else case


@pytest.mark.parallel
@pytest.mark.parametrize("share", [True, False])
def test_nodes_of_one_piece(share: bool, shared_tmp_path: Path) -> None:
    problem = build_problem(parse_case(squares(shared_tmp_path, share=share)), COMM)
    labels, count = connected_components(problem.body.space)
    assert count == (1 if share else 2)
    x = problem.body.space.tabulate_dof_coordinates()[: labels.size, 0]
    inner = np.abs(x - 1) > 1e-9
    found = COMM.allgather(set(zip((x[inner] > 1).tolist(), labels[inner].tolist(), strict=True)))
    assert len(set().union(*found)) == 2, "left and right of the edge: one label each"


@pytest.mark.parallel
def test_a_piece_that_nothing_holds_sideways_is_refused(shared_tmp_path: Path) -> None:
    case = squares(shared_tmp_path, share=False, friction=False)
    said = r"the body about \(1.5, 0.5\) is not held.*along x"
    with pytest.raises(InputError, match=said):
        build_problem(parse_case(case), COMM)
    build_problem(parse_case(squares(shared_tmp_path, share=True, friction=False)), COMM)
