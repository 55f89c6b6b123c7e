"""Recordings shown for a study, each once, with the outputs of the models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.equations import channel_symbols
from mckibben.diagnosis.coupling import coupling
from mckibben.errors import ModelError
from mckibben.recording import Recording
from mckibben.report.drawing import POINTS, Drawing
from mckibben.report.subjects import against

if TYPE_CHECKING:
    from mckibben.studying.study import Study

MOST_RECORDINGS = 6
"""Recordings with figures of their own; the others are named."""


@dataclass(frozen=True, eq=False)
class ModelledRun:
    """One recording and the models' free-running outputs on it.

    Parameters
    ----------
    recording : Recording
        Measured.
    input, output : str
        Channels.
    outputs : mapping of str to array, shape (n,)
        Model name to its output, the chosen model first.
    role : str
        What the recording was used for, in words.
    test_from : int or None
        First sample of the part held out for the test, where one recording serves for both.
    """

    recording: Recording
    input: str
    output: str
    outputs: Mapping[str, Array]
    role: str
    test_from: int | None = None
    several: bool = False
    """Whether the recording has other outputs, which are shown separately."""
    symbols: Mapping[str, str] = field(default_factory=dict)
    """Of channels, as in the equations of the model that is drawn."""

    @property
    def name(self) -> str:
        """Its name in the list of choices."""
        return f"{self.recording.name}: {self.output}" if self.several else self.recording.name

    def draw(self, kind: str, points: int = POINTS, models: int | None = None) -> Drawing:
        """Draw it with the outputs of models, or of the first few; see `subjects.against`."""
        outputs = dict(list(self.outputs.items())[:models])
        if not outputs:
            problem, remedy = "no model of this study worked", "see the reasons in its leaderboard"
            raise ModelError(problem, remedy=remedy)
        pair = self.input, self.output
        symbols = self.symbols if len(outputs) == 1 else None
        return against(kind, self.recording, pair, outputs, self.test_from, points, symbols)


def runs_of_study(study: Study) -> tuple[ModelledRun, ...]:
    """Return all recordings of a study, test recordings first; one per output.

    Where the last part of a recording is held out, the study holds its first part once more to fit;
    that is not repeated here.
    """
    board = study.leaderboard
    coupled = coupling([*study.train, *study.test], board.inputs, board.outputs)
    several = len(board.outputs) > 1
    ranked = [row.model for row in study.leaderboard.rows if row.model in study.predictions]
    chosen = next((row.block for row in board.rows if row.model in ranked[:1]), None)
    symbols = {} if chosen is None else channel_symbols(chosen)
    n_train = len(study.train)
    parts = [_part_of(study, recording) for recording in study.test]
    runs = [
        (n_train + place, run, "test", None)
        if part is None
        else (n_train + place, run, "first part to fit, rest to test", len(study.train[part]))
        for place, (run, part) in enumerate(zip(study.test, parts, strict=True))
    ]
    runs += [(k, run, "fit", None) for k, run in enumerate(study.train) if k not in parts]
    return tuple(
        ModelledRun(
            run,
            *pair,
            {model: study.predictions[model][place][:, column] for model in ranked},
            role,
            start,
            several,
            symbols,
        )
        for place, run, role, start in runs
        for column, pair in enumerate(coupled.pairs([run]))
    )


def runs_with_figures(runs: Sequence[ModelledRun]) -> tuple[ModelledRun, ...]:
    """Return those with figures: test recordings first, then the longest."""
    ordered = sorted(runs, key=lambda run: (run.role == "fit", -len(run.recording)))
    return tuple(ordered[:MOST_RECORDINGS])


def each_recording_once(runs: Sequence[ModelledRun]) -> tuple[ModelledRun, ...]:
    """Return every recording once, for all its outputs."""
    return tuple({id(run.recording): run for run in reversed(runs)}.values())[::-1]


def _part_of(study: Study, whole: Recording) -> int | None:
    """Return the training recording that is the first part of a test recording, or None."""
    for index, part in enumerate(study.train):
        n = len(part)
        if (
            n < len(whole)
            and part.name == whole.name
            and part.start_time == whole.start_time
            and all(
                np.array_equal(part[name], whole[name][:n])
                for name in (*study.leaderboard.inputs, *study.leaderboard.outputs)
            )
        ):
            return index
    return None
