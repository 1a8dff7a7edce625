# ---
# jupyter:
#   jupytext:
#     formats: py:percent
# ---

# %% [markdown]
# # Fretting: press, then back and forth
#
# Friction depends on the loading path. A block is pressed on a foundation, then moved back and
# forth; its ends slip, its middle sticks, and the force over the displacement is a loop. Its area
# is the work of a cycle.

# %%
import matplotlib.pyplot as plt
import numpy as np

from contact import load_case, solve
from scripts.cases import CASES

changes = ["mesh.cells=[32, 16]", "evolution.steps=[2, 8, 12, 12]", "friction.mu=0.12"]
case = load_case(CASES / "fretting.toml", changes)
solution = solve(case)
print(solution.outcome.reason)
rows = [record.row for record in solution.steps]
print(len(rows), "steps")

# %%
moved = np.array([row["driven_x"] for row in rows])
force = np.array([row["driven_force_x"] for row in rows])
time = np.array([row["t"] for row in rows])
plt.figure(figsize=(5, 3.5))
plt.plot(moved, force, "o-", ms=3)
plt.xlabel("displacement of the top")
plt.ylabel("force that drives it")
plt.show()

# %% [markdown]
# The area of the loop is dissipated by friction, and stored in the body where the cycle does not
# end as it began (try `friction.mu=0.3`). The difference tends to zero as the steps are refined:

# %%
dissipated = np.array([row["dissipation"] for row in rows])
cycle = time >= 2.0
area = np.trapezoid(force[cycle], moved[cycle])
heat = dissipated[cycle][1:].sum()
stored = np.array([row["energy"] for row in rows])[cycle]
change = stored[-1] - stored[0]
print(f"loop {area:.4e}, dissipation {heat:.4e}, change of the stored energy {change:.4e}")
assert abs(area - heat - change) < 0.02 * heat

# %%
slip = [row["slip_nodes"] for row in rows]
stick = [row["stick_nodes"] for row in rows]
plt.figure(figsize=(6, 3))
plt.stackplot(time, stick, slip, labels=["sticking", "sliding"])
plt.xlabel("t")
plt.ylabel("contact nodes")
plt.legend(loc="lower right")
plt.show()
