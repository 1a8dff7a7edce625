"""The cylinder on a block of NAFEMS R0094-1 (SSNP154 of code_aster), checked by other means.

code_aster takes finite rotations: St. Venant and Kirchhoff's law in the undeformed configuration
(`finite`, node to segment with penalties, nothing of this package but its mesh). Friction between
unlike materials has no closed form: two half planes by boundary elements (`half_planes`).

python3 -m scripts.studies.cylinder_block [--out DIR] [--coarse]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from scipy import sparse
from scipy.sparse.linalg import spsolve

from contact import build_problem, load_case
from contact.mesh.domain import Domain
from contact.typing import Array
from scripts.cases import CASES
from scripts.reporting import Report, append, empty, solved
from scripts.studies.hertz_exact import line_contact
from scripts.studies.two_bodies import ALUMINIUM, RADIUS, STEEL, middle

#: Force of the whole cylinder (N/mm), and Young's moduli (N/mm^2); Poisson's ratio is 0.3.
FORCE, MODULI = 35e3, {"cylinder": 210e3, "block": 70e3}

#: How far the middle of the block's top moves in code_aster (V6.04.154), for each mu.
CODE_ASTER = {0.0: -1.3069, 0.1: -1.3026}

#: Penalty (N/mm^3), for some 4e-4 mm of penetration, and where it is rounded off (mm).
PENALTY, ROUNDED = 1e7, 1e-5

#: Steps in which the load grows.
STEPS = 8


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables."""
    report = Report.of(__doc__, "cylinder_block", arguments)
    size = 1.2 if report.coarse else 0.6
    depth(report, size, rotations(report, size))
    friction(report, 100 if report.coarse else 400)


def rotations(report: Report, size: float) -> float:
    """Tabulate the depth without and with finite rotations; return how much these add to it."""
    rows = empty("load", "contact elements (mm)", "without")
    rows |= {"with rotations": [], "more (%)": []}
    for length, share in ((2 * size, 1.0), (size, 1.0), (size, 0.5), (size, 0.25)):
        domain = build_problem(case(length, share)).domain
        linear, turned = (finite(domain, share, finitely) for finitely in (False, True))
        append(rows, share, length, linear, turned, f"{100 * (turned / linear - 1):.2f}")
    report.table(
        "cylinder-block-rotations",
        "Depth u_y (mm) of the middle of the block's top, linear and with finite rotations",
        rows,
        "Without friction; degree 2, node-to-segment contact in plain UFL, on the mesh of this "
        "package.",
    )
    return float(rows["more (%)"][1]) / 100


def depth(report: Report, size: float, more: float) -> None:
    """Tabulate the depth beside that of code_aster, which has finite rotations."""
    rows = empty("mu", "linear", "code_aster", "apart (%)")
    rows |= {"with rotations": [], "then apart (%)": []}
    for mu, published in CODE_ASTER.items():
        ours = middle(solved(case(size, 1.0, "space.degree=2", f"friction.mu={mu}")))
        turned = ours * (1 + more)
        apart = [f"{100 * (value / published - 1):.1f}" for value in (ours, turned)]
        append(rows, mu, ours, published, apart[0], turned, apart[1])
    report.table(
        "cylinder-block-depth",
        "The same depth beside code_aster, which has finite rotations",
        rows,
        "Linear: this package, degree 2. With rotations: 2.65 % more, the effect of finite "
        "rotations in the table of depths with and without them.",
    )


def friction(report: Report, count: int) -> None:
    """Tabulate two half planes with friction."""
    rows = empty("mu", "steps", "a", "p_0", "stick")
    for mu, steps in ((0.0, 1), (0.1, 1), (0.1, 32)):
        append(rows, mu, steps, *half_planes(mu, count, steps))
    report.table(
        "cylinder-block-friction",
        "Two half planes of steel and aluminium, pressed on each other in steps",
        rows,
        f"By {count} boundary elements; a in mm, p_0 in MPa. stick: share of the contact that "
        "sticks.",
    )


def case(size: float, share: float, *changes: str) -> Any:
    """Return the case at a share of the load, without friction unless changes say so."""
    load = f"load.0.traction=[0.0, {-350.0 * share}]"
    all_changes = (f"mesh.contact_size={size}", "friction.mu=0.0", load, *changes)
    return load_case(CASES / "cylinder-on-block.toml", all_changes)


def finite(domain: Domain, share: float, rotations: bool, degree: int = 2) -> float:
    """Return how far the middle of the block's top moves."""
    mesh = domain.mesh
    space = fem.functionspace(mesh, ("Lagrange", degree, (2,)))
    u, v = fem.Function(space), ufl.TestFunction(space)
    young = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    for name, value in MODULI.items():
        young.x.array[domain.cells(name)] = value
    lam, mu = young * 0.3 / (1.3 * 0.4), young / 2.6
    gradient = ufl.grad(u)
    deformed = ufl.Identity(2) + gradient if rotations else ufl.Identity(2)
    strain = ufl.sym(gradient)
    if rotations:
        strain = (deformed.T * deformed - ufl.Identity(2)) / 2
    stress = lam * ufl.tr(strain) * ufl.Identity(2) + 2 * mu * strain
    load = fem.Constant(mesh, 0.0)
    inner = ufl.inner(deformed * stress, ufl.grad(v)) * domain.dx
    residual = fem.form(inner + load * v[1] * domain.ds("top"))
    tangent = fem.form(ufl.derivative(inner, u))
    x = space.tabulate_dof_coordinates()[:, :2]
    fixed = np.zeros(x.shape, dtype=bool)
    fixed[nodes(domain, space, "symmetry"), 0] = True
    fixed[nodes(domain, space, "block_bottom")] = True
    free = np.flatnonzero(~fixed)
    slaves, masters = (ordered(x, nodes(domain, space, part)) for part in ("arc", "block_top"))
    slaves = slaves[: 2 * (np.count_nonzero(x[slaves, 0] < 0.3 * RADIUS) // 2) + 1]
    weight = PENALTY * areas(x[slaves], degree)
    for step in range(1, STEPS + 1):
        load.value = 350.0 * share * step / STEPS
        moved = x + u.x.array.reshape(-1, 2)
        place = np.searchsorted(moved[masters, 0], moved[slaves, 0], side="right") - 1
        edges = masters[np.clip(place, 0, masters.size - 2)[:, None] + [0, 1]]
        for _ in range(40):
            moved = x + u.x.array.reshape(-1, 2)
            forces, stiffness = contact(moved, slaves, edges, weight)
            forces += fem_petsc.assemble_vector(residual).array
            matrix = fem_petsc.assemble_matrix(tangent)
            matrix.assemble()
            starts, columns, values = matrix.getValuesCSR()
            total = sparse.csr_matrix((values, columns, starts), shape=stiffness.shape) + stiffness
            change = spsolve(total[free][:, free].tocsc(), forces[free])
            u.x.array[free] -= change
            if np.abs(change).max() < 1e-9 * RADIUS:
                break
        else:
            raise RuntimeError("Newton's method has not converged")
    return float(u.x.array[2 * masters[0] + 1])


def nodes(domain: Domain, space: fem.FunctionSpace, part: str) -> Array:
    """Return the nodes of a part."""
    return fem.locate_dofs_topological(space, 1, domain.facets(part))


def ordered(x: Array, chosen: Array) -> Array:
    """Return nodes by x."""
    return chosen[np.argsort(x[chosen, 0])]


def areas(points: Array, degree: int) -> Array:
    """Return the weights of the nodes of a chain: the trapezoidal rule, or Simpson's."""
    lengths = np.linalg.norm(np.diff(points[::degree], axis=0), axis=1)
    weights = np.zeros(len(points))
    for begin in (0, degree):
        weights[begin : begin + degree * lengths.size : degree] += lengths / (2, 6)[degree - 1]
    if degree == 2:
        weights[1::2] = 2 * lengths / 3
    return weights


def contact(
    moved: Array, slaves: Array, edges: Array, weight: Array
) -> tuple[Array, sparse.csr_matrix]:
    """Return forces and stiffness of penalties on the deformed gaps g.

    g is the height of a node of the arc above the line through an edge of the block's top, shape
    (slaves, 2); its second derivatives are left out. The pressure k <-g> is rounded off at g = 0.
    """
    left, right = edges.T
    width = moved[right, 0] - moved[left, 0]
    share = (moved[slaves, 0] - moved[left, 0]) / width
    slope = (moved[right, 1] - moved[left, 1]) / width
    gap = moved[slaves, 1] - (1 - share) * moved[left, 1] - share * moved[right, 1]
    one = np.ones_like(gap)
    parts = [-slope, one, slope * (1 - share), share - 1, slope * share, -share]
    columns = np.column_stack([2 * n + i for n in (slaves, left, right) for i in (0, 1)])
    root = np.hypot(gap, ROUNDED)
    rows = np.repeat(np.arange(gap.size), 6)
    gradient = sparse.csr_matrix(
        (np.column_stack(parts).ravel(), (rows, columns.ravel())), shape=(gap.size, moved.size)
    )
    forces = gradient.T @ (weight * (gap - root) / 2)
    stiffness = weight * (1 - gap / root) / 2
    return forces, (gradient.T @ sparse.diags(stiffness) @ gradient).tocsr()


def half_planes(mu: float, count: int, steps: int = 1) -> tuple[float, float, float]:
    """Return half width, largest pressure and the share that sticks, by constant elements.

    The force grows in steps, in each of which friction acts on the slip since the last.

    With p on both and q on the block they move, relative to each other off and along the surface,

        w = -c int p ln|x - s| ds + b int sgn(x - s) q ds,
        t = -c int q ln|x - s| ds - b int sgn(x - s) p ds

    (Johnson, Contact Mechanics, 1985, (2.25)), c = 2/(pi E*) and b the difference of
    (1 - 2 nu)(1 + nu)/(2 E).
    """
    modulus = 1 / (1 / STEEL + 1 / ALUMINIUM)
    c = 2 / (np.pi * modulus)
    b = 0.4 * 1.3 / 2 * (1 / MODULI["block"] - 1 / MODULI["cylinder"])
    ends = np.linspace(-1.2, 1.2, count + 1) * line_contact(FORCE, modulus, RADIUS)[0]
    x, h = (ends[1:] + ends[:-1]) / 2, ends[1] - ends[0]
    offset = x[:, None] - ends
    primitive = offset * (np.log(np.abs(offset)) - 1)
    along = -c * (primitive[:, :-1] - primitive[:, 1:])
    across = b * h * np.sign(x[:, None] - x)
    zero, n = np.zeros((count, count)), np.arange(count)
    moves = np.block([[along, across], [-across, along]])
    closed, sticks, sign = np.ones(count, dtype=bool), np.ones(count, dtype=bool), np.sign(x)
    before = np.zeros(count)
    for force in FORCE * np.arange(1, steps + 1) / steps:
        for _ in range(100):
            # Unknown are p, q and the approach.
            matrix, rhs = np.zeros((2 * count + 1, 2 * count + 1)), np.zeros(2 * count + 1)
            matrix[:-1, :-1] = np.block([[np.eye(count), zero], [zero, np.eye(count)]])
            rows = n[closed]
            matrix[rows, :-1], matrix[rows, -1] = moves[rows], -1.0
            rhs[rows] = -(x[rows] ** 2) / (2 * RADIUS)
            rows = n[closed & sticks]
            matrix[count + rows, :-1], rhs[count + rows] = moves[count + rows], before[rows]
            rows = n[closed & ~sticks]
            matrix[count + rows, rows] = -mu * sign[rows]
            matrix[-1, :count], rhs[-1] = h, force
            solution = np.linalg.solve(matrix, rhs)
            p, q, approach = solution[:count], solution[count:-1], solution[-1]
            w, t = (moves @ solution[:-1]).reshape(2, -1)
            gap = w + x**2 / (2 * RADIUS) - approach
            trial = q - modulus / RADIUS * (t - before)
            new = p - modulus / RADIUS * gap > 0, np.abs(trial) <= mu * p, np.sign(trial)
            if all(np.array_equal(*pair) for pair in zip(new[:2], (closed, sticks), strict=True)):
                break
            closed, sticks, sign = new
        else:
            raise RuntimeError("the active set still changes")
        before = t
    a = 2 * np.sqrt(np.sum(p * x**2) / np.sum(p))
    return float(a), float(p.max()), float(np.sum(closed & sticks) / np.sum(closed))


if __name__ == "__main__":
    main()
