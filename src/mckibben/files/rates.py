"""Scalars beside the samples of a file that tell how fast they were taken, such as ``fs = 50``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mckibben.errors import DataError
from mckibben.files.headers import snake_case
from mckibben.files.notices import listed, warn

_RATES = ("fs", "Fs", "sample_rate", "sampling_frequency")
"""Names of samples per second [Hz]."""

_STEPS = ("Ts", "dt", "sample_time")
"""Names of seconds per sample."""


def is_one(name: str) -> bool:
    """Tell whether a scalar of this name is a rate or a sample time.

    >>> is_one("Fs"), is_one("SampleTime"), is_one("FS")
    (True, True, False)
    """
    return _plain(name) in _RATES + _STEPS


def sample_time(scalars: Mapping[str, float], path: Path) -> float | None:
    """Return the sample time [s] that scalars tell, by their places in the file, with a notice.

    Raises
    ------
    DataError
        If one is no positive finite number, or two contradict each other.
    """
    if not scalars:
        return None
    said = listed([f"{place} = {value:g}" for place, value in scalars.items()])
    with np.errstate(all="ignore"):
        steps = [
            float(value if _plain(place) in _STEPS else np.float64(1.0) / value)
            for place, value in scalars.items()
        ]
    possible = all(1e-12 <= step < 1e11 for step in steps)
    if not possible or max(steps) - min(steps) > 1e-3 * min(steps):
        problem = "contradict each other" if possible else "cannot be a rate or a sample time"
        raise DataError(
            f"{said}: {'these' if len(steps) > 1 else 'this'} {problem}",
            file=path,
            channel="time",
            remedy="say the samples per second with --rate, or correct them in the file",
        )
    warn(
        path,
        f"there are no times, so {said} is taken for {steps[0]:g} s between samples; "
        "say --rate where that is wrong",
    )
    return steps[0]


def _plain(place: str) -> str:
    name = place.replace("/", ".").rpartition(".")[2]
    return name if len(name) == 2 else snake_case(name)
