"""A controller tried on a plant, beside no compensation at all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mckibben.blocks.base import Block
from mckibben.control.loop import Tracked, track
from mckibben.control.roles import Plant, asked
from mckibben.control.suiting import doubts
from mckibben.control.uncompensated import slow_rise, uncompensated
from mckibben.errors import MckibbenError
from mckibben.recording import Recording

UNCOMPENSATED = "no compensation"
"""What that is called in tables and pictures."""


@dataclass(frozen=True)
class Before:
    """What is to be known before a compensator is believed.

    Parameters
    ----------
    tracked : Tracked or None
        What no compensation makes of the reference: pressures read off the plant's own slow rise. None
        where that cannot be.
    notes : tuple of str
        Whether plant and compensator are of one muscle, and why nothing was tracked.
    """

    tracked: Tracked | None
    notes: tuple[str, ...]

    def beside(self, recording: Recording) -> Recording:
        """Return a loop's recording with what no compensation gave, as ``uncompensated_...``."""
        if self.tracked is None:
            return recording
        units, without = recording.units, self.tracked.recording
        return recording.with_channels(
            {f"uncompensated_{name}": units[name] for name in self.tracked.rmse},
            **{f"uncompensated_{name}": without[name] for name in self.tracked.rmse},
        )


def before(compensator: Block, plant: Plant, reference: Recording, **settings: Any) -> Before:
    """Let a plant follow a reference without compensation, and look whether a compensator is of it.

    Parameters
    ----------
    compensator : Block
        What is to be tried.
    plant : Plant
    reference : Recording
    **settings
        As of `track`; a preview is passed over, for no dead time is undone.
    """
    settings.pop("preview", None)
    reference = asked(plant, reference, compensator)
    few = {name: settings[name] for name in ("pressure_loop", "seed") if name in settings}
    notes: list[str] = []
    try:
        rise = slow_rise(plant, reference, **few)
        notes += doubts(compensator, plant, rise)
        controller = uncompensated(plant, reference, rise, **few)
        return Before(track(controller, plant, reference, **settings), tuple(notes))
    except MckibbenError as error:
        return Before(None, (*notes, f"there is no run without compensation: {error}"))
