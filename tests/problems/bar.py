"""The case file of a bar on a rigid foundation, and its tables with changes."""

import tomllib

BAR = """\
title = "Bar on a rigid foundation"
[mesh]
generator = "rectangle"
origin = [0.0, 0.0]
size = [4.0, 1.0]
cells = [8, 2]
[mesh.parts.loaded]
side = "top"
from = 2.0
to = 4.0
[space]
degree = 1
[material]
law = "log"
young = 1.0
poisson = 0.3
yield_strain = 0.05
[[fixed]]
on = "left"
displacement = [0.0, 0.0]
[[load]]
on = "loaded"
traction = [0.0, -0.005]
[contact]
on = "bottom"
law = "signorini"
gap = 0.0
[friction]
law = "coulomb"
mu = { law = "slip", a = 0.5, b = 0.2, rho = 1e4 }
radius = 0.0
[solver]
method = "newton"
tolerance = 1e-8
"""


def changed(**changes):
    """Return the tables of the bar with some values replaced: ``a__b=value``, None removes."""
    data = tomllib.loads(BAR)
    for path, value in changes.items():
        *parents, last = path.split("__")
        place = data
        for key in parents:
            place = place[int(key)] if isinstance(place, list) else place.setdefault(key, {})
        if value is None:
            del place[last]
        else:
            place[int(last) if isinstance(place, list) else last] = value
    return data
