"""What blocks refuse in the same words: states of the wrong length, absent time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.core.fields import Initial
from mckibben.errors import ModelError

if TYPE_CHECKING:
    from mckibben.blocks.core.block import Block

VIRGIN = {"first_sample": False, "fitted": False, "virgin": True}
"""Named starts, and whether a start kernel takes them as if nothing had happened before.

"fitted" is "first_sample" where no outputs are known, see `mckibben.blocks.dynamic.linear_start`."""


def explicit_state(block: Block, initial: Initial) -> Array:
    """Return an explicit initial state after checking its length."""
    if isinstance(initial, str):
        raise ModelError(
            f"{block.kind!r} knows no start {initial!r}. Remedy: give 'first_sample', 'virgin', or "
            f"{block.n_states} numbers."
        )
    state = np.array(initial, dtype=np.float64)
    if state.shape != (block.n_states,) or not np.isfinite(state).all():
        raise ModelError(
            f"{block.kind!r} has {block.n_states} states, the initial state given has shape "
            f"{state.shape}. Remedy: give {block.n_states} finite numbers, or 'first_sample'."
        )
    return state


def needs_sample_time(kind: str, sample_time: float | None) -> float:
    """Return the sample time, or say that a rate-dependent block cannot do without."""
    if sample_time is None or not sample_time > 0:
        raise ModelError(
            f"{kind!r} depends on rate and needs a sample time, but the data have no time. "
            "Remedy: read the recording with a time column or --rate, or give sample_time."
        )
    return sample_time


def own_sample_time(kind: str, own: float, sample_time: float | None) -> float:
    """Return the sample time of a discrete block, after checking that the data have the same."""
    step = needs_sample_time(kind, sample_time)
    if abs(step - own) > 1e-3 * own:
        raise ModelError(
            f"{kind!r} holds for a sample time of {own:g} s, but the data have {step:g} s. Remedy: "
            f"resample them to {own:g} s, or identify the model again."
        )
    return own
