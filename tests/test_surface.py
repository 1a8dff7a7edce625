"""The names that the package offers: documented, importable."""

import pydoc
import re

import pytest

import contact


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


def test_unknown_name() -> None:
    with pytest.raises(AttributeError, match="no attribute 'solv'"):
        contact.solv  # noqa: B018
