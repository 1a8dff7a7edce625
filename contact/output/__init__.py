"""What a solution says and leaves: fields, balances, tables, files, figures, warnings.

Imports: `contact.methods` and what that may import.
"""
