"""Simulation of a saved model on a recording, with its errors and its band."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from mckibben.arrays import Array
from mckibben.blocks.bands import Band, Banded
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.diagnosis.bands import outside
from mckibben.errors import DataError, ModelError
from mckibben.metrics import score
from mckibben.reading import only
from mckibben.recording import Recording
from mckibben.simulation import Simulation
from mckibben.studying.recorded_inputs import beyond_known


def simulate_recording(
    model: Block,
    read: Callable[[list[str]], list[Recording]],
    *,
    initial: str | None = None,
    interval: float | None = None,
) -> Simulation:
    """Run a model over a recording.

    Parameters
    ----------
    model : Block
    read : callable
        Returns the recordings with some channels.
    initial : str, optional
        Memory before the first sample, ``first_sample`` or ``virgin``; default as of `Block.simulate`.
    interval : float, optional
        Level of the band of a calibrated model.

    Raises
    ------
    DataError, ModelError
        On a recording, or options, that do not suit the model.
    """
    banded, block = _with_band(model, interval)
    inputs = [channel.name for channel in block.inputs]
    outputs = [channel.name for channel in block.outputs]
    try:
        runs = read(list(dict.fromkeys((*inputs, *outputs))))
    except DataError:  # nothing was measured, or what lacks is said of the inputs
        runs = read(inputs)
    recording = only(runs)
    modelled = (banded or block).simulate(recording, initial=initial)
    result, metrics = recording.select(inputs), {}
    for channel in block.outputs:
        name = channel.name
        added = {f"{name}_model": modelled[name]}
        if banded is not None:
            added |= {f"{name}_{end}": modelled[f"{name}_{end}"] for end in ("lower", "upper")}
        result = result.with_channels(dict.fromkeys(added, channel.unit), **added)
        if name in recording and name not in inputs:
            measured = recording[name]
            result = result.with_channels({name: recording.units[name]}, **{name: measured})
            metrics[name] = asdict(score(measured, modelled[name]))
            if banded is not None:
                limits = added[f"{name}_lower"], added[f"{name}_upper"]
                metrics[name] |= _coverage(measured, *limits)
    beyond = () if banded is None else _beyond_calibration(banded.band, modelled)
    return Simulation(result, metrics, interval, tuple(beyond_known(block, recording)), beyond)


def _coverage(measured: Array, lower: Array, upper: Array) -> dict[str, float]:
    """Return the share of measured samples in a band, and its mean width."""
    inside = (lower <= measured) & (measured <= upper)
    return {"coverage": float(inside.mean()), "band_width": float((upper - lower).mean())}


def _beyond_calibration(
    band: Band, modelled: Recording
) -> tuple[tuple[Channel, float, Array, tuple[float, float]], ...]:
    """Return the channels beyond the range of a calibration: share of samples, samples and range."""
    channels = {channel.name: channel for channel in (*band.driving, *band.given)}
    ranges = dict(zip(channels, zip(*band.ends, strict=True), strict=True))
    return tuple(
        (channels[name], share, modelled[name], ranges[name])
        for name, share in outside(band, modelled.matrix(channels)).items()
    )


def _with_band(block: Block, interval: float | None) -> tuple[Any, Any]:
    """Return the model with its band at the requested level, if any, and the model."""
    if interval is None:
        return None, block.forward if isinstance(block, Banded) else block
    if not isinstance(block, Banded):
        problem = "this model has no band"
        remedy = "calibrate it on recordings that it was not fitted to, with `calibrate()`"
        raise ModelError(problem, parameter="interval", remedy=remedy)
    return block.at(interval), block.forward
