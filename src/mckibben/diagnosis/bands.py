"""Prediction bands of a model by split conformal prediction, for runs like those of the calibration.

What a model missed on some units (runs, or blocks of them longer than the errors are correlated) bounds
what it misses on the next, if all are exchangeable, whatever the model and its errors are. The quantile
of errors, where every unit weighs the same, at (1 + 1 / units) times the level holds that share of a new
unit's samples on average (Lee, Barber and Willett, Distribution-free inference with hierarchical data).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.bands import Band, Banded, inside
from mckibben.blocks.base import Block
from mckibben.blocks.fields import check_units, rows, vector
from mckibben.blocks.free_runs import free_run
from mckibben.blocks.inverse import commands
from mckibben.blocks.runs import FreeRun
from mckibben.errors import DataError, ModelError
from mckibben.numerals import numeral
from mckibben.numerics.blocks import block_length
from mckibben.numerics.statistics import correlation_length
from mckibben.recording import Recording, check_sample_times, listed
from mckibben.signals.reversals import reversals
from mckibben.signals.shared_rows import check_shared
from mckibben.simulation import Simulates
from mckibben.system.atomic import Numbers
from mckibben.system.progress import Tell, one_by_one, telling
from mckibben.system.showing import Result

if TYPE_CHECKING:
    from mckibben.splits import Split

Unit = Literal["auto", "run", "block"]

Unknown = Literal["blocks", "branches", "narrow", "wide"]
"""Why a band is not known; see `TestedBand`."""

LEVEL, LEVELS = 0.9, np.linspace(0.0, 1.0, 1001)
"""Default level of a band, reduced to the highest that the number of units allows; levels in the
table of half widths.
"""

FEWEST_UNITS = 9
"""Smallest number of units for a level of 0.9: with fewer runs, blocks of runs are the exchangeable
units.
"""

SHORTEST_BLOCK = 2.0
"""Shortest block, in correlation lengths of the errors."""

WIDENINGS, FOLDS = (0.0, 0.3, 1.0, 3.0, 10.0), 5
"""Candidate increases of the width at mean speed, relative to that at rest, and number of
cross-validation folds that choose among them.
"""

AT_SPEED = (1.0,)
"""The same for motion of another kind than in training, where the narrowest band of these data is no
better than another: half of the mean width grows with speed.
"""

MARGIN = 0.05
"""Share of a range by which samples may exceed it and count as inside, and by which turning points of
like branches differ.
"""

SHARES = 0.8, 0.97
"""Least and greatest share of the samples of a test recording in a band of 0.9 that is known."""


@dataclass(frozen=True, repr=False)
class Calibration(Simulates, Result):
    """A model with a band, and the band's width.

    Parameters
    ----------
    model : Banded
    band : Band
    runs : int
        Recordings of the calibration.
    memory : float
        Correlation length of the errors [samples].
    widths : tuple of float
        Mean width at the band's level in cross-validation over units, of every output [its unit].
    over_constant : tuple of float
        These over the width of a band that is the same everywhere.
    """

    face: ClassVar[str] = "calibration"

    model: Banded = field(repr=False)
    band: Band
    runs: int
    memory: float
    widths: tuple[float, ...]
    over_constant: tuple[float, ...]
    fitted_known: bool = False
    """Whether it was made sure that the model was not fitted to these recordings."""

    def at(self, level: float) -> Banded:
        """Return the model with the band of another level."""
        return self.model.at(level)

    @property
    def drawn(self) -> Block:
        """What a plot of it draws."""
        return self.model

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers, for JSON."""
        names, units = [channel.name for channel in self.band.given], self.band.units
        return {
            "unit": self.band.unit,
            "units": units,
            "highest_level": units / (units + 1),
            "level": self.band.level,
            "width": dict(zip(names, self.widths, strict=True)),
            "width_over_constant": dict(zip(names, self.over_constant, strict=True)),
            "memory": self.memory,
        }


def calibrate(
    model: Block,
    recordings: Recording | Sequence[Recording],
    *,
    exchangeable: Unit = "auto",
    fitted: Sequence[Recording] = (),
    progress: bool | Tell | None = None,
) -> Calibration:
    """Return a model with a band that covers a share of the samples of new, similar runs.

    The model runs free over each recording, and its errors give the half width of the band by split
    conformal prediction. The width is constant, or grows with the speed of the modelled output,
    whichever is narrower in cross-validation. ``found.at(0.9)`` chooses the level; n units allow
    n / (n + 1). On motion of another kind than the recordings' no level is guaranteed.

    Parameters
    ----------
    model : Block
        A forward model, perhaps with a band, which is then found anew.
    recordings : Recording or sequence of Recording
        With the model's inputs and outputs, of one sample time, and not those that it was fitted to.
    exchangeable : {"auto", "run", "block"}
        Units: runs, or blocks that are long against the correlation of the errors. By default runs from
        9 on, else blocks; what differs from run to run is then not in the band.
    fitted : sequence of Recording, optional
        Those that it was fitted to, to make sure that none is among the recordings.
    progress : bool or callable, optional
        Whether to show a bar; or a callback for the share done, and a text.

    Raises
    ------
    DataError
        On recordings too short, of several sample times, without a channel, or that share stretches
        with those fitted.
    ModelError
        On a model of inputs, or one that does not run on these recordings.

    Examples
    --------
    >>> import mckibben
    >>> import numpy as np
    >>> model, noise = mckibben.PI.example(), np.random.default_rng(0)
    >>> u = 2.5 - 2.5 * np.cos(0.1 * np.arange(1000))
    >>> y = model.simulate(u) + 0.1 * noise.standard_normal(1000)
    >>> run = mckibben.Recording({"pressure": u, "displacement": y}, 0.1)
    >>> list(mckibben.calibrate(model, run).at(0.8).simulate(run).channels)
    ['pressure', 'displacement', 'displacement_lower', 'displacement_upper']
    """
    model, recordings, fitted = inside(model), listed(recordings), listed(fitted)
    if commands(model):
        raise ModelError(
            f"{model.title!r} computes inputs, but bands are of outputs",
            remedy="calibrate the model that was inverted",
        )
    if not recordings:
        raise DataError("there is nothing to calibrate on", remedy="give at least one recording")
    check_sample_times(recordings)
    for recording in recordings:
        check_units(recording, model.outputs)
    inputs, outputs = ([c.name for c in channels] for channels in (model.inputs, model.outputs))
    check_shared({"fit": fitted, "calibrate": recordings}, inputs, outputs)
    with telling(progress, "calibrating") as tell:
        runs = [free_run(model, one) for one in one_by_one(recordings, tell)]
    # the first sample, a start, is not scored
    held = [replace(run, counts=np.arange(len(run)) > 0) for run in runs]
    return replace(find_band(model, held, exchangeable), fitted_known=bool(fitted))


def find_band(
    model: Block,
    runs: Sequence[FreeRun],
    unit: Unit = "auto",
    widenings: Sequence[float] = WIDENINGS,
) -> Calibration:
    """Return the band of a model from its errors on held-out runs; needs two units."""
    runs = [run for run in runs if run.counts.any()]
    errors = [run.errors for run in runs]
    memory = max(correlation_length(one) for one in zip(*(e.T for e in errors), strict=True))
    by_run = unit == "run" or (unit == "auto" and len(runs) >= FEWEST_UNITS)
    which: Literal["run", "block"] = "run" if by_run else "block"
    units: list[NDArray[np.intp]] = []
    n = 0
    for length in map(len, errors):
        block = max(block_length(length, memory), SHORTEST_BLOCK * memory)
        pieces = 1 if by_run else max(int(length / block), 1)
        units.append(n + np.arange(length) * pieces // length)
        n += pieces
    if n < 2:
        raise DataError(
            f"errors are correlated over {numeral(memory, 3)} samples, so {sum(map(len, errors))} of "
            f"them are one {which}, which is too few for a band",
            remedy="calibrate on more, or longer, recordings",
        )
    level = min(LEVEL, n / (n + 1))
    widenings = widenings if all(run.sample_time for run in runs) else WIDENINGS[:1]
    of, speeds = np.concatenate(units), np.concatenate([run.speeds for run in runs])
    found = [
        _narrowest(np.abs(e), v, of, level, widenings)
        for e, v in zip(np.concatenate(errors).T, speeds.T, strict=True)
    ]
    widening, scores, widths, ratios = zip(*found, strict=True)
    samples = np.concatenate([np.hstack([run.inputs, run.modelled]) for run in runs])
    band = Band(
        driving=model.inputs,
        given=model.outputs,
        ends=rows(np.array([samples.min(axis=0), samples.max(axis=0)])),
        widening=vector(np.array(widening)),
        scores=rows(np.array(scores)),
        units=n,
        unit=which,
        level=level,
        memory=memory * max(run.sample_time or 0.0 for run in runs),
    )
    return Calibration(Banded(model, band), band, len(runs), memory, widths, ratios)


def _narrowest(
    errors: Array, speeds: Array, of: NDArray[np.intp], level: float, widenings: Sequence[float]
) -> tuple[float, Array, float, float]:
    """Return widening, half widths at all levels, mean width, and its ratio to a constant band's.

    Units, by ``of``, weigh the same; widths are those on units left out of the quantile.
    """
    mean, n = float(speeds.mean()) or 1.0, int(of[-1]) + 1
    fold = of * min(FOLDS, n) // n

    def half_widths(widening: float, some: NDArray[np.bool_], levels: Array) -> Array:
        scores = errors[some] / (1.0 + widening * speeds[some])
        order = np.argsort(scores)
        _, place, sizes = np.unique(of[some], return_inverse=True, return_counts=True)
        reached = np.cumsum(1.0 / sizes[place[order]]) / sizes.size
        wanted = np.minimum(levels * (n + 1) / n, 1.0) - 1e-9
        return np.asarray(scores[order][np.searchsorted(reached, wanted).clip(max=scores.size - 1)])

    def width(widening: float) -> float:
        total = 0.0
        for out in (fold == k for k in range(int(fold[-1]) + 1)):
            half = half_widths(widening, ~out, np.array(level))
            total += 2.0 * float(half) * float((1.0 + widening * speeds[out]).sum())
        return total / errors.size

    tried = [(width(share / mean), share / mean) for share in widenings]
    narrowest, widening = min(tried)
    scores = half_widths(widening, np.ones(errors.size, dtype=bool), LEVELS)
    constant = tried[0][0]
    return widening, scores, narrowest, narrowest / constant if constant > 0 else 1.0


def outside(band: Band, samples: Array) -> dict[str, float]:
    """Return the share of samples outside the calibrated range, for channels that leave it.

    ``samples`` are the model's inputs, then its outputs, shape (n, channels).
    """
    low, high = np.array(band.ends)
    reach = MARGIN * (high - low)
    shares = ((samples < low - reach) | (samples > high + reach)).mean(axis=0)
    names = [channel.name for channel in (*band.driving, *band.given)]
    return {name: float(share) for name, share in zip(names, shares, strict=True) if share > 0}


def n_branches(tables: Sequence[Array]) -> int:
    """Return how many different branches between turning points an output has, of several the most.

    Tables are outputs, shape (n, k). A motion that is repeated adds none.
    """
    every = np.concatenate(tables)
    low, span = every.min(axis=0), np.maximum(np.ptp(every, axis=0), np.finfo(float).tiny)
    counts = []
    for runs in zip(*(((table - low) / span).T for table in tables), strict=True):
        turns = [run[reversals(run, MARGIN)] for run in runs]
        left = np.concatenate([np.column_stack([ends[:-1], ends[1:]]) for ends in turns])
        count = 0
        while len(left):
            left = left[np.abs(left - left[0]).max(axis=1) > MARGIN]
            count += 1
        counts.append(count)
    return max(counts)


@dataclass(frozen=True)
class TestedBand(Numbers):
    """Coverage of a band, calibrated on training data, on the test.

    Parameters
    ----------
    unknown : {"blocks", "branches", "narrow", "wide"} or None
        Why the band is not known: fewer blocks or branches than ``needed``, or a test recording with
        less or more of its samples inside than `SHARES`; None of a band that is known.
    level : float
        Share that the band is to contain: 0.9, or the most that so few units allow.
    units, branches : int
        Independent blocks of the cross-validation, and different branches of the output there.
    unit_of_width : str
        Unit of the outputs.
    coverage, width : mappings of str to float
        By output, the share of test samples inside, and the mean width.
    lowest, highest : float
        Least and greatest share inside of a test recording, of any output.
    """

    __test__ = False  # it is no test
    needed: ClassVar[int] = FEWEST_UNITS

    unknown: Unknown | None
    level: float
    units: int
    branches: int
    unit_of_width: str
    coverage: Mapping[str, float]
    width: Mapping[str, float]
    lowest: float
    highest: float


def tested_band(
    block: Block,
    held: Sequence[FreeRun],
    outputs: Sequence[Array],
    split: Split,
) -> tuple[Banded, TestedBand] | None:
    """Return a model with its band, and the band's coverage on the test; None without a band.

    ``held`` are of models fitted without a part of the recordings, on that part;
    ``outputs``, shape (n, k) each, free-running on every training recording, then on every test
    recording.
    """
    names = [channel.name for channel in block.outputs]
    if not held:
        return None
    try:
        band = find_band(block, held, "block", AT_SPEED).band
    except DataError:
        return None
    covered, width = [], []
    tested = zip(split.test, outputs[len(split.train) :], split.test_rows, strict=True)
    for recording, modelled, kept in tested:
        if not kept.any():
            continue
        ends = band.simulate(modelled, sample_time=recording.sample_time)
        _, lower, upper = np.moveaxis(ends.reshape(len(ends), -1, 3)[kept], -1, 0)
        measured = recording.matrix(names)[kept]
        covered.append((lower <= measured) & (measured <= upper))
        width.append(upper - lower)
    shares, widths = (
        dict(zip(names, np.concatenate(each).mean(axis=0).tolist(), strict=True))
        for each in (covered, width)
    )
    by_run = np.array([inside.mean(axis=0) for inside in covered])
    lowest, highest = float(by_run.min()), float(by_run.max())
    branches = n_branches([run.outputs for run in held])
    reasons: dict[Unknown, bool] = {
        "blocks": band.units < FEWEST_UNITS,
        "branches": branches < FEWEST_UNITS,
        "narrow": lowest < SHARES[0],
        "wide": highest > SHARES[1],
    }
    return Banded(block, band), TestedBand(
        unknown=next((reason for reason, holds in reasons.items() if holds), None),
        level=band.level,
        units=band.units,
        branches=branches,
        unit_of_width=block.outputs[0].unit,
        coverage=shares,
        width=widths,
        lowest=lowest,
        highest=highest,
    )
