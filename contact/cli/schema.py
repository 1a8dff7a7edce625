"""``contact schema``: the JSON schema of the case file."""

from __future__ import annotations

import argparse
import json

from mpi4py import MPI

from contact.case.schema import schema
from contact.cli.main import CONVERGED


def run(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Print the schema."""
    if comm.rank == 0:
        print(json.dumps(schema(), indent=1, ensure_ascii=False))
    return CONVERGED
