"""A second opinion on the files of a run: P1 in plane strain, assembled with numpy alone.

Nothing of the package is used: meshes are arrays, Gmsh's format 2.2 is written by hand, forces come
from `fields.vtu`, and the laws are looked at in `contact.csv`. Of bodies whose mesh is degree 1.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pyvista
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]
Tables = Mapping[str, Any]


@dataclass(frozen=True)
class Mesh:
    """Bodies of triangles that share no nodes."""

    #: Shapes (n, 2) and (m, 3).
    points: Array
    triangles: NDArray[np.intp]
    #: Number of the body of each triangle, shape (m,); `names` has its name.
    region: NDArray[np.intp]
    names: Sequence[str]
    #: Edges of each named part of the boundary, shape (k, 2).
    parts: Mapping[str, NDArray[np.intp]]

    def nodes(self, parts: str | Sequence[str]) -> NDArray[np.intp]:
        """Return the nodes of a part, or of several."""
        names = [parts] if isinstance(parts, str) else parts
        return np.unique(np.concatenate([self.parts[name].ravel() for name in names]))

    @property
    def body(self) -> NDArray[np.intp]:
        """Number of the body of each node."""
        found = np.zeros(len(self.points), dtype=np.intp)
        found[self.triangles] = self.region[:, None]
        return found


def write_msh(mesh: Mesh, path: Path) -> None:
    """Write a file of Gmsh's format 2.2."""
    groups = [(1, name, edges) for name, edges in mesh.parts.items()]
    groups += [(2, name, mesh.triangles[mesh.region == k]) for k, name in enumerate(mesh.names)]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(groups))]
    lines += [f'{dim} {tag} "{name}"' for tag, (dim, name, _) in enumerate(groups, 1)]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(mesh.points))]
    lines += [f"{k} {x!r} {y!r} 0" for k, (x, y) in enumerate(mesh.points.tolist(), 1)]
    lines += ["$EndNodes", "$Elements", str(sum(len(cells) for _, _, cells in groups))]
    every = (
        (tag, dim, cell) for tag, (dim, _, cells) in enumerate(groups, 1) for cell in cells + 1
    )
    for number, (tag, dim, cell) in enumerate(every, 1):
        lines.append(f"{number} {dim} 2 {tag} {tag} {' '.join(map(str, cell.tolist()))}")
    path.write_text("\n".join([*lines, "$EndElements", ""]))


def gradients(mesh: Mesh) -> tuple[Array, Array]:
    """Return the gradients of the barycentric coordinates, shape (m, 3, 2), and the areas."""
    edges = mesh.points[np.roll(mesh.triangles, 1, 1)] - mesh.points[np.roll(mesh.triangles, -1, 1)]
    twice = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    # Edges turned by 90 degrees over twice the area.
    slopes = np.stack([-edges[..., 1], edges[..., 0]], axis=2) / twice[:, None, None]
    return slopes, np.abs(twice) / 2


def internal_forces(mesh: Mesh, materials: Sequence[Tables], u: Array) -> Array:
    """Return the nodal forces of Hencky's materials in plane strain, shape (n, 2)."""
    slopes, areas = gradients(mesh)
    gradient = np.einsum("mai,maj->mij", u[mesh.triangles], slopes)
    strain = (gradient + gradient.transpose(0, 2, 1)) / 2
    trace = np.trace(strain, axis1=1, axis2=2)
    deviator = np.sqrt(np.einsum("mij,mij->m", strain, strain) - trace**2 / 3)
    bulk, shear = np.zeros(len(trace)), np.zeros(len(trace))
    for material in materials:
        there = np.isin(mesh.region, [mesh.names.index(name) for name in _listed(material["on"])])
        young, poisson = material["young"], material["poisson"]
        bulk[there] = young / (3 - 6 * poisson)
        shear[there] = young / (2 + 2 * poisson)
        if material.get("law") == "log":
            ratio = np.maximum(deviator[there] / material["yield_strain"], 1.0)
            shear[there] *= (np.log(ratio) + 1) / ratio
    stress = 2 * shear[:, None, None] * strain
    stress += ((bulk - 2 * shear / 3) * trace)[:, None, None] * np.eye(2)
    forces = np.zeros_like(mesh.points)
    nodal = areas[:, None, None] * np.einsum("mij,maj->mai", stress, slopes)
    np.add.at(forces, mesh.triangles, nodal)
    return forces


def external_forces(mesh: Mesh, tables: Tables) -> Array:
    """Return the nodal forces of constant tractions and body forces."""
    forces = np.zeros_like(mesh.points)
    for load in tables.get("load", ()):
        if load.get("everywhere"):
            share = gradients(mesh)[1][:, None, None] / 3 * np.asarray(load["body_force"])
            np.add.at(forces, mesh.triangles, np.broadcast_to(share, (len(share), 3, 2)))
        else:
            edges = mesh.parts[load["on"]]
            length = np.linalg.norm(np.diff(mesh.points[edges], axis=1), axis=2)
            share = length[:, :, None] / 2 * np.asarray(load["traction"])
            np.add.at(forces, edges, np.broadcast_to(share, (len(edges), 2, 2)))
    return forces


def _listed(value: Any) -> Sequence[Any]:
    return value if isinstance(value, list | tuple) else [value]


def _rows(path: Path) -> Any:
    """Return a table; its columns by their names."""
    found = np.genfromtxt(path, delimiter=",", names=True, dtype=None, encoding="utf-8")
    return np.atleast_1d(found)


def _columns(rows: Any, *names: str) -> Array:
    """Return columns side by side, shape (rows, names)."""
    return np.stack([np.asarray(rows[name], dtype=float) for name in names], axis=1)


def _displacement(mesh: Mesh, path: Path) -> Array:
    """Return the displacement at the nodes of a mesh: cells are known by their middles."""
    grid = pyvista.read(path)
    cells = grid.cells.reshape(-1, 4)[:, 1:]
    points, u = grid.points[:, :2], np.asarray(grid.point_data["displacement"])[:, :2]
    middles = mesh.points[mesh.triangles].mean(axis=1)
    distance, order = cKDTree(points[cells].mean(axis=1)).query(middles)
    theirs, own = cells[order], mesh.points[mesh.triangles]
    apart = np.linalg.norm(points[theirs][:, None] - own[:, :, None], axis=3)
    corner = np.argmin(apart, axis=2)
    if max(distance.max(), apart.min(axis=2).max()) > 1e-9 * np.ptp(mesh.points):
        raise ValueError(f"{path} has other cells")
    found = np.zeros_like(mesh.points)
    found[mesh.triangles] = u[np.take_along_axis(theirs, corner, axis=1)]
    return found


def _steps(folder: Path) -> list[tuple[float, Path]]:
    """Return times and files of the fields of an evolution; one without time if it is static."""
    if not (folder / "fields.pvd").exists():
        return [(1.0, folder / "fields.vtu")]
    found = ElementTree.parse(folder / "fields.pvd").iter("DataSet")
    return [(float(entry.get("timestep")), folder / entry.get("file")) for entry in found]


def recheck(mesh: Mesh, tables: Tables, folder: Path) -> dict[str, float]:
    """Return by how much the files of a run miss equilibrium and the laws of contact.

    Each is relative: forces to the largest nodal one that acts on the same body, stresses to the
    largest pressure. `penetration` and `slip` are displacements times E over the size of the mesh.
    """
    steps = _steps(folder)
    last = _rows(folder / "contact.csv")
    table = _rows(folder / "contact-steps.csv") if len(steps) > 1 else None
    worst: dict[str, float] = {}
    before = np.zeros(len(last))
    moved = max(float(np.abs(_displacement(mesh, path)).max()) for _, path in steps)
    young = max(material["young"] for material in tables["material"])
    # Displacements are known to their rounding, and forces to that of stresses: 1e-13 E |u|.
    least = max(1e-7 * young * moved, 1e-300)
    for time, path in steps:
        rows = last if table is None else table[table["t"] == time]
        found = _laws(tables, rows, before, float(np.ptp(mesh.points)), least)
        before = rows["u_t"]
        if path == steps[-1][1] or not any("against" in entry for entry in tables["contact"]):
            found |= _balance(mesh, tables, folder, rows, path, least)
        worst = {name: max(value, worst.get(name, 0.0)) for name, value in found.items()}
    return worst


def _laws(tables: Tables, rows: Any, before: Array, size: float, least: float) -> dict[str, float]:
    """Return the errors of Signorini's and Coulomb's laws."""
    names = "pressure", "tau", "bound", "gap", "u_n", "u_t"
    pressure, tau, bound, gap, u_n, u_t = _columns(rows, *names).T
    entries = {_listed(entry["on"])[0]: entry for entry in tables["contact"]}
    first = [next(iter(entries))] * len(rows)  # the only one, where there is no column
    entry = [entries[on] for on in (rows["on"] if "on" in rows.dtype.names else first)]
    mu = np.array([float(one.get("friction", {}).get("mu", 0.0)) for one in entry])
    names = "layer", "stiffness", "limit"
    deep, stiffness, limit = np.array([[one.get(name, 0.0) for name in names] for one in entry]).T
    layer = stiffness * np.clip(np.minimum(u_n, gap) - gap + deep, 0.0, limit)
    young = min(material["young"] for material in tables["material"])
    c, scale = young / size, max(pressure.max(), least / size)
    rigid = pressure - layer
    slip = u_t - before
    slides = np.abs(tau) >= mu * pressure - 1e-6 * scale
    # A node that slides does so along its friction stress; any other does not slide.
    back = np.where(slides, np.minimum(slip * np.sign(tau), 0.0) * (mu * pressure > 0), slip)
    back = np.where(pressure > 1e-6 * scale, back, 0.0)
    wrong = (rows["status"] == "open") & (pressure > 1e-6 * scale) & (layer == 0)
    over = max(np.max(np.abs(tau) - mu * pressure), np.max(np.abs(bound - mu * pressure)), 0.0)
    return {
        "tension": -min(rigid.min(), 0.0) / scale,
        "penetration": c * max((u_n - gap).max(), 0.0) / scale,
        "apart": np.max(np.minimum(np.abs(rigid), c * np.abs(gap - u_n))) / scale,
        "bound": over / scale,
        "slip": c * np.abs(back).max() / scale,
        "status": float(wrong.any()),
    }


def _balance(
    mesh: Mesh, tables: Tables, folder: Path, rows: Any, path: Path, least: float
) -> dict[str, float]:
    """Return the errors of nodal forces, of action and reaction, and of the reactions."""
    internal = internal_forces(mesh, tables["material"], _displacement(mesh, path))
    residual = internal - external_forces(mesh, tables)
    summary = json.loads((folder / "summary.json").read_text())
    surface = pyvista.read(folder / "contact.vtu")
    action, worst_turn = np.zeros_like(residual), 0.0
    weight, pressure, tau = _columns(rows, "weight", "pressure", "tau").T
    places = _columns(rows, "x", "y")
    row = np.asarray(surface.point_data["row"])
    normals = np.zeros((len(rows), 2))
    normals[row[row >= 0]] = np.asarray(surface.point_data["normal"])[row >= 0][:, :2]
    along = np.stack([-normals[:, 1], normals[:, 0]], axis=1)
    vectors = weight[:, None] * (pressure[:, None] * normals + tau[:, None] * along)
    on = rows["on"] if "on" in rows.dtype.names else np.full(len(rows), "")
    passed, shared = np.zeros(2), list[tuple[int, int, Array]]()
    for entry in tables["contact"]:
        names = _listed(entry["on"])
        mine = np.flatnonzero(np.isin(on, ["", *names]))
        nodes, edges = mesh.nodes(names), np.concatenate([mesh.parts[name] for name in names])
        distance, order = cKDTree(mesh.points[nodes]).query(places[mine])
        assert distance.max(initial=0.0) < 1e-9 * np.ptp(mesh.points)
        np.add.at(action, nodes[order], vectors[mine])
        shared += _shared(edges, nodes[order], vectors[mine])
        if "against" in entry:
            passed += vectors[mine].sum(axis=0)
        turn = 1 - np.einsum("ni,ni->n", normals[mine], _normals(mesh, edges)[nodes[order]])
        pressed = pressure[mine] > 1e-6 * pressure.max()
        if "against" in entry:  # in front of a shape its normal is the one
            worst_turn = max(worst_turn, turn[pressed].max(initial=0.0))
    against = folder / "contact-against.csv"
    answered = np.zeros(2)
    if against.exists():
        for row in _rows(against):
            nodes = mesh.nodes(str(row["on"]))
            far = mesh.points[nodes] - [row["x"], row["y"]]
            node = nodes[np.argmin(np.linalg.norm(far, axis=1))]
            force = row["weight"] * np.array([row["traction_x"], row["traction_y"]])
            answered += force
            action[node] -= force
    residual += action
    fixed = np.zeros(residual.shape, dtype=bool)
    for support in tables["fixed"]:
        constrained = [component != "free" for component in support["displacement"]]
        fixed[mesh.nodes(support["on"])] |= constrained
    for node, neighbour, force in shared:
        size = float(force @ force)
        part = float(np.clip(residual[node] @ force / size, 0, 1)) if size > 0 else 0.0
        for place, sign in ((node, -part), (neighbour, part)):
            residual[place] += sign * force
            action[place] += sign * force
    reactions = np.where(fixed, residual, 0.0)
    left = np.where(fixed, 0.0, residual)
    body, sizes = mesh.body, np.zeros(len(mesh.names))
    acting = np.stack([action, reactions, external_forces(mesh, tables)])
    np.maximum.at(sizes, body, np.abs(acting).max(axis=(0, 2)))
    sizes = np.maximum(sizes, least)
    given = np.sum([*map(np.array, summary["reactions"].values())], axis=0)
    last = path == _steps(folder)[-1][1]  # whose reactions these are
    size = max(np.abs(acting).max(), least)
    return {
        "equilibrium": float((np.abs(left).max(axis=1) / sizes[body]).max()),
        "action": float(np.abs(passed - answered).max() / size),
        "reactions": float(np.abs(given - reactions.sum(axis=0)).max() / size) if last else 0.0,
        "normal turned": float(worst_turn),
    }


def _shared(
    edges: NDArray[np.intp], nodes: NDArray[np.intp], forces: Array
) -> list[tuple[int, int, Array]]:
    """Return nodes whose forces act on a neighbour too, one that supports hold: it has no row."""
    found = []
    for one, other in [*edges.tolist(), *edges[:, ::-1].tolist()]:
        if one in nodes and other not in nodes:
            found.append((one, other, forces[np.flatnonzero(nodes == one)[0]]))
    return found


def _normals(mesh: Mesh, edges: NDArray[np.intp]) -> Array:
    """Return unit normals at nodes, out of the body: means of those of given edges."""
    # The integral of a node's function's gradient is that of the normal times the function.
    slopes, areas = gradients(mesh)
    outward, total = np.zeros_like(mesh.points), np.zeros_like(mesh.points)
    np.add.at(outward, mesh.triangles, areas[:, None, None] * slopes)
    along = mesh.points[edges[:, 1]] - mesh.points[edges[:, 0]]
    out = np.stack([along[:, 1], -along[:, 0]], axis=1)
    out *= np.sign(np.einsum("ni,nki->n", out, outward[edges]))[:, None]
    np.add.at(total, edges, out[:, None, :].repeat(2, axis=1))
    return total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]
