"""Solution methods: from a state of a problem to another one, and how that went.

`newton` is the semismooth Newton method, with `interior_point` and `continuation` as its fallbacks;
`thesis` has fixed points, Uzawa block relaxation and penalty; `load_stepping` is the quasi-static
load stepping around any of them. Tolerances and parameters are in `options`.

Imports: `contact.problem` and the packages below it.
"""
