"""A contact problem: a body and its interface put together, its state, and its residuals.

Imports: `contact.interface`, `contact.body` and the packages that these may import.
"""
