"""Two surfaces that face each other, integrated exactly piece by piece: the dual mortar method.

Nothing here but NumPy arrays of facets; `surface` alone knows the mesh that they come from.
"""
