"""The command line's arguments: ours, and those that are left for PETSc."""

from __future__ import annotations

import argparse
import difflib
from collections.abc import Sequence
from typing import Any, NoReturn

from mpi4py import MPI

from contact import __version__
from contact.cli import materials, new, plot, sweep
from contact.errors import InputError
from contact.output.reference import files_help

DESCRIPTION = """\
Frictional contact of elasto-plastic and piezoelectric bodies. A problem is a case file;
contact new MESH.msh writes one to begin with, contact check says what is in it, contact solve
solves it, contact plot draws what came out. Documentation: docs/index.md.
"""
EXIT = """\
exit status: 0 converged; 1 not converged, results are written all the same; 2 bad input, or no
place for the results: one message, nothing is written; 70 a fault of the program; 130 stopped by
Ctrl-C, 143 by SIGTERM: what a solve had reached is written
"""

#: Names of arguments that are no options.
POSITIONAL = ("command", "case", "folder", "name", "mesh")


class _Parser(argparse.ArgumentParser):
    """A parser that raises InputError, and prints its help on one rank alone."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; accepted: {' '.join(self.format_usage().split())}")

    def _print_message(self, message: str, file: Any = None) -> None:
        if MPI.COMM_WORLD.rank == 0:
            super()._print_message(message, file)


def _parser() -> _Parser:
    # PETSc's options begin with one dash and any letter, -h among them.
    common: dict[str, Any] = {"add_help": False, "allow_abbrev": False}
    parser = _Parser(
        prog="contact",
        description=DESCRIPTION,
        epilog=EXIT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        **common,
    )
    parser.add_argument("--help", action="help", help="show this help and leave")
    parser.add_argument(
        "--version", action="version", version=f"contact {__version__}", help="show the version"
    )
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="new|check|solve|sweep|plot|materials"
    )
    setup = "draw the set-up too: CASE-setup.png and .pdf in the present folder"
    for name, text, drawn in (
        ("solve", "solve a case and write the results", "draw the figures too"),
        ("check", "validate a case and print it with its mesh parts and unknowns", setup),
    ):
        command = commands.add_parser(name, help=text, description=text, **common)
        command.usage = f"contact {name} CASE.toml [options] [PETSc options]"
        optional: dict[str, Any] = {"nargs": "?"} if name == "solve" else {}
        command.add_argument("case", metavar="CASE.toml", help="case file (TOML)", **optional)
        command.add_argument(
            "--set",
            action="append",
            default=[],
            metavar="KEY=VALUE",
            help="replace a value of the case file, for instance load.0.traction='[0, -1]'; may be "
            "repeated",
        )
        command.add_argument("--help", action="help", help="show this help and leave")
        command.add_argument("--plot", action="store_true", help=drawn)
        if name == "solve":
            command.usage = f"contact {name} CASE.toml --out DIR [options] [PETSc options]"
            command.epilog = files_help("summary.json", "contact.csv", "steps.csv", "history.csv")
            command.formatter_class = argparse.RawDescriptionHelpFormatter
            command.add_argument("--out", metavar="DIR", help="folder for results")
            command.add_argument(
                "--restart",
                metavar="DIR",
                help="go on with an evolution that was ended, from the checkpoints in DIR: the "
                "case is known, and the results go there too unless told otherwise",
            )
            command.add_argument("--quiet", action="store_true", help="show no progress")
            command.add_argument("--log", metavar="FILE", help="write a log to the end of a file")
            command.add_argument(
                "--overwrite",
                action="store_true",
                help="replace results of another case, if DIR has any",
            )
    new.add_parser(commands, common)
    sweep.add_parser(commands, common)
    plot.add_parser(commands, common)
    materials.add_parser(commands, common)
    return parser


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
    known = [
        f"--{name}"
        for name in vars(options)
        if name not in ("command", "case", "folder", "name", "mesh")
    ]
    known.append("--help")
    for i, argument in enumerate(rest):
        follows = i > 0 and rest[i - 1].startswith("-")
        if argument.startswith("--"):
            near = difflib.get_close_matches(argument.partition("=")[0], known, n=1)
            hint = f", did you mean {near[0]}?" if near else ""
            raise InputError(f"{argument}: unknown option{hint}; accepted: {', '.join(known)}")
        if not argument.startswith("-") and not follows:
            raise InputError(f"{argument}: one argument too many; accepted: one case file")
    return options, rest
