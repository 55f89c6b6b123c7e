"""Muscles that together move fewer coordinates: a tip in a plane by three, a joint by two.

Each shortens by a linear function of the coordinates, as round a backbone that bends: along the
direction in which its pressure moves them. By what moves no coordinate they do not shorten.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.fields import Channel, rows
from mckibben.errors import DataError
from mckibben.estimators.core.data import TrainingData

LEAST_MOVED = 0.02
"""Share of the most that any pressure moves below which one moves nothing, of a coordinate too."""


def directions_of(data: TrainingData) -> Array:
    """Return the unit vectors along which pressures move the coordinates, shape (muscles, coordinates).

    Raises
    ------
    DataError
        If a pressure moves nothing, or the coordinates only move together.
    """
    spans = data.highest - data.lowest
    driven, scheduled = data.stacked("driven"), data.stacked("scheduled")
    columns = np.column_stack([driven, scheduled, np.ones(len(driven))])
    found = np.linalg.lstsq(columns, data.stacked("outputs"), rcond=None)[0]
    moved = found[: len(spans)] * spans[:, np.newaxis]
    sizes = np.sqrt((moved**2).sum(axis=1))
    for k in np.flatnonzero(~(sizes > LEAST_MOVED * sizes.max())).tolist():
        raise DataError(
            "it moves nothing",
            channel=data.inputs[k].name,
            remedy="leave it out, or record runs in which it moves the muscles",
        )
    ways: Array = moved / sizes[:, np.newaxis]
    if np.linalg.svd(ways, compute_uv=False)[-1] < LEAST_MOVED:
        raise DataError(
            "all outputs move together, whatever the pressures",
            remedy="leave out all but one, or record runs in which pressures move apart",
        )
    return ways


def shortened(data: TrainingData, ways: Array) -> TrainingData:
    """Return data whose outputs are what every muscle shortens by."""
    unit = data.outputs[0].unit
    channels = tuple(Channel(f"shortening_{k}", unit) for k in range(1, 1 + len(ways)))
    runs = tuple(replace(run, outputs=run.outputs @ ways.T) for run in data.runs)
    return replace(data, runs=runs, outputs=channels)


def together(data: TrainingData, ways: Array, channels: tuple[Channel, ...]) -> Coupling:
    """Return what makes coordinates of shortenings."""
    return Coupling(rows(np.linalg.pinv(ways).T), data.outputs, channels)


def in_words(data: TrainingData, ways: Array) -> str:
    """Return the directions in words."""
    names = ", ".join(channel.name for channel in data.outputs)
    each = "; ".join(
        f"{channel.name} along {np.array2string(way, precision=2)}"
        for channel, way in zip(data.inputs, ways, strict=True)
    )
    return f"{len(ways)} muscles move {names}, each along its direction: {each}"
