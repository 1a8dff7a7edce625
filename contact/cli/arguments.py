"""The command line's arguments: those of the commands, and those that are left for PETSc."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
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

#: Options without a value, and those that may be repeated.
FLAG: dict[str, Any] = {"action": "store_true"}
MANY: dict[str, Any] = {"action": "append", "default": []}


#: Names of arguments that are no options.
POSITIONAL = ("command", "case", "folder", "name", "mesh", "data", "keys", "file", "to")

#: Files whose keys and columns the help of a command lists.
FILES = {
    "solve": ("summary.json", "contact.csv", "steps.csv", "history.csv"),
    "sweep": ("sweep.csv",),
}


class Parser(argparse.ArgumentParser):
    """A parser that raises InputError, and prints its help on one rank alone."""

    def __init__(self, **options: Any) -> None:
        raw = argparse.RawDescriptionHelpFormatter
        super().__init__(add_help=False, allow_abbrev=False, formatter_class=raw, **options)
        self._negative_number_matcher = re.compile(r"-[\d.]")  # "-1,0,0" is a value, too

    def error(self, message: str) -> NoReturn:
        """Raise an InputError that names the command whose help has the usage."""
        raise InputError(f"{message}; accepted: as {self.prog} --help shows", "command-line")

    def format_help(self) -> str:
        """Return the help, with the keys and columns of the files that the command writes."""
        files = FILES.get(self.prog.rpartition(" ")[2], ())
        if not files:
            return super().format_help()
        from contact.io.tables import files_help  # loads dolfinx, which options precede

        return f"{super().format_help()}\n{files_help(*files)}\n"

    def _print_message(self, message: str, file: Any = None) -> None:
        if MPI.COMM_WORLD.rank == 0:
            super()._print_message(message, file)


def parse(arguments: Sequence[str]) -> tuple[argparse.Namespace, list[str]]:
    """Split a command line into our options and PETSc's; InputError if it is not understood."""
    # As an option of argparse, -h would take PETSc's -history for several of one letter.
    given = ["--help" if argument == "-h" else argument for argument in arguments]
    whole, commands = parser()
    options, rest = whole.parse_known_args(given)
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
            usage = commands[options.command].usage
            raise InputError(
                f"{argument}: one argument too many; accepted: {usage}", "command-line"
            )
    return options, rest


def parser() -> tuple[Parser, dict[str, Parser]]:
    """Return the parser of all commands, and that of each by its name."""
    whole = Parser(prog="contact", description=DESCRIPTION, epilog=EXIT)
    commands = whole.add_subparsers(dest="command", required=True)
    version = f"contact {__version__}"
    whole.add_argument("--help", action="help", help="show this help and leave")
    whole.add_argument("--version", action="version", version=version, help="show the version")

    def common(*names: str, **about: Any) -> Parser:
        made = Parser()
        made.add_argument(*names, **about)
        return made

    case = common("case", metavar="CASE.toml", help="case file (TOML)")
    replaced = common(
        "--set",
        metavar="KEY=VALUE",
        **MANY,
        help="replace a value of the case file, for instance load.0.traction='[0, -1]'; "
        "may be repeated",
    )
    quiet = common("--quiet", **FLAG, help="show no progress")
    log = "write all iterations and remarks, with the time, to the end of a file"
    told = [quiet, common("--log", metavar="FILE", help=log)]
    overwrite = common(
        "--overwrite", **FLAG, help="replace results or checkpoints of another case, if DIR has any"
    )

    def command(usage: str, text: str, **more: Any) -> Parser:
        name, usage = usage.partition(" ")[0], f"contact {usage}"
        made = commands.add_parser(name, help=text, description=text, usage=usage, **more)
        made.add_argument("--help", action="help", help="show this help and leave")
        return made

    demo = command(
        "demo [--out DIR] [options]",
        "solve an example, a bar pressed on a foundation, with its figures",
        parents=[replaced, *told, overwrite],
    )
    demo.add_argument("--out", metavar="DIR", help="folder for results; contact-demo by default")
    new = command(
        "new MESH [--case CASE.toml]", "write a commented case file for a mesh file, with its parts"
    )
    new.add_argument(
        "mesh",
        metavar="MESH",
        help="mesh file: .msh with named physical groups, .inp, .vtu, .med, ...",
    )
    new.add_argument("--case", metavar="FILE", help="file to write; MESH.toml by default")
    mesh = command(
        "mesh FILE PART.xdmf",
        "write a mesh file as XDMF of which each rank reads its share, for many ranks",
    )
    mesh.add_argument("file", metavar="FILE", help="mesh file: .msh, .inp, .vtu, .med, ...")
    mesh.add_argument("to", metavar="PART.xdmf", help="the new file; PART.h5 is written beside it")
    check = command(
        "check CASE.toml [options] [PETSc options]",
        "validate a case and print it with its mesh parts and unknowns",
        parents=[case, replaced],
    )
    solve = command(
        "solve CASE.toml --out DIR [options] [PETSc options]",
        "solve a case and write the results",
        parents=[replaced, *told, overwrite],
        epilog=PETSC,
    )
    sweep = command(
        "sweep CASE.toml --over KEY=V1,V2,... --out DIR [options]",
        "solve a case for several values of some keys: sweep.csv, one row per value",
        parents=[case, replaced, *told],
    )
    plot = command(
        "plot DIR [options]", "draw the figures of a run from its files, or the figure of a sweep"
    )
    view = command(
        "view DIR [options]",
        "show the body of a run in 3-D and its contact in a window, to turn it",
    )
    identify = command(
        "identify CASE.toml DATA.csv --for KEY,... [options]",
        "find the parameters with which a case fits measured columns of steps.csv best",
        parents=[case, replaced, quiet],
    )
    materials = command(
        'materials ["NAME"] [--file FILE]',
        "list the materials that have a name, or show one with its derived constants",
    )
    command(
        "schema",
        "print the JSON schema of the case file, by which editors complete and check TOML",
        epilog="contact schema > contact.schema.json, and as the first line of a case file\n"
        "#:schema ./contact.schema.json",
    )
    solve.add_argument("case", metavar="CASE.toml", help="case file (TOML)", nargs="?")
    check.add_argument(
        "--plot",
        **FLAG,
        help="draw the set-up too: CASE-setup.png and .pdf in the present folder, which it "
        "replaces",
    )
    solve.add_argument("--plot", **FLAG, help="draw the figures too")
    solve.add_argument("--out", metavar="DIR", help="folder for results")
    solve.add_argument(
        "--restart",
        metavar="DIR",
        help="go on with an interrupted evolution from its checkpoints in DIR, which have the "
        "case too; the results go to DIR unless --out names another folder",
    )
    sweep.add_argument(
        "--over",
        metavar="KEY=V1,V2,...",
        **MANY,
        help="the values of a key, for all combinations; may be repeated",
    )
    sweep.add_argument(
        "--columns",
        metavar="KEY,...",
        **MANY,
        help="further columns: keys of summary.json, max_dev_strain, reactions.left, ...; "
        "may be repeated",
    )
    sweep.add_argument("--out", metavar="DIR", help="folder for the table; rows in it are kept")
    sweep.add_argument(
        "--cold", **FLAG, help="start each solve from the zero initial guess, without a warm start"
    )
    plot.add_argument(
        "folder", metavar="DIR", help="folder with the results of a run, or of a sweep"
    )
    plot.add_argument(
        "--field",
        metavar="NAME",
        **MANY,
        help="colour the body by this field of fields.vtu, von_mises, displacement, "
        "displacement_y, stress_xy, potential, ..., and draw this figure alone; of a sweep, draw "
        "this column, as figure-sweep-NAME; may be repeated",
    )
    plot.add_argument(
        "--format", metavar="pdf,png", default="png", help="formats of the files: png, pdf, svg"
    )
    plot.add_argument("--width", metavar="85mm", help="width of the figures, in mm, cm or in")
    plot.add_argument(
        "--view",
        metavar="X,Y,Z",
        help="direction from a body in 3-D to the eye; without it one that sees the contact",
    )
    plot.add_argument(
        "--step",
        metavar="N",
        type=int,
        help="draw the results at the end of a step of an evolution, from 1, as figure-NAME-step-N",
    )
    plot.add_argument(
        "--html",
        **FLAG,
        help="write figure-view.html instead, a body in 3-D to turn in a browser "
        "(needs pyvista[jupyter])",
    )
    view.add_argument("folder", metavar="DIR", help="folder with the results of a run")
    view.add_argument(
        "--field",
        metavar="NAME",
        help="colour the body by this field, as contact plot; else contact pressure",
    )
    identify.add_argument(
        "data", metavar="DATA.csv", help="measurements: t, and columns of steps.csv"
    )
    identify.add_argument(
        "--for", metavar="KEY,...", dest="keys", help="keys of the case whose numbers are sought"
    )
    identify.add_argument(
        "--bound",
        metavar="KEY=A:B",
        **MANY,
        help="least and largest value of a parameter; may be repeated",
    )
    identify.add_argument("--plot", metavar="FILE", help="draw fit and residuals into a new file")
    materials.add_argument("name", metavar="NAME", help="material to show", nargs="?")
    materials.add_argument("--file", metavar="FILE", help="a library of one's own (TOML)")
    return whole, dict(commands.choices)
