"""What the sections of a case stand for: the parts of which `contact.build` makes a problem.

Imports: `contact.case`, `contact.problem` and what these may import.
"""
