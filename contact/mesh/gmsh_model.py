"""Models and .msh files of Gmsh as contents of a mesh file, by their physical groups."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from contact.errors import InputError
from contact.mesh.contents import Contents, Ints


@contextmanager
def session() -> Iterator[Any]:
    """Provide a new model of Gmsh, leaving a running Gmsh as it was."""
    try:
        import gmsh
    except (ImportError, OSError) as error:  # OSError: one of its shared libraries is missing.
        raise InputError(f"the Python module gmsh is needed ({error})", "gmsh") from error
    started = not gmsh.isInitialized()
    if started:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
    # Gmsh's errors are exceptions, too: no need to print them.
    terminal = gmsh.option.getNumber("General.Terminal")
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("contact")
    try:
        yield gmsh
    except Exception as error:
        # The class of Gmsh's errors; others are faults of the program.
        if type(error) is not Exception:
            raise
        raise InputError(f"Gmsh says: {error}", "mesh-file") from error
    finally:
        gmsh.model.remove()
        gmsh.option.setNumber("General.Terminal", terminal)
        if started:
            gmsh.finalize()


def read_msh(file: Path) -> Contents:
    """Read a .msh file; execute nothing in it or beside it.

    Gmsh executes files of another beginning as scripts, unpacks those of some endings by other
    programs, and reads options from a file beside: the file is checked, and read by another name.

    Raises
    ------
    InputError
        If it begins otherwise, is cut off, or Gmsh refuses it.
    """
    with file.open("rb") as stream:
        start = re.match(rb"\$MeshFormat[ \t]*\r?\n\s*([24])[. \t]", stream.read(100))
        stream.seek(max(0, file.stat().st_size - 100))
        end = stream.read()
    if start is None:
        raise InputError("this is no Gmsh .msh file; accepted: formats 2.2 and 4.1", "mesh-file")
    if re.search(rb"\$End\w+\s*$", end) is None:  # Gmsh takes half a section for a whole one
        raise InputError("it is cut off: it does not end as a section does", "mesh-file")
    with session() as gmsh, tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "mesh.msh"
        plain.symlink_to(file.resolve())
        # Format 2 names the group of each element, but Gmsh keeps one set of groups an entity. With
        # the two tags of an element switched, the entities are the groups.
        switch = start[1] == b"2"
        gmsh.option.setNumber("Mesh.SwitchElementTags", switch)
        try:
            gmsh.merge(str(plain))
        finally:
            gmsh.option.setNumber("Mesh.SwitchElementTags", 0)
        return model_contents(gmsh.model, entities_are_groups=switch)


def model_contents(model: Any, entities_are_groups: bool = False) -> Contents:
    """Return nodes, elements and groups, physical ones or entities, of ``gmsh.model``.

    A group without a name goes by its number.
    """
    tags, points, _ = model.mesh.getNodes()
    order = np.argsort(tags)
    tags = tags[order].astype(np.int64)
    if np.any(tags[1:] == tags[:-1]):
        raise InputError("it has several nodes of one number", "mesh-file")
    blocks: list[tuple[str, Ints]] = []
    at: dict[tuple[int, int], range] = {}
    for dim, entity in model.getEntities():
        first = len(blocks)
        for kind, _, nodes in zip(*model.mesh.getElements(dim, entity), strict=True):
            name, _, _, count, *_ = model.mesh.getElementProperties(kind)
            nodes = nodes.astype(np.int64).reshape(-1, count)
            rows = np.minimum(np.searchsorted(tags, nodes), max(tags.size - 1, 0))
            if tags.size == 0 or np.any(tags[rows] != nodes):
                raise InputError("it has elements whose nodes it does not have", "mesh-file")
            blocks.append((name.split()[0].lower(), rows))
        at[dim, entity] = range(first, len(blocks))
    made = Contents(points.reshape(-1, 3)[order], blocks, repeats=True, by_groups=True)
    groups = [pair for pair in at if pair[1]] if entities_are_groups else model.getPhysicalGroups()
    for dim, tag in groups:
        entities = [tag] if entities_are_groups else model.getEntitiesForPhysicalGroup(dim, tag)
        group = made.groups.setdefault(model.getPhysicalName(dim, tag) or str(tag), {})
        for entity in entities:
            group |= {b: np.arange(len(blocks[b][1])) for b in at[dim, entity]}
    return made
