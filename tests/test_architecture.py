"""Who imports whom: the packages of the solver know those above them in the list alone."""

import ast
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

#: A package or module of contact/ imports its own line and those above it.
LAYERS = (
    {
        "errors",
        "typing",
        "tolerances",
        "settings",
        "_compat",
        "arguments",
        "ranks",
        "history",
    },
    {"mesh", "library"},
    {"linear"},
    {"model"},
    {"body"},
    {"interface"},
    {"problem"},
    {"methods", "thesis"},
    {"results"},
    {"case"},
    {"io"},
    {"plot"},
    {"refining", "solution", "solving", "sweeping", "writing", "derivatives"},
    {"cli"},
)

#: Longest file of contact/, in lines.
LONGEST = 700

#: What breaks the rules as yet: (importing, imported), modules in a cycle, files. What is mended
#: has to leave its list; nothing may join one.
DOWNWARDS: set[tuple[str, str]] = set()
CYCLIC: set[str] = set()
LONG: set[str] = set()


def modules(package: str) -> dict[str, Path]:
    """Return the modules of a package by their full names."""
    found = {}
    for path in sorted((ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports(path: Path) -> set[str]:
    """Return the modules and names that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
    return found


CONTACT = modules("contact")


def graph() -> dict[str, set[str]]:
    """Return the modules of contact/ that each of them imports.

    Left out is the folder's own `__init__`, whose names are looked up on first use.
    """
    edges = {}
    for name, path in CONTACT.items():
        whole = {i if i in CONTACT else i.rpartition(".")[0] for i in imports(path)}
        edges[name] = (whole & CONTACT.keys()) - {name, "contact"}
    del edges["contact"]
    return edges


def layer(module: str) -> int:
    """Return the line of the list that a module stands on."""
    head = module.split(".")[1]
    name = "cli" if head == "__main__" else head
    (line,) = (i for i, names in enumerate(LAYERS) if name in names)
    return line


def agrees(found: set, known: set) -> None:
    """Check what breaks a rule against the list of what is known to."""
    assert not found - known, "new, and against the rule"
    assert not known - found, "mended: take it off the list"


@pytest.mark.core
def test_imports_go_up():
    edges = graph()
    agrees({(a, b) for a in edges for b in edges[a] if layer(b) > layer(a)}, DOWNWARDS)


@pytest.mark.core
def test_no_module_imports_itself_through_others():
    edges = graph()

    def reached(start: str) -> set[str]:
        seen, front = set(), set(edges[start])
        while front:
            seen |= front
            front = set().union(*(edges[name] for name in front)) - seen
        return seen

    agrees({name for name in edges if name in reached(name)}, CYCLIC)


@pytest.mark.core
def test_no_python_objects_are_sent_by_the_communicator_of_a_mesh():
    """With mpi4py from 4.0 on a program may not end then, see `contact._compat.lasting`."""
    sent = re.compile(r"mesh\.comm\.(all)?(reduce|gather|bcast|scatter|toall|send|recv)\b")
    assert [name for name, path in CONTACT.items() if sent.search(path.read_text())] == []


@pytest.mark.core
def test_files_are_short():
    lengths = {name: len(path.read_text().splitlines()) for name, path in CONTACT.items()}
    agrees({name for name, length in lengths.items() if length > LONGEST}, LONG)


@pytest.mark.core
@pytest.mark.parametrize("name", modules("forms"))
def test_forms_need_no_mesh_and_no_solver(name):
    allowed = {"forms", "ufl", "numpy", "scipy", *sys.stdlib_module_names}
    assert {used.split(".")[0] for used in imports(modules("forms")[name])} <= allowed


@pytest.mark.core
@pytest.mark.parametrize("name", modules("meshes"))
def test_generators_need_the_solver_for_its_errors_alone(name):
    used = {i for i in imports(modules("meshes")[name]) if i.split(".")[0] in ("contact", "forms")}
    assert used <= {"contact.errors.InputError"}
