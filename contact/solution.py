"""The solution that `solve` returns: results of a problem, with figures drawn from its files.

`results/` knows neither files nor figures: its `Results` have numbers and fields alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from contact.results.solution import Results
from contact.writing import written

if TYPE_CHECKING:
    from contact.plot.figures import Gallery


class Solution(Results):
    """The solution of a problem, or the state at which its method has ended, and its figures.

    Its attributes are those of `contact.results.solution.Results`.
    """

    def plot(self, *fields: str, width: float | None = None) -> Gallery | None:
        """Return the figures on rank 0, which a notebook shows; None elsewhere. Collective.

        Parameters
        ----------
        fields
            Fields to colour the body by, as ``contact plot --field`` takes them. By default
            contact part, von Mises stress and potential are drawn.
        width
            Of the figures (inches).

        Returns
        -------
        The figures.

        Raises
        ------
        InputError
            If there is no such field.
        """
        from contact.plot.figures import Look, figures_of  # which take a while to load

        run = written(self)
        return None if run is None else figures_of(run, fields, Look(width))

    def view(self, field: str | None = None) -> Any:
        """Show a body in 3-D in a window or a notebook, on rank 0. Collective.

        Parameters
        ----------
        field
            To colour the body by, as `plot` takes it; by default the contact pressure.
        """
        from contact.plot.figures import window  # which takes a while to load

        run = written(self)
        return None if run is None else window(run, field).show()
