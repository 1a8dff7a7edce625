"""The reference page of the command line, made from its arguments.

``python3 -m scripts.command_page`` writes ``docs/command-line.md``.
"""

from __future__ import annotations

from argparse import Action
from pathlib import Path

from contact.cli.arguments import EXIT, parser

PAGE = Path(__file__).parents[1] / "docs" / "command-line.md"

INTRODUCTION = """\
# Command line

<!-- Made by `python3 -m scripts.command_page`; edit contact/cli/arguments.py instead. -->

`contact COMMAND ...`, or `python3 -m contact COMMAND ...`; in parallel with `mpirun -n N` before
either. From a clone: `scripts/fx python3 -m contact COMMAND ...`. Options of PETSc have one dash
and come last, those of the linear solver with the prefix `contact_`: `-contact_ksp_monitor`.
"""


def page() -> str:
    """Return the reference page (Markdown)."""
    lines = [INTRODUCTION]
    for name, command in parser()[1].items():
        text = str(command.description)
        lines += [f"## contact {name}", ""]
        lines += ["```text", str(command.usage), "```", "", f"{text[0].upper()}{text[1:]}."]
        arguments = [action for action in command._actions if action.dest != "help"]
        if arguments:
            lines += ["", "| argument | meaning |", "|---|---|"]
            lines += [_row(action) for action in arguments]
        if command.epilog is not None:
            lines += ["", "```text", command.epilog.rstrip(), "```"]
        lines.append("")
    lines += ["## Exit status", "", "| status | meaning |", "|---|---|"]
    said = " ".join(EXIT.split()).removeprefix("exit status: ")
    for entry in said.split("; "):
        status, _, meaning = entry.partition(" ")
        lines.append(f"| {status} | {meaning} |")
    return "\n".join(lines) + "\n"


def _row(action: Action) -> str:
    usage = " ".join([*action.option_strings, str(action.metavar or "")]).strip()
    text = str(action.help).replace("|", r"\|")
    return f"| `{usage}` | {text[0].upper()}{text[1:]}. |"


if __name__ == "__main__":
    PAGE.write_text(page())
