"""``contact check CASE``: the resolved case, its mesh and unknowns, and all that acts."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact import _compat
from contact.body.elements import CHUNK, unlocked
from contact.case.build import build_problem
from contact.case.checks import growing
from contact.case.file import Case, load_case, to_toml
from contact.cli.main import CONVERGED
from contact.errors import counted
from contact.mesh.cells import Shape, rule, shape_of
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices, cells_at
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
from contact.model.rigid import Motion
from contact.problem.checks import expected_displacements, meeting_supports
from contact.problem.problem import ContactProblem
from contact.ranks import on_root
from contact.refining import coarser_cases
from contact.results.bodies import apart, overlapping
from contact.results.remarks import beyond_heights, own_shape, rounded_overlaps
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array
from forms.elasticity import Anisotropic

#: Mean ratio below which a cell is called thin.
THIN = 0.1
#: Poisson's ratio from which on elements of degree 1 lock: the bulk modulus is 19.7 times mu.
INCOMPRESSIBLE = 0.475
#: Stiffness of a crystal's strain over that of another one, from which on check warns, too.
STIFFER = 100.0
#: Length of the mean of a part's normals from which on the part counts as flat, and below which
#: they cancel.
FLAT, CLOSED = 1 - 1e-6, 1e-6
#: Displacements above this share of the body are not small.
LARGE = 0.05
#: Loads over the contact part and Young's modulus from which on units are asked for: sharp
#: indenters come to a tenth.
SOFT = 0.25


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
        from contact.plot.setup import save_setup  # matplotlib takes a while to load

        for path in save_setup(case, problem, Path.cwd()):
            print(f"# set-up: {path.name}")
    return CONVERGED


def describe(case: Case, problem: ContactProblem) -> str:
    """Return the text. Collective; the same on all ranks."""
    domain, comm = problem.domain, problem.comm
    cells = domain.mesh.topology.index_map(domain.dim).size_global
    layout = problem.body.layout
    library, path = _compat.blas()
    end = 1.0 if case.evolution is None else case.evolution.ends[-1]
    lines = [
        to_toml(case, domain.dim),
        f"# mesh: {counted(cells, 'cell')} in {domain.dim}-D on {counted(comm.size, 'rank')}, "
        f"largest extent {domain.size:g}",
        *parts(domain),
        *regions(domain),
        *(f"# note: {note}" for note in (*domain.notes, *amplitude_notes(case))),
        f"# unknowns: {layout.unknowns} ({layout.block_size} a node), contact nodes: "
        f"{problem.nodes.size}",
        *expectations(problem.at(end)),
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


def expectations(problem: ContactProblem) -> list[str]:
    """Return lines on the mesh, and on all that acts at the time of a problem. Collective."""
    warnings = [
        f"# warning: {text} [{identifier}]"
        for identifier, remarks in {
            "curved-surface": chain(rounded_overlaps(problem), own_shape(problem)),
            "part-end": beyond_heights(problem, np.ones(len(problem.nodes.weight), dtype=bool)),
            "supports": meeting_supports(problem, [problem.time]),
            "overlap": overlapping(problem),
            "two-bodies": apart(problem),
        }.items()
        for text in remarks
    ]
    return [*_quality(problem), *acting(problem), *_locking(problem), *warnings]


def _locking(problem: ContactProblem) -> list[str]:
    """Say which materials resist some strains so much that elements of degree 1 lock."""
    body = problem.body
    remedy = unlocked(body.element, body.degree, shape_of(body.domain.mesh))
    if remedy is None:
        return []
    # In plane stress volumes are free to change.
    laws = [m.law for m in problem.description.materials if not m.in_plane_stress]
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
    """Return d det(A)^(2/d) / |A|^2, least at corners, A from the regular cell (Knupp, 2001)."""
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
    found = []
    for title, group in {"of its boundary": domain.parts, "inside of it": domain.inside}.items():
        rows = []
        for name in sorted(group):
            count, area, centroid, mean = _sizes(domain, group[name])
            row = [name, counted(count, "facet"), "on the axis", "", ""]
            if area > 0:  # else facets on the axis of revolution
                words = "length" if domain.dim == 2 and not domain.revolved else "area"
                row[2:4] = f"{words} {area:.6g}", f"centroid {vector(domain.resultant(centroid))}"
                length = float(np.linalg.norm(mean))
                if group is domain.parts:
                    across = mean / length if length > CLOSED else mean
                    row[4] = f"normal {vector(across)}"
                    row[4] = row[4] if length >= FLAT else f"not plane, mean {row[4]}"
            rows.append(row)
        found += [f"# parts {title}:", *aligned(rows)] if rows else []
    return found


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
    return ["# regions:", *aligned(rows)]


def acting(problem: ContactProblem) -> list[str]:
    """Return lines on all that acts at the time of a problem, and warnings of it. Collective."""
    body, comm, size, time = problem.body, problem.comm, problem.domain.size, problem.time
    gap = problem.interface.gap
    gap = np.where(np.abs(gap) < NEGLIGIBLE * size, 0.0, gap)  # rounding is no gap
    least = comm.allreduce(float(gap.min(initial=np.inf)), op=MPI.MIN)
    largest = comm.allreduce(float(gap.max(initial=-np.inf)), op=MPI.MAX)
    loads, given = body.external(time), body.prescribe(body.zero_displacement(), time)
    pressed, moved = (x / size for x in expected_displacements(problem, loads, given))
    rows = [*_resultants(problem, loads, given), *_global_unknowns(problem)]
    rows += [
        [f"foundation of {contact.on!r}", f"potential {float(phi):.4g}"]
        for contact in problem.contacts
        if contact.conductor is not None
        and (phi := np.abs(contact.conductor.at(time).phi_f).max(initial=0.0)) > 0
    ]
    layers = any(contact.compliant_layer is not None for contact in problem.contacts)
    if not rows and least >= 0 and not layers:
        return ["# warning: nothing is loaded or moved: all results will be 0"]
    over = "" if least >= 0 else " (below 0: by the given gap, or the mean over facets that touch)"
    if least < 0 and any(contact.press for contact in problem.contacts):
        over = " (below 0: an overlap, which is pressed apart)"
    lines = ["# acting:", *aligned([*rows, ["gap", f"{least:.4g} to {largest:.4g}{over}"]])]
    if moved > LARGE:
        lines.append(
            f"# warning: displacements of {moved:.0%} of the body are prescribed, and strains are "
            "taken as small"
        )
    if pressed > SOFT:
        lines.append(
            f"# warning: the loads over the area of the contact part are {pressed:.0%} of Young's "
            "modulus, and strains are taken as small; are both in the same units?"
        )
    if pressed == 0 and least > 10 * moved * size:
        lines.append("# warning: the gap is far larger: the body may not touch at all")
    return lines


def _resultants(problem: ContactProblem, external: Array, prescribed: Array) -> list[list[str]]:
    """Return the loads, charges, and values of supports, as far as they are not 0. Collective."""
    body, comm, d = problem.body, problem.comm, problem.dim
    tied = body.global_unknowns.tied
    loads, given = body.nodal(external), body.nodal(prescribed)[: len(tied)]
    given = np.where(tied, 0.0, given)
    loads[:, d:] /= body.phi_scale
    given[:, d:] *= body.phi_scale
    total, size = (
        np.asarray(comm.allreduce(x.sum(axis=0), op=MPI.SUM)) for x in (loads, np.abs(loads))
    )
    moved, raised = (
        comm.allreduce(float(np.abs(x).max(initial=0.0)), op=MPI.MAX)
        for x in (given[:, :d], given[:, d:])
    )
    balanced = np.abs(total[:d]).max() <= NEGLIGIBLE * size[:d].sum()
    force = f"resultant {vector(problem.domain.resultant(total[:d]))}"
    force = f"forces of {size[:d].sum():.4g} in all, which balance" if balanced else force
    rows = {
        ("loads", force): size[:d].sum(),
        ("charges", f"{size[d:].sum():.4g} in all"): size[d:].sum(),
        ("supports", f"displacements of up to {moved:.4g}"): moved,
        ("supports", f"potentials of up to {raised:.4g}"): raised,
    }
    return [[*row] for row, size in rows.items() if size > 0]


def _global_unknowns(problem: ContactProblem) -> list[list[str]]:
    """Return the given motions and forces of rigid bodies, electrodes and bolts."""
    rows = []
    for group in problem.body.global_unknowns.groups:
        d, kind, names = problem.dim, "bolt", ["shortening", "force"]
        if isinstance(group.description, Electrode):
            kind, names = "electrode", ["potential", "charge"]
        if isinstance(group.description, Motion):
            kind = "foundation of" if group.is_foundation else "rigid part"
            names = ["displacement", "force", "rotation (radians)", "moment"]
        moves = group.prescribed(problem.time) * group.units
        forces = group.forces(problem.time) / group.units
        values = [moves[:d], forces[:d], moves[d:], forces[d:]]
        rows += [
            [f"{kind} {group.part!r}", f"{name} {vector(value)}"]
            for name, value in zip(names, values, strict=False)
            if np.any(value)
        ]
    return rows


def vector(values: NDArray[np.floating]) -> str:
    """Return a number or a vector, without the rounding of its zeros."""
    values = np.where(np.abs(values) < 1e-12 * np.abs(values).max(initial=0.0), 0.0, values)
    text = ", ".join(f"{value:.6g}" for value in values)
    return text if values.size == 1 else f"({text})"


def aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Give the rows with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        yield "#   " + "  ".join(cells).rstrip()
