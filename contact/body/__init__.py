"""One deformable body: its unknowns, supports and loads, and its equilibrium at a state.

Imports: `contact.linear`, `contact.mesh` and the packages below these.
"""
