"""Solution methods: each takes an initial guess of a problem to a `State` and its `Outcome`.

`newton` is the semismooth Newton method (primal-dual active set) with its order of fallbacks:
all nodes open and a `working_set`, then `continuation`, `unconstrained_modes`, `interior_point`,
and the condensed body where that was not the first. `newton_loop` iterates its
steps: `newton_step` on the whole body, `condensed_step` on the body condensed onto its contact
nodes, with `chord` steps. `thesis` has fixed points, Uzawa block relaxation and penalty, on which
Newton's method does not fall back; `load_stepping` is the quasi-static load stepping around any
method.

Parts of methods: `cones` (slacks and multipliers of the interior point), `conductivity_derivative`
(Newton or Picard in the conductivity) and `stagnation`. For all methods: `method` is their
protocol, `options` has tolerances and limits, `complementarity_parameters` c, r and gamma, `report`
the history and the outcome; `signals` ends a solve by Ctrl-C.

The methods share, and do not define: complementarity functions and active set
(`contact.interface.complementarity`, `active_set`), static condensation
(`contact.problem.condensed`, `contact.linear.schur`), the constraint x = C y + d
(`contact.linear.constraint`), the residuals (`contact.problem.residuals`).

Imports: `contact.problem` and the packages below it.
"""
