"""Sizes of the parts and regions of a domain."""

import ufl
from dolfinx import fem


def integral(domain, measure, integrand=1.0):
    """Return an integral over all ranks."""
    form = fem.form(ufl.as_ufl(integrand) * fem.Constant(domain.mesh, 1.0) * measure)
    return domain.comm.allreduce(fem.assemble_scalar(form))


def measures(domain):
    """Return the length or area of each part."""
    return {name: integral(domain, domain.ds(name)) for name in domain.parts}
