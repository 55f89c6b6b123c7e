"""How well the models predict: with all pressures random, then along the paper's patterns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mckibben.arrays import Array
from mckibben.metrics import err
from mckibben.papers.free_runs import FreeRuns
from mckibben.papers.reproduction import Cell, Figure, Points, Table, rms, thinned
from mckibben.papers.sdchm import printed
from mckibben.papers.sdchm.models import (
    BALANCE,
    DAMPED,
    INVERTED,
    LINEAR,
    OURS,
    PREDICTING,
    PUBLISHED,
    RAW,
    Models,
    measured,
)
from mckibben.papers.sdchm.protocol import PATTERNS, PREDICTION
from mckibben.papers.sdchm.recordings import EXTENSOR, OUTPUTS, Recordings
from mckibben.recording import Recording

TABLE_4 = 0.1
"""Pressure of the extensor in all groups of Table 4 [bar]."""

GROUPS = (PUBLISHED, RAW, OURS, BALANCE)
"""Models whose groups are listed."""


@dataclass(frozen=True)
class Predictions:
    """Models and what they are compared with."""

    models: Models
    runs: Recordings

    @cached_property
    def found(self) -> FreeRuns:
        """What the models give over the recordings."""
        return FreeRuns(self.models.blocks)

    def errors(self, name: str, recordings: list[Recording]) -> Array:
        """Return modelled less measured displacements over all recordings, shape (n, 3) [mm]."""
        parts = [self.found(name, r).matrix(OUTPUTS) - r.matrix(OUTPUTS) for r in recordings]
        return np.concatenate(parts)

    @property
    def names(self) -> tuple[str, ...]:
        """Models in the order of the tables."""
        rest = [name for name in self.models.blocks if name.endswith("joint runs too")]
        return (*PREDICTING, *rest)

    def joint(self, role: str, extensor: str) -> list[Recording]:
        """Return joint random runs."""
        return self.runs.select(role, stage="joint", extensor=extensor)  # type: ignore[arg-type]

    def off(self, name: str, recordings: list[Recording]) -> float:
        """Return a model's RMSE over all outputs [mm]."""
        return rms(self.errors(name, recordings))

    @property
    def headline(self) -> str:
        """The invertible model of ours that is closest on the joint validation runs."""
        held = self.runs.select("validation", stage="joint")
        return min(INVERTED, key=lambda name: self.off(name, held))

    @property
    def only_along_patterns(self) -> list[str]:
        """Models that a linear function beats on the joint test runs."""
        runs = self.joint("test", "constant")
        limit = self.off(LINEAR, runs)
        return [name for name in self.names if self.off(name, runs) > limit]

    def tables(self) -> Iterator[Table]:
        """Return all tables, joint random runs first."""
        yield self._joint_table("constant", "")
        yield self._joint_table(
            "moving",
            "Every run counts displacement from its own first sample, so no run with a constant "
            "extensor says how far the extensor alone moves the arm: that is in these errors.",
        )
        yield self._test_table()
        yield from self._groups(TABLE_4)
        for p0 in PREDICTION[1:]:
            if self._prediction(p0):
                yield self._figure_11(p0)

    def _joint_table(self, extensor: str, more: str) -> Table:
        test = self.joint("test", extensor)
        validation = self.joint("validation", extensor)
        spans = np.ptp(measured(test), axis=0)
        rows: list[tuple[Cell, ...]] = []
        for name in self.names:
            off = self.errors(name, test)
            each = np.sqrt(np.mean(off**2, axis=0))
            rows.append(
                (
                    name,
                    *each.tolist(),
                    float(100 * np.max(each / spans)),
                    float(np.abs(off).max()),
                    self.off(name, validation) if validation else None,
                )
            )
        note = (
            f"Test runs: {len(test)}, which no choice has seen; displacements cover "
            f"{', '.join(f'{span:.0f}' for span in spans)} mm. Trained on the paper's patterns alone, "
            f"unless the name says more. {more}"
        )
        return Table(
            f"All pressures random at once, extensor {extensor}: errors beside the training patterns",
            (
                "model",
                *(f"RMSE {k} [mm]" for k in (1, 2, 3)),
                "worst RMSE of range [%]",
                "largest error [mm]",
                "validation runs, RMSE [mm]",
            ),
            tuple(rows),
            note.strip(),
        )

    def _test_table(self) -> Table:
        test = self.runs.select("test", stage="network")
        y = measured(test)
        mean = y.mean(axis=0)
        levels = sorted({round(float(recording[EXTENSOR].mean()), 1) for recording in test})
        rows: list[tuple[Cell, ...]] = []
        for name in self.names:
            off = self.errors(name, test)
            each = np.sqrt(np.mean(off**2, axis=0)).tolist()
            rows.append((name, *each, err((y - mean).ravel(), (y - mean + off).ravel())))
        return Table(
            "The paper's test set: its patterns at stiffnesses not trained on",
            ("model", *(f"RMSE {k} [mm]" for k in (1, 2, 3)), "Err [%]"),
            tuple(rows),
            f"{len(y)} samples, extensor at {', '.join(f'{p0:.1f}' for p0 in levels)} bar. The paper "
            "records such a set and prints no error on it.",
        )

    def _prediction(self, p0: float) -> dict[str, Recording]:
        found = {}
        for pattern in PATTERNS:
            for recording in self.runs.select(stage="prediction", p0=p0, driven=pattern):
                found[pattern] = recording
        return found

    def groups(self, name: str, p0: float) -> Mapping[str, tuple[float, float]]:
        """Return Err [%] and RMSE [mm] of groups a to l: pattern by output."""
        letters = iter(printed.PREDICTION)
        found = {}
        for recording in self._prediction(p0).values():
            off = self.errors(name, [recording])
            for k, output in enumerate(OUTPUTS):
                y = recording[output]
                found[next(letters)] = (err(y, y + off[:, k]), rms(off[:, k]))
        return found

    def _groups(self, p0: float) -> Iterator[Table]:
        scores = {name: self.groups(name, p0) for name in GROUPS}
        for place, what in enumerate(("Err [%]", "RMSE [mm]")):
            rows: list[tuple[Cell, ...]] = []
            for group, said in printed.PREDICTION.items():
                cells = [scores[name][group][place] for name in GROUPS]
                rows.append((group, said[place], said[2 + place], *cells))
            yield Table(
                f"Prediction along the patterns, extensor at {p0:g} bar, {what} (its Table 4)",
                ("group", "printed SDCHM", "printed raw network", *GROUPS),
                tuple(rows),
                "Groups: muscle 1, 2, 3 or all driven, by output 1, 2, 3; peaks of 1.4 bar. This "
                "stiffness is one of the validation set's.",
                Points(what, ("printed SDCHM", "printed raw network", *GROUPS)) if place else None,
            )

    def _figure_11(self, p0: float) -> Table:
        scores = {name: self.groups(name, p0) for name in GROUPS}
        rows: list[tuple[Cell, ...]] = [
            (group, *(scores[name][group][1] for name in GROUPS)) for group in printed.PREDICTION
        ]
        return Table(
            f"Prediction along the patterns, extensor at {p0:g} bar, RMSE [mm] (its Figure 11)",
            ("group", *GROUPS),
            tuple(rows),
            "This stiffness is one of the validation set's; the paper shows bars without figures.",
        )

    def summary(self) -> Iterator[str]:
        """Return what came out: first beside the training patterns, then along them."""
        joint = self.joint("test", "constant")
        moving = self.joint("test", "moving")
        test = self.runs.select("test", stage="network")
        best, limit = self.headline, self.off(LINEAR, joint)
        spans = np.ptp(measured(joint), axis=0)
        each = np.sqrt(np.mean(self.errors(best, joint) ** 2, axis=0))
        yield (
            f"All pressures random at once, test runs: {best}, chosen on validation runs, is off by "
            f"{self.off(best, joint):.2f} mm (at worst {100 * np.max(each / spans):.1f} % of a range) "
            f"with the extensor constant and by {self.off(best, moving):.2f} mm with it moving; a "
            f"linear function of the pressures by {limit:.2f} and {self.off(LINEAR, moving):.2f} mm."
        )
        failing = self.only_along_patterns
        if failing:
            told = ", ".join(f"{name} ({self.off(name, joint):.1f} mm)" for name in failing)
            verb = "is" if len(failing) == 1 else "are"
            yield (
                f"Only near the patterns trained on: {told} {verb} worse than that linear function "
                "with the extensor constant."
            )
        limit = self.off(LINEAR, moving)
        told = ", ".join(
            f"{name} ({self.off(name, moving):.1f} mm)"
            for name in self.names
            if name not in failing and self.off(name, moving) > limit
        )
        if told:
            yield f"Worse than it once the extensor moves: {told}."
        along = ", ".join(
            f"{name} {self.off(name, test):.2f} mm"
            for name in (RAW, DAMPED, PUBLISHED, OURS, BALANCE)
        )
        yield f"Along the paper's patterns, test set: {along}."
        yield self._against_raw(test)

    def _against_raw(self, test: list[Recording]) -> str:
        limit = self.off(LINEAR, test)
        sound = [name for name in (RAW, DAMPED) if self.off(name, test) < limit]
        if not sound:
            return (
                f"No raw network was fitted well enough to be compared with: on the test set none is "
                f"better than the linear function ({limit:.2f} mm)."
            )
        rival = min(sound, key=lambda name: self.off(name, test))
        base = self.off(rival, test)
        said = [
            f"{name} leaves {self.off(name, test) / base:.2f} times its error"
            for name in (PUBLISHED, OURS, BALANCE)
        ]
        return f"Beside the better raw network ({rival}) on that set, {', '.join(said)}."

    def figures(self) -> Iterator[Figure]:
        """Return joint test runs over time, and Figure 10."""
        for extensor in ("constant", "moving"):
            run = self.joint("test", extensor)[0]
            shown = {name: self.found(name, run) for name in (LINEAR, OURS, BALANCE)}
            curves = {run.origin: (thinned(run.time), thinned(run[OUTPUTS[0]]))}
            for name, found in shown.items():
                curves[name] = (thinned(run.time), thinned(found[OUTPUTS[0]]))
            title = f"All pressures random, extensor {extensor}: displacement 1"
            yield Figure(title, "time [s]", "displacement [mm]", curves)
        for pattern, run in self._prediction(TABLE_4).items():
            driven = f"pressure_{pattern[0]}"
            found_by = {name: self.found(name, run) for name in (PUBLISHED, RAW, OURS)}
            for output in OUTPUTS:
                curves = {run.origin: (thinned(run[driven]), thinned(run[output]))}
                for name, found in found_by.items():
                    curves[name] = (thinned(run[driven]), thinned(found[output]))
                said = f"Driven: {', '.join(pattern)}; {output.replace('_', ' ')} (its Figure 10)"
                yield Figure(said, "pressure [bar]", "displacement [mm]", curves)
