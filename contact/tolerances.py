"""Tolerances and limits that more than one place needs."""

import sys

#: Residual of contact and friction above which a penalised solution approximates nothing.
LARGEST_VIOLATION = 0.1

#: Distance of 1 from the next larger number.
EPS = sys.float_info.epsilon

#: The least tolerance: rounding keeps relative residuals from falling below.
PRECISION = 1e-15

#: Numbers beyond this one, or below its inverse, are too near to those whose squares overflow.
HUGE = 1e150

#: Most that counts as rounding, over loads, contact forces and reactions. A beam 1000 times as
#: long as thick has 6e-6 of its loads; where it is more, too little is known of the forces.
MOST_ROUNDING = 1e-5
