"""Recordings checked, and brought to the form that identification sees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mckibben.blocks.fields import Channel
from mckibben.errors import DataError
from mckibben.estimators.core.data import Mask, Run, TrainingData
from mckibben.recording import Recording, listed

FEWEST_SAMPLES = 10
"""Fewer samples than this identify nothing."""


def training_data(
    recordings: Recording | Sequence[Recording],
    inputs: str | Sequence[str],
    outputs: str | Sequence[str],
    rows: Sequence[Mask] | None = None,
    scheduling: Sequence[str] = (),
    *,
    one_rate: bool = True,
    spans: tuple[float, ...] | None = None,
) -> TrainingData:
    """Check recordings and return them as training data.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        What to identify from.
    inputs, outputs : str or sequence of str
        Channels.
    rows : sequence of bool arrays, optional
        For every recording the samples that count; default all. Inputs are always used whole, since
        memory depends on them, while outputs elsewhere are never looked at.
    scheduling : sequence of str
        Further channels that the model is given.
    one_rate : bool
        Whether all must have the same sample time.
    spans : tuple of float, optional
        Ranges of the outputs, where these are known otherwise; then outputs may be constant.

    Raises
    ------
    DataError
        On no recordings, absent channels, too few samples, a constant input or output, or sample
        times that differ.
    """
    every = listed(recordings)
    driven, given = (
        (names,) if isinstance(names, str) else tuple(names) for names in (inputs, outputs)
    )
    if not every:
        raise DataError("there are no recordings to fit", remedy="give at least one")
    if same := set(driven) & set(given):
        raise DataError(
            "input and output are the same channel",
            channel=min(same),
            remedy="choose two channels with --input and --output",
        )
    masks = [np.ones(len(r), dtype=bool) for r in every] if rows is None else list(rows)
    if len(masks) != len(every) or any(
        np.shape(mask) != (len(r),) for mask, r in zip(masks, every, strict=False)
    ):
        raise DataError(
            "rows do not match the recordings", remedy="give one mask a recording, one value a row"
        )
    first = every[0]
    for recording in every:
        _check(recording, first, (*driven, *given, *scheduling), one_rate)
    runs = tuple(
        Run(
            r.name,
            r.matrix(driven),
            r.matrix(given),
            r.matrix(scheduling) if scheduling else np.empty((len(r), 0)),
            np.asarray(mask, dtype=bool),
            r.sample_time,
            recording=place,
        )
        for place, (r, mask) in enumerate(zip(every, masks, strict=True))
    )

    def channels(names: Sequence[str]) -> tuple[Channel, ...]:
        return tuple(Channel(name, first.units[name]) for name in names)

    data = TrainingData(runs, channels(driven), channels(given), channels(scheduling), spans=spans)
    counting = np.concatenate([run.outputs[run.counts] for run in runs])
    if len(counting) < FEWEST_SAMPLES:
        raise DataError(
            f"{len(counting)} samples are too few to identify a model",
            file=first.source,
            remedy=f"give at least {FEWEST_SAMPLES}",
        )
    moving = () if spans else given
    for names, values in ((driven, data.stacked("driven")), (moving, counting[:, : len(moving)])):
        for name, column in zip(names, values.T, strict=True):
            if np.ptp(column) == 0:
                raise DataError(
                    f"the channel is constant at {column[0]:g}",
                    file=first.source,
                    channel=name,
                    remedy="record a run in which it moves, or name another channel",
                )
    return data


def _check(recording: Recording, first: Recording, names: Sequence[str], one_rate: bool) -> None:
    for name in names:
        if recording[name].size and recording.units[name] != first.units[name]:
            raise DataError(
                f"the unit is {recording.units[name]!r} here and {first.units[name]!r} in "
                f"{first.source or first.name}",
                file=recording.source,
                channel=name,
                remedy="convert one of the recordings, or name its unit with --unit",
            )
        absolute = [_is_absolute(one, name) for one in (recording, first)]
        if absolute[0] != absolute[1]:
            raise DataError(
                "it is absolute in one recording, and gauge in another",
                file=(recording if absolute[0] else first).source,
                channel=name,
                remedy="subtract the atmosphere, as in "
                f"--calibrate {name}=COLUMN:GAIN:-1.01325:bar, with a GAIN of 1 for bar, 0.01 for kPa",
            )
    ours, theirs = recording.sample_time, first.sample_time
    if (ours is None) != (theirs is None):
        raise DataError(
            "some recordings have time and others have none",
            file=recording.source,
            remedy="give --rate for those without, or fit them apart",
        )
    if one_rate and ours is not None and theirs is not None and abs(ours - theirs) > 1e-3 * theirs:
        raise DataError(
            f"the sample time is {ours:g} s here and {theirs:g} s in {first.source or first.name}",
            file=recording.source,
            remedy=f"say --resample {max(ours, theirs):.3g}, or use mckibben.signals.resample",
        )


def _is_absolute(recording: Recording, channel: str) -> bool:
    references = recording.meta.get("pressure_reference")
    return isinstance(references, Mapping) and references.get(channel) == "absolute"
