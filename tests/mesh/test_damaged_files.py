"""Damaged mesh files: each gives one message or a sound mesh, whatever Gmsh does with it.

60 are tried; ``DAMAGED_MESHES=300 scripts/fx python3 -m pytest tests/mesh/test_damaged_files.py``
tries as many as it says.
"""

import os
import time
from pathlib import Path

import gmsh
import numpy as np
import pytest
from mpi4py import MPI

import meshes
from contact.errors import InputError
from contact.mesh.geometry import area, volume
from contact.mesh.reader import from_msh

FIXTURES = Path(meshes.__file__).parent / "fixtures"
TEXTS = [path.name for path in sorted(FIXTURES.glob("*.msh"))]
BATCHES = 6
IN_BATCH = int(os.environ.get("DAMAGED_MESHES", "60")) // BATCHES
#: What a number of a file may turn into.
WRONG = ["0", "-1", "1", "3", "15", "999", "1000000000", "-2147483648", "99999999999999999999"]
WRONG += ["nan", "inf", "1e400", "-1e400", "1e300", "1e-320", "0.5", "x", '"', "", "$End"]


def cut(lines, draw):
    text = "\n".join(lines)
    return text[: draw.integers(len(text))].split("\n")


def change_number(lines, draw):
    return change(lines, draw, range(2, len(lines)))


def drop_lines(lines, draw):
    start = draw.integers(len(lines))
    return lines[:start] + lines[start + draw.integers(1, 4) :]


def double_line(lines, draw):
    start = draw.integers(len(lines))
    return lines[: start + 1] + lines[start:]


def change_count(lines, draw):
    heads = [i + 1 for i, line in enumerate(lines) if line.startswith("$") and "End" not in line]
    return change(lines, draw, heads[1:])


def miscount(lines, draw):
    """One too many or too few, of nodes or of elements, all or in a block."""
    heads = [i + 1 for i, line in enumerate(lines) if line in ("$Nodes", "$Elements")]
    line = draw.choice(heads) + draw.integers(2)
    words = lines[line].split()
    word = draw.integers(len(words))
    words[word] = str(int(float(words[word])) + draw.choice([-1, 1]))
    return [*lines[:line], " ".join(words), *lines[line + 1 :]]


def change_node(lines, draw):
    return change(lines, draw, section(lines, "Nodes"))


def change_element(lines, draw):
    return change(lines, draw, section(lines, "Elements"))


def section(lines, name):
    return range(lines.index(f"${name}") + 1, lines.index(f"$End{name}"))


def change(lines, draw, candidates):
    """Replace one word of one of the lines."""
    line = int(draw.choice([i for i in candidates if lines[i].split()]))
    words = lines[line].split()
    words[draw.integers(len(words))] = str(draw.choice(WRONG))
    return [*lines[:line], " ".join(words), *lines[line + 1 :]]


DAMAGES = [cut, change_number, drop_lines, double_line, change_count, miscount]
DAMAGES += [change_node, change_element]


def damage_bytes(content, draw):
    """Cut a binary file, or overwrite some bytes behind its first lines."""
    if draw.random() < 0.4:
        return content[: draw.integers(30, len(content))]
    damaged, width = bytearray(content), int(draw.choice([1, 4, 8]))
    start = int(draw.integers(30, len(content) - width))
    damaged[start : start + width] = draw.choice(
        [b"\xff" * width, bytes(width), draw.bytes(width)]
    ).ljust(width, b"\0")
    return bytes(damaged)


def binary(name, version, path):
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.merge(str(FIXTURES / name))
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path.read_bytes()


def is_sound_or_refused(path, comm):
    """Read a file and check what comes of it; returns whether it was refused."""
    start = time.process_time()
    try:
        domain = from_msh(comm, path)
    except InputError as error:
        message = str(error)
        assert message.startswith(f"mesh file {path}: ")
        assert "\n" not in message
        assert len(message) < 500
        return True
    finally:
        assert time.process_time() - start < 50
    assert np.all(np.isfinite(domain.mesh.geometry.x))
    sizes = [volume(domain), *(volume(domain, name) for name in domain.regions)]
    sizes += [area(domain, name) for name in domain.parts]
    assert min(sizes) > 0.0
    return False


@pytest.mark.parametrize("batch", range(BATCHES))
def test_damaged_files(batch, tmp_path):
    draw = np.random.default_rng(batch)
    contents = [binary(name, v, tmp_path / "b.msh") for name in TEXTS[:3] for v in (2.2, 4.1)]
    refused = 0
    for i in range(IN_BATCH):
        if i % 5 == 4:
            damaged = damage_bytes(contents[draw.integers(len(contents))], draw)
        else:
            damage = DAMAGES[(i + batch) % len(DAMAGES)]
            lines = (FIXTURES / str(draw.choice(TEXTS))).read_text().split("\n")
            damaged = "\n".join(damage(lines, draw)).encode()
        path = tmp_path / f"{i}.msh"
        path.write_bytes(damaged)
        refused += is_sound_or_refused(path, MPI.COMM_SELF)
    assert refused > 0


@pytest.mark.parallel(2)
@pytest.mark.parametrize(
    ("fixture", "old", "new"),
    [
        ("bar-2.2.msh", "$Nodes\n30\n", "$Nodes\n29\n"),
        ("bar-2.2.msh", "$Nodes\n30\n", "$Nodes\n1000000000000\n"),
        ("bar.msh", "$Nodes\n11 30 1 30\n", "$Nodes\n11 29 1 29\n"),
        ("square.msh", "3 1 1 0", "3 nan 1 0"),
        ("square.msh", "3 1 1 0", "3 1e400 1 0"),
        ("square.msh", "2 2 1 1 1 2 3", "2 2 1 1 1 2 9"),
    ],
)
def test_known_damages_are_refused_on_all_ranks(fixture, old, new, shared_tmp_path):
    path = shared_tmp_path / "body.msh"
    text = (FIXTURES / fixture).read_text()
    assert old in text
    if MPI.COMM_WORLD.rank == 0:
        path.write_text(text.replace(old, new))
    MPI.COMM_WORLD.Barrier()
    refused = is_sound_or_refused(path, MPI.COMM_WORLD)
    assert refused or fixture == "bar.msh", "Gmsh mends these counts itself"
