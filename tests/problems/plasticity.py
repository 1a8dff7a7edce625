"""Bodies in homogeneous states of plasticity, and these states by an integration of their own."""

import numpy as np
from scipy.optimize import root

from contact import parse_case
from contact.results.fields import DerivedFields

FAR = 100.0


def homogeneous(kind, material, times, values, *, degree=1, cells=2, **more):
    """Return the case of a unit block whose top moves by given values at given times.

    `kind` is "plane" (plane strain between smooth plates, free sides), "space" (the same in 3-D),
    "oedometer", "oedometer-space", "oedometer-revolved", "uniaxial" (in 3-D) or "revolved" (a
    cylinder in uniaxial stress). It stands on a foundation in the oedometer; else the contact part
    touches nothing.
    """
    space = kind in ("space", "uniaxial", "oedometer-space")
    revolved = "revolved" in kind
    dim, up = (3, 2) if space else (2, 1)
    free = ["free"] * dim
    where = {"bottom": {up: 0.0}, "top": {up: 1.0}}
    if not revolved:
        where["left"] = {0: 0.0}
    if space:
        where["front"] = {1: 0.0}
    if kind == "space":
        where["back"] = {1: 0.0}
    if "oedometer" in kind:
        where["right"] = {0: 0.0}
    if kind == "oedometer-space":
        where["back"] = {1: 0.0}
    stands = "oedometer" in kind
    if stands:
        del where["bottom"]
    fixed = [
        {
            "on": on,
            "displacement": [given.get(i, x) for i, x in enumerate(free)],
            **({"amplitude": "drive"} if on == "top" else {}),
        }
        for on, given in where.items()
    ]
    return parse_case(
        {
            "mesh": {
                "generator": "box" if space else "rectangle",
                "size": [1.0] * dim,
                "cells": [cells] * dim,
            },
            "space": {"degree": degree, **({"kinematics": "axisymmetric"} if revolved else {})},
            "material": {"law": "j2", "poisson": 0.3, **material},
            "fixed": fixed,
            "contact": {"on": "bottom"} if stands else {"on": "right", "gap": FAR},
            "solver": {"tolerance": 1e-12},
            "evolution": {
                "times": [0.0, *times],
                "steps": [1] * len(times),
                "amplitudes": {"drive": {"time": [0.0, *times], "value": [0.0, *values]}},
            },
            **more,
        }
    )


def path(*ends, steps):
    """Return the values of equal steps from 0 to one end after the other."""
    values, last = [], 0.0
    for end in ends:
        values += [*np.linspace(last, end, steps + 1)[1:]]
        last = end
    return values


def homogeneous_values(solution, step=-1):
    """Return stress, equivalent plastic strain, and the relative range of both over the cells."""
    problem, state = solution.problem, solution.steps[step].state
    cells = DerivedFields(problem.body, state).cells()
    stress = cells["stress"].x.array.reshape(-1, 3, 3)
    a = cells["equivalent_plastic_strain"].x.array
    mean, most = stress.mean(axis=0), max(a.max(), 1e-12)
    spread = max(np.ptp(stress, axis=0).max() / np.abs(mean).max(), np.ptp(a) / most)
    return mean, a.mean(), spread


def integrated(young, poisson, yield_stress, hardening, kinematic, free, driven):
    """Return stress and plastic strain after steps of backward Euler, by Powell's method."""
    k, g, m, n = young / (3 - 6 * poisson), young / (2 + 2 * poisson), len(kinematic), len(free)
    scale = yield_stress / young

    def stress(strain, plastic):
        return k * strain.sum() + 2 * g * (strain - strain.mean() - plastic)

    def size(xi):
        return np.sqrt(1.5) * np.linalg.norm(xi)

    def strength(a):
        return yield_stress + hardening(a)

    def step(value, eps, plastic, a, back):
        strain = eps.copy()
        strain[0] = value

        def elastic(unknown):
            strain[free] = unknown
            return stress(strain, plastic)[free]

        def equations(z):
            strain[free] = z[:n] * scale
            flow, da = z[n : n + 3] * scale, z[n + 3] * scale
            b = z[n + 4 :].reshape(m, 3) * yield_stress
            sigma = stress(strain, plastic + flow)
            xi = sigma - sigma.mean() - b.sum(axis=0)
            moved = [
                b[i] - back[i] - 2 / 3 * c * flow + recovery * b[i] * da
                for i, (c, recovery) in enumerate(kinematic)
            ]
            normality = (flow - 1.5 * da * xi / size(xi)) / scale
            left = [sigma[free], [size(xi) - strength(a + da)], *moved]
            return np.concatenate([normality, np.concatenate(left) / yield_stress])

        if n:
            strain[free] = root(elastic, eps[free], tol=1e-15).x
        xi = stress(strain, plastic)
        xi = xi - xi.mean() - back.sum(axis=0)
        over = size(xi) - strength(a)
        if over <= 0:
            return strain, plastic, a, back
        da = over / (3 * g)
        flow = 1.5 * da * xi / size(xi)
        start = [strain[free] / scale, flow / scale, [da / scale], back.ravel() / yield_stress]
        found = root(equations, np.concatenate(start), tol=1e-14)
        assert np.abs(found.fun).max() < 1e-9, found.message
        z = found.x
        strain[free] = z[:n] * scale
        flow = z[n : n + 3] * scale
        return (
            strain, plastic + flow, a + z[n + 3] * scale, z[n + 4 :].reshape(m, 3) * yield_stress
        )  # fmt: skip

    now, rows = (np.zeros(3), np.zeros(3), 0.0, np.zeros((m, 3))), []
    for value in driven:
        now = step(value, *now)
        rows.append([*stress(now[0], now[1]), now[2]])
    return np.array(rows)
