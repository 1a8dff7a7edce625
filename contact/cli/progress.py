"""What the command line shows of a solve: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from mpi4py import MPI

from contact.methods.report import Monitor, Record


@contextmanager
def progress(comm: MPI.Intracomm, quiet: bool = False) -> Iterator[Monitor | None]:
    """Show the logs of ``contact`` on rank 0 and yield a monitor for the outer iterations.

    Parameters
    ----------
    comm
        Communicator of the solve.
    quiet
        Show warnings alone.
    """
    logger = logging.getLogger("contact")
    iterations = logging.getLogger("contact.solver")
    levels = logger.level, iterations.level
    handler = logging.StreamHandler(sys.stderr) if comm.rank == 0 else logging.NullHandler()
    handler.setFormatter(logging.Formatter("%(message)s"))
    logger.addHandler(handler)
    logger.setLevel(logging.WARNING if quiet or comm.rank > 0 else logging.INFO)
    try:
        if comm.rank == 0 and not quiet and sys.stderr.isatty():
            # The bar says what these lines would.
            iterations.setLevel(logging.WARNING)
            with _bar(logger) as monitor:
                yield monitor
        else:
            yield None
    finally:
        logger.removeHandler(handler)
        logger.setLevel(levels[0])
        iterations.setLevel(levels[1])


@contextmanager
def _bar(logger: logging.Logger) -> Iterator[Monitor]:
    from tqdm import tqdm
    from tqdm.contrib.logging import logging_redirect_tqdm

    with tqdm(unit=" iterations", file=sys.stderr) as bar, logging_redirect_tqdm([logger]):

        def show(record: Record) -> None:
            kkt = record.kkt
            bar.set_postfix_str(
                f"{record.inner} solves, residuals {kkt.equilibrium:.1e} {kkt.contact:.1e} "
                f"{kkt.friction:.1e} {record.note}",
                refresh=False,
            )
            bar.update()

        yield show
