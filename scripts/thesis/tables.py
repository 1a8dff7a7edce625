"""All tables of the thesis beside ours: `make tables` (`ARGS="--coarse"` for a quick look).

`python3 -m scripts.thesis.tables [--out DIR] [--coarse] [--only SCRIPT...]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Sequence

from scripts.thesis.chapters import PARTS, run


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the scripts that make tables."""
    run([part for part in PARTS if part.tables], __doc__, arguments)


if __name__ == "__main__":
    main()
