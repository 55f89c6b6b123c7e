"""How recordings are shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mckibben.numerals import numeral
from mckibben.recording import Recording
from mckibben.report import subjects
from mckibben.report.drawing import Drawing
from mckibben.report.notebook.card import Card
from mckibben.report.notebook.face import Draw, Face

DRIVING = ("pressure", "voltage")
MOVED = ("displacement", "length", "contraction", "angle", "force")
"""What drives, and what is moved, by the first word of a channel's name."""


class RecordingFace(Face):
    """A recording."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording

    def card(self) -> Card:
        """Return its channels with their ranges, and its loop."""
        r = self.recording
        time = (
            "no time"
            if r.sample_time is None
            else f"{numeral(r.duration)} s, a sample every {numeral(r.sample_time)} s"
        )
        rows = [
            (name, r.units[name] or "–", numeral(float(y.min()), 4), numeral(float(y.max()), 4))
            for name, y in r.channels.items()
        ]
        pair = pair_of(r)
        virtual = [f"recorded on {r.meta['rig']}"] if "rig" in r.meta else []
        return Card(
            f"Recording {r.name}",
            (f"{r.n_samples} samples; {time}",),
            ("channel", "unit", "lowest", "highest"),
            rows,
            notes=(*virtual, *r.notes),
            path=None if pair is None else (r[pair[0]], r[pair[1]]),
        )

    def drawings(self, choices: Mapping[str, Any]) -> Mapping[str, Draw]:
        """Return the loop, where there is one, and the course of time."""
        loop: dict[str, Draw] = {"loop": self.loop}
        if pair_of(self.recording) is None and not {"input", "output"} <= choices.keys():
            loop = {}
        return {**loop, "time": self.time}

    def loop(self, input: str | None = None, output: str | None = None) -> Drawing:  # noqa: A002
        """Draw the output over the input, from early to late."""
        own = pair_of(self.recording) or ("", "")
        return subjects.loop([self.recording], input or own[0], output or own[1])

    def time(
        self,
        channels: Sequence[str] = (),
        input: str | None = None,  # noqa: A002
        output: str | None = None,
    ) -> Drawing:
        """Draw channels over time, one panel each; default all."""
        named = [name for name in (input, output) if name is not None]
        return subjects.time_course(
            [self.recording], channels or named or [*self.recording.channels]
        )


def pair_of(recording: Recording) -> tuple[str, str] | None:
    """Return the first channel that drives and the first that is moved, or None without either."""

    def first(quantities: Sequence[str]) -> str | None:
        found = (
            name
            for quantity in quantities
            for name in recording.channels
            if name.partition("_")[0] == quantity and np.ptp(recording[name]) > 0
        )
        return next(found, None)

    driving, moved = first(DRIVING), first(MOVED)
    return None if driving is None or moved is None else (driving, moved)
