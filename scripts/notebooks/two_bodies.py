# ---
# jupyter:
#   jupytext:
#     formats: py:percent
# ---

# %% [markdown]
# # Two bodies: a steel cylinder on a block of aluminium
#
# Parts of one mesh may touch each other, `[contact] against = ...`, on meshes that need not match
# (mortar method). The example is NAFEMS R0094-1, half of it by symmetry.

# %%
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import pyvista

from contact import load_case, solve, write_outputs
from scripts.cases import CASES

case = load_case(CASES / "cylinder-on-block.toml", ["mesh.contact_size=1.0", "friction.mu=0"])
solution = solve(case)
print(solution.outcome.reason)

# %%
solution.plot()

# %% [markdown]
# Both sides in the deformed state, each with its own nodes: in the contact they are one line, and
# beyond it they separate.

# %%
with TemporaryDirectory() as folder:
    write_outputs(solution, folder)
    names = {"contact-against.vtu": ("block", "s-"), "contact.vtu": ("cylinder", "o-")}
    sides = {name: pyvista.read(f"{folder}/{name}") for name in names}
plt.figure(figsize=(6, 3))
for name, (body, style) in names.items():
    side = sides[name]
    x, y = (side.points + side["displacement"])[:, :2].T
    order = np.argsort(x)
    plt.plot(x[order], y[order], style, ms=3, label=body)
plt.xlim(0, 12)
plt.ylim(-1.35, -0.35)
plt.xlabel("x (mm)")
plt.ylabel("y (mm)")
plt.legend()
plt.show()

# %% [markdown]
# Hertz's line contact with the modulus of both bodies: half width a and largest pressure.

# %%
force, radius = 35e3, 50.0  # N a millimetre of the whole cylinder, mm
modulus = 1 / ((1 - 0.3**2) / 210e3 + (1 - 0.3**2) / 70e3)
a = np.sqrt(4 * force * radius / (np.pi * modulus))
p0 = 2 * force / (np.pi * a)
contact = solution.contact
print(f"half width {contact.weight[contact.status != 'open'].sum():.2f} mm, Hertz {a:.2f} mm")
print(f"largest pressure {contact.pressure.max():.0f} MPa, Hertz {p0:.0f} MPa")
assert abs(contact.pressure.max() / p0 - 1) < 0.1

# %% [markdown]
# The force of one body on the other balances the load of its half:

# %%
print(solution.contact_force, solution.reaction("block_bottom"))
assert np.isclose(abs(solution.contact_force[1]), force / 2, rtol=0.02)
