"""A model checked on recordings: what it leaves of them, and whether that is noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.bands.banded import inside
from mckibben.blocks.base import Block
from mckibben.recording import Recording, listed
from mckibben.signals.reversals import noise_level, reversals
from mckibben.system.progress import Tell, one_by_one, telling
from mckibben.validation import judging
from mckibben.validation.crossing import Crossing, crossing
from mckibben.validation.k_step import errors_ahead
from mckibben.validation.patterns import Pattern, binned, by_branch
from mckibben.validation.regression import Regression
from mckibben.validation.residuals import Run, runs_of
from mckibben.validation.results import ROUNDING, OutputCheck, Validation
from mckibben.validation.suspects import Suspects, averaged, block_length, suspects
from mckibben.validation.whiteness import whiteness

FEWEST_BLOCKS = 6
"""Of a recording that is tested."""

UNMOVED = 0.05
"""Share of the samples that are equal to the one before, from which a sensor shows its steps."""

OFF_GRID = 0.01
"""Steps by which a sample may miss the sensor's steps."""

FORGOTTEN = np.exp(-1.0)
"""Correlation below which noise has forgotten."""


def check(
    model: Block,
    recordings: Recording | Sequence[Recording],
    *,
    progress: bool | Tell | None = None,
) -> Validation:
    """Say whether a model is right on recordings, and what it misses if it is not.

    The model runs free, from an honest start of its memory. What it leaves is tested for being white;
    for following inputs, now and before, the modelled output, rates, loads, the branch (hysteresis that
    is left), time, and holds (creep). The tests hold for noise whose samples are like their
    neighbours; the level is shared among them.

    Parameters
    ----------
    model : Block
        What is checked.
    recordings : Recording or sequence of Recording
        With all inputs and outputs of the model; of one sample time. They tell most where the model
        was fitted to others.
    progress : bool or callable, optional
        Whether to show a bar; or who is told the share done, and words.

    Returns
    -------
    Validation
        Read its ``verdict`` and ``sentences`` first.

    Raises
    ------
    DataError
        On recordings that lack channels, are too short or constant, differ in sample time, or are the
        same in part.
    ModelError
        Where the model's output is not finite, or runs away.
    """
    model = inside(model)
    with telling(progress, "checking") as tell:
        return check_runs(model, runs_of(model, listed(recordings)), tell)


def check_runs(model: Block, runs: Sequence[Run], tell: Tell | None = None) -> Validation:
    """Check a model by what it made of recordings, running free; see `check`."""
    every = block_length(model, runs)
    tested = [run for run in runs if len(run.inputs) // every >= FEWEST_BLOCKS] or list(runs)
    notes = []
    if len(tested) < len(runs):
        names = ", ".join(run.recording.name for run in runs if run not in tested)
        notes.append(f"too short beside the others to be tested, so left out of most: {names}")
    outputs = tuple(
        _output(model, runs, tested, every, place)
        for place in one_by_one(range(len(model.outputs)), tell)
    )
    return Validation(
        model.kind, tuple(run.recording.name for run in runs), outputs, tuple(notes), tuple(runs)
    )


def _output(
    model: Block, runs: Sequence[Run], tested: Sequence[Run], every: int, place: int
) -> OutputCheck:
    channel = model.outputs[place]
    residuals = [run.residual[:, place] for run in runs]
    measured = [run.measured[:, place] for run in runs]
    n = sum(map(len, residuals))
    squares = float(sum(e @ e for e in residuals))
    span = float(max(y.max() for y in measured) - min(y.min() for y in measured))
    found = suspects(model, tested, place, every)
    left = [averaged(run.residual[:, place], every) for run in tested]
    # where nothing but rounding is left, what it follows is the arithmetic
    exact = np.sqrt(squares / n) <= ROUNDING * span
    quiet = [e * 0.0 for e in left] if exact else left
    regression = Regression(list(zip(quiet, found.tables, strict=True)))
    n_tests = len(model.outputs) * (len(found.groups) + 1)
    about = (every, squares, n)
    lengths = [
        length
        for run in runs
        for k, own in enumerate(model.inputs)
        if own.name not in model.scheduling and np.ptp(run.inputs[:, k]) > 0
        for length in np.diff(reversals(run.inputs[:, k]))
    ]
    memory = _memory(residuals)
    white = whiteness([e * 0.0 if exact else e for e in residuals], 3 * memory)
    levels = [noise_level(y, span) for y in measured if len(y) > 1]
    known = [level for level in levels if np.isfinite(level)]
    asked = judging.asked(regression, found.groups, *about)
    missing = () if exact else judging.missing(regression, found.groups, *about, n_tests)
    return OutputCheck(
        output=channel.name,
        unit=channel.unit,
        n_samples=n,
        sample_time=runs[0].recording.sample_time,
        span=span,
        deviation=float(np.std(np.concatenate(measured))),
        rmse=float(np.sqrt(squares / n)),
        sensor_noise=float(np.median(known)) if known else None,
        resolution=_resolution(measured),
        whiteness=white,
        crossings=_crossings(model, tested, left, found, regression),
        patterns=_patterns(model, tested, left, found, regression, place),
        suspects=asked,
        missing=missing,
        slow=() if exact else judging.slow(asked, missing, n_tests),
        noise_time=memory,
        independent=regression.independent,
        branch_length=float(np.median(lengths)) if lengths else float(n),
        every=every,
        ahead=errors_ahead(model, runs, place),
        n_tests=n_tests,
        large_steps=found.large_steps,
    )


def _crossings(
    model: Block,
    runs: Sequence[Run],
    left: Sequence[Array],
    found: Suspects,
    regression: Regression,
) -> tuple[Crossing, ...]:
    every = found.every
    crossings = []
    for k, channel in enumerate(model.inputs):
        inputs = [averaged(run.inputs[:, k], every) for run in runs]
        if max(u.max() for u in inputs) > min(u.min() for u in inputs):
            group = found.of("crossing", channel.name)
            p = None if group is None else regression.test(group.columns, group.beside).p_value
            crossings.append(crossing(channel.name, left, inputs, every, regression, p))
    return tuple(crossings)


def _patterns(
    model: Block,
    runs: Sequence[Run],
    left: Sequence[Array],
    found: Suspects,
    regression: Regression,
    place: int,
) -> tuple[Pattern, ...]:
    every = found.every

    def p_value(kind: str, channel: str = "") -> float | None:
        group = found.of(kind, channel)
        return None if group is None else regression.test(group.columns, group.beside).p_value

    step = runs[0].recording.sample_time
    patterns = []
    for k, channel in enumerate(model.inputs):
        name, unit = channel.name, channel.unit
        inputs = [averaged(run.inputs[:, k], every) for run in runs]
        if max(u.max() for u in inputs) == min(u.min() for u in inputs):
            continue
        bins = binned(left, inputs, every, regression)
        if name in model.scheduling:
            patterns.append(Pattern("load", name, unit, bins, p_value("load", name)))
            continue
        patterns.append(Pattern("input", name, unit, bins, p_value("curve", name)))
        rates = [np.gradient(u) / (every * (step or 1.0)) for u in inputs]
        bins = binned(left, rates, every, regression)
        per = f"{unit}/s" if step else f"{unit}/sample"
        patterns.append(Pattern("rate", name, per, bins, p_value("speed", name)))
        group = found.of("hysteresis", name)
        if group is not None:
            ways = [table[:, group.columns[0]] for table in found.tables]
            bins = by_branch(left, inputs, ways, every, regression)
            patterns.append(Pattern("branch", name, unit, bins, p_value("hysteresis", name)))
    channel = model.outputs[place]
    modelled = [averaged(run.modelled[:, place], every) for run in runs]
    bins = binned(left, modelled, every, regression)
    patterns.append(Pattern("output", channel.name, channel.unit, bins, p_value("output")))
    return tuple(patterns)


def _resolution(measured: Sequence[Array]) -> float:
    """Return the step of a measured output whose samples are all whole steps apart; else 0."""
    values = np.unique(np.concatenate(measured))
    span = float(values[-1] - values[0])
    steps = np.diff(values)
    steps = steps[steps > ROUNDING * span]
    unmoved = np.mean(np.concatenate([np.diff(y) for y in measured]) == 0)
    if not steps.size or unmoved < UNMOVED:
        return 0.0
    step = float(steps.min())
    places = (values - values[0]) / step
    return step if np.abs(places - np.round(places)).max() < OFF_GRID else 0.0


def _memory(residuals: Sequence[Array]) -> float:
    """Return after how many samples residuals have forgotten all but a third, about the mean."""
    n = sum(map(len, residuals))
    mean = sum(float(r.sum()) for r in residuals) / n
    longest = max(map(len, residuals))
    total = np.zeros(longest)
    for r in residuals:
        size = 2 * len(r)
        power = np.abs(np.fft.rfft(r - mean, size)) ** 2
        total[: len(r)] += np.fft.irfft(power, size)[: len(r)]
    if total[0] <= 0:
        return 0.0
    below = np.flatnonzero(total < FORGOTTEN * total[0])
    return float(below[0]) if below.size else float(longest)
