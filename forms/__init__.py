"""Variational forms of frictional contact for Hencky and piezoelectric bodies.

Everything here is plain UFL: no mesh is made, no solver is started and no MPI is
initialised, so that a notebook can import, print and differentiate the forms.
"""
