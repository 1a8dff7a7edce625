"""Command line: ``python3 -m meshes GENERATOR --size 0.5 --out body.msh``."""

import argparse
import inspect
import sys

from contact.errors import InputError
from meshes import CELLS, GENERATORS, parameters, write


def main(arguments: list[str] | None = None) -> int:
    """Write a generator's mesh; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python3 -m meshes", description="Write a .msh file.")
    generators = parser.add_subparsers(dest="generator", required=True)
    for name, generator in GENERATORS.items():
        text = inspect.getdoc(generator) or ""
        options = generators.add_parser(name, help=text.split("\n")[0], description=text)
        for key, default in parameters(name).items():
            options.add_argument(
                f"--{key.replace('_', '-')}", type=float, default=default, help=f"[{default:g}]"
            )
        options.add_argument("--cell", choices=CELLS, help="shape of the cells")
        options.add_argument("--order", type=int, default=1, choices=(1, 2), help="of the cells")
        options.add_argument("--out", required=True, metavar="FILE.msh")
        options.add_argument("--format", type=float, default=4.1, choices=(2.2, 4.1))
    given = vars(parser.parse_args(arguments))
    chosen, out, version = given.pop("generator"), given.pop("out"), given.pop("format")
    try:
        write(chosen, out, version=version, **given)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
