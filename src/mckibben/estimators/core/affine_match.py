"""Scale and offset behind a model: by ranges, as paper B matches its models, or by least squares."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.memoryless.affine import Affine
from mckibben.errors import DataError
from mckibben.recording import Recording, listed


def affine_match(
    model: Block,
    recordings: Recording | Sequence[Recording],
    rule: Literal["range", "least-squares"] = "least-squares",
    *,
    output: str = "displacement",
) -> Series:
    """Return a model with a gain and an offset behind it that match it to recordings.

    Source of the rule by range: "Analysis and modeling of a pneumatic artificial muscle system",
    Eqs. (1) to (3): a = range(z) / range(x), b such that the first samples agree.

    Parameters
    ----------
    model : Block
        One output, run free from its inputs alone, as it will be behind the match.
    recordings : Recording or sequence of Recording
        With the model's inputs and the measured output; the range rule looks at the first.
    rule : {"range", "least-squares"}
        How gain and offset are found.
    output : str
        Measured channel.

    Raises
    ------
    DataError
        If the model's output does not move.
    """
    every = listed(recordings)
    name = model.outputs[0].name
    inputs = [channel.name for channel in model.inputs]
    modelled = [model.simulate(recording.select(inputs))[name] for recording in every]
    x = modelled[0] if rule == "range" else np.concatenate(modelled)
    if np.ptp(x) == 0:
        raise DataError(
            "the model's output does not move on it, so there is nothing to match",
            file=every[0].source,
            remedy="give another recording, or another model",
        )
    if rule == "range":
        z = every[0][output]
        gain = float(np.ptp(z) / np.ptp(x))
        offset = float(z[0] - gain * x[0])
    else:
        z = np.concatenate([recording[output] for recording in every])
        gain, offset = (float(value) for value in np.polyfit(x, z, 1))
    channel = model.outputs[0]
    return Series((model, Affine(gain, offset, channel, channel)))
