"""Linear systems: factorised once and solved many times, sparse or dense, direct or by multigrid.

It knows no contact: it is given a layout of unknowns, matrices and blocks at nodes.
"""
