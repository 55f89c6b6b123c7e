"""Which recordings of a study are shown, each once, with what the models make of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mckibben.arrays import Array
from mckibben.diagnosis.coupling import coupling
from mckibben.recording import Recording

if TYPE_CHECKING:
    from mckibben.studying.study import Study

MOST_RECORDINGS = 6
"""Recordings with figures of their own; the others are named."""


@dataclass(frozen=True, eq=False)
class Shown:
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
    """Whether the recording has other outputs, which are shown apart."""

    @property
    def name(self) -> str:
        """What it is called where it is chosen."""
        return f"{self.recording.name}: {self.output}" if self.several else self.recording.name


def shown(study: Study) -> tuple[Shown, ...]:
    """Return all recordings of a study, those tested on first; of several outputs, each once for each.

    Where the last part of a recording is held out, the study holds its first part once more to fit;
    that is not repeated here.
    """
    board = study.leaderboard
    coupled = coupling([*study.train, *study.test], board.inputs, board.outputs)
    several = len(board.outputs) > 1
    ranked = [row.model for row in study.leaderboard.rows if row.model in study.predictions]
    n_train = len(study.train)
    parts = [_part_of(study, recording) for recording in study.test]
    found = []
    for index, (recording, part) in enumerate(zip(study.test, parts, strict=True)):
        role = "test" if part is None else "first part to fit, rest to test"
        start = None if part is None else len(study.train[part])
        for place, pair in enumerate(coupled.pairs([recording])):
            outputs = {m: study.predictions[m][n_train + index][:, place] for m in ranked}
            found.append(Shown(recording, *pair, outputs, role, start, several))
    for index, recording in enumerate(study.train):
        if index not in parts:
            for place, pair in enumerate(coupled.pairs([recording])):
                outputs = {model: study.predictions[model][index][:, place] for model in ranked}
                found.append(Shown(recording, *pair, outputs, "fit", None, several))
    return tuple(found)


def drawn(found: Sequence[Shown]) -> tuple[Shown, ...]:
    """Return those with figures of their own: recordings tested on first, then the longest."""
    by_weight = sorted(found, key=lambda one: (one.role == "fit", -len(one.recording)))
    return tuple(by_weight[:MOST_RECORDINGS])


def unique(found: Sequence[Shown]) -> tuple[Shown, ...]:
    """Return every recording once, whatever its outputs."""
    return tuple({id(one.recording): one for one in reversed(found)}.values())[::-1]


def _part_of(study: Study, whole: Recording) -> int | None:
    """Return which training recording is the first part of a test recording, or None."""
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
