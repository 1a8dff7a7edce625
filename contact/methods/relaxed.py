"""The road of the block relaxation, which damps what Newton's loop lets cycle."""

from __future__ import annotations

from contact.linear.operator import Counters
from contact.methods.fixed_point import FixedPoint
from contact.methods.options import FixedPointOptions, with_method
from contact.methods.report import Outcome, Record
from contact.methods.search import Search
from contact.methods.step import Iterate

#: What the history says of this road.
BLOCK_RELAXATION = "block relaxation"


def block_relaxation(search: Search, counters: Counters) -> tuple[Iterate, Outcome]:
    """Solve by the fixed point over block relaxation, from rest."""

    def note(record: Record) -> None:
        search.see(Iterate(relaxed.state), record.kkt)
        search.history.record(record.kkt, BLOCK_RELAXATION, record.inner)

    limit = min(FixedPointOptions.max_outer, search.left)
    options = with_method(search.options, FixedPointOptions, max_outer=limit)
    relaxed = FixedPoint(search.problem, options, note, counters, search.history.poll)
    state, outcome = relaxed.solve()
    return Iterate(state), outcome
