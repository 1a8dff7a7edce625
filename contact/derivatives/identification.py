"""Parameters from measurements: least squares on the columns of ``steps.csv``.

An evaluation costs one run, and a back-substitution per parameter and step
(`contact.derivatives.by_parameters`).

References
----------
Nocedal and Wright, Numerical Optimization, 2nd ed. (2006), chapter 10; Bates and Watts, Nonlinear
Regression Analysis and Its Applications (1988), for the intervals.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares
from scipy.stats import t as student

from contact.arguments import expect
from contact.case.file import Case, number_at, with_number
from contact.derivatives.by_parameters import sensitivity
from contact.errors import InputError
from contact.methods.report import Monitor
from contact.solution import Solution
from contact.solving import solve
from contact.typing import Array

logger = logging.getLogger("contact.identify")

#: The column with the times of a measurement.
TIME = "t"

#: Ratio to the largest singular value of an undetermined combination of parameters, and least part
#: of a parameter in it.
UNSEEN, SHARE = 1e-8, 1e-4

#: Relative distance of the start from a bound: more than that of SciPy.
INSIDE = 2e-10

#: Relative changes of parameters and misfit at the end.
ENOUGH = 1e-10


@dataclass(frozen=True)
class Identified:
    """Parameters that fit measurements best.

    Attributes
    ----------
    parameters
        Key -> value.
    intervals
        Key -> the bounds of its interval, with the probability `level`.
    level
        0.95 by default.
    covariance, correlation
        Of the parameters in this order, shape (k, k), from the derivatives at the solution and the
        scatter of the residuals.
    undetermined
        Parameters that the measurements do not determine, alone or in a combination with the others
        here: infinite interval, infinite variance, covariances nan.
    at_bound
        Parameters whose value is a bound; their intervals are those without it.
    fits
        Of each measurement: column -> its values in the model at the measured times.
    misfit
        Root mean square of the residuals, each over the largest value of its column.
    solutions
        The run of each case with these parameters.
    evaluations
        Runs that the search took.
    """

    parameters: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    level: float
    covariance: Array
    correlation: Array
    undetermined: tuple[str, ...]
    at_bound: tuple[str, ...]
    fits: tuple[dict[str, Array], ...]
    misfit: float
    solutions: tuple[Solution, ...]
    evaluations: int


def identify(
    case: Case | Sequence[Case],
    data: Mapping[str, ArrayLike] | Sequence[Mapping[str, ArrayLike]],
    parameters: Sequence[str],
    bounds: Mapping[str, tuple[float, float]] | None = None,
    level: float = 0.95,
    monitor: Monitor | None = None,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
) -> Identified:
    """Return the parameters of a case with which it fits measurements best. Collective.

    Parameters
    ----------
    case
        A case with [evolution], or several that share the parameters. Its own numbers are the
        initial guess.
    data
        Measurements: column of ``steps.csv`` -> values, with the times ``t``, which lie within
        those of the case. Several cases have one each. Between the ends of steps the model is
        linear.
    parameters
        Keys of the case with a number, ``friction.mu``, in all cases.
    bounds
        Key -> least and largest value; by default 0 is the least where the case accepts no negative
        number, as of a modulus and a coefficient of friction. A trial that the case does not
        accept, or that cannot be solved, is taken back.
    level
        Probability of the intervals.
    monitor
        Called after every outer iteration of a run.
    comm
        Communicator of the meshes.

    Returns
    -------
    The parameters with their intervals, and the fitted columns.

    Raises
    ------
    InputError
        If a key, a column, a bound or a time does not fit, there are no more measurements than
        parameters, or the first run does not converge.

    Examples
    --------
    >>> found = identify(case, read_data("loop.csv"), ["friction.mu"])  # doctest: +SKIP
    >>> found.intervals["friction.mu"]  # doctest: +SKIP
    (0.297, 0.303)
    """
    cases = [case] if isinstance(case, Case) else list(case)
    measurements = [data] if isinstance(data, Mapping) else list(data)
    expect("data", len(measurements), f"{len(cases)}, one a case", len(measurements) == len(cases))
    single = not isinstance(parameters, str) and len(set(parameters)) == len(parameters)
    accepted = "a list of keys, each once"
    expect("parameters", parameters, accepted, single and len(parameters) > 0)
    for key in (bounds or {}).keys() - set(parameters):
        expect("bounds", key, f"one of the parameters {', '.join(parameters)}", False)
    models = [_Model(*pair, comm, monitor) for pair in zip(cases, measurements, strict=True)]
    first = np.array([number_at(cases[0], key) for key in parameters])
    bounds = bounds or {}
    limits = [bounds.get(key) or (_least(cases, key), np.inf) for key in parameters]
    count = sum(model.count for model in models)
    enough = f"more than {len(parameters)}, the number of parameters"
    expect("data", f"{count} values", enough, count > len(parameters))
    for key, value, (low, high) in zip(parameters, first, limits, strict=True):
        accepted = f"some around {value:g}, its number in the case"
        expect(f"bounds: {key}", f"{low:g} to {high:g}", accepted, low <= value <= high)

    last = dict[bytes, Array]()

    def residuals(values: Array) -> Array:
        key = values.tobytes()
        if key not in last:
            last.clear()
            numbers = dict(zip(parameters, values, strict=True))
            last[key] = np.concatenate([model.residuals(numbers) for model in models])
        return last[key]

    def trial(values: Array) -> Array:
        try:
            return residuals(values)
        except InputError as error:
            logger.info("%s: taken back", error)
            return np.full(count, np.inf)  # SciPy takes a shorter step

    def jacobian(values: Array) -> Array:
        return np.concatenate([model.jacobian(parameters) for model in models])

    low, high = np.transpose(limits)
    inside = INSIDE * np.maximum(1.0, np.abs(first))
    begin = np.clip(first, low + inside, np.maximum(high - inside, low + inside))
    residuals(begin)  # its errors are the user's
    optimum = least_squares(
        trial,
        begin,
        jac=jacobian,
        bounds=(low, high),
        x_scale="jac",
        ftol=ENOUGH,
        xtol=ENOUGH,
        gtol=ENOUGH,
    )
    size = np.maximum(np.abs(first), np.abs(optimum.x))
    scale = np.where(size > 0, size, 1.0)
    residual = residuals(optimum.x)
    freedom = residual.size - optimum.x.size
    covariance, unseen = _covariance(optimum.jac, scale, residual @ residual / freedom)
    deviation = np.sqrt(np.diag(covariance))
    half = student.ppf(0.5 * (1 + level), freedom) * deviation
    size = np.where((deviation > 0) & ~unseen, deviation, 1.0)
    undetermined = tuple(key for key, hidden in zip(parameters, unseen, strict=True) if hidden)
    if undetermined:
        logger.warning(
            "%s: the measurements do not determine these parameters: near the values found they do "
            "not change with them; another first value may lead elsewhere",
            ", ".join(undetermined),
        )
    return Identified(
        parameters=dict(zip(parameters, optimum.x.tolist(), strict=True)),
        intervals={
            key: (float(value - way), float(value + way))
            for key, value, way in zip(parameters, optimum.x, half, strict=True)
        },
        level=level,
        covariance=covariance,
        correlation=covariance / np.outer(size, size),
        undetermined=undetermined,
        at_bound=tuple(key for key, on in zip(parameters, optimum.active_mask, strict=True) if on),
        fits=tuple(model.fit for model in models),
        misfit=float(np.sqrt(np.mean(residual**2))),
        solutions=tuple(model.solution for model in models),
        evaluations=optimum.nfev,
    )


def _covariance(slopes: Array, scale: Array, variance: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return the covariance of the parameters, and which are undetermined.

    Of derivatives (n, k) of the residuals, sizes (k,) of the parameters, variance of a residual.
    """
    _, singular, directions = np.linalg.svd(slopes * scale, full_matrices=False)
    seen = singular > UNSEEN * singular.max()
    unseen = np.abs(directions[~seen]).max(axis=0, initial=0.0) > SHARE
    factor = directions[seen] / singular[seen, None]
    covariance = variance * np.outer(scale, scale) * (factor.T @ factor)
    covariance[unseen] = covariance[:, unseen] = np.nan
    covariance[unseen, unseen] = np.inf
    return covariance, unseen


def _least(cases: Sequence[Case], key: str) -> float:
    """Return 0 where a case accepts no negative number at a key, else minus infinity."""
    try:
        for case in cases:
            with_number(case, key, -(abs(number_at(case, key)) or 1.0))
    except InputError:
        return 0.0
    return -np.inf


class _Model:
    """A case and a measurement."""

    solution: Solution
    fit: dict[str, Array]

    def __init__(
        self,
        case: Case,
        data: Mapping[str, ArrayLike],
        comm: MPI.Intracomm,
        monitor: Monitor | None,
    ) -> None:
        self._case, self._comm, self._monitor = case, comm, monitor
        if case.evolution is None:
            raise InputError(
                f"{case.source}: evolution: missing; accepted: a case with load steps", "missing"
            )
        arrays = {name: np.asarray(values, dtype=float) for name, values in data.items()}
        if TIME not in arrays or len(arrays) < 2:
            raise InputError(
                f"data: columns {', '.join(arrays)}; accepted: t and columns of steps.csv",
                "data-file",
            )
        self._time = arrays.pop(TIME)
        expect("data", "no rows", "one row or more", self._time.size > 0)
        self._measured = arrays
        for name, values in arrays.items():
            fits = values.shape == self._time.shape and bool(np.all(np.isfinite(values)))
            expect(f"data: {name}", values, f"{self._time.size} finite numbers, as of t", fits)
        begin, end = case.evolution.times[0], case.evolution.times[-1]
        inside = bool(np.all((self._time >= begin) & (self._time <= end)))
        expect("data: t", self._time, f"times between {begin:g} and {end:g}", inside)
        self._scale = {name: np.abs(v).max() or 1.0 for name, v in arrays.items()}

    @property
    def count(self) -> int:
        """Number of measured values."""
        return self._time.size * len(self._measured)

    def residuals(self, values: Mapping[str, float]) -> Array:
        """Solve the case with values of the parameters; return the scaled residuals."""
        case = self._case
        for key, value in values.items():
            case = with_number(case, key, float(value))
        self.solution = solve(case, monitor=self._monitor, comm=self._comm)
        shown = ", ".join(f"{key} = {value:g}" for key, value in values.items())
        if not self.solution.converged:
            reason = self.solution.outcome.reason
            raise InputError(
                f"{shown}: {reason}; accepted: numbers with which the case converges",
                "identification-start",
            )
        rows = [record.row for record in self.solution.steps]
        columns = ", ".join(rows[0])
        for name in self._measured:
            expect("data", name, f"columns of steps.csv: {columns}", name in rows[0])
        self.fit = {name: self._at([row[name] for row in rows]) for name in self._measured}
        scaled = [
            (self.fit[name] - measured) / self._scale[name]
            for name, measured in self._measured.items()
        ]
        misfit = float(np.sqrt(np.mean(np.square(scaled))))
        logger.info("%s: misfit %.3g of the largest values", shown, misfit)
        return np.concatenate(scaled)

    def jacobian(self, keys: Sequence[str]) -> Array:
        """Return the derivatives of the residuals of the last run."""
        slopes = sensitivity(self.solution, [*self._measured], keys, "tangent").steps
        return np.concatenate(
            [
                np.column_stack([self._at(slopes[name][key]) / self._scale[name] for key in keys])
                for name in self._measured
            ]
        )

    def _at(self, values: ArrayLike) -> Array:
        """Interpolate values at the ends of steps, 0 at the beginning, to the measured times."""
        assert self._case.evolution is not None
        begin = self._case.evolution.times[0]
        ends = [record.state.time for record in self.solution.steps]
        course = np.concatenate([[0.0], np.asarray(values, dtype=float)])
        return np.interp(self._time, [begin, *ends], course)
