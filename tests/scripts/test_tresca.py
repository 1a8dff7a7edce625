"""The study of problems with given friction bounds, on coarse meshes."""

from scripts.studies.tresca import compare, problems


def test_the_interior_point_and_newton_agree_on_all():
    """To 1e-10 and 25 steps at most; two of them are held by contact alone."""
    rows = [compare(case) for case in problems(coarse=True)]
    assert len(rows) == 8
    for row in rows:
        assert row["solved"] and row["newton"], row["problem"]
        assert row["gap"] <= 1e-10 and row["steps"] <= 25, row["problem"]
        assert row["difference"] <= 1e-8, row["problem"]
    assert sum(row["closed"] > 0 for row in rows) >= 6
