"""Frequency responses of linear models, with measured ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.estimators.core.uncertainty import DIFFERENCE, relative_sizes
from mckibben.recording import Recording

FREQUENCIES, COHERENT = 80, 0.6
"""Number of frequencies, and smallest coherence of measurements that are shown."""

LEAST, MOST = 16, 4096
"""Smallest and largest segment of Welch's method [samples]."""


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Frequency response of a linear model from one input to one output.

    Parameters
    ----------
    input, output : Channel
    frequency, gain, angle : array, shape (f,)
        [Hz]; output per input; [deg], negative where the output is late.
    gain_interval, angle_interval : (array, array) or None
        In which they lie by 95 %; None where the parameters' errors are not known.
    measured_frequency, measured_gain, measured_angle : array, shape (g,)
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


def frequency_responses(
    block: Block, recordings: Sequence[Recording], covariance: Array, half_width: float
) -> tuple[FrequencyResponse, ...]:
    """Return the frequency response of every output to its main input; none for a nonlinear model.

    Parameters
    ----------
    covariance : array, shape (n_parameters, n_parameters)
        Of the parameters; NaN where not known.
    half_width : float
        Half an interval, in standard errors.
    """
    step = recordings[0].sample_time
    if step is None or not block.is_linear or block.n_states == 0:
        return ()
    frequency = np.geomspace(2 / (max(map(len, recordings)) * step), 0.5 / step, FREQUENCIES)
    base = linear_response(block, step, frequency)
    values, known = block.pack(), np.flatnonzero(np.isfinite(np.diag(covariance)))
    steps = DIFFERENCE * relative_sizes(values)
    slopes = np.zeros((known.size, *base.shape), dtype=complex)
    for slope, place in zip(slopes, known, strict=True):
        moved = block.unpack(values + steps * (np.arange(values.size) == place))
        slope[:] = np.log(linear_response(moved, step, frequency) / base) / steps[place]
    small, found = covariance[np.ix_(known, known)], []
    for j, output in enumerate(block.outputs):
        i = j if len(block.inputs) - len(block.scheduling) == len(block.outputs) else 0
        gain, angle = np.abs(base[:, j, i]), np.degrees(np.unwrap(np.angle(base[:, j, i])))
        wide, turned = (
            half_width * np.sqrt(np.einsum("pf,pq,qf->f", part, small, part).clip(0))
            for part in (slopes[:, :, j, i].real, np.degrees(slopes[:, :, j, i].imag))
        )
        found.append(
            FrequencyResponse(
                *(block.inputs[i], output, frequency, gain, angle),
                (gain * np.exp(-wide), gain * np.exp(wide)) if known.size else None,
                (angle - turned, angle + turned) if known.size else None,
                *_welch(recordings, block.inputs[i].name, output.name, step),
            )
        )
    return tuple(found)


def linear_response(block: Block, step: float, frequency: Array) -> NDArray[np.complex128]:
    """Return the response of a linear block at frequencies [Hz], shape (f, outputs, inputs).

    A sample is x+ = A x + B u, y = C x + D u, whose matrices are the kernel's answers to a unit of every
    state and input.
    """
    n, k, m = block.n_states, len(block.inputs), len(block.outputs)
    given, state, outputs = np.zeros((1, k)), np.zeros(n), np.zeros((1, m))
    run, columns = block.bind(step, state, given, outputs), []
    for unit in np.vstack([np.zeros(n + k), np.eye(n + k)]):
        state[:], given[0] = unit[:n], unit[n:]
        run()
        columns.append(np.concatenate([state, outputs[0]]))
    table = np.transpose(np.array(columns[1:]) - columns[0])
    a, b, c, d = table[:n, :n], table[:n, n:].astype(complex), table[n:, :n], table[n:, n:]
    z = np.exp(2j * np.pi * step * frequency)[:, np.newaxis, np.newaxis]
    return np.asarray(c @ np.linalg.solve(z * np.eye(n) - a, b) + d)


def _welch(
    recordings: Sequence[Recording], given: str, wanted: str, step: float
) -> tuple[Array, Array, Array]:
    """Return measured frequency, gain and angle, where coherence is high."""
    from scipy.signal import csd

    length = min(max(map(len, recordings)) // 4, MOST)
    if length < LEAST:
        return (np.zeros(0),) * 3
    kept = [r for r in recordings if len(r) >= length]
    settings: dict[str, Any] = {"fs": 1 / step, "nperseg": length, "detrend": "linear"}

    def power(one: str, other: str) -> NDArray[np.complex128]:
        spectra = [len(r) * csd(r[one], r[other], **settings)[1] for r in kept]
        return np.asarray(np.sum(spectra, axis=0))

    with np.errstate(divide="ignore", invalid="ignore"):
        response = power(given, wanted) / power(given, given)
        coherence = np.abs(response) ** 2 * (power(given, given) / power(wanted, wanted)).real
    good = np.nan_to_num(coherence) > COHERENT
    good[0] = False  # the mean
    angle = np.asarray(np.degrees(np.unwrap(np.angle(response[good]))), dtype=np.float64)
    frequency = np.asarray(np.fft.rfftfreq(length, step), dtype=np.float64)
    return frequency[good], np.abs(response[good]), angle
