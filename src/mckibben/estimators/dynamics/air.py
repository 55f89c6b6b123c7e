"""Identification of a valve and its air: from command to measured pressure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, cast

import numpy as np
from annotated_types import Ge

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.air import Air
from mckibben.blocks.fields import LONGEST_DELAY
from mckibben.errors import DataError
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.estimator import Start
from mckibben.estimators.core.separable import SEARCH_SAMPLES, SeparableEstimator
from mckibben.estimators.core.uncertainty import simulate_all
from mckibben.estimators.optimisers.multi_start import multi_start
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.recording import Recording

MOVED = ("contraction", "displacement", "force", "length")
"""Channels of muscles, which are not commands."""

WIDEST = 0.2
"""Largest hysteresis, relative to the range of the command."""

GUESSES = 8
"""Lags for the initial search of the dead time."""

LIMIT_GAIN = 0.02
"""Smallest relative reduction of the error for a pressure limit to be added."""

NO_WORSE = 1e-6
"""Relative increase of the error up to which hysteresis is left out."""

POLISHED = 40
"""Maximum number of evaluations of the joint refinement."""


@dataclass(kw_only=True, repr=False, eq=False)
class AirEstimator(SeparableEstimator):
    """Valve or regulator with air: gain and offset solved for, lags and dead time searched.

    Dead times are tried sample by sample from where the correlation of command and pressure is best, as
    long as the error falls; with each, gain and offset are solved for while lags and hysteresis are
    searched, and then all are refined together within the limits of the pressure. Recordings should
    begin at rest.

    Parameters
    ----------
    longest_dead_time : float
        Dead times up to this are looked for [s].
    ambient, supply : float, optional
        Lowest and highest pressure that the valve can aim for. Default: found where it shows, else
        0 below, if nothing recorded is, and no limit above.
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
    needs_time: ClassVar[bool] = True

    effort: ClassVar[float] = 1.0

    input: str = "voltage"
    output: str = "pressure"
    initial: Start = "first_sample"
    n_starts: Annotated[int, Ge(1)] = 8
    n_refined: Annotated[int, Ge(1)] = 2
    longest_dead_time: Annotated[float, Ge(0)] = 0.5
    ambient: float | None = None
    supply: float | None = None

    rises: ClassVar[bool] = False
    searches_condensed: ClassVar[bool] = False

    @classmethod
    def objection(
        cls,
        recordings: Sequence[Recording],
        inputs: Sequence[str],
        outputs: Sequence[str],
        scheduling: Sequence[str] | None = None,
    ) -> str | None:
        found = super().objection(recordings, inputs, outputs, scheduling)
        if found is not None:
            return found
        given, wanted = inputs[0].partition("_")[0], outputs[0].partition("_")[0]
        return "it maps a command to a pressure" if given in MOVED or wanted != "pressure" else None

    @property
    def n_further(self) -> int:
        """The dead time."""
        return 1

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        step = data.timed()
        shortest = min(run.u.size for run in data.runs)
        most = min(int(self.longest_dead_time / step + 1e-9), LONGEST_DELAY, shortest // 4)
        tried: dict[int, tuple[float, Air]] = {}
        best = self._correlated(data, most)
        asked = [best]
        while asked:
            for late in asked:
                own = tracker.part(1 - 0.7 ** len(tried), 1 - 0.7 ** (len(tried) + 1))
                tried[late] = self._at(late, data, own)
                tracker.update_from(own)
            best = min(tried, key=lambda late: tried[late][0])
            near = (best - 1, best + 1, best - 2, best + 2)
            asked = [late for late in near if 0 <= late <= most and late not in tried][:2]
        tracker.best_cost, block = tried[best]
        tracker.best = block.pack()
        others = [
            f"{100 * (tried[late][0] / max(tried[best][0], 1e-300) - 1):.1f} % at {late * step:g} s"
            for late in (best - 1, best + 1)
            if late in tried
        ]
        if others:
            tracker.notes.append(
                f"dead time {block.dead_time:g} s, in whole samples; the error is higher by "
                f"{' and '.join(others)}"
            )
        return block

    def _correlated(self, data: TrainingData, most: int) -> int:
        """Return the dead time with the best correlation of pressure and lagged command."""
        thin = data.thinned(SEARCH_SAMPLES)
        wanted = thin.target - thin.target.mean()
        lower, upper = self.bounds(data)
        likeness: dict[int, float] = {}
        for late in range(most + 1):
            moved = delayed(thin, late)
            for share in np.linspace(0.0, 0.8, GUESSES):
                theta = np.array([*(lower + share * (upper - lower))[:2], 0.0])
                given = self.matrix(theta, moved)[:, 0]
                given = given - given.mean()
                size = float(np.linalg.norm(given))
                found = float(given @ wanted) / size if size > 0 else 0.0
                likeness[late] = max(found, likeness.get(late, 0.0))
        best = max(likeness, key=lambda late: likeness[late])
        if not likeness[best] > 0:
            raise DataError(
                "the pressure does not rise with the command",
                channel=data.input,
                remedy="choose the command with `input`, and the pressure it makes with `output`",
            )
        return best

    def _at(self, late: int, data: TrainingData, tracker: Tracker) -> tuple[float, Air]:
        """Return the error and the block for a dead time in samples."""
        moved = delayed(data, late)
        found = super().identify(moved, tracker)
        limits: tuple[str, ...] = ()
        block, cost = self._refined(cast(Air, found), moved, tracker, limits)
        shares = {"ambient": 0.005, "supply": 0.995}
        for limit in ("ambient", "supply", "ambient"):  # which one alone may not have shown
            if getattr(self, limit) is None and limit not in limits:
                tight: dict[str, Any] = {limit: float(np.quantile(data.target, shares[limit]))}
                limited = replace(block, **tight)
                limited, least = self._refined(limited, moved, tracker, (*limits, limit))
                if least < (1 - LIMIT_GAIN) * cost:
                    block, cost, limits = limited, least, (*limits, limit)
        if block.ambient is None and self.ambient is None:
            low = block.goal(data.input_range[0], -1)
            block = replace(block, ambient=0.0 if low >= 0 else None)
        return cost, replace(block, dead_time=late * (data.sample_time or 1.0))

    def _refined(
        self, block: Air, data: TrainingData, tracker: Tracker, limits: Sequence[str]
    ) -> tuple[Air, float]:
        """Return the block with all parameters, and some limits, refined together; and its error."""
        span, wide = np.ptp(data.input_range), np.ptp(data.output_range)
        (quick, _, _), (slow, _, most) = self.bounds(data)
        times = np.log([block.filling_time, block.venting_time])
        limit = [getattr(block, name) for name in limits]
        start = np.array([block.gain, block.offset, block.hysteresis, *times, *limit])
        reach = np.array(
            [0.5 * block.gain, 0.5 * span, 0.0, 0.0, 0.0, *[0.25 * wide] * len(limits)]
        )
        lower, upper = start - reach, start + reach
        lower[2:5], upper[2:5] = (0.0, quick, quick), (most, slow, slow)

        def made(point: Array) -> Air:
            changed: dict[str, Any] = dict(zip(limits, point[5:].tolist(), strict=True))
            return replace(block.unpack([*point[:3], *np.exp(point[3:5])]), **changed)

        def residuals(point: Array) -> Array:
            return simulate_all([made(point)], data)[0] - data.target

        own = tracker.part(0.9, 1.0)
        best = multi_start(
            residuals, [start], lower, upper, own, n_refined=1, max_evaluations=POLISHED
        )
        tracker.update_from(own)
        without = best.copy()
        without[2] = 0.0
        cost, least = (float(np.sqrt(np.mean(residuals(p) ** 2))) for p in (best, without))
        return (made(without), least) if least <= (1 + NO_WORSE) * cost else (made(best), cost)

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [log filling time, log venting time, hysteresis]."""
        step = data.sample_time or 1.0
        quick, slow = np.log(0.1 * step), np.log(max(run.u.size for run in data.runs) * step)
        widest = WIDEST * float(np.ptp(data.input_range))
        return np.array([quick, quick, 0.0]), np.array([slow, slow, widest])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return initial lags, with and without hysteresis."""
        lower, upper = self.bounds(data)
        shares = [(s, s, h) for s in (0.2, 0.35, 0.5, 0.65) for h in (0.01, 0.2)]
        return [lower + np.array(share) * (upper - lower) for share in shares]

    def unit(self, theta: Array, data: TrainingData) -> Air:
        """Return the block with unit gain, without offset, limits or dead time."""
        filling, venting = np.exp(theta[:2]).tolist()
        rest: dict[str, Any] = {
            "input_range": data.input_range,
            "initial": self.starting_rule,
            **self.channels(data),
        }
        return Air(1.0, 0.0, float(theta[2]), filling, venting, **rest)

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        unit = data.latest("unit", theta, lambda: self.unit(theta, data))
        return unit.simulate(run.u, sample_time=run.sample_time)[:, np.newaxis]

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Air:
        block = replace(self.unit(theta, data), ambient=self.ambient, supply=self.supply)
        return replace(block, gain=float(linear[0]), offset=-offset / float(linear[0]))


def delayed(data: TrainingData, late: int) -> TrainingData:
    """Return the same data with delayed inputs, the first value extended."""
    runs = []
    for run in data.runs:
        places = np.maximum(np.arange(len(run.driven)) - late, 0)
        runs.append(replace(run, driven=run.driven[places]))
    return replace(data, runs=tuple(runs))
