"""Contact with given friction bounds as a convex problem, and Coulomb's law over it.

Dense, node by node, in NumPy and SciPy alone: nothing here knows a mesh or a rank.
"""
