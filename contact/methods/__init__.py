"""Solution methods: each takes an initial guess of a problem to a `State` and its `Outcome`.

`newton` is the default: it condenses the body where that pays, and iterates over its material.
`semismooth` is the semismooth Newton method (primal-dual active set) on the whole body or on the
condensed one, `newton_step` one step of it. `fallbacks` has the methods after it, in order.
`method` has the protocol `Method` and the methods by name, `load_stepping` the load steps around
any of them. The fixed points, Uzawa block relaxation and penalty are in `contact.thesis`; none is
a fallback.

Parts of methods: `interior_point` with its cones, `unconstrained_modes` (rigid-body modes). For all
methods: `options` has tolerances and limits, `report` records, stagnation and outcome; `signals`
ends a solve by Ctrl-C.

The methods share, and do not define: complementarity functions and active set
(`contact.interface.complementarity`, `multipliers`), static condensation
(`contact.problem.condensed`, `contact.linear.schur`), the transformation x = C y + d
(`contact.linear.transformation`), the residuals (`contact.problem.residuals`).

Imports: `contact.problem` and the packages below it.
"""
