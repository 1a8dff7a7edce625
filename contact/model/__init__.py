"""The description of a problem, made in Python or read from a case file: one class of each.

`material` has materials, `units` systems of units, `body` supports, loads, electrodes and bolts,
`rigid` rigid parts, `contact` contacts with their `obstacle`, `friction` and `foundation` (layer,
conductivity), `evolution` load steps; `fields` and `formula` have given functions of position and
time, `section` tables and kinds of values, `messages` their errors.

Imports: `contact.mesh` and the packages below these.
"""
