"""``contact check CASE``: the resolved case, its mesh and unknowns, and all that acts."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact import _compat
from contact.body.elements import CHUNK, unlocked
from contact.body.global_unknowns import Member
from contact.case.build import build_problem
from contact.case.checks import growing
from contact.case.file import Case, load_case, to_toml
from contact.cli.main import CONVERGED
from contact.errors import counted
from contact.mesh.cells import Shape, rule, shape_of
from contact.mesh.domain import Domain, Indices
from contact.mesh.entities import cells_at
from contact.mesh.geometry import (
    determinant,
    geometry_nodes,
    integration_weights,
    jacobians,
    outward,
    volumes,
)
from contact.methods.options import NewtonOptions
from contact.model.body import Electrode
from contact.model.rigid import Rigid
from contact.problem.checks import expected_displacements, meeting_supports
from contact.problem.problem import ContactProblem
from contact.ranks import on_root
from contact.refining import coarser_cases
from contact.results.bodies import apart
from contact.results.discretisation import own_shape, without_heights
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array
from forms.elasticity import Anisotropic

#: Mean ratio below which a cell is called thin.
THIN = 0.1
#: Poisson's ratio from which on elements of degree 1 lock: the bulk modulus is 19.7 times mu.
INCOMPRESSIBLE = 0.475
#: Stiffness of a crystal's strain over that of another one, from which on check warns, too.
STIFFER = 100.0
#: Most steps of an evolution whose loads are looked at.
LOOKS = 20
#: Length of the mean of a part's normals from which on the part counts as flat, and below which
#: they cancel.
FLAT, CLOSED = 1 - 1e-6, 1e-6
#: Displacements above this share of the body are not small.
LARGE = 0.05
#: Loads over the contact part and Young's modulus from which on units are asked for: sharp
#: indenters come to a tenth.
SOFT = 0.25
#: Words for components that have no displacement given, or no force.
WORDS = {True: "free", False: "held"}


def run(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Validate a case, print it, and draw its set-up where that is asked for."""
    case = on_root(comm, lambda: load_case(options.case, options.set))
    if isinstance(case.solver, NewtonOptions) and case.solver.nested:
        coarser_cases(case, case.solver.nested_levels)
    problem = build_problem(case, comm)
    text = describe(case, problem)
    if comm.rank == 0:
        print(text)
    if options.plot:
        from contact.cli.setup import save_setup  # matplotlib takes a while to load

        for path in save_setup(case, problem, Path.cwd()):
            print(f"# set-up: {path.name}")
    return CONVERGED


def describe(case: Case, problem: ContactProblem) -> str:
    """Return the text. Collective; the same on all ranks."""
    domain, comm = problem.domain, problem.comm
    cells = domain.mesh.topology.index_map(domain.dim).size_global
    layout = problem.equilibrium.layout
    library, path = _compat.blas()
    lines = [
        to_toml(case, domain.dim),
        f"# mesh: {counted(cells, 'cell')} in {domain.dim}-D on {counted(comm.size, 'rank')}, "
        f"largest extent {domain.size:g}",
        *parts(domain),
        *regions(domain),
        *(f"# note: {note}" for note in (*domain.notes, *amplitude_notes(case))),
        f"# unknowns: {layout.unknowns} ({layout.block_size} a node), contact nodes: "
        f"{problem.nodes.size}",
        *expectations(problem, _times(case)),
        f"# blas: {library} {path}".rstrip(),
        "# versions: " + ", ".join(f"{k} {v}" for k, v in _compat.versions().items()),
    ]
    if library == _compat.REFERENCE:
        lines.append(f"# {_compat.ADVICE}")
    return "\n".join(lines)


def amplitude_notes(case: Case) -> list[str]:
    """Say which loads and values have no amplitude in an evolution, and which peaks are lost."""
    found = growing(case)
    if case.evolution is None:
        return []
    lost = case.evolution.lost_peaks
    if not found:
        return lost
    begin, end = case.evolution.times[:2]
    return [
        *lost,
        f"{', '.join(found)} without an amplitude: from 0 at t = {begin:g} to all at t = {end:g}, "
        'and then constant; amplitude = "constant": all the time',
    ]


def _times(case: Case) -> list[float]:
    """Return times at which loads are looked at: ends of stages and steps, of some of many."""
    if case.evolution is None:
        return [1.0]
    ends, stages = case.evolution.ends, case.evolution.times[1:]
    some = [times[:: 1 + len(times) // LOOKS] for times in (ends, stages)]
    return sorted({*some[0], *some[1], ends[-1]})


def expectations(problem: ContactProblem, times: Sequence[float] = (1.0,)) -> list[str]:
    """Return lines on the mesh, and on loads and prescribed values at some times. Collective."""
    warnings = [
        f"# warning: {text} [{identifier}]"
        for identifier, remarks in {
            "own-shape": own_shape(problem),
            "part-end": without_heights(problem),
            "meeting-supports": meeting_supports(problem, times),
            "two-bodies": apart(problem),
        }.items()
        for text in remarks
    ]
    return [*_quality(problem), *acting(problem, times), *_locking(problem), *warnings]


def _locking(problem: ContactProblem) -> list[str]:
    """Say which materials resist some strains so much that elements of degree 1 lock."""
    body = problem.equilibrium
    remedy = unlocked(body.element, body.degree, shape_of(body.domain.mesh))
    if remedy is None:
        return []
    # In plane stress volumes are free to change.
    laws = [m.law for m in problem.body.materials if not m.in_plane_stress]
    ratios = [float(law.poisson) for law in laws]
    crystals = [law.eigenvalues for law in laws if isinstance(law, Anisotropic)]
    stiffer = [values[-1] / values[0] for values in crystals]
    found = [
        *(f"Poisson's ratio {ratio:g}" for ratio in ratios if ratio >= INCOMPRESSIBLE),
        *(f"a strain {more:.3g} times as stiff as another" for more in stiffer if more >= STIFFER),
    ]
    return [
        f"# warning: {text}: elements of degree 1 can be much too stiff, they lock; {remedy} "
        "[locking]"
        for text in dict.fromkeys(found)
    ]


def quality(shape: Shape, corners: Array) -> Array:
    """Return the mean ratio of cells, the least at their corners: 1 if regular, 0 if flat.

    It is d det(A)^(2/d) / |A|^2, A the map from the regular cell of the shape (Knupp, SIAM J. Sci.
    Comput. 23, 2001).
    """
    d, jacobian = shape.dim, jacobians(shape, corners[:, : shape.corners], shape.nodes(1))
    if shape.simplex:  # its edges from one corner: W^T W = (1 + I) / 2
        regular = np.linalg.cholesky((1 + np.eye(d)) / 2).T
        jacobian = jacobian @ np.linalg.inv(regular)
    size = np.abs(determinant(jacobian)) ** (2 / d)
    return np.asarray((d * size / np.sum(jacobian**2, axis=(2, 3))).min(axis=1))


def _quality(problem: ContactProblem) -> list[str]:
    comm = problem.comm
    shape, nodes = shape_of(problem.domain.mesh), geometry_nodes(problem.domain)
    chunks = np.array_split(nodes, len(nodes) // CHUNK + 1)
    ratio = np.concatenate([quality(shape, some) for some in chunks])
    least = comm.allreduce(float(ratio.min(initial=1.0)), op=MPI.MIN)
    thin = comm.allreduce(int(np.count_nonzero(ratio < THIN)), op=MPI.SUM)
    lines = [f"# mesh quality: the worst cell has the mean ratio {least:.2g} (1: regular)"]
    if thin:
        lines.append(
            f"# warning: {thin} cells are thinner than {THIN:g}: stresses there are poor, and "
            "iterative solvers slow"
        )
    return lines


def parts(domain: Domain) -> list[str]:
    """Return a line for each part: its facets, area, centroid and mean normal. Collective."""
    rows, inside = [], []
    for name in sorted(domain.parts):
        count, area, centroid, mean = _sizes(domain, domain.parts[name])
        if not area > 0:  # facets on the axis of revolution
            rows.append([name, counted(count, "facet"), "on the axis", "", ""])
            continue
        length = float(np.linalg.norm(mean))
        across = f"normal {vector(mean)}"
        if length < CLOSED:
            across = "not plane, normals that cancel"
        elif length < FLAT:
            across = f"not plane, mean normal {vector(mean / length)}"
        rows.append([*_row(domain, name, count, area, centroid), across])
    for name in sorted(domain.inside):
        count, area, centroid, _ = _sizes(domain, domain.inside[name])
        inside.append(_row(domain, name, count, area, centroid))
    return [
        "# parts of its boundary:",
        *table(rows),
        *(["# parts inside of it:"] if inside else []),
        *table(inside),
    ]


def _row(domain: Domain, name: str, count: int, area: float, centroid: Array) -> list[str]:
    extent = "area" if domain.dim == 3 or domain.revolved else "length"
    place = f"centroid {vector(domain.resultant(centroid))}"
    return [name, counted(count, "facet"), f"{extent} {area:.6g}", place]


def _sizes(domain: Domain, facets: Indices) -> tuple[int, float, Array, Array]:
    """Return number, area, centroid and mean normal of facets, of the whole body. Collective."""
    cells, place = cells_at(domain.mesh, facets)
    shape, order, behind = shape_of(domain.mesh), domain.order, geometry_nodes(domain, cells)
    nodes = np.take_along_axis(behind, shape.facet_nodes(order)[place][:, :, None], axis=1)
    at, weights = rule(shape.facet, 4 * order)
    areas = integration_weights(domain.revolved, shape.facet, nodes, at, weights)
    points = np.einsum("qk,fkd->fqd", shape.facet.lagrange(order, at), nodes)
    normal = outward(shape.facet, nodes, behind.mean(axis=1), at)
    normal = normal / np.linalg.norm(normal, axis=2, keepdims=True)
    both = np.concatenate([points, np.broadcast_to(normal, points.shape)], axis=2)
    local = np.array([facets.size, areas.sum(), *np.einsum("fq,fqd->d", areas, both)])
    count, area, *sums = domain.comm.allreduce(local, op=MPI.SUM)
    centroid, mean = np.reshape(sums, (2, domain.dim)) / (area if area > 0 else 1.0)
    return round(count), float(area), centroid, mean


def regions(domain: Domain) -> list[str]:
    """Return a line for each region: its cells and volume. Collective."""
    rows, size = [], volumes(domain)
    word = "volume" if domain.dim == 3 or domain.revolved else "area"
    for name in sorted(domain.regions):
        cells = domain.regions[name]
        local = np.array([cells.size, size[cells].sum()])
        count, volume = domain.comm.allreduce(local, op=MPI.SUM)
        rows.append([name, counted(round(count), "cell"), f"{word} {volume:.6g}"])
    return ["# regions:", *table(rows)]


def vector(values: NDArray[np.floating]) -> str:
    """Return a vector, without the rounding of its zeros."""
    values = np.where(np.abs(values) < 1e-12 * np.abs(values).max(initial=0.0), 0.0, values)
    return f"({', '.join(f'{value:.6g}' for value in values)})"


def table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Give the rows with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        yield "#   " + "  ".join(cells).rstrip()


class Row(NamedTuple):
    """One thing that acts, or would if its size were not 0.

    Attributes
    ----------
    where, text
        The thing, and its values in words.
    size
        Of its values, by which those of several times are compared.
    moves
        Whether it prescribes a displacement.
    """

    where: str
    text: str
    size: float
    moves: bool = False


def acting(problem: ContactProblem, times: Sequence[float]) -> list[str]:
    """Return lines on all that acts at some times, and warnings of these. Collective.

    Each thing is told at the time at which it is largest, and not at all if it is 0 at all times.
    """
    comm, size = problem.comm, problem.domain.size
    gap = problem.interface.gap
    gap = np.where(np.abs(gap) < NEGLIGIBLE * size, 0.0, gap)  # rounding is no gap
    least = comm.allreduce(float(gap.min(initial=np.inf)), op=MPI.MIN)
    largest = comm.allreduce(float(gap.max(initial=-np.inf)), op=MPI.MAX)
    problems = [problem.at(time) for time in times]
    lines, forces = [], False
    for seen in zip(*map(_rows, problems), strict=True):
        time, row = max(zip(times, seen, strict=True), key=lambda pair: pair[1].size)
        if row.size > 0:
            forces |= not row.moves
            lines.append([row.where, row.text, f"at t = {time:g}" if len(times) > 1 else ""])
    if not lines and least >= 0:
        return ["# warning: nothing is loaded or moved: all results will be 0"]
    loads = [now.equilibrium.external(now.time) for now in problems]
    given = [now.equilibrium.prescribe(now.equilibrium.rest(), now.time) for now in problems]
    pairs = [expected_displacements(problem, *both) for both in zip(loads, given, strict=True)]
    pressed, moved = (max(values) / size for values in zip(*pairs, strict=True))
    over = " (below 0: an overlap, which is pressed apart)" if least < 0 else ""
    return [
        "# acting:",
        *table([*lines, ["gap", f"{least:.4g} to {largest:.4g}{over}", ""]]),
        *_warnings(pressed, moved, beyond=least > 10 * moved * size and not forces),
    ]


def _warnings(pressed: float, moved: float, beyond: bool) -> Iterator[str]:
    """Give warnings of loads and displacements that are large, and of a gap that is."""
    if moved > LARGE:
        yield (
            f"# warning: displacements of {moved:.0%} of the body are prescribed, and "
            "strains are taken as small"
        )
    if pressed > SOFT:
        yield (
            f"# warning: the loads over the area of the contact part are {pressed:.0%} of Young's "
            "modulus, and strains are taken as small; are both in the same units?"
        )
    if beyond:
        yield "# warning: the gap is far larger: the body may not touch at all"


def _rows(problem: ContactProblem) -> list[Row]:
    """Return all that may act at the time of a problem, the same things at all. Collective."""
    body, comm, d = problem.equilibrium, problem.comm, problem.dim
    unknowns, time = body.global_unknowns, problem.time

    def largest(values: Array) -> float:
        return float(comm.allreduce(float(np.abs(values).max(initial=0.0)), op=MPI.MAX))

    loads = body.nodal(body.external(time))
    given = body.nodal(body.prescribe(body.rest(), time))[: len(unknowns.tied)]
    given = np.where(unknowns.tied, 0.0, given)
    charge = np.abs(loads[:, d:] / body.phi_scale).sum()
    charge = float(comm.allreduce(float(charge), op=MPI.SUM))
    moved, raised = largest(given[:, :d]), largest(given[:, d:] * body.phi_scale)
    return [
        _forces("loads", loads[:, :d], problem),
        Row("charges", f"{charge:.4g} in all", charge),
        Row("supports", f"displacements of up to {moved:.4g}", moved, moves=True),
        Row("supports", f"potentials of up to {raised:.4g}", raised),
        *(row for member in unknowns.members for row in _member(member, time)),
        *_foundations(problem),
    ]


def _forces(where: str, nodal: Array, problem: ContactProblem) -> Row:
    """Return the resultant of nodal forces, (nodes, d). Collective."""
    total = np.asarray(problem.comm.allreduce(nodal.sum(axis=0), op=MPI.SUM))
    size = float(problem.comm.allreduce(float(np.abs(nodal).sum()), op=MPI.SUM))
    total = problem.domain.resultant(total)
    balanced = np.abs(total).max() <= NEGLIGIBLE * size
    text = (
        f"forces of {size:.4g} in all, which balance" if balanced else f"resultant {vector(total)}"
    )
    return Row(where, text, size)


def _member(member: Member, time: float) -> list[Row]:
    """Return the given motions and forces of a rigid body, the charge of an electrode, a bolt's."""
    given, where = member.description, f"{member.description.name} {member.description.on!r}"
    names: tuple[tuple[str, ...], ...] = (("shortening",), ("force",))
    if isinstance(given, Electrode):
        names = (("potential",), ("charge",))
    if isinstance(given, Rigid):
        where = f"foundation of {given.on!r}" if given.foundation else f"rigid part {given.on!r}"
        names = (("displacement", "rotation"), ("force", "moment"))
    d = len(given.displacement or ()) if isinstance(given, Rigid) else 1
    values = [member.given(time) * member.units, member.forces(time) / member.units]
    values[0][d:] = np.rad2deg(values[0][d:])
    rows = []
    for moves, kinds, every in zip((True, False), names, values, strict=True):
        told = [f"{value:.4g}" for value in every]
        told = [t if f != moves else WORDS[moves] for t, f in zip(told, member.free, strict=True)]
        for name, own, texts in zip(
            kinds, np.split(every, [d]), (told[:d], told[d:]), strict=False
        ):
            one = texts[0] if len(texts) == 1 else f"({', '.join(texts)})"
            text = f"{name} {one}{' degrees' if name == 'rotation' else ''}"
            rows.append(Row(where, text, np.abs(own).max(), moves))
    return rows


def _foundations(problem: ContactProblem) -> list[Row]:
    """Return the potentials of foundations, and the forces of layers before any motion."""
    body, start = problem.equilibrium, problem.start()
    forces = np.zeros(body.owned + body.global_unknowns.size)
    problem.interface.add_forces(forces, body.rest(), start.forces)
    found = [
        (contact.on, float(np.abs(contact.conductor.at(problem.time).phi_f).max(initial=0.0)))
        for contact in problem.contacts
        if contact.conductor is not None
    ]
    return [
        _forces("layers", -body.nodal(forces)[:, : problem.dim], problem),
        *(Row(f"foundation of {on!r}", f"potential {phi:.4g}", phi) for on, phi in found),
    ]
