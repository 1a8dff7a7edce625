"""``contact identify``: parameters of a case from measured columns of ``steps.csv``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from mpi4py import MPI

from contact.arguments import expect
from contact.case.file import load_case
from contact.cli.main import CONVERGED
from contact.cli.progress import progress
from contact.derivatives.identification import TIME, Identified, identify
from contact.errors import InputError
from contact.model.data import read_data
from contact.plot.figures import FORMATS
from contact.plot.style import BLUE, GREY, ORANGE, STYLE, sheet
from contact.ranks import on_root
from contact.typing import Array


def run(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Identify the parameters and print them. Collective."""
    case = on_root(comm, lambda: load_case(options.case, options.set))
    data = on_root(comm, lambda: read_data(options.data))
    keys = [key.strip() for key in (options.keys or "").split(",") if key.strip()]
    if not keys:
        raise InputError(
            "--for: missing; accepted: keys of the case, --for friction.mu,...", "missing"
        )
    picture = None if options.plot is None else Path(options.plot)
    on_root(comm, lambda: _check_free(picture))
    bounds = dict(_bound(text) for text in options.bound)
    for key in bounds.keys() - set(keys):
        raise InputError(f"--bound {key}: no parameter; accepted: {', '.join(keys)}", "bound")
    with progress(comm, options.quiet, over="contact.identify") as monitor:
        found = identify(case, data, keys, bounds, monitor=monitor, comm=comm)
    if comm.rank == 0:
        print("\n".join(report(found)))
    if picture is not None:
        on_root(comm, lambda: draw(found, data, picture))
    return CONVERGED


def _check_free(path: Path | None) -> None:
    """Refuse a figure that would replace a file, or that nothing could draw."""
    if path is not None:
        if path.exists():
            raise InputError(f"--plot {path}: it exists; accepted: a new file", "plot-file")
        accepted = f"a new file, {', '.join(f'.{ending}' for ending in FORMATS)}, in a folder"
        fits = path.suffix[1:] in FORMATS and path.parent.is_dir()
        expect("--plot", str(path), accepted, fits, "plot-file")


def _bound(text: str) -> tuple[str, tuple[float, float]]:
    """Read ``KEY=LEAST:LARGEST``."""
    key, _, ends = text.partition("=")
    try:
        least, largest = (float(end) for end in ends.split(":"))
    except ValueError:
        least = largest = np.nan
    if not least < largest:
        raise InputError(f"--bound {text}: accepted: KEY=LEAST:LARGEST, friction.mu=0:1", "bound")
    return key.strip(), (least, largest)


def report(found: Identified) -> list[str]:
    """Return the parameters, their intervals and their correlation in lines."""
    width = max(len(key) for key in found.parameters)
    lines = [f"{'parameter':{width}}  {'value':>12}  {found.level:.0%} interval"]
    for key, value in found.parameters.items():
        least, largest = found.intervals[key]
        words = f"{least:.6g} to {largest:.6g}"
        if key in found.undetermined:
            words = "none: the measurements do not determine it near this value"
        at = ", at its bound" if key in found.at_bound else ""
        lines.append(f"{key:{width}}  {value:12.6g}  {words}{at}")
    lines += [
        f"correlation of {one} and {other}: {found.correlation[i, j]:.3f}"
        for i, one in enumerate(found.parameters)
        for j, other in enumerate(found.parameters)
        if i < j and not {one, other} & {*found.undetermined}
    ]
    return [*lines, f"misfit {found.misfit:.3g} of the largest values; {found.evaluations} runs"]


def draw(found: Identified, data: dict[str, Array], path: Path) -> None:
    """Draw measurements, fit and residuals into a file."""
    names: Sequence[str] = [name for name in data if name != TIME]
    with matplotlib.rc_context(STYLE):
        figure = sheet(0.35 * len(names) + 0.15)
        for row, name in enumerate(names):
            both = figure.add_subplot(len(names), 2, 2 * row + 1)
            both.plot(data[TIME], data[name], ".", color=GREY, ms=3, label="measured")
            both.plot(data[TIME], found.fits[0][name], color=BLUE, label="identified")
            both.set(xlabel=TIME, ylabel=name.replace("_", " "))
            both.legend()
            left = figure.add_subplot(len(names), 2, 2 * row + 2)
            left.axhline(0, color=GREY, lw=0.6)
            left.plot(data[TIME], data[name] - found.fits[0][name], ".", color=ORANGE, ms=3)
            left.set(xlabel=TIME, ylabel="residual")
        figure.savefig(path)
