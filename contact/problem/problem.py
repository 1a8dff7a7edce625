"""A contact problem: a body and its interface, put together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.arguments import expect, several
from contact.body.elements import STANDARD
from contact.body.equilibrium import BodyEquilibrium
from contact.body.global_unknowns import GlobalUnknowns
from contact.body.internal_variables import VARIABLES
from contact.body.materials import young_behind
from contact.errors import InputError
from contact.history import CONTACT_NODES, History, InternalVariables, Part
from contact.interface.foundation import FoundationLaw
from contact.interface.friction import joined_friction
from contact.interface.grouping import joined_conductors, joined_fixed_conducting, joined_layers
from contact.interface.interface import Interface
from contact.interface.multipliers import Multipliers, SlipHistory
from contact.interface.nodes import (
    ContactNodes,
    Geometry,
    joined_nodes,
    motion_at_constant_jump,
)
from contact.interface.overlaps import Depths, overlap_depths
from contact.interface.pairing import PairPlacement, find_pair
from contact.interface.placing import FoundationPlacement, find_nodes
from contact.linear.operator import Counters, SparseOperator
from contact.linear.transformation import Transformation, TransformedOperator
from contact.mesh.domain import Domain
from contact.mesh.entities import elongation
from contact.mesh.geometry import area, volume
from contact.model.body import Body
from contact.model.contact import Contact, check_laws
from contact.model.foundation import Conductor, Electric
from contact.model.friction import Friction
from contact.problem.state import Scales, State
from contact.ranks import on_all_ranks
from contact.typing import Array


def approached(
    interface: Interface, x: Array, global_unknowns: GlobalUnknowns, time: float
) -> Array:
    """Return unknowns with each free foundation moved by its force to where it first touches.

    Where it touches nothing, nothing resists its force: the first linear system would be singular.
    Given local unknowns, and the time of the forces. Collective.
    """
    nodes, forces = interface.nodes, global_unknowns.forces(time)
    for group in global_unknowns.groups:
        push = np.zeros(global_unknowns.size)
        push[group.columns] = forces[group.columns]
        if nodes.motion is None or not group.is_foundation or not push.any():
            continue
        normal_gap = interface.normal_gap(nodes.jump(x))
        closing = -nodes.normal_component(nodes.motion @ push)
        moved = np.abs(nodes.motion[:, :, group.columns]).max(axis=(1, 2), initial=0.0) > 0
        travel = np.full(normal_gap.size, np.inf)
        closes = moved & (closing > 0)
        travel[closes] = normal_gap[closes] / closing[closes]
        least = nodes.comm.allreduce(float(travel.min(initial=np.inf)), op=MPI.MIN)
        if 0 < least < np.inf:
            x = x.copy()
            x[x.size - global_unknowns.size :] += least * push
    return x


#: The contact of a part: where its nodes are, and their geometry at any place, by `at`.
Placement = FoundationPlacement | PairPlacement

#: Part of the history of each problem.
SLIP = "slip"


class ContactProblem:
    """A contact problem: bodies, and their contacts with foundations and with each other.

    Parameters
    ----------
    domain
        Mesh and named parts.
    body
        Material, supports and loads.
    contact
        Contact part and foundation, or several.
    friction
        Friction law of contacts that have none of their own; none by default.
    conductor
        Electric contact, likewise; None for an insulated foundation.
    degree
        Degree of the Lagrange elements, 1 or 2.
    element
        "standard" or "mean_dilatation", see `contact.body.elements`.

    Attributes
    ----------
    contacts
        The contacts, each with its friction and conductor.
    description
        Material, supports and loads.
    body
        The bodies: their space, forms, forces and operators.
    placements, geometries
        Of each contact: which nodes, and their geometry where the bodies are: in the reference
        configuration, but of `with_geometry`.
    unpaired
        Overlaps of bodies between which there is no contact (`overlap_depths`).
    interface
        Gamma_3 with its laws.
    scales
        Sizes of the body and its stiffness.
    time
        Time of its loads and prescribed values: 1, or that of the load step of `at`.
    since
        Time at the beginning of that step; None in the first one.
    history
        History at its beginning, of friction and of the material.

    Raises
    ------
    InputError
        If an argument is none of these, a part is missing, a vector has the wrong length, nothing
        can touch, or a law of the layer is not one.
    """

    def __init__(
        self,
        domain: Domain,
        body: Body,
        contact: Contact | Sequence[Contact],
        friction: Friction | None = None,
        conductor: Electric | Conductor | None = None,
        degree: int = 1,
        element: str = STANDARD,
    ) -> None:
        self.domain = domain
        expect("domain", domain, "Domain.from_mesh(...), from_msh(...)", isinstance(domain, Domain))
        expect("body", body, "Body(...)", isinstance(body, Body))
        contacts = several("contact", contact, Contact, "Contact(part), or several")
        expect("contact", contact, "Contact(part), or several", contacts)
        check_laws("Problem", friction, conductor)
        self.description = body.in_space(domain.dim)
        self.contacts = tuple(one.filled(domain, friction, conductor) for one in contacts)
        names = [contact.label for contact in self.contacts]
        for name in names:
            if names.count(name) > 1:
                raise InputError(
                    f"contact.name: {name!r} is that of several contacts; accepted: one each",
                    "contact-name",
                )
        if self.by_contact and "nodes" in names:
            raise InputError(
                "contact.name: given 'nodes'; accepted: another name, "
                "for the columns stick_nodes and slip_nodes are the numbers of nodes",
                "contact-name",
            )
        foundations = {c.on: c.rigid for c in self.contacts if c.rigid is not None}
        self.body = BodyEquilibrium(domain, self.description, degree, element, foundations)
        one = len(self.contacts) == 1
        pairs = {i: (c.on, c.against, c.press) for i, c in enumerate(self.contacts) if c.against}
        pair_depths, self.unpaired = overlap_depths(self.body, [*pairs.values()])
        depths = dict(zip(pairs, pair_depths, strict=True))
        placed = [
            self._placed("contact" if one else f"contact.{i}", contact, depths.get(i, (0.0, 0.0)))
            for i, contact in enumerate(self.contacts)
        ]
        self.placements = tuple(placement for placement, _ in placed)
        self.geometries = tuple(geometry for _, geometry in placed)
        self.interface = self._interface()
        self._check_cuts()
        self.scales = self._scales()
        self.time = 1.0
        self.since: float | None = None
        #: The history of a body to which nothing has been done.
        self.initial = self._history(self.interface.friction.history, self.body.laws.initial)
        self.history = self.initial

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse changes: attributes made from the old value would stay."""
        if "history" in vars(self):  # the last attribute of __init__
            raise AttributeError(f"Problem.{name}: a problem does not change; make another one")
        super().__setattr__(name, value)

    def at(
        self, time: float, history: History | None = None, since: float | None = None
    ) -> ContactProblem:
        """Return a step of an evolution: the same body with other loads and another history.

        Parameters
        ----------
        time
            End of the step.
        history
            The history at its beginning; that of this problem by default. An empty one is that of
            a body to which nothing has been done.
        since
            Beginning of the step; None where nothing has acted before.

        Returns
        -------
        The problem of the step; its forms and its interface's nodes are shared.
        """
        history = self.history if history is None else history or self.initial
        step = self._with(time=time, since=since, history=history)
        return step.with_interface(self.interface.at(time, step.slip_history))

    @property
    def by_contact(self) -> bool:
        """Whether tables have columns of each contact: of several, or of one that has a name."""
        return len(self.contacts) > 1 or self.contacts[0].name is not None

    @property
    def slip_history(self) -> SlipHistory:
        """The part of the history that friction has."""
        slip = self.history[SLIP]
        assert isinstance(slip, SlipHistory)
        return slip

    def with_geometry(self, geometries: Sequence[Geometry]) -> ContactProblem:
        """Return the problem with its contacts at another place, each as of `Placement.at`.

        The contact nodes, the history and the time are the same. Collective.
        """
        other = self._with(geometries=tuple(geometries))
        return other.with_interface(other._interface().at(self.time, self.slip_history))

    def with_interface(self, interface: Interface) -> ContactProblem:
        """Return the problem with another interface; its transformation is that of its nodes."""
        return self._with(interface=interface)

    def _with(self, **changes: object) -> ContactProblem:
        """Return a copy with other attributes; the transformation remains while the nodes do."""
        other = object.__new__(type(self))
        vars(other).update(vars(self) | changes)
        if other.nodes is not self.nodes:
            vars(other).pop("transformation", None)
        return other

    def commit(self, state: State) -> History:
        """Return the history of the step that follows a state of this problem. Collective.

        The state knows the time and the history of the step that led to it: the problem may be
        that of any step.
        """
        step_problem = self.at(state.time, state.history)
        slip = step_problem.interface.commit(step_problem.nodal(state))
        variables = self.body.laws.commit(replace(state, history=step_problem.history))
        return self._history(slip, variables)

    @staticmethod
    def _history(slip: SlipHistory, variables: InternalVariables | None) -> History:
        """Return the history of these parts: who adds one adds it here."""
        parts: dict[str, Part] = {SLIP: slip}
        return History(parts if variables is None else parts | {VARIABLES: variables})

    def points(self, place: str) -> Array:
        """Return the points of the places of a history that this rank owns, shape (n, d)."""
        return self.nodes.points if place == CONTACT_NODES else self.body.laws.places

    def _placed(self, key: str, contact: Contact, overlap: Depths) -> tuple[Placement, Geometry]:
        """Return the placement of a contact, and its geometry in the reference configuration."""
        layer = contact.compliant_layer
        if layer is not None:
            layer.check(self.domain.size)
        if contact.conductor is not None:
            with on_all_ranks(self.comm):
                contact.conductor.check()
                if not self.piezoelectric:
                    raise InputError(
                        f"{key}: a conductor; accepted: one before a piezoelectric body", "piezo"
                    )
        assert contact.friction is not None  # filled in above
        body, arguments = self.body, (contact.obstacle, key, contact.press)
        if contact.against is not None:
            acts = contact.friction.acts
            return find_pair(body, contact.on, contact.against, *arguments, acts, overlap)
        conducts = contact.conductor is not None and self.piezoelectric
        return find_nodes(body, contact.on, *arguments, conducts)

    @cached_property
    def contact_youngs(self) -> list[float]:
        """Modulus at each contact (stress); of a pair that of the softer side. Collective.

        Parts away from the contacts may be much softer.
        """
        where = self.domain, self.description.materials, self.body.cells
        return [min(young_behind(*where, part) for part in both) for both in self.sides]

    @property
    def sides(self) -> list[list[str]]:
        """The parts of each contact."""
        return [[c.on] if c.against is None else [c.on, c.against] for c in self.contacts]

    def _interface(self) -> Interface:
        """Return the laws of all contacts at their geometries. Collective."""
        body, geometries = self.body, self.geometries
        nodes = joined_nodes(geometries, [contact.on for contact in self.contacts], body)
        young, extents = max(self.contact_youngs), body.extents
        sizes = np.array(
            [extents[body.connected_components_of(*both)].min() for both in self.sides]
        )
        conductors = [contact.conductor for contact in self.contacts]
        law = FoundationLaw(
            nodes=nodes,
            layer=joined_layers([contact.compliant_layer for contact in self.contacts], geometries),
            conductor=joined_conductors(conductors, [geometry.nodes for geometry in geometries]),
            phi_scale=body.phi_scale,
            c_b=young / self.domain.size,
        )
        frictions = [contact.friction or Friction() for contact in self.contacts]
        facets = [self.domain.facets(contact.on) for contact in self.contacts]
        return Interface(
            nodes=nodes,
            gap=law.signorini_gap,
            foundation=law,
            friction=joined_friction(frictions, geometries, nodes),
            fixed_conducting=joined_fixed_conducting(
                conductors, geometries, law, body.layout.index_map.local_range[0]
            ),
            c_b=young / self.domain.size,
            c_0=young / sizes[self.entry_numbers],
            size=self.domain.size,
            elongation=max(elongation(self.domain.mesh, part) for part in facets),
            connected_component=body.component_norms.connected_component[nodes.nodes],
            connected_components=body.component_norms.count,
        )

    def _check_cuts(self) -> None:
        """Refuse contact at nodes of a bolt's cut that moves across it. Collective."""
        body, nodes = self.body, self.nodes
        if body.cuts is None:
            return
        acting = [nodes.normal]
        if any(contact.friction and contact.friction.acts for contact in self.contacts):
            acting += list(np.moveaxis(nodes.tangential_projector, 2, 0))
        along = np.zeros((len(body.free), self.dim, len(acting)))
        for k, vectors in enumerate(acting):
            into = np.zeros_like(body.owned_part(body.zero_displacement()))
            nodes.add_jump_transposed(vectors, into)
            along[:, :, k] = body.nodal(into)[:, : self.dim]
        body.cuts.check(np.arange(len(along), dtype=np.int32), along, "contact meets")

    def _area(self, domain: Domain) -> float:
        """Return the area of Gamma_3. Collective."""
        return sum(area(domain, contact.on) for contact in self.contacts)

    def _scales(self) -> Scales:
        domain, d = self.domain, self.dim
        contact_area = self._area(domain)
        # Of the mesh itself, which may be but the half plane of the body.
        mesh_area = self._area(replace(domain, revolved=False)) if domain.revolved else contact_area
        return Scales(
            **self.body.softest._asdict(),
            contact_young=max(self.contact_youngs),
            size=domain.size,
            height=volume(domain) / contact_area,
            area=contact_area,
            spacing=(mesh_area / self.nodes.size) ** (1 / (d - 1)),
        )

    @property
    def entry_numbers(self) -> NDArray[np.intp]:
        """Number of the contact of each owned contact node, shape (n,)."""
        sizes = [geometry.nodes.nodes.size for geometry in self.geometries]
        return np.repeat(np.arange(len(sizes)), sizes)

    @cached_property
    def transformation(self) -> Transformation | None:
        """The transformation x = C y of the linear systems. Collective.

        None where jumps are nodal values and there are no global unknowns.
        """
        body, nodes = self.body, self.nodes
        unknowns, motions = body.global_unknowns, body.global_unknowns.tied_motion
        if nodes.coupling is None and unknowns.size == 0:
            return None
        if nodes.motion is not None:
            motions = unknowns.with_foundations(nodes.nodes, motion_at_constant_jump(nodes, body))
        change = None if nodes.coupling is None else nodes.coupling.change
        return Transformation(body.layout, change, motions, unknowns.free)

    def same_unknowns(self, other: ContactProblem) -> bool:
        """Tell whether the linear systems of another problem have the same unknowns y. Collective.

        Those of load steps have; those at another geometry may have other jumps.
        """
        if self.nodes is other.nodes:
            return True
        nodes = self.interface.operator_nodes, other.interface.operator_nodes
        same = self.comm.allreduce(np.array_equal(*nodes), op=MPI.LAND)
        one, two = self.transformation, other.transformation
        if not same or one is None or two is None:
            return same and one is two
        return one.same(two)

    def operator(
        self, *, symmetric: bool, counters: Counters, solver: str
    ) -> SparseOperator | TransformedOperator:
        """Return the operator of its linear systems; see `BodyEquilibrium.operator`. Collective."""
        return self.body.operator(
            self.interface.operator_nodes,
            self.transformation,
            symmetric=symmetric,
            counters=counters,
            solver=solver,
        )

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator of the mesh."""
        return self.domain.comm

    @property
    def dim(self) -> int:
        """Space dimension."""
        return self.body.dim

    @property
    def kinematics(self) -> str:
        """The kinematics of the body as the case file names it; "solid" in 3-D."""
        if self.domain.revolved or self.dim == 3:
            return "axisymmetric" if self.domain.revolved else "solid"
        thin = any(material.in_plane_stress for material in self.description.materials)
        return "plane_stress" if thin else "plane_strain"

    @property
    def piezoelectric(self) -> bool:
        """Whether there is a potential."""
        return self.body.piezoelectric

    @property
    def frictional(self) -> bool:
        """Whether a tangential force can act."""
        return self.interface.friction.acts

    @property
    def nodes(self) -> ContactNodes:
        """The contact nodes."""
        return self.interface.nodes

    def nodal(self, state: State) -> Array:
        """Return the jumps T x at the owned contact nodes, shape (n, block size)."""
        return self.nodes.jump(state.x)

    def start(self, time: float | None = None) -> State:
        """Return the state to start from: zero, but for the prescribed values at a time.

        Where no potential is prescribed, it starts from that of the first conductive foundation,
        as these alone determine it: far from phi_F a truncated charge has no derivative.
        """
        body, time = self.body, self.time if time is None else time
        x = body.zero_displacement()
        conductors = [c.conductor for c in self.contacts if c.conductor is not None]
        if self.piezoelectric and conductors:
            if all(fixed.potential is None for fixed in self.description.fixed):
                body.nodal(x)[:, -1] = conductors[0].at(self.time).phi_f / body.phi_scale
        x = approached(self.interface, body.prescribe(x, time), body.global_unknowns, time)
        return State(x, Multipliers.zero(self.nodes), time, self.history)
