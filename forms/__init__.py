"""Variational forms of frictional contact for Hencky and piezoelectric bodies.

The forms are plain UFL; stress updates at points are in NumPy (`history`, and `j2` with its return
mapping). No mesh is made, no solver is started and no MPI is initialised, so that a notebook can
import, print and differentiate the forms.
"""
