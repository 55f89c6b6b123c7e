"""Steady-state responses of continuous models to periodic inputs."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval

from mckibben.blocks.base import Block
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.errors import ModelError
from mckibben.recording import Recording
from mckibben.signals.periodic import band_limited

Substeps = Annotated[int, Interval(ge=1, le=10_000)]
Hold = Literal["first", "zero"]

PERIODS, REPEATS = 100, 1e-9
"""Maximum number of periods simulated, and the relative difference at which two are equal."""

BETWEEN = 2
"""Interpolated samples per substep of a band-limited input."""


def steady_state(block: Any, recording: Recording) -> Recording:
    """Return the steady-state response to a periodic recording.

    The input is taken to be band-limited between samples, as a multisine measured over whole
    periods is; neither holds of `simulate`, which starts somewhere and joins samples as `hold` says.

    Parameters
    ----------
    block : Block
        Of one input and one output, with ``substeps`` and ``hold``, whose last state is the last input.
    recording : Recording
        A whole number of periods of the input, with time.

    Returns
    -------
    Recording
        Of the input, and the modelled output.

    Raises
    ------
    ModelError
        Where no response comes to repeat itself.
    """
    given = block._inputs_from(recording)
    step, ratio = needs_sample_time(block.kind, recording.sample_time), BETWEEN * block.substeps
    fine = np.ascontiguousarray(np.roll(band_limited(given[:, 0], ratio), -1)[:, np.newaxis])
    finer: Block = replace(block, substeps=1, hold="first")
    state, found = block.initial_state(given[0], "virgin", step), np.empty_like(fine)
    run = finer.bind(step / ratio, state, fine, found)
    state[-1] = given[0, 0]
    before = np.full(len(given), np.inf)
    for _ in range(PERIODS):
        run()
        now = np.roll(found[ratio - 1 :: ratio, 0], 1)
        change = np.abs(now - before).max()
        if not np.isfinite(now).all() or change <= REPEATS * np.ptp(now):
            break
        before = now.copy()
    if not change <= REPEATS * np.ptp(now):
        raise ModelError(
            f"the response of {block.kind!r} to {recording.name} is not periodic "
            f"within {PERIODS} periods",
            remedy="use simulate, which starts from rest",
        )
    modelled: Recording = block._modelled(recording, now[:, np.newaxis])
    return modelled
