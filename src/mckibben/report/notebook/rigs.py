"""How virtual rigs are shown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mckibben.numerals import numeral
from mckibben.recording import Recording, standard_unit
from mckibben.report import subjects
from mckibben.report.drawing import Drawing
from mckibben.report.notebook.card import Card
from mckibben.report.notebook.face import Draw, Face
from mckibben.rigs.rig import Rig
from mckibben.signals import decaying_triangle

PERIOD, CYCLES, SAMPLE_TIME = 10.0, 3, 0.02
"""Of the falling triangle that its loop is drawn with [s]."""


class RigFace(Face):
    """A virtual rig."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig

    def card(self) -> Card:
        """Return what drives it and what it measures."""
        rig = self.rig
        rows = []
        for name in rig.inputs:
            ends = rig.limits(name)
            rows.append(
                (name, "driven", _unit(name), f"{numeral(ends.low)} to {numeral(ends.high)}")
            )
        rows += [
            (name, "output", _unit(name), "") for name in rig.outputs if name not in rig.inputs
        ]
        said = [rig.title] if rig.title else []
        note = f"Virtual: a simulation, a sample every {numeral(rig.sample_time)} s."
        notes = (note, f"Numbers from: {rig.source}") if rig.source else (note,)
        return Card(f"Rig {rig.name}", said, ("channel", "is", "unit", "range"), rows, notes=notes)

    def drawings(self, choices: Mapping[str, Any]) -> Mapping[str, Draw]:
        """Return what a falling triangle does to it."""
        return {"loop": self.loop, "time": self.time}

    def loop(self, input: str | None = None, output: str | None = None) -> Drawing:  # noqa: A002
        """Draw an output over an input that is driven by a falling triangle, the others at rest."""
        driven, measured = self._pair(input, output)
        return subjects.loop([self._run(driven)], driven, measured)

    def time(self, input: str | None = None, output: str | None = None) -> Drawing:  # noqa: A002
        """Draw the same over time."""
        pair = self._pair(input, output)
        return subjects.time_course([self._run(pair[0])], pair)

    def _pair(self, given: str | None, wanted: str | None) -> tuple[str, str]:
        driven = given or self.rig.inputs[0]
        moved = [name for name in self.rig.outputs if not name.startswith("pressure")]
        own = driven.replace("pressure", "displacement")
        return driven, wanted or (own if own in moved else (moved or [*self.rig.outputs])[0])

    def _run(self, driven: str) -> Recording:
        rig = self.rig
        t = SAMPLE_TIME * np.arange(round(CYCLES * PERIOD / SAMPLE_TIME) + 1)
        resting = dict(zip(rig.inputs, rig.resting[0], strict=True))
        channels = {name: np.full(t.size, value) for name, value in resting.items()}
        ends = rig.limits(driven)
        channels[driven] = decaying_triangle(t, period=PERIOD, high=ends.high, low=ends.low)
        return rig.run(Recording(channels, SAMPLE_TIME, meta={"name": rig.name}))


def _unit(channel: str) -> str:
    return standard_unit(channel) or "–"
