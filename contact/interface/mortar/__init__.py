"""Dual mortar method: two surfaces that face each other, integrated exactly on their segments.

Nothing here but NumPy arrays of facets; `surface` knows the mesh that they come from. Each rank
integrates over its own slave facets, with master facets of others that `search` asks for, and
`contact.mesh.owners` sums up at the owners of nodes.
"""
