"""Meshes with named parts: where they come from, refinement, transfer between them.

Imports: `contact.errors`, `contact.typing`, `contact._compat`.
"""
