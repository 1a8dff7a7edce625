"""``python3 -m contact``: see `contact.cli.main`."""

import signal
import sys
import traceback

if __name__ == "__main__":
    # No traceback of the import below: until `main` has its handlers, Ctrl-C just ends this.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        from contact._neighbours import check_neighbours
        from contact.errors import InputError

        try:
            check_neighbours()
        except InputError as error:
            print(f"contact: {error}", file=sys.stderr)
            sys.exit(2)
        from contact.cli.main import run
    except Exception:  # Python's own status would say that a solve has not converged
        traceback.print_exc()
        sys.exit(70)
    run()
