"""The case file: its models, messages, and the problem of it.

`file` reads it, the sections check it, each key with its description, bounds and default in one
place, and `build` makes a problem of it. The keys of `[mesh]` are in `mesh`; of `[material]` in
`material`; of `[space]`, supports, loads, rigid parts, electrodes and bolts in `body`; of
`[contact]`, `[friction]` and `[electric]` in `interface`; of `[evolution]` in `evolution`. Those of
`[solver]` are `contact.methods.options`, those of `[output]` `contact.results.options`.
"""
