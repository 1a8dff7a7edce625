# ---
# jupyter:
#   jupytext:
#     formats: py:percent
# ---

# %% [markdown]
# # Parameters from measurements, and a shape for a wanted pressure
#
# With the consistent Newton matrix factorised at the solution of a contact problem, each derivative
# of a result costs a few more back-substitutions. Here derivatives identify friction and modulus
# from a noisy loop, piezoelectric constants from two indentations, and the shape of a foundation
# with 500 parameters. See [Sensitivities](../derivatives.md).

# %%
import logging

import matplotlib.pyplot as plt
import numpy as np

# before dolfinx: that of the wheels takes the library of MPI
from mpi4py import MPI  # isort: skip
from dolfinx.mesh import create_rectangle, locate_entities_boundary
from scipy.fft import dct, idct
from scipy.optimize import minimize

from contact import (
    Body,
    Contact,
    Fixed,
    Linear,
    Problem,
    gap_gradient,
    identify,
    load_case,
    solve,
)
from contact.case.file import number_at, with_number
from contact.mesh.domain import from_mesh
from scripts.cases import CASES

logging.getLogger("contact").setLevel(logging.ERROR)  # the meshes are coarse
rng = np.random.default_rng(1)


def measured(case, columns, noise=0.01):
    """Return the columns of a run with noise, relative to their largest values."""
    rows = [record.row for record in solve(case).steps]
    data = {"t": np.array([row["t"] for row in rows])}
    for name in columns:
        exact = np.array([row[name] for row in rows])
        data[name] = exact + noise * np.abs(exact).max() * rng.standard_normal(exact.size)
    return data


# %% [markdown]
# ## Friction and modulus from a fretting loop
#
# The forces on a block that is pressed, sheared and sheared back, with 1 % noise. The search starts
# from a coefficient that is half as large again, and from 70 % of the modulus.

# %%
loop = load_case(CASES / "fretting.toml", ["mesh.cells=[16,8]", "evolution.steps=[1,3,6,6]"])
data = measured(loop, ["contact_force_x", "contact_force_y"])
start = with_number(with_number(loop, "friction.mu", 0.225), "material.young", 0.7)
found = identify(start, data, ["friction.mu", "material.young"], {"friction.mu": (0.0, 1.0)})
for key, value in found.parameters.items():
    print(f"{key} = {value:.4f}, 95 % between {found.intervals[key][0]:.4f} and "
          f"{found.intervals[key][1]:.4f}; right: {number_at(loop, key):g}")  # fmt: skip
print(f"correlation {found.correlation[0, 1]:.2f}, {found.evaluations} runs")

# %%
plt.figure(figsize=(5, 3.2))
plt.plot(data["t"], data["contact_force_x"], "k.", label="measured")
plt.plot(data["t"], found.fits[0]["contact_force_x"], label="identified")
plt.xlabel("t")
plt.ylabel("tangential force")
plt.legend()
plt.tight_layout()
plt.show()

# %% [markdown]
# ## Constants of PZT-4 from two indentations
#
# The force depends on the constants differently under a grounded and under an insulating ball:
# $\partial\ln P/\partial\ln c_{33}$ is 0.89 and 0.63, and $\partial\ln P/\partial\ln e_{33}$ is
# -0.07 and 0.18. Both force curves together determine two constants, if the others are known. One
# curve alone does not: the correlation would be 1.

# %%
ball = [
    "mesh.contact_size=0.02",
    "mesh.edge_size=0.005",
    "mesh.extent=1.5",
    "mesh.size=0.3",
    'material={law="anisotropic",poling=-90.0,c11=139.0,c12=77.8,c13=74.3,c33=113.0,c44=25.6,'
    "piezo={e31=-6.98,e33=13.84,e15=13.44,beta11=6.0,beta33=5.47}}",
    "evolution={times=[0.0,1.0],steps=[3]}",
]
names = "indent-pzt4-insulating.toml", "indent-pzt4-conducting.toml"
cases = [load_case(CASES / name, ball) for name in names]
curves = [measured(case, ["contact_force_y"]) for case in cases]
keys = ["material.c33", "material.piezo.e33"]
starts = [with_number(with_number(case, keys[0], 100.0), keys[1], 11.0) for case in cases]
constants = identify(starts, curves, keys)
for key, value in constants.parameters.items():
    least, largest = constants.intervals[key]
    print(f"{key} = {value:.1f}, 95 % between {least:.1f} and {largest:.1f}")
print(f"right: 113 and 13.84; correlation {constants.correlation[0, 1]:.2f}")

# %% [markdown]
# ## The shape that gives a wanted pressure
#
# The 500 heights of a foundation under a block are sought for which the pressure is a half sine.
# The misfit and its gradient by all heights take one solution and one adjoint. `Misfit` returns its
# value, and its derivatives by the unknowns and by the contact forces.

# %%
count = 500
mesh = create_rectangle(MPI.COMM_WORLD, [[0.0, 0.0], [4.0, 1.0]], [count - 1, 8])
parts = {
    name: locate_entities_boundary(mesh, 1, lambda x, y=y: np.isclose(x[1], y))
    for name, y in (("bottom", 0.0), ("top", 1.0))
}
domain, places = from_mesh(mesh, parts), np.linspace(0.0, 4.0, count)


def pressed(heights):
    """Return the block on a foundation with gaps at 500 places."""
    body = Body(Linear(1.0, 0.3), [Fixed("top", [0.0, -0.02])])
    contact = Contact("bottom", lambda x: np.interp(x[0], places, heights))
    return solve(Problem(domain, body, contact))


def wanted(x):
    """Return the wanted pressure."""
    return 0.005 + 0.02 * np.sin(np.pi * x / 4)


class Misfit:
    """Half the square of the difference to the wanted pressure, over that of this one."""

    def difference(self, problem, state):
        """Return the difference of the pressures at the nodes."""
        size = problem.nodes.norm(wanted(problem.nodes.points[:, 0]))
        return (state.multipliers.contact - wanted(problem.nodes.points[:, 0])) / size, size

    def __call__(self, problem, state):
        """Return the value."""
        return 0.5 * problem.nodes.norm(self.difference(problem, state)[0]) ** 2

    def gradient(self, problem, state):
        """Return the derivatives by the unknowns, none, and by the contact forces."""
        difference, size = self.difference(problem, state)
        by_pressure = problem.nodes.weight * difference / size
        by_x = np.zeros_like(problem.body.owned_part(state.x))
        return by_x, by_pressure[:, None] * problem.nodes.normal


# %% [markdown]
# The pressure behaves like a derivative of the height: a wave of the foundation has an effect that
# grows with its wave number k. With the coefficients times 1 + k as unknowns a quasi-Newton method
# (L-BFGS) needs few iterations. An open node has no derivative: the ends stay open.

# %%
scale, misfit = 0.01 / (1 + np.arange(count)), Misfit()


def both(coefficients):
    """Return the misfit and its derivatives by all coefficients."""
    solution = pressed(idct(scale * coefficients, norm="ortho"))
    by_gap = gap_gradient(solution, misfit)[np.argsort(solution.problem.nodes.points[:, 0])]
    return misfit(solution.problem, solution.state), scale * dct(by_gap, norm="ortho")


shape = minimize(both, np.zeros(count), jac=True, method="L-BFGS-B", options={"maxiter": 25})
heights = idct(scale * shape.x, norm="ortho")
print(f"{shape.nfev} solutions and adjoints; relative misfit {np.sqrt(2 * shape.fun):.1e}")

# %%
last = pressed(heights)
order = np.argsort(last.problem.nodes.points[:, 0])
_, (left, right) = plt.subplots(1, 2, figsize=(8, 3.2))
left.plot(places, heights - heights.min())
left.set(xlabel="x", ylabel="gap, above its least")
right.plot(places, wanted(places), "k--", label="wanted")
right.plot(places, last.pressure[order], label="found")
right.set(xlabel="x", ylabel="pressure")
right.legend()
plt.tight_layout()
plt.show()
