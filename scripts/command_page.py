"""The reference page of the command line, made from its arguments.

``python3 -m scripts.command_page`` writes ``docs/command-line.md``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from contact.cli.arguments import EXIT, offered

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
    for usage, purpose, epilog, arguments in offered():
        lines += [f"## contact {usage.partition(' ')[0]}", ""]
        lines += ["```text", f"contact {usage}", "```", "", f"{purpose[0].upper()}{purpose[1:]}."]
        if arguments:
            lines += ["", "| argument | meaning |", "|---|---|"]
            lines += [_row(name, options) for name, options in arguments.items()]
        if epilog is not None:
            lines += ["", "```text", epilog.rstrip(), "```"]
        lines.append("")
    lines += ["## Exit status", "", "| status | meaning |", "|---|---|"]
    said = " ".join(EXIT.split()).removeprefix("exit status: ")
    for entry in said.split("; "):
        status, _, meaning = entry.partition(" ")
        lines.append(f"| {status} | {meaning} |")
    return "\n".join(lines) + "\n"


def _row(name: str, options: dict[str, Any]) -> str:
    shown = options.get("metavar", "")
    usage = f"{name} {shown}".strip() if name.startswith("-") else shown
    text = options["help"].replace("|", r"\|")
    return f"| `{usage}` | {text[0].upper()}{text[1:]}. |"


if __name__ == "__main__":
    PAGE.write_text(page())
