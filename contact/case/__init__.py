"""The case file: its models, messages, and the problem of it.

`file` reads it, the sections check it (`mesh`, `material`, `body`, `interface`), each key with its
description, bounds and default in one place, and `build` makes a problem of it.
"""
