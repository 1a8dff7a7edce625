"""The command line's arguments: those of the commands, and those that are left for PETSc."""

from __future__ import annotations

import argparse
import difflib
from collections.abc import Sequence
from typing import Any, NoReturn

from mpi4py import MPI

from contact import __version__
from contact.errors import InputError
from contact.output.reference import files_help

DESCRIPTION = """\
Frictional contact of elasto-plastic and piezoelectric bodies. A problem is a case file;
contact new MESH.msh writes one to begin with, contact check shows its contents, contact solve
solves it, contact plot draws the results. Documentation: docs/ of the sources.
"""
EXIT = """\
exit status: 0 converged; 1 not converged, results are written all the same; 2 bad input, or no
place for the results: one message, nothing is written; 70 a fault of the program; 130 stopped by
Ctrl-C, 143 by SIGTERM: the results so far are written
"""

PETSC = """\
PETSc's options have one dash, those of the linear solver the prefix contact_, and come last:
-contact_ksp_monitor -contact_pc_type gamg
"""

#: PETSc's options begin with one dash and any letter, -h among them.
COMMON: dict[str, Any] = {
    "add_help": False,
    "allow_abbrev": False,
    "formatter_class": argparse.RawDescriptionHelpFormatter,
}

#: Names of arguments that are no options.
POSITIONAL = ("command", "case", "folder", "name", "mesh")

#: The one positional argument of a command, where that is no case file.
ONE = {
    "new": "mesh file",
    "plot": "folder with results",
    "materials": 'name of a material, in quotes where it has spaces: "PZT-4 Clevite"',
}


class Parser(argparse.ArgumentParser):
    """A parser that raises InputError, and prints its help on one rank alone."""

    def error(self, message: str) -> NoReturn:
        """Raise an InputError with the usage."""
        raise InputError(f"{message}; accepted: {' '.join(self.format_usage().split())}")

    def _print_message(self, message: str, file: Any = None) -> None:
        if MPI.COMM_WORLD.rank == 0:
            super()._print_message(message, file)


def parse(arguments: Sequence[str]) -> tuple[argparse.Namespace, list[str]]:
    """Split a command line into our options and PETSc's.

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


def _parser() -> Parser:
    parser = Parser(prog="contact", description=DESCRIPTION, epilog=EXIT, **COMMON)
    _help(parser)
    parser.add_argument(
        "--version", action="version", version=f"contact {__version__}", help="show the version"
    )
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="new|check|solve|sweep|plot|materials"
    )
    for add in (_new, _check, _solve, _sweep, _plot, _materials):
        add(commands)
    return parser


def _new(commands: Any) -> None:
    text = "write a commented case file for a mesh file, with its parts"
    command = _command(commands, "new MESH.msh [--case CASE.toml]", text)
    command.add_argument("mesh", metavar="MESH.msh", help="Gmsh file with named physical groups")
    command.add_argument("--case", metavar="FILE", help="file to write; MESH.toml by default")


def _check(commands: Any) -> None:
    text = "validate a case and print it with its mesh parts and unknowns"
    command = _command(commands, "check CASE.toml [options] [PETSc options]", text)
    _case(command)
    setup = "draw the set-up too: CASE-setup.png and .pdf in the present folder"
    command.add_argument("--plot", action="store_true", help=setup)


def _solve(commands: Any) -> None:
    files = files_help("summary.json", "contact.csv", "steps.csv", "history.csv")
    usage = "solve CASE.toml --out DIR [options] [PETSc options]"
    text = "solve a case and write the results"
    command = _command(commands, usage, text, f"{PETSC}\n{files}")
    _case(command, optional=True)
    command.add_argument("--plot", action="store_true", help="draw the figures too")
    command.add_argument("--out", metavar="DIR", help="folder for results")
    command.add_argument(
        "--restart",
        metavar="DIR",
        help="go on with an evolution that was ended, from the checkpoints in DIR: the case is "
        "known, and the results go there too unless told otherwise",
    )
    _progress(command)
    command.add_argument(
        "--overwrite",
        action="store_true",
        help="replace results or checkpoints of another case, if DIR has any",
    )


def _sweep(commands: Any) -> None:
    usage = "sweep CASE.toml --over KEY=V1,V2,... --out DIR [options]"
    text = "solve a case for several values of some keys: sweep.csv, one row a value"
    command = _command(commands, usage, text, files_help("sweep.csv"))
    _case(command)
    command.add_argument(
        "--over",
        action="append",
        default=[],
        metavar="KEY=V1,V2,...",
        help="the values of a key; may be repeated, for all combinations",
    )
    command.add_argument("--out", metavar="DIR", help="folder for the table; rows in it are kept")
    command.add_argument(
        "--cold",
        action="store_true",
        help="start each solve from the zero initial guess, without a warm start",
    )
    _progress(command)


def _plot(commands: Any) -> None:
    text = "draw the figures of a run again, from its files"
    command = _command(commands, "plot DIR [options]", text)
    command.add_argument("folder", metavar="DIR", help="folder with the results of a run")
    command.add_argument(
        "--field",
        action="append",
        default=[],
        metavar="NAME",
        help="colour the body by this field of fields.vtu, and draw this figure alone; may be "
        "repeated: von_mises, displacement, displacement_y, stress_xy, potential, ...",
    )
    command.add_argument(
        "--format", default="png", metavar="pdf,png", help="formats of the files: png, pdf, svg"
    )
    command.add_argument("--width", metavar="85mm", help="width of the figures, in mm, cm or in")
    command.add_argument(
        "--mirror", action="store_true", help="show both halves of a body of revolution"
    )
    command.add_argument(
        "--animate",
        action="store_true",
        help="draw animation-FIELD.gif instead, the deformed body over the steps of an evolution",
    )


def _materials(commands: Any) -> None:
    text = "list the materials that have a name, or show one with its derived constants"
    command = _command(commands, "materials [NAME] [--file FILE]", text)
    command.add_argument("name", nargs="?", metavar="NAME", help="material to show")
    command.add_argument("--file", metavar="FILE", help="a library of one's own (TOML)")


def _command(commands: Any, usage: str, text: str, epilog: str | None = None) -> Parser:
    """Add a command and return its parser.

    Parameters
    ----------
    commands
        The commands of the parser.
    usage
        Its name and arguments.
    text
        Its purpose.
    epilog
        The text below its options.
    """
    name = usage.partition(" ")[0]
    command: Parser = commands.add_parser(
        name, help=text, description=text, epilog=epilog, usage=f"contact {usage}", **COMMON
    )
    _help(command)
    return command


def _help(parser: Parser) -> None:
    parser.add_argument("--help", action="help", help="show this help and leave")


def _case(command: Parser, optional: bool = False) -> None:
    """Add a case file, and values that replace some of its own."""
    how: dict[str, Any] = {"nargs": "?"} if optional else {}
    command.add_argument("case", metavar="CASE.toml", help="case file (TOML)", **how)
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="replace a value of the case file, for instance load.0.traction='[0, -1]'; may be "
        "repeated",
    )


def _progress(command: Parser) -> None:
    """Add the options of the output on the console."""
    command.add_argument("--quiet", action="store_true", help="show no progress")
    command.add_argument("--log", metavar="FILE", help="write a log to the end of a file")
