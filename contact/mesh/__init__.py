"""Meshes with names: parts of their boundary and regions of their cells.

`domain`: `Domain`, and `from_mesh` for a dolfinx mesh; `grid`: `rectangle`, `box`, their `Piece`;
`reader`: `from_msh` for Gmsh files and `from_recipe` for the package `meshes`; `refinement`:
`refined`; `transfer`: `carry`; `pieces`: `connected_pieces`.

Imports: `contact.errors`, `contact.typing`, `contact._compat`.
"""
