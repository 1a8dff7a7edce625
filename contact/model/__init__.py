"""The description of a problem, made in Python or read from a case file: one class of each.

`body` has a body with its supports, loads, electrodes and bolts, `material` materials, `units`
systems of units, `rigid` rigid parts, `contact` contacts with their `obstacle`, `friction` and
`foundation` (layer, conductivity), `evolution` load steps; `fields` and `formula` have given
functions of position and time, `section` tables and kinds of values, `messages` their errors.

Imports: `contact.mesh` and the packages below these.
"""
