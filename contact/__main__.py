"""``python3 -m contact``: see `contact.cli.main`."""

import signal
import sys
import traceback
from importlib.util import find_spec
from pathlib import Path

from contact.errors import InputError


def check_neighbours() -> None:
    """Refuse to go on with another's ``forms`` or ``meshes``, as from the working folder.

    Raises
    ------
    InputError
        If one of them is not where this package is, or missing.
    """
    root = Path(__file__).resolve().parents[1]
    for name in ("forms", "meshes"):
        spec = find_spec(name)
        places = [] if spec is None else [spec.origin, *(spec.submodule_search_locations or [])]
        origin = next((place for place in places if place is not None), None)
        if origin is None or not Path(origin).resolve().is_relative_to(root / name):
            given = f"{Path(origin)} hides" if origin else "there is not"
            raise InputError(
                f"{given} the package {name!r} of contact-fenicsx, {root / name}; accepted: "
                "another name for that file or folder, or another folder to run in"
            )


if __name__ == "__main__":
    # No traceback of the import below: until `main` has its handlers, Ctrl-C just ends this.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        check_neighbours()
        from contact.cli.main import run
    except InputError as error:
        print(f"contact: {error}", file=sys.stderr)
        sys.exit(2)
    except Exception:  # Python's own status would say that a solve has not converged
        traceback.print_exc()
        sys.exit(70)
    run()
