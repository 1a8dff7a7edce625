# ---
# jupyter:
#   jupytext:
#     formats: py:percent
# ---

# %% [markdown]
# # A ball pressed into steel, and lifted off
#
# A rigid ball of radius 10 mm is pressed into steel that yields at 250 MPa, to ten times the depth
# of first yield, and lifted. With `law = "j2"` plastic strain remains, and with it an impression, a
# rim and residual stress.

# %%
import matplotlib.pyplot as plt
import numpy as np

from contact import load_case, solve
from contact.results.fields import DerivedFields
from scripts.cases import CASES

sizes = ["mesh.contact_size=0.015", "mesh.edge_size=0.015"]
case = load_case(CASES / "ball-in-steel.toml", sizes)
solution = solve(case)
print(solution.outcome.reason)
print(f"largest equivalent plastic strain {solution.equivalent_plastic_strain:.4f}")

# %% [markdown]
# Loading and unloading are different curves: the force is zero before the ball is back.

# %%
depth = 1e3 * np.array([0.0, *(-step.row["rigid_y"] for step in solution.steps)])
force = np.abs([0.0, *(step.row["contact_force_y"] for step in solution.steps)])
plt.figure(figsize=(5, 3.5))
plt.plot(depth, force, "o-", ms=3)
plt.xlabel("depth of the ball (µm)")
plt.ylabel("force (N)")
plt.show()
plastic = sum(step.row["plastic_dissipation"] for step in solution.steps)
print(f"{plastic:.2e} N mm are lost to plastic flow")
assert force[-1] == 0 and plastic > 0

# %% [markdown]
# The surface after the ball is lifted: the impression, and the rim around it.

# %%
nodes, body = solution.problem.nodes, solution.problem.body
radius = nodes.points[:, 0]
order = np.argsort(radius)
height = 1e3 * body.nodal(solution.state.x)[nodes.nodes, 1]
plt.figure(figsize=(6, 3))
plt.plot(radius[order], height[order], ".-")
plt.axhline(0.0, color="0.7", lw=0.8)
plt.xlabel("r (mm)")
plt.ylabel("height (µm)")
plt.show()
print(f"mark {-height.min():.3f} µm deep, rim {height.max():.3f} µm high")
assert height.min() < -0.1

# %% [markdown]
# The residual stress is compressive across the axis below the impression, where the elastic part of
# the body compresses the plastic zone.

# %%
fields = DerivedFields(body, solution.state).nodes()
places = fields["stress"].function_space.tabulate_dof_coordinates()
axis = np.flatnonzero(np.abs(places[:, 0]) < 1e-9)
axis = axis[np.argsort(-places[axis, 1])]
axis = axis[places[axis, 1] > -0.3]
stress = fields["stress"].x.array.reshape(-1, 3, 3)[axis]
strain = fields["equivalent_plastic_strain"].x.array[axis]
figure, (left, right) = plt.subplots(1, 2, figsize=(7, 3), sharex=True)
left.plot(-places[axis, 1], stress[:, 0, 0], label="radial")
left.plot(-places[axis, 1], stress[:, 1, 1], label="axial")
left.set(xlabel="depth on the axis (mm)", ylabel="residual stress (MPa)")
left.legend()
right.plot(-places[axis, 1], strain)
right.set(xlabel="depth on the axis (mm)", ylabel="equivalent plastic strain")
figure.tight_layout()
plt.show()
assert np.abs(stress).max() > 25
