"""Derivatives of results, and parameters from measurements.

`by_parameters` solves the linearised equations at a solution (tangent) or their transpose
(adjoint), `by_fields` has the gradients of a result by all values of a field; `identification` fits
parameters to measured values.
"""
