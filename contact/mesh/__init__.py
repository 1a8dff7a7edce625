"""Meshes with names: parts of their boundary and regions of their cells.

- `domain`: `Domain`, `from_mesh`, `revolved`, names of parts, measures over them; `grid`:
  `rectangle`, `box`.
- `cells`: reference cells, by basix; `geometry`: Jacobians, normals, volumes; `entities`: facets,
  connected components; `owners`: nodes of other ranks.
- `transfer`: `refined`, `carry`; `deviation`: curved surfaces from straight facets.
- `reader`: `from_file`, `from_generator` for the package `meshes`; `formats`, `abaqus`: one
  function a format; `contents`: the checked contents of a file of any format.

Imports: `contact.errors`, `contact.typing`, `contact.ranks`, `contact._compat`.
"""
