"""From a case to a problem: what each section of the case stands for, put together.

Imports: `contact.case`, `contact.problem` and what these may import.
"""

from contact.build.problem import build_problem, named

__all__ = ["build_problem", "named"]
