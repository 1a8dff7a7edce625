"""Which problems need each device of solver and linear algebra: one of them off at a time.

`make ablation ARGS="[--out DIR] [--coarse] [--devices NAME ..]"`. Problems are the plain and the
hard ones, and Example 8.4 with a steep ramp; --coarse takes a tenth. Other devices have a class of
problems of their own. One whose row shows no problem, neither failed nor slow, is to go
(CONTRIBUTING.md). Slow is 1.5 times as long; of linear algebra, on a problem of its own, 1.1 times.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias
from unittest.mock import patch

import numpy as np

from contact import Case, NewtonOptions, Solution, build_problem, load_case, parse_case, solve
from contact.linear import multigrid, schur
from contact.methods import fallbacks, interior_point, newton_step, safeguards, semismooth
from contact.methods.report import Outcome
from contact.methods.unconstrained_modes import UnconstrainedModes
from contact.problem.residuals import evaluate
from scripts.benchmarks import bench_one
from scripts.cases import CASES, on_grid
from scripts.reporting import Report, append, empty, parser
from scripts.studies.robustness.one_body import Tables, case, elastic, grid, sliding
from scripts.studies.robustness.problems import Problem, problems
from tests.methods.test_belt import wall
from tests.methods.test_slender import TIP, UNIFORM, beam, on_the_ground

#: Times as long as with the device, and seconds more, from which on a problem counts as slow.
SLOW, NOTICED = 1.5, 0.1

#: The same of a device of linear algebra.
SLOW_LINEAR = 1.1


def drawn(kind: str, name: str, seed: int | None = None, **mesh: Any) -> Problem:
    """Return a random problem, on another mesh if need be."""
    found = next(problems(kind, name, folder=Path(tempfile.mkdtemp()), seed=seed))
    if not mesh:
        return found
    tables = {**found.tables, "mesh": found.tables["mesh"] | mesh}
    return Problem(f"finer {name}", tables, parse_case(tables, source=name))


def layer(part: float) -> Tables:
    """Return a block on a layer that the load presses to a part of its limit."""
    law = {"law": "compliance", "stiffness": 500.0, "limit": 3e-3, "layer": np.inf}
    load = {"on": "top", "pressure": part * 500.0 * 3e-3}
    fixed, mesh = [{"on": "left", "symmetry": "x"}], grid([2.0, 1.0], [6, 3])
    return case(mesh, elastic(1000.0, 0.0), fixed, {"on": "bottom", **law}, sliding(0.0), load)


def soft_block(stiffness: float) -> Tables:
    """Return a block on a layer that is stiffer, solved by multigrid."""
    law = {"law": "compliance", "stiffness": stiffness, "limit": 3.0 / stiffness, "layer": 0.05}
    fixed = [{"on": "left", "symmetry": "x"}, {"on": "back", "symmetry": "y"}]
    return case(
        grid([2.0, 1.0, 1.0], [16, 8, 8]), elastic(6.0, 0.05), fixed, {"on": "bottom", **law},
        sliding(0.0), {"on": "top", "pressure": 0.1}, solver={"linear": "iterative"},
    )  # fmt: skip


def steep(cells: tuple[int, int] = (96, 16), k_e: str = "0.6", delta: str = "83.3333") -> Case:
    """Return Example 8.4 with a steep ramp of the conductivity."""
    changes = "solver.method=newton", f"electric.k_e={k_e}", f"electric.delta={delta}"
    return on_grid("compliance-8-4", cells, *changes)


def pulled_strip() -> Tables:
    """Return a pressed strip, clamped at one end and pulled at the other: half of it slides."""
    loads = {"on": "top", "traction": [0.0, -1e-3]}, {"on": "right", "traction": [0.015, 0.0]}
    return {**beam(100.0, [1600, 16], {}, 0.0, 0.3), "load": [*loads]}


def charged_pair(size: float) -> Tables:
    """Return two piezoelectric bodies below a plate, with a current across both contacts."""
    coupling = {"e31": -0.3, "e33": 0.8, "e15": 0.6, "beta11": 1.0, "beta33": 0.9}
    return {
        "mesh": {"generator": "two_blocks", "lower_size": size, "upper_size": 0.73 * size},
        "material": elastic(piezo=coupling),
        "fixed": [{"on": "lower_left", "displacement": [0.0, "free"]}],
        "rigid": [{"on": "upper_top", "displacement": [0.002, "free"], "force": [0.0, -0.02]}],
        "electrode": [{"on": "upper_top", "charge": 0.003}],
        "contact": [
            {"on": "upper_bottom", "against": "lower_top", "friction": sliding(0.3),
             "electric": {"k_e": 2.0, "delta": 5.0}},
            {"on": "lower_bottom", "friction": sliding(0.1),
             "electric": {"k_e": 1.0, "delta": 5.0}},
        ],
        "solver": {"linear": "iterative", "tolerance": 1e-9},
    }  # fmt: skip


Made: TypeAlias = Problem | Case | Tables


def beams() -> Iterator[Made]:
    """Make slender bodies that touch a stop, on one mesh as of a file, and one on the ground."""
    for degree, mu, cells in product((1, 2), (0.0, 0.3), ([400, 4], [800, 8])):
        yield beam(100.0, cells, TIP, 0.5, mu, solver={"nested": False}, space={"degree": degree})
    yield beam(100.0, [1600, 16], TIP, 0.5, 0.3, solver={"nested": False})
    yield on_the_ground()


def finer(*chosen: tuple[str, list[int]]) -> Iterator[Made]:
    """Make plain problems on finer meshes."""
    for name, cells in chosen:
        yield drawn("plain", name, cells=cells)


def of_kind(kind: str, *names: str, seed: int | None = None) -> Iterator[Made]:
    """Draw random problems by their names."""
    for name in names:
        yield drawn(kind, name, seed)


def single(made: Callable[[], Made]) -> Callable[[], Iterator[Made]]:
    """Return a class of one problem."""
    return lambda: iter([made()])


#: Classes of problems beside the common ones, for devices that these do not need.
CLASSES: dict[str, Callable[[], Iterator[Made]]] = {
    "beams": beams,
    # Bodies that roll, that part, and that jaws hold (docs/robustness.md).
    "rings": partial(of_kind, "bodies", "rings-0", "rings-5", "rings-6", "rings-9", "rings-20"),
    "out of loads": partial(of_kind, "bodies", "rings-12", "rings-23", "stacks-45"),
    "snap fits": partial(of_kind, "bodies", *(f"snap_fits-{k}" for k in (0, 1, 2, 17, 19, 24))),
    "wedges": partial(of_kind, "bodies", "wedges-16", seed=211),
    "belts": partial(of_kind, "held", "belt-1", "belt-8", "belt-9"),
    "walls": lambda: (wall(2, load) for load in (1.01, 1.05, 1.2)),
    "finer": partial(
        finer, ("bar-24", [128, 32]), ("bar-67", [640, 160]), ("piezo-7", [64, 32]),
        ("piezo-32", [128, 64]), ("block-4", [16, 8, 8]), ("block-33", [24, 12, 12]),
    ),
    # Near the limit of the layer.
    "layers": lambda: (layer(part) for part in (0.9, 0.95, 0.99)),
    # Layers that are stiffer than the body, solved by multigrid.
    "stiff layers": lambda: (soft_block(k) for k in (500.0, 1500.0, 5000.0)),
    # Example 8.4 with a foundation that conducts ten times as well, or more.
    "conducting": lambda: (
        steep(cells, k_e, "8.3333")
        for cells in ((24, 4), (48, 8), (96, 16)) for k_e in ("6.0", "20.0")
    ),
    "charged pairs": lambda: (charged_pair(size) for size in (0.3, 0.24, 0.18, 0.15, 0.12)),
    "pulled strip": single(pulled_strip),
    # A cantilever most of which lies on the ground, and that is condensed.
    "lying": single(partial(beam, 100.0, [500, 20], UNIFORM, 0.5, space={"degree": 2})),
    # Those of the benchmark (docs/benchmarks.md).
    "block-16": single(partial(bench_one.block, 16)),
    "plane-256": single(partial(bench_one.problem_case, 2, 256, "solver.nested=false")),
    "piezo-column": single(
        partial(load_case, CASES / "piezo-column.toml", ["mesh.cells=[20, 20, 40]"])
    ),
}  # fmt: skip


def class_of(name: str) -> list[Problem]:
    """Return the problems of one of the `CLASSES`."""
    problems = []
    for number, made in enumerate(CLASSES[name]()):
        if not isinstance(made, Problem):
            title = f"{name} {number}"
            case = made if isinstance(made, Case) else parse_case(made, source=title)
            made = Problem(title, {}, case)
        problems.append(made)
    return problems


@dataclass(frozen=True)
class Device:
    """A part of the method that can be switched off."""

    #: Its replacements: owner, name, value.
    changes: tuple[tuple[Any, str, Any], ...] = ()
    #: The class of problems that need it, of `CLASSES`; none for the common ones.
    own: str = ""
    #: Option that switches it off.
    option: tuple[str, Any] | None = None

    @contextmanager
    def off(self) -> Iterator[NewtonOptions]:
        """Switch it off; yield the options."""
        with ExitStack() as stack:
            for owner, name, value in self.changes:
                stack.enter_context(patch.object(owner, name, value))
            yield NewtonOptions(**dict([self.option] if self.option else []))


def _off(owner: Any, name: str, value: Any = lambda *_, **__: None, own: str = "") -> Device:
    """Return a device that a function which does nothing, or another value, takes the place of."""
    return Device(((owner, name, value),), own)


def _no_fallback(method: Any, *_: Any) -> tuple[Any, Outcome]:
    residuals = evaluate(method.problem, method.last)
    return method.last, Outcome(residuals, method.options.allowed, "no interior point")


def _linearised(old: Callable[..., Any]) -> Callable[..., Any]:
    """Return the layer linearised about the displacement alone."""

    def plain(interface: Any, nodal: Any, state: Any, of: Any, full: bool) -> Any:
        multipliers = replace(state.multipliers, contact=0.0 * state.multipliers.contact)
        layer = interface.foundation.layer_pressure(nodal)
        about = replace(state, multipliers=multipliers, layer_pressure=layer)
        return old(interface, nodal, about, of, full)

    return plain


def _never(*_: Any) -> bool:
    return False


#: Their literature is in docs/algorithms.md, or said here.
DEVICES = {
    "interior point": _off(fallbacks, "interior_point", _no_fallback),
    "updates of the friction bound": _off(interior_point, "UPDATES", 1),
    "friction bound of Newton's last steps": _off(interior_point, "PROGRESS", 0.0, "wedges"),
    "limit analysis of the friction bound": _off(UnconstrainedModes, "overloaded", _never, "walls"),
    "rigid motion to a state without contact": _off(fallbacks, "rigid_motion", own="out of loads"),
    # Guyan 1965
    "steps on the condensed body at last": _off(fallbacks, "on_condensed_body"),
    "secants of a layer": _off(fallbacks, "layer_secants", own="layers"),
    "proximal points": _off(fallbacks, "proximal_points", own="belts"),
    "continuation in the conductivity": _off(fallbacks, "conductivity_continuation"),
    "estimate of the stiffness from the first step": _off(
        semismooth, "_overestimates_stiffness", _never, "beams"
    ),
    "Levenberg-Marquardt regularisation": _off(safeguards, "REGULARISATION", 0.0, "rings"),
    "forcing term that tightens": _off(newton_step, "STAGNANT", 10**9, "charged pairs"),
    "layer linearised where its law is met": _off(
        newton_step, "linearised_layer", _linearised(newton_step.linearised_layer), "stiff layers"
    ),
    "limited softening": Device((), "finer", ("softening", float("inf"))),
    "sliding nodes at their bound": _off(
        safeguards, "at_bound", lambda _, friction, *__: friction, "finer"
    ),
    "derivative of the conductivity by the gap": _off(
        safeguards.ConductivityDerivative, "__call__", _never
    ),
    "stagnation limit of the continuation": _off(
        fallbacks, "CONTINUATION_LIMIT", None, "conducting"
    ),
    "zero displacement where nothing acts": _off(
        semismooth.ConvergenceMonitor, "_loss_of_contact", own="snap fits"
    ),
    "working set of contact nodes, from all open": _off(fallbacks, "all_open", own="beams"),
}

#: Ways to solve the linear systems: one with a problem of its own is needed from SLOW_LINEAR on.
LINEAR = {
    "nested iteration": Device((), "pulled strip", ("nested", False)),
    "material left as it was linearised last": _off(newton_step, "SMALL", 0.0, "block-16"),
    "chord steps": Device((), "plane-256", ("reuse", "never")),
    # Guyan 1965
    "static condensation": Device(option=("condense", False)),
    # Golub and Van Loan 2013, as the next one
    "Cholesky factors of a condensed body": _off(
        schur, "dpotrf", lambda *_, **__: (None, 1), "lying"
    ),
    "elimination of unknowns without contact": _off(
        schur, "_cholesky", lambda _, rows: (np.zeros((0, 0)), int(rows.size > 0)), "lying"
    ),
    # Karlin, Manasse, Rudolph and Sleator 1988
    "coarse levels kept from step to step": _off(multigrid, "PRICE", 0, "block-16"),
    "interpolation that follows contact nodes": Device(
        ((multigrid.StiffNodes, "follow", lambda *_: None),
         (multigrid.StiffNodes, "local_correction", lambda _, rhs: rhs.duplicate())), "block-16",
    ),
    # Silvester and Wathen 1994
    "piezoelectric block preconditioner": _off(
        multigrid, "LARGE", {**multigrid.LARGE, (3, True): 10**9}, "piezo-column"
    ),
}  # fmt: skip


def timed(problem: Problem, options: NewtonOptions) -> tuple[Solution, float]:
    """Solve a problem; return the seconds of the processor too."""
    begin, case = time.process_time(), problem.case
    given = {name: getattr(case.solver, name) for name in ("tolerance", "linear")}
    if options.nested is None:
        given["nested"] = getattr(case.solver, "nested", None)
    domain = problem.domain
    made = case if domain is None else build_problem(case, domain.mesh.comm, domain=domain)
    return solve(made, options.model_copy(update=given)), time.process_time() - begin


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve all problems with all devices, then with one of them off at a time."""
    command = parser(__doc__, "ablation")
    command.add_argument("--devices", nargs="+", default=[""], help="parts of their names")
    given = command.parse_args(arguments)
    chosen = {
        name: device
        for name, device in (DEVICES | LINEAR).items()
        if any(part in name for part in given.devices)
    }
    common = [one for kind in ("plain", "hard") for one in problems(kind, coarse=given.coarse)]
    common.append(Problem("compliance-8-4", {}, steep()))
    owned = {name: class_of(name) for name in {device.own for device in chosen.values()} - {""}}
    every = [problem for problems in owned.values() for problem in problems]
    for problem in every:
        timed(problem, NewtonOptions())  # loads its forms
    whole = {one.name: timed(one, NewtonOptions()) for one in [*common, *every]}
    rows = empty("device", "failed", "slow", "seconds", "problems that need it")
    for name, device in chosen.items():
        failed, slow, total = [], [], 0.0
        slower = SLOW_LINEAR if device.own and name in LINEAR else SLOW
        with device.off() as options:
            for problem in owned.get(device.own, common):
                (solution, least), (found, seconds) = whole[problem.name], timed(problem, options)
                total, limit = total + seconds, max(slower * least, least + NOTICED)
                if solution.converged and not found.converged:
                    failed.append(problem.name)
                # Other load makes single runs slow.
                elif seconds > limit and timed(problem, options)[1] > limit:
                    slow.append(problem.name)
        needed = ", ".join([*failed, *slow][:6]) or "none"
        append(rows, name, len(failed), len(slow), round(total, 1), needed)
        print(name, len(failed), len(slow), round(total, 1), needed, flush=True)
    total = sum(seconds for _, seconds in whole.values())
    unsolved = [name for name, (solution, _) in whole.items() if not solution.converged]
    note = f"{len(common)} problems, {total:.1f} s with all devices; not solved: {unsolved}"
    Report(given.out).table("ablation", "Devices of solver and linear algebra, one off", rows, note)


if __name__ == "__main__":
    main()
