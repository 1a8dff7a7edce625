"""The reference page of the output files, made from the description of each key.

``python3 -m scripts.output_page`` writes ``docs/output.md``.
"""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from contact.output import quantities as q
from contact.output.reference import described

#: Formulas in Markdown for the symbols of the command line's help.
FORMULAS = {"σ_ν": r"$\sigma_\nu$", "σ_τ": r"$\sigma_\tau$", "u_τ": r"$u_\tau$"}

PAGE = Path(__file__).parents[1] / "docs" / "output.md"

INTRODUCTION = """\
# Output files

<!-- Made by `python3 -m scripts.output_page`; edit contact/output/quantities.py instead. -->

`contact solve CASE.toml --out DIR` leaves in DIR:

| file | contents |
|---|---|
| `summary.json` | the numbers of the run as a whole |
| `contact.csv` | one row a contact node |
| `history.csv` | one row an outer iteration |
| `steps.csv` | of an evolution: one row a step |
| `contact-steps.csv` | likewise: `contact.csv` of all steps, with a first column `t` |
| `fields.vtu` | all fields of the body, for ParaView, pyvista and meshio |
| `contact.vtu` | the contact part alone, a surface (in the plane a line) |
| `contact-against.csv`, `.vtu` | between bodies: the other side, with the stresses there |
| `fields.pvd`, `contact.pvd` | of an evolution: steps of body and contact part, for ParaView |
| `fields.bp`, `cells.bp` | instead of `fields.vtu`, with `output.fields = "vtx"`: needs ADIOS2 |
| `fields.xdmf`, `fields.h5` | likewise with `output.fields = "xdmf"`: degree 1 at most |
| `checkpoint.npz` | with `output.checkpoint = true`; on several ranks a piece of each |
| `figure-*.png` | with `--plot`, and by `contact plot DIR` |
| `animation-*.gif` | of an evolution, by `contact plot DIR --animate` |

Of more than 100,000 contact nodes on several ranks, each rank writes its own: `contact.0000.csv`,
`contact.0001.csv` and so on, by x, y and z, and the pieces of `contact.pvtu`, which ParaView and
pyvista open as one; a `row` there is that in the file of the rank that has the node. So it does
with `contact-steps` and `contact-against`, and with a body of more nodes: `fields.pvtu`.
`node` numbers the points of all pieces, for those on two of them are in both. Figures are drawn of
a body in pieces, and not of contact nodes in pieces.

They replace those of an earlier run all together, once they are complete; other files in DIR are
left alone. Results of another problem are replaced with `--overwrite` only: the same one may be
solved again by another method, to another tolerance, with other outputs.

`contact sweep` leaves `sweep.csv`, one row a case, and `sweep.toml`, the case that was swept.

**Units.** All is in the units of the case: with millimetres and newtons, stresses are in MPa. In
the plane, forces and charges are those of a unit of depth; of bodies of revolution they are those
of the full turn, in which those along r cancel: resultants have 0 there.

**Signs.** ν points out of the body, to the foundation. Pressure is positive; contact forces and
friction stresses act from the body *on the foundation*, reactions from the supports *on the
body*. Stresses in the body are positive in tension. In the plane tangential numbers
count along ν turned counter-clockwise by 90 degrees: at the bottom of a body, where ν points down,
along x. Charges of surfaces are D·ν, the opposite of the free charge of an electrode there: a
positive `charge` lowers the potential, where a positive `body_charge` raises it.

## Opening them

```python
import json, csv
import pyvista

summary = json.load(open("results/summary.json"))
print(summary["converged"], summary["max_pressure"], summary["contact_force"])

with open("results/contact.csv") as file:
    rows = list(csv.DictReader(file))
print(max(float(row["pressure"]) for row in rows))

body = pyvista.read("results/fields.vtu")
print(body["displacement"].shape, body.cell_data["von_mises_cell"].max())
surface = pyvista.read("results/contact.vtu")
touching = surface["status"] > 0
print(surface["pressure"][touching].mean())
```

`pyvista.read("results/fields.vtu").warp_by_vector("displacement").plot(scalars="von_mises")` shows
the deformed body; `meshio.read` reads the same files. In ParaView: open, Apply, and the filter
*Warp By Vector*.

Figures are drawn again from these files, without a solve, in other formats and of other fields:

```sh
contact plot results --format pdf --width 85mm
contact plot results --field stress_xy --field displacement
```
"""


#: Sections of the page, and the text at the head of each.
SECTIONS: Mapping[str, str] = {
    q.SUMMARY: "",
    q.NODES: "",
    q.AGAINST: "",
    q.HISTORY: "",
    q.STEPS: "",
    q.SWEEP: "",
    q.BODY: "At the nodes. All but displacement and potential are averages of the cells around a "
    "node, weighted by volume, in each region for itself: a node between regions is a point of "
    "each. As they are, they stand in the cells under NAME`_cell`.",
    q.SURFACE: "At the nodes; `nan` where a node is held and hence no contact node.",
    q.OPPOSITE: "",
}


def page() -> str:
    """Return the reference page (Markdown)."""
    lines = [INTRODUCTION]
    for file, head in SECTIONS.items():
        lines += [f"## {file}", "", *([head, ""] if head else []), *_rows(file), ""]
    return "\n".join(lines)


def _rows(file: str) -> Iterator[str]:
    kind = {"json": "key", "csv": "column"}.get(file.rpartition(".")[2], "field")
    yield from (f"| {kind} | unit | meaning |", "|---|---|---|")
    for name, quantity, text in described(file):
        text = text.replace("|", r"\|")
        for plain, formula in FORMULAS.items():
            text = text.replace(plain, formula)
        yield f"| `{name}` | {quantity.unit or '—'} | {text} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the page."""
    ArgumentParser("python3 -m scripts.output_page", description=__doc__).parse_args(arguments)
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
