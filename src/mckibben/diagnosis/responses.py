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

FREQUENCIES = 80
"""Of a frequency response."""

COHERENT = 0.6
"""Coherence above which a measured frequency response is shown."""

AMPLITUDES, RATES = 6, (0.05, 0.5, 0.95)
"""Of sines: how many sizes, and quantiles of the measured rates."""

PERIODS, PER_PERIOD = 3, 200
"""Of a sine simulated, and samples of each; the last one counts."""

MOST_CYCLES = 200
"""Measured, of each input and output."""

STILL = 0.1
"""Share of its range that another input may move in a cycle that counts."""

FEWEST = 8
"""Samples of a cycle."""


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
        Of the measured cycles in which no other input moves.
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
    try:
        system = None if step is None else block.linear_system(step)
    except ModelError:
        return ()
    if step is None or system is None or not len(system.a):
        return ()
    frequency = np.geomspace(2 / (max(map(len, recordings)) * step), 0.5 / step, FREQUENCIES)
    base = system.response(frequency)
    values, known = block.pack(), np.flatnonzero(np.isfinite(np.diag(covariance)))
    sizes = DIFFERENCE * relative_sizes(values)
    slopes = []
    for place in known:
        moved = values.copy()
        moved[place] += sizes[place]
        other = block.unpack(moved).linear_system(step).response(frequency)
        slopes.append(np.log(other / base) / sizes[place])
    found = []
    for i, j in _pairs(block, output):
        gain = np.abs(base[:, j, i])
        angle = np.degrees(np.unwrap(np.angle(base[:, j, i])))
        gains = angles = None
        if slopes:
            own = np.array(slopes)[:, :, j, i]
            small = covariance[np.ix_(known, known)]
            wide, turned = (
                half_width * np.sqrt(np.einsum("pf,pq,qf->f", part, small, part).clip(0))
                for part in (own.real, own.imag)
            )
            gains = gain * np.exp(-wide), gain * np.exp(wide)
            angles = angle - np.degrees(turned), angle + np.degrees(turned)
        given, wanted = block.inputs[i], block.outputs[j]
        measured = _welch(recordings, given.name, wanted.name, step)
        found.append(
            FrequencyResponse(given, wanted, frequency, gain, angle, gains, angles, *measured)
        )
    return tuple(found)


def describing_functions(
    block: Block, recordings: Sequence[Recording], output: str | None = None
) -> tuple[DescribingFunction, ...]:
    """Return the describing functions of a model, beside the measured cycles."""
    modelled = [block.simulate(r) for r in recordings]
    return tuple(
        _describing_function(block, recordings, modelled, i, j) for i, j in _pairs(block, output)
    )


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


def _pairs(block: Block, output: str | None) -> Iterator[tuple[int, int]]:
    """Give inputs and outputs to look at, by their places: each output from its own input."""
    n_driven = len(block.inputs) - len(block.scheduling)
    for j, channel in enumerate(block.outputs):
        if output in (None, channel.name):
            yield (j if n_driven == len(block.outputs) else 0), j


def _welch(
    recordings: Sequence[Recording], given: str, wanted: str, step: float
) -> tuple[Array, Array, Array, Array]:
    """Return frequency, gain, angle and coherence as measured, where that is high."""
    from scipy.signal import csd

    length = min(max(map(len, recordings)) // 4, 4096)
    if length < 2 * FEWEST:
        return (np.zeros(0),) * 4
    kept = [r for r in recordings if len(r) >= length]
    settings: dict[str, Any] = {"fs": 1 / step, "nperseg": length, "detrend": "linear"}

    def power(one: str, other: str) -> NDArray[np.complex128]:
        spectra = [len(r) * csd(r[one], r[other], **settings)[1] for r in kept]
        return np.asarray(np.sum(spectra, axis=0))

    cross, alone = power(given, wanted), power(given, given).real
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.nan_to_num(np.abs(cross) ** 2 / (alone * power(wanted, wanted).real))
        response = cross / alone
    good = np.flatnonzero(coherence > COHERENT)[1 if coherence[0] > COHERENT else 0 :]
    angle = np.asarray(np.degrees(np.unwrap(np.angle(response[good]))), dtype=np.float64)
    frequency = np.asarray(np.fft.rfftfreq(length, step), dtype=np.float64)
    return frequency[good], np.abs(response[good]), angle, coherence[good]


def _describing_function(
    block: Block, recordings: Sequence[Recording], modelled: Sequence[Recording], i: int, j: int
) -> DescribingFunction:
    given, wanted = block.inputs[i], block.outputs[j]
    whole = {c.name: np.concatenate([r[c.name] for r in recordings]) for c in block.inputs}
    spans = {name: float(np.ptp(x)) for name, x in whole.items() if name != given.name}
    rows, centres = [], []
    for recording, run in zip(recordings, modelled, strict=True):
        u, step = recording[given.name], recording.sample_time or np.nan
        for cycle in cycles(u) if np.ptp(u) > 0 else []:
            n = cycle.stop - cycle.start - 1
            moved = any(np.ptp(recording[x][cycle]) > STILL * span for x, span in spans.items())
            if n < FEWEST or moved:
                continue
            by, swept = first_harmonic(u[cycle]), float(np.ptp(u[cycle]))
            both = [first_harmonic(r[wanted.name][cycle]) / by for r in (recording, run)]
            rows.append((0.5 * swept, 2 * swept / (n * step), *both))
            centres.append(0.5 * float(u[cycle].max() + u[cycle].min()))
    spread = np.linspace(0, len(rows) - 1, min(MOST_CYCLES, len(rows))).round().astype(int)
    table = np.array([rows[place] for place in spread], dtype=complex).reshape(-1, 4)
    low, high = float(whole[given.name].min()), float(whole[given.name].max())
    amplitudes, rates = table[:, 0].real, table[:, 1].real
    largest = min(float(amplitudes.max(initial=0.0)) or high, 0.5 * (high - low))
    least = min(float(amplitudes.min(initial=largest)), 0.5 * largest)
    amplitude = np.linspace(max(least, 0.05 * largest), largest, AMPLITUDES)
    rate = np.array([np.nan])
    if block.rate_dependent and np.isfinite(rates).all() and recordings[0].sample_time:
        slowest = 4 * (high - low) / (len(whole[given.name]) * recordings[0].sample_time)
        rate = np.unique(np.quantile(rates if rates.size else [slowest], RATES))
    held = np.array([np.median(x) for x in whole.values()])
    centre = float(np.median(centres)) if centres else 0.5 * (low + high)
    answers = np.full((rate.size, amplitude.size), np.nan, dtype=complex)
    for row, one in enumerate(rate):
        for column, half in enumerate(amplitude):
            about = min(max(centre, low + half), high - half)
            answers[row, column] = _answer(block, i, j, held, about, half, one)
    return DescribingFunction(
        *(given, wanted, amplitude, rate, np.abs(answers), np.degrees(np.angle(answers))),
        *(amplitudes, rates, np.abs(table[:, 2]), np.degrees(np.angle(table[:, 2]))),
        *(np.abs(table[:, 3]), np.degrees(np.angle(table[:, 3]))),
    )


def _answer(
    block: Block, i: int, j: int, held: Array, centre: float, half: float, rate: float
) -> complex:
    """Return the first harmonic of an output over that of a sine; NaN where it cannot be simulated."""
    period = PER_PERIOD if np.isnan(rate) else 4 * half / rate
    step = block.sample_time or period / PER_PERIOD
    n = round(period / step)
    if not (half > 0 and FEWEST <= n <= 100 * PER_PERIOD):
        return complex(np.nan)
    inputs = np.tile(held, (PERIODS * n + 1, 1))
    inputs[:, i] = centre - half * np.cos(2 * np.pi * np.arange(len(inputs)) / n)
    try:
        with np.errstate(all="ignore"):
            found = np.asarray(block.simulate(inputs, sample_time=None if np.isnan(rate) else step))
            last = slice((PERIODS - 1) * n, None)
            answer = first_harmonic(found.reshape(len(inputs), -1)[last, j])
    except ModelError:
        return complex(np.nan)
    return answer / first_harmonic(inputs[last, i]) if np.isfinite(answer) else complex(np.nan)
