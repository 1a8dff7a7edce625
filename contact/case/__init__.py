"""The case file: its models, messages, and the problem of it.

`file` reads and writes it, the sections check it, each key with its description, bounds and default
in one place, and `build` makes a problem of it. The keys of `[mesh]` are in `mesh`, of `[space]` in
`file`; those of `[solver]` are `contact.methods.options`, those of `[output]`
`contact.results.options`, all others in `contact.model`.
"""
