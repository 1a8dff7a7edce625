"""Run the notebooks and write them as pages with their figures: ``python3 docs/render.py``.

The pages go to ``docs/notebooks``, for Sphinx; they are not kept in the repository.
"""

import base64
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import jupytext
from nbclient import NotebookClient

ROOT = Path(__file__).parents[1]
PAGES = Path(__file__).parent / "notebooks"
NOTEBOOKS = (
    *sorted((ROOT / "scripts" / "notebooks").glob("[a-z]*.py")),
    ROOT / "scripts" / "examples" / "explore_forms.py",
)


def render(path: Path) -> None:
    """Execute a notebook and write its page."""
    notebook = jupytext.read(path)
    place = {"metadata": {"path": str(ROOT)}}
    NotebookClient(notebook, timeout=600, kernel_name="python3", resources=place).execute()
    source = path.relative_to(ROOT).as_posix()
    lines: list[str] = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            lines += [cell.source, ""]
            continue
        if cell.cell_type != "code" or not cell.source.strip():
            continue
        lines += ["```python", cell.source, "```", ""]
        for output in cell.outputs:
            lines += _output(output, path.stem)
    lines += [f"*This page is the notebook `{source}`, executed.*", ""]
    PAGES.mkdir(exist_ok=True)
    (PAGES / f"{path.stem}.md").write_text("\n".join(lines), encoding="utf-8")


def _output(output: dict, stem: str) -> list[str]:
    """Return what a cell has shown: figures, HTML or text; warnings go to no page."""
    if output["output_type"] == "stream":
        return [] if output["name"] == "stderr" else ["```text", output["text"].rstrip(), "```", ""]
    data = output.get("data", {})
    if "image/png" in data:
        number = len(list(PAGES.glob(f"{stem}-*.png"))) + 1
        PAGES.mkdir(exist_ok=True)
        name = f"{stem}-{number}.png"
        (PAGES / name).write_bytes(base64.b64decode(data["image/png"]))
        return [f"![figure]({name})", ""]
    if "text/html" in data:
        return [data["text/html"], ""]
    return ["```text", data.get("text/plain", ""), "```", ""]


def main(names: Sequence[str]) -> None:
    """Render the notebooks named, or all, as many at a time as there are cores."""
    os.environ.pop("MPLBACKEND", None)  # the kernels show figures in the notebook
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    chosen = [path for path in NOTEBOOKS if not names or path.stem in names]
    for path in chosen:
        for old in PAGES.glob(f"{path.stem}*"):
            old.unlink()
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
        for path, _ in zip(chosen, pool.map(render, chosen), strict=True):
            print(f"docs/notebooks/{path.stem}.md", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
