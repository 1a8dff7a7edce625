"""``python3 -m contact``: see `contact.cli.main`."""

import signal
import sys

if __name__ == "__main__":
    # No traceback of the import below: until `main` has its handlers, Ctrl-C just ends this.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from contact.cli.main import main

    sys.exit(main())
