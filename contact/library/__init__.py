"""Materials by name: a file of the package, and the user's own.

Imports: `contact.errors`, `contact.typing` and `forms`.
"""
