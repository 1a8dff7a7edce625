"""Mutants: errors of one line in the sources, each of which the core tests have to find.

`python3 -m scripts.studies.mutants [--out DIR] [--only NAME ...]`. Each is made in a copy of the
tree, whose core tests run there until the first one fails, likely ones first. The status is 1 if a
mutant survives.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from contact.errors import InputError
from scripts.benchmarks.processes import ENVIRONMENT, launcher
from scripts.reporting import Report, append, empty, parser

ROOT = Path(__file__).parents[2]

#: Seconds that the tests on some ranks may take: a mutant that hangs is found by that.
LIMIT = 1200

#: Status of pytest without any test, and of `timeout` where it ends a command.
NO_TESTS, TIMEOUT = 5, 124

#: A test that fails, as pytest's summary names it.
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+::\S+)", re.M)


@dataclass(frozen=True)
class Mutant:
    """An error of one line."""

    #: Its name, and the term that it breaks.
    name: str
    breaks: str
    #: The file, a text that stands there once, and the one that takes its place.
    file: str
    old: str
    new: str
    #: Files with tests, or folders, that come before all others.
    near: tuple[str, ...]
    #: The number of ranks on which the tests run first.
    ranks: int = 1

    def apply(self, tree: Path) -> None:
        """Put it into a tree."""
        path = tree / self.file
        text = path.read_text() if path.exists() else ""
        count = text.count(self.old)
        if count != 1:
            raise InputError(
                f"mutant {self.name}: {count} times in {self.file}: {self.old!r}; accepted: once",
                "value",
            )
        path.write_text(text.replace(self.old, self.new))


MUTANTS = (
    Mutant(
        "voigt-shear",
        "shear strains of crystals: 2 eps_ij in Voigt's notation",
        "forms/elasticity.py",
        "else 2 * e[i, j] for i, j in VOIGT",
        "else e[i, j] for i, j in VOIGT",
        ("tests/forms/test_piezo.py",),
    ),
    Mutant(
        "deviator-of-2d",
        "|dev eps|^2 with 1/d in the plane: 1/3 there too",
        "forms/kinematics.py",
        "- ufl.tr(eps) ** 2 / 3",
        "- ufl.tr(eps) ** 2 / 2",
        ("tests/forms/test_hencky.py",),
    ),
    Mutant(
        "ring-of-length-r",
        "2 pi r in the forms of bodies of revolution",
        "forms/kinematics.py",
        "return 2 * ufl.pi * x[0]",
        "return x[0]",
        ("tests/verification/test_axisymmetric.py",),
    ),
    Mutant(
        "hardening-by-dg",
        "equivalent plastic strain sqrt(2/3) dg of the radial return",
        "forms/j2.py",
        'new["equivalent_plastic_strain"][plastic] += ROOT * flow.dg',
        'new["equivalent_plastic_strain"][plastic] += flow.dg',
        ("tests/forms/test_j2.py",),
    ),
    Mutant(
        "coupling-sign",
        "the sign of e^T grad(phi) in the stress",
        "forms/piezo.py",
        "ufl.as_tensor(e[i, j, k] * gradient(phi, kinematics)[i], (j, k))",
        "ufl.as_tensor(-e[i, j, k] * gradient(phi, kinematics)[i], (j, k))",
        ("tests/verification/test_piezo_closed_forms.py",),
    ),
    Mutant(
        "transformation-not-transposed",
        "C^T f, the forces on the jumps",
        "contact/linear/transformation.py",
        "nodal = times(self.matrix, forces[: self.owned], transposed=True)",
        "nodal = times(self.matrix, forces[: self.owned])",
        ("tests/verification/test_patch_two_bodies.py",),
    ),
    Mutant(
        "elastic-half",
        "the force k u of an elastic support",
        "contact/body/weak_form.py",
        "work += k * x.u[i] * z.u[i]",
        "work += k / 2 * x.u[i] * z.u[i]",
        ("tests/body/test_elastic.py",),
    ),
    Mutant(
        "dilatation-by-area",
        "the mean dilatation of rings: weights of their volume",
        "contact/body/elements.py",
        "extent = integration_weights(domain.revolved, shape, of, at, weights)",
        "extent = integration_weights(False, shape, of, at, weights)",
        ("tests/body/test_mean_dilatation.py", "tests/verification/test_patch_cells.py"),
    ),
    Mutant(
        "friction-sign",
        "the sign of friction among the contact forces",
        "contact/interface/multipliers.py",
        "nodes.normal + nodes.tangential_component(self.friction)",
        "nodes.normal - nodes.tangential_component(self.friction)",
        ("tests/verification/test_closed_forms.py",),
    ),
    Mutant(
        "friction-square",
        "the disc of admissible friction: a square in its place",
        "contact/interface/complementarity.py",
        "length = np.linalg.norm(z, axis=-1)",
        "length = np.abs(z).max(axis=-1)",
        ("tests/methods/test_interior_point.py",),
    ),
    Mutant(
        "friction-of-open-nodes",
        "the active set: nodes that are open, and bound by Tresca's law",
        "contact/interface/multipliers.py",
        "acts = (bound > 0) | closed",
        "acts = closed",
        ("tests/methods/test_newton.py", "tests/methods/test_uzawa.py"),
    ),
    Mutant(
        "bound-of-raw-pressure",
        "the bound mu |R p|: R left out",
        "contact/interface/friction.py",
        "np.maximum(self.smoothing(pressure), 0.0)",
        "np.maximum(pressure, 0.0)",
        ("tests/interface/test_smoothing.py", "tests/methods/test_newton.py"),
    ),
    Mutant(
        "tangent-without-slope",
        "the derivative of mu(slip) in Newton's matrix",
        "contact/methods/safeguards.py",
        "return np.maximum(interface.friction.by_slip(length, pressure), -limit)",
        "return np.zeros_like(length)",
        ("tests/interface/test_complementarity.py",),
    ),
    Mutant(
        "normals-of-one-side",
        "the contact direction of curved pairs, between the normals of both sides",
        "contact/interface/mortar/coupling.py",
        "direction = slave.normal - mean",
        "direction = slave.normal.copy()",
        ("tests/interface/test_mortar.py",),
    ),
    Mutant(
        "dual-by-columns",
        "the dual functions: rows of the inverse mass matrix weighed, not columns",
        "contact/interface/mortar/coupling.py",
        "weight[faces, :, None] * np.linalg.inv(mass[faces])",
        "weight[faces, None, :] * np.linalg.inv(mass[faces])",
        ("tests/interface/test_mortar.py",),
    ),
    Mutant(
        "lost-mortar-forces",
        "contact forces on master nodes of other ranks",
        "contact/mesh/owners.py",
        "        vector.scatter_reverse(la.InsertMode.add)\n",
        "",
        ("tests/problem/test_two_bodies.py",),
        2,
    ),
    Mutant(
        "adjoint-of-slip",
        "the sign of accumulated slip in the adjoint of several steps",
        "contact/problem/solution_jacobian.py",
        'accumulated = -np.einsum("ni,ni->n", jacobian.by_length, conditions)',
        'accumulated = np.einsum("ni,ni->n", jacobian.by_length, conditions)',
        ("tests/test_derivatives.py",),
    ),
    Mutant(
        "late-history",
        "the history of a step: one step behind",
        "contact/methods/load_stepping.py",
        "problem = problem.at(time, problem.commit(last), since=last.time)",
        "problem = problem.at(time, last.history, since=last.time)",
        ("tests/methods/test_steps.py",),
    ),
    Mutant(
        "derivative-without-history",
        "the tangent of several steps: history carried along",
        "contact/derivatives/by_parameters.py",
        "jacobian.solve(change + by_history)",
        "jacobian.solve(change)",
        ("tests/test_derivatives.py",),
    ),
    Mutant(
        "estimate-without-contact",
        "the estimated error: its part from the contact",
        "contact/results/error_estimate.py",
        "squares += at_contact\n",
        "squares += 0 * at_contact\n",
        ("tests/results/test_error_estimate.py",),
    ),
    Mutant(
        "restart-without-history",
        "the history of a checkpoint",
        "contact/io/checkpoint.py",
        "initial.replaced({name: own[HISTORY + name] for name in initial.arrays()})",
        "initial",
        ("tests/io/test_resume.py",),
    ),
    Mutant(
        "resultant-of-one-rank",
        "the sum of contact forces over all ranks",
        "contact/results/resultants.py",
        "total = problem.comm.allreduce(local, op=MPI.SUM)",
        "total = local",
        ("tests/results/test_resultants.py",),
        2,
    ),
    Mutant(
        "moment-sign",
        "the moment x f_y - y f_x",
        "contact/results/resultants.py",
        "points[:, 0] * forces[:, 1] - points[:, 1] * forces[:, 0]",
        "points[:, 0] * forces[:, 1] + points[:, 1] * forces[:, 0]",
        ("tests/results/test_resultants.py",),
    ),
    Mutant(
        "late-steps",
        "the ends of the steps of a case: one step late",
        "contact/model/evolution.py",
        "* (k + 1) / count",
        "* k / count",
        ("tests/case/test_case.py",),
    ),
)


def copied(into: Path) -> Path:
    """Return a copy of the tree in a folder."""

    def left_out(folder: str, names: list[str]) -> set[str]:
        return {"__pycache__", *([".git", "build", "results"] if Path(folder) == ROOT else [])}

    return shutil.copytree(ROOT, into / "tree", symlinks=True, ignore=left_out)


def core_files(tree: Path, mutant: Mutant) -> list[str]:
    """Return the files with core tests, those near a mutant first."""
    files = [
        str(path.relative_to(tree))
        for path in sorted((tree / "tests").rglob("test_*.py"))
        if "mark.core" in path.read_text()
    ]
    return sorted(files, key=lambda file: not file.startswith(mutant.near))


def found_by(tree: Path, files: Sequence[str], ranks: int) -> str:
    """Return the first core test of files that fails on some ranks; nothing where all pass."""
    options = ["--short", "-x", "-q", "--tb=no", "-rfE", "--color=no", "-p", "no:cacheprovider"]
    run = [sys.executable, "-m", "pytest", *files, *options, "-m", "core", "-n", "0"]
    if ranks > 1:
        run[1:2] = ["-m", "mpi4py", "-m"]
        run = [*launcher(ranks), *run[:-3], "core and parallel"]
    ended = subprocess.run(
        ["timeout", str(LIMIT), *run],
        cwd=tree,
        env={**os.environ, **ENVIRONMENT, "PYTHONPATH": str(tree)},
        capture_output=True,
        text=True,
    )
    if ended.returncode in (0, NO_TESTS):
        return ""
    failed = FAILED.search(ended.stdout)
    if failed is None and ended.returncode != TIMEOUT:
        raise RuntimeError(f"pytest: {ended.stdout}{ended.stderr}")
    return failed[1] if failed else f"no end within {LIMIT} s"


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the table of mutants."""
    names = {mutant.name: mutant for mutant in MUTANTS}
    given = parser(__doc__, "mutants")
    given.add_argument("--only", nargs="+", choices=names, default=[*names], metavar="NAME")
    options = given.parse_args(arguments)
    columns = empty("mutant", "breaks", "found by", "ranks", "s")
    for name in options.only:
        mutant, began, found = names[name], time.perf_counter(), ""
        with tempfile.TemporaryDirectory() as folder:
            tree = copied(Path(folder))
            mutant.apply(tree)
            files = core_files(tree, mutant)
            for ranks in sorted((1, 2, 3), key=lambda n: n != mutant.ranks):
                found = found_by(tree, files, ranks)
                if found:
                    break
        row = name, mutant.breaks, found or "nothing", ranks, round(time.perf_counter() - began)
        append(columns, *row)
        print(*row, sep="; ", flush=True)
    lost = columns["found by"].count("nothing")
    caption = f"Mutants: {len(options.only) - lost} of {len(options.only)} found"
    Report(options.out).table("mutants", caption, columns)
    return int(lost > 0)


if __name__ == "__main__":
    sys.exit(main())
