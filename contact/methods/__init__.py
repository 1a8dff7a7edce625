"""Solvers: from a state of a problem to another one, and how that went.

Imports: `contact.problem` and what that may import; what they are told stands in `options`.
"""
