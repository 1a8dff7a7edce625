"""The numbers of a solution as a whole: ``summary.json``, and a row of steps or of a sweep."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI

from contact.output import environment
from contact.output.quantities import ABSENT, SUMMARY, values_of
from contact.output.resultants import ChargeBalance, rigid_columns
from contact.output.solution import Solution
from contact.output.table import Table
from contact.problem.energy import Balance
from contact.typing import Array


class Results:
    """A solution as the quantities see it. The attributes are collective.

    Parameters
    ----------
    solution
        The solution.
    table
        Its contact table; None on ranks other than 0.
    energies, driven
        Of a step: its energies, and displacement and force of the part that is moved or loaded.
    """

    def __init__(
        self,
        solution: Solution,
        table: Table | None,
        energies: Balance | None = None,
        driven: tuple[Array, Array] | None = None,
    ) -> None:
        self.solution, self.problem, self.energies = solution, solution.problem, energies
        self.driven: Any = (ABSENT, ABSENT) if driven is None else driven
        self._table = table

    @cached_property
    def counts(self) -> dict[str, int]:
        """Numbers of contact nodes that are open, stick and slip."""
        status = np.array([]) if self._table is None else self._table["status"]
        counts = {name: int(np.sum(status == name)) for name in ("open", "stick", "slip")}
        return self.problem.comm.bcast(counts)

    @property
    def charges(self) -> ChargeBalance | None:
        """The free charges; None for a body without a potential."""
        return self.solution.charges

    @property
    def charge_columns(self) -> Any:
        """Charges of the electrodes and of the contact part, by the names of their columns."""
        if self.charges is None:
            return ABSENT
        columns = {f"charge_{part}": charge for part, charge in self.charges.electrodes.items()}
        return columns | {"charge_foundation": self.charges.foundation}

    @cached_property
    def potential_range(self) -> tuple[Any, Any]:
        """The least and the largest potential at a node."""
        if not self.problem.piezoelectric:
            return ABSENT, ABSENT
        comm, body = self.problem.comm, self.problem.equilibrium
        scaled = self.solution.state.x[: body.owned].reshape(-1, body.block_size)[:, -1]
        phi = body.phi_scale * scaled
        return (
            comm.allreduce(float(phi.min(initial=math.inf)), op=MPI.MIN),
            comm.allreduce(float(phi.max(initial=-math.inf)), op=MPI.MAX),
        )

    @property
    def conduction_ramp(self) -> Any:
        """How far in front of the closed gap the foundation conducts, 1/delta (length)."""
        if not self.problem.piezoelectric:
            return ABSENT
        conductor = self.problem.interface.law.conductor
        return 1 / conductor.psi.delta if conductor and conductor.psi.follows_gap else None

    @cached_property
    def rigid(self) -> Mapping[str, Mapping[str, float]]:
        """The columns of foundations that move, and of electrodes: see `motions`."""
        return rigid_columns(self.problem, self.solution.state)

    def moving(self, key: str) -> Any:
        """Return rigid bodies, or electrodes of unknown potential."""
        return self.solution.movements.get(key, ABSENT)

    def of_deformation(self, *names: str) -> Any:
        """Return measures of the deformation; absent before the solution is reviewed."""
        values = [getattr(self.solution.deformation, name, ABSENT) for name in names]
        return values[0] if len(names) == 1 or values[0] is ABSENT else values

    @property
    def floors(self) -> dict[str, float]:
        """Rounding floors of the residuals."""
        balance, contact, friction = self.solution.outcome.kkt.floors
        balance = max(balance, self.solution.rounding)
        return {"equilibrium": balance, "contact": contact, "friction": friction}

    @property
    def kinematics(self) -> str:
        """As in the case file."""
        domain = self.problem.domain
        return "axisymmetric" if domain.revolved else {2: "plane_strain", 3: "solid"}[domain.dim]

    @property
    def cells(self) -> int:
        """Number of cells."""
        topology = self.problem.domain.mesh.topology
        return int(topology.index_map(topology.dim).size_global)

    @property
    def versions(self) -> Mapping[str, str]:
        """Of Python, the libraries and the BLAS."""
        return environment.versions()


def summarise(solution: Solution, table: Table | None) -> dict[str, Any]:
    """Return the contents of ``summary.json``. Collective.

    Parameters
    ----------
    solution, table
        The solution, and its contact table; None on ranks other than 0.
    """
    return {key: _plain(v) for key, v in values_of(SUMMARY, Results(solution, table)).items()}


def _plain(value: Any) -> Any:
    """Return a value of JSON: null in place of NaN and infinity."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | np.ndarray):
        return [_plain(item) for item in value]
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
