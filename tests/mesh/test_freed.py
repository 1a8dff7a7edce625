"""Meshes that are freed while an exception is on its way."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]

#: What is wrong is found after the mesh has been made, which nobody holds then.
SCRIPT = """
from mpi4py import MPI
from contact import Body, Contact, InputError, Problem
from contact.mesh.grid import rectangle

try:
    Problem(rectangle(MPI.COMM_WORLD, (0, 0), (1, 1), (2, 2)), Body(3, []), Contact("bottom"))
except InputError as error:
    print(error)
"""


def test_a_program_ends_whose_mesh_is_freed_by_an_exception() -> None:
    """mpi4py 4.0 waits for ever for the lock of a communicator that goes with such a mesh."""
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("law: given 3")
