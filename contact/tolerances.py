"""Tolerances and limits that more than one place needs."""

import sys

#: Residual of contact and friction above which a penalised solution approximates nothing.
LARGEST_VIOLATION = 0.1

#: Distance of 1 from the next larger number.
EPS = sys.float_info.epsilon

#: Rounding of a result of many operations, over its terms: 1e-13.
ROUNDING = 500 * EPS

#: Share of a length, of a motion or of an overlap that is taken for none. Positions in files have
#: ten digits and more, and an orthogonal basis knows a motion to some root of `EPS`.
NEGLIGIBLE = 1e-9

#: Overlap of two bodies, over the size of the mesh, that is rounding of positions in files.
TOUCHING = 1e-6

#: The least tolerance: rounding keeps relative residuals from falling below.
PRECISION = 1e-15

#: Share of loads, of their work or of displacements that is taken for none where bodies balance.
BALANCED = 1e-6

#: Numbers beyond this one, or below its inverse, are too near to those whose squares overflow.
HUGE = 1e150

#: Most that counts as rounding, over loads, contact forces and reactions. A beam 1000 times as
#: long as thick has 6e-6 of its loads; where it is more, too little is known of the forces.
MOST_ROUNDING = 1e-5
