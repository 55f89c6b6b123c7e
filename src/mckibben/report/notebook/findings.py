"""How what was found of a muscle, a model or a loop is shown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mckibben.control.loop import Tracked
from mckibben.diagnosis.characterization import Characterization
from mckibben.diagnosis.check import OutputCheck, Validation
from mckibben.diagnosis.review import Review
from mckibben.errors import DataError, ModelError
from mckibben.numerals import numeral
from mckibben.report import check_subjects, model_subjects, review_subjects, words
from mckibben.report.drawing import Curve, Drawing, Panel, axis_label
from mckibben.report.notebook.card import Card
from mckibben.report.notebook.face import Draw, Face

QUANTITIES = (
    *("loop width e_w", "mean branch gap", "asymmetry", "dead zone after upper reversals", "gain"),
    *("creep", "drift", "rate dependence", "closure error"),
)
"""Of a characterization, those that a card has; its table has all."""


class CharacterizationFace(Face):
    """What a muscle does."""

    def __init__(self, found: Characterization) -> None:
        self.found = found

    def card(self) -> Card:
        """Return its sentences and main numbers."""
        found = self.found
        rows = [
            (name, numeral(value, 3) if isinstance(value, float) else str(value), unit)
            for name, value, _, unit, _ in words.characterization_rows(found)
            if name in QUANTITIES and value is not None
        ]
        title = f"Characterization, {found.input} to {found.output}"
        return Card(title, words.characterization_sentences(found), rows=rows)

    def drawings(self, choices: Mapping[str, Any]) -> Mapping[str, Draw]:
        """Return the widths of its cycles."""
        return {"cycles": self.cycles}

    def cycles(self) -> Drawing:
        """Draw the loop width of every cycle over its amplitude."""
        cycles = self.found.cycles
        if not cycles:
            raise ModelError(
                "there is no whole cycle to draw",
                remedy="record one, from the lowest input and back",
            )
        x = np.array([cycle.amplitude for cycle in cycles])
        y = np.array([cycle.width for cycle in cycles])
        label = axis_label(f"amplitude of {self.found.input}", self.found.input_unit)
        return Drawing((Panel(label, "loop width [%]", (Curve(x, y, "", "series-1", "dots"),)),))


class TrackedFace(Face):
    """A loop that was closed."""

    def __init__(self, found: Tracked) -> None:
        self.found = found

    def card(self) -> Card:
        """Return its errors."""
        found = self.found
        units = found.recording.units
        rows = [
            (name, numeral(rmse), numeral(found.largest[name]), units.get(name) or "–")
            for name, rmse in found.rmse.items()
        ]
        notes = [f"{found.clipped} steps at a limit, or beyond reach"] if found.clipped else []
        notes += [
            f"{name}: {out.samples} samples beyond {numeral(out.low)} to {numeral(out.high)}"
            for name, out in found.beyond.items()
        ]
        headings = ("followed", "RMSE", "largest error", "unit")
        return Card("Tracked", (), headings, rows, notes=notes)

    def drawings(self, choices: Mapping[str, Any]) -> Mapping[str, Draw]:
        """Return reference and motion over time."""
        return {"time": self.time}

    def time(self, output: str | None = None) -> Drawing:
        """Draw what was wished for, and what came of it."""
        output = output or next(iter(self.found.rmse))
        if output not in self.found.rmse:
            raise DataError(
                "this was not followed", channel=output, remedy=f"use {', '.join(self.found.rmse)}"
            )
        return model_subjects.tracking({"achieved": self.found}, output)


class ReviewFace(Face):
    """What a robot's log says."""

    def __init__(self, found: Review) -> None:
        self.found = found

    def card(self) -> Card:
        """Return its numbers in sentences."""
        return Card("Review", words.reviewed(self.found))

    def drawings(self, choices: Mapping[str, Any]) -> Mapping[str, Draw]:
        """Return reference, motion, and what the error is made of."""
        return {"parts": self.parts}

    def parts(self, output: str | None = None) -> Drawing:
        """Draw reference and motion, and below the error with its parts."""
        by_name = {one.output: one for one in self.found.outputs}
        if output is not None and output not in by_name:
            raise DataError(
                "this was not followed", channel=output, remedy=f"use {', '.join(by_name)}"
            )
        return review_subjects.parts(by_name[output or next(iter(by_name))])


class ValidationFace(Face):
    """Whether a model is right."""

    def __init__(self, found: Validation) -> None:
        self.found = found

    def card(self) -> Card:
        """Return what the residual follows."""
        said = (words.check_verdict(self.found), *words.check_sentences(self.found))
        return Card(f"Check of {self.found.model}", said)

    def drawings(self, choices: Mapping[str, Any]) -> Mapping[str, Draw]:
        """Return the residual's autocorrelation, and its means over what it should not depend on."""
        return {"autocorrelation": self.autocorrelation, "residual": self.residual}

    def autocorrelation(self, output: str | None = None) -> Drawing:
        """Draw the autocorrelation of an output's residual."""
        return check_subjects.autocorrelation(self._output(output))

    def residual(self, output: str | None = None, against: str = "branch") -> Drawing:
        """Draw the means of an output's residual over inputs, loads, outputs or branches."""
        one = self._output(output)
        known = {each.against: each for each in one.patterns}
        if against not in known:
            raise DataError(f"{against!r} was not tested", remedy=f"use {', '.join(known)}")
        return check_subjects.pattern(one, known[against])

    def _output(self, name: str | None) -> OutputCheck:
        known = {one.output: one for one in self.found.outputs}
        if name is not None and name not in known:
            raise DataError("the model has no such output", remedy=f"use {', '.join(known)}")
        return known[name or next(iter(known))]
