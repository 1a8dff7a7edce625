"""``contact mesh FILE PART.xdmf``: a mesh file that many ranks read in shares."""

from __future__ import annotations

import argparse
from pathlib import Path

from mpi4py import MPI

from contact.cli.main import CONVERGED
from contact.mesh.reader import convert
from contact.ranks import on_root


def run(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Convert the file."""
    to = Path(options.to)
    cells = on_root(comm, lambda: convert(Path(options.file), to))
    if comm.rank == 0:
        parts, regions = (", ".join(group.names) for group in (cells.parts, cells.regions))
        print(f"{to}, {to.with_suffix('.h5')}: {len(cells.regions.rows)} cells")
        print(f"parts {parts}; regions {regions}")
    return CONVERGED
