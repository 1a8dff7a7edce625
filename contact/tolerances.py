"""Tolerances and limits that more than one place needs."""

import sys

#: Largest residual of contact and friction of a useful penalised solution.
LARGEST_VIOLATION = 0.1

#: Machine epsilon.
EPS = sys.float_info.epsilon

#: Relative rounding error of a sum of many terms: 1e-13.
ROUNDING = 500 * EPS

#: Relative length, motion or overlap that counts as zero: positions in files have ten digits and
#: more, and rigid-body modes from an orthogonal basis an error of about a root of `EPS`.
NEGLIGIBLE = 1e-9

#: Overlap of two bodies, over the thickness of the thinner one, that changes nothing.
TOUCHING = 1e-6

#: Overlap of two bodies, over the largest coordinate, that may be the rounding of positions in
#: files: of both bodies, in single precision. And the most of it, over the thickness of the thinner
#: one: where positions are rounded more, far from the origin, they tell too little of a body.
POSITIONS, POSITIONS_KNOWN = 2e-7, 1e-3

#: The least tolerance of relative residuals: the size of their rounding errors.
PRECISION = 1e-15

#: Relative imbalance of loads, of their work or of displacements that counts as zero.
BALANCED = 1e-6

#: Largest number, and inverse of the least one, whose squares neither overflow nor underflow.
HUGE = 1e150

#: Largest error of forces, over loads, contact forces and reactions, that counts as rounding: of a
#: beam 1000 times as long as thick it is 6e-6.
MOST_ROUNDING = 1e-5
