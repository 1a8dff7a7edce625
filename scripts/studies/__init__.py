"""Numerical studies: convergence, limits, agreement of the methods."""
