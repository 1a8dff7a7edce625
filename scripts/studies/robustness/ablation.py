"""Which problems need each device of solver and linear algebra: one of them off at a time.

`make ablation ARGS="[--out DIR] [--coarse] [--every K] [--devices NAME ..] [--only NAME]"`.
Problems are the plain and the hard ones, and Example 8.4 with a steep ramp; --coarse takes a tenth,
--every K one of K. A device whose row shows no problem, neither failed nor slow, is to go
(CONTRIBUTING.md). Some have a problem of their own. Slow is 1.5 times as long; on one of its own
a device of linear algebra is needed where it saves a tenth.
"""

from __future__ import annotations

import inspect
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from contact import Case, NewtonOptions, Solution, load_case, parse_case, refining, solve
from contact.linear import multigrid, schur
from contact.linear.operator import BlockPreconditioner
from contact.methods import fallbacks, interior_point, newton_step, safeguards, semismooth
from contact.methods.newton import Chord, Newton
from contact.methods.report import Outcome
from contact.methods.unconstrained_modes import UnconstrainedModes
from contact.problem.residuals import evaluate, undeformed_equilibrium
from scripts.benchmarks import bench_one
from scripts.cases import CASES
from scripts.reporting import Report, append, empty, parser
from scripts.studies.robustness.bodies import Bodies
from scripts.studies.robustness.check import write_msh
from scripts.studies.robustness.one_body import case, clamp, elastic, grid, sliding
from scripts.studies.robustness.problems import problems
from scripts.thesis.tables_compliance import case_of
from tests.methods.test_belt import wall
from tests.methods.test_free_body import pads
from tests.methods.test_nothing_touches import unloaded
from tests.methods.test_slender import TIP, UNIFORM, beam

#: Times as long as with the device, and seconds more, from which on a problem counts as slow.
SLOW, NOTICED = 1.5, 0.1

#: The same of a device of linear algebra.
SLOW_LINEAR = 1.1


@dataclass(frozen=True)
class Device:
    """A part of the method that can be switched off."""

    #: As in the documentation.
    name: str
    #: The functions and classes that it consists of.
    source: tuple[Any, ...]
    #: Its reference.
    literature: str
    #: Its replacement: owner, name, value.
    changes: tuple[tuple[Any, str, Any], ...] = ()
    #: Changes of the options.
    options: tuple[tuple[str, Any], ...] = ()
    #: The only problem that is solved without it; None for all.
    problem: Callable[[], Case] | None = None

    @property
    def lines(self) -> int:
        """Lines of its source; of one that is part of a function 0."""
        return sum(len(inspect.getsource(part).splitlines()) for part in self.source)

    @contextmanager
    def off(self) -> Iterator[NewtonOptions]:
        """Switch it off; yield the options."""
        with ExitStack() as stack:
            for owner, name, value in self.changes:
                stack.enter_context(patch.object(owner, name, value))
            yield NewtonOptions(**dict(self.options))


def _nothing(*_: Any, **__: Any) -> None:
    return None


def _no_fallback(method: Any, *_: Any) -> tuple[Any, Outcome]:
    residuals = evaluate(method.problem, method.last)
    return method.last, Outcome(residuals, method.options.allowed, "no interior point")


def _linearised(old: Callable[..., Any]) -> Callable[..., Any]:
    """Return the layer linearised about the displacement alone."""

    def plain(interface: Any, nodal: Any, state: Any, of: Any, full: bool) -> Any:
        forces = replace(state.forces, pressure=0.0 * state.forces.pressure)
        about = replace(state, forces=forces, layer_pressure=interface.foundation.pressure(nodal))
        return old(interface, nodal, about, of, full)

    return plain


MU = sliding(0.3)
ON_PLANE = {"on": "bottom"}

_STRIP = beam(100.0, [1600, 16], {}, 0.0, 0.3)
_PRESSED = {"on": "top", "traction": [0.0, -1e-3]}, {"on": "right", "traction": [0.015, 0.0]}
_SPHERES = {
    "generator": "two_spheres", "quarters": 2, "size": 25.0, "contact_size": 2.5,
    "contact_width": 5.0,
}  # fmt: skip
_HALF_SPHERES = [
    {"on": "symmetry_y", "displacement": ["free", 0.0, "free"]}, *clamp("lower_cut", dim=3),
]  # fmt: skip
_PIEZO = {"e31": -0.3, "e33": 0.8, "e15": 0.6, "beta11": 1.0, "beta33": 0.9}

#: Tables of problems that a device alone solves, or solves in time.
OWN: dict[str, dict[str, Any]] = {
    # A cantilever whose tip touches a stop, on one mesh alone, as of a file.
    "stop": beam(100.0, [1600, 16], TIP, 0.5, 0.3, solver={"nested": False}),
    # A cantilever most of which lies on the ground, and that is condensed.
    "lying": beam(100.0, [500, 20], UNIFORM, 0.5, space={"degree": 2}),
    # A pressed strip, clamped at one end and pulled at the other: half of it slides.
    "pulled-strip": {**_STRIP, "load": [*_PRESSED]},
    # A ball that another one alone holds, pushed aside.
    "two-spheres": case(
        _SPHERES, elastic(20e3), _HALF_SPHERES, {"on": "upper_round", "against": "lower_round"},
        MU, {"on": "upper_cut", "traction": [0.5, 0.0, -8.0]}, solver={"linear": "iterative"},
    ),
    # Two piezoelectric bodies below a plate, with a current across both contacts.
    "piezoelectric-pair": {
        "mesh": {"generator": "two_blocks", "lower_size": 0.3, "upper_size": 0.22},
        "material": elastic(piezo=_PIEZO),
        "fixed": [{"on": "lower_left", "displacement": [0.0, "free"]}],
        "rigid": [{"on": "upper_top", "displacement": [0.002, "free"], "force": [0.0, -0.02]}],
        "electrode": [{"on": "upper_top", "charge": 0.003}],
        "contact": [
            {"on": "upper_bottom", "against": "lower_top", "friction": MU,
             "electric": {"k_e": 2.0, "delta": 5.0}},
            {"on": "lower_bottom", "friction": sliding(0.1),
             "electric": {"k_e": 1.0, "delta": 5.0}},
        ],
        "solver": {"linear": "iterative", "tolerance": 1e-9},
    },
}  # fmt: skip


def _own(name: str) -> Callable[[], Case]:
    """Return how a problem of `OWN` is made."""
    return lambda: parse_case(OWN[name], source=name)


def _belt() -> Case:
    """Return a belt around half a drum, pulled with 95 % of its friction, which alone holds it."""
    angle, mu, thick = np.pi, 0.3, 0.02
    at = np.linspace(0.0, angle, 25)
    rows = [r * np.stack([-np.cos(at), np.sin(at)], axis=1) for r in (1.0, 1.0 + thick)]
    bodies = Bodies(np.random.default_rng(0))
    bodies.grid("belt", np.array(rows), ["inside", "outside", "left", "right"])
    folder = Path(tempfile.mkdtemp())
    write_msh(bodies.mesh(), folder / "belt.msh")
    pull = 1 + 0.95 * (np.exp(mu * angle) * (1 - thick) - 1)
    drum = {"shape": "sphere", "centre": [0.0, 0.0], "radius": 1.0}
    contact = {"on": "belt_inside", "overlap": "press", "foundation": drum}
    left = {"on": "belt_left", "force": [0.0, -1e-7]}
    right = {"on": "belt_right", "force": [0.0, -1e-7 * float(pull)]}
    mesh, space = {"file": str(folder / "belt.msh")}, {"degree": 2, "kinematics": "plane_stress"}
    tables = case(mesh, elastic(1.0, 0.0), [], contact, sliding(mu), left, right, space=space)
    return parse_case(tables, source="belt")


def _layer() -> Case:
    """Return a block on a layer that the load presses to 95 % of its limit."""
    layer = {"stiffness": 500.0, "limit": 3e-3, "layer": np.inf}
    load = {"on": "top", "pressure": 0.95 * layer["stiffness"] * layer["limit"]}
    contact, fixed = {**ON_PLANE, "law": "compliance", **layer}, [{"on": "left", "symmetry": "x"}]
    mesh = grid([2.0, 1.0], [6, 3])
    tables = case(mesh, elastic(1000.0, 0.0), fixed, contact, sliding(0.0), load)
    return parse_case(tables, source="layer")


def _wedge() -> Case:
    """Return a wedge between two planes, whose bounds by interior points alone take far longer."""
    (problem,) = problems("bodies", "wedges-21", folder=Path(tempfile.mkdtemp()))
    return problem.case


def _steep(cells: tuple[int, int], k_e: str, delta: str) -> Case:
    """Return Example 8.4 with a steep ramp of the conductivity."""
    changes = "solver.method=newton", f"electric.k_e={k_e}", f"electric.delta={delta}"
    return case_of("compliance-8-4", cells, *changes)


def _finer(name: str, cells: tuple[int, ...]) -> Callable[[], Case]:
    """Return how a plain problem is made on a finer mesh."""

    def make() -> Case:
        tables = next(problems("plain", name)).tables
        mesh = tables["mesh"] | {"cells": [*cells]}
        return parse_case({**tables, "mesh": mesh}, source=f"{name} on a finer mesh")

    return make


def _renamed(name: str, make: Callable[..., Case], *arguments: Any) -> Callable[[], Case]:
    """Return how a case of another script is made under a name of its own."""

    def made() -> Case:
        case = make(*arguments)
        case._source = name
        return case

    return made


_block = _renamed("block-16", bench_one.block, 16)
_plane = _renamed("plane-256", bench_one.problem_case, 2, 256, "solver.nested=false")
_wall = _renamed("wall", wall, 2, 1.01)
_lifted = _renamed("pads", lambda: pads(Path(tempfile.mkdtemp()), 1))
_unloaded = _renamed("two-blocks-unloaded", lambda: parse_case(unloaded("supports")))
_conducting = _renamed("compliance-8-4 with k_e = 6", _steep, (48, 8), "6.0", "8.3333")

DEVICES = (
    Device("interior point", (interior_point,), "Mehrotra 1992; Nesterov and Todd 1998",
           ((fallbacks, "interior_point", _no_fallback),)),
    Device("updates of the friction bound", (), "Haslinger 1983",
           ((interior_point, "UPDATES", 1),)),
    Device("friction bound of Newton's last steps", (), "-",
           ((interior_point, "PROGRESS", 0.0),), (), _wedge),
    Device("limit analysis of the friction bound", (UnconstrainedModes.overloaded,), "Drucker 1954",
           ((UnconstrainedModes, "overloaded", lambda *_: False),), (), _wall),
    Device("rigid motion to a state without contact", (UnconstrainedModes.separated,),
           "Lawson and Hanson 1974", ((fallbacks, "rigid_motion", _nothing),), (), _lifted),
    Device("steps on the condensed body at last", (fallbacks.condensed_body,), "Guyan 1965",
           ((fallbacks, "condensed_body", _nothing),)),
    Device("secants of a layer", (fallbacks.layer_secants,), "Kacanov 1959",
           ((fallbacks, "layer_secants", _nothing),), (), _layer),
    Device("proximal points", (fallbacks.proximal_points,), "Rockafellar 1976",
           ((fallbacks, "proximal_points", _nothing),), (), _belt),
    Device("continuation in the conductivity", (fallbacks.continuation,), "Allgower and Georg 2003",
           ((fallbacks, "conductivity_continuation", _nothing),)),
    Device("estimate of the stiffness from the first step",
           (semismooth._overestimates_stiffness,), "-",
           ((semismooth, "_overestimates_stiffness", lambda *_: False),), (), _own("stop")),
    Device("Levenberg-Marquardt regularisation", (), "Marquardt 1963",
           ((safeguards, "REGULARISATION", 0.0),), (), _own("two-spheres")),
    Device("forcing term that tightens", (newton_step.NewtonStep._forcing_term,),
           "Dembo, Eisenstat and Steihaug 1982", ((newton_step, "STAGNANT", 10**9),), (),
           _own("piezoelectric-pair")),
    Device("layer linearised where its law is met", (newton_step.linearised_layer,), "-",
           ((newton_step, "linearised_layer", _linearised(newton_step.linearised_layer)),)),
    Device("limited softening", (), "-", (), (("softening", float("inf")),),
           _finer("block-33", (24, 12, 12))),
    Device("sliding nodes at their bound", (safeguards.at_bound,), "-",
           ((safeguards, "at_bound", lambda _, friction, *__: friction),), (),
           _finer("bar-67", (640, 160))),
    Device("derivative of the conductivity by the gap", (safeguards.ConductivityDerivative,), "-",
           ((safeguards.ConductivityDerivative, "__call__", lambda *_: False),)),
    Device("stagnation limit of the continuation", (), "-",
           ((fallbacks, "CONTINUATION_LIMIT", None),), (), _conducting),
    Device("zero displacement where nothing acts", (undeformed_equilibrium,), "-",
           ((semismooth.ConvergenceMonitor, "_loss_of_contact", _nothing),), (),
           _unloaded),
    Device("working set of contact nodes, from all open",
           (fallbacks.all_open, fallbacks.working_set, fallbacks.dual_active_set),
           "Goldfarb and Idnani 1983",
           ((fallbacks, "all_open", _nothing),), (), _own("stop")),
)  # fmt: skip

#: Ways to solve the linear systems: one with a problem of its own is needed from SLOW_LINEAR on.
LINEAR = (
    Device("nested iteration",
           (refining.pays, refining.default_start, refining.nested_start, refining.prolong,
            refining._interpolate, refining.coarser_cases, refining._coarser),
           "Bornemann and Deuflhard 1996", (),
           (("nested", False),), _own("pulled-strip")),
    Device("material left as it was linearised last", (), "-", ((newton_step, "SMALL", 0.0),), (),
           _block),
    Device("chord steps", (Chord,), "Kelley 1995", (), (("reuse", "never"),), _plane),
    Device("static condensation", (Newton._condensed_steps,), "Guyan 1965", (),
           (("condense", False),)),
    Device("Cholesky factors of a condensed body", (), "Golub and Van Loan 2013",
           ((schur, "dpotrf", lambda *_, **__: (None, 1)),), (), _own("lying")),
    Device("elimination of unknowns without contact", (), "Golub and Van Loan 2013",
           ((schur, "_cholesky", lambda _, rows: (np.zeros((0, 0)), int(rows.size > 0))),), (),
           _own("lying")),
    Device("coarse levels kept from step to step", (multigrid.Hierarchy,),
           "Karlin, Manasse, Rudolph and Sleator 1988", ((multigrid, "PRICE", 0),), (), _block),
    Device("interpolation that follows contact nodes", (multigrid.StiffNodes,), "-",
           ((multigrid.StiffNodes, "follow", _nothing),
            (multigrid.StiffNodes, "local_correction", lambda _, rhs: rhs.duplicate())),
           (), _block),
    Device("piezoelectric block preconditioner", (BlockPreconditioner,),
           "Silvester and Wathen 1994",
           ((multigrid, "LARGE", {**multigrid.LARGE, (3, True): 10**9}),), (),
           partial(load_case, CASES / "piezo-column.toml", ["mesh.cells=[20, 20, 40]"])),
)  # fmt: skip


def cases(coarse: bool, every: int, only: str | None) -> Iterator[Case]:
    """Give the problems."""
    for kind in ("plain", "hard"):
        found = (problem.case for problem in problems(kind, only, coarse))
        yield from islice(found, 0, None, every)
    if only is None:
        yield _steep((96, 16), "0.6", "83.3333")


def run(case: Case, options: NewtonOptions) -> tuple[Solution, float]:
    """Solve a problem; return the seconds of the processor too."""
    begin = time.process_time()
    given = {name: getattr(case.solver, name) for name in ("tolerance", "linear")}
    if options.nested is None:
        given["nested"] = getattr(case.solver, "nested", None)
    solution = solve(case, options.model_copy(update=given))
    return solution, time.process_time() - begin


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve all problems with all devices, then with one of them off at a time."""
    command = parser(__doc__, "ablation")
    command.add_argument("--every", type=int, default=1, metavar="K", help="one of K problems")
    command.add_argument("--devices", nargs="+", metavar="NAME", help="parts of their names")
    command.add_argument("--only", help="a family, or one problem such as bar-7")
    given = command.parse_args(arguments)
    chosen = [
        device
        for device in (*DEVICES, *LINEAR)
        if not given.devices or any(name in device.name for name in given.devices)
    ]
    common = list(cases(given.coarse, given.every, given.only))
    own = {device.name: device.problem() for device in chosen if device.problem is not None}
    for one in own.values():
        run(one, NewtonOptions())  # loads its forms
    whole = {case.source: run(case, NewtonOptions()) for case in [*common, *own.values()]}
    rows = empty(
        "device", "lines", "failed", "slow", "seconds", "problems that need it", "literature",
    )  # fmt: skip
    for device in chosen:
        failed, slow, total = [], [], 0.0
        with device.off() as options:
            alone = own.get(device.name)
            slower = SLOW_LINEAR if alone is not None and device in LINEAR else SLOW
            for case in common if alone is None else [alone]:
                (solution, least), (found, seconds) = whole[case.source], run(case, options)
                total += seconds
                if solution.converged and not found.converged:
                    failed.append(case.source)
                elif seconds > max(slower * least, least + NOTICED):
                    slow.append(case.source)
        needed = ", ".join([*failed, *slow][:6])
        counts = len(failed), len(slow), round(total, 1)
        append(rows, device.name, device.lines, *counts, needed or "none", device.literature)
        print(device.name, *counts, needed, flush=True)
    total = sum(seconds for _, seconds in whole.values())
    unsolved = [name for name, (solution, _) in whole.items() if not solution.converged]
    note = f"{len(common)} problems, {total:.1f} s with all devices; not solved: {unsolved}"
    Report(given.out).table("ablation", "Devices of solver and linear algebra, one off", rows, note)


if __name__ == "__main__":
    main()
