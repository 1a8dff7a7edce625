"""A contact problem: a body and its interface, put together."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.description import Body
from contact.body.equilibrium import BodyEquilibrium
from contact.body.norms import volume
from contact.interface.current import Conductor, HeldCurrent, held_current
from contact.interface.friction import Friction, NodalFriction
from contact.interface.history import SlipHistory
from contact.interface.interface import Interface
from contact.interface.layer import Layer
from contact.interface.multipliers import Multipliers
from contact.interface.nodes import ContactNodes
from contact.interface.obstacle import Obstacle
from contact.interface.placing import candidates, find_nodes
from contact.interface.response import FoundationResponse
from contact.mesh.domain import Domain
from contact.problem.scales import Scales
from contact.problem.state import State
from contact.typing import Array


@dataclass(frozen=True)
class Contact:
    """The part that may touch, the obstacle, and the compliant layer in front of it."""

    on: str
    foundation: Obstacle
    layer: Layer | None = None


class ContactProblem:
    """One body in front of one foundation.

    Parameters
    ----------
    domain
        Mesh and named parts.
    body
        Material, supports and loads.
    contact
        Contact part and foundation.
    friction
        Friction law; none by default.
    conductor
        Electric contact; None for an insulated foundation.
    degree
        Degree of the Lagrange elements, 1 or 2.

    Attributes
    ----------
    equilibrium
        The body: its space, forms, forces and operators.
    interface
        Gamma_3 with its laws.
    scales
        Sizes of the body and its stiffness.
    time
        When its loads and prescribed values act: 1, unless `at` has made it another step.

    Raises
    ------
    InputError
        If a part is missing, a vector has the wrong length, nothing can touch, or the laws of
        the layer are none.
    """

    def __init__(
        self,
        domain: Domain,
        body: Body,
        contact: Contact,
        friction: Friction | None = None,
        conductor: Conductor | None = None,
        degree: int = 1,
    ) -> None:
        self.domain, self.body, self.contact = domain, body, contact
        self.friction, self.conductor = friction or Friction(), conductor
        self.equilibrium = BodyEquilibrium(domain, body, degree)
        self.interface = self._interface()
        self.scales = self._scales()
        self.time = 1.0

    def at(self, time: float, history: SlipHistory | None = None) -> ContactProblem:
        """Return a step of an evolution: the same body with other loads and another history.

        Parameters
        ----------
        time
            End of the step.
        history
            What friction remembers; that of this problem by default.
        """
        step = copy(self)
        step.time = time
        step.interface = self.interface.at(time, history or self.interface.friction.history)
        return step

    def _interface(self) -> Interface:
        contact, body, size = self.contact, self.equilibrium, self.domain.size
        if contact.layer is not None:
            contact.layer.check(size)
        found = find_nodes(body, contact.on, contact.foundation)
        stiffness = float(self.body.law.young) / size
        response = FoundationResponse(
            found, contact.layer, self.conductor, body.phi_scale, stiffness
        )
        jump = response.constrained
        friction = NodalFriction.at(jump, self.friction)
        return Interface(jump, response, friction, self._held(jump), stiffness, size)

    def _held(self, jump: ContactNodes) -> HeldCurrent | None:
        if self.conductor is None or not self.piezoelectric:
            return None
        body, contact = self.equilibrium, self.contact
        return held_current(
            candidates(self.domain, body.space, contact.on),
            contact.foundation,
            body.free,
            jump,
            self.conductor,
            body.phi_scale,
        )

    def _scales(self) -> Scales:
        domain, law, d = self.domain, self.body.law, self.dim
        area = volume(domain, domain.ds(self.contact.on))
        whole = volume(domain, domain.dx)
        cell = (whole / self.equilibrium.layout.index_map.size_global) ** (1 / d)
        return Scales(
            young=float(law.young),
            poisson=float(law.poisson),
            bulk=float(law.bulk),
            shear=float(law.shear),
            size=domain.size,
            height=whole / area,
            area=area,
            spacing=(area / self.nodes.size) ** (1 / (d - 1)),
            stiffness=float(law.bulk + 4 / 3 * law.shear) * cell ** (d - 2),
        )

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator of the mesh."""
        return self.domain.comm

    @property
    def dim(self) -> int:
        """Space dimension."""
        return self.equilibrium.dim

    @property
    def piezoelectric(self) -> bool:
        """Whether there is a potential."""
        return self.equilibrium.piezoelectric

    @property
    def frictional(self) -> bool:
        """Whether a tangential force can act."""
        return self.interface.friction.acts

    @property
    def nodes(self) -> ContactNodes:
        """The contact nodes."""
        return self.interface.jump

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which unknowns of the owned nodes are not fixed, shape (nodes, block size)."""
        return self.equilibrium.free

    def nodal(self, state: State) -> Array:
        """Return the unknowns at the owned contact nodes, shape (n, block size)."""
        return self.nodes.apply(state.x)

    def start(self, time: float | None = None) -> State:
        """Return the state to start from: at rest, but for the prescribed values at a time.

        Where no potential is prescribed, it starts from that of the conductive foundation, which
        alone determines it: far from phi_F a truncated charge has no derivative.
        """
        body, time = self.equilibrium, self.time if time is None else time
        x, conductor = body.rest(), self.interface.response.conductor
        if self.piezoelectric and conductor is not None:
            if all(fixed.potential is None for fixed in self.body.fixed):
                x.reshape(-1, body.block_size)[:, -1] = conductor.phi_f / body.phi_scale
        return State(body.prescribe(x, time), Multipliers.zero(self.nodes), time)
