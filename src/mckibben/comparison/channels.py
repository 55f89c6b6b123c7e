"""Which channels of recordings a comparison is about."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mckibben.comparison.recognising import FORCE, any_moves, force_over, lacks_displacement
from mckibben.errors import DataError
from mckibben.estimators.coupled.base import driving, loads_among, moved, schedules
from mckibben.recording import Recording

Names = str | Sequence[str] | None
"""One channel, several, or None for what the recordings' names say."""

STEADY = 0.05
"""What schedules is a level of its run where it varies in it by no more than this share of its range."""


@dataclass(frozen=True)
class Channels:
    """What drives, what is to be modelled, and what schedules.

    Parameters
    ----------
    inputs, outputs : tuple of str
        Of every model.
    scheduling : tuple of str or None
        Of models that can be told more; None for what they find by name.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    scheduling: tuple[str, ...] | None = None

    @property
    def single(self) -> bool:
        """Whether this is one muscle whose load does not matter."""
        return len(self.inputs) == len(self.outputs) == 1 and self.scheduling is None

    def scheduled(self, recordings: Sequence[Recording]) -> tuple[str, ...]:
        """Return the channels that schedule models of recordings."""
        if self.scheduling is not None:
            return self.scheduling
        return () if self.single else schedules(recordings, (*self.inputs, *self.outputs))

    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Return every output with the input that is its own: that of its number, else of its place."""

        def own(place: int, output: str) -> str:
            number = re.search(r"\d*$", output)
            alike = [
                name for name in self.inputs if number and number[0] and name.endswith(number[0])
            ]
            return alike[0] if len(alike) == 1 else self.inputs[min(place, len(self.inputs) - 1)]

        return tuple((own(place, output), output) for place, output in enumerate(self.outputs))


def channels_of(
    recordings: Sequence[Recording],
    inputs: Names,
    outputs: Names,
    load: str | None,
) -> Channels:
    """Return the channels that a comparison is about; a force beside other inputs is a load, too.

    Force by length is told the pressure by the models of it, so that this is no input.

    Raises
    ------
    DataError
        If a recording lacks the load, or a channel is named twice.
    """
    over = None if load else force_over(recordings, _several(inputs), _several(outputs))
    if over is not None:
        return Channels((over,), (FORCE,))
    usual = FORCE if lacks_displacement(recordings) else "displacement"
    given = _named(recordings, inputs, _by_name(recordings, driving, "pressure"))
    wanted = _named(recordings, outputs, _by_name(recordings, moved, usual))
    found = loads_told(recordings, Channels(given, wanted, (load,) if load else None))
    told = found.scheduling or ()
    named = (*found.inputs, *found.outputs, *told)
    if twice := [name for name in named if named.count(name) > 1]:
        raise DataError(
            "the channel is named twice among inputs, outputs and load",
            channel=twice[0],
            remedy="a model is not told what it is to give: name each channel once",
        )
    for name in told:
        for recording in recordings:
            if name not in recording:
                raise DataError(
                    "there is no such channel to tell the load",
                    file=recording.source,
                    channel=name,
                    remedy="name it with --column, or leave --load out",
                )
    return found


def loads_told(recordings: Sequence[Recording], channels: Channels) -> Channels:
    """Return channels whose forces beside other inputs schedule: nobody commands what hangs there."""
    loads = loads_among(recordings, channels.inputs)
    if channels.scheduling is not None or not loads:
        return channels
    driven = tuple(name for name in channels.inputs if name not in loads)
    return replace(channels, inputs=driven, scheduling=loads)


def dead_loads_told(recordings: Sequence[Recording], channels: Channels) -> Channels:
    """Return channels of one muscle with what is held at a level of its own in every recording.

    Such a load moves the output from recording to recording, and no input tells a model why.
    """
    if not (channels.single and recordings):
        return channels
    held = [
        name
        for name in schedules(recordings, (*channels.inputs, *channels.outputs))
        if all(name in one for one in recordings) and held_at_levels(recordings, name)
    ]
    return replace(channels, scheduling=tuple(held)) if held else channels


def held_at_levels(recordings: Sequence[Recording], name: str) -> bool:
    """Tell whether a channel differs from recording to recording, and hardly within one."""
    span = float(np.ptp(np.concatenate([one[name] for one in recordings])))
    return span > 0 and all(float(np.ptp(one[name])) <= STEADY * span for one in recordings)


def where_held(recordings: Sequence[Recording], found: Channels) -> Channels:
    """Return force over what is held, where nothing that is found moves while a force does."""
    held = len(found.outputs) == 1 and not any_moves(recordings, found.outputs)
    forced = all(FORCE in one for one in recordings) and any_moves(recordings, (FORCE,))
    return Channels(found.outputs, (FORCE,)) if held and forced else found


def _by_name(
    recordings: Sequence[Recording],
    named: Callable[[Recording], tuple[str, ...]],
    usual: str,
) -> tuple[str, ...]:
    """Return what recordings call several muscles' channels, or one's: the usual before others."""
    found = tuple(dict.fromkeys(name for recording in recordings for name in named(recording)))
    several = tuple(name for name in found if name.rpartition("_")[2].isdigit())
    if len(several) > 1 or not found:
        return several or (usual,)
    return (usual,) if any(usual in recording for recording in recordings) else several or found


def _several(names: Names) -> Sequence[str] | None:
    return (names,) if isinstance(names, str) else names


def _named(
    recordings: Sequence[Recording], given: Names, by_name: tuple[str, ...]
) -> tuple[str, ...]:
    if given is None:
        return by_name
    if isinstance(given, str):  # of several muscles, all that are called so
        if any(given in recording for recording in recordings):
            return (given,)
        return tuple(name for name in by_name if name.startswith(f"{given}_")) or (given,)
    return tuple(given)
