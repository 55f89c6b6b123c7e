"""Preview of references, to compensate dead time.

Commands act after the dead time of the air. With a planned motion, the compensator can be given the
reference that much ahead: offline, `previewed` shifts the reference; sample by sample, `Stream.step`
gets the reference of `preview_time` later; `mckibben.control.track` does so by default.
"""

from __future__ import annotations

import numpy as np

from mckibben.blocks.base import Block
from mckibben.errors import require
from mckibben.recording import Recording, sample_time_of

MOST_PREVIEW = 1e4
"""Longest preview [s]."""


def preview_time(compensator: Block) -> float:
    """Return the dead time of the inverted model [s], which is the preview needed.

    With feedback, that of the compensator; 0 if the inverted model is unknown.

    Examples
    --------
    >>> from mckibben.blocks.dynamics.air import Air
    >>> preview_time(Air.example().inverse())
    0.02
    """
    model = compensator.forward_model
    return 0.0 if model is None else model.dead_time


def samples_ahead(preview: float, sample_time: float) -> int:
    """Return a preview in whole samples; raise an error if it is out of range."""
    require(0 <= preview <= MOST_PREVIEW, "preview", preview, f"0 to {MOST_PREVIEW:g} s")
    return round(preview / sample_time)


def previewed(reference: Recording, preview: float) -> Recording:
    """Return a reference shifted by the preview.

    Parameters
    ----------
    reference : Recording
        With time.
    preview : float
        How much later [s], not negative, in whole samples; see `preview_time`. The end is held.

    Raises
    ------
    DataError
        Where the reference has no time.
    ModelError
        Where the preview is out of range.
    """
    ahead = samples_ahead(preview, sample_time_of(reference, "be a reference"))
    n = len(reference)
    places = np.minimum(np.arange(n) + ahead, n - 1)
    return reference.with_channels(**{name: reference[name][places] for name in reference.channels})
