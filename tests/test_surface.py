"""The names that the package offers: documented, importable, of one version."""

import pydoc
import re
import tomllib
from pathlib import Path

import pytest

import contact

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("name", contact.__all__)
def test_each_name_is_there_and_documented(name: str) -> None:
    found = getattr(contact, name)
    assert name in dir(contact)
    assert isinstance(found, str) or found.__doc__


def test_help_lists_them_all() -> None:
    text = pydoc.plain(pydoc.render_doc(contact))
    head = contact.__doc__
    for name in contact.__all__:
        assert name.strip("_") in text.lower() or name in text
        if name not in ("__version__", "GapFunction", "solve"):
            assert re.search(rf"\b{name}\b", head), name


def test_one_version() -> None:
    given = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert given["project"]["dynamic"] == ["version"]
    assert given["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "contact.__version__"}
    cited = re.search(r"^version: *\"?([\d.]+)", (ROOT / "CITATION.cff").read_text(), re.M)
    assert cited is None or cited[1] == contact.__version__


def test_unknown_name() -> None:
    with pytest.raises(AttributeError, match="no attribute 'solv'"):
        contact.solv  # noqa: B018
