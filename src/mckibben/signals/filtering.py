"""Removal of noise and drift from a recording, without delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mckibben.errors import DataError
from mckibben.recording import Recording, sample_time_of

ORDER = 4
"""Of the low-pass, which is run forth and back."""


def low_pass(
    recording: Recording, cutoff: float, channels: Sequence[str] | None = None
) -> Recording:
    """Return a recording with high frequencies damped, without delay.

    A Butterworth filter runs forth and back.

    Parameters
    ----------
    recording : Recording
        With time.
    cutoff : float
        Frequency that is damped to one half [Hz], positive and below half the sampling rate.
    channels : sequence of str, optional
        Default all. Input and output are best filtered alike, or their loop changes its shape.

    Raises
    ------
    DataError
        If the recording has no time or no such channel, or the frequency cannot be.
    """
    from scipy.signal import butter, sosfiltfilt

    highest = 0.5 / sample_time_of(recording, "be filtered by frequency")
    if not 0 < cutoff < highest:
        raise DataError(
            f"a cutoff of {cutoff:g} Hz is impossible",
            file=recording.source,
            remedy=f"give one between 0 and {highest:g} Hz, half the sampling rate",
        )
    sections = butter(ORDER, cutoff / highest, output="sos")
    beyond = min(3 * (2 * ORDER + 1), len(recording) - 1)
    smooth = {
        name: sosfiltfilt(sections, recording[name], padlen=beyond)
        for name in _chosen(recording, channels)
        if np.ptp(recording[name])  # what is held stays held, to the bit
    }
    return replace(recording, channels={**recording.channels, **smooth})


def detrend(recording: Recording, channels: Sequence[str] | None = None) -> Recording:
    """Return a recording without the linear trend of its channels; their means are unchanged.

    Parameters
    ----------
    recording : Recording
    channels : sequence of str, optional
        Default all.

    Raises
    ------
    DataError
        If there is no such channel.
    """
    grid = np.linspace(-1.0, 1.0, len(recording))
    level = {
        name: recording[name] - grid * (grid @ recording[name]) / (grid @ grid)
        for name in _chosen(recording, channels)
    }
    return replace(recording, channels={**recording.channels, **level})


def _chosen(recording: Recording, channels: Sequence[str] | None) -> Sequence[str]:
    return list(recording.channels) if channels is None else channels
