"""Code blocks of a page, and what runs them as a reader would: one after the other, in a folder.

A block after the comment ``<!-- file: NAME -->`` is a file that the reader writes. Else blocks of
``python`` are executed, each with the names of those before; ``sh`` line by line; ``toml`` is read.
A block of ``text`` right behind one of ``python`` is what that prints. Other languages (``bash``)
show what is not executed.
"""

import contextlib
import io
import math
import re
import runpy
import shlex
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

from contact.case.file import parse_case
from contact.cli.main import main

ROOT = Path(__file__).parents[2]
_BLOCK = re.compile(
    r"(?:<!-- file: (\S+) -->\n+)?^```([^`\n]*)\n(.*?)^```", re.DOTALL | re.MULTILINE
)


class Block(NamedTuple):
    """A block of code: the file that it is, if any, its language, its text, its line."""

    file: str
    language: str
    text: str
    line: int


def blocks(page: Path) -> list[Block]:
    """Return the blocks of a page."""
    text = page.read_text()
    found = _BLOCK.finditer(text)
    return [Block(m[1] or "", m[2], m[3], text.count("\n", 0, m.start()) + 1) for m in found]


def alike(shown: list[str], printed: list[str]) -> bool:
    """Tell whether words and whole numbers are those that are shown, others within 5 %.

    Meshes differ from one version of Gmsh to the next.
    """

    def same(a: str, b: str) -> bool:
        if a == b or "." not in a:
            return a == b
        try:
            return math.isclose(float(a), float(b), rel_tol=0.05)
        except ValueError:
            return False

    return len(shown) == len(printed) and all(map(same, shown, printed))


def run(page: Path, small: dict[str, str] | None = None) -> dict[str, Any]:
    """Run a page in the present folder; return the names that its Python blocks leave.

    Parameters
    ----------
    page
        The page.
    small
        Texts and what replaces them, so that a test takes less time than its reader.
    """
    if not Path("scripts").exists():
        Path("scripts").symlink_to(ROOT / "scripts")
    names: dict[str, Any] = {"__name__": "__main__"}
    printed = io.StringIO()
    for block in blocks(page):
        text = block.text
        for given, taken in (small or {}).items():
            text = text.replace(given, taken)
        place = f"{page.name}:{block.line}"
        if block.file:
            Path(block.file).write_text(text)
        elif block.language == "python":
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                exec(compile("\n" * block.line + text, place, "exec"), names)
        elif block.language == "text" and printed.getvalue():
            assert alike(text.split(), printed.getvalue().split()), f"{place}: {printed.getvalue()}"
            printed = io.StringIO()
        elif block.language == "sh":
            for line in text.replace("\\\n", " ").splitlines():
                _command(shlex.split(line, comments=True), place)
        elif block.language == "toml":
            data = tomllib.loads(text)
            if {"mesh", "material", "fixed", "contact"} <= set(data):
                parse_case(data)
    return names


def _command(words: list[str], place: str) -> None:
    if words[:1] == ["scripts/fx"]:
        words = words[1:]
    if words[:3] == ["python3", "-m", "contact"]:
        words = words[2:]
    if words[:1] == ["contact"]:
        status = main(words[1:])
        assert status == 0, f"{place}: {shlex.join(words)} left with {status}"
    elif words[:1] == ["python3"]:
        runpy.run_path(words[1], run_name="__main__")
    else:
        assert not words, f"{place}: what runs {words[0]!r}? bash blocks are not executed"
