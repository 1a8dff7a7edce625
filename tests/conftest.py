"""What all tests share: figures without a display, temporary folders, and ranks in step."""

import importlib.metadata
import io
import os
import re
import sys
from collections.abc import Callable, Iterator
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import module_from_spec, spec_from_file_location
from itertools import groupby
from pathlib import Path
from typing import Any

import basix.ufl
import ffcx.codegeneration.jit
import pytest
import ufl
from hypothesis import HealthCheck, settings
from mpi4py import MPI

from tests.problems.bar import BAR

os.environ.setdefault("MPLBACKEND", "Agg")

# The C compiler takes most of a first run: less optimisation of forms is enough for small meshes.
os.environ["XDG_CONFIG_HOME"] = str(Path(__file__).parent / "settings")

# The same examples on every rank and in every run; forms compile at the first one, so no deadline.
_common = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("contact", derandomize=True, database=None, **_common)
settings.register_profile("explore", max_examples=1000, **_common)
settings.load_profile("contact")

# messages of the hooks below must not meet those of a test that failed half way
_comm = MPI.COMM_WORLD.Dup()

# FFCx lists its whole cache folder, of thousands of files, each time that it looks for a form:
# a compiled one is loaded by its path, and once a process.
_look_up, _known = ffcx.codegeneration.jit.get_cached_module, {}


def _look_up_once(name: str, objects: list[str], folder: str | Path, *rest: Any) -> tuple[Any, Any]:
    """Return a form's compiled objects and their module; two None where it is to be compiled."""
    key = (name, *objects)
    if key not in _known:
        found = _load(name, objects, Path(folder)) or _look_up(name, objects, folder, *rest)
        if found[1] is None:
            return found
        _known[key] = found
    return _known[key]


def _load(name: str, objects: list[str], folder: Path) -> tuple[Any, Any] | None:
    """Return the same from the cache folder; None where it has no finished one."""
    if not (folder / f"{name}.c.cached").exists():
        return None
    path = str(folder / f"{name}{EXTENSION_SUFFIXES[0]}")
    module = module_from_spec(spec := spec_from_file_location(name, path))
    spec.loader.exec_module(module)
    return [getattr(module.lib, one) for one in objects], module


ffcx.codegeneration.jit.get_cached_module = _look_up_once

# For each form that is compiled, setuptools reads the names of all installed packages several
# times, which takes as long as the compiler.
importlib.metadata.entry_points = cache(importlib.metadata.entry_points)

# UFL makes a cell with all of its faces and edges anew each time that an element is asked for it,
# a tenth of the time to set a problem up; cells do not change.
_cell = cache(ufl.Cell)
basix.ufl._ElementBase.cell = property(lambda element: _cell(element.cell_type.name))


@pytest.fixture(autouse=True)
def _small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let scripts write small pictures: to encode them takes longer than to solve and draw."""
    if "scripts.reporting" in sys.modules:
        monkeypatch.setattr("scripts.reporting.DPI", 60)


#: Parts of messages that memory, ranks and Python's parser of TOML decide.
OTHERS_WORDS = {
    r"[\d.e+]+ GB": "… GB",
    r"give at most [\d.e+]+": "give at most …",
    r"shape \(\d+, ": "shape (…, ",
    r" at \([-\d., e]+\)": " at (…)",
    r"0x[0-9a-f]+": "0x…",
    r"not a TOML file: .* ": "not a TOML file: … ",
    r"is broken \(.*\); ": "is broken (…); ",
}


@pytest.fixture
def snapshot(request: pytest.FixtureRequest) -> Callable[[str, dict[str, str]], None]:
    """Return the comparison of texts, by their names, with a file of tests/snapshots."""

    def compare(file: str, texts: dict[str, str]) -> None:
        path = Path(__file__).parent / "snapshots" / f"{file}.txt"
        text = "".join(f"{name}\n  {said}\n" for name, said in texts.items())
        for pattern, replaced in OTHERS_WORDS.items():
            text = re.sub(pattern, replaced, text)
        if request.config.getoption("--renew"):
            path.write_text(text, encoding="utf-8")
        assert text.splitlines() == path.read_text(encoding="utf-8").splitlines()

    return compare


@pytest.fixture
def bar(tmp_path: Path) -> Path:
    """Return the path of the bar's case file."""
    path = tmp_path / "bar.toml"
    path.write_text(BAR)
    return path


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let `make test` run short tests alone, and `make messages` write texts."""
    words = (
        "no slow tests; each value of each parameter, not all combinations; of a test one item on "
        "3 ranks, and on 2 where it is not core"
    )
    parser.addoption("--short", action="store_true", help=words)
    parser.addoption("--renew", action="store_true", help="write the files of tests/snapshots anew")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Let rank 0 alone report: failures are made common by `pytest_pyfunc_call`."""
    if _comm.rank > 0:
        sys.stdout = io.StringIO()


def pytest_report_header() -> str:
    """Say how large the solver is, to see it grow."""
    files = list((Path(__file__).parents[1] / "contact").rglob("*.py"))
    lines = sum(len(path.read_text().splitlines()) for path in files)
    return f"contact: {len(files)} files, {lines} lines"


#: Identifiers of `core` by tests that have no such parameters, as far as tests are collected.
_unknown: dict[str, set[str]] = {}


def pytest_itemcollected(item: pytest.Item) -> None:
    """Let `core` with identifiers of parameters stand for those alone."""
    mark = item.get_closest_marker("core")
    if mark is not None and mark.args:
        missing = _unknown.setdefault(item.nodeid.split("[")[0], set(mark.args))
        missing.discard(item.callspec.id)
        if item.callspec.id not in mark.args:
            item.own_markers.remove(mark)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out tests that are for another number of ranks, or compare one rank with itself.

    On several ranks, those stay that have each value of each parameter: all combinations run on
    one, or on 2 where a test is not for one. Which rank has nothing, or two neighbours, depends on
    no combination. With --short that holds on one as well; of a test one item stays on 3 ranks, and
    on 2 where it is not `core`.
    """
    unknown = {name: wrong for name, wrong in _unknown.items() if wrong}
    # Some parameters are for some numbers of ranks; a single item has no others beside it.
    if unknown and _comm.size == 1 and not any("[" in given for given in config.args):
        raise pytest.UsageError(f"core: parameters that no test has: {unknown}")
    kept, short = set(), config.getoption("--short")
    for _, group in groupby(items, key=lambda item: item.nodeid.split("[")[0]):
        some = [item for item in group if not (short and item.get_closest_marker("slow"))]
        if not some:
            continue
        mark = some[0].get_closest_marker("parallel")
        if mark is None or _comm.size in _sizes(mark):
            everything = _comm.size == (1 if mark is None or mark.kwargs.get("alone", True) else 2)
            some = some if everything and not short else _covering(some)
            core = _comm.size == 2 and some[0].get_closest_marker("core") is not None
            kept |= set(some if everything or core or not short else some[:1])
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    items[:] = [item for item in items if item in kept]


def _sizes(mark: pytest.Mark) -> set[int]:
    """Return the numbers of ranks that a test is for."""
    if _comm.size == 1:
        return {int(mark.kwargs.get("alone", True))}
    return set(mark.args or (_comm.size,))


def _covering(items: list[pytest.Item]) -> list[pytest.Item]:
    """Return the few of a test's items that have each value of each parameter."""
    values = [_values(item) for item in items]
    missing, kept = set().union(*values), []
    while missing:
        best = max(range(len(items)), key=lambda k: len(missing & values[k]))
        kept.append(items[best])
        missing -= values[best]
    return kept


def _values(item: pytest.Item) -> set[tuple[str, ...]]:
    """Return an item's row of each list of parameters, by names and identities of its values."""
    spec = getattr(item, "callspec", None)
    values = dict(spec.params if spec else {}) or {"": 0}
    found = set()
    for mark in item.iter_markers("parametrize"):
        given = mark.args[0]
        names = [name.strip() for name in given.split(",")] if isinstance(given, str) else given
        found.add(tuple(f"{name} {id(values.pop(name))}" for name in names))
    return found | {(f"{name} {id(value)}",) for name, value in values.items()}


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call() -> Iterator[None]:
    """Fail a test on all ranks if it fails on one, so that they stay in step."""
    if _comm.size == 1:
        return (yield)
    error: Exception | None = None
    result = None
    try:
        result = yield
    except Exception as caught:
        error = caught
    errors = _comm.allgather(None if error is None else f"{type(error).__name__}: {error}")
    if error is not None:
        raise error
    failed = [f"rank {rank}: {text}" for rank, text in enumerate(errors) if text is not None]
    if failed:
        pytest.fail("\n".join(failed), pytrace=False)
    return result


@pytest.fixture
def comm() -> MPI.Intracomm:
    """All ranks of the run."""
    return MPI.COMM_WORLD


@pytest.fixture
def shared_tmp_path(tmp_path: Path) -> Path:
    """Rank 0's temporary folder, the same on all ranks."""
    return _comm.bcast(tmp_path, root=0)
