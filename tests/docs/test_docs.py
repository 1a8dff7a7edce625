"""Every code block of the documentation runs, links lead somewhere, the index has all pages."""

import csv
import inspect
import itertools
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import contact
from contact import refining
from contact.linear import multigrid, petsc
from contact.methods import (
    fallbacks,
    interior_point,
    load_stepping,
    newton,
    newton_step,
    safeguards,
    semismooth,
)
from contact.methods.options import FixedPointOptions, NewtonOptions
from contact.problem import condensed
from contact.thesis import fixed_point, penalty, softest_mode, uzawa
from contact.tolerances import LARGEST_VIOLATION
from scripts import command_page
from scripts.reporting import text
from scripts.thesis import results_page
from scripts.thesis.chapters import PARTS
from tests.docs.pages import ROOT, blocks, run

DOCS = ROOT / "docs"
PAGES = sorted(
    path
    for path in DOCS.glob("*.md")
    if path.name not in ("architecture.md", "results.md") and not path.name.startswith("thesis-")
)
#: Pages whose code takes seconds.
LONG = (
    "api-derivatives", "derivatives", "evolution", "example-bracket", "how-to", "output", "python",
    "tutorial",
)  # fmt: skip
#: What makes the problems of a page small.
SMALL = {'bar.toml")': 'bar.toml", ["mesh.cells=[16, 4]"])'}


def shows_code(page: Path) -> bool:
    """Tell whether there is something to run on a page."""
    return any(block.language in ("python", "sh", "toml") for block in blocks(page))


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=page.stem, marks=pytest.mark.slow if page.stem in LONG else ())
        for page in filter(shows_code, PAGES)
    ],
)
def test_code_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder of its own, as a reader would type it."""
    for module in ("gmsh", "pyvista", "meshio"):
        if re.search(rf"^import {module}|^from {module}", page.read_text(), re.M):
            pytest.importorskip(module)
    monkeypatch.chdir(tmp_path)
    if page.stem == "output":  # it opens what a run has left
        assert run_bar(tmp_path) == 0
    run(page, SMALL)


def run_bar(folder: Path) -> int:
    from contact.cli.main import main

    case = str(ROOT / "scripts" / "cases" / "bar.toml")
    coarse = ["--set", "mesh.cells=[16, 4]", "--quiet"]
    return main(["solve", case, "--out", str(folder / "results"), *coarse])


@cache
def anchors(page: Path) -> set[str]:
    """Return the headings of a page as the ends of links, in GitHub's spelling."""
    included = re.findall(r"^```{include} (\S+\.md)$", page.read_text(), re.M)
    texts = [one.read_text() for one in (page, *(page.parent / name for name in included))]
    prose = re.sub(r"^```.*?^```", "", "\n".join(texts), flags=re.M | re.S)
    words = [re.sub(r"[^\w\- ]", "", x).lower() for x in re.findall(r"^#+ (.*)$", prose, re.M)]
    return {heading.replace(" ", "-") for heading in words}


def test_links_lead_somewhere() -> None:
    for page in [*sorted(DOCS.glob("*.md")), ROOT / "README.md"]:
        written = page.read_text()
        links = re.findall(r"\]\(([^)#:\s]*)(?:#([^)\s]*))?\)", written)
        for target, anchor in [*links, *re.findall(r'src="([^":]+)()"', written)]:
            there = page.parent / target if target else page
            assert there.exists(), f"{page.name}: {target}"
            if target.endswith(".png"):  # a whole one
                assert there.read_bytes()[-8:-4] == b"IEND", f"{page.name}: {target}"
            assert not anchor or anchor in anchors(there), f"{page.name}: {target}#{anchor}"


def listed(page: str) -> list[str]:
    """Return the pages in the tables of contents of a page."""
    tables = re.findall(r"^```{toctree}\n(.*?)^```", (DOCS / f"{page}.md").read_text(), re.M | re.S)
    return re.findall(r"^([a-z][a-z-]*)$", "".join(tables), re.M)


def test_every_page_is_in_one_table_of_contents() -> None:
    reached, front = ["index"], ["index"]
    while front:
        front = [below for page in front for below in listed(page)]
        reached += front
    assert sorted(reached) == sorted(page.stem for page in DOCS.glob("*.md"))


def test_the_summary_of_the_thesis_is_that_of_its_files() -> None:
    said = (DOCS / "results.md").read_text()
    made = said.partition("## Versions\n\n")[2].strip()
    assert results_page.overview(DOCS / "results", made) == said
    for part in PARTS:
        assert f"\n## {part.heading}\n" in (DOCS / f"{part.page}.md").read_text()


def test_the_command_line_is_that_of_the_program() -> None:
    assert command_page.PAGE.read_text() == command_page.page(), "scripts.command_page"


def same(cell: str, number: str) -> bool:
    """Tell whether a cell of a page shows that of a file of numbers."""
    if number in ("True", "False"):
        number = text(number == "True")
    number = number.replace("|", r"\|")
    try:
        return cell in (number, text(float(number))) or float(cell) == float(text(float(number)))
    except ValueError:
        return cell in (number, "—") and number in (cell, "", "nan")


def measured_tables() -> dict[tuple[str, ...], list[list[list[str]]]]:
    """Return header -> rows of the files of numbers with that header."""
    found: dict[tuple[str, ...], list[list[list[str]]]] = {}
    for path in sorted([*DOCS.glob("results/*/*.csv"), *DOCS.glob("benchmarks/*.csv")]):
        with path.open() as stream:
            head, *rows = csv.reader(stream)
        name = tuple(cell.strip().replace("|", r"\|") for cell in head)
        found.setdefault(name, []).append(rows)
    return found


def matches(rows: list[list[str]], numbers: list[list[str]]) -> bool:
    """Tell whether the rows of a page show those of a file of numbers."""
    if [len(row) for row in rows] != [len(row) for row in numbers]:
        return False
    return all(map(same, itertools.chain(*rows), itertools.chain(*numbers)))


def test_tables_of_pages_are_those_of_the_files_of_numbers() -> None:
    files, compared, wrong = measured_tables(), 0, []
    for page in sorted([*DOCS.glob("*.md"), *DOCS.glob("results/*/*.md")]):
        for table in re.findall(r"(?:^\|.*\n){3,}", page.read_text(), re.M):
            head, _, *rows = [
                [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip()[1:-1])]
                for line in table.splitlines()
            ]
            if tuple(head) in files:
                compared += 1
                if not any(matches(rows, numbers) for numbers in files[tuple(head)]):
                    wrong.append(f"{page.name}: {head}")
    assert compared > 80 and not wrong, "\n".join(wrong)


def test_every_public_name_has_its_place_in_the_reference() -> None:
    pages = "".join(page.read_text() for page in DOCS.glob("api-*.md"))
    listed = set(re.findall(r"^\.\. auto\w+:: (\S+)$", pages, re.M))
    members = set(re.findall(r"\w+", "".join(re.findall(r":members:(.*)$", pages, re.M))))
    shown = [block for page in DOCS.glob("api-*.md") for block in blocks(page)]
    code = "".join(block.text for block in shown if block.language == "python")
    examples = set(re.findall(r"\w+", code))
    for name, (module, there) in contact._PUBLIC.items():
        assert f"{module}.{there}" in listed or there in members, name
        assert name in examples, f"no example has {name}"
        made = getattr(contact, name)
        if inspect.isfunction(made) and made.__annotations__["return"] != "None":
            assert re.search(r"^ *(Returns|Yields)\n *-{6,7}$", made.__doc__ or "", re.M), name


@pytest.mark.slow
def test_pages_build_without_warnings(tmp_path: Path) -> None:
    """All but the notebooks, which `make docs` executes first."""
    pytest.importorskip("sphinx")
    for module in ("myst_parser", "pydata_sphinx_theme", "sphinx_design", "sphinxcontrib.bibtex"):
        pytest.importorskip(module)
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-D"]
    command += ["exclude_patterns=results/**,notebooks/**", str(DOCS), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "Domain.from_mesh" in (tmp_path / "api-geometry.html").read_text()
    if Path("/usr/share/javascript/mathjax").is_dir():  # formulas are drawn without a network
        assert "_static/mathjax/MathJax.js" in (tmp_path / "theory.html").read_text()
        assert (tmp_path / "_static/mathjax/jax/output/SVG/jax.js").exists()


def test_files_that_pages_name_are_there() -> None:
    pages = [page for page in DOCS.glob("*.md") if page.name != "changes.md"]
    pattern = r"`((?:contact|forms|meshes|scripts|tests)/[\w/.-]+)`"
    named = {name for page in pages for name in re.findall(pattern, page.read_text())}
    missing = [name for name in sorted(named) if not (ROOT / name).exists()]
    assert len(named) > 20 and not [name for name in missing if "NAME" not in name]


def file_named(name: str) -> str:
    """Return the text of a file in `contact/`, or of the folders beside it."""
    (path,) = (path for root in ("contact", ".") if (path := ROOT / root / name).is_file())
    return path.read_text(encoding="utf-8")


def test_equations_lead_to_names_that_are_there() -> None:
    section = (DOCS / "theory.md").read_text().split("## Equations of the thesis")[1]
    places = re.findall(r"`([\w/]+\.py)`((?:[:,] `\w+`)*)", section)
    assert len(places) > 14
    for file, names in places:
        defined = re.findall(r"(?:def|class) (\w+)", file_named(file))
        assert {*re.findall(r"`(\w+)`", names)} <= {*defined}, file


def test_the_architecture_and_how_to_add_name_what_is_there() -> None:
    page = (DOCS / "architecture.md").read_text()
    steps = (ROOT / "CONTRIBUTING.md").read_text().split("## How to add")[1].split("\n## ")[0]
    calls = page.split("```text\n")[1].split("```")[0]
    files = re.findall(r"`(\w[\w-]*/[\w/-]+\.(?:pyi?|md|toml|bib))`", page + steps)
    files += re.findall(r"\w+/\w+\.py", calls)
    assert len(files) > 50
    tops = ("contact", "forms", "meshes")
    modules = [path for top in tops for path in (ROOT / top).rglob("*.py")]
    sources = [file_named(file) for file in files if "NAME" not in file]
    sources += [path.read_text() for path in modules]
    known = {*re.findall(r"\w+", "".join(sources))} | {path.stem for path in modules}
    names = re.findall(r"`([A-Za-z_]\w*(?:\.\w+)*)`", page + steps)
    for line in calls.splitlines():
        names += re.findall(r"\b[a-z]+_\w+|\b[A-Z][a-z]\w*", line.split("   ")[0])
    assert {part for name in names for part in name.split(".")} <= known


def test_constants_of_the_algorithms_are_those_of_the_code() -> None:
    page = (DOCS / "algorithms.md").read_text()
    options = NewtonOptions()
    said = {
        f"after [{options.stagnation_limit}] steps in which": semismooth.PROGRESS == 0.5,
        f"after [{options.max_iterations}] steps;": True,
        "is [10³] times all loads": semismooth.OVERESTIMATE == 1e3,
        "is limited to [1/4] κ": options.softening == 0.25,
        "10^4 \\max(c, \\kappa)": options.gamma == 1e4,
        "below [1/10] of the largest one": newton_step.SMALL == 0.1,
        "the forcing term [10⁻²]": newton_step.FORCING == 1e-2,
        f"At most\n   [{petsc.CORRECTIONS}] corrections follow": True,
        "each three steps": newton_step.STAGNANT == 3,
        "[10^{-2}]\\,\\kappa$ is added": safeguards.REGULARISATION == 1e-2,
        "tolerance is [10⁻³] of the": newton.CONTACT_PART == 1e-3,
        "has not fallen to [1/20]": newton.UNSOLVED == 0.05,
        "below a residual of [0.05]": newton.RADIUS == 0.05,
        f"within [{newton.MOST_STEPS:g}] steps": True,
        f"at most [{interior_point.LIMIT}] times": True,
        f"at most [{interior_point.UPDATES}] times": True,
        "below [10⁻¹⁰] of the work": interior_point.CLOSED == 1e-10,
        f"[{interior_point.SHORTEST} to {interior_point.LONGEST}] of the way": True,
        "with k = [10⁻²] c": fallbacks.PROXIMAL_STIFFNESS == 1e-2,
        f"are at most [{fallbacks.NEARLY_BALANCED}]": True,
        f"below a residual of [{fallbacks.NEARLY_BALANCED}] Newton": True,
        f"of [{softest_mode.STEPS}] steps of the Krylov method": True,
        f"at most\n   [{fallbacks.SECANTS}] times": True,
        f"Multiply k by [{fallbacks.SOFTER}]": True,
        f"multiply k by [{fallbacks.STIFFER:g}] until": True,
        f"after [{fallbacks.STAGNANT_PROBLEMS}] problems in succession": True,
        f"to [{fallbacks.NEARER}] of its least value": True,
        "the part [10⁻⁹]": fallbacks.FIRST_PART == 1e-9,
        "by [10³]": fallbacks.FACTOR == 1e3,
        f"down to [{fallbacks.LEAST_FACTOR}]": True,
        f"over [{FixedPointOptions().depth}] solves": True,
        f"up to [{load_stepping.HALVINGS}] times": True,
        f"by the factor\n   [{load_stepping.FARTHEST:g}]": True,
        f"k is at most [{condensed.LARGEST}]": True,
        f"at most [{multigrid.DIRECT:,}] unknowns": True,
        f"in 3-D from [{multigrid.LARGE[3, False]:,}] unknowns": True,
        f"a potential from [{multigrid.LARGE[3, True]:,}] on": True,
        f"in 2-D from [{multigrid.LARGE[2, False]:,}] on": True,
        f"k is at most [{condensed.ALWAYS}]": True,
        f"less than [{condensed.DENSE_IS_FASTER:g}] sparse ones": True,
        "is more than [half] of that before": fallbacks.PROGRESS == 0.5,
        "is [10⁻⁴] f b²/d": interior_point.SHARE == 1e-4,
        f"is [{interior_point.SHARE_UNSUPPORTED}] of that of the loads": True,
        "below\n   [10⁻⁴]": interior_point.FORCING == 1e-4,
        "below [half] of the least": interior_point.PROGRESS == 0.5,
        f"stagnation limit [{fallbacks.CONTINUATION_LIMIT}]": True,
        f"or after [{uzawa.STAGNATION_LIMIT}]\n": True,
        f"iterations, [{uzawa.STAGNATION_LIMIT_PLAIN}] without acceleration": True,
        "by [1 %]": uzawa.PROGRESS == 0.99,
        f"after [{fixed_point.FixedPoint.stagnation[0]}] iterations": True,
        f"after [{fixed_point.STALLED}] where the relaxation": True,
        f"after [{penalty.Penalty.stagnation[0]}] iterations that do not reduce its": True,
        f"more than [{LARGEST_VIOLATION}] the run": penalty.Penalty.stagnation[1] == 0.99,
        "by [10 %]": fixed_point.FixedPoint.stagnation[1] == 0.9,
        f"by more than [{LARGEST_VIOLATION}] of the largest displacement": True,
        "Below a residual of [10⁻²]": fixed_point.NEAR == 1e-2,
        "the residual is below [10⁻²], friction": fixed_point.NEAR == 1e-2,
        "to [10⁻³], and each": refining.COARSE_TOLERANCE == 1e-3,
        f"from [{refining.MANY['whole']:,}] unknowns on": True,
        f"[{refining.MANY['condensed']:,}] on": True,
    }
    assert [words for words, holds in said.items() if words not in page or not holds] == []
    rows = [found.span() for words in said for found in re.finditer(re.escape(words), page)]
    for number in re.finditer(r"\[[\d.,/⁰¹²³⁴⁵⁶⁷⁸⁹⁻ %to]+\](?!\()", page):
        begin, end = number.span()
        assert any(a <= begin and end <= b for a, b in rows), f"{number[0]} at {begin} has no row"
