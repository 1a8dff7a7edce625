"""The reference page of the output files, made from the description of each key.

``python3 -m scripts.output_page`` writes ``docs/output.md``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from contact.io.tables import described
from contact.results import quantity as q

#: Formulas in Markdown for the symbols of the command line's help.
FORMULAS = {"σ_ν": r"$\sigma_\nu$", "σ_τ": r"$\sigma_\tau$", "u_τ": r"$u_\tau$"}

PAGE = Path(__file__).parents[1] / "docs" / "output.md"

INTRODUCTION = """\
# Output files

<!-- Made by `python3 -m scripts.output_page`; its entries are in contact/results. -->

`contact solve CASE.toml --out DIR` writes into DIR:

| file | contents |
|---|---|
| `summary.json` | the numbers of the run as a whole |
| `contact.csv` | one row per contact node |
| `history.csv` | one row per outer iteration |
| `steps.csv` | of an evolution: one row per step |
| `contact-steps.csv` | of an evolution: `contact.csv` of all steps, with a first column `t` |
| `adapt.csv` | with `[mesh.adapt]`: one row per mesh |
| `fields.vtu` | all fields of the body, for ParaView, pyvista and meshio |
| `contact.vtu` | the contact part alone, a surface (in 2-D a line) |
| `contact-against.csv`, `.vtu` | between bodies: the master side, with its stresses |
| `fields.pvd`, `contact.pvd` | of an evolution: steps of body and contact part, for ParaView |
| `fields.bp`, `cells.bp` | instead of `fields.vtu`, with `output.fields = "vtx"`: needs ADIOS2 |
| `fields.xdmf`, `fields.h5` | the same with `output.fields = "xdmf"`: degree 1 at most |
| `checkpoint.npz` | with `output.checkpoint = true` |
| `figure-*.png` | with `--plot`, and by `contact plot DIR` |
| `figure-*-step-N.png` | of a step of an evolution, by `contact plot DIR --step N` |

Once all files are complete, they replace those of an earlier run; other files in DIR are not
touched. Results of another problem are replaced with `--overwrite` only. The same problem may be
solved again by another method, to another tolerance, with other outputs.

**Large bodies.** A file is one whatever the number of ranks: rank 0 gathers and writes it. Instead,
all ranks write with `output.fields = "vtx"`.

`contact sweep` writes `sweep.csv`, one row per case, and `sweep.toml`, the case that was swept.

**Units** are those of the case: with millimetres and newtons, stresses are in MPa. In 2-D forces
and charges are per unit of depth. For bodies of revolution they are those of the full turn, and
resultants along r are 0.

**Signs.** ν points out of the body, to the foundation.

- Pressure is positive. Contact forces and friction stresses are those of the body *on the
  foundation*, reactions those of the supports *on the body*.
- Stresses in the body are positive in tension.
- In 2-D tangential components are along ν rotated counter-clockwise by 90 degrees: at the bottom of
  a body, where ν points down, along x.
- Charges of surfaces are D·ν, the opposite of the free charge of an electrode there: a positive
  `charge` lowers the potential, while a positive `body_charge` raises it.

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

`contact plot` draws figures from these files in other formats and of other fields:

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
    q.ADAPT: "",
    q.SWEEP: "",
    q.BODY: "At the nodes. All but displacement and potential are averages of the cells around a "
    "node, weighted by volume, within each region: a node between regions is a point of "
    "each. NAME`_cell` has the values of the cells.",
    q.SURFACE: "At the nodes; `nan` where a node is constrained and therefore not a contact node.",
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


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
