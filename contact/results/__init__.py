"""The results of a solution: fields, resultants, tables, estimates, warnings.

Imports: `contact.thesis` and all that it may import.
"""
