"""``python3 -m contact``: see `contact.cli.main`."""

import signal
import sys
import traceback
from pathlib import Path

if __name__ == "__main__":
    # The working folder comes first in the path, and may have `forms` or `meshes` of its own.
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    # No traceback of the import below: until `main` has its handlers, Ctrl-C just ends this.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        from contact.cli.main import run
    except Exception:  # Python's own status would say that a solve has not converged
        traceback.print_exc()
        sys.exit(70)
    run()
