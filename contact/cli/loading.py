"""Which case a command is about: that of its file, or that of an interrupted run."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from contact.errors import InputError

if TYPE_CHECKING:  # it loads dolfinx, which PETSc's options have to precede
    from contact.case.file import Case


def load(options: argparse.Namespace) -> Case:
    """Read the case, of an interrupted run too. On one rank."""
    from contact.case.file import load_case  # after PETSc's options

    if options.command != "solve" or options.restart is None:
        if options.case is None:
            raise InputError("CASE.toml: missing; accepted: a case file, or --restart DIR")
        if options.command == "solve" and options.out is None:
            raise InputError("--out: missing; accepted: a folder to write to")
        return load_case(options.case, options.set)
    from contact.case.text import to_toml
    from contact.output.rerun import check_restart
    from contact.output.resume import case_of

    folder = Path(options.restart)
    stored = case_of(folder)
    case = load_case(options.case or stored, options.set)
    check_restart(folder, to_toml(load_case(stored)), to_toml(case, anchored=True))
    return case
