"""Errors that a user can mend."""


class InputError(ValueError):
    """Bad input: the message names the fault and the accepted values.

    The command line prints the message alone and leaves with exit status 2.
    """


class SingularError(InputError):
    """A linear system has no solution, for nothing holds the body where it is linearised."""
