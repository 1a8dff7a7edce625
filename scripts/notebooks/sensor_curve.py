# ---
# jupyter:
#   jupytext:
#     formats: py:percent
# ---

# %% [markdown]
# # A contact sensor
#
# A piezoelectric body lies between an electrode and a table with friction. The charge of the
# short-circuited electrode, or the potential of the open one, measures the load; this notebook
# draws the curve. `scripts/examples/sensor.py` does so for any case file.

# %%
import matplotlib.pyplot as plt
import numpy as np

from contact import build_problem, load_case
from contact.results.resultants import sensor
from scripts.cases import CASES
from scripts.examples.sensor import opened, readings
from scripts.reporting import solved

case = load_case(CASES / "piezo-sensor.toml", ["mesh.cells=[16, 8]"])
print(case.title)

# %%
factors = (0.5, 1.0, 2.0, 3.0)
charges = [reading.charge for reading in readings(case, "electrode", factors)]
potentials = [r.potential for r in readings(opened(case, "electrode"), "electrode", factors)]
figure, axes = plt.subplots(1, 2, figsize=(7, 3), layout="constrained")
for ax, values, label in zip(axes, (charges, potentials), ("charge", "potential"), strict=True):
    ax.plot((0.0, *factors), (0.0, *values), "o-")
    ax.set(xlabel="load / load of the case", ylabel=label)
plt.show()

# %% [markdown]
# The sensitivity changes as the material yields:

# %%
for factor, charge in zip(factors, charges, strict=True):
    print(f"load x {factor}: charge per load {charge / factor:.5g}")

# %% [markdown]
# A single reading in three steps: build, solve, read.

# %%
problem = build_problem(case).at(1.0)
solution = solved(case, problem)
reading = sensor(solution.problem, solution.state, "electrode")
assert np.isclose(reading.charge, charges[1], rtol=1e-8)
reading
