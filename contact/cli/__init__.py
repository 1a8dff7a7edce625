"""The command line: ``contact solve`` and ``contact check``, progress, exit status."""
