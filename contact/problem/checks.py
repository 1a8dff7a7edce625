"""Checks of a problem before a solve: loads, supports, rigid-body modes, potential."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, product

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import linalg

from contact.body.loads import wrong_load
from contact.errors import InputError
from contact.interface.foundation import FoundationLaw
from contact.interface.placing import FoundationPlacement
from contact.model.body import Electrode
from contact.model.fields import values_at
from contact.problem.problem import ContactProblem
from contact.problem.rigid_modes import (
    PULLED_OFF,
    PUSHED_THROUGH,
    Group,
    UnilateralSupport,
    groups,
    middle,
    mode_names,
    null_space,
)
from contact.problem.state import State
from contact.tolerances import EPS, HUGE, NEGLIGIBLE
from contact.typing import Array


def expected_displacements(
    problem: ContactProblem, loads: Array, prescribed: Array
) -> tuple[float, float]:
    """Return the displacement of a block of the body's size by all loads on Gamma_3.

    And the largest prescribed displacement; of owned nodal loads, and local unknowns with the
    prescribed values. Collective.
    """
    body, scales = problem.body, problem.scales
    nodal = np.abs(body.nodal(loads)[:, : body.dim]).sum()
    motions = body.global_unknowns.mechanical
    force = body.comm.allreduce(float(nodal), op=MPI.SUM)
    force += np.abs(body.motion(loads)[motions]).sum()
    moved = body.motion(prescribed)[motions]
    displacements = np.abs(np.append(body.nodal(prescribed)[:, : body.dim], moved))
    largest = body.comm.allreduce(float(displacements.max(initial=0.0)), op=MPI.MAX)
    return float(force / scales.area / scales.young * scales.size), largest


def check_problem(
    problem: ContactProblem, times: Sequence[float] = (), refined: bool = False
) -> None:
    """Check presses, loads, supports and rigid-body modes of a problem. Collective.

    InputError if a shape presses within a facet (unless the mesh is to be `refined`, which may show
    the press), a load acts on a contact part or is not finite, two supports contradict each other
    at one of the `times` (by default the problem's own), or a rigid-body mode is unconstrained.
    """
    if not refined:
        check_presses(problem)
    _check_plane_stress(problem)
    _check_loaded_parts(problem)
    for step_problem in [problem.at(time) for time in times] or [problem]:
        _check_sizes(step_problem)
        check_supports(step_problem)
        check_rigid_modes(step_problem)


def check_presses(problem: ContactProblem) -> None:
    """Refuse presses of shapes that cut facets between their nodes. Collective."""
    for placement in problem.placements:
        if isinstance(placement, FoundationPlacement) and placement.press:
            placement.refuse_unresolved()


def _check_plane_stress(problem: ContactProblem) -> None:
    """Refuse plane stress but for all materials of a plane body."""
    body = problem.body
    thin = [material.in_plane_stress for material in problem.description.materials]
    if not any(thin):
        return
    plane = problem.dim == 2 and not problem.domain.revolved
    if not (plane and all(thin) and body.element == "standard"):
        raise InputError(
            "material: plane stress; accepted: all materials of a body in the plane, with the "
            "standard element",
            "plane-stress",
        )


def _shared(problem: ContactProblem, one: str, other: str) -> tuple[NDArray[np.int32], bool]:
    """Return the facets of this rank that two parts share, and whether any rank has such."""
    domain = problem.domain
    shared = np.intersect1d(domain.facets_anywhere(one), domain.facets_anywhere(other))
    return shared, domain.comm.allreduce(shared.size > 0, op=MPI.LOR)


def _check_loaded_parts(problem: ContactProblem) -> None:
    """Refuse loads and elastic supports on Gamma_3. Collective."""
    for contact, (i, load) in product(problem.contacts, enumerate(problem.description.loads)):
        if load.on is not None and _shared(problem, load.on, contact.on)[1]:
            raise InputError(
                f"load.{i}.on: {load.on} shares facets with the contact part {contact.on}; "
                "accepted: parts beside it, or body forces",
                "load-on-contact",
            )
    for contact, (i, support) in product(problem.contacts, enumerate(problem.description.elastic)):
        sides = [contact.on] if contact.against is None else [contact.on, contact.against]
        if any([_shared(problem, support.on, side)[1] for side in sides]):
            raise InputError(
                f"elastic.{i}.on: {support.on} shares facets with the contact part {contact.on}; "
                "accepted: parts beside it",
                "load-on-contact",
            )


def _check_sizes(problem: ContactProblem) -> None:
    """Refuse loads that are not finite, or too large. Collective."""
    loads = problem.body.external(problem.time)
    fits = bool(np.isfinite(loads).all()) and np.abs(loads).max(initial=0.0) <= HUGE
    if not problem.comm.allreduce(bool(fits), op=MPI.LAND):
        key = wrong_load(problem.description.loads, problem.domain, problem.time)
        raise InputError(
            f"{key}: not finite everywhere on its part, or too large; accepted: formulas and "
            f"functions that are finite, and units that keep sizes up to {HUGE:g}",
            "not-finite",
        )


def check_supports(problem: ContactProblem) -> None:
    """Refuse different values of two supports for one component on a common facet. Collective.

    And of a support and a rigid part or an electrode. InputError if they differ at the time of the
    problem by more than rounding.
    """
    space, time = problem.body.space, problem.time
    for i, j in combinations(range(len(problem.description.fixed)), 2):
        first, last = problem.description.fixed[i], problem.description.fixed[j]
        facets, shared = _shared(problem, first.on, last.on)
        if not shared:
            continue
        nodes = fem.locate_dofs_topological(space, problem.dim - 1, facets)
        for name in sorted(first.given.keys() & last.given.keys()):
            values = _differing(problem, (i, j), name, nodes)
            if values is not None:
                when = "" if time == 1.0 else f" at t = {time:g}"
                raise InputError(
                    f"fixed.{j}.{name}: {values[1]:g} on {last.on}; accepted: {values[0]:g}, "
                    f"as fixed.{i} has there{when}",
                    "supports",
                )

    for place, on_facets, (given, fixed) in _tied_otherwise(problem):
        if on_facets:
            raise InputError(
                f"{place}, where a support fixes {fixed}, and not {given}; accepted: equal values, "
                "one of them alone, or parts that share no facets",
                "supports",
            )


def _tied_otherwise(problem: ContactProblem) -> Iterator[tuple[str, bool, tuple[str, str]]]:
    """Say which rigid parts and electrodes have a node that a support fixes otherwise. Collective.

    Their key with the point, whether it is on a common facet, and the values of both.
    """
    body, space, d, time = problem.body, problem.body.space, problem.dim, problem.time
    if not problem.description.fixed:
        return
    unknowns = body.nodal(body.prescribe(body.zero_displacement(), time))
    for group in body.global_unknowns.groups:
        if not group.has_tied_nodes:
            continue
        electric = isinstance(group.description, Electrode)
        facets = problem.domain.facets_anywhere(group.part)
        nodes = fem.locate_dofs_topological(space, d - 1, facets)
        points = space.tabulate_dof_coordinates()[nodes, :d]
        tied = group.motion(points, body.block_size) @ group.prescribed(time)
        own = slice(d, None) if electric else slice(0, d)
        both = np.stack([tied[:, own], unknowns[nodes, own]], axis=1)
        size = problem.comm.allreduce(float(np.abs(both).max(initial=0.0)), op=MPI.MAX)
        rounding = NEGLIGIBLE * size + (1.0 if electric else problem.domain.size) * EPS
        differ = np.ptp(both, axis=1).max(axis=1) > rounding
        shared = [_shared(problem, fixed.on, group.part)[0] for fixed in problem.description.fixed]
        common = fem.locate_dofs_topological(space, d - 1, np.unique(np.concatenate(shared)))
        on_facets = np.isin(nodes, common)
        both = np.where(np.abs(both) <= rounding, 0.0, both)
        points = np.where(np.abs(points) < EPS * problem.domain.size, 0.0, points)
        # Those on common facets first.
        rows = np.column_stack([~on_facets, points, both[:, 0], both[:, 1]])[differ]
        rows = np.concatenate(problem.comm.allgather(rows[np.argsort(rows[:, 0])][:1]))
        if rows.size > 0:
            apart, *row = rows[rows[:, 0].argmin()] + 0.0
            unit = body.phi_scale if electric else 1.0
            values = np.split(unit * np.array(row[d:]), 2)
            at, given, by = (f"({', '.join(f'{x:.4g}' for x in v)})" for v in (row[:d], *values))
            key = "electrode" if electric else "rigid"
            yield f"{key} on {group.part!r}: at {at}", not apart, (given, by)


def meeting_supports(problem: ContactProblem, times: Sequence[float]) -> Iterator[str]:
    """Say where the edges of two supports meet with different values. Collective."""
    d, space = problem.dim, problem.body.space
    for i, j in combinations(range(len(problem.description.fixed)), 2):
        first, last = problem.description.fixed[i], problem.description.fixed[j]
        names = sorted(first.given.keys() & last.given.keys() - {"normal"})
        if not names or _shared(problem, first.on, last.on)[1]:
            continue
        sides = (problem.domain.facets_anywhere(fixed.on) for fixed in (first, last))
        nodes = np.intersect1d(*(fem.locate_dofs_topological(space, d - 1, f) for f in sides))
        if problem.comm.allreduce(nodes.size) == 0:
            continue
        for name in names:
            for time in times:
                values = _differing(problem.at(time), (i, j), name, nodes)
                if values is None:
                    continue
                when = "" if time == 1.0 else f" at t = {time:g}"
                place = ", ".join(f"{x:.4g}" for x in values[2:])
                yield (
                    f"fixed.{i} and fixed.{j}: {first.on} and {last.on} meet at ({place}), where "
                    f"{name} is {values[0]:g} of the first and {values[1]:g} of the second{when}: "
                    "the second counts at their common nodes, and fields beside them grow with "
                    "each refinement"
                )
                break
    for time in times:
        found = [*_tied_otherwise(problem.at(time))]
        for place, _, (given, fixed) in found:
            yield (
                f"{place}, where it meets a support that fixes {fixed}, and not {given}: the "
                "support counts at their common nodes, and fields beside them grow with each "
                "refinement"
            )
        if found:
            break


def _differing(
    problem: ContactProblem, pair: tuple[int, int], name: str, nodes: NDArray[np.int32]
) -> Array | None:
    """Return the values of two supports where they differ, and the point, (2 + d,). Collective.

    None if they do not differ at the nodes. `pair` has the numbers of both supports, `name` is the
    component.
    """
    points = problem.body.space.tabulate_dof_coordinates()[nodes, : problem.dim]
    values = np.zeros((len(points), 2))
    for k, number in enumerate(pair):
        fixed, key = problem.description.fixed[number], f"fixed.{number}.{name}"
        prescribed = values_at(fixed.given[name], points, problem.time, key, problem.comm)
        values[:, k] = fixed.factor(problem.time) * prescribed
    size = problem.comm.allreduce(float(np.abs(values).max(initial=0.0)), op=MPI.MAX)
    # sin(pi) is 0.
    unit = problem.body.phi_scale if name == "potential" else 1.0
    rounding_length = EPS * problem.domain.size
    differ = np.ptp(values, axis=1) > NEGLIGIBLE * size + unit * rounding_length
    points = np.where(np.abs(points) < rounding_length, 0.0, points)
    local_row = np.column_stack([values, points])[differ][:1]
    differing = np.concatenate(problem.comm.allgather(local_row)) + 0.0  # no -0
    return differing[0] if differing.size > 0 else None


def check_rigid_modes(problem: ContactProblem) -> None:
    """Check rigid-body modes, unilateral supports and potential. Collective.

    InputError if supports and contact leave a rigid-body mode unconstrained, loads pull the body
    off contact that alone constrains it, or the potential would be floating with contact
    everywhere.
    """
    for group in groups(problem):
        _check_group(problem, group)
    check_potential(problem)


def _check_group(problem: ContactProblem, group: Group) -> None:
    """Check a group of bodies. Collective."""
    free = null_space(group.supports)
    if free.shape[1] == 0:
        return
    unconstrained = null_space(group.constraints(problem.frictional))
    if unconstrained.shape[1] > 0:
        raise InputError(_unconstrained(group, unconstrained), "unsupported")
    support = UnilateralSupport.of(group)
    release = None if support is None else support.release(problem.time)
    if release is None:
        return
    if not release.saturated:
        raise InputError(
            f"the loads {PULLED_OFF}, and no support holds it there; accepted: loads that press it "
            "on, or more displacement components fixed",
            "pulled-off",
        )
    words = mode_names(release.motion[:, None], group.names)
    along = group.translation(release.motion)
    if along is None:
        sums = f"{_distinct(release.power / release.resisted, 1.0)[0]} times its resistance"
    else:
        loads, borne = _distinct(release.power / along, release.resisted / along)
        sums = f"{loads}, it bears less than {borne}"
    raise InputError(
        f"the loads {PUSHED_THROUGH} ({words}): they are {sums}, with its largest "
        f"pressure of {problem.interface.saturation:.4g} (stiffness x limit); accepted: smaller "
        "loads, a larger limit, a layer on a rigid part, or supports",
        "saturated",
    )


def _distinct(one: float, other: float) -> tuple[str, str]:
    """Return two numbers with the fewest digits, from six to twelve, that distinguish them."""
    pairs = [(f"{one:.{digits}g}", f"{other:.{digits}g}") for digits in range(6, 13)]
    return next((both for both in pairs if both[0] != both[1]), pairs[0])


def _unconstrained(group: Group, unconstrained: Array) -> str:
    """Return the message on unconstrained modes."""
    about, motions = "", unconstrained
    if group.count > 1:
        moves = (
            np.linalg.norm(group.by_connected_component(unconstrained), axis=2).max(axis=1) > 1e-6
        )
        about = f" about {places(group.centres[moves])}"
    if group.cut:  # shortenings only follow
        motions = linalg.orth(np.concatenate(group.by_connected_component(unconstrained)))
    modes = mode_names(motions, group.names[: len(motions)])
    return (
        f"the body{about} is not constrained: it can move as a rigid body ({modes}); accepted: "
        "displacement components fixed so that it cannot"
    )


def places(points: Array) -> str:
    """Return points in words, for messages."""
    return " and ".join(f"({', '.join(f'{x:.4g}' for x in point)})" for point in points)


def check_potential(problem: ContactProblem, state: State | None = None) -> None:
    """Check that the potential of no connected component is floating. Collective.

    InputError if one is neither prescribed nor determined by the charge of a foundation or of
    another component; electrodes join components. Without a state, contact and charge may be
    anywhere.
    """
    if not problem.piezoelectric:
        return
    body, interface = problem.body, problem.interface
    component, count = body.connected_components
    # Constants that may be added to the potential: of each component, and of each electrode.
    raised = np.zeros((*body.free.shape, count))
    raised[np.arange(component.size), -1, component] = 1.0
    electrodes = np.eye(body.global_unknowns.size)[:, ~body.global_unknowns.mechanical]
    follows = (body.global_unknowns.tied_motion @ electrodes)[
        body.block_size - 1 :: body.block_size
    ]
    rows = [np.hstack([raised[:, -1], -follows])[~body.free[:, -1]]]
    columns = linalg.block_diag(raised.reshape(body.owned, count), electrodes)
    locally = [body.local(column) for column in columns.T]
    flows, among_fixed = _flows(problem, state)
    rows.append(np.column_stack([problem.nodes.jump(x)[flows, -1] for x in locally]))
    if interface.fixed_conducting is not None:
        nodes = interface.fixed_conducting.nodes
        rows.append(np.column_stack([nodes.jump(x)[among_fixed, -1] for x in locally]))
    gram = sum(problem.comm.allreduce(part.T @ part, op=MPI.SUM) for part in rows)
    floating = null_space(gram / max(np.trace(gram), 1.0))
    if floating.shape[1] == 0:
        return
    where, grounding = "", "a conductive foundation"
    if count > 1:
        alone = np.flatnonzero(np.linalg.norm(floating[:count], axis=1) > 1e-6)
        middles = [middle(problem, body.layout.points[component == k])[0] for k in alone]
        where = f" of the component of the mesh about {places(np.array(middles))}"
        grounding += ", or with a body that conducts and whose potential is known"
    raise InputError(
        f"the potential{where} is not determined: it is prescribed nowhere, and the foundation "
        f"conducts nowhere; accepted: a potential fixed on a part, or contact with {grounding}",
        "ungrounded",
    )


def _flows(
    problem: ContactProblem, state: State | None
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which contact nodes, and which fixed ones, carry charge, or could without a state."""
    interface = problem.interface
    law, constrained = interface.foundation, interface.fixed_conducting
    if state is None:
        return _conducts(law, interface.size), _conducts(constrained, interface.size)
    charged = [
        law.charge_block(jump, pressure, full=True)[:, -1, -1] != 0
        for law, jump, pressure in interface.acting(state.x, state.multipliers)
    ]
    return charged[0], charged[1] if constrained is not None else np.zeros(0, dtype=bool)


def _conducts(law: FoundationLaw | None, deep: float) -> NDArray[np.bool_]:
    """Return which nodes conduct deep inside the foundation."""
    closed = np.ones(0 if law is None else law.nodes.nodes.size, dtype=bool)
    if law is None or law.conductor is None:
        return ~closed
    psi = law.conductor.psi.at(np.full(closed.size, deep), ~closed, closed)
    return np.broadcast_to(psi, closed.shape) > 0
