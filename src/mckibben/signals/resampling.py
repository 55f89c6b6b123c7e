"""Cutting a recording in time, and putting it on another grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.recording import Recording, sample_time_of
from mckibben.signals.checking import require_positive

STOP_BAND = 60.0
"""Attenuation of what could alias [dB]."""

PASS_SHARE = 0.8
"""Share of the new Nyquist frequency up to which signals are unchanged."""


def cut(recording: Recording, start: float, stop: float = np.inf) -> Recording:
    """Return the samples within a time; see `Recording.between`."""
    return recording.between(start, stop)


def resample(recording: Recording, sample_time: float) -> Recording:
    """Return a recording on another sample time, any ratio, without aliasing and without delay.

    Onto a coarser grid, a zero-phase FIR low-pass comes first: signals pass up to 80 % of the new
    Nyquist frequency, and what would alias is attenuated by 60 dB; then a cubic spline is read at
    the new instants. Onto a finer grid, the samples are joined by straight lines, which adds no
    overshoot and so no reversals. Beyond its ends the signal is continued by its mirror image in
    the end point.

    Parameters
    ----------
    recording : Recording
        With time.
    sample_time : float
        Wanted time between samples [s], positive. The first instant stays; the last is the last
        that fits.

    Raises
    ------
    DataError
        If the recording has no time, the sample time is not positive, or fewer than two samples
        would be left.
    """
    step = sample_time_of(recording, "be resampled")
    require_positive("sample_time", sample_time)
    ratio = sample_time / step
    if ratio == 1:
        return recording
    n = int(np.floor((len(recording) - 1) / ratio + 1e-9)) + 1
    if n < 2:
        raise DataError(
            f"{recording.duration:g} s at {sample_time:g} s a sample leave one sample",
            file=recording.source,
            remedy="ask for a shorter sample time",
        )
    places = np.minimum(np.arange(n) * ratio, len(recording) - 1)
    read = _read_smoothed if ratio > 1 else _read_straight
    return replace(
        recording,
        channels={name: read(recording[name], places, ratio) for name in recording.channels},
        sample_time=sample_time,
    )


def _read_straight(x: Array, places: Array, ratio: float) -> Array:
    del ratio
    return np.asarray(np.interp(places, np.arange(x.size), x))


def _read_smoothed(x: Array, places: Array, ratio: float) -> Array:
    from scipy.interpolate import make_interp_spline
    from scipy.signal import firwin, kaiserord, oaconvolve

    if np.ptp(x) == 0:  # what is held stays held, to the bit
        return np.full(places.size, x[0])
    n_taps, beta = kaiserord(STOP_BAND, (1 - PASS_SHARE) / ratio)
    half = n_taps // 2
    low_pass = firwin(2 * half + 1, 0.5 * (1 + PASS_SHARE) / ratio, window=("kaiser", beta))
    beyond = np.pad(x, half, mode="reflect", reflect_type="odd")
    smooth = oaconvolve(beyond, low_pass, mode="valid")
    degree = min(3, x.size - 1)
    return np.asarray(make_interp_spline(np.arange(x.size), smooth, k=degree)(places))
