"""Whether the body of a problem is condensed onto its contact nodes."""

from __future__ import annotations

from petsc4py import PETSc

from contact.linear import multigrid
from contact.linear.operator import Counters
from contact.problem.condensed import LARGEST, PREFIX, Condensation
from contact.problem.problem import ContactProblem

#: Unknowns up to which dense steps take no time to speak of.
ALWAYS = 1000

#: How much faster dense operations are than those of a sparse factorisation, and how many more of
#: its steps Newton's method takes in the worst case.
DENSE_IS_FASTER = 50.0


def pays(problem: ContactProblem, kind: str) -> bool:
    """Tell whether dense steps at the contact nodes cost less than sparse ones of the body.

    Large bodies in space are left to multigrid, unless a direct solver is asked for by `kind`.

    A dense factorisation costs k^3 operations with k kept unknowns. A sparse one costs n b^2 with
    n unknowns and fronts of b: in the plane the body's depth, n/k nodes, in
    space some n^(1/2).
    Of a slender body the contact nodes are too large a part.
    """
    layout = problem.equilibrium.layout
    if kind == "auto" and multigrid.is_large(layout):
        return False
    kept, unknowns = problem.nodes.size * layout.block_size, layout.unknowns
    front = unknowns / kept * layout.block_size if layout.dim == 2 else unknowns**0.5
    return kept <= ALWAYS or kept**3 <= DENSE_IS_FASTER * unknowns * front**2


def condensation(problem: ContactProblem, counters: Counters, kind: str) -> Condensation | None:
    """Return the problem condensed onto its contact nodes, where that is possible. Collective.

    That is where the contact nodes are few and a direct solver has the memory, unless the user
    or his options of PETSc ask for another.
    """
    options = PETSc.Options(PREFIX)
    names = ("ksp_type", "pc_type", "pc_factor_mat_solver_type")
    chosen = any(options.hasName(name) for name in names)
    layout = problem.equilibrium.layout
    large = kind == "auto" and layout.dim == 3 and layout.unknowns > multigrid.DIRECT
    many = problem.nodes.size * layout.block_size > LARGEST
    if chosen or kind == "iterative" or large or many:
        return None
    return Condensation(problem, counters)
