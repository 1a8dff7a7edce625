"""Algorithms 1 to 9 of the thesis: fixed points, Uzawa block relaxation, penalty.

`fixed_point` over `uzawa`, and `penalty`; both are an `OuterLoop` (`fixed_point`). Newton's method
does not fall back on them. By default they end by the residuals, the relaxation accelerated;
docs/algorithms.md has the options for the algorithms as printed. Numbers such as (3.45) are those
of equations of the thesis.

References
----------
Mandyly, Contact problems with Coulomb friction in elasto-plasticity and electro-elasto-plasticity
for Hencky type materials, doctoral thesis, University Sultan Moulay Slimane, Beni Mellal (2020).
"""
