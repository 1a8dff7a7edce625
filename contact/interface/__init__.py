"""Gamma_3: the contact nodes and their jump, mortar coupling, and the laws.

Imports: `contact.body` and the packages above it. Every law is stated once, node by node.

Where to find
-------------
complementarity functions, their residuals and generalised derivative
    `complementarity`, with the parameters c and gamma of Newton's method
    (`ComplementarityParameters`); that of the residuals is `interface.Interface.c_r`.
active set (open, stick, slip)
    `multipliers`: `ActiveSet` and `constraint_active`, its only definition.
all laws together
    `interface.Interface`: normal gap, slip, pressure, friction bound, forces on the body.
friction
    `friction`, with the coefficients of `forms.laws`, and the non-local operator R.
layer and charge
    `foundation.FoundationLaw`; `NormalGraph` is the layer with the rigid part behind it;
    `grouping`: the laws of several contacts as one.
jump, lumped surface mass
    `nodes.ContactNodes`, of both kinds of contact; `nodes.Geometry` of one contact.
contact forces, slip history
    `multipliers`.
contact nodes and their geometry at a place
    in front of a rigid foundation `placing`, of another body `pairing`.
mortar coupling
    `mortar`: `search` of the facets opposite on all ranks, `coupling` (D and M, by integrals over
    `segments`), `operator` (their application), `lumping` (areas of nodes); the deviation of curved
    surfaces from their chords is in `contact.mesh.deviation`. Each rank has the rows of its nodes.
"""
