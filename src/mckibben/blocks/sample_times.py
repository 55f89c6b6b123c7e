"""Sample times that blocks need, and what follows from them."""

from __future__ import annotations

from math import exp, isfinite

from mckibben.errors import ModelError, require


def refuse_time(sample_time: float | None) -> None:
    """Raise an error for an invalid sample time."""
    possible = sample_time is None or (isfinite(sample_time) and sample_time > 0)
    require(possible, "sample_time", sample_time, "a positive time [s]")


def needs_sample_time(kind: str, sample_time: float | None) -> float:
    """Return the sample time; raise an error if a rate-dependent block has none."""
    if sample_time is None or not sample_time > 0:
        raise ModelError(
            f"{kind!r} depends on rate and needs it, but the data have no time",
            parameter="sample_time",
            remedy="read the recording with a column of times or `rate`, or give `sample_time`",
        )
    return sample_time


def rate_filter(time_constant: float, step: float) -> tuple[float, float]:
    """Return the decay per step of a first-order rate filter, and its gain on the change."""
    smoothing = exp(-step / time_constant) if time_constant > 0 else 0.0
    return smoothing, (1 - smoothing) / step


def own_sample_time(kind: str, own: float, sample_time: float | None) -> float:
    """Return the sample time of a discrete block after checking that the data have the same."""
    step = needs_sample_time(kind, sample_time)
    if abs(step - own) > 1e-3 * own:
        raise ModelError(
            f"{kind!r} holds for {own:g} s, but the data have {step:g} s",
            parameter="sample_time",
            remedy=f"resample them to {own:g} s, or identify the model again",
        )
    return own
