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
# tiny mesh the statements of the theory on them, and draws the constitutive laws.

# %%
# ruff: noqa: D100, E402
import basix.ufl
import matplotlib.pyplot as plt
import numpy as np
import ufl

from forms.foundation import (
    augmentation_form,
    auxiliary_load,
    compliance,
    electric_contact,
    penalty,
    penalty_friction,
    penalty_pressure,
)
from forms.hencky import Linear, Log, energy_density, secant_form
from forms.kinematics import normal_part, strain, tangential_part
from forms.laws import (
    Compliance,
    PotentialFactor,
    RampConductivity,
    ShiftedConductivity,
    SlipCoefficient,
    Truncation,
)
from forms.monotonicity import check_monotonicity
from forms.piezo import coupling_number, hexagonal, saddle_form, symmetrised_form

# %% [markdown]
# ## Printing a form
#
# An abstract triangle mesh is enough to write forms down. $B(u; v, w)$ is linear in $v$ and $w$;
# its modulus is frozen at $u$. Sections and equations here are those of the thesis.

# %%
cell = "triangle"
abstract = ufl.Mesh(basix.ufl.element("Lagrange", cell, 1, shape=(2,)))
V = ufl.FunctionSpace(abstract, basix.ufl.element("Lagrange", cell, 1, shape=(2,)))
u, v, w = ufl.Coefficient(V), ufl.TrialFunction(V), ufl.TestFunction(V)
linear, hencky = Linear(1.0, 0.3), Log(1.0, 0.3, yield_strain=0.05)
print(secant_form(linear, u, v, w))
nu = ufl.FacetNormal(abstract)
print(augmentation_form(v, w, nu, 25.0))
B = secant_form(hencky, u, v, w) * ufl.dx
print("arguments:", B.arguments(), "coefficients:", B.coefficients())

# %% [markdown]
# ## Assembly
#
# The same integrands on a real, tiny mesh, with a random displacement well in the plastic range.

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
# The tangent is softer than the secant in the plastic range. Therefore the first Newton step from
# a state near zero is too long, and Kacanov's is not.

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
# ## The foundation
#
# The integrands of section 3.4 on $\Gamma_3$, here the whole boundary. Step 1 of Algorithm 2
# balances where its auxiliary unknowns are those of the body: its two sides differ by the
# multipliers alone.

# %%
nu, r, eps = ufl.FacetNormal(square), 25.0, 1e-3
normal, along, none = normal_part(u, nu), tangential_part(u, nu), ufl.zero(2)
left_side = vector(augmentation_form(u, w, nu, r) * ufl.ds)
right_side = vector(auxiliary_load(normal, along, ufl.zero(), none, w, nu, r) * ufl.ds)
assert np.linalg.norm(left_side - right_side) < 1e-13 * np.linalg.norm(left_side)

# %% [markdown]
# The penalty $\Phi/\varepsilon$ of (4.32) is the derivative of an energy. The regularised
# friction $J_\varepsilon$ of (4.33) is symmetric as long as its modulus is frozen. Its
# derivative is not: the bound follows the pressure, as Coulomb's does.

# %%
gap = ufl.as_ufl(0.01)
contact = penalty(u, w, nu, gap, eps) * ufl.ds
pressed = ufl.conditional(ufl.gt(normal, gap), normal - gap, 0.0)
by_ufl = vector(ufl.derivative(pressed**2 / (2 * eps) * ufl.ds, u, w))
assert np.linalg.norm(vector(contact) - by_ufl) < 1e-12 * np.linalg.norm(by_ufl)
bound = 0.3 * penalty_pressure(normal, gap, eps)
fixed_bound = matrix(penalty_friction(u, v, w, nu, bound, eps) * ufl.ds)
friction = ufl.derivative(penalty_friction(u, u, w, nu, bound, eps) * ufl.ds, u, v)
print(f"friction, frozen: asymmetry {asymmetry(fixed_bound):.1e}")
print(f"its derivative:   asymmetry {asymmetry(matrix(friction)):.2f}")
assert asymmetry(fixed_bound) < 1e-14

# %% [markdown]
# The pressure of the layer $j_1$ of section 6.2 grows with the potential difference to the
# foundation; the charge $l$ of (5.11) is there where the gap is nearly closed. Far in contact it
# is that of a plate capacitor: $k_e (\varphi - \varphi_F)$ times the area.

# %%
layer, grows = Compliance(0.5), PotentialFactor(1.0, 2.0, 0.6)
press = [
    vector(compliance(u, w, nu, layer, grows, gap, ufl.as_ufl(s)) * ufl.ds) for s in (0.0, 0.6)
]
print(f"the layer presses {np.linalg.norm(press[1]) / np.linalg.norm(press[0]):.1f} times as hard")
potentials = fem.functionspace(square, ("Lagrange", 1))
phi, xi = fem.Function(potentials), ufl.TestFunction(potentials)
phi.x.array[:] = 3.0
psi, phi_l = ShiftedConductivity(2.0, 4.0), Truncation(np.inf)
flow = electric_contact(nu, phi, xi, nu, psi, phi_l, gap, 1.0)  # u = nu, far in contact
charge = vector(flow * ufl.ds).sum()
print(f"charge {charge:.3f}: 2 (3 - 1) on four sides")
assert np.isclose(charge, 16.0)

# %% [markdown]
# ## Piezoelectric bodies
#
# The saddle form of (5.16) is positive and not symmetric; with the electric test function
# negated, (5.27), it is symmetric and indefinite.

# %%
crystal = hexagonal(-5.4, 15.8, 12.3, 8.1387, 7.3746)
material = crystal.in_plane()
ceramic = Linear(58.7102, 0.3)
# In the plane the crystal is poled along y; how strongly it couples does not depend on that.
assert np.allclose(material.e, crystal.poled_along([0.0, 1.0, 0.0]).e)
assert np.isclose(coupling_number(ceramic, material), coupling_number(ceramic, crystal))
print(f"without electrodes it is up to {coupling_number(ceramic, crystal):.0%} stiffer")
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
# Hencky's law (7.8): the modulus falls in the plastic range while the stress keeps rising, which is
# strong monotonicity. Taken with the *square* of the norm as its argument, it softens.

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
