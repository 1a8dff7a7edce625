"""The script that compares the methods, on coarse meshes."""

from pathlib import Path

import pytest

from contact import build_problem
from contact.methods.options import NewtonOptions
from scripts.cases import CASES
from scripts.studies import agreement, agreement_examples, branches
from scripts.studies.agreement_examples import Example
from scripts.studies.branches import AGREE, Branches
from tests.problems.written import rows_of


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("agreement")
    cases = ("bar", "hertz-sphere", "piezo-8-1-conductive", "compliance-8-3-layer")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(agreement_examples, "RHO", (0.0, 1e7, 6e7))
        agreement.main(["--coarse", "--out", str(out), "--only", *cases])
    return out


def test_every_case_file_is_compared_but_those_in_steps():
    names = {path.stem for path in CASES.glob("*.toml")}
    left_out = names - {example.name for example in agreement.examples()}
    assert "bar" not in left_out and "fretting" in left_out
    assert all("[evolution]" in (CASES / f"{name}.toml").read_text() for name in left_out)


def test_block_relaxation_is_given_up_after_its_solves(monkeypatch, tmp_path):
    monkeypatch.setattr(branches, "SOLVES", 20)
    (compared,) = agreement.main(["--coarse", "--out", str(tmp_path), "--only", "hertz-sphere"])
    run = compared.runs["uzawa"]
    assert run.counters.linear_solves == 20
    assert not run.converged
    assert run.outcome.reason.startswith("given up: 20 solves")
    (row,) = rows_of(tmp_path / "agreement.csv")
    assert row["verdict"] == "not converged"
    assert row["uzawa's"] == "20"


def test_newton_and_block_relaxation_agree_or_find_different_solutions(folder):
    found = {row["example"]: row for row in rows_of(folder / "agreement.csv")}
    assert len(found) == 6
    for name, row in found.items():
        assert max(float(row["newton"]), float(row["uzawa"])) <= 1e-10
        apart = max(float(row[key]) for key in ("u", "energy", "p", "tau"))
        if row["warned"] == "False":
            assert row["verdict"] == "agree", name
        assert (row["verdict"] == "agree") == (apart <= AGREE)
        # Nothing in between: another solution is far away.
        assert apart <= AGREE or (apart > 1e-4 and int(row["solutions"]) > 1)
    assert found["7.2, f2 = -0.005, rho = 6e7"]["verdict"] == "A and B"


def test_both_methods_stay_at_each_other_s_solutions(folder):
    found = [
        row
        for row in rows_of(folder / "agreement-branches.csv")
        if {"newton", "uzawa"} & set(row["found by"].split(", "))
    ]
    assert len(found) >= 4
    for row in found:
        assert float(row["residual"]) <= 1e-9
        assert max(float(row["newton from it"]), float(row["uzawa from it"])) <= AGREE
        assert row["newton, disturbed"] == row["uzawa, disturbed"] == row["solution"]


def test_a_foundation_that_moves_has_unknowns_of_its_own():
    """Two displacements and a rotation, behind the unknowns of nodes, which alone are compared."""
    coarse = ("mesh.extent=8.0", "mesh.size=4.0", "mesh.contact_size=0.5", "mesh.edge_size=0.2")
    example = Example("ball", "indent-ball", coarse)
    problem = build_problem(example.case(coarse=True))
    branches, newton = Branches(problem), NewtonOptions(tolerance=1e-10)
    found = branches.solve(newton)
    assert branches.letter(found) == "A"
    again = branches.solve(newton, branches.disturbed(found))
    assert problem.body.motion(found.state.x).size == 3
    assert branches.letter(again) == "A"
    assert branches.difference(again, found).largest <= AGREE


def test_the_penalty_method_tends_to_a_solution(folder):
    for row in rows_of(folder / "agreement-penalty.csv"):
        assert row["converged"] == "True"
        assert float(row["eps 1e-7"]) < 1e-4
        if not row["example"].startswith("7.2"):
            assert float(row["order"]) == pytest.approx(1.0, abs=0.01)
