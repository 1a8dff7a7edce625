"""Materials by name: what they say of themselves, and that wrong ones are refused."""

import tomllib

import numpy as np
import pytest

import contact
from contact.case.file import parse_case
from contact.library.materials import PACKAGED, find, library
from forms.crystal import isotropic_about_x3, stiffness_tensor, turned
from tests.problems.messages import message_of

CASE = {
    "mesh": {"generator": "rectangle", "size": [1.0, 1.0], "cells": [4, 4]},
    "fixed": [
        {"on": "top", "displacement": [0.0, -0.01], "potential": 0.0},
        {"on": "left", "potential": 0.0},
    ],
    "contact": {"on": "bottom"},
}
#: The same ceramics and crystals in COMSOL's material library: c11, c12, c13, c33, c44 (GPa), e31,
#: e33, e15 (C/m2), permittivities 11 and 33 over that of empty space; how far they may differ.
ELSEWHERE = """
PZT-4 Clevite | 138.999 77.8366 74.2836 115.412 25.641 -5.20279 15.0804 12.7179 762.5 663.2 0.004
PZT-5A | 120.346 75.1791 75.0901 110.867 21.0526 -5.35116 15.7835 12.2947 919.1 826.6 0.01
PZT-5H | 127.205 80.2122 84.6702 117.436 22.9885 -6.62281 23.2403 17.0345 1704.4 1433.6 0.03
BaTiO3 | 150.377 65.6308 65.9391 145.521 43.8596 -4.32015 17.3624 11.4035 1115.1 1251.3 0.01
ZnO | 209.714 121.14 105.359 211.194 42.3729 -0.567005 1.32044 -0.480508 8.5446 10.204 0.012
AlN | 410 149 99 389 125 -0.58 1.55 -0.48 9 9 0.001
quartz | 86.7362 6.98527 11.9104 107.194 57.9428 0 0 0 4.428 4.634 0.004
LiNbO3 | 202.897 52.9177 74.9098 243.075 59.9034 0.193644 1.30863 3.69548 43.6 29.16 0.04
"""


def case(**material):
    return parse_case({**CASE, "material": material})


@pytest.mark.core
def test_the_packaged_library():
    known = library()
    wanted = "PZT-4 PZT-5A PZT-5H PZT-6B BaTiO3 PVDF ZnO AlN quartz LiNbO3 steel aluminium tungsten"
    assert {*wanted.split(), "sapphire"} <= set(known)
    for entry in known.values():
        assert entry.source and entry.temperature and entry.condition and entry.checked
        if entry.symmetry in ("isotropic", "6mm"):
            tensors = [stiffness_tensor(entry.stiffness)]
            if entry.piezo is not None:
                tensors += [entry.piezo.e, entry.piezo.beta]
            assert isotropic_about_x3(*tensors), entry.name
        if entry.coupling is not None:
            # d = e s and e = d c, eps^T = eps^S + d e^T is symmetric and larger.
            assert np.allclose(entry.charge_constants @ entry.stiffness, entry.coupling, atol=1e-12)
            more = entry.free_permittivity - entry.permittivity
            assert np.allclose(more, more.T, atol=1e-9 * np.abs(more).max())
            assert np.linalg.eigvalsh(more)[0] > -1e-12 * np.abs(more).max()


def test_classes_32_and_3m_have_their_threefold_axis_and_their_diad_or_mirror():
    third = [[-0.5, -np.sqrt(0.75), 0.0], [np.sqrt(0.75), -0.5, 0.0], [0.0, 0.0, 1.0]]
    for name, diad in (
        ("quartz", np.diag([1.0, -1.0, -1.0])),
        ("LiNbO3", None),
        ("sapphire", None),
    ):
        entry = find(name)
        parts = [stiffness_tensor(entry.stiffness)]
        parts += [] if entry.piezo is None else [entry.piezo.e]
        for part in parts:
            size = np.abs(part).max()
            # Printed to four digits: c66 = (c11 - c12)/2 and the like hold to the last one.
            assert np.allclose(turned(part, third), part, atol=2e-4 * size), name
            if diad is not None:
                assert np.allclose(turned(part, diad), part, atol=1e-12 * size)
            assert not isotropic_about_x3(part)
    e = find("LiNbO3").piezo.e
    mirror = np.diag([-1.0, 1.0, 1.0])
    assert np.allclose(np.einsum("ia,jb,kc,abc", mirror, mirror, mirror, e), e)


@pytest.mark.parametrize("row", ELSEWHERE.split("\n")[1:-1])
def test_the_numbers_are_those_of_another_library(row):
    name, given = row.split(" | ")
    *numbers, within = map(float, given.split())
    entry = find(name)
    c, e, eps = entry.stiffness / 1e9, entry.coupling, entry.permittivity / 8.8541878e-12
    own = [c[0, 0], c[0, 1], c[0, 2], c[2, 2], c[3, 3], e[2, 0], e[2, 2], e[0, 4]]
    own += [eps[0, 0], eps[2, 2]]
    assert own == pytest.approx(numbers, rel=within, abs=1e-9)


def test_published_charge_constants_of_quartz_and_lithium_niobate():
    assert find("quartz").charge_constants[0, [0, 3]] == pytest.approx(
        [2.31e-12, 0.727e-12], rel=0.01
    )
    assert find("LiNbO3").charge_constants[0, 4] == pytest.approx(68e-12, rel=0.01)
    assert find("PZT-5A").bar_coupling(2, 2) == pytest.approx(0.705, abs=0.005)
    assert find("PZT-5A").bar_coupling(2, 0) == pytest.approx(0.344, abs=0.005)


@pytest.mark.core
def test_the_published_charge_constants_are_those_of_the_others():
    """Bechmann's relation d = e s, which holds with the constants of one source."""
    tables = tomllib.loads(PACKAGED.read_text(encoding="utf-8"))
    given = {name: table for name, table in tables.items() if "d" in table}
    assert len(given) > 3
    for name, table in given.items():
        found = find(name).charge_constants * 1e12
        for key, value in table["d"].items():
            own = found[int(key[1]) - 1, int(key[2]) - 1]
            assert own == pytest.approx(value, rel=table.get("within", 0.05)), (name, key)


@pytest.mark.core
def test_a_material_by_name_is_the_one_by_its_constants():
    entry = find("PZT-4")
    constants = {"c11": 139.0, "c12": 77.8, "c13": 74.3, "c33": 113.0, "c44": 25.6}
    piezo = {"e31": -6.98, "e33": 13.84, "e15": 13.44, "beta11": 6.0, "beta33": 5.47}
    named = contact.solve(case(name="PZT-4", units="GPa"))
    given = contact.solve(case(law="anisotropic", **constants, piezo=piezo))
    assert np.allclose(named.pressure, given.pressure, rtol=1e-12)
    full = case(law="anisotropic", stiffness=(entry.stiffness / 1e9).tolist(), piezo=piezo)
    assert np.allclose(contact.solve(full).pressure, named.pressure, rtol=1e-12)
    si = contact.solve(case(name="PZT-4"))
    assert np.allclose(si.pressure, 1e9 * named.pressure, rtol=1e-8)
    assert np.allclose(si.potential.x.array, 1e9 * named.potential.x.array, rtol=1e-6, atol=1e-2)


BAD = {
    "unknown name": {"name": "PZT4"},
    "name and law": {"name": "steel", "law": "linear"},
    "name and young": {"name": "steel", "young": 1.0},
    "units alone": {"young": 1.0, "poisson": 0.3, "units": "SI"},
    "no isotropic axis": {"name": "steel", "poling": 0.0},
    "poling without": {"young": 1.0, "poisson": 0.3, "poling": 0.0},
    "half of six": {"law": "anisotropic", "c11": 1.0, "c12": 0.2},
    "nothing": {"law": "anisotropic"},
    "isotropic too": {"law": "anisotropic", "young": 1.0},
    "indefinite": {
        "law": "anisotropic",
        "c11": 1.0,
        "c12": 2.0,
        "c13": 0.0,
        "c33": 1.0,
        "c44": 1.0,
    },
    "not six": {"law": "anisotropic", "stiffness": [[1.0]]},
    "no library": {"name": "a", "library": "nowhere.toml"},
}


@pytest.mark.wording
def test_messages_of_bad_materials(snapshot):
    said = {name: message_of(case, **given) for name, given in BAD.items()}
    snapshot("refused-materials", said)
