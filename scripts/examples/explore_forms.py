# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # The forms, by themselves
#
# `forms` is plain UFL: it makes no mesh, starts no solver and initialises no MPI. This notebook
# (open it with jupytext, or run it as a script) prints the weak forms, checks by assembly on a
# tiny mesh what the theory says of them, and draws the constitutive laws.

# %%
# ruff: noqa: D100, E402
import basix.ufl
import matplotlib.pyplot as plt
import numpy as np
import ufl

from forms.foundation import augmented_lagrangian
from forms.hencky import Linear, Log, energy_density, secant_form
from forms.kinematics import strain
from forms.laws import (
    Compliance,
    PotentialFactor,
    RampConductivity,
    ShiftedConductivity,
    SlipCoefficient,
)
from forms.monotonicity import check_monotonicity
from forms.piezo import hexagonal, saddle_form, symmetrised_form

# %% [markdown]
# ## Printing a form
#
# An abstract triangle mesh is enough to write forms down. $B(u; v, w)$ of section 3.4 is linear
# in $v$ and $w$; its modulus is frozen at $u$.

# %%
cell = "triangle"
abstract = ufl.Mesh(basix.ufl.element("Lagrange", cell, 1, shape=(2,)))
V = ufl.FunctionSpace(abstract, basix.ufl.element("Lagrange", cell, 1, shape=(2,)))
u, v, w = ufl.Coefficient(V), ufl.TrialFunction(V), ufl.TestFunction(V)
linear, hencky = Linear(1.0, 0.3), Log(1.0, 0.3, yield_strain=0.05)
print(secant_form(linear, u, v, w))
nu = ufl.FacetNormal(abstract)
print(augmented_lagrangian(v, w, nu, 25.0))
B = secant_form(hencky, u, v, w) * ufl.dx
print("arguments:", B.arguments(), "coefficients:", B.coefficients())

# %% [markdown]
# ## What assembly tells
#
# The same integrands on a real, tiny mesh, with a random displacement well beyond yield.

# %%
from dolfinx import fem, mesh
from mpi4py import MPI

square = mesh.create_unit_square(MPI.COMM_SELF, 3, 3)
space = fem.functionspace(square, ("Lagrange", 1, (2,)))
u, v, w = fem.Function(space), ufl.TrialFunction(space), ufl.TestFunction(space)
u.x.array[:] = 0.1 * np.random.default_rng(1).standard_normal(u.x.array.size)


def matrix(form: ufl.Form) -> np.ndarray:
    """Assemble a small bilinear form."""
    return fem.assemble_matrix(fem.form(form)).to_dense()


def vector(form: ufl.Form) -> np.ndarray:
    """Assemble a small linear form."""
    return fem.assemble_vector(fem.form(form)).array


def asymmetry(a: np.ndarray) -> float:
    """Return |A - A^T| / |A|."""
    return float(np.linalg.norm(a - a.T) / np.linalg.norm(a))


secant = matrix(secant_form(hencky, u, v, w) * ufl.dx)
tangent = matrix(ufl.derivative(secant_form(hencky, u, u, w) * ufl.dx, u, v))
print(f"secant form: asymmetry {asymmetry(secant):.1e}")
print(f"tangent:     asymmetry {asymmetry(tangent):.1e}")
assert asymmetry(secant) < 1e-14
assert asymmetry(tangent) < 1e-14

# %% [markdown]
# $B(u; u, w)$ is the derivative of the energy $\int M(\varepsilon(u))$, which UFL can form
# itself; its second derivative is the consistent tangent.

# %%
energy = energy_density(hencky, strain(u)) * ufl.dx
by_hand = vector(secant_form(hencky, u, u, w) * ufl.dx)
by_ufl = vector(ufl.derivative(energy, u, w))
print(f"B(u; u, .) against dM/du: {np.linalg.norm(by_hand - by_ufl):.1e}")
assert np.linalg.norm(by_hand - by_ufl) < 1e-13
hessian = matrix(ufl.derivative(ufl.derivative(energy, u, w), u, v))
assert np.linalg.norm(hessian - tangent) < 1e-12

# %% [markdown]
# The tangent is softer than the secant beyond yield. This is why the first Newton step from a
# state near zero goes too far, and Kacanov's does not.

# %%
plastic = np.sort(np.linalg.eigvalsh(tangent))[3:]  # without the rigid motions
frozen = np.sort(np.linalg.eigvalsh(secant))[3:]
print(f"softest tangent / softest secant: {plastic[0] / frozen[0]:.2f}")
assert np.all(plastic > 0)
figure, axes = plt.subplots()
axes.semilogy(frozen, "o", ms=3, label="secant")
axes.semilogy(plastic, "s", ms=3, label="tangent")
axes.set(xlabel="mode", ylabel="eigenvalue")
_ = axes.legend()

# %% [markdown]
# ## Piezoelectric bodies
#
# The saddle form of (5.16) is positive and not symmetric; with the electric test function
# negated, (5.27), it is symmetric and indefinite.

# %%
material = hexagonal(-5.4, 15.8, 12.3, 8.1387, 7.3746).in_plane()
ceramic = Linear(58.7102, 0.3)
mixed = fem.functionspace(square, ("Lagrange", 1, (3,)))
x, y, z = fem.Function(mixed), ufl.TrialFunction(mixed), ufl.TestFunction(mixed)


def fields(f: ufl.core.expr.Expr) -> tuple[ufl.core.expr.Expr, ufl.core.expr.Expr]:
    """Split into displacement and potential."""
    return ufl.as_vector([f[0], f[1]]), f[2]


arguments = (ceramic, material, fields(x)[0], *fields(y), *fields(z))
saddle = matrix(saddle_form(*arguments) * ufl.dx)
symmetrised = matrix(symmetrised_form(*arguments) * ufl.dx)
values = np.linalg.eigvalsh(symmetrised)
print(f"saddle form: asymmetry {asymmetry(saddle):.2f}")
print(f"symmetrised: asymmetry {asymmetry(symmetrised):.1e},")
print(f"{np.sum(values > 1e-9)} positive and {np.sum(values < -1e-9)} negative eigenvalues")
assert asymmetry(symmetrised) < 1e-14
assert np.linalg.eigvalsh(saddle + saddle.T).min() > -1e-9

# %% [markdown]
# ## The laws
#
# Hencky's law (7.8): the modulus falls beyond yield while the stress keeps rising, which is
# assumption (h1). Read with the *square* of the norm as its argument, it softens.

# %%
t = np.linspace(0, 0.4, 401)
square_law = Log(1.0, 0.3, yield_strain=0.05, argument="square")
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3))
for law, label in ((linear, "linear"), (hencky, "norm"), (square_law, "square")):
    g = law.secant_modulus(t**2)
    left.plot(t, g, label=label)
    right.plot(t, 2 * g * t, label=label)
    print(label, check_monotonicity(law, 0.6))
left.set(xlabel="|dev eps|", ylabel="g")
right.set(xlabel="|dev eps|", ylabel="|dev sigma|")
_ = right.legend()

# %% [markdown]
# Friction coefficient (7.16), conductivities (1.34), and the compliant layer of section 8.1.2.
# Each law is written once and serves UFL and NumPy.

# %%
s = np.linspace(-1, 1, 401)
slip = np.geomspace(1e-9, 1, 200)
figure, panels = plt.subplots(1, 3, figsize=(12, 3))
for rho in (1e5, 1e6, 1e7, 6e7):
    panels[0].semilogx(slip, SlipCoefficient(0.5, 0.2, rho)(slip), label=f"rho = {rho:g}")
panels[1].plot(s, RampConductivity(1.0, 4.0)(s), label="as printed")
panels[1].plot(s, ShiftedConductivity(1.0, 4.0)(s), label="shifted to the closing gap")
panels[2].plot(s, Compliance(0.5)(s), label="p_nu, n_nu = 0.5")
panels[2].plot(s, PotentialFactor(1.0, 2.0, 0.6)(s), label="h_nu, s_0 = 0.6")
for panel, label in zip(panels, ("|u_tau|", "u_nu - rho", "argument"), strict=True):
    panel.set(xlabel=label)
    panel.legend(fontsize=7)

# %%
f = fem.Function(fem.functionspace(square, ("Lagrange", 1)))
f.x.array[:] = np.linspace(0, 1e-4, f.x.array.size)
mu = SlipCoefficient(0.5, 0.2, 1e5)
vertices = ufl.dx(square, metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})
test = ufl.TestFunction(f.function_space)
nodal = vector(mu(f) * test * vertices) / vector(test * vertices)
assert np.allclose(nodal, mu(f.x.array), rtol=1e-13)
print("mu in a form and in NumPy agree")
