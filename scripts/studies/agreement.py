"""Do the methods agree? Newton's, Uzawa block relaxation and, as eps -> 0, the penalty method.

Every case file is solved by each of them. Where two find different solutions, each method is
started from the other's, to show that both are solutions of the same discrete problem.

`python3 -m scripts.studies.agreement [--out DIR] [--coarse] [--only CASE...]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from contact import Solution, build_problem
from contact.methods.options import FixedPointOptions, Options, PenaltyOptions, with_method
from contact.problem.residuals import evaluate
from scripts.reporting import Report, append, empty, observed_orders, parser
from scripts.studies.agreement_examples import TOLERANCE, Example, examples
from scripts.studies.branches import AGREE, DISTURBANCE, SOLVES, Branches

#: Tolerance on the residual of the penalised problem: rounding is magnified by 1/eps.
PENALISED = 1e-9

#: eps of the penalty method, relative to the size of the solution.
EPS = {f"eps 1e-{k}": 10.0**-k for k in range(3, 8)}


@dataclass
class Compared:
    """Results of the methods on one example."""

    #: The example.
    example: Example
    #: Settings of Newton's method.
    newton: Options
    #: Its solutions.
    branches: Branches
    #: Name of a method or start -> where it has ended.
    runs: dict[str, Solution]
    #: Method, start or eps -> which solution that is, or which one is next to a penalised one.
    letters: dict[str, str]

    @property
    def several(self) -> bool:
        """Whether more than one solution has been found."""
        return len(self.branches.solutions) > 1


def compare(example: Example, coarse: bool) -> Compared:
    """Solve an example by all methods. Collective."""
    case = example.case(coarse)
    branches = Branches(build_problem(case))
    newton = case.solver
    runs = {"newton": branches.solve(newton), "uzawa": branches.solve(relaxed(newton))}
    start = branches.nested_start(case)
    if start is not None:
        runs["nested"] = branches.solve(newton, start)
    letters = {name: branches.letter(run) for name, run in runs.items()}
    last: Solution | None = None
    for name, eps in EPS.items():
        settings = penalised(branches, runs["newton"], eps)
        last = branches.solve(settings, None if last is None else last.state)
        runs[name] = last
        letters[name] = branches.letter(branches.next_to(last.state, TOLERANCE))
    return Compared(example, newton, branches, runs, letters)


def relaxed(newton: Options) -> Options:
    """Return the settings of Uzawa block relaxation: hundreds of solves by one factorisation."""
    return with_method(newton, FixedPointOptions, linear="lu")


def penalised(branches: Branches, solution: Solution, eps: float) -> Options:
    """Return the penalty method with eps relative to a solution. Collective.

    At the largest pressure the penetration is eps max|u|, and that is the slip length as well.
    """
    displacement, pressure = branches.size(solution)
    return PenaltyOptions(
        tolerance=PENALISED,
        max_outer=1000,
        linear="lu",
        eps_contact=eps * displacement / pressure,
        eps_slip=eps * displacement,
    )


def agreement(report: Report, compared: Sequence[Compared]) -> None:
    """Tabulate the differences between Newton's method and Uzawa block relaxation. Collective."""
    rows = []
    for one in compared:
        newton, uzawa = one.runs["newton"], one.runs["uzawa"]
        apart = one.branches.difference(uzawa, newton)
        dofmap = one.branches.problem.body.space.dofmap
        rows.append(
            {
                "example": one.example.label,
                "unknowns": dofmap.index_map.size_global * dofmap.index_map_bs,
                "newton": newton.outcome.residuals.largest,
                "uzawa": uzawa.outcome.residuals.largest,
                "solves": newton.counters.linear_solves,
                "uzawa's": uzawa.counters.linear_solves,
                "u": apart.u,
                "phi": apart.phi,
                "energy": apart.energy,
                "p": apart.pressure,
                "tau": apart.friction,
                "verdict": verdict(one, apart.largest),
                "solutions": len(one.branches.solutions),
                "warned": one.branches.warned(newton),
            }
        )
    report.table(
        "agreement",
        f"Newton's method and Uzawa block relaxation, both to residuals of {TOLERANCE:g}",
        rows,
        "*newton*, *uzawa*: the largest residual at the end, computed from scratch. *solves*: "
        "the linear solves of the whole body. The next columns are relative differences of the "
        "two solutions. *u*, *phi*: the largest difference at a node. *energy*: the larger one "
        "of |eps(u)| and |grad(phi)| in L2. *p*, *tau*: in L2 of Gamma_3, both over the "
        f"pressure. The verdict is `agree` where all are at most {AGREE:g}, else the letters of "
        "the two solutions in the last table. *solutions*: the number of different ones that any "
        "start or method has found here. *warned*: whether the program warns of several "
        f"solutions. Uzawa block relaxation is given up after {SOLVES} solves, and the verdict is "
        "then `not converged`. Its counts depend on rounding: `indent-ball` takes 595 to 811 "
        "solves where the displacement is up to 5e-10 larger.",
    )


def verdict(one: Compared, apart: float) -> str:
    """Return in words whether Newton's method and Uzawa block relaxation agree."""
    letters = one.letters["newton"], one.letters["uzawa"]
    if "—" in letters:
        return "not converged"
    return "agree" if apart <= AGREE else " and ".join(letters)


def limits(report: Report, compared: Sequence[Compared]) -> None:
    """Tabulate how the penalised solutions tend to those with multipliers. Collective."""
    rows = []
    for one in compared:
        runs = [one.runs[name] for name in EPS]
        near, apart = zip(*map(one.branches.nearest, runs), strict=True)
        u = [float(np.nanmax([each.u, each.phi])) for each in apart]
        p = [each.pressure for each in apart]
        rows.append(
            {
                "example": one.example.label,
                "converged": all(run.converged for run in runs),
                "limit": path(near),
                **dict(zip(EPS, u, strict=True)),
                "order": last_order(near, u),
                "p": p[-1],
                "order of p": last_order(near, p),
            }
        )
    report.table(
        "agreement-penalty",
        "The penalty method as eps -> 0: distance to the solution with multipliers",
        rows,
        "eps is relative: the penetration at the largest pressure is eps max|u|, and so is the "
        "slip length. The first eps is solved from zero displacement, each further one from the "
        f"solution of the last, to a residual of {PENALISED:g} of the penalised problem. *limit*: "
        "the closest of the solutions in the last table, to which the distances belong. A is "
        "that of Newton's method from zero; an arrow means that smaller eps are closer to "
        "another solution. The distances are the largest relative differences of u and phi at a "
        "node. *p*: at the smallest eps, the difference of the pressure in L2 of Gamma_3. Orders "
        "are those of the last step. Without friction the order is 1 throughout. With friction "
        "it tends to 1 once eps is below the slip of all sliding nodes: the friction law is "
        "rounded over the slip length, so that nodes creep that ought to stick. Without a rigid "
        "part no term is penalised.",
    )


def last_order(near: Sequence[str], apart: Sequence[float]) -> float:
    """Return the order of the last step; NaN between two solutions, or in rounding."""
    if near[-1] != near[-2] or apart[-1] < 10 * TOLERANCE:
        return np.nan
    return observed_orders(list(EPS.values())[-2:], apart[-2:])[-1]


def path(letters: Sequence[str]) -> str:
    """Return letters without repetitions, with arrows between them."""
    return " -> ".join(letter for letter, _ in groupby(letters))


def solutions(report: Report, compared: Sequence[Compared]) -> None:
    """Tabulate the solutions of the examples that have several. Collective."""
    columns = empty(
        "example", "solution", "found by", "stick", "slide", "open", "others than in A",
        "max |u_i|", "max p", "distance to A", "residual", "newton from it", "uzawa from it",
        "newton, disturbed", "uzawa, disturbed",
    )  # fmt: skip
    for one in compared:
        if not one.several:
            continue
        branches = one.branches
        first = branches.solutions["A"]
        # Disturbed starts may lead to further ones; these are not looked at in turn.
        for letter, found in list(branches.solutions.items()):
            others = int(branches.problem.comm.allreduce(np.sum(found.status != first.status)))
            append(
                columns,
                one.example.label,
                letter,
                ", ".join(name for name, to in one.letters.items() if to == letter),
                *branches.counts(found),
                others,
                *branches.size(found),
                branches.difference(found, first).largest,
                evaluate(branches.problem, found.state).largest,
                *restarted(one, found),
            )
    if columns["example"]:
        report.table(
            "agreement-branches",
            "Examples with several solutions, and who finds which",
            columns,
            "*stick*, *slide*, *open*: numbers of contact nodes; then the number of nodes "
            "that are in another state than in solution A. *distance to A*: the largest relative "
            "difference. *residual*: the largest, computed from scratch. *newton from it*, "
            "*uzawa from it*: how far each method moves from the solution if it starts there. "
            "*disturbed*: the solution at "
            f"which it ends if each node is disturbed by up to {DISTURBANCE:g} of its values. "
            "*nested*: Newton's method by way of coarser meshes; *eps*: the solution closest to "
            "the penalised one. With (7.16) mu falls from 0.6 to 0.5 as soon as a node slides by "
            "a few 1/rho. A node where |sigma_tau| lies between 0.5 and 0.6 of the pressure may "
            "therefore stick or slide. In Example 7.2 these are the node at the end of the bar "
            "and those at the tip of the sliding zone, each independently of the others. Between "
            "sticking and sliding there is a solution on the falling part of the law, which both "
            "methods leave if disturbed.",
        )


def restarted(one: Compared, found: Solution) -> tuple[object, ...]:
    """Return the ends of both methods from a solution and from a start beside it. Collective."""
    branches = one.branches
    stays, back = [], []
    for settings in (one.newton, relaxed(one.newton)):
        stays.append(branches.difference(branches.solve(settings, found.state), found))
        back.append(branches.letter(branches.solve(settings, branches.disturbed(found))))
    return (*(each.largest for each in stays), *back)


def main(arguments: Sequence[str] | None = None) -> list[Compared]:
    """Make the tables. Collective."""
    command = parser(__doc__, "agreement")
    known = examples()
    names = sorted({example.name for example in known})
    command.add_argument(
        "--only", nargs="+", choices=names, metavar="CASE", help="these case files alone"
    )
    chosen = command.parse_args(arguments)
    report = Report(chosen.out)
    wanted = [e for e in known if chosen.only is None or e.name in chosen.only]
    compared = [compare(example, chosen.coarse) for example in wanted]
    agreement(report, compared)
    limits(report, compared)
    solutions(report, compared)
    return compared


if __name__ == "__main__":
    main()
