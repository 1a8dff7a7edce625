# ---
# jupyter:
#   jupytext:
#     formats: py:percent
# ---

# %% [markdown]
# # Indentation: a sphere presses on a half space
#
# A body of revolution is solved on its half plane, x the radius and y the axis. A rigid sphere,
# free to move along the axis, is pressed on it by a force. Depth and contact radius are compared
# with Hertz's for a half space.

# %%
import matplotlib.pyplot as plt
import numpy as np

from contact import parse_case, solve

RADIUS, YOUNG, POISSON, SIZE = 10.0, 1000.0, 0.3, 8.0


def indentation(force: float, cells: int = 64) -> dict:
    """Return the case of a force, of totals over the full turn."""
    return {
        "mesh": {"generator": "rectangle", "size": [SIZE, SIZE], "cells": [cells, cells]},
        "space": {"kinematics": "axisymmetric"},
        "material": {"young": YOUNG, "poisson": POISSON},
        "fixed": [{"on": "bottom", "displacement": [0.0, 0.0]}],
        "contact": {
            "on": "top",
            "foundation": {"shape": "sphere", "centre": [0.0, SIZE + RADIUS], "radius": RADIUS},
            "rigid": {"displacement": [0.0, "free"], "force": [0.0, -force]},
        },
    }


solution = solve(parse_case(indentation(100.0)))
print(solution.outcome.reason, solution.contact_force)

# %%
solution.plot()

# %% [markdown]
# The pressure beside Hertz's, p = p₀ √(1 - r²/a²) with a³ = 3 F R / (4 E*), p₀ = 3 F / (2 π a²).

# %%
modulus = YOUNG / (1 - POISSON**2)
a = (3 * 100.0 * RADIUS / (4 * modulus)) ** (1 / 3)
p0 = 3 * 100.0 / (2 * np.pi * a**2)
contact = solution.contact
r = contact.points[:, 0]
order = np.argsort(r)
plt.figure(figsize=(6, 3))
plt.plot(r[order], contact.pressure[order], "o-", ms=3, label="computed")
x = np.linspace(0, a, 100)
plt.plot(x, p0 * np.sqrt(1 - (x / a) ** 2), "k--", label="Hertz")
plt.xlim(0, 3 * a)
plt.xlabel("r")
plt.ylabel("pressure")
plt.legend()
plt.show()
print(
    f"a = {a:.3f} = {a / (SIZE / 64):.1f} cells; peak {contact.pressure.max():.1f}, Hertz {p0:.1f}"
)

# %% [markdown]
# The contact area, the sum of tributary areas, is π a² up to half a cell. Over the force:

# %%
forces = np.array([30.0, 100.0, 300.0])
areas = [solve(parse_case(indentation(force))).contact_area for force in forces]
hertz = np.pi * (3 * forces * RADIUS / (4 * modulus)) ** (2 / 3)
plt.figure(figsize=(5, 3))
plt.loglog(forces, areas, "o", label="computed")
plt.loglog(forces, hertz, "k--", label="Hertz")
plt.xlabel("force")
plt.ylabel("area in contact")
plt.legend()
plt.show()
assert np.all(np.abs(np.array(areas) / hertz - 1) < 0.25)
assert abs(contact.pressure.max() / p0 - 1) < 0.05
