"""Meshes with names: parts of their boundary and regions of their cells.

- `domain`: `Domain`, `from_mesh`, `revolved`; `parts`: names of parts; `integrals`: measures and
  forms over them; `grid`: `rectangle`, `box`.
- `cells`: reference cells, by basix; `geometry`: Jacobians, normals, volumes; `entities`: facets,
  connected components; `owners`: nodes of other ranks.
- `transfer`: `refined`, `carry`; `deviation`: curved surfaces from straight facets.
- `reader`: `from_file` and its table of formats, `from_generator` for the package `meshes`; one
  file a format; `contents`: their results; `validity`: checks of these.

Imports: `contact.errors`, `contact.typing`, `contact.ranks`, `contact._compat`.
"""
