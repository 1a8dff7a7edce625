"""Tuning constants of the solver: few, each with its meaning beside it."""

import ast

from tests.test_architecture import ROOT

#: Number of constants as it stands. It may only fall.
MOST = 68

#: Constants that tune nothing: codes of MUMPS, formats, nodes of quadrature, geometry.
FORMATS = {
    "TOO_SMALL",
    "OUT_OF_MEMORY",
    "INTERIOR_SOLVE",
    "REDUCE",
    "INVERTED",
    "SCHUR",
    "HEADER",
    "EACH",
    "SIGNALLED",
    "SMOOTH",
    "APART",
}


def numbers(node: ast.expr) -> int:
    """Return how many numbers a constant expression has; 0 where it is none."""
    if isinstance(node, ast.Constant):
        return int(type(node.value) in (int, float))
    if isinstance(node, ast.UnaryOp):
        return numbers(node.operand)
    if isinstance(node, ast.BinOp):
        return int(numbers(node.left) > 0 and numbers(node.right) > 0)
    if isinstance(node, ast.Tuple | ast.List):
        return sum(map(numbers, node.elts))
    return sum(map(numbers, node.values)) if isinstance(node, ast.Dict) else 0


def constants() -> dict[str, tuple[int, bool]]:
    """Return the constants by file and name: how many numbers, and whether a comment says more."""
    found = {}
    for package in ("methods", "linear", "problem", "interface", "body"):
        for path in sorted((ROOT / "contact" / package).rglob("*.py")):
            lines = path.read_text().splitlines()
            for node in ast.parse("\n".join(lines)).body:
                if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
                    continue
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                names = [part.id for part in ast.walk(targets[0]) if isinstance(part, ast.Name)]
                if all(name.isupper() and name not in FORMATS for name in names):
                    known = lines[node.lineno - 2].startswith("#: ")
                    name = f"{path.relative_to(ROOT)}: {', '.join(names)}"
                    found[name] = numbers(node.value), known
    return {name: value for name, value in found.items() if value[0]}


def test_there_are_no_more_than_before():
    count = sum(number for number, _ in constants().values())
    assert count <= MOST, "\n".join(constants())


def test_a_comment_says_what_each_is_for():
    assert not [name for name, (_, known) in constants().items() if not known]
