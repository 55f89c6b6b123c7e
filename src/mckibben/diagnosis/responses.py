"""What models answer to sines, beside what was measured.

Linear models have a frequency response, with bounds from how sure their parameters are. Of all others
the first harmonic of the output, over that of the input, depends on amplitude and rate (the describing
function): a gain, and an angle, which for hysteresis stays however slow the input is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.errors import ModelError
from mckibben.estimators.core.uncertainty import DIFFERENCE, relative_sizes
from mckibben.recording import Recording
from mckibben.signals import cycles

Complex = NDArray[np.complex128]

FREQUENCIES = 80
"""Of a frequency response."""

SEGMENTS = 8
"""Of a recording, at least, whose spectra are averaged."""

COHERENT = 0.6
"""Coherence above which a measured frequency response is shown."""

AMPLITUDES, RATES = 6, 3
"""Of the grid."""

PERIODS, PER_PERIOD = 3, 200
"""Of a sine simulated, and samples of each; the last one counts."""

MOST_CYCLES = 200
"""Measured, of each input and output."""

STILL = 0.1
"""Share of its range that another input may move in a cycle that counts."""

FEWEST = 8
"""Samples of a cycle."""

BEYOND = 1e30
"""Outputs beyond which a model has left all sense."""


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Of a linear model, from one input to one output.

    Parameters
    ----------
    input, output : Channel
    frequency, gain, angle : array, shape (f,)
        [Hz]; output per input; [deg], negative where the output is late.
    gain_interval, angle_interval : (array, array) or None
        In which they lie by 95 %; None where the parameters' errors are not known.
    measured_frequency, measured_gain, measured_angle, coherence : array, shape (g,)
        By Welch's method, where the coherence is high.
    """

    input: Channel
    output: Channel
    frequency: Array
    gain: Array
    angle: Array
    gain_interval: tuple[Array, Array] | None
    angle_interval: tuple[Array, Array] | None
    measured_frequency: Array
    measured_gain: Array
    measured_angle: Array
    coherence: Array


@dataclass(frozen=True, eq=False)
class DescribingFunction:
    """Of any model, from one input to one output, others held at their medians.

    Parameters
    ----------
    input, output : Channel
    amplitude : array, shape (a,)
        Half of what sines sweep.
    rate : array, shape (r,)
        Mean rates of the input [its unit per s]; one NaN of a model that does not depend on it.
    gain, angle : array, shape (r, a)
        Output per input, and [deg], negative where the output is late; NaN where not simulated.
    measured_amplitude, measured_rate, measured_gain, measured_angle : array, shape (c,)
        Of the measured cycles.
    modelled_gain, modelled_angle : array, shape (c,)
        Of the model run free over the same cycles.
    """

    input: Channel
    output: Channel
    amplitude: Array
    rate: Array
    gain: Array
    angle: Array
    measured_amplitude: Array
    measured_rate: Array
    measured_gain: Array
    measured_angle: Array
    modelled_gain: Array
    modelled_angle: Array


def pairs(block: Block, output: str | None) -> Iterator[tuple[int, int]]:
    """Give inputs and outputs to look at, by their places: each output from its own input."""
    n_driven = len(block.inputs) - len(block.scheduling)
    for j, channel in enumerate(block.outputs):
        if output in (None, channel.name):
            yield (j if n_driven == len(block.outputs) else 0), j


def frequency_responses(
    block: Block,
    recordings: Sequence[Recording],
    covariance: Array,
    half_width: float,
    output: str | None = None,
) -> tuple[FrequencyResponse, ...]:
    """Return the frequency responses of a linear model; none of others.

    Parameters
    ----------
    covariance : array, shape (n_parameters, n_parameters)
        Of the parameters; NaN where not known.
    half_width : float
        Half an interval, in standard errors.
    """
    step = recordings[0].sample_time
    if step is None:
        return ()
    try:
        system = block.linear_system(step)
    except ModelError:
        return ()
    if not len(system.a):
        return ()
    longest = max(map(len, recordings)) * step
    frequency = np.geomspace(2 / longest, 0.5 / step, FREQUENCIES)
    base = system.response(frequency)
    slopes, known = _log_slopes(block, step, frequency, base, covariance)
    found = []
    for i, j in pairs(block, output):
        h = base[:, j, i]
        gain, angle = np.abs(h), np.degrees(np.unwrap(np.angle(h)))
        gains = angles = None
        if known.size:
            own = slopes[:, :, j, i]
            small = covariance[np.ix_(known, known)]
            spread = [
                half_width * np.sqrt(np.einsum("pf,pq,qf->f", part, small, part).clip(0))
                for part in (own.real, own.imag)
            ]
            gains = gain * np.exp(-spread[0]), gain * np.exp(spread[0])
            angles = angle - np.degrees(spread[1]), angle + np.degrees(spread[1])
        given, wanted = block.inputs[i], block.outputs[j]
        measured = _welch(recordings, given.name, wanted.name, step)
        found.append(
            FrequencyResponse(given, wanted, frequency, gain, angle, gains, angles, *measured)
        )
    return tuple(found)


def _log_slopes(
    block: Block, step: float, frequency: Array, base: Complex, covariance: Array
) -> tuple[Complex, NDArray[np.intp]]:
    """Return how the logarithm of a response moves with every known parameter, and their places."""
    values = block.pack()
    sizes = relative_sizes(values)
    known = np.flatnonzero(np.isfinite(np.diag(covariance)))
    found = []
    for place in known:
        moved = values.copy()
        moved[place] += DIFFERENCE * sizes[place]
        other = block.unpack(moved).linear_system(step).response(frequency)
        found.append(np.log(other / base) / (DIFFERENCE * sizes[place]))
    return np.array(found), known


def _welch(
    recordings: Sequence[Recording], given: str, wanted: str, step: float
) -> tuple[Array, Array, Array, Array]:
    """Return frequency, gain, angle and coherence as measured, where that is high."""
    from scipy.signal import csd, welch

    length = min(max(map(len, recordings)) // (SEGMENTS // 2), 4096)
    kept = [r for r in recordings if len(r) >= length] if length >= 16 else []
    if not kept:
        return (np.zeros(0),) * 4
    settings: dict[str, Any] = {"fs": 1 / step, "nperseg": length, "detrend": "linear"}
    frequency = np.zeros(0)
    cross, power, other = np.zeros(1, dtype=complex), np.zeros(1), np.zeros(1)
    for recording in kept:
        u, y, weight = recording[given], recording[wanted], len(recording)
        frequency, found = csd(u, y, **settings)
        cross = cross + weight * found
        power = power + weight * welch(u, **settings)[1]
        other = other + weight * welch(y, **settings)[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.nan_to_num(np.abs(cross) ** 2 / (power * other))
        response = cross / power
    good = np.flatnonzero(coherence > COHERENT)
    good = good[frequency[good] > 0]
    if good.size > FREQUENCIES:  # evenly over the logarithm
        wanted_at = np.geomspace(frequency[good[0]], frequency[good[-1]], FREQUENCIES)
        good = np.unique(good[np.searchsorted(frequency[good], wanted_at * (1 - 1e-9))])
    angle = np.degrees(np.unwrap(np.angle(response[good])))
    return frequency[good], np.abs(response[good]), angle, np.asarray(coherence)[good]


def describing_functions(
    block: Block,
    recordings: Sequence[Recording],
    output: str | None = None,
) -> tuple[DescribingFunction, ...]:
    """Return the describing functions of a model, beside the measured cycles."""
    modelled = [block.simulate(r) for r in recordings]
    return tuple(
        _describing_function(block, recordings, modelled, i, j) for i, j in pairs(block, output)
    )


def _describing_function(
    block: Block,
    recordings: Sequence[Recording],
    modelled: Sequence[Recording],
    i: int,
    j: int,
) -> DescribingFunction:
    given, wanted = block.inputs[i], block.outputs[j]
    others = [channel.name for place, channel in enumerate(block.inputs) if place != i]
    medians = [
        float(np.median(np.concatenate([r[c.name] for r in recordings]))) for c in block.inputs
    ]
    spans = {n: float(np.ptp(np.concatenate([r[n] for r in recordings]))) for n in others}
    rows, centres = [], []
    for recording, run in zip(recordings, modelled, strict=True):
        u, step = recording[given.name], recording.sample_time
        for cycle in cycles(u) if np.ptp(u) > 0 else []:
            n = cycle.stop - cycle.start - 1
            moved = any(np.ptp(recording[name][cycle]) > STILL * spans[name] for name in others)
            if n < FEWEST or moved:
                continue
            by = first_harmonic(u[cycle])
            rate = np.nan if step is None else 2 * float(np.ptp(u[cycle])) / (n * step)
            both = [first_harmonic(r[wanted.name][cycle]) / by for r in (recording, run)]
            rows.append((0.5 * float(np.ptp(u[cycle])), rate, *both))
            centres.append(0.5 * float(u[cycle].max() + u[cycle].min()))
    spread = np.linspace(0, len(rows) - 1, min(MOST_CYCLES, len(rows))).round().astype(int)
    table = np.array([rows[place] for place in spread], dtype=complex).reshape(-1, 4)
    low = min(float(r[given.name].min()) for r in recordings)
    high = max(float(r[given.name].max()) for r in recordings)
    amplitude, rate = _grid(block, table, 0.5 * (high - low), recordings)
    centre = float(np.median(centres)) if centres else 0.5 * (low + high)
    answers = np.full((rate.size, amplitude.size), np.nan, dtype=complex)
    for row, one in enumerate(rate):
        for column, half in enumerate(amplitude):
            about = min(max(centre, low + half), high - half)
            answers[row, column] = _answer(block, i, j, medians, about, half, one)
    return DescribingFunction(
        *(given, wanted, amplitude, rate, np.abs(answers), np.degrees(np.angle(answers))),
        *(
            table[:, 0].real,
            table[:, 1].real,
            np.abs(table[:, 2]),
            np.degrees(np.angle(table[:, 2])),
        ),
        *(np.abs(table[:, 3]), np.degrees(np.angle(table[:, 3]))),
    )


def _grid(
    block: Block, table: Complex, half: float, recordings: Sequence[Recording]
) -> tuple[Array, Array]:
    """Return amplitudes and rates inside what recordings cover."""
    amplitudes, rates = table[:, 0].real, table[:, 1].real
    largest = min(float(amplitudes.max(initial=0.0)) or half, half)
    least = float(amplitudes.min(initial=largest))
    amplitude = np.linspace(max(min(least, 0.5 * largest), 0.05 * largest), largest, AMPLITUDES)
    if not block.rate_dependent or recordings[0].sample_time is None:
        return amplitude, np.array([np.nan])
    if not rates.size:
        duration = max(map(len, recordings)) * recordings[0].sample_time
        return amplitude, np.array([8 * half / duration])
    ends = np.quantile(rates, [0.05, 0.95])
    if ends[1] < 1.2 * ends[0]:
        return amplitude, np.array([float(np.median(rates))])
    return amplitude, np.geomspace(float(ends[0]), float(ends[1]), RATES)


def _answer(
    block: Block, i: int, j: int, held: Sequence[float], centre: float, half: float, rate: float
) -> complex:
    """Return the first harmonic of an output over that of a sine; NaN where it cannot be simulated."""
    if not half > 0:
        return complex(np.nan)
    period = PER_PERIOD if np.isnan(rate) else 4 * half / rate
    step = block.sample_time or period / PER_PERIOD
    n = round(period / step)
    if not FEWEST <= n <= 100 * PER_PERIOD:
        return complex(np.nan)
    sine = -np.cos(2 * np.pi * np.arange(PERIODS * n + 1) / n)
    inputs = np.tile(np.array(held), (sine.size, 1))
    inputs[:, i] = centre + half * sine
    try:
        found = np.asarray(block.simulate(inputs, sample_time=None if np.isnan(rate) else step))
    except ModelError:
        return complex(np.nan)
    last = slice((PERIODS - 1) * n, None)
    answer = found.reshape(len(inputs), -1)[last, j]
    if not np.abs(answer).max() < BEYOND:
        return complex(np.nan)
    return first_harmonic(answer) / first_harmonic(inputs[last, i])


def first_harmonic(x: Array) -> complex:
    """Return the first harmonic of one period, which holds both its ends; drift is taken out.

    >>> t = np.linspace(0, 2 * np.pi, 101)
    >>> h = first_harmonic(3 * np.cos(t) + np.cos(2 * t) + 0.1 * t)
    >>> round(abs(h), 6)
    3.0
    """
    n = len(x) - 1
    place = np.arange(n)
    level = x[:n] - (x[n] - x[0]) * place / n
    return complex(2 / n * np.sum(level * np.exp(-2j * np.pi * place / n)))
