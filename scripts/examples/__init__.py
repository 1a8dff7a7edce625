"""Examples to read first, each on its own; `make NAME` runs one.

`own_material`: a secant modulus of your own in place of the case's law.
`own_contact`: a friction coefficient and an obstacle of your own.
`refinement`: errors and their orders on finer and finer meshes, with a figure.

Longer: `sensor`, with any case and electrode, and `explore_forms`, a notebook of the forms.
"""
