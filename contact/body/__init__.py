"""One deformable body: its unknowns, supports and loads, and its equilibrium at a state.

Imports: `contact.model` and the packages below these.
"""
