"""Sphinx: `make docs`, or ``python3 -m sphinx -W docs build/docs`` from the top folder."""

import re
import shutil
from pathlib import Path
from typing import Any

import contact

project = "contact-fenicsx"
version = release = contact.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["results/**"]
html_theme = "alabaster"
html_theme_options = {
    "description": "Frictional contact in FEniCSx",
    "page_width": "min(1240px, 96%)",  # narrow windows cut nothing off
    "sidebar_width": "250px",
    "body_max_width": "none",  # lines of code have 100 characters
    "code_font_size": "0.8em",
    "fixed_sidebar": True,
}
html_static_path = ["_static"]  # custom.css, which the theme looks for
html_show_copyright = False
autodoc_typehints = "none"
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


def _bars(_: Any, __: str, ___: str, ____: Any, _____: Any, lines: list[str]) -> None:
    """Let |x| be what it says in docstrings, and no substitution; several attributes one field."""
    section = ""
    for i, line in enumerate(lines):
        if lines[i + 1 : i + 2] and re.fullmatch("-{3,}", lines[i + 1]):
            section = line
        if section == "Attributes" and re.fullmatch(r"\w+(, \w+)+", line):
            lines[i] = line = line.replace(", ", ",")
        pieces = re.split(r"(``?[^`]*``?)", line)
        lines[i] = "".join(p if p.startswith("`") else p.replace("|", r"\|") for p in pieces)


def _present(app: Any, name: str, source: list[str]) -> None:
    """Leave out of the index what is not there: notebooks that have not been run."""
    if name == "index":
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
    app.connect("source-read", _present)
    app.connect("builder-inited", _mathjax)
