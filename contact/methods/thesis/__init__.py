"""Algorithms 1 to 9 of the thesis: fixed points, Uzawa block relaxation, penalty.

Newton's method does not fall back on them.
"""
