"""The results of a solution: fields, resultants, tables, files, figures, warnings.

Imports: `contact.methods` and all that it may import.
"""
