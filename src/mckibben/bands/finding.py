"""A band found: units that are exchangeable, a scale by state, and the quantiles of scores.

Scores are of units that the scale does not know (in turn), so that they are like those of a new run.
Which scale is used is by how narrow the band is there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.bands.held import BLOCK, Held, off_as_a_whole
from mckibben.bands.scale import SHAPES, Scale, Shape, Terms, scale_of
from mckibben.blocks.bands import Band, look_along
from mckibben.blocks.base import Block
from mckibben.blocks.fields import rows, vector
from mckibben.errors import DataError
from mckibben.numerals import numeral
from mckibben.statistics import correlation_length
from mckibben.system.threads import one_blas_thread

Unit = Literal["auto", "run", "block"]

LEVEL = 0.9

MANY = 20
"""Runs from which they are the units; of fewer the largest score of any would bound 90 %."""

WIDTHS = (0.03, 0.1, 0.3)
"""Of plays, as shares of a range: just turned, turned a while ago, in another loop."""

N_TIMES, SHORTEST, LONGEST = 4, 2.0, 2.0
"""Lags, the shortest in samples, and how often the longest fits into the longest run."""

MOST_FITTED = 8000
"""Samples that a scale is fitted to, and as many that are scored at a time."""

HELD, NEAR = 0.02, 0.1
"""Shares of the widest range of a unit: what moves by less is held, and near it is as good as there."""

STEPS = 1000
"""Of the table of quantiles."""

PARTS = 5
"""That the units are left out in."""

WORTH = 0.02
"""Share of the width that a less simple scale must save."""


@dataclass(frozen=True)
class Found:
    """A band, and what is to be said of it.

    Parameters
    ----------
    band : Band
    memory : float
        Samples that errors stay alike for.
    widths : tuple of float
        Of every output, mean width at ``level`` on units left out, over that of a constant band.
    mean_widths : tuple of float
        The same in the output's unit.
    level : float
        Of the widths: `LEVEL`, or the highest that the units allow.
    notes : tuple of str
    """

    band: Band
    memory: float
    widths: tuple[float, ...]
    mean_widths: tuple[float, ...]
    level: float
    notes: tuple[str, ...]


@one_blas_thread()
def find_band(
    model: Block,
    runs: Sequence[Held],
    unit: Unit = "auto",
    shapes: Sequence[Shape] = SHAPES,
) -> Found:
    """Return the band of a model that missed so much on runs it was not fitted to.

    Parameters
    ----------
    model : Block
    runs : sequence of Held
        All with the model's inputs and outputs.
    unit : {"auto", "run", "block"}
        What is exchangeable.
    shapes : sequence of Shape
        What a scale may be made of, from the simplest on; the first alone is the same everywhere.

    Raises
    ------
    DataError
        Where errors stay alike for so long that the runs hold fewer than two units.
    """
    missed = [run.measured - run.modelled for run in runs]
    by_output = [
        [e[run.counts, k] for e, run in zip(missed, runs, strict=True)]
        for k in range(missed[0].shape[1])
    ]
    memory = max(map(correlation_length, by_output))
    which, units, note = _units(runs, by_output, memory, unit)
    ends = _ends(
        np.concatenate([np.hstack([run.inputs, run.modelled]) for run in runs]),
        [channel.unit for channel in (*model.inputs, *model.outputs)],
    )
    times = _times(runs)
    seen, units_of, all_missed = [], [], []
    for run, errors, own in zip(runs, missed, units, strict=True):
        samples = np.ascontiguousarray(np.hstack([run.inputs, run.modelled]))
        n_driving, n_x = run.inputs.shape[1], samples.shape[1]
        keeps = np.exp(-(run.sample_time or 1.0) / np.array(times))
        state = np.empty(n_driving * (len(WIDTHS) + keeps.size))
        found = np.empty((len(samples), n_x + state.size))
        look_along(samples, ends.ravel(), np.array(WIDTHS), keeps, state, found)
        seen.append(found[run.counts])
        units_of.append(own[run.counts])
        all_missed.append(errors[run.counts])
    of = np.unique(np.concatenate(units_of), return_inverse=True)[1]
    n_units = int(of.max()) + 1
    # what is like in a whole run, or of one model, is foreseen in a part of it, and in no new one
    models = [run.by for run in runs]
    alike = models if len(set(models)) > 1 else range(len(runs))
    apart = np.repeat(np.array(alike), [e.shape[0] for e in all_missed])
    apart = of if len(runs) == 1 else np.unique(apart, return_inverse=True)[1]
    if n_units < 2 and unit == "run":
        raise DataError(
            "one run tells nothing of another",
            remedy="calibrate on two or more, or count blocks of it (--exchangeable block)",
        )
    if n_units < 2:
        raise DataError(
            f"errors stay alike for {numeral(memory, 3)} samples, and {of.size} are too few for two "
            "blocks that differ",
            remedy="calibrate on more, or longer, recordings",
        )
    shown = np.concatenate(seen)
    made = Terms.of(shown)
    terms = made(shown)
    level = min(LEVEL, n_units / (n_units + 1))
    best, scores, widths = [], [], []
    for errors in np.concatenate(all_missed).T:
        scale, own_scores, *width = _best(terms, errors, of, apart, level, shapes)
        best.append(scale)
        scores.append(_calibrated(own_scores, of))
        widths.append(width)
    band = Band(
        driving=model.inputs,
        given=model.outputs,
        ends=rows(ends),
        widths=WIDTHS,
        times=times,
        mean=vector(made.mean),
        spread=vector(made.spread),
        bells=(),
        sharpness=1.0,
        shift=rows(np.array([scale.shift for scale in best])),
        log_scale=rows(np.array([scale.log_scale for scale in best])),
        limits=rows(np.array([scale.limits for scale in best])),
        scores=rows(np.array(scores)),
        units=n_units,
        unit=which,
        level=level,
        memory=memory * (max(run.sample_time or 0.0 for run in runs) if times else 1.0),
    )
    narrower, mean = zip(*widths, strict=True)
    return Found(band, memory, narrower, mean, level, (note,) if note else ())


def _best(
    terms: Array,
    errors: Array,
    of: NDArray[np.intp],
    apart: NDArray[np.intp],
    level: float,
    shapes: Sequence[Shape],
) -> tuple[Scale, Array, float, float]:
    """Return the scale of the narrowest band, its scores, its width over a constant's, and its width.

    Units, by ``of``, weigh the same; those that ``apart`` numbers alike are left out together.
    """
    n_apart = int(apart.max()) + 1
    part, typical = apart * min(PARTS, n_apart) // n_apart, terms.mean(axis=0)
    every = max(len(errors) // MOST_FITTED, 1)

    some = np.arange(0, len(errors), every)

    def scale_on(known: NDArray[np.intp], shape: Shape) -> Scale:
        return scale_of(terms[known], errors[known], apart[known], shape, typical)

    def tried(shape: Shape) -> tuple[Scale, Array, float]:
        scores, width = np.empty(len(errors)), 0.0
        whole, fitted = scale_on(some, shape), []
        for place in range(int(part.max()) + 1):
            here = part == place
            scale = scale_on(np.flatnonzero(~here)[::every], shape)
            scores[here] = scale.scores(terms[here], errors[here])
            fitted.append((here, scale))
        half = float(_quantiles(scores, of)[round(level * STEPS)])
        width = sum(scale.width(terms[here], half) * here.sum() for here, scale in fitted)
        # scores are of scales that know less: what these save, the one that is used must save, too
        return whole, scores, max(float(width) / len(errors), whole.width(terms, half))

    scale, scores, constant = tried(shapes[0])
    width = constant
    for shape in shapes[1:]:
        other, own, narrower = tried(shape)
        if narrower < (1.0 - WORTH) * width:
            scale, scores, width = other, own, narrower
    return scale, scores, width / constant if constant > 0 else 1.0, width


def _calibrated(scores: Array, of: NDArray[np.intp]) -> Array:
    """Return the score that a band at level 0, 1 / STEPS, ... 1 reaches to.

    A quantile that so many units give holds, of another unit, that share on average which it would have
    held of each of them, had it been found on the rest: more runs than the level are asked of few, or of
    such that differ as a whole, hardly more of many that are alike. What no unit's rest would have held
    is given the largest score.
    """
    n_units = int(of.max()) + 1
    reached = _quantiles(scores, of)
    held = np.empty((n_units, STEPS + 1))
    for unit in range(n_units):
        own = np.sort(scores[of == unit])
        held[unit] = np.searchsorted(own, reached, side="right") / own.size
    others = (held.sum(axis=0) - held) / (n_units - 1)
    shares = np.linspace(0.0, 1.0, STEPS + 1)
    left_out = np.zeros(STEPS + 1)
    for own, rest in zip(held, others, strict=True):
        places = np.searchsorted(rest, shares - 1e-9).clip(max=STEPS)
        left_out += own[places] / n_units
    left_out = np.maximum.accumulate(left_out)
    first = np.searchsorted(left_out, shares - 1e-9).clip(max=STEPS)
    # of quantiles whose rests hold alike, as those between two units do, the widest
    last = np.searchsorted(left_out, left_out[first] + 1e-9, side="right") - 1
    return np.asarray(reached[last])


def _quantiles(scores: Array, of: NDArray[np.intp]) -> Array:
    """Return quantiles of scores, where every unit weighs the same, at shares 0, 1 / STEPS, ... 1."""
    order = np.argsort(scores)
    weights = 1.0 / np.bincount(of)[of[order]]
    share = np.cumsum(weights) / weights.sum()
    wanted = np.linspace(0.0, 1.0, STEPS + 1)
    places = np.searchsorted(share, wanted - 1e-9).clip(max=scores.size - 1)
    return np.asarray(scores[order][places])


def _units(
    runs: Sequence[Held], errors: Sequence[list[Array]], memory: float, unit: Unit
) -> tuple[Literal["run", "block"], list[NDArray[np.intp]], str]:
    """Return what is exchangeable, which unit every sample of every run is of, and what to say.

    ``errors`` are of every output, those of every run that count.
    """
    lengths = [len(run.inputs) for run in runs]
    longest = max(int(np.ceil(BLOCK * memory)), 1)
    pieces = [max(length // longest, 1) for length in lengths]
    few = unit == "auto" and len(runs) < MANY
    apart = few and any(off_as_a_whole(of_runs, pieces) for of_runs in errors)
    single = unit == "auto" and (len(runs) >= MANY or sum(pieces) == len(runs))
    as_runs = unit == "run" or single or apart
    if as_runs:
        pieces = [1] * len(runs)
    units, count, note = [], 0, ""
    for length, n in zip(lengths, pieces, strict=True):
        units.append(count + np.arange(length) * n // length)
        count += n
    if not as_runs:
        note = (
            f"{len(runs)} run(s) are few: {count} blocks of them, each {numeral(BLOCK, 2)} memories of "
            "the error or longer, count as exchangeable instead, so what differs from run to run is not "
            f"in the band. Remedy: calibrate on {MANY} runs or more"
        )
    elif apart:
        note = (
            f"{len(runs)} runs are off as a whole by more than blocks of one differ, so each run "
            f"counts once, which allows up to {numeral(100 * len(runs) / (len(runs) + 1), 3)} %. "
            "Remedy: calibrate on more runs"
        )
    elif unit != "run" and len(runs) < MANY and min(lengths) < BLOCK * memory:
        note = (
            f"errors stay alike for {numeral(memory, 3)} samples, about as long as runs last, so each "
            "run counts once"
        )
    return ("run" if as_runs else "block"), units, note


def _ends(samples: Array, units: Sequence[str]) -> Array:
    """Return the lowest and highest of every channel, shape (2, channels); of one held, near it.

    A channel that moves by little of what others of its unit do is held, but for its sensor's noise.
    """
    low, high = samples.min(axis=0), samples.max(axis=0)
    spans = high - low
    widest = np.array(
        [max(s for s, other in zip(spans, units, strict=True) if other == unit) for unit in units]
    )
    held = spans <= HELD * widest
    near = np.where(held, np.maximum(0.025 * np.abs(low) + 1e-3, NEAR * widest), 0.0)
    return np.array([low - near, high + near])


def _times(runs: Sequence[Held]) -> tuple[float, ...]:
    """Return time constants of lags that the runs can tell of; none without time."""
    if any(run.sample_time is None for run in runs):
        return ()
    step = max(run.sample_time or 0.0 for run in runs)
    longest = max(len(run.inputs) * (run.sample_time or 0.0) for run in runs) / LONGEST
    if longest <= SHORTEST * step:
        return ()
    return vector(np.geomspace(SHORTEST * step, longest, N_TIMES))
