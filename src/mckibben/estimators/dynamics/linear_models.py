"""ARX, ARMAX, output-error and Box-Jenkins models of any order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from annotated_types import Interval, Len

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Parallel
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.blocks.fields import vector
from mckibben.blocks.parameters import Parametrised
from mckibben.blocks.runs import Run
from mckibben.channels import Channels
from mckibben.errors import DataError, ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Estimator, Grid, Start, resting
from mckibben.estimators.dynamics.prediction_error import (
    Beginning,
    Orders,
    Polynomials,
    arx,
    evaluate,
    minimise,
    starting_points,
    with_noise,
)
from mckibben.numerics.tracker import Tracker
from mckibben.recording import Recording, listed

Order = Annotated[int, Interval(ge=0, le=20)]
Lag = Annotated[int, Interval(ge=0, le=120)]


class _Scale(NamedTuple):
    """Means and spans of training data, by which inputs and output are relative."""

    inputs: Array
    output: float
    input_spans: Array
    output_span: float

    @classmethod
    def of(cls, data: TrainingData) -> Self:
        """Return the scale of data of one output."""
        driven = data.stacked("driven")
        spans = np.ptp(driven, axis=0), float(np.ptp(data.target))
        return cls(np.mean(driven, axis=0), float(np.mean(data.target)), *spans)

    def relative(self, run: Run) -> Run:
        """Return a run with inputs and output less their means, by their spans."""
        driven = (run.driven - self.inputs) / self.input_spans
        return replace(run, driven=driven, outputs=(run.outputs - self.output) / self.output_span)


class PredictionErrorEstimator(Estimator):
    """Estimator of a linear model by one-step prediction errors; the model runs free.

    Standard errors are those of the free run, whose errors may be autocorrelated.

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
    input, output : str or sequence of str
        Channels to learn from. Of several inputs, A is common to all, and every input has an F of its
        own; several outputs are identified one after another.
    scheduling : sequence of str, optional
        Further inputs, such as a load. Default: of several inputs or outputs ``pressure_extensor`` and
        ``force``, where there are any.
    initial : {"first_sample", "virgin"}
        State before the first sample of every recording: at rest where the first output is explained (at
        the first inputs, if there are several); at rest at the operating point. One-step predictions of
        models with noise begin with an estimated state.
    """

    purpose = "rate"
    inverse_kind = "exact where stable"
    param_grid: ClassVar[Grid] = {"n_poles": (1, 2, 3), "n_zeros": (1, 2, 3)}
    needs_time = True
    begins_measured = True
    effort = 0.02

    input: str | tuple[str, ...] = "pressure"
    output: str | tuple[str, ...] = "displacement"
    initial: Start = "first_sample"
    scheduling: tuple[str, ...] | None = None
    n_zeros: Annotated[int, Interval(ge=1, le=20)] = 2
    n_poles: Order = 2
    shared_poles: bool = True
    n_noise: Order = 0
    n_noise_poles: Order = 0
    delay: Annotated[int, Interval(ge=0, le=100)] = 0
    lags: Annotated[Sequence[Lag], Len(1)] | None = None
    n_starts: Annotated[int, Interval(ge=1, le=1000)] = 12

    @property
    def orders(self) -> Orders:
        """Number of coefficients of each polynomial."""
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
        """Raise an error for invalid settings, or noise poles specified twice."""
        super().check_settings()
        if self.shared_poles and self.n_noise_poles:
            raise ModelError(
                f"the noise shares the model's poles, and has {self.n_noise_poles} of its own",
                remedy="use `settings[n_noise_poles]=0`, or `settings[shared_poles]=false`",
            )

    @property
    def single(self) -> bool:
        """Whether there are one input and one output."""
        return isinstance(self.input, str) and isinstance(self.output, str) and not self.scheduling

    @classmethod
    def objection(cls, recordings: Sequence[Recording], channels: Channels) -> str | None:
        if not channels.inputs or not channels.outputs:
            return "it needs an input and an output"
        for name in () if channels.single else channels.further:
            if absent := [run.name for run in recordings if name not in run]:
                return f"it needs the channel {name!r}, which {absent[0]} lacks"
        return resting(recordings, channels.inputs)

    @classmethod
    def channel_settings(cls, channels: Channels) -> dict[str, Any]:
        if channels.single:
            return {"input": channels.inputs[0], "output": channels.outputs[0]}
        return {
            "input": channels.inputs,
            "output": channels.outputs,
            "scheduling": channels.further,
        }

    def data(
        self, recordings: Recording | Sequence[Recording], rows: Sequence[Mask] | None = None
    ) -> TrainingData:
        """Return the training data; with several inputs, of all driving channels."""
        if self.single:
            return super().data(recordings, rows)
        runs = listed(recordings)
        channels = self.resolved(runs, self.input, self.output, self.scheduling)
        driving, outputs, further = channels.inputs, channels.outputs, channels.further
        moving = [name for name in further if any(name in r and np.ptp(r[name]) > 0 for r in runs)]
        estimator = replace(self, input=(*driving, *moving), output=tuple(outputs))
        return super(PredictionErrorEstimator, estimator).data(recordings, rows)

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the identified block: for several channels, the sum over inputs, per output."""
        parts: list[Block] = []
        share = 1.0 / len(data.outputs)
        for k, output in enumerate(data.outputs):
            runs = tuple(replace(run, outputs=run.outputs[:, [k]]) for run in data.runs)
            own_tracker = tracker.part(k * share, (k + 1) * share)
            parts += self._identify_output(replace(data, runs=runs, outputs=(output,)), own_tracker)
        return parts[0] if self.single else Parallel(tuple(parts))

    def _identify_output(
        self, data: TrainingData, tracker: Tracker
    ) -> tuple[TransferFunction, ...]:
        """Return the transfer functions from every input to the one output of the data."""
        orders = replace(self.orders, inputs=len(data.inputs))
        if data.target.size <= orders.size + orders.poles * len(data.runs):
            raise DataError(
                f"{data.target.size} samples are too few for {orders.size} parameters",
                remedy="give longer recordings, or lower orders",
            )
        scale = _Scale.of(data)
        theta, deviation = self._minimise(data, orders, scale, tracker)
        blocks = self._transfer_functions(theta, orders, scale, deviation, data)
        for block in blocks:
            if not block.is_stable:
                radius = float(np.abs(block.poles).max())
                raise ModelError(
                    f"the model found is unstable (a pole at |z| = {radius:.4g})",
                    remedy="use other orders, or output-error (oe), which is constrained to be stable",
                )
        return blocks

    def _minimise(
        self, data: TrainingData, orders: Orders, scale: _Scale, tracker: Tracker
    ) -> tuple[Array, float]:
        """Return the parameters theta of relative data, and the deviation of their errors."""
        start: Beginning = "estimated" if orders.a or orders.c or orders.d else self.initial
        runs = list(map(scale.relative, data.runs))
        stretches = list(map(scale.relative, data.stretches(orders.size).runs))
        if orders.a or orders.c or orders.d:
            if not stretches:
                raise DataError(
                    f"no {orders.size + 1} samples in a row count, which {orders.size} parameters take",
                    remedy="give longer recordings, or lower orders",
                )
            runs = stretches  # only a free run goes on where outputs do not count
        plant = replace(orders, c=0, d=0)
        if plant.f:
            starts = starting_points(runs, stretches, plant, self.n_starts, self.seed)
            theta = minimise(runs, plant, starts, tracker, start)
        else:
            theta = arx(runs, plant)
        if plant != orders:
            noise_tracker = tracker.part(0.5, 1.0)
            theta = minimise(runs, orders, [with_noise(theta, orders, runs)], noise_tracker, start)
            tracker.best, tracker.best_cost = noise_tracker.best, noise_tracker.best_cost
        elif not plant.f:
            tracker.update(theta, evaluate(theta, orders, runs, start)[2])
        return theta, evaluate(theta, orders, runs, start)[2]

    def _transfer_functions(
        self, theta: Array, orders: Orders, scale: _Scale, deviation: float, data: TrainingData
    ) -> tuple[TransferFunction, ...]:
        """Return the blocks of relative parameters; the first has the offset and the noise."""
        theta[: orders.zeros] *= np.repeat(scale.output_span / scale.input_spans, orders.b)
        theta[-1] *= scale.output_span
        p = Polynomials.of(theta, orders)
        noise_poles = vector(p.poles[0] if orders.a else p.d)
        noise = (vector(p.c), noise_poles, scale.output_span * deviation)
        constant = p.constant / (1.0 + float(p.poles.sum())) if orders.a else p.constant
        blocks = []
        for k, (channel, b) in enumerate(zip(data.inputs, p.b, strict=True)):
            numerator = np.zeros(1 + max(orders.input_lags))
            numerator[[*orders.input_lags]] = b
            block = TransferFunction(
                vector(numerator),
                vector(p.poles[min(k, len(p.poles) - 1)]),
                data.timed(),
                float(scale.inputs[k]),
                0.0 if k else scale.output + constant,
                *(() if k else noise),
                initial=self.initial,
                input=channel,
                output=data.outputs[0],
            )
            ends = float(data.lowest[k]), float(data.highest[k])
            blocks.append(replace(block, input_range=ends))
        return tuple(blocks)

    def fixed(self, block: Block) -> tuple[int, ...]:
        """Return the indices of input offsets, skipped lags, and parameters shared by inputs."""
        first_of_output: dict[str, Parametrised] = {}
        fixed = []
        for k, (part, name, at) in enumerate(block.numbers()):
            assert isinstance(part, TransferFunction)
            is_repeated = first_of_output.setdefault(part.output.name, part) is not part
            is_shared = name == "output_offset" or (self.shared_poles and name == "denominator")
            is_skipped = name == "numerator" and at[0] not in self.orders.input_lags
            if name == "input_offset" or is_skipped or (is_repeated and is_shared):
                fixed.append(k)
        return tuple(fixed)


class ARMAXEstimator(PredictionErrorEstimator):
    """ARMAX model, A y = B u + C e."""

    title = "ARMAX model, linear"
    can = "Linear dynamics with a model of the noise; fast to fit."
    cannot = "Has no hysteresis: rising and falling branches coincide at rest."
    param_grid: ClassVar[Grid] = {"n_poles": (1, 2, 3), "n_zeros": (1, 2, 3), "n_noise": (1, 2)}
    effort = 1.0
    n_noise = 2


class ARXEstimator(PredictionErrorEstimator):
    """ARX model, A y = B u + e, by linear least squares."""

    title = "ARX model, linear"
    can = "Linear dynamics, in closed form."
    cannot = (
        "No hysteresis; biased by noise in the output, so its free run is worse than its one-"
        "step prediction."
    )
    quick = True
    param_grid: ClassVar[Grid] = {"n_poles": (1, 2, 3, 4), "n_zeros": (1, 2, 3)}


class BJEstimator(PredictionErrorEstimator):
    """Box-Jenkins model, y = B / F u + C / D e; second order each by default."""

    title = "Box–Jenkins model (BJ), linear"
    can = "Linear dynamics with a separate noise model."
    cannot = "No hysteresis."
    effort = 1.0
    shared_poles = False
    n_noise = 2
    n_noise_poles = 2


class OEEstimator(PredictionErrorEstimator):
    """Output-error model, y = B / F u + e: the best free run of its orders."""

    title = "Output-error model (OE), linear"
    can = "Linear dynamics, identified on free runs."
    cannot = "No hysteresis."
    effort = 0.8
    shared_poles = False
