"""Meshes of which each rank reads its share: as their sources, or refused."""

from __future__ import annotations

import pytest
from mpi4py import MPI

from contact import solve
from contact.cli.main import CONVERGED, main
from contact.mesh.reader import from_file
from contact.ranks import on_root
from tests.mesh.test_formats import PLATE, bricks, regions
from tests.problems.sizes import integral, sizes_of_parts

pytest.importorskip("h5py")

COMM = MPI.COMM_WORLD

#: Two triangles that share a region, with parts that overlap and one that lies inside.
SQUARE = """\
$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
6
1 1 "low"
1 2 "outside"
1 5 "diagonal"
2 3 "left half"
2 4 "all"
2 6 "right half"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
8
1 1 2 1 1 1 2
2 1 2 2 1 1 2
3 1 2 2 2 2 3
4 1 2 5 3 1 3
5 2 2 3 4 1 3 4
6 2 2 4 4 1 3 4
7 2 2 4 5 1 2 3
8 2 2 6 5 1 2 3
$EndElements
"""

SOURCES = {
    "plate.inp": PLATE,
    "bricks.inp": bricks(),
    "bent.inp": bricks(0.05),
    "square.msh": SQUARE,
}


def written(folder, name):
    """Write a source, convert it on one rank, and return both names. Collective."""
    source, made = folder / name, folder / "part.xdmf"
    on_root(COMM, lambda: source.write_text(SOURCES[name]))
    assert main(["mesh", str(source), str(made)]) == CONVERGED
    COMM.barrier()
    return source, made


@pytest.mark.parallel
@pytest.mark.parametrize(
    "name",
    [
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("plate.inp", "bent.inp")),
        "bricks.inp", "square.msh",
    ],
)  # fmt: skip
def test_a_shared_mesh_is_its_source(name, shared_tmp_path, capsys):
    source, made = written(shared_tmp_path, name)
    one, other = from_file(COMM, source), from_file(COMM, made)
    assert sizes_of_parts(other) == pytest.approx(sizes_of_parts(one), rel=1e-13)
    assert regions(other) == pytest.approx(regions(one), rel=1e-13)
    assert [*other.parts] == [*one.parts]
    assert other.order == one.order == (2 if name == "bent.inp" else 1)
    assert [*other.regions] == [*one.regions]
    assert (other.size, other.notes) == (one.size, one.notes)
    said = [{key: text.split(": ", 1)[1] for key, text in d.unusable.items()} for d in (one, other)]
    assert said[0] == said[1]
    assert ("diagonal" in said[0]) == (name == "square.msh")
    assert moments(other) == pytest.approx(moments(one), rel=1e-12, abs=1e-12)


def moments(domain):
    """Return the first moments of parts and regions: no other facet or cell is taken for one."""
    places = [{"part": name} for name in domain.parts]
    places += [{"region": name} for name in domain.regions]
    axes = [lambda x, *_, i=i: x[i] for i in range(domain.dim)]
    return [integral(domain, of, **place) for place in places for of in axes]


@pytest.mark.parallel
def test_dolfinx_reads_it_too(shared_tmp_path, capsys):
    from dolfinx.io import XDMFFile

    _, made = written(shared_tmp_path, "plate.inp")
    with XDMFFile(COMM, str(made), "r") as file:
        mesh = file.read_mesh()
    assert mesh.topology.index_map(2).size_global == 2
    assert mesh.topology.cell_name() == "quadrilateral"
    assert mesh.geometry.x[:, 0].max(initial=0.0) <= 2.0


@pytest.mark.core
def test_a_case_is_solved_on_it_as_on_its_source(tmp_path, capsys):
    source, made = written(tmp_path, "plate.inp")
    found = []
    for mesh in (source, made):
        text = f"""
        [mesh]
        file = "{mesh.name}"
        [material]
        young = 1.0
        poisson = 0.3
        [[fixed]]
        on = "top"
        displacement = [0.0, -0.01]
        [contact]
        on = "ground"
        """
        path = tmp_path / "case.toml"
        path.write_text(text)
        found.append(solve(path).contact_force)
    assert found[0] == pytest.approx(found[1], rel=1e-12)
    assert abs(found[0][1]) > 1e-3
