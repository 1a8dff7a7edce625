"""Dual mortar method: two surfaces that face each other, integrated exactly on their segments.

Nothing here but NumPy arrays of facets; `surface` knows the mesh that they come from, `operator`
the ranks.
"""
