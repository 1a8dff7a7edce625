# ---
# jupyter:
#   jupytext:
#     formats: py:percent
# ---

# %% [markdown]
# # First contact
#
# A soft block is pressed on a rigid table and pushed sideways. This notebook finds the parts of its
# bottom that stick and slide: a problem in ten lines of Python, its solution, and a check by hand.

# %%
import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

from contact import Body, Contact, Fixed, Friction, Linear, Problem, solve
from contact.mesh.grid import rectangle

domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (32, 16))
sorted(domain.parts)

# %% [markdown]
# The top is moved by 0.005 down and by 0.002 to the side; the bottom lies on the table, with
# Coulomb friction.

# %%
rubber = Linear(10.0, 0.3)
body = Body(rubber, [Fixed("top", [0.002, -0.005])])
problem = Problem(domain, body, Contact("bottom"), Friction(mu=0.3))
solution = solve(problem)
print(solution.outcome.reason, solution.contact_force)

# %%
solution.plot()

# %% [markdown]
# All nodes touch; the middle sticks, the ends slide. The friction stress is bounded by μ p, and
# reaches the bound where the block slides:

# %%
contact = solution.contact
friction = np.linalg.norm(contact.friction, axis=1)
plt.figure(figsize=(6, 3))
plt.plot(contact.points[:, 0], friction, label="friction stress")
plt.plot(contact.points[:, 0], 0.3 * contact.pressure, "--", label="μ p")
plt.xlabel("x")
plt.legend()
plt.show()

# %% [markdown]
# By hand: the forces on the block balance. Without friction the block is in uniaxial stress, with
# the strain 0.005 and the modulus of plane strain, E/(1 - ν²).

# %%
np.testing.assert_allclose(solution.reaction("top"), solution.contact_force, rtol=1e-7)

supports = [Fixed("top", ["free", -0.005]), Fixed("left", [0.0, "free"])]
smooth = solve(Problem(domain, Body(rubber, supports), Contact("bottom")))
by_hand = 2.0 * 10.0 / (1 - 0.3**2) * 0.005
print(-smooth.contact_force[1], by_hand)
assert np.isclose(-smooth.contact_force[1], by_hand, rtol=1e-8)

# %% [markdown]
# The share that slides falls as the coefficient grows:

# %%
coefficients = (0.1, 0.2, 0.3, 0.5, 0.8)
shares = []
for mu in coefficients:
    found = solve(Problem(domain, body, Contact("bottom"), Friction(mu=mu))).contact
    shares.append(found.weight[found.status == "slip"].sum() / found.weight.sum())
plt.figure(figsize=(6, 3))
plt.plot(coefficients, shares, "o-")
plt.xlabel("μ")
plt.ylabel("share that slides")
plt.show()
assert shares == sorted(shares, reverse=True)
