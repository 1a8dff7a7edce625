"""The study of units: results do not depend on them."""

from scripts.studies import units


def test_units_agree(tmp_path):
    assert units.main(["--coarse", "--methods", "newton", "--out", str(tmp_path)]) == 0
