"""What the commands share of their arguments."""

from __future__ import annotations

import argparse
from typing import Any, NoReturn

from mpi4py import MPI

from contact.errors import InputError

#: PETSc's options begin with one dash and any letter, -h among them.
COMMON: dict[str, Any] = {
    "add_help": False,
    "allow_abbrev": False,
    "formatter_class": argparse.RawDescriptionHelpFormatter,
}


class Parser(argparse.ArgumentParser):
    """A parser that raises InputError, and prints its help on one rank alone."""

    def error(self, message: str) -> NoReturn:
        """Raise an InputError with the usage."""
        raise InputError(f"{message}; accepted: {' '.join(self.format_usage().split())}")

    def _print_message(self, message: str, file: Any = None) -> None:
        if MPI.COMM_WORLD.rank == 0:
            super()._print_message(message, file)


def add_help(parser: Parser) -> None:
    """Add the option that shows the help."""
    parser.add_argument("--help", action="help", help="show this help and leave")


def add_command(commands: Any, usage: str, text: str, epilog: str | None = None) -> Parser:
    """Add a command and return its parser.

    Parameters
    ----------
    commands
        The commands of the parser.
    usage
        Its name and arguments.
    text
        What it does.
    epilog
        What stands below its options.
    """
    name = usage.partition(" ")[0]
    command: Parser = commands.add_parser(
        name, help=text, description=text, epilog=epilog, usage=f"contact {usage}", **COMMON
    )
    add_help(command)
    return command


def add_case(command: Parser, optional: bool = False) -> None:
    """Add a case file, and what replaces some of its values."""
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


def add_progress(command: Parser) -> None:
    """Add what is shown of a run."""
    command.add_argument("--quiet", action="store_true", help="show no progress")
    command.add_argument("--log", metavar="FILE", help="write a log to the end of a file")
