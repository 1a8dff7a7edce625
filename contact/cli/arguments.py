"""The command line's arguments: ours, and those that are left for PETSc."""

from __future__ import annotations

import argparse
import difflib
from collections.abc import Sequence
from typing import Any

from contact import __version__
from contact.cli import materials, new, plot, sweep
from contact.cli.options import COMMON, Parser, add_case, add_command, add_help, add_progress
from contact.errors import InputError
from contact.output.reference import files_help

DESCRIPTION = """\
Frictional contact of elasto-plastic and piezoelectric bodies. A problem is a case file;
contact new MESH.msh writes one to begin with, contact check says what is in it, contact solve
solves it, contact plot draws what came out. Documentation: docs/ of the sources.
"""
EXIT = """\
exit status: 0 converged; 1 not converged, results are written all the same; 2 bad input, or no
place for the results: one message, nothing is written; 70 a fault of the program; 130 stopped by
Ctrl-C, 143 by SIGTERM: what a solve had reached is written
"""

PETSC = """\
PETSc's options have one dash, those of the linear solver the prefix contact_, and come last:
-contact_ksp_monitor -contact_pc_type gamg
"""

#: Names of arguments that are no options.
POSITIONAL = ("command", "case", "folder", "name", "mesh")

#: What the command takes one of, where that is no case file.
ONE = {
    "new": "mesh file",
    "plot": "folder with results",
    "materials": 'name of a material, in quotes where it has spaces: "PZT-4 Clevite"',
}


def _parser() -> Parser:
    parser = Parser(prog="contact", description=DESCRIPTION, epilog=EXIT, **COMMON)
    add_help(parser)
    parser.add_argument(
        "--version", action="version", version=f"contact {__version__}", help="show the version"
    )
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="new|check|solve|sweep|plot|materials"
    )
    new.add_parser(commands)
    _add_check(commands)
    _add_solve(commands)
    sweep.add_parser(commands)
    plot.add_parser(commands)
    materials.add_parser(commands)
    return parser


def _add_check(commands: Any) -> None:
    text = "validate a case and print it with its mesh parts and unknowns"
    command = add_command(commands, "check CASE.toml [options] [PETSc options]", text)
    add_case(command)
    setup = "draw the set-up too: CASE-setup.png and .pdf in the present folder"
    command.add_argument("--plot", action="store_true", help=setup)


def _add_solve(commands: Any) -> None:
    files = files_help("summary.json", "contact.csv", "steps.csv", "history.csv")
    usage = "solve CASE.toml --out DIR [options] [PETSc options]"
    text = "solve a case and write the results"
    command = add_command(commands, usage, text, f"{PETSC}\n{files}")
    add_case(command, optional=True)
    command.add_argument("--plot", action="store_true", help="draw the figures too")
    command.add_argument("--out", metavar="DIR", help="folder for results")
    command.add_argument(
        "--restart",
        metavar="DIR",
        help="go on with an evolution that was ended, from the checkpoints in DIR: the case is "
        "known, and the results go there too unless told otherwise",
    )
    add_progress(command)
    command.add_argument(
        "--overwrite",
        action="store_true",
        help="replace results or checkpoints of another case, if DIR has any",
    )


def parse(arguments: Sequence[str]) -> tuple[argparse.Namespace, list[str]]:
    """Split a command line into ours and PETSc's.

    Raises
    ------
    InputError
        If it is not understood.
    """
    if "-h" in arguments:
        arguments = ["--help" if argument == "-h" else argument for argument in arguments]
    options, rest = _parser().parse_known_args(arguments)
    known = [f"--{name}" for name in vars(options) if name not in POSITIONAL]
    known.append("--help")
    for i, argument in enumerate(rest):
        follows = i > 0 and rest[i - 1].startswith("-")
        if argument.startswith("--"):
            near = difflib.get_close_matches(argument.partition("=")[0], known, n=1)
            hint = f", did you mean {near[0]}?" if near else ""
            raise InputError(f"{argument}: unknown option{hint}; accepted: {', '.join(known)}")
        if not argument.startswith("-") and not follows:
            one = ONE.get(options.command, "case file")
            raise InputError(f"{argument}: one argument too many; accepted: one {one}")
    return options, rest
