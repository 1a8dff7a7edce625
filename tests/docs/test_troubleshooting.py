"""What a message means: each identifier of a message has one entry of the page, and none is idle.

Identifiers are read from the sources: what `InputError` and `fault` are raised with, and the keys
of the tables of remarks. Warnings of the log have none, and are found by their words. Entries also
name messages by phrases in code at their head, for readers who search for words; … stands for what
differs.
"""

import ast
import re
from collections import Counter

from tests.docs.pages import ROOT

PAGE = (ROOT / "docs" / "troubleshooting.md").read_text()
SOURCES = sorted([*(ROOT / "contact").rglob("*.py"), *(ROOT / "meshes").rglob("*.py")])
TREES = [ast.parse(path.read_text()) for path in SOURCES]
DIFFERS = "…"

#: What takes an identifier, and where.
TAKES = {"InputError": 1, "SingularError": 1, "fault": 3, "require": 3, "expect": 4, "refuse": 2}
TAKES["Fault"] = 1


def text_of(node: ast.expr) -> str:
    """Return what is known of a text before the program runs."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(map(text_of, values))
        case ast.BinOp(op=ast.Add(), left=left, right=right):
            return text_of(left) + text_of(right)
    return DIFFERS


def identifiers() -> set[str]:
    """Return all identifiers of the program."""
    found = set()
    for node in (node for tree in TREES for node in ast.walk(tree)):
        match node:
            case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name), args=args) if len(
                args
            ) > TAKES.get(name, 99):
                found |= {text_of(part) for part in ast.walk(args[TAKES[name]]) if is_text(part)}
            case ast.For() | ast.comprehension() if "remarks" in ast.unparse(node.target):
                found |= set(re.findall(r"'([a-z-]+)':", ast.unparse(node.iter)))
    return found


def is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value != ""


def heads() -> list[str]:
    """Return the heads of entries: their identifiers, and the phrases before their colon."""
    code = r"(?:\*\*)?`[^`]+`(?:\*\*)?,?\s+"
    return re.findall(rf"^ *- ((?:{code})*`[^`]+`(?=:|\*\*$)|\*\*`[^`]+`\*\*$)", PAGE, re.MULTILINE)


def of_page() -> list[str]:
    """Return the identifiers of the page."""
    code = [" ".join(one.split()) for head in heads() for one in re.findall(r"`([^`]+)`", head)]
    return [one[1:-1] for one in code if re.fullmatch(r"\[[a-z-]+\]", one)]


def test_each_identifier_has_one_entry() -> None:
    assert len(identifiers()) > 100
    assert Counter(of_page()) == Counter(identifiers())
