"""What ``summary.json`` says."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np
from mpi4py import MPI

from contact.mesh.domain import Domain
from contact.output import environment
from contact.output.balances import charge_balance
from contact.output.motions import movements
from contact.output.solution import Solution
from contact.output.table import Table


def summarise(solution: Solution, table: Table | None) -> dict[str, Any]:
    """Return the contents of ``summary.json``. Collective.

    Parameters
    ----------
    solution
        The solution.
    table
        Its contact table, None on ranks other than 0.
    """
    problem, records = solution.problem, solution.history.records
    counts = count(problem.comm, table)
    mesh, counters = problem.domain.mesh, solution.counters
    kkt = solution.outcome.kkt
    summary: dict[str, Any] = {
        "title": solution.title,
        "units": solution.units.given,
        "converged": solution.converged,
        "reason": solution.outcome.reason,
        "method": solution.method,
        "kinematics": _kinematics(problem.domain),
        "dofs": problem.equilibrium.layout.unknowns,
        "cells": mesh.topology.index_map(mesh.topology.dim).size_global,
        "ranks": problem.comm.size,
        "outer_iterations": len(records),
        "inner_iterations": [record.inner for record in records],
        "linear_solves": counters.linear_solves,
        "linear_iterations": counters.linear_iterations,
        "factorizations": counters.factorizations,
        "contact_solves": counters.contact_solves,
        "kkt": {"equilibrium": kkt.equilibrium, "contact": kkt.contact, "friction": kkt.friction},
        "rounding": solution.rounding,
        "max_pressure": problem.nodes.maximum(solution.pressure),
        "contact_area": solution.contact_area,
        "contact_force": solution.contact_force.tolist(),
        "contact_moment": solution.contact_moment.tolist(),
        "reactions": {part: held.force.tolist() for part, held in solution.supports.items()},
        "reaction_moments": {
            part: held.moment.tolist() for part, held in solution.supports.items()
        },
        "max_displacement": largest_displacement(solution),
        "max_dev_strain": solution.max_dev_strain,
        **_deformation(solution),
        "max_von_mises": solution.max_von_mises,
        "share_beyond_yield": solution.share_beyond_yield,
        "contact_nodes": counts["stick"] + counts["slip"],
        "stick_nodes": counts["stick"],
        "slip_nodes": counts["slip"],
        "contact_direction": ", ".join(
            dict.fromkeys(contact.foundation.direction for contact in problem.contacts)
        ),
        **movements(problem, solution.state),
        "notes": solution.notes,
        "warnings": solution.warnings,
    }
    if problem.piezoelectric:
        summary |= _electric(solution)
    summary["case"] = solution.case
    summary |= {"seconds": solution.seconds, "versions": environment.versions()}
    return {key: _finite(value) for key, value in summary.items()}


def _kinematics(domain: Domain) -> str:
    if domain.revolved:
        return "axisymmetric"
    return "plane_strain" if domain.dim == 2 else "solid"


def count(comm: MPI.Intracomm, table: Table | None) -> dict[str, int]:
    """Return how many contact nodes are open, stick and slip. Collective."""
    status = np.array([]) if table is None else table["status"]
    return comm.bcast({s: int(np.sum(status == s)) for s in ("open", "stick", "slip")})


def largest_displacement(solution: Solution) -> float:
    """Return the largest Euclidean norm of the displacement over the nodes. Collective."""
    problem = solution.problem
    body = problem.equilibrium
    u = solution.state.x[: body.owned].reshape(-1, body.block_size)[:, : problem.dim]
    largest = float(np.linalg.norm(u, axis=1).max(initial=0.0))
    return float(problem.comm.allreduce(largest, op=MPI.MAX))


def _electric(solution: Solution) -> dict[str, Any]:
    problem, body = solution.problem, solution.problem.equilibrium
    scaled = solution.state.x[: body.owned].reshape(-1, body.block_size)[:, -1]
    phi = body.phi_scale * scaled
    charges = charge_balance(problem, solution.state)
    return {
        "phi_min": problem.comm.allreduce(float(phi.min(initial=math.inf)), op=MPI.MIN),
        "phi_max": problem.comm.allreduce(float(phi.max(initial=-math.inf)), op=MPI.MAX),
        "total_charge": charges.total,
        "charges": asdict(charges),
        "conduction_ramp": _ramp(solution),
    }


def _ramp(solution: Solution) -> float | None:
    """Return how far in front of the closed gap the foundation conducts, 1/delta (length)."""
    conductor = solution.problem.interface.response.conductor
    if conductor is None or not conductor.psi.follows_gap:
        return None
    return 1 / conductor.psi.delta


def _deformation(solution: Solution) -> dict[str, Any]:
    made = solution.deformation
    if made is None:
        return {}
    return {
        "max_strain": made.largest_strain,
        "volume_ratio": [made.least_volume, made.largest_volume],
    }


def _finite(value: Any) -> Any:
    """Return a value with null for what JSON cannot say: NaN and infinity."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
