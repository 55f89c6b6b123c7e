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

LEVEL = 0.9
"""Default level of a band, reduced to the highest that the number of units allows."""

LEVELS = np.linspace(0.0, 1.0, 1001)
"""Levels in the table of half widths."""

FEWEST_UNITS = 9
"""Smallest number of units for a level of 0.9: with fewer runs, blocks of runs are the exchangeable
units.
"""

SHORTEST_BLOCK = 2.0
"""Shortest block, in correlation lengths of the errors."""

WIDENINGS = (0.0, 0.3, 1.0, 3.0, 10.0)
"""Candidate increases of the width at mean speed, relative to that at rest."""

HALF_AT_SPEED = (1.0,)
"""The same for motion of another kind than in training, where the narrowest band of these data is no
better than another: half of the mean width grows with speed.
"""

FOLDS = 5
"""Number of cross-validation folds that choose among them."""

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
        problem = "there are none to calibrate on"
        raise DataError(problem, parameter="recordings", remedy="give at least one")
    check_sample_times(recordings)
    for recording in recordings:
        check_units(recording, model.outputs)
    inputs, outputs = ([c.name for c in channels] for channels in (model.inputs, model.outputs))
    check_shared({"fit": fitted, "calibrate": recordings}, inputs, outputs)
    with telling(progress, "calibrating") as tell:
        runs = [free_run(model, recording) for recording in one_by_one(recordings, tell)]
    # the first sample, a start, is not scored
    scored = [replace(run, counts=np.arange(len(run)) > 0) for run in runs]
    return replace(find_band(model, scored, exchangeable), fitted_known=bool(fitted))


def find_band(
    model: Block,
    runs: Sequence[FreeRun],
    unit: Unit = "auto",
    widenings: Sequence[float] = WIDENINGS,
) -> Calibration:
    """Return the band of a model from its errors on held-out runs; needs two units."""
    runs = [run for run in runs if run.counts.any()]
    errors = [run.errors for run in runs]
    memory = max(correlation_length(x) for x in zip(*(e.T for e in errors), strict=True))
    by_run = unit == "run" or (unit == "auto" and len(runs) >= FEWEST_UNITS)
    unit_name: Literal["run", "block"] = "run" if by_run else "block"
    units = _units([len(e) for e in errors], None if by_run else memory)
    n = int(units[-1]) + 1
    if n < 2:
        raise DataError(
            f"errors are correlated over {numeral(memory, 3)} samples, so {sum(map(len, errors))} of "
            f"them are one {unit_name}, which is too few for a band",
            remedy="calibrate on more, or longer, recordings",
        )

    level = min(LEVEL, n / (n + 1))
    widenings = widenings if all(run.sample_time for run in runs) else WIDENINGS[:1]
    speeds = np.concatenate([run.speeds for run in runs])
    bands_of_outputs = [
        _narrowest(np.abs(error), speed, units, level, widenings)
        for error, speed in zip(np.concatenate(errors).T, speeds.T, strict=True)
    ]
    widening, scores, widths, ratios = zip(*bands_of_outputs, strict=True)

    samples = np.concatenate([np.hstack([run.inputs, run.modelled]) for run in runs])
    band = Band(
        driving=model.inputs,
        given=model.outputs,
        ends=rows(np.array([samples.min(axis=0), samples.max(axis=0)])),
        widening=vector(np.array(widening)),
        scores=rows(np.array(scores)),
        units=n,
        unit=unit_name,
        level=level,
        memory=memory * max(run.sample_time or 0.0 for run in runs),
    )
    return Calibration(Banded(model, band), band, len(runs), memory, widths, ratios)


def _units(lengths: Sequence[int], memory: float | None) -> NDArray[np.intp]:
    """Return the number of the exchangeable unit of every sample of runs of these lengths.

    Units are runs, or with ``memory``, a correlation length [samples], blocks that are long against it.
    """
    units: list[NDArray[np.intp]] = []
    n = 0
    for length in lengths:
        pieces = 1
        if memory is not None:
            block = max(block_length(length, memory), SHORTEST_BLOCK * memory)
            pieces = max(int(length / block), 1)
        units.append(n + np.arange(length) * pieces // length)
        n += pieces
    return np.concatenate(units)


def _half_widths(
    errors: Array, relative_width: Array, units: NDArray[np.intp], levels: Array, n: int
) -> Array:
    """Return the quantiles of |error| / width at levels, as split conformal prediction has them.

    Units weigh the same. With n of them, the quantile of a level is that of level (n + 1) / n.
    """
    scores = errors / relative_width
    order = np.argsort(scores)
    _, place, sizes = np.unique(units, return_inverse=True, return_counts=True)
    shares = np.cumsum(1.0 / sizes[place[order]]) / sizes.size
    needed = np.minimum(levels * (n + 1) / n, 1.0) - 1e-9
    return np.asarray(scores[order][np.searchsorted(shares, needed).clip(max=scores.size - 1)])


def _narrowest(
    errors: Array,
    speeds: Array,
    units: NDArray[np.intp],
    level: float,
    widenings: Sequence[float],
) -> tuple[float, Array, float, float]:
    """Return widening, half widths at all levels, mean width, and its ratio to a constant band's.

    Widths are those on units that are left out of the quantile.
    """
    mean, n = float(speeds.mean()) or 1.0, int(units[-1]) + 1
    fold = units * min(FOLDS, n) // n

    def width(widening: float) -> float:
        total, relative = 0.0, 1.0 + widening * speeds
        for out in (fold == k for k in range(int(fold[-1]) + 1)):
            inside = ~out
            half = _half_widths(errors[inside], relative[inside], units[inside], np.array(level), n)
            total += 2.0 * float(half) * float(relative[out].sum())
        return total / errors.size

    candidates = [(width(share / mean), share / mean) for share in widenings]
    narrowest, widening = min(candidates)
    scores = _half_widths(errors, 1.0 + widening * speeds, units, LEVELS, n)
    constant = candidates[0][0]
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
    whole = np.concatenate(tables)
    low, span = whole.min(axis=0), np.maximum(np.ptp(whole, axis=0), np.finfo(float).tiny)
    counts = []
    for runs in zip(*(((table - low) / span).T for table in tables), strict=True):
        turns = [run[reversals(run, MARGIN)] for run in runs]
        branches = np.concatenate([np.column_stack([ends[:-1], ends[1:]]) for ends in turns])
        count = 0
        while len(branches):  # those like the first one are one branch
            branches = branches[np.abs(branches - branches[0]).max(axis=1) > MARGIN]
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
    if not held:
        return None
    try:
        band = find_band(block, held, "block", HALF_AT_SPEED).band
    except DataError:
        return None

    names = [channel.name for channel in block.outputs]
    inside, widths = _coverage(band, names, outputs[len(split.train) :], split)
    by_recording = np.array([samples.mean(axis=0) for samples in inside])
    lowest, highest = float(by_recording.min()), float(by_recording.max())
    branches = n_branches([run.outputs for run in held])
    reasons: dict[Unknown, bool] = {
        "blocks": band.units < FEWEST_UNITS,
        "branches": branches < FEWEST_UNITS,
        "narrow": lowest < SHARES[0],
        "wide": highest > SHARES[1],
    }
    coverage, width = (
        dict(zip(names, np.concatenate(tables).mean(axis=0).tolist(), strict=True))
        for tables in (inside, widths)
    )
    return Banded(block, band), TestedBand(
        unknown=next((reason for reason, applies in reasons.items() if applies), None),
        level=band.level,
        units=band.units,
        branches=branches,
        unit_of_width=block.outputs[0].unit,
        coverage=coverage,
        width=width,
        lowest=lowest,
        highest=highest,
    )


def _coverage(
    band: Band, names: Sequence[str], outputs: Sequence[Array], split: Split
) -> tuple[list[NDArray[np.bool_]], list[Array]]:
    """Return which scored samples of every test recording are inside the band, and its widths."""
    inside, widths = [], []
    for recording, modelled, scored in zip(split.test, outputs, split.test_rows, strict=True):
        if not scored.any():
            continue
        ends = band.simulate(modelled, sample_time=recording.sample_time)
        _, lower, upper = np.moveaxis(ends.reshape(len(ends), -1, 3)[scored], -1, 0)
        measured = recording.matrix(names)[scored]
        inside.append((lower <= measured) & (measured <= upper))
        widths.append(upper - lower)
    return inside, widths
