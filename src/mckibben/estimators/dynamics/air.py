"""Identification of a valve and its air: from command to measured pressure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, cast

import numpy as np
from annotated_types import Ge

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.air import Air
from mckibben.blocks.fields import LONGEST_DELAY
from mckibben.blocks.runs import Run
from mckibben.channels import Channels
from mckibben.errors import DataError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.separable import DIFFERENCE, SEARCH_SAMPLES, SeparableEstimator
from mckibben.numerics.descent import by_differences
from mckibben.numerics.multi_start import multi_start
from mckibben.numerics.tracker import Tracker
from mckibben.recording import Recording, base_name

NO_COMMANDS = ("contraction", "displacement", "force", "length")
"""Channels that cannot be commands of a valve."""

MOST_HYSTERESIS = 0.2
"""Largest hysteresis, relative to the range of the command."""

LIMIT_GAIN = 0.02
"""Smallest relative reduction of the error for a pressure limit to be added."""

NO_WORSE = 1e-6
"""Relative increase of the error up to which hysteresis is left out."""


class AirEstimator(SeparableEstimator):
    """Valve or regulator with air: gain and offset solved for, lags and dead time searched.

    The dead time is searched sample by sample from the one with the highest correlation of command and
    pressure, as long as the error falls. For each dead time, gain and offset are solved for while lags
    and hysteresis are searched; then all are refined together with the pressure limits. Recordings
    should begin at rest.

    Parameters
    ----------
    longest_dead_time : float
        Longest dead time [s].
    ambient, supply : float, optional
        Lowest and highest pressure that the valve can aim for [bar]. Default: identified if limiting
        reduces the error; otherwise ambient is 0, unless lower pressures were commanded, and supply is
        unlimited.
    """

    title = "Valve and air"
    purpose = "rate"
    can = (
        "From a valve's command to the pressure: gain, hysteresis, lags that "
        "differ in filling and venting, dead time."
    )
    cannot = (
        "Flow does not depend on pressure or volume: a muscle that moves, or "
        "a large step, fills at a different speed."
    )
    inverse_kind = "exact"
    needs_time = True
    effort = 1.0
    n_further = 1  # the dead time
    rises = False
    searches_condensed = False

    input = "voltage"
    output = "pressure"
    n_starts = 8
    n_refined = 2
    longest_dead_time: Annotated[float, Ge(0)] = 0.5
    ambient: float | None = None
    supply: float | None = None

    @classmethod
    def objection(cls, recordings: Sequence[Recording], channels: Channels) -> str | None:
        if objection := super().objection(recordings, channels):
            return objection
        (command, pressure) = (base_name(name) for name in channels.pair)
        if command in NO_COMMANDS or pressure != "pressure":
            return "it maps a command to a pressure"
        return None

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        sample_time = data.timed()
        shortest = min(run.u.size for run in data.runs)
        longest = int(self.longest_dead_time / sample_time + 1e-9)
        longest = min(longest, LONGEST_DELAY, shortest // 4)
        fits: dict[int, tuple[float, Air]] = {}  # dead time in samples -> error and block
        best = self._most_correlated(data, longest)
        candidates = [best]
        while candidates:
            for delay in candidates:
                # the number of fits is unknown: each is 30 % of the work that is left
                part = tracker.part(1 - 0.7 ** len(fits), 1 - 0.7 ** (len(fits) + 1))
                fits[delay] = self._fit_delay(delay, data, part)
            best = min(fits, key=lambda delay: fits[delay][0])
            nearest = (best - 1, best + 1, best - 2, best + 2)
            candidates = [d for d in nearest if 0 <= d <= longest and d not in fits][:2]
        tracker.best_cost, block = fits[best]
        tracker.best = block.pack()
        lowest = max(tracker.best_cost, 1e-300)
        neighbours = [
            f"{100 * (fits[delay][0] / lowest - 1):.1f} % at {delay * sample_time:g} s"
            for delay in (best - 1, best + 1)
            if delay in fits
        ]
        if neighbours:
            tracker.notes.append(
                f"dead time {block.dead_time:g} s, in whole samples; the error is higher by "
                f"{' and '.join(neighbours)}"
            )
        return block

    def _most_correlated(self, data: TrainingData, longest: int) -> int:
        """Return the dead time with the highest correlation of pressure and lagged command."""
        thin = data.thinned(SEARCH_SAMPLES)
        pressure = thin.target - thin.target.mean()
        lower, upper = self.bounds(data)
        correlations = np.zeros(longest + 1)
        for delay in range(longest + 1):
            late = delayed(thin, delay)
            for share in np.linspace(0.0, 0.8, 8):
                theta = np.array([*(lower + share * (upper - lower))[:2], 0.0])
                command = self.design_matrix(theta, late)[:, 0]
                command = command - command.mean()
                size = float(np.linalg.norm(command))
                if size > 0:
                    correlations[delay] = max(command @ pressure / size, correlations[delay])
        best = int(correlations.argmax())
        if not correlations[best] > 0:
            raise DataError(
                "the pressure does not rise with the command",
                channel=data.inputs[0].name,
                remedy="choose the command with `input`, and the pressure it makes with `output`",
            )
        return best

    def _fit_delay(self, delay: int, data: TrainingData, tracker: Tracker) -> tuple[float, Air]:
        """Return the RMSE and the block for a dead time in samples."""
        late = delayed(data, delay)
        unlimited = super().identify(late, tracker)
        limits: tuple[str, ...] = ()
        block, error = self._refined(cast(Air, unlimited), late, tracker, limits)
        quantiles = {"ambient": 0.005, "supply": 0.995}
        for limit in ("ambient", "supply", "ambient"):  # the first may help only with the second
            if getattr(self, limit) is None and limit not in limits:
                start: dict[str, Any] = {limit: float(np.quantile(data.target, quantiles[limit]))}
                limited, limited_error = self._refined(
                    replace(block, **start), late, tracker, (*limits, limit)
                )
                if limited_error < (1 - LIMIT_GAIN) * error:
                    block, error, limits = limited, limited_error, (*limits, limit)
        if block.ambient is None and self.ambient is None:
            lowest = block.goal(data.input_range[0], -1)
            block = replace(block, ambient=0.0 if lowest >= 0 else None)
        return error, replace(block, dead_time=delay * data.timed())

    def _refined(
        self, block: Air, data: TrainingData, tracker: Tracker, limits: Sequence[str]
    ) -> tuple[Air, float]:
        """Return the block with all parameters and these limits refined together, and its RMSE.

        Points are [gain, offset, hysteresis, log filling time, log venting time, limits].
        """
        (shortest, _, _), (longest, _, widest) = self.bounds(data)
        times = np.log([block.filling_time, block.venting_time])
        pressures = [getattr(block, name) for name in limits]
        start = np.array([block.gain, block.offset, block.hysteresis, *times, *pressures])
        half = np.full(start.size, 0.25 * data.output_span)
        half[:2] = 0.5 * block.gain, 0.5 * data.input_span
        lower, upper = start - half, start + half
        lower[2:5], upper[2:5] = (0.0, shortest, shortest), (widest, longest, longest)

        def block_at(point: Array) -> Air:
            changed: dict[str, Any] = dict(zip(limits, point[5:].tolist(), strict=True))
            return replace(block.unpack([*point[:3], *np.exp(point[3:5])]), **changed)

        def residuals(point: Array) -> Array:
            return data.simulated([block_at(point)])[0] - data.target

        part = tracker.part(0.9, 1.0)
        errors = by_differences(residuals, DIFFERENCE * (upper - lower))
        best = multi_start(errors, [start], (lower, upper), part, n_refined=1, max_evaluations=40)
        without = best.copy()
        without[2] = 0.0
        error, error_without = (np.sqrt(np.mean(residuals(p) ** 2)) for p in (best, without))
        if error_without <= (1 + NO_WORSE) * error:
            return block_at(without), float(error_without)
        return block_at(best), float(error)

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [log filling time, log venting time, hysteresis]."""
        sample_time = data.timed()
        shortest = np.log(0.1 * sample_time)
        longest = np.log(max(run.u.size for run in data.runs) * sample_time)
        widest = MOST_HYSTERESIS * data.input_span
        return np.array([shortest, shortest, 0.0]), np.array([longest, longest, widest])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return initial lags, with and without hysteresis."""
        lower, upper = self.bounds(data)
        shares = [(s, s, h) for s in (0.2, 0.35, 0.5, 0.65) for h in (0.01, 0.2)]
        return [lower + np.array(share) * (upper - lower) for share in shares]

    def unit(self, theta: Array, data: TrainingData) -> Air:
        """Return the block with unit gain, without offset, limits or dead time."""
        filling, venting = np.exp(theta[:2]).tolist()
        return Air(1.0, 0.0, float(theta[2]), filling, venting, **self.common_fields(data))

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        unit = data.latest("unit", theta, lambda: self.unit(theta, data))
        return unit.simulate(run.u, sample_time=run.sample_time)[:, np.newaxis]

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Air:
        block = replace(self.unit(theta, data), ambient=self.ambient, supply=self.supply)
        return replace(block, gain=float(linear[0]), offset=-offset / float(linear[0]))


def delayed(data: TrainingData, delay: int) -> TrainingData:
    """Return the same data with inputs delayed by some samples, the first value extended."""

    def late(run: Run) -> Run:
        return replace(run, driven=run.driven[np.maximum(np.arange(len(run)) - delay, 0)])

    return data.changed(late)
