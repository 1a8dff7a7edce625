"""Gamma_3: the contact nodes and their jump, rigid shapes, mortar coupling, and the laws.

Imports: `contact.body` and the packages above it. Every law is stated once, node by node.

Where to find
-------------
complementarity functions, their residuals and generalised derivative
    `complementarity`, with the parameters c and gamma (`ComplementarityParameters`).
active set (open, stick, slip)
    `active_set`: `ActiveSet` and `touching` are its only definition.
all laws together
    `interface.Interface`: opening, slip, pressure, friction bound, forces on the body.
friction
    `friction`, with the coefficients of `forms.laws`; `smoothing` has the non-local operator R.
layer and current
    `law.InterfaceLaw`; `layer` describes normal compliance.
penalised laws
    `penalised`.
jump, lumped surface mass
    `nodes.ContactNodes`, of both kinds of contact.
contact forces, slip history
    `multipliers`.
contact nodes
    in front of a rigid foundation `placing`, of another body `pairing`; of several contacts
    `entries`.
mortar coupling
    `mortar`: `search` finds the facets opposite, on whatever rank, `coupling` integrates the dual
    operator over their `segments`, `operator` applies it, `lumping` has the areas of nodes;
    `contact.mesh.deviation` has the distance of a curved surface from its chords. Each rank has the
    rows of its own nodes.
rigid shapes
    `obstacle`: `protocol` is the base class of shapes, which `shapes` and `triangles` are.
"""
