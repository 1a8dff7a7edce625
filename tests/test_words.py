"""The words of the field: private ones are not to come back into sources and pages.

`python3 -m tests.test_words PATH...` lists where they stand.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

#: Forbidden word, as a regular expression in which a blank stands for any gap -> the field's.
WORDS = {
    r"what": "a noun: the supports, not that which holds the body",
    r"roads?": "fallback, globalisation",
    r"last resort": "fallback",
    r"springs?": "Levenberg-Marquardt regularisation",
    r"to and fro": "cycling of the active set",
    r"settled": "active set unchanged",
    r"vain|patience": "stagnation, stagnation limit",
    r"softness|far softer": "smallest eigenvalue, spectral estimate",
    r"grips?": "rigid-body mode not constrained by the supports",
    r"loose(ly|ness)?": "rigid-body mode not constrained by the supports",
    r"few nodes": "interior-point fallback",
    r"leftovers?": "remainder, residual, Schur complement",
    r"recipes?": "parametric mesh generator",
    r"honest(ly)?": "the meaning: converged to the stated residual",
    r"from rest": "zero initial guess, reference configuration",
    r"at rest": "in the reference configuration",
    r"remember(s|ed)?": "history, incremental friction",
    r"lengthen(s|ed|ing)?": "longer step (of a chord), greater",
    r"frozen friction": "fixed point on the friction bound",
    r"(conductivity|load) steps? of a static": "continuation",
    r"dense solves?": "Newton iterations on the condensed problem",
    r"flexibility": "compliance (Delassus) matrix",
    r"nested mesh(es)?": "nested iteration",
    r"beyond (the )?yield": "in the plastic range",
    r"laws? hold": "complementarity conditions are met",
    r"(?<!Uzawa.)block relaxation": "Uzawa block relaxation",
    r"bulges?": "deviation of a curved surface from its chord",
    r"in\s+space": "in 3-D",
}

#: Most of them that a package, or a page, may have. Nothing may rise; what is mended lowers it.
ALLOWED: dict[str, int] = {}

#: A word ends where its letters do: underscores of identifiers are borders too.
PATTERNS = {
    word: re.compile(rf"(?<![A-Za-z])(?:{word})(?![a-z])".replace(" ", r"[\s_]+"), re.IGNORECASE)
    for word in WORDS
}


def packages() -> dict[str, list[Path]]:
    """Return the sources by package, and each page by itself."""
    found: dict[str, list[Path]] = {}
    for top in ("contact", "forms", "meshes", "scripts"):
        for path in sorted((ROOT / top).rglob("*.py")):
            parts = path.relative_to(ROOT).parts
            name = "/".join(parts[:2] if top == "contact" and len(parts) > 2 else parts[:1])
            found.setdefault(name, []).append(path)
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        found[str(path.relative_to(ROOT))] = [path]
    return found


def joined(text: str) -> str:
    """Return a text whose sentences go on over the ends of lines, in comments and strings too."""
    text = re.sub(r"\"[ \t]*\n[ \t]*f?\"", "", text)
    return re.sub(r"[ \t]*\n[ \t]*#:?[ \t]*", " ", text)


def offences(path: Path) -> Iterator[tuple[str, str]]:
    """Give each forbidden word of a file and the text around it."""
    text = joined(path.read_text(encoding="utf-8"))
    for word, pattern in PATTERNS.items():
        for match in pattern.finditer(text):
            around = text[max(0, match.start() - 40) : match.end() + 30]
            yield word, " ".join(around.split())


@pytest.mark.core
@pytest.mark.parametrize("package", packages())
def test_words_of_the_field(package: str) -> None:
    found = [(path.name, *place) for path in packages()[package] for place in offences(path)]
    allowed = ALLOWED.get(package, 0)
    said = [f"{name}: ...{around}... -> {WORDS[word]}" for name, word, around in found]
    assert len(found) <= allowed, "\n".join(said)


def main() -> None:
    """List the forbidden words of some packages, or the number of each package."""
    for package, paths in packages().items():
        found = [(path, *place) for path in paths for place in offences(path)]
        if len(sys.argv) == 1 and found:
            print(f'    "{package}": {len(found)},')
        elif package in sys.argv[1:]:
            for path, word, around in found:
                print(f"{path.relative_to(ROOT)}: {around} -> {WORDS[word]}")


if __name__ == "__main__":
    main()
