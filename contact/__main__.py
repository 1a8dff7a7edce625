"""``contact`` and ``python3 -m contact``: see `contact.cli.main`."""

import signal
import sys
import traceback
from pathlib import Path
from typing import NoReturn

from contact.errors import InputError, installed


def run() -> NoReturn:
    """Run the command line and leave with its status."""
    # No traceback of the import below: until `main` has its handlers, Ctrl-C just ends this.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        with installed():
            from contact.cli.main import main
    except InputError as error:
        print(f"contact: {error}", file=sys.stderr)
        sys.exit(2)
    except Exception:  # Python's own status would say that a solve has not converged
        traceback.print_exc()
        sys.exit(70)
    sys.exit(main())


if __name__ == "__main__":
    # The working folder comes first in the path, and may have `forms` or `meshes` of its own.
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    run()
