"""ARX, ARMAX, output-error and Box-Jenkins models of any order."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval, Len
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.blocks.fields import vector
from mckibben.errors import DataError, ModelError
from mckibben.estimators.base import Estimator
from mckibben.estimators.data import Run, TrainingData
from mckibben.estimators.linear.polynomials import Orders, Polynomials
from mckibben.estimators.linear.prediction_error import (
    arx,
    evaluate,
    minimise,
    starting_points,
)
from mckibben.estimators.search import Tracker

Array = NDArray[np.float64]

Order = Annotated[int, Interval(ge=0, le=20)]
Lag = Annotated[int, Interval(ge=0, le=120)]


@dataclass(frozen=True)
class Noise:
    """The noise model of a prediction-error fit: C / D and the standard deviation of e."""

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]
    deviation: float


def stretches(run: Run, shortest: int) -> list[Run]:
    """Return the stretches of a run whose samples all count, each to be started on its own.

    Predictions feed on outputs before them, which may not be looked at where they do not count.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], run.counts, [False]])))
    return [
        Run(
            run.u[start:stop],
            run.y[start:stop],
            run.counts[start:stop],
            run.sample_time,
            run.scheduled[start:stop],
        )
        for start, stop in edges.reshape(-1, 2)
        if stop - start > shortest
    ]


@dataclass(kw_only=True, repr=False, eq=False)
class PredictionErrorEstimator(Estimator):
    """An estimator of a linear model by one-step prediction errors, run free ever after.

    After `fit`, ``noise_`` holds the noise model.

    Parameters
    ----------
    n_zeros : int
        Coefficients of B, at least 1.
    delay : int
        Samples before B's first coefficient.
    n_starts : int
        Starting points.
    """

    n_zeros: Annotated[int, Interval(ge=1, le=20)] = 2
    delay: Annotated[int, Interval(ge=0, le=100)] = 0
    n_starts: Annotated[int, Interval(ge=1, le=1000)] = 12

    rises: ClassVar[bool] = False

    @property
    @abstractmethod
    def orders(self) -> Orders:
        """How many coefficients each polynomial has."""

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the transfer function found, and the data."""
        step = data.sample_time
        if step is None:
            raise DataError(
                "the recordings have no time, and this model depends on rate",
                remedy="read them with a time column or --rate, or use gpi",
            )
        if self.initial == "fitted":
            raise ModelError(
                "prediction errors always estimate the state before the first sample. "
                "Remedy: leave initial out."
            )
        orders = self.orders
        if data.target.size <= orders.size + orders.poles * len(data.runs):
            raise DataError(
                f"{data.target.size} samples are too few for {orders.size} parameters",
                remedy="give longer recordings, or lower orders",
            )
        centre = float(np.mean(np.concatenate([run.u for run in data.runs])))
        middle = float(np.mean(data.target))
        runs = [
            replace(piece, u=piece.u - centre, y=piece.y - middle)
            for run in data.runs
            for piece in stretches(run, orders.size)
        ]
        if orders.c == orders.d == orders.f == 0:
            theta = arx(runs, orders)
            tracker.saw(theta, evaluate(theta, orders, runs)[2])
        else:
            starts = starting_points(runs, orders, self.n_starts, self.seed)
            theta = minimise(runs, orders, starts, tracker)
        p = Polynomials.of(theta, orders)
        deviation = evaluate(theta, orders, runs)[2]
        self.noise_ = Noise((1.0, *vector(p.c)), (1.0, *vector(p.d)), deviation)
        constant = p.constant / (1.0 + float(p.poles.sum())) if orders.a else p.constant
        numerator = np.zeros(1 + max(orders.input_lags))
        numerator[[*orders.input_lags]] = p.b
        block = TransferFunction(
            vector(numerator),
            vector(p.poles),
            step,
            centre,
            middle + constant,
            self.starting_rule,
            **self.channels(data),
        )
        if not block.is_stable:
            radius = float(np.abs(block.poles).max())
            raise ModelError(
                f"the model found is unstable (a pole at |z| = {radius:.4g}). "
                "Remedy: use other orders, or output-error (oe), which is kept stable."
            )
        return block, data


@dataclass(kw_only=True, repr=False, eq=False)
class ARXEstimator(PredictionErrorEstimator):
    """ARX model, A y = B u + e, by linear least squares.

    Parameters
    ----------
    n_poles : int
        Order of A.
    """

    effort: ClassVar[float] = 0.02

    n_poles: Order = 2

    @property
    def orders(self) -> Orders:
        """A and B."""
        return Orders(b=self.n_zeros, a=self.n_poles, delay=self.delay)


@dataclass(kw_only=True, repr=False, eq=False)
class ARMAXEstimator(ARXEstimator):
    """ARMAX model, A y = B u + C e.

    Parameters
    ----------
    n_noise : int
        Order of C.
    """

    effort: ClassVar[float] = 1.0

    n_noise: Order = 2

    @property
    def orders(self) -> Orders:
        """A, B and C."""
        return Orders(b=self.n_zeros, a=self.n_poles, c=self.n_noise, delay=self.delay)


@dataclass(kw_only=True, repr=False, eq=False)
class OutputErrorEstimator(PredictionErrorEstimator):
    """Output-error model, y = B / F u + e: the best free run of its orders.

    Parameters
    ----------
    n_poles : int
        Order of F.
    """

    effort: ClassVar[float] = 0.8

    n_poles: Order = 2

    @property
    def orders(self) -> Orders:
        """B and F."""
        return Orders(b=self.n_zeros, f=self.n_poles, delay=self.delay)


@dataclass(kw_only=True, repr=False, eq=False)
class BoxJenkinsEstimator(OutputErrorEstimator):
    """Box-Jenkins model, y = B / F u + C / D e; second order each by default.

    Source: "Analysis and modeling of a pneumatic artificial muscle system", Eq. (5). Its printed B has
    terms in q^0 and q^-2 only, Eq. (6): ``lags=(0, 2)``.

    Parameters
    ----------
    lags : sequence of int, optional
        Samples by which the input of each coefficient of B lies back, instead of n_zeros from the delay
        on.
    n_noise, n_noise_poles : int
        Orders of C and D.
    """

    effort: ClassVar[float] = 1.0

    lags: Annotated[Sequence[Lag], Len(1)] | None = None
    n_noise: Order = 2
    n_noise_poles: Order = 2

    @property
    def orders(self) -> Orders:
        """B, F, C and D."""
        lags = None if self.lags is None else tuple(sorted(set(self.lags)))
        return Orders(
            b=len(lags) if lags else self.n_zeros,
            f=self.n_poles,
            c=self.n_noise,
            d=self.n_noise_poles,
            delay=self.delay,
            lags=lags,
        )
