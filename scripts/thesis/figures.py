"""All figures of the thesis and their counterparts: `make figures`.

`python3 -m scripts.thesis.figures [--out DIR] [--coarse] [--only SCRIPT...]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Sequence

from scripts.thesis.chapters import PARTS, run


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the scripts that make figures."""
    run([part for part in PARTS if part.figures], __doc__, arguments)


if __name__ == "__main__":
    main()
