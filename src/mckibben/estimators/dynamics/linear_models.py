"""ARX, ARMAX, output-error and Box-Jenkins models of any order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval, Len

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.blocks.fields import vector
from mckibben.errors import DataError, ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Grid, SearchEstimator
from mckibben.estimators.core.uncertainty import inverted, told_by_runs
from mckibben.estimators.dynamics.linear_polynomials import Orders, Polynomials
from mckibben.estimators.dynamics.linear_starts import LinearEstimator
from mckibben.estimators.dynamics.prediction_error import (
    arx,
    evaluate,
    minimise,
    starting_points,
)
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.presets import preset

Order = Annotated[int, Interval(ge=0, le=20)]
Lag = Annotated[int, Interval(ge=0, le=120)]


@dataclass(frozen=True)
class Noise:
    """The noise model of a prediction-error fit: C / D and the standard deviation of e."""

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]
    deviation: float
    covariance: Array = field(repr=False)
    """Of all coefficients: B, A or F, C, D, leading ones left out; constants not."""

    @property
    def standard_errors(self) -> tuple[float, ...]:
        """Of the same."""
        return vector(np.sqrt(np.diag(self.covariance)))


@dataclass(kw_only=True, repr=False, eq=False)
class PredictionErrorEstimator(LinearEstimator, SearchEstimator):
    """An estimator of a linear model by one-step prediction errors, run free ever after.

    After `fit`, ``noise_`` holds the noise model, the one-step error, and the covariance of all
    coefficients. Covariances are those of Ljung, chapter 9, and take the noise to be what the model says
    it is; output-error models say nothing of it, and theirs hold under coloured noise too.

    Parameters
    ----------
    n_zeros : int
        Coefficients of B, at least 1.
    n_poles : int
        Order of A or F.
    shared_poles : bool
        Whether the poles are the noise's too, A y = B u + C e, of which ARX is solved for at once; or of
        the way from the input alone, y = B / F u + C / D e.
    n_noise, n_noise_poles : int
        Orders of C and D.
    delay : int
        Samples before B's first coefficient.
    lags : sequence of int, optional
        Samples by which the input of each coefficient of B lies back, instead of n_zeros from the delay
        on. The Box-Jenkins model of "Analysis and modeling of a pneumatic artificial muscle system",
        Eq. (5), has terms in q^0 and q^-2 only in its printed B, Eq. (6): ``lags=(0, 2)``.
    n_starts : int
        Starting points.
    """

    purpose = "rate"
    inverse_kind = "exact where stable"
    param_grid: ClassVar[Grid] = {
        "n_poles": (1, 2, 3),
        "n_zeros": (1, 2, 3),
    }
    needs_time: ClassVar[bool] = True

    n_zeros: Annotated[int, Interval(ge=1, le=20)] = 2
    n_poles: Order = 2
    shared_poles: bool = True
    n_noise: Order = 0
    n_noise_poles: Order = 0
    delay: Annotated[int, Interval(ge=0, le=100)] = 0
    lags: Annotated[Sequence[Lag], Len(1)] | None = None
    n_starts: Annotated[int, Interval(ge=1, le=1000)] = 12

    effort: ClassVar[float] = 0.02

    @property
    def orders(self) -> Orders:
        """How many coefficients each polynomial has."""
        lags = None if self.lags is None else tuple(sorted(set(self.lags)))
        poles = {"a" if self.shared_poles else "f": self.n_poles}
        return Orders(
            b=len(lags) if lags else self.n_zeros,
            c=self.n_noise,
            d=self.n_noise_poles,
            delay=self.delay,
            lags=lags,
            **poles,
        )

    def check_settings(self) -> None:
        """Refuse settings that are not as they are declared, and poles of the noise in two places."""
        super().check_settings()
        if self.shared_poles and self.n_noise_poles:
            raise ModelError(
                f"the noise shares the model's poles, and has {self.n_noise_poles} of its own. "
                "Remedy: use n_noise_poles=0, or shared_poles=false."
            )

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the transfer function found, and the data."""
        step = data.timed(instead=", or use gpi")
        orders = self.orders
        if data.target.size <= orders.size + orders.poles * len(data.runs):
            raise DataError(
                f"{data.target.size} samples are too few for {orders.size} parameters",
                remedy="give longer recordings, or lower orders",
            )
        centre = float(np.mean(np.concatenate([run.u for run in data.runs])))
        middle = float(np.mean(data.target))
        given, wanted = (float(np.ptp(span)) for span in (data.input_range, data.output_range))
        known, runs = (
            [run.carrying((run.u - centre) / given, (run.y - middle) / wanted) for run in pieces]
            for pieces in (data.stretches(orders.size).runs, data.runs)
        )
        if orders.a or orders.c or orders.d:
            if not known:
                raise DataError(
                    f"no {orders.size + 1} samples in a row count, which {orders.size} parameters take",
                    remedy="give longer recordings, or lower orders",
                )
            runs = known  # a free run needs no outputs, so it alone goes on where they do not count
        if orders.c == orders.d == orders.f == 0:
            theta = arx(runs, orders)
            tracker.saw(theta, evaluate(theta, orders, runs, self.initial)[2])
        else:
            starts = starting_points(runs, known, orders, self.n_starts, self.seed)
            theta = minimise(runs, orders, starts, tracker, self.initial)
        theta[: orders.b] *= wanted / given
        theta[-1] *= wanted
        runs = [run.carrying(given * run.u, wanted * run.y) for run in runs]
        p = Polynomials.of(theta, orders)
        self._constant = p.constant
        e, slopes, deviation = evaluate(theta, orders, runs, self.initial)
        size = np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
        self._condition, inverse = inverted(slopes / size)
        freedom = max(e.size - orders.size - orders.poles * len(runs), 1)
        self._covariance = float(e @ e) / freedom * inverse / np.outer(size, size)
        if orders.f and not orders.c + orders.d:
            coloured = told_by_runs(slopes / size, e, runs)[1]
            self._covariance = coloured / np.outer(size, size)
        self.noise_ = Noise(
            (1.0, *vector(p.c)),
            (1.0, *vector(p.poles if orders.a else p.d)),
            deviation,
            self._covariance[:-1, :-1],
        )
        constant = p.constant / (1.0 + float(p.poles.sum())) if orders.a else p.constant
        numerator = np.zeros(1 + max(orders.input_lags))
        numerator[[*orders.input_lags]] = p.b
        block = TransferFunction(
            vector(numerator),
            vector(p.poles),
            step,
            centre,
            middle + constant,
            self.initial,
            noise_numerator=vector(p.c),
            noise_denominator=vector(p.poles if orders.a else p.d),
            noise_deviation=deviation,
            **self.channels(data),
        )
        if not block.is_stable:
            radius = float(np.abs(block.poles).max())
            raise ModelError(
                f"the model found is unstable (a pole at |z| = {radius:.4g}). "
                "Remedy: use other orders, or output-error (oe), which is kept stable."
            )
        return block, data

    def uncertainty(
        self, block: Block, data: TrainingData, residual: Array, at_bounds: Sequence[int]
    ) -> tuple[float, Array]:
        """Return the condition and covariance from the prediction errors; the input's offset is set."""
        orders = self.orders
        n, poles = block.n_parameters, orders.poles
        turned = np.zeros((n, orders.size))
        turned[[*orders.input_lags], : orders.b] = np.eye(orders.b)
        first = 1 + max(orders.input_lags)
        turned[first : first + poles, orders.b : orders.b + poles] = np.eye(poles)
        turned[-1, -1] = 1.0
        if orders.a:  # the offset of the output is the constant over the sum of A
            assert isinstance(block, TransferFunction)
            whole = 1.0 + sum(block.denominator)
            turned[-1, -1] = 1.0 / whole
            turned[-1, orders.b : orders.b + poles] = -self._constant / whole**2
        used = np.any(turned != 0, axis=1)
        covariance = np.full((n, n), np.nan)
        covariance[np.ix_(used, used)] = (turned @ self._covariance @ turned.T)[np.ix_(used, used)]
        return self._condition, covariance


ARMAX = preset(
    PredictionErrorEstimator,
    "ARMAX model, A y = B u + C e.",
    title="ARMAX model, linear",
    can="Linear dynamics with a model of the noise; fast to fit.",
    cannot="Has no hysteresis: rising and falling branches coincide at rest.",
    param_grid={"n_poles": (1, 2, 3), "n_zeros": (1, 2, 3), "n_noise": (1, 2)},
    n_noise=2,
    effort=1.0,
)

ARX = preset(
    PredictionErrorEstimator,
    "ARX model, A y = B u + e, by linear least squares.",
    title="ARX model, linear",
    can="Linear dynamics, in closed form.",
    cannot=(
        "No hysteresis; biased by noise in the output, so its free run drifts from what one "
        "step ahead promises."
    ),
    param_grid={"n_poles": (1, 2, 3, 4), "n_zeros": (1, 2, 3)},
)

BJ = preset(
    PredictionErrorEstimator,
    "Box-Jenkins model, y = B / F u + C / D e; second order each by default.",
    title="Box–Jenkins model (BJ), linear",
    can="Linear dynamics with noise described apart from them.",
    cannot="No hysteresis.",
    shared_poles=False,
    n_noise=2,
    n_noise_poles=2,
    effort=1.0,
)

OE = preset(
    PredictionErrorEstimator,
    "Output-error model, y = B / F u + e: the best free run of its orders.",
    title="Output-error model (OE), linear",
    can="Linear dynamics, identified on free runs.",
    cannot="No hysteresis.",
    shared_poles=False,
    effort=0.8,
)
