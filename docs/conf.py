"""Sphinx: `make docs`, or ``python3 -m sphinx -W docs build/docs`` from the top folder."""

import inspect
import os
import re
import shutil
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_type_hints

from sphinx.util.typing import stringify_annotation

import contact

project = "contact-fenicsx"
version = release = contact.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinxcontrib.bibtex",
]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
exclude_patterns = ["results/**", "benchmarks/**", "examples/**"]
bibtex_bibfiles = ["references.bib"]
add_module_names = False
bibtex_reference_style = "author_year"
html_theme = "pydata_sphinx_theme"
html_title = f"{project} {version}"
html_theme_options = {
    "logo": {"text": f"{project} {version}"},
    "navbar_align": "left",
    "header_links_before_dropdown": 8,
    "navbar_persistent": ["search-button"],
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc", "edit-this-page"],
    "use_edit_page_button": bool(os.environ.get("REPOSITORY")),
}
# "edit this page" leads to a public repository, OWNER/NAME on GitHub, where one is named.
if repository := os.environ.get("REPOSITORY", ""):
    owner, _, name = repository.partition("/")
    html_context = {
        "github_user": owner,
        "github_repo": name,
        "github_version": "main",
        "doc_path": "docs",
    }
html_sidebars = {"index": []}
html_last_updated_fmt = None
html_static_path = ["_static"]
html_css_files = ["custom.css"]
html_show_copyright = False
html_show_sphinx = False
autodoc_typehints = "description"
python_use_unqualified_type_names = True
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
napoleon_numpy_docstring = True
napoleon_use_ivar = True
# Links to sources lead to files of the repository, and single quotes of docstrings to nothing.
suppress_warnings = ["myst.xref_missing"]
default_role = "code"

# Pages can be read without a network where MathJax is at hand; its SVG needs no fonts.
MATHJAX = Path("/usr/share/javascript/mathjax")  # Debian's version 2 comes with PETSc
if MATHJAX.is_dir():
    myst_update_mathjax = False  # that is for version 3
    mathjax_path = "mathjax/MathJax.js"
    mathjax2_config = {
        "jax": ["input/TeX", "output/SVG"],
        "extensions": ["tex2jax.js", "MathEvents.js", "TeX/AMSmath.js", "TeX/AMSsymbols.js"],
        "showMathMenu": False,
        "messageStyle": "none",
    }


def _bars(_: Any, __: str, ___: str, made: Any, ____: Any, lines: list[str]) -> None:
    """Let |x| be that in docstrings, several attributes one field, and results have their type."""
    section = ""
    result = getattr(getattr(made, "fget", made), "__annotations__", {}).get("return")
    if result and "Returns" in lines:
        first = lines.index("Returns") + 2
        rest = lines[first:]
        ends = [i - 1 for i, line in enumerate(rest) if re.fullmatch("-{3,}", line)]
        text = rest[: ends[0] if ends else len(rest)]
        if not any(line.startswith(" ") for line in text):  # prose alone
            name = result.__name__ if isinstance(result, type) else str(result)
            lines[first : first + len(text)] = [name, *(f"    {x}".rstrip() for x in text)]
    for i, line in enumerate(lines):
        if lines[i + 1 : i + 2] and re.fullmatch("-{3,}", lines[i + 1]):
            section = line
        if section == "Attributes" and re.fullmatch(r"\w+(, \w+)+", line):
            lines[i] = line = line.replace(", ", ",")
        pieces = re.split(r"(``?[^`]*``?)", line)
        lines[i] = "".join(p if p.startswith("`") else p.replace("|", r"\|") for p in pieces)


def _section(lines: list[str], title: str) -> tuple[int, int]:
    """Return where the rows of a section begin and end; nowhere where there is none."""
    if title not in lines:
        return 0, 0
    first = lines.index(title) + 2
    heads = [i - 1 for i, x in enumerate(lines) if i > first and re.fullmatch("-{3,}", x)]
    return first, (heads or [len(lines)])[0]


def _type_of(made: type, name: str) -> str:
    """Return the type of an attribute of a class, or nothing."""
    for base in made.__mro__:
        found = inspect.get_annotations(base).get(name)
        if found is None:
            getter = getattr(vars(base).get(name), "fget", None)
            found = getattr(getter, "__annotations__", {}).get("return")
        if found is not None:
            try:
                only = SimpleNamespace(__annotations__={name: found})
                found = get_type_hints(only, vars(sys.modules[base.__module__]))[name]
            except (NameError, TypeError):  # imported for type checkers alone, or of the class
                return str(found)
            return stringify_annotation(found, "smart")
    return ""


def _argument_type(made: type, name: str) -> str:
    """Return the type of an argument of a constructor, or nothing.

    Sphinx would take that of the attribute of the same name, which may be narrower.
    """
    try:
        found = get_type_hints(made.__init__).get(name)  # type: ignore[misc]
    except NameError:  # imported for type checkers alone
        return ""
    return stringify_annotation(found, "smart") if found is not None else ""


def _types(_: Any, what: str, __: str, made: Any, ___: Any, lines: list[str]) -> None:
    """Let arguments and attributes say their types; add the attributes that a class inherits."""
    if what != "class":
        return
    _say(lines, "Parameters", partial(_argument_type, made))
    if "Attributes" not in lines:
        return
    for base in made.__mro__[1:]:
        known = {name for row in lines if row[:1].strip() for name in re.split(", ?", row)}
        inherited = inspect.cleandoc(base.__doc__ or "").splitlines()
        kept, more = False, []
        for row in inherited[slice(*_section(inherited, "Attributes"))]:
            kept = known.isdisjoint(re.split(", ?", row)) if row[:1].strip() else kept
            more += [row] if kept else []
        if base.__module__.split(".")[0] in ("contact", "forms"):
            end = _section(lines, "Attributes")[1]
            lines[end:end] = [x.replace(", ", ",") if x[:1].strip() else x for x in [*more, ""]]
    _say(lines, "Attributes", partial(_type_of, made))


def _say(lines: list[str], section: str, type_of: Callable[[str], str]) -> None:
    """Put types behind the names of a section; names of unlike types get rows of their own."""
    first, end = _section(lines, section)
    rows: list[list[str]] = []
    for line in lines[first:end]:
        if line[:1].strip() or not rows:
            rows.append([line])
        else:
            rows[-1].append(line)
    made: list[str] = []
    for head, *text in rows:
        names = re.split(", ?", head) if re.fullmatch(r"\w+(, ?\w+)*", head) else []
        types = [type_of(name) for name in names]
        if all(types) and len(set(types)) > 1:
            made += [x for n, t in zip(names, types, strict=True) for x in (f"{n} : {t}", *text)]
        else:
            made += [f"{head} : {types[0]}" if names and all(types) else head, *text]
    lines[first:end] = made


def _present(app: Any, name: str, source: list[str]) -> None:
    """Leave notebooks that have not been run out of the examples."""
    if name == "examples":
        lines = source[0].splitlines()
        pages = re.compile(r"[a-z_/0-9-]+")
        kept = (x for x in lines if not pages.fullmatch(x) or x in app.env.found_docs)
        source[0] = "\n".join(kept)


def _mathjax(app: Any) -> None:
    """Put what the pages need of MathJax beside them."""
    needed = ("MathJax.js", "extensions", "jax/element", "jax/input/TeX")
    for part in (*needed, *(f"jax/output/SVG/{x}" for x in ("*.js", "autoload", "fonts/TeX"))):
        for source in MATHJAX.glob(part):
            target = Path(app.outdir, "_static", "mathjax", source.relative_to(MATHJAX))
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.is_dir():
                shutil.copytree(source, target, dirs_exist_ok=True)
            else:
                shutil.copy(source, target)


def setup(app: Any) -> None:
    """Connect what docstrings need, before napoleon reads them, the index, and MathJax."""
    app.connect("autodoc-process-docstring", _bars, priority=400)
    app.connect("autodoc-process-docstring", _types, priority=410)
    app.connect("source-read", _present)
    app.connect("builder-inited", _mathjax)
