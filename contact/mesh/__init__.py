"""Meshes with names: parts of their boundary and regions of their cells.

`domain`: `Domain`, `from_mesh` for a dolfinx mesh, and `revolved`; `grid`: `rectangle`, `box`,
their `Piece`; `reader`: `from_file` for files, `from_msh` for those of Gmsh, and `from_generator`
for the package `meshes`; `cells`, `geometry`: the shapes of cells, and their sizes; `transfer`:
`refined` and `carry`; `entities`: facets, connected components; `owners`: values of
nodes that other ranks own.

Imports: `contact.errors`, `contact.typing`, `contact.ranks`, `contact._compat`.
"""
