"""The problems of the golden numbers: all cases, examples and thesis tables, on coarse meshes."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from mpi4py import MPI

from contact import (
    Body,
    Case,
    Contact,
    Domain,
    Fixed,
    Friction,
    Linear,
    Load,
    Material,
    NewtonOptions,
    Problem,
    load_case,
    parse_case,
    sensitivity,
    solve,
    solve_steps,
    write_outputs,
)
from scripts.cases import CASES, bar, on_grid
from scripts.gallery import EXAMPLES, Run
from scripts.golden_values import Value, counted, measured
from scripts.thesis import table_7_1, table_7_2, tables_compliance, tables_piezo
from tests.problems import (
    apart,
    blocks,
    compliance,
    materials,
    mechanics,
    pairs,
    piezo,
    plasticity,
    put_together,
    quadrilaterals,
    revolution,
    rigid,
    rings,
    shaken,
    stepped,
    written,
)
from tests.problems import (
    bar as tables,
)

COMM = MPI.COMM_WORLD

#: So small that nine digits of the results are known.
TIGHT = 1e-12

#: Case file -> changes for a mesh, and load steps, of a second.
COARSE: Mapping[str, tuple[str, ...]] = {
    "ball-between-plates": ("mesh.size=0.3", "mesh.contact_size=0.05"),
    "ball-in-steel": (
        "mesh.size=2.0", "mesh.contact_size=0.02", "mesh.edge_size=0.02",
        "evolution.steps=[2, 1, 1, 2, 1, 3]",
    ),
    "bar": ("mesh.cells=[32, 8]",),
    "bar-large": ("mesh.cells=[32, 8]",),
    "bimorph-stop": ("mesh.size=0.5", "mesh.contact_size=0.06", "evolution.steps=[3, 2, 3]"),
    "bracket": ("mesh.size=16.0", "mesh.contact_size=8.0"),
    "compliance-8-3": ("mesh.cells=[24, 4]",),
    "compliance-8-3-layer": ("mesh.cells=[24, 4]",),
    "compliance-8-3-soft": ("mesh.cells=[24, 4]",),
    "compliance-8-3-top": ("mesh.cells=[24, 4]",),
    "compliance-8-4": ("mesh.cells=[24, 4]",),
    "compliance-8-4-layer": ("mesh.cells=[24, 4]",),
    "cylinder-on-block": ("mesh.size=20.0", "mesh.contact_size=1.5"),
    "fretting": ("mesh.cells=[24, 12]", "evolution.steps=[2, 2, 4, 4]"),
    "fretting-plastic": ("mesh.cells=[24, 12]", "evolution.steps=[3, 2, 2, 2, 1, 1]"),
    "hertz": ("mesh.size=1.6", "mesh.contact_size=0.4"),
    "hertz-small": ("mesh.size=1.6", "mesh.contact_size=0.15"),
    "hertz-sphere": ("mesh.size=4.0", "mesh.contact_size=0.3"),
    "indent-ball": ("mesh.contact_size=0.2", "mesh.edge_size=0.05"),
    "indent-ball-force": (
        "mesh.contact_size=0.2", "mesh.edge_size=0.05", "evolution.steps=[4, 4]",
    ),
    "indent-cone": ("mesh.contact_size=0.2", "mesh.edge_size=0.05"),
    "indent-punch-tilted": (
        "mesh.extent=5.0", "mesh.contact_size=0.6", "mesh.edge_size=0.2", "mesh.arc_size=0.6",
    ),
    "indent-pzt4-conducting": ("mesh.contact_size=0.02", "mesh.edge_size=0.005"),
    "indent-pzt4-insulating": ("mesh.contact_size=0.02", "mesh.edge_size=0.005"),
    "layer-column": (),
    "piezo-8-1": ("mesh.cells=[16, 8]",),
    "piezo-8-1-conductive": ("mesh.cells=[16, 8]",),
    "piezo-8-2": ("mesh.cells=[16, 8]",),
    "piezo-column": ("mesh.cells=[2, 2, 4]",),
    "piezo-sensor": ("mesh.cells=[16, 8]",),
    "piezo-sensor-cyclic": ("mesh.cells=[16, 8]", "evolution.steps=[3, 2, 2, 2, 2]"),
    "press-fit": ("mesh.cells=[8, 2]",),
    "press-shear-unload": ("mesh.cells=[6, 3, 3]", "evolution.steps=[2, 3, 2]"),
    "ring-on-mandrel": ("mesh.cells=[6, 5]", "evolution.steps=[4, 4]"),
    "two-blocks": ("mesh.lower_size=0.2", "mesh.upper_size=0.15"),
    "two-half-cylinders": ("mesh.size=3.0", "mesh.contact_size=0.08"),
    "two-spheres": ("mesh.size=20.0", "mesh.contact_size=4.0"),
}  # fmt: skip

#: Name -> case file, and further changes: methods, laws, elements.
VARIANTS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "bar, Newton": ("bar", ("solver.method=newton",)),
    "bar, mu(x)": ("bar", ("solver.method=newton", "friction.mu=0.2 + 0.1*x")),
    "bar, R": ("bar", ("solver.method=newton", "friction.radius=0.3")),
    "bar, degree 2": ("bar", ("solver.method=newton", "space.degree=2", "mesh.cells=[16, 4]")),
    "bar, squares": ("bar", ("solver.method=newton", "mesh.cell=quadrilateral")),
    "bar, plane stress": ("bar", ("solver.method=newton", "space.kinematics=plane_stress")),
    "bar, turned": ("bar", ("solver.method=newton", "mesh.rotation=30.0")),
    "bar, refined": ("bar", ("solver.method=newton", "mesh.cells=[16, 4]", "mesh.refine=1")),
    "bar, adapted": ("bar", ("solver.method=newton", "mesh.cells=[8, 2]", "mesh.adapt.error=0.1")),
    "bar, intervals": (
        "bar",
        (
            "solver.method=newton", "mesh.cells=[8, 2]", "mesh.adapt.error=0.06",
            "mesh.adapt.fraction=1.0",
        ),
    ),
    "bar, nested": (
        "bar", ("solver.method=newton", "solver.nested=true", "solver.nested_levels=2"),
    ),
    "bar, multigrid": ("bar", ("solver.method=newton", "solver.linear=iterative")),
    "bar, single loop": ("bar", ("solver.single_loop=true",)),
    "piezo, ramp": (
        "piezo-8-1-conductive",
        ("electric.law=ramp", "contact.gap=0.0", "friction.mu=0.2"),
    ),
    "piezo, perfect": ("piezo-8-1-conductive", ("electric.law=perfect", "friction.mu=0.2")),
    "piezo, truncated": ("piezo-8-1-conductive", ("electric.limit=4.0",)),
    "compliance, Newton": ("compliance-8-4-layer", ("solver.method=newton",)),
    "press-shear-unload, hexahedra": ("press-shear-unload", ("mesh.cell=hexahedron",)),
    "press-shear-unload, multigrid": ("press-shear-unload", ("solver.linear=iterative",)),
    "hertz, curved": ("hertz", ("mesh.order=2", "space.degree=2")),
    "two-spheres, degree 2": (
        "two-spheres", ("space.degree=2", "mesh.size=30.0", "mesh.contact_size=6.0"),
    ),
    "cylinder-on-block, squares": ("cylinder-on-block", ("mesh.cell=quadrilateral",)),
}  # fmt: skip


def case_of(name: str, *changes: str) -> Case:
    """Return a case on its coarse mesh, without files of fields."""
    tight = (f"solver.tolerance={TIGHT}", "output.fields=none")
    return load_case(CASES / f"{name}.toml", (*COARSE[name], *tight, *changes))


def of_case(name: str, *changes: str) -> dict[str, Value]:
    """Solve a case file with changes. Collective."""
    return measured(solve(case_of(name, *changes)))


def of_example(name: str) -> dict[str, Value]:
    """Solve an example of the gallery, and return the values of its page too. Collective."""
    example = EXAMPLES[name]
    solution = solve(case_of(example.case, *example.changes))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(COMM.bcast(place))
        write_outputs(solution, folder)
        rows = COMM.bcast([*example.compare(Run(folder))] if COMM.rank == 0 else None)
    compared = {f"compared: {key}": Value(now, abs(now)) for key, now, _ in rows}
    return {**measured(solution), **compared}


def of(given: Case | Problem, **options: Any) -> dict[str, Value]:
    """Solve a case, or a problem that is put together in Python. Collective."""
    return measured(solve(given, NewtonOptions(tolerance=TIGHT, **options)))


def in_steps(problem: Problem, times: Iterable[float]) -> dict[str, Value]:
    """Solve a problem in load steps. Collective."""
    return measured(solve_steps(problem, [*times], NewtonOptions(tolerance=TIGHT)))


def of_case_itself(case: Case) -> dict[str, Value]:
    """Solve a case by the method that it names. Collective."""
    return measured(solve(case))


def counts(case: Case) -> dict[str, Value]:
    """Return the counts of an algorithm of the thesis, as its table has them. Collective."""
    return counted(solve(case))


class Pressed:
    """The friction law s = 0.4 p/(1 + 20 p)/(1 + 5 |u_tau|), with mu(p)."""

    maximum, lipschitz = 0.4, 2.0

    def __call__(self, slip: Any, pressure: Any) -> Any:
        """Return the bound."""
        return 0.4 * pressure / (1 + 20 * pressure) / (1 + 5 * slip)

    def by_slip(self, slip: Any, pressure: Any) -> Any:
        """Return the derivative by the slip."""
        return -2.0 * pressure / (1 + 20 * pressure) / (1 + 5 * slip) ** 2

    def by_pressure(self, slip: Any, pressure: Any) -> Any:
        """Return the derivative by the pressure."""
        return 0.4 / (1 + 20 * pressure) ** 2 / (1 + 5 * slip)


def mu_of_pressure() -> dict[str, Value]:
    """Solve the bar with a law mu(p). Collective."""
    case = bar(8, -0.005, 1e5, f"solver.tolerance={TIGHT}", "output.fields=none")
    return measured(solve(case, friction=Pressed()))


def pair(
    degree: int = 1, mu: float = 0.3, element: str = "standard", load: float = 0.02, **given: Any
) -> Problem:
    """Return a block on a block, pressed and pushed."""
    made = blocks.Blocks(**given)
    d = made.dim
    domain: Domain = made.domain(COMM)
    upper = Material(Linear(1.0, 0.3), on="upper")
    lower = Material(mechanics.Log(2.0, 0.25, yield_strain=0.01), on="lower")
    push = [0.1 * load, *[0.05 * load] * (d - 2), -load]
    body = Body([upper, lower], [Fixed("bottom", [0.0] * d)], [Load("top", traction=push)])
    contact = Contact("under", against="over")
    friction = Friction(mu=mu) if mu else Friction()
    return Problem(domain, body, contact, friction, degree=degree, element=element)


def unlike() -> dict[str, Value]:
    """Solve a pair of blocks of other cells from a file of Abaqus. Collective."""
    with tempfile.TemporaryDirectory() as place:
        path = Path(COMM.bcast(place)) / "pair.inp"
        if COMM.rank == 0:
            upper = blocks.Blocks(3, 2, 2, cell="hexahedron")
            blocks.write_unlike(path, upper, blocks.Blocks(3, 2, 3))
        COMM.barrier()
        case = {
            "mesh": {"file": str(path)},
            "material": {"young": 1.0, "poisson": 0.3},
            "fixed": [
                {"on": "bottom", "displacement": [0.0, 0.0, 0.0]},
                {"on": "top", "displacement": [0.01, 0.0, -0.02]},
            ],
            "contact": {"on": "under", "against": "over"},
            "friction": {"law": "coulomb", "mu": 0.3},
        }
        return of(parse_case(case))


def squares(cell: str, element: str = "standard", poisson: float = 0.3) -> Problem:
    """Return a block of jittered cells, pressed aslant on a plane."""
    domain = quadrilaterals.unit_block(COMM, cell)
    d = domain.dim
    push = [0.004, *[0.002] * (d - 2), -0.01]
    body = Body(Linear(1.0, poisson), Fixed("top", push))
    contact = Contact("bottom", mechanics.flat())
    return Problem(domain, body, contact, Friction(mu=0.25), element=element)


def crystal(dim: int, potential: bool) -> Case:
    """Return a block of a poled crystal that is pressed and pushed aside."""
    poling = 60.0 if dim == 2 else [0.3, 0.2, 1.0]
    stiffness = {"c11": 139.0, "c12": 77.8, "c13": 74.3, "c33": 113.0, "c44": 25.6}
    material = (
        {"name": "PZT-4", "units": "GPa"} if potential else {"law": "anisotropic"} | stiffness
    )
    grounded = {"potential": 0.0} if potential else {}
    return parse_case(
        {
            "mesh": {
                "generator": "rectangle" if dim == 2 else "box",
                "size": [2.0, 1.0, 1.0][:dim],
                "cells": [12, 6] if dim == 2 else [4, 3, 3],
            },
            "material": {**material, "poling": poling},
            "fixed": [
                {"on": "top", "displacement": [0.004, *[0.002] * (dim - 2), -0.01], **grounded}
            ],
            "contact": {"on": "bottom", "gap": "0.004*(x - 1)**2"},
            "friction": {"law": "coulomb", "mu": 0.25},
        }
    )


def bolt() -> Case:
    """Return a bar that a bolt draws from a foundation that it touches at its side."""
    return parse_case(
        {
            "mesh": {
                "generator": "rectangle",
                "size": [1.0, 2.0],
                "cells": [6, 10],
                "inside": {"cut": "abs(y - 0.8) < 1e-6"},
                "parts": {"wall": {"side": "right", "from": 1.2}},
            },
            "material": {"young": 10.0, "poisson": 0.3},
            "fixed": [{"on": side, "displacement": [0.0, 0.0]} for side in ("bottom", "top")],
            "bolt": [{"on": "cut", "force": 0.05}],
            "load": [{"on": "left", "traction": [0.02, 0.0]}],
            "contact": {"on": "wall", "gap": "0.001*y"},
            "friction": {"law": "coulomb", "mu": 0.2},
        }
    )


def bed() -> Case:
    """Return a block on an elastic bed, pressed against a wall."""
    return parse_case(
        {
            "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [12, 6]},
            "material": {"young": 1.0, "poisson": 0.3},
            "elastic": [
                {"on": "bottom", "stiffness": [0.05, "0.2 + 0.1*x"]},
                {"on": "left", "normal": 0.3},
            ],
            "load": [{"on": "top", "traction": ["0.01*x", -0.02]}],
            "contact": {"on": "right", "gap": "0.002 + 0.001*y"},
            "friction": {"law": "coulomb", "mu": 0.3},
        }
    )


def shape(**foundation: Any) -> Case:
    """Return a block that is pressed by a rigid shape, which turns a little."""
    return parse_case(
        {
            "mesh": {
                "generator": "box",
                "origin": [-1.0, -1.0, -1.0],
                "size": [2.0, 2.0, 1.0],
                "cells": [8, 8, 3],
            },
            "material": {"young": 1.0, "poisson": 0.3},
            "fixed": [{"on": "bottom", "displacement": [0.0, 0.0, 0.0]}],
            "contact": {
                "on": "top",
                "direction": "axis",
                "axis": [0.0, 0.0, 1.0],
                "foundation": foundation,
                "rigid": {
                    "displacement": [0.0123, 0.0071, -0.0531],
                    "rotation": [0.11, 0.0, 0.23],
                    "centre": [0.0, 0.0, 0.0],
                },
            },
            "friction": {"law": "coulomb", "mu": 0.3},
        }
    )


def ring() -> dict[str, Value]:
    """Solve a ring between plate and lid. Collective."""
    case = rings.squeezed("newton", tolerance=TIGHT)
    return measured(solve(case, domain=rings.between_plates(COMM, 3)))


def block_in_steps() -> dict[str, Value]:
    """Solve the sliding block of closed form 1 pushed back and forth. Collective."""
    law = materials.LAWS["norm"]
    block = mechanics.SlidingBlock(law, mechanics.SlipCoefficient(0.3, 0.2, 50.0), 0.02, 0.0, 0.0)
    given = stepped.SteppedBlock(block, stepped.back_and_forth(0.03, 0.01))
    return in_steps(given.problem(COMM), given.times)


def derivatives(method: str) -> dict[str, Value]:
    """Return derivatives of results of the fretting block by its parameters. Collective."""
    solution = solve(case_of("fretting", "evolution.steps=[2, 2, 2, 2]"))
    quantities = ["contact_force_x", "max_pressure", "max_displacement"]
    parameters = ["material.young", "friction.mu", "material.poisson"]
    return _of_sensitivities(sensitivity(solution, quantities, parameters, method))


def derivatives_of_charge() -> dict[str, Value]:
    """Return derivatives of charges of a sensor. Collective."""
    solution = solve(case_of("piezo-sensor"))
    quantities = ["charge_electrode", "charge_foundation", "contact_force_y"]
    parameters = ["material.piezo.e33", "load.0.traction.0", "friction.mu"]
    found = _of_sensitivities(sensitivity(solution, quantities, parameters))
    # A difference by e33 has the rounding of the force, and of the sum of the charge's magnitudes.
    scales = {"charge_electrode": 64.43 / 15.8, "contact_force_y": 314.6 / 15.8}
    names = {f"d {quantity}/d material.piezo.e33": scale for quantity, scale in scales.items()}
    return found | {name: Value(found[name].value, scale) for name, scale in names.items()}


def _of_sensitivities(found: Mapping[str, Mapping[str, float]]) -> dict[str, Value]:
    return {
        f"d {quantity}/d {parameter}": Value(float(value), abs(float(value)))
        for quantity, by in found.items()
        for parameter, value in by.items()
    }


def interior_point() -> dict[str, Value]:
    """Solve a bar whose Newton's method gives up early, by the interior point. Collective."""
    problem = mechanics.bar(COMM, 8, -0.05, friction=Friction(mu=0.5))
    solution = solve(problem, NewtonOptions(tolerance=TIGHT, max_iterations=2, condense=False))
    notes = {record.note for record in solution.history}
    used = any(note.startswith("interior point") for note in notes)
    return {**measured(solution), "interior point": Value(str(used))}


#: Problems in Python: name -> values.
IN_PYTHON: Mapping[str, Callable[[], dict[str, Value]]] = {
    "blocks apart": lambda: of(
        apart.pressed(apart.blocks(COMM), 0.01, 0.02, gap=0.0), condense=True
    ),
    "pair, triangles": lambda: of(pair()),
    "pair, sparse": lambda: of(pair(), condense=False),
    "pair, multigrid": lambda: of(pair(), condense=False, linear="iterative"),
    "pair, turned": lambda: of(pair(turn=20.0)),
    "pair, degree 2": lambda: of(pair(2)),
    "pair, curved": lambda: of(pair(2, bow=0.03)),
    "pair, squares": lambda: of(pair(cell="quadrilateral")),
    "pair, tetrahedra": lambda: of(pair(dim=3, upper=2, lower=3)),
    "pair, tetrahedra, degree 2": lambda: of(pair(2, dim=3, upper=2, lower=2)),
    "pair, hexahedra": lambda: of(pair(dim=3, upper=2, lower=3, cell="hexahedron")),
    "pair, unlike cells": unlike,
    "pair, generator": lambda: of(parse_case(pairs.case())),
    "squares": lambda: of(squares("quadrilateral")),
    "squares, mean dilatation": lambda: of(squares("quadrilateral", "mean_dilatation", 0.4999)),
    "hexahedra": lambda: of(squares("hexahedron")),
    "hexahedra, mean dilatation": lambda: of(squares("hexahedron", "mean_dilatation", 0.4999)),
    **{
        f"layer, {regime}": lambda dim=dim, column=column: of(column.problem(dim))
        for (regime, column), dim in zip(compliance.REGIMES.items(), (2, 3, 2, 3), strict=True)
    },
    **{
        f"layer, piezo, {regime}": lambda dim=dim, column=column: of(column.problem(dim))
        for (regime, column), dim in zip(
            compliance.PIEZO_REGIMES.items(), (2, 3, 2, 3), strict=True
        )
    },
    **{
        f"law, {name}": lambda law=law: of(mechanics.bar(COMM, 4, -0.05, law=law))
        for name, law in materials.LAWS.items()
    },
    "leaning block": lambda: of(mechanics.leaning_block(COMM)),
    "leaning block, degree 2": lambda: of(mechanics.leaning_block(COMM, 2, 2)),
    "pressed block": lambda: of(mechanics.pressed_block(COMM, 3, gap=0.01)),
    "column, 2-D": lambda: of(piezo.Column(k_e=1.0, phi_f=32.0).problem(COMM, 2)),
    "column, 3-D, degree 2": lambda: of(
        piezo.Column(k_e=1.0, phi_f=32.0).problem(COMM, 3, degree=2, mu=0.2)
    ),
    "column, perfect, turned": lambda: of(
        piezo.Column(k_e=1.0, phi_f=32.0).problem(COMM, 2, perfect=True, degrees=20.0)
    ),
    "piezo, 3-D": lambda: of(piezo.example(COMM, (6, 2, 3), friction=Friction(mu=0.2), delta=1.0)),
    "piezo, Hencky": lambda: of(
        piezo.example(
            COMM, (16, 8), law=piezo.hencky(), friction=Friction(mu=0.2), delta=1.0, limit=8.0
        )
    ),
    "j2, plane": lambda: of(_cyclic("plane", kinematic=20.0)),
    "j2, uniaxial": lambda: of(_cyclic("uniaxial", hardening={"saturation": 0.3, "rate": 20.0})),
    "j2, revolved": lambda: of(
        _cyclic("revolved", kinematic=[{"modulus": 50.0, "recovery": 20.0}], hardening=2.0)
    ),
    "j2, oedometer": lambda: of(
        _cyclic("oedometer-space", hardening=[[0.0, 0.2], [0.01, 0.3], [0.1, 0.4]])
    ),
    "put together": lambda: of(put_together.problem()),
    "tube": lambda: of(revolution.Tube().problem(6)),
    "tube, mean dilatation": lambda: of(
        revolution.Tube(Linear(1.0, 0.4999)).problem(6, 2, element="mean_dilatation")
    ),
    "tubes, two bodies": lambda: of(revolution.Layers().problem(6, 1, 2)),
    "tubes, two bodies, degree 2": lambda: of(revolution.Layers().problem(6, 2, 2)),
    "drum": lambda: of(revolution.Drum().problem(6)),
    "cylinder, R": lambda: of(revolution.pressed_cylinder(COMM, radius=0.3)),
    "cylinder, degree 2": lambda: of(revolution.pressed_cylinder(COMM, degree=2)),
    "indented": lambda: of(
        rigid.indented(
            2, displacement=[0.0, "free"], force=[0.0, -0.05], rotation="free", moment=0.001
        )
    ),
    "indented, 3-D": lambda: of(
        rigid.indented(3, 4, displacement=[0.01, 0.0, "free"], force=[0.0, 0.0, -0.05])
    ),
    "plate": lambda: of(rigid.plate()),
    "electrode": lambda: of(rigid.column()),
    "ring": ring,
    "shaken": lambda: in_steps(shaken.shaken(comm=COMM), shaken.times(2)),
    "shaken, Hencky, degree 2": lambda: in_steps(
        shaken.shaken(materials.LAWS["norm"], 2, comm=COMM), shaken.times(1)
    ),
    "stepped": block_in_steps,
    "written": lambda: of(written.block(2)),
    "written, degree 2": lambda: of(written.block(2, 2)),
    "written, 3-D": lambda: of(written.block(3)),
    "written, electric": lambda: of(written.electric(2)),
    "written, electric, 3-D": lambda: of(written.electric(3)),
    "crystal, 2-D": lambda: of(crystal(2, False)),
    "crystal, 3-D": lambda: of(crystal(3, False)),
    "crystal, piezo": lambda: of(crystal(2, True)),
    "bolt": lambda: of(bolt()),
    "bed": lambda: of(bed()),
    "shape, sphere": lambda: of(shape(shape="sphere", centre=[0.0, 0.0, 1.0], radius=1.0)),
    "shape, punch": lambda: of(
        shape(
            shape="punch",
            centre=[0.03, 0.02, 0.0],
            axis=[0.0, 0.0, 1.0],
            radius=0.6,
            edge_radius=0.2,
        )
    ),
    "shape, cylinder": lambda: of(
        shape(shape="cylinder", point=[0.0, 0.0, 1.5], axis=[1.0, 0.2, 0.0], radius=1.5)
    ),
    "shape, cone": lambda: of(
        shape(shape="cone", apex=[0.03, 0.02, 0.0], axis=[0.0, 0.0, 1.0], half_angle=80.0)
    ),
    "shape, distance": lambda: of(
        shape(shape="distance", distance="sqrt(x**2 + 2*y**2 + (z - 1)**2) - 1")
    ),
    "Tresca": lambda: of(
        parse_case(tables.changed(friction={"law": "tresca", "bound": "0.0003*x"}, solver=None))
    ),
    "mu(p)": mu_of_pressure,
    "interior point": interior_point,
    "derivatives, tangent": partial(derivatives, "tangent"),
    "derivatives, adjoint": partial(derivatives, "adjoint"),
    "derivatives of charge": derivatives_of_charge,
}


def _cyclic(kind: str, **material: Any) -> Case:
    """Return a homogeneous body that yields in both directions."""
    values = plasticity.path(0.02, -0.01, steps=2)
    if "oedometer" in kind:
        values = [-value for value in plasticity.path(0.02, 0.005, steps=2)]
    times = [float(k + 1) for k in range(len(values))]
    if not isinstance(material.get("hardening"), list):
        material["yield_stress"] = 0.2
    return plasticity.homogeneous(kind, {"young": 100.0, **material}, times, values)


#: Table or figure of the thesis -> values: counts of its algorithms, and a solution of a figure.
THESIS: Mapping[str, Callable[[], dict[str, Value]]] = {
    **{
        f"Table 7.1, {load}, {name}": partial(counts, bar(8, load, rho, *changes))
        for load, rho in ((-0.005, 1e5), (-0.05, 6e7))
        for name, changes in (
            ("thesis", table_7_1.STOPPING),
            ("converged", table_7_1.CONVERGED),
            ("single", ("solver.method=uzawa", "solver.single_loop=true")),
        )
    },
    "Table 7.1, printed": partial(
        counts,
        bar(8, -0.005, 1e5, *table_7_1.STOPPING, table_7_1.PLAIN,
            f"solver.r={table_7_1.PER_MILLIMETRE}"),
    ),
    **{
        f"Table 7.2, {load}, {name}": partial(
            counts,
            bar(8, load, table_7_2.RHO, "solver.method=penalty", f"solver.eps_contact={eps}",
                *changes),
        )
        for load, eps in ((-0.005, 1e-3), (-0.05, 1e-4))
        for name, changes in (
            ("thesis", ("solver.stopping=thesis", "solver.material_step=secant")),
            ("converged", ()),
        )
    },
    **{
        f"Table {number}, {name}": partial(
            counts, on_grid(file, (16, 8), "electric.phi_f=8", *changes)
        )
        for number, (file, _) in tables_piezo.THESIS.items()
        for name, changes in (
            ("Algorithm 4", (*tables_piezo.LAGGED, *tables_piezo.BY_CHANGE)),
            ("implicit", (tables_piezo.UZAWA,)),
        )
    },
    **{
        f"Table 8.4{suffix}, {name}": partial(
            counts,
            on_grid(
                f"compliance-8-4{suffix}", (24, 4), "friction.mu=0.068", "electric.k_e=0.068",
                *changes,
            ),
        )
        for suffix in ("", "-layer")
        for name, changes in (("Algorithm 6", tables_compliance.LAGGED), ("implicit", ()))
    },
    **{
        f"Figure {number}": partial(
            of, bar(8, load, 1e4, "output.fields=none")
        )
        for number, load in (("7.4", -0.005), ("7.5", -0.05))
    },
    **{
        f"Figure {number}": partial(
            of_case_itself,
            bar(8, load, 1e4, "solver.method=penalty", "solver.eps_contact=1.05e-5",
                f"solver.tolerance={TIGHT}"),
        )
        for number, load in (("7.7", -0.005), ("7.8", -0.05))
    },
}  # fmt: skip

#: All problems.
PROBLEMS: Mapping[str, Callable[[], dict[str, Value]]] = {
    **{f"case {name}": partial(of_case, name) for name in COARSE},
    **{f"example {name}": partial(of_example, name) for name in EXAMPLES},
    **{
        f"variant {name}": partial(of_case, case, *changes)
        for name, (case, changes) in VARIANTS.items()
    },
    **{f"problem {name}": make for name, make in IN_PYTHON.items()},
    **THESIS,
}
