"""The command line's arguments: those of the commands, and those that are left for PETSc."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn

from mpi4py import MPI

from contact import __version__
from contact.errors import InputError, nearest

DESCRIPTION = """\
Frictional contact of elasto-plastic and piezoelectric bodies. A problem is a case file;
contact new MESH writes one to begin with, contact check shows its contents, contact solve
solves it, contact plot draws the results; contact demo solves an example. Documentation: docs/ of
the sources.
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

#: Options of one letter: not argparse's, which would take PETSc's for several of them.
SHORT = {"-h": "--help", "-v": "--verbose"}

#: Names of arguments that are no options.
POSITIONAL = ("command", "case", "folder", "name", "mesh", "data", "keys", "file", "to")

#: The one positional argument of a command, where that is no case file.
ONE = {
    "new": "mesh file",
    "mesh": "mesh file and the name of the new one",
    "plot": "folder with results",
    "view": "folder with results",
    "materials": 'name of a material, in quotes where it has spaces: "PZT-4 Clevite"',
}


#: Files whose keys and columns the help of a command lists.
FILES = {
    "solve": ("summary.json", "contact.csv", "steps.csv", "history.csv"),
    "sweep": ("sweep.csv",),
}


class Parser(argparse.ArgumentParser):
    """A parser that raises InputError, and prints its help on one rank alone."""

    files: tuple[str, ...] = ()

    def error(self, message: str) -> NoReturn:
        """Raise an InputError that names the command whose help has the usage."""
        raise InputError(f"{message}; accepted: as {self.prog} --help shows", "command-line")

    def format_help(self) -> str:
        """Return the help, with the keys and columns of the files that the command writes."""
        if not self.files:
            return super().format_help()
        from contact.io.tables import files_help  # loads dolfinx, which options precede

        return f"{super().format_help()}\n{files_help(*self.files)}\n"

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
    arguments = _joined([SHORT.get(argument, argument) for argument in arguments])
    options, rest = _parser().parse_known_args(arguments)
    known = [f"--{name}" for name in vars(options) if name not in POSITIONAL]
    known.append("--help")
    for i, argument in enumerate(rest):
        follows = i > 0 and rest[i - 1].startswith("-")
        if argument.startswith("--"):
            hint = nearest(argument.partition("=")[0], known, ", did you mean {}?")
            raise InputError(
                f"{argument}: unknown option{hint}; accepted: {', '.join(known)}", "command-line"
            )
        if not argument.startswith("-") and not follows:
            one = ONE.get(options.command, "case file")
            raise InputError(
                f"{argument}: one argument too many; accepted: one {one}", "command-line"
            )
    return options, rest


def _joined(arguments: Sequence[str]) -> list[str]:
    """Join options and values that begin with a minus sign, which argparse takes for options."""
    found: list[str] = []
    for argument in arguments:
        if found and re.fullmatch(r"--[a-z-]+", found[-1]) and re.match(r"-[\d.]", argument):
            found[-1] += f"={argument}"
        else:
            found.append(argument)
    return found


def _parser() -> Parser:
    parser = Parser(prog="contact", description=DESCRIPTION, epilog=EXIT, **COMMON)
    parser.add_argument("--help", action="help", help="show this help and leave")
    parser.add_argument(
        "--version", action="version", version=f"contact {__version__}", help="show the version"
    )
    commands = parser.add_subparsers(
        dest="command",
        required=True,
        metavar="demo|new|mesh|check|solve|sweep|plot|view|identify|materials|schema",
    )
    for usage, text, epilog, arguments in offered():
        command = commands.add_parser(
            usage.partition(" ")[0],
            help=text,
            description=text,
            epilog=epilog,
            usage=f"contact {usage}",
            **COMMON,
        )
        command.files = FILES.get(usage.partition(" ")[0], ())
        command.add_argument("--help", action="help", help="show this help and leave")
        for name, options in arguments.items():
            command.add_argument(name, **options)
    return parser


def _value(metavar: str, text: str, **more: Any) -> dict[str, Any]:
    return {"metavar": metavar, "help": text, **more}


def _values(metavar: str, text: str) -> dict[str, Any]:
    return {
        "metavar": metavar,
        "help": f"{text}; may be repeated",
        "action": "append",
        "default": [],
    }


def _flag(text: str) -> dict[str, Any]:
    return {"help": text, "action": "store_true"}


def offered() -> Iterator[tuple[str, str, str | None, dict[str, dict[str, Any]]]]:
    """Give the commands: usage, purpose, the text below the options, and the arguments."""
    case = _value("CASE.toml", "case file (TOML)")
    replaced = _values(
        "KEY=VALUE", "replace a value of the case file, for instance load.0.traction='[0, -1]'"
    )
    replaces = _flag("replace results or checkpoints of another case, if DIR has any")
    shown = {
        "--quiet": _flag("show no progress"),
        "--verbose": _flag("-v: show all iterations and remarks, with the time"),
        "--log": _value("FILE", "write a log to the end of a file"),
    }
    yield (
        "demo [--out DIR] [options]",
        "solve an example, a bar pressed on a foundation, with its figures",
        None,
        {
            "--out": _value("DIR", "folder for results; contact-demo by default"),
            "--set": replaced,
            **shown,
            "--overwrite": replaces,
        },
    )
    yield (
        "new MESH [--case CASE.toml]",
        "write a commented case file for a mesh file, with its parts",
        None,
        {
            "mesh": _value(
                "MESH", "mesh file: .msh with named physical groups, .inp, .vtu, .med, ..."
            ),
            "--case": _value("FILE", "file to write; MESH.toml by default"),
        },
    )
    yield (
        "mesh FILE PART.xdmf",
        "write a mesh file as XDMF of which each rank reads its share, for many ranks",
        None,
        {
            "file": _value("FILE", "mesh file: .msh, .inp, .vtu, .med, ..."),
            "to": _value("PART.xdmf", "the new file; PART.h5 is written beside it"),
        },
    )
    yield (
        "check CASE.toml [options] [PETSc options]",
        "validate a case and print it with its mesh parts and unknowns",
        None,
        {
            "case": case,
            "--set": replaced,
            "--plot": _flag("draw the set-up too: CASE-setup.png and .pdf in the present folder"),
        },
    )
    yield (
        "solve CASE.toml --out DIR [options] [PETSc options]",
        "solve a case and write the results",
        PETSC,
        {
            "case": {**case, "nargs": "?"},
            "--set": replaced,
            "--plot": _flag("draw the figures too"),
            "--out": _value("DIR", "folder for results"),
            "--restart": _value(
                "DIR",
                "go on with an interrupted evolution from its checkpoints in DIR, which have the "
                "case too; the results go to DIR unless --out names another folder",
            ),
            **shown,
            "--overwrite": replaces,
        },
    )
    yield (
        "sweep CASE.toml --over KEY=V1,V2,... --out DIR [options]",
        "solve a case for several values of some keys: sweep.csv, one row per value",
        None,
        {
            "case": case,
            "--set": replaced,
            "--over": _values(
                "KEY=V1,V2,...", "the values of a key, for all combinations; a:b:n is n numbers"
            ),
            "--columns": _values(
                "KEY,...",
                "further columns: keys of summary.json, max_dev_strain, reactions.left, ...",
            ),
            "--out": _value("DIR", "folder for the table; rows in it are kept"),
            "--cold": _flag("start each solve from the zero initial guess, without a warm start"),
            **shown,
        },
    )
    yield (
        "plot DIR [options]",
        "draw the figures of a run from its files, or the figure of a sweep",
        None,
        {
            "folder": _value("DIR", "folder with the results of a run, or of a sweep"),
            "--field": _values(
                "NAME",
                "colour the body by this field of fields.vtu, von_mises, displacement, "
                "displacement_y, stress_xy, potential, ..., and draw this figure alone; of a "
                "sweep, draw this column, as figure-sweep-NAME",
            ),
            "--format": _value("pdf,png", "formats of the files: png, pdf, svg", default="png"),
            "--width": _value("85mm", "width of the figures, in mm, cm or in"),
            "--view": _value(
                "X,Y,Z",
                "direction from a body in 3-D to the eye; without it one that sees the contact",
            ),
            "--step": _value(
                "N",
                "draw the results at the end of a step of an evolution, from 1, as "
                "figure-NAME-step-N",
                type=int,
            ),
            "--html": _flag(
                "write figure-view.html instead, a body in 3-D to turn in a browser (needs trame)"
            ),
        },
    )
    yield (
        "view DIR [options]",
        "show the body of a run in 3-D and its contact in a window, to turn it",
        None,
        {
            "folder": _value("DIR", "folder with the results of a run"),
            "--field": _value(
                "NAME", "colour the body by this field, as contact plot; else contact pressure"
            ),
        },
    )
    yield (
        "identify CASE.toml DATA.csv --for KEY,... [options]",
        "find the parameters with which a case fits measured columns of steps.csv best",
        None,
        {
            "case": case,
            "data": _value("DATA.csv", "measurements: t, and columns of steps.csv"),
            "--for": _value("KEY,...", "keys of the case whose numbers are sought", dest="keys"),
            "--bound": _values("KEY=A:B", "least and largest value of a parameter"),
            "--set": replaced,
            "--plot": _value("FILE", "draw fit and residuals into a new file"),
            "--quiet": shown["--quiet"],
        },
    )
    yield (
        "materials [NAME] [--file FILE]",
        "list the materials that have a name, or show one with its derived constants",
        None,
        {
            "name": _value("NAME", "material to show", nargs="?"),
            "--file": _value("FILE", "a library of one's own (TOML)"),
        },
    )
    yield (
        "schema",
        "print the JSON schema of the case file, by which editors complete and check TOML",
        "contact schema > contact.schema.json, and as the first line of a case file\n"
        "#:schema ./contact.schema.json",
        {},
    )
