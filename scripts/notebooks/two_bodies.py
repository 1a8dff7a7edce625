# ---
# jupyter:
#   jupytext:
#     formats: py:percent
# ---

# %% [markdown]
# # Two bodies: a steel cylinder on a block of aluminium
#
# Parts of one mesh may touch each other: `[contact] against = ...`. A mortar method in between lets
# their meshes be as they are. The example is NAFEMS's R0094-1, half of it by symmetry.

# %%
import matplotlib.pyplot as plt
import numpy as np

from contact import load_case, solve
from scripts.cases import CASES

case = load_case(CASES / "cylinder-on-block.toml", ["mesh.contact_size=1.0", "friction.mu=0"])
solution = solve(case)
print(solution.outcome.reason)

# %%
solution.plot()

# %% [markdown]
# Hertz's line contact, of both moduli together: the half width a and the largest pressure.

# %%
force, radius = 35e3, 50.0  # N a millimetre of the whole cylinder, mm
modulus = 1 / ((1 - 0.3**2) / 210e3 + (1 - 0.3**2) / 70e3)
a = np.sqrt(4 * force * radius / (np.pi * modulus))
p0 = 2 * force / (np.pi * a)
contact = solution.contact
x = contact.points[:, 0]
order = np.argsort(x)
plt.figure(figsize=(6, 3))
plt.plot(x[order], contact.pressure[order], "o-", ms=3, label="computed")
s = np.linspace(0, a, 100)
plt.plot(s, p0 * np.sqrt(1 - (s / a) ** 2), "k--", label="Hertz")
plt.xlim(0, 2 * a)
plt.xlabel("x (mm)")
plt.ylabel("pressure (MPa)")
plt.legend()
plt.show()
print(f"half width {a:.2f} mm; peak {contact.pressure.max():.0f} MPa, Hertz {p0:.0f} MPa")
assert abs(contact.pressure.max() / p0 - 1) < 0.1

# %% [markdown]
# What one body exerts on the other balances the load of its half:

# %%
print(solution.contact_force, solution.reaction("block_bottom"))
assert np.isclose(abs(solution.contact_force[1]), force / 2, rtol=0.02)
