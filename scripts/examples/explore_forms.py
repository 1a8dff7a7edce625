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
# tiny mesh the statements of the theory on them.

# %%
# ruff: noqa: D100, E402
import basix.ufl
import matplotlib.pyplot as plt
import numpy as np
import ufl
from mpi4py import MPI

from forms.foundation import augmentation_form
from forms.hencky import Linear, Log, energy_density, secant_form
from forms.kinematics import strain
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
