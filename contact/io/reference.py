"""The keys and columns of the output files as pages and the command line's help show them."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

from contact.results.quantities import quantities
from contact.results.quantity import Quantity


def described(file: str) -> Iterator[tuple[str, Quantity, str]]:
    """Yield the name of a key, column or field, its quantity, and the description there."""
    for quantity in quantities(file):
        name, text = quantity.name, quantity.text
        if file.endswith(".csv") and quantity.component:
            name = quantity.component.format(name=name, axis="x")
        if file != quantity.files[0]:
            text = f"As in `{quantity.files[0]}`."
        if name != quantity.name:
            text += " Likewise the other components."
        yield name, quantity, text


def files_help(*names: str) -> str:
    """Return the keys or columns of some files, for the command line's help."""
    lines = []
    for file in names:
        lines += ["", f"{'columns' if file.endswith('.csv') else 'keys'} of {file}:"]
        for name, quantity, text in described(file):
            unit = f" ({quantity.unit})" if quantity.unit else ""
            text = f"{_first(text)}{unit}"
            lines += textwrap.wrap(f"  {name:<19} {text}", 98, subsequent_indent=22 * " ")
    return "\n".join([*lines, "", "signs, units, all files: docs/output.md"]).lstrip("\n")


def _first(text: str) -> str:
    """Return the first statement of a text, without Markdown."""
    for end in (". ", ": ", "; "):
        text = text.partition(end)[0]
    return text.rstrip(".").replace("`", "")
