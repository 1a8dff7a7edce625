"""What a message means: the page has a place for every message, and none for messages that went.

The messages are read from the sources: what `InputError` and `fault` are raised with, what is
logged as a warning, and what functions that return a `Remark` say. The page names them by phrases
in code at the head of its entries; … stands for what differs.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.docs.pages import ROOT

PAGE = ROOT / "docs" / "troubleshooting.md"
SOURCES = sorted([*(ROOT / "contact").rglob("*.py"), *(ROOT / "meshes").rglob("*.py")])
DIFFERS = "…"

#: The form of messages on a value of the case file, which say all there is to say.
FORMS = ("given …; accepted:", "missing; accepted:")


def text_of(node: ast.expr) -> str:
    """Return what is known of a text before the program runs."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(map(text_of, values))
        case ast.BinOp(op=ast.Add(), left=left, right=right):
            return text_of(left) + text_of(right)
        case ast.Call(func=ast.Name(id="Words"), args=[words]):
            return text_of(words)
        case ast.IfExp(body=body, orelse=orelse):
            return text_of(body) + DIFFERS + text_of(orelse)
    return DIFFERS


def message_of(call: ast.Call) -> str:
    """Return the message that a call makes; nothing for one that says nothing of its own."""
    match call:
        case ast.Call(func=ast.Name(id="InputError"), args=[text]):
            return text_of(text)
        case ast.Call(func=ast.Name(id="fault"), args=[_, given, accepted]):
            words = isinstance(given, ast.Call) and ast.unparse(given.func) == "Words"
            said = text_of(given) if words else f"given {DIFFERS}"
            return f"{DIFFERS}: {said}; accepted: {text_of(accepted)}"
        case ast.Call(func=ast.Attribute(attr="warning"), args=[text, *_]):
            return text_of(text).replace("%s", DIFFERS)
    return ""


def raised(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text())):
        text = message_of(node) if isinstance(node, ast.Call) else ""
        # Not what hands another message on, or says but the form.
        if re.search(r"\w{3}", re.sub("given|accepted", "", text)):
            yield text


def remarks(path: Path) -> Iterator[str]:
    """Give what each function that returns remarks may say, all of it as one text."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef) and node.returns is not None:
            if re.search(r"Remark|tuple\[str, bool\]", ast.unparse(node.returns)):
                texts = map(text_of, (n for n in ast.walk(node) if isinstance(n, ast.expr)))
                said = [text for text in texts if " " in text and text != documented(node)]
                if said:
                    yield DIFFERS.join(said)


def documented(node: ast.FunctionDef) -> str | None:
    return ast.get_docstring(node, clean=False)


def advice(path: Path) -> Iterator[str]:
    """Give what is printed as a warning."""
    tree = ast.parse(path.read_text())
    inner = {id(part) for n in ast.walk(tree) if isinstance(n, ast.JoinedStr) for part in n.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.expr) and id(node) not in inner:
            if re.match(r"(# )?warning: \w", text_of(node)):
                yield text_of(node)


@cache
def messages() -> list[str]:
    return sorted({text for path in SOURCES for find in (raised, advice) for text in find(path)})


@cache
def all_remarks() -> list[str]:
    return sorted({text for path in SOURCES for text in remarks(path)})


def phrases() -> list[str]:
    """Return the phrases of the page: code at the head of an entry, before its colon."""
    heads = re.findall(r"^- ((?:`[^`]+`(?:,\s+)?)+):", PAGE.read_text(), re.MULTILINE)
    found = [phrase for head in heads for phrase in re.findall(r"`([^`]+)`", head)]
    return [" ".join(phrase.split()) for phrase in found]


def identifiers() -> set[str]:
    """Return the identifiers that warnings and notes end with: keys of tables of remarks."""
    found = set()
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.For | ast.comprehension) and "remarks" in ast.unparse(
                node.target
            ):
                found |= set(re.findall(r"'([a-z-]+)':", ast.unparse(node.iter)))
    return found


def test_identifiers_have_a_place() -> None:
    assert len(identifiers()) > 15
    assert {f"[{one}]" for one in identifiers()} == {p for p in phrases() if p.startswith("[")}


def fits(phrase: str, message: str) -> bool:
    pattern = ".*".join(map(re.escape, phrase.split(DIFFERS)))
    return re.search(pattern, message) is not None


def known(message: str) -> bool:
    form = any(fits(form, message) for form in FORMS)
    return form or any(fits(phrase, message) for phrase in phrases())


def test_there_are_messages() -> None:
    assert len(messages()) > 200 and len(all_remarks()) > 10 and len(phrases()) > 80


def test_every_message_has_a_place() -> None:
    missing = [text for text in (*messages(), *all_remarks()) if not known(text)]
    assert not missing, "\n".join(missing)


@pytest.mark.parametrize("phrase", [*(p for p in phrases() if p[0] != "["), *FORMS])
def test_every_place_has_a_message(phrase: str) -> None:
    said = "\n".join(path.read_text() for path in SOURCES)
    joined = re.sub(r'"\s*f?"', "", said)  # texts over several lines
    plain = re.sub(r"\{[^{}]*\}", DIFFERS, joined)
    assert any(fits(phrase, text) for text in (*messages(), *all_remarks())) or phrase in plain
